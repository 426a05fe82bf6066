//! What the coffee graph costs: time from `up` to all services ready, memory of each process, processor while
//! it waits for an order, and the speed of a delivery in logical time. `cargo bench -p tests`

use board::clock;
use std::process::Command;
use std::time::Duration;
use tests::{Graph, launcher};

const STARTS: usize = 10;
const PAIRS: usize = 9;
const IDLE: Duration = Duration::from_secs(10);

fn main() {
    let processors = std::thread::available_parallelism().map_or(0, usize::from);
    println!("coffee graph on {processors} processors");
    let mut ready_ms: Vec<f64> = (0..STARTS).map(|_| time_to_ready_ms()).collect();
    ready_ms.sort_by(f64::total_cmp);
    println!(
        "up to all services ready: median {:.0} ms, from {:.0} to {:.0} ms ({STARTS} starts)",
        ready_ms[STARTS / 2],
        ready_ms[0],
        ready_ms[STARTS - 1]
    );
    idle();
    let run = Graph::load("coffee").run_in_lockstep();
    let (logical_s, wall_s) = (number(&run["logical_s"]), number(&run["wall_s"]));
    println!(
        "a delivery in logical time: {logical_s:.1} s in {wall_s:.2} s, {:.0} x real time, {:.1} us a turn",
        logical_s / wall_s,
        wall_s / number(&run["turns"]) * 1e6
    );
    recording();
}

/// What it costs to record: runs with and without, in turns, by the clock.
fn recording() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("run.mcap");
    let (mut plain_s, mut recorded_s) = (Vec::new(), Vec::new());
    let (mut bytes, mut logical_s) = (0, f64::NAN);
    for _ in 0..PAIRS {
        plain_s.push(number(&Graph::load("coffee").run_in_lockstep()["wall_s"]));
        let _ = std::fs::remove_file(&file);
        let graph = Graph::load("coffee").with(&["--record", &file.display().to_string()]);
        let run = graph.run_in_lockstep();
        recorded_s.push(number(&run["wall_s"]));
        bytes = std::fs::metadata(&file).map_or(0, |found| found.len());
        logical_s = number(&run["logical_s"]);
    }
    let least = |times: &[f64]| times.iter().copied().fold(f64::INFINITY, f64::min);
    let mut ratios: Vec<f64> =
        recorded_s.iter().zip(&plain_s).map(|(recorded, plain)| recorded / plain).collect();
    ratios.sort_by(f64::total_cmp);
    println!(
        "recording: {:.3} times the duration without ({PAIRS} pairs, median; {:.3} of the shortest), {:.0} MB an hour",
        ratios[PAIRS / 2],
        least(&recorded_s) / least(&plain_s),
        bytes as f64 / logical_s * 3600.0 / 1e6
    );
}

/// As the launcher says: from the beginning of `up`, after the check, to the last service's first look at the
/// board; and the whole command before it.
fn time_to_ready_ms() -> f64 {
    let began = clock::monotonic();
    let graph = Graph::load("coffee").set("navigator.default_order", "").without_recording().start();
    let took_ms = clock::monotonic().seconds_since(began) * 1e3;
    graph.stop();
    took_ms
}

fn idle() {
    let graph = Graph::load("coffee").set("navigator.default_order", "").without_recording().start();
    clock::sleep(Duration::from_secs(2));
    let launcher_pid = graph.launcher_pid();
    let pids: Vec<u32> = graph.services().into_iter().map(|(_, pid)| pid).chain([launcher_pid]).collect();
    let before: f64 = pids.iter().map(|&pid| cpu_s(pid)).sum();
    clock::sleep(IDLE);
    let after: f64 = pids.iter().map(|&pid| cpu_s(pid)).sum();
    println!(
        "idle, waiting for an order: {:.1} % of one processor in all, launcher included",
        (after - before) / IDLE.as_secs_f64() * 100.0
    );
    let output = Command::new(launcher()).args(["ps", "--json", "--board", graph.board()]).output();
    let status: serde_json::Value =
        output.ok().and_then(|output| serde_json::from_slice(&output.stdout).ok()).unwrap_or_default();
    let mut total = 0.0;
    for service in status["services"].as_array().into_iter().flatten() {
        total += number(&service["memory_kib"]);
        println!("  {:20} {:>7} KiB", service["role"].as_str().unwrap_or_default(), service["memory_kib"]);
    }
    println!("  {:20} {total:>7} KiB of their own", "all services");
    graph.stop();
}

/// Processor time that a process has used, in seconds, from its run time in nanoseconds.
fn cpu_s(pid: u32) -> f64 {
    let text = std::fs::read_to_string(format!("/proc/{pid}/schedstat")).unwrap_or_default();
    text.split_whitespace().next().and_then(|word| word.parse::<f64>().ok()).unwrap_or(0.0) * 1e-9
}

fn number(value: &serde_json::Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}
