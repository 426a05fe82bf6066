//! `board rate` and `board delay`: how often messages come, and how old they are when they do.

use crate::connect::{self, Watch};
use crate::{Common, EXIT_TIMEOUT, Outcome, show};
use board::tap::{Tap, TapReader, now};
use board::{arguments, clock};
use messages::Time;
use serde_json::{Value, json};
use std::io::{self, IsTerminal as _};
use std::process::ExitCode;
use std::time::Duration;

#[derive(Debug, clap::Args)]
pub(crate) struct RateOptions {
    /// The topics; without any, all.
    topics: Vec<String>,
    /// Seconds between two reports.
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = arguments::seconds)]
    interval: Duration,
    /// End after this many reports.
    #[arg(short = 'n', long, value_name = "N")]
    count: Option<u64>,
}

#[derive(Debug, clap::Args)]
pub(crate) struct DelayOptions {
    /// The topic.
    topic: String,
    /// Seconds between two reports.
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = arguments::seconds)]
    interval: Duration,
    /// End after this many messages.
    #[arg(short = 'n', long, value_name = "N")]
    count: Option<u64>,
    /// End after this many seconds without a message, with exit code 3.
    #[arg(long, value_name = "SECONDS", value_parser = arguments::seconds)]
    timeout: Option<Duration>,
}

/// Longest sleep: how soon an interrupt is noticed.
const LOOK: Duration = Duration::from_millis(200);

/// What was seen of a topic since the last report.
#[derive(Debug, Default)]
struct Periods {
    last: Option<(u64, u64)>,
    messages: u64,
    lost: u64,
    periods_ns: Vec<f64>,
}

impl Periods {
    fn add(&mut self, stamp_ns: u64, sequence: u64) {
        self.messages += 1;
        if let Some((last_stamp_ns, last_sequence)) = self.last {
            match sequence.checked_sub(last_sequence) {
                // Over a gap there is no period to measure.
                Some(1) => self.periods_ns.push(stamp_ns.saturating_sub(last_stamp_ns) as f64),
                Some(gap) if gap > 1 => self.lost += gap - 1,
                _ => {}
            }
        }
        self.last = Some((stamp_ns, sequence));
    }

    /// Mean, least, greatest and standard deviation of the periods.
    fn statistics(&self) -> Option<[f64; 4]> {
        let count = self.periods_ns.len() as f64;
        if count == 0.0 {
            return None;
        }
        let mean = self.periods_ns.iter().sum::<f64>() / count;
        let variance = self.periods_ns.iter().map(|period| (period - mean).powi(2)).sum::<f64>() / count;
        let least = self.periods_ns.iter().copied().fold(f64::INFINITY, f64::min);
        let greatest = self.periods_ns.iter().copied().fold(0.0, f64::max);
        Some([mean, least, greatest, variance.sqrt()])
    }
}

struct Watched {
    name: String,
    reader: TapReader,
    periods: Periods,
}

