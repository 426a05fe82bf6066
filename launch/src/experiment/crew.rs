//! Runs as child processes, as many at once as there are places, each on a processor of its own.

use super::plan::Run;
use super::store::{Outcome, Record};
use crate::console::warn;
use board::clock;
use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::Read as _;
use std::os::fd::OwnedFd;
use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Sender};
use std::sync::{
    Mutex, PoisonError,
    atomic::{AtomicBool, Ordering},
};
use std::time::Duration;

/// Between two looks at a child: a run lasts a second or more.
const LOOK: Duration = Duration::from_millis(10);
/// A child that was asked to leave has so long before it is killed.
const LEAVE_WITHIN: Duration = Duration::from_secs(5);
/// A run that cannot start is tried so often.
const TRIES: usize = 3;
/// No run takes as long as this; one that does hangs.
const HANGS_AFTER: Duration = Duration::from_secs(1800);

/// What all runs have in common.
#[derive(Debug)]
pub(super) struct Crew {
    /// The launcher itself.
    pub(super) launcher: PathBuf,
    /// The graph's name or path.
    pub(super) graph: String,
    /// A processor for each place.
    pub(super) processors: Vec<usize>,
}

/// A run to be done: its place in the plan, its key, the name of its variant.
#[derive(Debug, Clone)]
pub(super) struct Job {
    pub(super) key: String,
    pub(super) variant: String,
    pub(super) run: Run,
}

impl Crew {
    /// Does the jobs and hands each record to `done` as it comes. `wants_to_stop` is asked often; when it says so, no job is begun, and
    /// those under way are ended without a record.
    pub(super) fn work<E>(
        &self,
        jobs: Vec<Job>,
        wants_to_stop: impl Fn() -> bool,
        mut done: impl FnMut(Record) -> Result<(), E>,
    ) -> Result<(), E> {
        let (queue, stop) = (Mutex::new(VecDeque::from(jobs)), AtomicBool::new(false));
        let (sender, receiver) = mpsc::channel();
        std::thread::scope(|scope| {
            for (place, &processor) in self.processors.iter().enumerate() {
                let (sender, queue, stop) = (sender.clone(), &queue, &stop);
                let work = move || self.place(place, processor, queue, stop, &sender);
                if let Err(error) = std::thread::Builder::new().spawn_scoped(scope, work) {
                    warn(&format!("place {place} is not used: no thread can be started: {error}"));
                    // Those that were started do the rest; without any there is nobody to wait for.
                    break;
                }
            }
            drop(sender);
            let mut outcome = Ok(());
            loop {
                match receiver.recv_timeout(Duration::from_millis(50)) {
                    Ok(record) if outcome.is_ok() => {
                        outcome = done(record);
                    }
                    Ok(_) | Err(mpsc::RecvTimeoutError::Timeout) => {}
                    Err(mpsc::RecvTimeoutError::Disconnected) => return outcome,
                }
                if wants_to_stop() || outcome.is_err() {
                    stop.store(true, Ordering::Release);
                }
            }
        })
    }

    fn place(
        &self,
        place: usize,
        processor: usize,
        queue: &Mutex<VecDeque<Job>>,
        stop: &AtomicBool,
        records: &Sender<Record>,
    ) {
        // Boards of two experiments on one machine must not meet.
        let board = format!("experiment-{}-{place}", std::process::id());
        while !stop.load(Ordering::Acquire) {
            let Some(job) = queue.lock().unwrap_or_else(PoisonError::into_inner).pop_front() else { return };
            let mut tries = 0;
            let record = loop {
                let mut command = self.command(&job.run, &board, processor);
                let began = clock::monotonic();
                let ended = run_child(&mut command, stop);
                let wall_s = clock::monotonic().seconds_since(began);
                if stop.load(Ordering::Acquire) {
                    return;
                }
                tries += 1;
                let record = record(job.clone(), wall_s, ended);
                // The variant was checked, so what cannot start is a machine with too much else to do.
                if record.outcome != Outcome::Error || tries == TRIES {
                    break record;
                }
            };
            if records.send(record).is_err() {
                return;
            }
        }
    }

    fn command(&self, run: &Run, board: &str, processor: usize) -> Command {
        let mut command = Command::new(&self.launcher);
        command.args([
            "up",
            &self.graph,
            "--lockstep",
            "--json",
            "--no-build",
            "--no-view",
            "--board",
            board,
        ]);
        command.args(["--cpu", &processor.to_string(), "--until", &run.limit_s.to_string()]);
        let options = [
            ("--set", &run.overrides.set),
            ("--swap", &run.overrides.swap),
            ("--without", &run.overrides.without),
        ];
        for (option, values) in options {
            command.args(values.iter().flat_map(|value| [option, value.as_str()]));
        }
        command.args(run.overrides.seed.iter().flat_map(|seed| ["--seed".to_owned(), seed.to_string()]));
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // The terminal's Ctrl-C reaches the experiment, which ends its runs in order.
        command.process_group(0);
        command
    }
}

