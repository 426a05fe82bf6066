//! Messages that nobody meant, on every topic of a living robot:
//! `cargo run --release -p tests --example raw-messages -- --messages 2000000`.
//!
//! A third are random bytes of any length, a third numbers that nobody wants, a third true messages with a
//! few bits turned over. Services may ignore them; none may die, hang or take a gigabyte.
#![allow(clippy::print_stdout, clippy::unwrap_used, clippy::panic, reason = "a program for the workbench")]

use board::clock;
use board::tap::TapReader;
use clap::Parser;
use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use std::process::ExitCode;
use std::time::Duration;
use tests::{Graph, Running};

/// Who forges these decides that the run is over: the referee believes the truth and the mission, and the
/// launcher the referee.
const ENDS_THE_RUN: [&str; 4] = ["mission/status", "journey/status", "world/truth", "run/summary"];
/// So many on a topic before the services may breathe.
const AT_ONCE: u64 = 20;
/// Numbers that nobody wants.
const UNWANTED: [u64; 8] = [
    0x7ff8_0000_0000_0000,
    0x7ff0_0000_0000_0000,
    0xfff0_0000_0000_0000,
    u64::MAX,
    0,
    0x7e37_e43c_8800_759c,
    1,
    0x7fc0_0000_7f80_0000,
];

/// Messages that nobody meant, on every topic of a living robot
#[derive(Debug, Parser)]
struct Args {
    /// The graph
    #[arg(long, default_value = "coffee")]
    graph: String,
    /// How many, on all topics together
    #[arg(long, default_value_t = 100_000)]
    messages: u64,
    /// The seed from which all come
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

struct Topic {
    name: String,
    size: usize,
    reader: TapReader,
    last: Vec<u8>,
}

impl Topic {
    fn message(&mut self, chance: &mut Pcg64Mcg) -> Vec<u8> {
        while let Some((_, bytes)) = self.reader.next() {
            self.last = bytes.to_vec();
        }
        let length = match chance.random_range(0..3) {
            0 => self.size,
            1 => self.size + chance.random_range(0..400),
            _ => chance.random_range(1..300),
        };
        match chance.random_range(0..3) {
            0 => {
                let mut bytes = vec![0; length];
                chance.fill_bytes(&mut bytes);
                bytes
            }
            1 => {
                let words = (0..length.div_ceil(8)).map(|_| UNWANTED[chance.random_range(0..UNWANTED.len())]);
                words.flat_map(u64::to_le_bytes).take(length).collect()
            }
            _ => {
                let mut bytes = if self.last.is_empty() { vec![0; self.size] } else { self.last.clone() };
                for _ in 0..chance.random_range(1..8) {
                    let at = chance.random_range(0..bytes.len().max(1)).min(bytes.len().saturating_sub(1));
                    if let Some(byte) = bytes.get_mut(at) {
                        *byte ^= 1 << chance.random_range(0..8);
                    }
                }
                bytes
            }
        }
    }
}

/// The most memory that a process ever had, in KiB.
fn peak_kib(pid: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}

fn main() -> ExitCode {
    let args = Args::parse();
    let graph = Graph::load(&args.graph).set("referee.time_limit_s", 3600.0).without_recording();
    // Nobody asks for an end.
    let graph = graph.with(&["--stay"]).start();
    let before = graph.services();
    let manifest = board::manifest::Manifest::read(graph.place()).unwrap();
    let topics = manifest.topics.iter().filter(|topic| !ENDS_THE_RUN.contains(&topic.name.as_str()));
    let mut topics: Vec<Topic> = topics
        .map(|topic| Topic {
            name: topic.name.clone(),
            size: topic.message.size,
            reader: graph.reader(&topic.name),
            last: Vec::new(),
        })
        .collect();
    let mut chance = Pcg64Mcg::seed_from_u64(args.seed);
    let mut sent = 0;
    let began = clock::monotonic();
    while sent < args.messages {
        for topic in &mut topics {
            for _ in 0..AT_ONCE {
                let bytes = topic.message(&mut chance);
                graph.publish_bytes(&topic.name, &bytes);
                sent += 1;
            }
        }
        clock::sleep(Duration::from_millis(2));
    }
    // Whoever hangs is noticed by now.
    clock::sleep(Duration::from_secs(3));
    let seconds = clock::monotonic().seconds_since(began);
    println!("{sent} messages on {} topics of `{}` in {seconds:.0} s", topics.len(), args.graph);
    verdict(&graph, &before)
}

fn verdict(graph: &Running, before: &[(String, u32)]) -> ExitCode {
    let after = graph.services();
    let replaced: Vec<&str> =
        before.iter().filter(|service| !after.contains(service)).map(|(role, _)| role.as_str()).collect();
    let peaks = after.iter().map(|(role, pid)| (peak_kib(*pid), role));
    let (peak, role) = peaks.max().unwrap();
    println!("most memory: {:.0} MiB (`{role}`)", peak as f64 / 1024.0);
    if !replaced.is_empty() || peak > 1 << 20 {
        println!("died or hung: {}\n{}", replaced.join(", "), graph.output());
        return ExitCode::FAILURE;
    }
    println!("nobody died or hung");
    ExitCode::SUCCESS
}