pub(crate) fn run(common: &Common, options: &RateOptions) -> Outcome {
    let place = connect::choose(common)?;
    let mut ending = Watch::begin(place.clone())?;
    let tap = connect::join(&place)?;
    let names: Vec<String> = if options.topics.is_empty() {
        tap.manifest().topics.iter().map(|topic| topic.name.clone()).collect()
    } else {
        options.topics.clone()
    };
    let mut watched = Vec::with_capacity(names.len());
    for name in names {
        connect::topic(tap.manifest(), &name)?;
        let reader = tap.reader(&name)?;
        watched.push(Watched { name, reader, periods: Periods::default() });
    }
    // The last message is served to us at once, and says nothing about the rate.
    tap.wait(tap.bell(), Duration::from_millis(20));
    for topic in &mut watched {
        while let Some((envelope, _)) = topic.reader.next() {
            topic.periods.last = Some((envelope.stamp_ns, envelope.sequence));
        }
    }
    let mut reports = 0;
    let mut shown_lines = 0;
    while options.count.is_none_or(|count| reports < count) {
        let since = clock::monotonic();
        let whole = watch(&tap, &mut watched, since.after(options.interval), &mut ending)?;
        let passed_s = clock::monotonic().seconds_since(since);
        if !whole && reports > 0 {
            break;
        }
        shown_lines = report_rates(common, &mut watched, passed_s, shown_lines)?;
        reports += 1;
        if !whole {
            break;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Takes messages in until the deadline; false when the command is to end before it.
fn watch(tap: &Tap, watched: &mut [Watched], deadline: Time, ending: &mut Watch) -> io::Result<bool> {
    loop {
        let heard = tap.bell();
        for topic in watched.iter_mut() {
            while let Some((envelope, _)) = topic.reader.next() {
                topic.periods.add(envelope.stamp_ns, envelope.sequence);
            }
        }
        let now = clock::monotonic();
        if ending.end_said()?.is_some() {
            return Ok(false);
        }
        if now >= deadline {
            return Ok(true);
        }
        tap.wait(heard, deadline.since(now).min(LOOK));
    }
}

fn report_rates(
    common: &Common,
    watched: &mut [Watched],
    passed_s: f64,
    shown_lines: usize,
) -> io::Result<usize> {
    let mut table = show::table(&["topic", "rate", "mean period", "least", "greatest", "jitter", "lost"]);
    let mut all = Vec::new();
    for topic in watched.iter_mut() {
        let periods = std::mem::take(&mut topic.periods);
        topic.periods.last = periods.last;
        let statistics = periods.statistics();
        let rate_hz = (periods.messages + periods.lost) as f64 / passed_s;
        let named = |index: usize| statistics.map(|values| values[index]);
        all.push(json!({
            "topic": topic.name, "rate_hz": rate_hz, "messages": periods.messages, "lost": periods.lost,
            "period_mean_ns": named(0), "period_min_ns": named(1), "period_max_ns": named(2), "jitter_ns": named(3),
        }));
        let shown = |index: usize| named(index).map_or("-".to_owned(), show::duration);
        table.add_row([
            show::harmless(&topic.name),
            if rate_hz > 0.0 { format!("{} Hz", show::three(rate_hz)) } else { "-".into() },
            shown(0),
            shown(1),
            shown(2),
            shown(3),
            if periods.lost > 0 { periods.lost.to_string() } else { "-".into() },
        ]);
    }
    if common.json {
        show::json(&Value::from(all))?;
        return Ok(0);
    }
    let text = table.trim_fmt();
    // Over the last report, where there is a screen to write on.
    if shown_lines > 0 && io::stdout().is_terminal() {
        show::line(&format!("\x1b[{shown_lines}A\x1b[J{text}"))?;
    } else {
        show::line(&text)?;
    }
    Ok(text.lines().count())
}

pub(crate) fn run_delay(common: &Common, options: &DelayOptions) -> Outcome {
    let place = connect::choose(common)?;
    let mut watch = Watch::begin(place.clone())?;
    let tap = connect::join(&place)?;
    let (index, _) = connect::topic(tap.manifest(), &options.topic)?;
    let mut reader = tap.reader(&options.topic)?;
    // The last message has lain there for a while.
    tap.wait(tap.bell(), Duration::from_millis(20));
    while reader.next().is_some() {}
    let mut next_report = clock::monotonic().after(options.interval);
    let (mut published_ns, mut origin_ns) = (Vec::new(), Vec::new());
    let full = |seen: usize| options.count.is_some_and(|count| seen as u64 >= count);
    let mut code = ExitCode::SUCCESS;
    while !full(published_ns.len()) {
        if watch.end_said()?.is_some() {
            // Fewer than were asked for.
            code = if options.count.is_some() { ExitCode::FAILURE } else { ExitCode::SUCCESS };
            break;
        }
        let heard = tap.bell();
        while let Some((envelope, _)) = reader.next() {
            watch.heard();
            let now = now(tap.switchboard());
            published_ns.push(now.since(Time::from_nanos(envelope.stamp_ns)).as_nanos() as f64);
            origin_ns.push(now.since(Time::from_nanos(envelope.origin_ns)).as_nanos() as f64);
            if full(published_ns.len()) {
                break;
            }
        }
        let waited = watch.wait(|| connect::awaited(&tap, index));
        if options.timeout.is_some_and(|timeout| waited >= timeout) {
            code = ExitCode::from(EXIT_TIMEOUT);
            break;
        }
        let now = clock::monotonic();
        // With a number of messages given there is one report, at the end.
        if now >= next_report && options.count.is_none() {
            report_delays(common, &options.topic, &published_ns, &origin_ns)?;
            next_report = now.after(options.interval);
        }
        tap.wait(heard, next_report.since(now).clamp(Duration::from_millis(1), LOOK));
    }
    report_delays(common, &options.topic, &published_ns, &origin_ns)?;
    Ok(code)
}

fn report_delays(common: &Common, topic: &str, published_ns: &[f64], origin_ns: &[f64]) -> io::Result<()> {
    let quantiles = |values: &[f64]| -> Option<[f64; 4]> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        Some([0.5, 0.9, 0.99, 1.0].map(|share| sorted[(last as f64 * share).round() as usize]))
    };
    let (published, origin) = (quantiles(published_ns), quantiles(origin_ns));
    if common.json {
        let object = |values: Option<[f64; 4]>| {
            values.map(
                |[p50, p90, p99, max]| json!({ "p50_ns": p50, "p90_ns": p90, "p99_ns": p99, "max_ns": max }),
            )
        };
        return show::json(&json!({
            "topic": topic, "messages": published_ns.len(), "since_published": object(published),
            "since_origin": object(origin),
        }));
    }
    let mut table = show::table(&["age", "p50", "p90", "p99", "greatest"]);
    for (name, values) in [("since it was published", published), ("since its origin", origin)] {
        let mut row = vec![name.to_owned()];
        row.extend(values.map_or(vec!["-".to_owned(); 4], |values| values.map(show::duration).to_vec()));
        table.add_row(row);
    }
    let messages = show::count(published_ns.len(), "message");
    show::line(&format!("{messages} on {}\n{}", show::harmless(topic), table.trim_fmt()))
}