/// How a child ended, and what it said.
#[derive(Debug)]
pub(super) struct Ended {
    pub(super) status: Option<ExitStatus>,
    pub(super) stdout: String,
    pub(super) stderr: String,
}

fn run_child(command: &mut Command, stop: &AtomicBool) -> Ended {
    let mut child = match command.spawn() {
        Ok(child) => child,
        Err(error) => {
            return Ended { status: None, stdout: String::new(), stderr: error.to_string() };
        }
    };
    let pipes = [child.stdout.take().map(OwnedFd::from), child.stderr.take().map(OwnedFd::from)];
    std::thread::scope(|scope| {
        let begin = |pipe| std::thread::Builder::new().spawn_scoped(scope, || text_of(pipe));
        let readers = pipes.map(begin);
        if readers.iter().any(Result::is_err) {
            // It would wait for ever for somebody who reads what it says.
            let _ = child.kill();
        }
        let status = wait_for(&mut child, stop);
        let [stdout, stderr] = readers.map(|reader| match reader {
            Ok(reader) => reader.join().unwrap_or_default(),
            Err(error) => format!("no thread can be started: {error}"),
        });
        Ended { status, stdout, stderr }
    })
}

fn text_of(pipe: Option<OwnedFd>) -> String {
    let mut bytes = Vec::new();
    // What was read before an error is still worth a look.
    let _ = pipe.map(|pipe| File::from(pipe).read_to_end(&mut bytes));
    String::from_utf8_lossy(&bytes).into_owned()
}

fn wait_for(child: &mut Child, stop: &AtomicBool) -> Option<ExitStatus> {
    let began = clock::monotonic();
    let mut asked = None;
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) => {}
            Err(_) => return None,
        }
        let now = clock::monotonic();
        match asked {
            None if stop.load(Ordering::Acquire) || now.since(began) > HANGS_AFTER => {
                asked = Some(now);
                let pid = i32::try_from(child.id()).ok().and_then(rustix::process::Pid::from_raw);
                // The child was not waited for yet, so its number is still its own.
                let _ = pid.map(|pid| rustix::process::kill_process(pid, rustix::process::Signal::INT));
            }
            Some(since) if now.since(since) > LEAVE_WITHIN => {
                let _ = child.kill();
                return child.wait().ok();
            }
            _ => {}
        }
        clock::sleep(LOOK);
    }
}

/// What a child's last words mean.
pub(super) fn record(job: Job, wall_s: f64, ended: Ended) -> Record {
    let Job { key, variant, run } = job;
    let mut record = Record {
        key,
        variant,
        situation: run.situation,
        seed: run.seed,
        outcome: Outcome::Error,
        remark: String::new(),
        logical_s: 0.0,
        wall_s,
        figures: BTreeMap::new(),
        digest: String::new(),
    };
    let said = ended.stdout.lines().rev().find_map(|line| {
        let value: serde_json::Value = serde_json::from_str(line).ok()?;
        value.get("digest")?;
        Some(value)
    });
    let Some(said) = said else {
        // The first error says why, the last line only that there was one.
        let mut lines = ended.stderr.lines().filter(|line| !line.trim().is_empty());
        let complaint = lines.clone().find(|line| line.starts_with("error")).or_else(|| lines.next_back());
        record.remark = complaint.unwrap_or("it said nothing").trim().to_owned();
        return record;
    };
    let word = &said["run"];
    record.outcome = match (word["passed"].as_bool(), ended.status.and_then(|status| status.code())) {
        (Some(true), _) => Outcome::Passed,
        (_, Some(0)) => Outcome::Unfinished,
        (Some(false), Some(_)) => Outcome::Failed,
        _ => Outcome::Error,
    };
    record.remark = word["remark"].as_str().unwrap_or_default().to_owned();
    record.logical_s = said["logical_s"].as_f64().unwrap_or_default();
    record.digest = said["digest"]["digest"].as_str().unwrap_or_default().to_owned();
    let figures = word["figures"].as_object().into_iter().flatten();
    record.figures = figures.filter_map(|(name, value)| Some((name.clone(), value.as_f64()?))).collect();
    record
}
