//! What a swap costs a robot that drives: controller, planner and localiser, a hundred times. `cargo bench -p tests --bench swap`

use board::clock;
use messages::{AppliedWheels, DriveReasonName, Time, View};
use std::time::Duration;
use tests::{Graph, Running};

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
    let mut command_gaps_ms = Vec::new();
    let mut hand_over_gaps_ms = Vec::new();
    let (mut done, mut stops) = (0, 0);
    while done < SWAPS {
        let graph = Graph::load("coffee").set("referee.time_limit_s", 600.0).start();
        graph.wait_for("wheels/applied", |applied| applied["reason"] == "Driving", Duration::from_secs(60));
        let mut commands = graph.reader("wheels/desired");
        let mut applied = graph.reader("wheels/applied");
        let mut last: Option<Time> = None;
        let mut drains = clock::monotonic();
        while done < SWAPS && still_runs(&graph) {
            let (role, binary) = SWAPPED[done % SWAPPED.len()];
            let Some(swap) = graph.try_swap(role, binary) else { break };
            if let Some(gap_ms) = swap["done"]["gap_ms"].as_f64() {
                hand_over_gaps_ms.push(gap_ms);
            }
            done += 1;
            drains = drains.after(Duration::from_millis(300));
            while clock::monotonic() < drains {
                while let Some((envelope, _)) = commands.next() {
                    let stamp = Time::from_nanos(envelope.stamp_ns);
                    if let Some(last) = last {
                        command_gaps_ms.push(stamp.seconds_since(last) * 1e3);
                    }
                    last = Some(stamp);
                }
                while let Some((_, bytes)) = applied.next() {
                    let reason = View::<AppliedWheels>::parse(bytes)
                        .ok()
                        .and_then(|view| view.message.reason.get().ok());
                    stops += usize::from(matches!(
                        reason,
                        Some(DriveReasonName::StaleCommand | DriveReasonName::StaleGuard)
                    ));
                }
                clock::sleep(Duration::from_millis(2));
            }
            drains = clock::monotonic();
        }
    }
    command_gaps_ms.sort_by(f64::total_cmp);
    hand_over_gaps_ms.sort_by(f64::total_cmp);
    let largest = |gaps: &[f64]| gaps.last().copied().unwrap_or(f64::NAN);
    println!("{done} swaps of controller, planner and localiser while the robot drives");
    println!(
        "between two commands: median {:.1} ms, largest {:.1} ms, {:.2} x the period",
        command_gaps_ms[command_gaps_ms.len() / 2],
        largest(&command_gaps_ms),
        largest(&command_gaps_ms) / PERIOD_MS
    );
    println!(
        "from the last message of the old to the first of the new one: median {:.1} ms, largest {:.1} ms",
        hand_over_gaps_ms[hand_over_gaps_ms.len() / 2],
        largest(&hand_over_gaps_ms)
    );
    println!("wheel commands that were stopped because something was late: {stops}");
}

fn still_runs(graph: &Running) -> bool {
    board::host::living_launcher(graph.place()).is_some()
}
