//! `launch chaos`: kills, stops and restarts services of a live robot at random instants, and checks after each that the wheels stood in time, that the
//! set healed, that nothing was touched and that nothing is left behind.

mod plan;
mod report;
mod victims;
mod witness;

use crate::cli::ChaosArgs;
use crate::graph::{self, Checked};
use crate::summary;
use crate::supervise::Supervisor;
use crate::up::Signals;
use board::clock;
use board::tap::Tap;
use indicatif::{ProgressBar, ProgressStyle};
use messages::Time;
use plan::Plan;
use report::Report;
use rustix::event::{PollFd, PollFlags, poll};
use std::error::Error;
use std::io::IsTerminal as _;
use std::os::fd::AsFd as _;
use std::process::ExitCode;
use std::time::Duration;
use victims::Scene;

/// The set must be whole so long after the last deed.
const HEAL_LIMIT: Duration = Duration::from_secs(10);
/// How often the board is looked at.
const LOOK: Duration = Duration::from_millis(2);

/// `launch chaos`.
pub(crate) fn command(args: &ChaosArgs) -> ExitCode {
    let Some(graph) = graph::prepare(&args.which.request(args.board.as_deref())) else {
        return ExitCode::FAILURE;
    };
    match run(&graph, args) {
        Ok(report) => {
            if args.json {
                println!("{:#}", report.json());
            } else {
                print!("{}", report.text());
            }
            if report.is_sound() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(graph: &Checked, args: &ChaosArgs) -> Result<Report, Box<dyn Error>> {
    for swept in board::host::sweep_named(args.board.as_deref())? {
        eprintln!("{}", summary::swept(&swept));
    }
    let signals = Signals::catch()?;
    let board = args.board.as_deref().unwrap_or(&graph.name);
    let mut supervisor = Supervisor::new(graph, board, args.log_dir.as_deref(), false)?;
    let place = supervisor.host.place().clone();
    supervisor.start_all();
    while !supervisor.all_ready() {
        pause(&mut supervisor, LOOK);
        if let Some(failed) = supervisor.failed() {
            let role = failed.service.role.clone();
            let lines = supervisor.last_log_lines(&role, 8).join("\n  ");
            return Err(format!("`{role}` does not start:\n  {lines}").into());
        }
        if signals.count() > 0 {
            return Err("interrupted".into());
        }
    }
    let tap = Tap::join(place.clone(), "chaos")?;
    let mut scene = Scene::new(graph, &args.spare, tap, graph.seed)?;
    let mut report = hurt(&mut supervisor, &mut scene, args, graph.seed, &signals);
    drop(scene);
    supervisor.stop(&|| signals.count() > 1)?;
    report.left_behind = place.shared_memory().len() + usize::from(place.exists());
    Ok(report)
}

/// Does what the plan says, and looks what becomes of it.
fn hurt(
    supervisor: &mut Supervisor,
    scene: &mut Scene,
    args: &ChaosArgs,
    seed: u64,
    signals: &Signals,
) -> Report {
    let mut plan = Plan::new(seed, scene.victims());
    let bar = progress(args);
    let mut report = Report::new(seed, scene.victim_roles());
    let began = clock::monotonic();
    // The robot gets under way first.
    let mut due = began.after(Duration::from_secs(3));
    let mut deed = plan.next();
    let mut events = supervisor.event_count;
    while report.deeds < args.kills && signals.count() == 0 {
        step(supervisor, scene, &mut report);
        print_events(supervisor, &mut events, args.events);
        if supervisor.failed().is_some() {
            break;
        }
        let now = clock::monotonic();
        if now >= due && scene.hit(supervisor, &deed, now) {
            report.deed(&deed);
            deed = plan.next();
            due = now.after(deed.after);
            show(bar.as_ref(), &report, args, began);
        }
    }
    let end = clock::monotonic().after(HEAL_LIMIT);
    while (scene.has_open_wounds() || !supervisor.all_ready())
        && supervisor.failed().is_none()
        && clock::monotonic() < end
    {
        step(supervisor, scene, &mut report);
        print_events(supervisor, &mut events, args.events);
    }
    for role in scene.give_up() {
        report.unhealed.push(role);
    }
    report.took_s = clock::monotonic().seconds_since(began);
    report.contacts = scene.contacts();
    report.way_m = scene.way_m();
    report.deliveries = scene.deliveries();
    report.interrupted = signals.count() > 0;
    report.given_up = supervisor.failed().map(|service| {
        let role = service.service.role.clone();
        let line = supervisor.last_log_lines(&role, 1).pop().unwrap_or_default();
        format!("{role}: {line}")
    });
    if let Some(bar) = bar {
        bar.finish_and_clear();
    }
    report
}

fn step(supervisor: &mut Supervisor, scene: &mut Scene, report: &mut Report) {
    pause(supervisor, LOOK);
    let now = clock::monotonic();
    scene.look(supervisor, now);
    scene.keep_it_busy(now);
    for verdict in scene.close_wounds(now) {
        report.verdict(verdict);
    }
}

/// Looks after the services, at once when one of them dies.
fn pause(supervisor: &mut Supervisor, length: Duration) {
    let length = length.min(supervisor.next_due(clock::monotonic()));
    let timeout = rustix::time::Timespec { tv_sec: 0, tv_nsec: i64::from(length.subsec_nanos()) };
    let mut descriptors: Vec<PollFd<'_>> =
        supervisor.descriptors().map(|fd| PollFd::from_borrowed_fd(fd.as_fd(), PollFlags::IN)).collect();
    let _ = poll(&mut descriptors, Some(&timeout));
    drop(descriptors);
    supervisor.tick();
}

fn print_events(supervisor: &Supervisor, printed: &mut usize, wanted: bool) {
    let new = supervisor.event_count - *printed;
    *printed = supervisor.event_count;
    if !wanted {
        return;
    }
    let kept = supervisor.events.len();
    for event in supervisor.events.iter().skip(kept.saturating_sub(new)) {
        eprintln!("[{:>9.3}] {}: {}", event.at_s, event.role, event.text);
    }
}

fn progress(args: &ChaosArgs) -> Option<ProgressBar> {
    let bar = std::io::stderr().is_terminal().then(|| ProgressBar::new(args.kills));
    let style = ProgressStyle::with_template("{bar:32} {pos} of {len}, {msg}, {eta} to go");
    if let (Some(bar), Ok(style)) = (&bar, style) {
        bar.set_style(style);
    }
    bar
}

fn show(bar: Option<&ProgressBar>, report: &Report, args: &ChaosArgs, began: Time) {
    let message = format!("{} wrong", report.wrong());
    match bar {
        Some(bar) => {
            bar.set_message(message);
            bar.set_position(report.deeds);
        }
        None if report.deeds.is_multiple_of(args.kills.div_ceil(20).max(1)) => {
            let took_s = clock::monotonic().seconds_since(began);
            eprintln!("[{took_s:>8.1}] {} of {}, {message}", report.deeds, args.kills);
        }
        None => {}
    }
}
