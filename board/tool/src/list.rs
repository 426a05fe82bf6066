//! `board list`: topics and services at a glance.

use crate::connect::{self, Life, Look, life, publisher_life};
use crate::{Common, Outcome, show};
use board::tap::now;
use board::{arguments, clock};
use messages::Time;
use serde_json::json;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Duration;

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// Show services instead: state, process, steps, heartbeat.
    #[arg(long)]
    services: bool,
    /// Seconds over which rates are measured.
    #[arg(long, value_name = "SECONDS", default_value = "0.5", value_parser = arguments::seconds)]
    sample: Duration,
}

pub(crate) fn run(common: &Common, options: &Options) -> Outcome {
    let look = connect::look(&connect::choose(common)?)?;
    if options.services {
        services(common, &look)?
    } else {
        topics(common, &look, options)?
    }
    Ok(ExitCode::SUCCESS)
}

fn topics(common: &Common, look: &Look, options: &Options) -> std::io::Result<()> {
    let page = &look.switchboard;
    let counts = || -> Vec<u64> {
        let count =
            |topic: usize| page.topic(topic as u32).map_or(0, |entry| entry.count.load(Ordering::Acquire));
        (0..look.manifest.topics.len()).map(count).collect()
    };
    let before = counts();
    let since = clock::monotonic();
    clock::sleep(options.sample);
    let after = counts();
    let passed_s = clock::monotonic().seconds_since(since).max(1e-6);
    let now = now(page);
    let colours = show::colours();
    let mut table = show::table(&["topic", "type", "publisher", "readers", "count", "rate", "age"]);
    let mut all = Vec::new();
    for (index, topic) in look.manifest.topics.iter().enumerate() {
        let life = publisher_life(page, index as u32);
        let stamp = page.topic(index as u32).map_or(0, |entry| entry.last_stamp_ns.load(Ordering::Relaxed));
        let age_ns = (after[index] > 0).then(|| now.since(Time::from_nanos(stamp)).as_nanos() as f64);
        let rate_hz = after[index].saturating_sub(before[index]) as f64 / passed_s;
        let tools = tools_reading(look, index as u32);
        all.push(json!({
            "topic": topic.name, "type": topic.message.name, "publisher": topic.publisher, "publisher_life": life,
            "readers": topic.readers, "tools": tools, "count": after[index], "rate_hz": rate_hz, "age_ns": age_ns,
        }));
        let readers = topic.readers.len();
        table.add_row([
            show::harmless(&topic.name),
            show::harmless(&topic.message.name),
            publisher(colours, topic.publisher.as_deref(), life),
            if tools == 0 {
                readers.to_string()
            } else {
                format!("{readers} + {}", show::count(tools, "tool"))
            },
            after[index].to_string(),
            if rate_hz > 0.0 { format!("{} Hz", show::three(rate_hz)) } else { "-".into() },
            age_ns.map_or("-".into(), show::duration),
        ]);
    }
    if common.json {
        return show::json(&all.into());
    }
    show::line(&table.trim_fmt())
}

pub(crate) fn publisher(colours: bool, name: Option<&str>, life: Life) -> String {
    match (name.map(show::harmless), life) {
        (Some(name), Life::Lives) => show::good(colours, &name),
        (Some(name), Life::Idle) => show::doubtful(colours, &format!("{name} (takes no steps)")),
        (Some(name), Life::Dead) => show::bad(colours, &format!("{name} (dead)")),
        (Some(name), Life::Absent) => show::doubtful(colours, &format!("{name} (not there)")),
        (None, _) => show::faint(colours, "(from outside)"),
    }
}

/// Tools that listen to a topic at this moment.
pub(crate) fn tools_reading(look: &Look, topic: u32) -> usize {
    let Some(entry) = look.switchboard.topic(topic) else { return 0 };
    let listens = |index: u32, is_service: u32| is_service == 0 && entry.wakes(index);
    look.switchboard
        .taken()
        .filter(|(index, slot)| {
            listens(*index, slot.is_service.load(Ordering::Relaxed)) && life(slot) != Life::Dead
        })
        .count()
}

fn services(common: &Common, look: &Look) -> std::io::Result<()> {
    let colours = show::colours();
    let now = clock::monotonic();
    let mut table = show::table(&["service", "state", "process", "steps", "in step for", "heartbeat"]);
    let mut all = Vec::new();
    for (slot_number, slot) in look.switchboard.taken() {
        let is_service = slot.is_service.load(Ordering::Relaxed) != 0;
        let (life, state) = (life(slot), format!("{:?}", slot.state()).to_lowercase());
        let pid = slot.pid.load(Ordering::Relaxed);
        let heartbeat_ns = slot.silence(now).map(|silence| silence.as_nanos() as f64);
        let in_step_ns = slot.in_step(now).map(|passed| passed.as_nanos() as f64);
        let steps = slot.steps.load(Ordering::Relaxed);
        all.push(json!({
            "service": slot.role(), "tool": !is_service, "slot": slot_number, "state": state, "life": life, "pid": pid,
            "steps": steps, "in_step_ns": in_step_ns, "heartbeat_age_ns": heartbeat_ns,
        }));
        let state = match life {
            Life::Lives => show::good(colours, &state),
            Life::Dead => show::bad(colours, "dead"),
            _ => show::doubtful(colours, &state),
        };
        table.add_row([
            // The page is everybody's to write on.
            format!("{}{}", show::harmless(&slot.role()), if is_service { "" } else { " (tool)" }),
            state,
            pid.to_string(),
            steps.to_string(),
            in_step_ns.map_or("-".into(), show::duration),
            heartbeat_ns.map_or("-".into(), show::duration),
        ]);
    }
    for name in &look.manifest.services {
        if all.iter().any(|row: &serde_json::Value| row["service"] == *name) {
            continue;
        }
        table.add_row([name.as_str(), &show::doubtful(colours, "not there"), "-", "-", "-", "-"]);
        all.push(json!({ "service": name, "tool": false, "life": Life::Absent }));
    }
    if common.json {
        return show::json(&all.into());
    }
    show::line(&table.trim_fmt())
}
