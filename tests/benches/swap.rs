//! What a swap costs a robot that drives: controller, planner and localiser, a hundred times.
//! `cargo bench -p tests --bench swap`

use board::clock;
use board::place::Place;
use board::tap::Tap;
use messages::{AppliedWheels, DriveReasonName, Time, View};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tests::Graph;

const SWAPS: usize = 100;
const PERIOD_MS: f64 = 50.0;
/// What is swapped for what: another algorithm, and the same service started anew, as after an update.
const SWAPPED: [(&str, &str); 5] = [
    ("controller", "window-controller"),
    ("planner", "grid-planner"),
    ("localiser", "tag-localiser"),
    ("controller", "fuzzy-controller"),
    ("localiser", "tag-localiser"),
];

fn main() {
    let mut seen = Seen::default();
    let mut hand_over_gaps_ms = Vec::new();
    let mut done = 0;
    while done < SWAPS {
        let graph = Graph::load("coffee").set("referee.time_limit_s", 600.0).start();
        graph.wait_for("wheels/applied", |applied| applied["reason"] == "Driving", Duration::from_secs(60));
        let (place, ending) = (graph.place().clone(), Arc::new(AtomicBool::new(false)));
        let end = Arc::clone(&ending);
        // Beside the swaps, so that no message is overwritten before it is read.
        let watch = std::thread::spawn(move || watch(place, &end));
        while done < SWAPS
            && board::host::living_launcher(graph.place()).is_ok_and(|launcher| launcher.is_some())
        {
            let (role, binary) = SWAPPED[done % SWAPPED.len()];
            let Some(swap) = graph.try_swap(role, binary) else { break };
            hand_over_gaps_ms.extend(swap["done"]["gap_ms"].as_f64());
            done += 1;
            clock::sleep(Duration::from_millis(200));
        }
        ending.store(true, Ordering::Release);
        let more = watch.join().unwrap_or_default();
        seen.gaps_ms.extend(more.gaps_ms);
        seen.stops += more.stops;
        seen.lost += more.lost;
    }
    seen.gaps_ms.sort_by(f64::total_cmp);
    hand_over_gaps_ms.sort_by(f64::total_cmp);
    let largest = |gaps: &[f64]| gaps.last().copied().unwrap_or(f64::NAN);
    let median = |gaps: &[f64]| gaps.get(gaps.len() / 2).copied().unwrap_or(f64::NAN);
    println!("{done} swaps of controller, planner and localiser while the robot drives");
    println!(
        "between two commands: median {:.1} ms, largest {:.1} ms, {:.2} x the period ({} commands, {} not seen)",
        median(&seen.gaps_ms),
        largest(&seen.gaps_ms),
        largest(&seen.gaps_ms) / PERIOD_MS,
        seen.gaps_ms.len(),
        seen.lost
    );
    println!(
        "from the last message of the old to the first of the new one: median {:.1} ms, largest {:.1} ms",
        median(&hand_over_gaps_ms),
        largest(&hand_over_gaps_ms)
    );
    println!("wheel commands that were stopped because something was late: {}", seen.stops);
}

/// What was seen of the commands.
#[derive(Debug, Default)]
struct Seen {
    gaps_ms: Vec<f64>,
    stops: usize,
    lost: u64,
}

fn watch(place: Place, ending: &AtomicBool) -> Seen {
    let mut seen = Seen::default();
    let Ok(tap) = Tap::join(place, "watch") else { return seen };
    let (Ok(mut commands), Ok(mut applied)) = (tap.reader("wheels/desired"), tap.reader("wheels/applied"))
    else {
        return seen;
    };
    let mut last: Option<Time> = None;
    while !ending.load(Ordering::Acquire) {
        let heard = tap.bell();
        while let Some((envelope, _)) = commands.next() {
            let stamp = Time::from_nanos(envelope.stamp_ns);
            if let Some(last) = last {
                seen.gaps_ms.push(stamp.seconds_since(last) * 1e3);
            }
            last = Some(stamp);
        }
        while let Some((_, bytes)) = applied.next() {
            let view = View::<AppliedWheels>::parse(bytes).ok();
            let reason = view.and_then(|view| view.message.reason.get().ok());
            let late = matches!(reason, Some(DriveReasonName::StaleCommand | DriveReasonName::StaleGuard));
            seen.stops += usize::from(late);
        }
        tap.wait(heard, Duration::from_millis(20));
    }
    seen.lost = commands.lost();
    seen
}
