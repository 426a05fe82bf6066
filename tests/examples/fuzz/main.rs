//! Damaged files of every kind that people give to the product, made of valid ones, and what becomes of them:
//! `cargo run --release -p tests --example fuzz -- --kind map-yaml --files 20000 --seed 1`.
//!
//! Readers may refuse a file; they may not panic, think for more than ten seconds of processor time, or take
//! more than a gigabyte. A file that makes them is kept, and said. Files depend on nothing but kind, seed and
//! number: `--first N --files 1` makes that of number N again. The kinds `graph`, `params` and `experiment`
//! ask the binaries of a release build; all others are read in a process of their own, which is started again
//! when a file ends it.
#![allow(clippy::print_stdout, clippy::unwrap_used, clippy::panic, reason = "a program for the workbench")]

mod kinds;
mod mutate;
mod seeds;
mod worker;

use clap::{Parser, ValueEnum as _};
use kinds::Kind;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::Duration;

/// Damaged files of every kind, and what becomes of them
#[derive(Debug, Parser)]
struct Args {
    /// What the files are; all kinds one after the other without
    #[arg(long, value_enum)]
    kind: Option<Kind>,
    /// How many files of a kind
    #[arg(long, default_value_t = 1000)]
    files: u64,
    /// The seed from which all files come
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The number of the first file
    #[arg(long, default_value_t = 0)]
    first: u64,
    /// Where the files go that were too much
    #[arg(long, value_name = "DIR", default_value = "fuzz-found")]
    keep: PathBuf,
    /// Read the files here, a line each: what the program starts itself with
    #[arg(long, hide = true)]
    work: bool,
}

fn main() -> ExitCode {
    let args = Args::parse();
    if args.work {
        worker::work(args.kind.unwrap(), args.seed, args.first..args.first + args.files);
        return ExitCode::SUCCESS;
    }
    let kinds: Vec<Kind> = args.kind.map_or_else(|| Kind::value_variants().to_vec(), |kind| vec![kind]);
    let mut found = 0;
    for kind in kinds {
        let tally = fuzz(kind, &args);
        println!("{tally}");
        found += tally.found.len();
    }
    if found == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// What became of the files of a kind.
#[derive(Debug)]
struct Tally {
    kind: Kind,
    accepted: u64,
    refused: u64,
    /// The number of each file that was too much, and why.
    found: Vec<(u64, String)>,
    /// The longest that a file took, of processor time and by the clock on the wall, and which.
    slowest: (Duration, u64),
    longest: (Duration, u64),
    /// The most memory that the readers had, and with which file they first had it.
    largest_kib: (u64, u64),
}

impl std::fmt::Display for Tally {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let name = self.kind.name();
        let count = self.accepted + self.refused + self.found.len() as u64;
        let Self { accepted, refused, slowest, longest, largest_kib, .. } = self;
        write!(f, "{name}: {count} files, {accepted} read, {refused} refused, {} found; ", self.found.len())?;
        write!(f, "slowest {:.2} s of processor time (file {}), ", slowest.0.as_secs_f64(), slowest.1)?;
        write!(f, "{:.2} s on the wall (file {})", longest.0.as_secs_f64(), longest.1)?;
        if largest_kib.0 > 0 {
            write!(f, "; {} MB at most (file {})", largest_kib.0 / 1000, largest_kib.1)?;
        }
        for (number, why) in &self.found {
            write!(f, "\n  file {number}: {why}")?;
        }
        Ok(())
    }
}

fn fuzz(kind: Kind, args: &Args) -> Tally {
    let mut tally = Tally {
        kind,
        accepted: 0,
        refused: 0,
        found: Vec::new(),
        slowest: (Duration::ZERO, 0),
        longest: (Duration::ZERO, 0),
        largest_kib: (0, 0),
    };
    let end = args.first + args.files;
    let mut next = args.first;
    while next < end {
        next = run_worker(kind, args, next..end, &mut tally);
    }
    for (number, why) in &mut tally.found {
        let path = keep(kind, args.seed, *number, &args.keep);
        *why += &format!("; kept as {}", path.display());
    }
    tally
}

/// Lets one process read files until it ends, and returns the number of the file to go on with.
fn run_worker(kind: Kind, args: &Args, numbers: std::ops::Range<u64>, tally: &mut Tally) -> u64 {
    // What one leaves behind that crashes goes with it.
    let scratch = tempfile::tempdir().unwrap();
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.env("TMPDIR", scratch.path());
    command.args(["--work", "--kind", &kind.name(), "--seed", &args.seed.to_string()]);
    command.args(["--first", &numbers.start.to_string()]);
    command.args(["--files", &(numbers.end - numbers.start).to_string()]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let errors = child.stderr.take().unwrap();
    // The last words of one that crashes.
    let errors = std::thread::spawn(move || {
        let lines = BufReader::new(errors).lines().map_while(Result::ok);
        lines.fold(String::new(), |last, line| if line.trim().is_empty() { last } else { line })
    });
    let mut next = numbers.start;
    for line in BufReader::new(child.stdout.take().unwrap()).lines().map_while(Result::ok) {
        let report = worker::Report::parse(&line).unwrap_or_else(|| panic!("the worker says {line:?}"));
        next = report.number + 1;
        match report.verdict {
            Ok(true) => tally.accepted += 1,
            Ok(false) => tally.refused += 1,
            Err(why) => tally.found.push((report.number, why)),
        }
        tally.slowest = tally.slowest.max((report.used, report.number));
        tally.longest = tally.longest.max((report.passed, report.number));
        if report.peak_kib > tally.largest_kib.0 {
            tally.largest_kib = (report.peak_kib, report.number);
        }
    }
    let status = child.wait().unwrap();
    let last_words = errors.join().unwrap();
    if next < numbers.end && !status.success() && status.code() != Some(worker::TOO_LONG) {
        tally.found.push((next, format!("ended the reader ({status}): {last_words}")));
        next += 1;
    } else {
        assert!(next == numbers.end || !status.success(), "the worker leaves too early");
    }
    next
}

/// Writes a file that was too much to where it can be looked at.
fn keep(kind: Kind, seed: u64, number: u64, folder: &Path) -> PathBuf {
    std::fs::create_dir_all(folder).unwrap();
    let scratch = tempfile::tempdir().unwrap();
    let bytes = worker::Files::new(kind, seed, scratch.path()).file(number).0;
    let path = folder.join(format!("{}-{seed}-{number}", kind.name()));
    std::fs::write(&path, bytes).unwrap();
    path
}
