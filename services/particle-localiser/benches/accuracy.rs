//! How often the localiser is right, and how far off: `cargo bench -p particle-localiser --bench accuracy`
//! (three minutes).
//!
//! Laser drives are localised on the map of their own even scans, from raw odometry, and judged by the
//! corrected poses. Logs that are not in `../shared/data` are left out; the drive in Málaga is part of the
//! repository. The sonar starts anywhere in an arena, and looks three times at most; in the third arena,
//! which repeats itself, it should know that it does not know.

#[path = "../tests/support/mod.rs"]
mod support;

use support::arenas::{arena, tally};
use support::{Drive, follow, found, load, malaga, recovered};

const SEEDS: u64 = 20;
const STARTS: usize = 40;
const ARENA_STARTS: u64 = 100;

fn main() {
    // `cargo test --benches` only wants to know that it starts.
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
    println!(
        "{:<14} {:>6} {:>10} {:>8} {:>9} {:>14} {:>16}",
        "drive", "scans", "median", "", "largest", "found in 10 m", "carried: found"
    );
    let (intel, freiburg) = (load("intel"), load("freiburg-079"));
    row("intel", intel.as_ref(), true, Some(10.0));
    row("freiburg-079", freiburg.as_ref(), true, Some(10.0));
    row("csail", load("csail").as_ref(), false, None);
    row("belgioioso", load("belgioioso").as_ref(), false, None);
    row("malaga", Some(&malaga()), true, Some(5.0));
    println!(
        "(medians and largest error: the worst of {SEEDS} seeds, 500 particles; of {STARTS} starts and carried robots each)"
    );
    println!(
        "\n{:<8} {:>6} {:>12} {:>6} {:>6} {:>20} {:>6}",
        "arena", "starts", "scans at most", "right", "wrong", "seen as ambiguous", "scans"
    );
    for (number, most_scans) in [(1, 3), (2, 3), (3, 3)] {
        let tally = tally(&arena(number), ARENA_STARTS, most_scans);
        println!(
            "{number:<8} {ARENA_STARTS:>6} {most_scans:>12} {:>6} {:>6} {:>20} {:>6.2}",
            tally.right,
            tally.wrong,
            tally.ambiguous,
            tally.scans as f64 / ARENA_STARTS as f64
        );
    }
}

fn row(name: &str, drive: Option<&Drive>, finds: bool, carried_m: Option<f64>) {
    let Some(drive) = drive else { return };
    let worst = follow(drive, SEEDS, f64::INFINITY);
    let of_starts = |right: usize| format!("{right} of {STARTS}");
    let starts = if finds { of_starts(found(drive, STARTS)) } else { "-".to_owned() };
    let carried = carried_m.map_or("-".to_owned(), |most_m| {
        format!("{} in {most_m:.0} m", of_starts(recovered(drive, STARTS as u64, most_m)))
    });
    println!(
        "{name:<14} {:>6} {:>8.4} m {:>4.2} deg {:>7.2} m {starts:>14} {carried:>18}",
        drive.looks.len(),
        worst.median_m,
        worst.median_deg,
        worst.farthest_m
    );
}
