//! `launch experiment`: variants of a graph in the same situations, in lockstep, and what they differ in.
//!
//! The experiment file is spelt out into runs ([`plan`]); every variant is checked before the first run; a [`crew`] of child processes
//! does the runs; each is written to `runs.csv` at once ([`store`]), so that an interrupted experiment goes on where it was; tables
//! ([`report`]) and box plots ([`plot`]) say what came of it.

mod crew;
mod plan;
mod plot;
mod report;
mod statistics;
mod store;
#[cfg(test)]
mod tests;

use crate::cli::ExperimentArgs;
use crate::console::{say, say_line, warn};
use crate::graph::{self, Checked, Request};
use crate::signals::Signals;
use board::clock;
use crew::{Crew, Job};
use indicatif::{ProgressBar, ProgressStyle};
use plan::Plan;
use std::collections::HashMap;
use std::fs;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use store::{Outcome, Record, Store};

/// `launch experiment`. Fails when a variant is refused, a run could not be done, an expectation does not hold, or the person left early.
pub(crate) fn command(args: &ExperimentArgs) -> ExitCode {
    match conduct(args) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            warn(&format!("error: {error}"));
            ExitCode::FAILURE
        }
    }
}

fn conduct(args: &ExperimentArgs) -> Result<bool, Box<dyn std::error::Error>> {
    let plan = plan::read(&found(&args.file))?;
    let Some(keys) = checked_keys(&plan, !args.no_build) else { return Ok(false) };
    let processors = processors(args.jobs);
    if args.dry_run {
        print_plan(&plan, processors.len());
        return Ok(true);
    }
    let out = args.out.clone().unwrap_or_else(|| Path::new("results").join(&plan.name));
    fs::create_dir_all(out.join("plots"))?;
    let places: HashMap<&str, usize> = keys.iter().enumerate().map(|(at, key)| (key.as_str(), at)).collect();
    // A run that could not be done is done again.
    let is_wanted = |record: &Record| {
        !args.fresh && places.contains_key(record.key.as_str()) && record.outcome != Outcome::Error
    };
    let (mut store, outdated) = Store::open(&out.join("runs.csv"), &plan.axes, is_wanted)?;
    if outdated > 0 {
        warn(&format!(
            "{outdated} runs are done again: they failed to run, or something in them has changed since (kept in {})",
            out.join("runs-outdated.csv").display()
        ));
    }
    let known: Vec<String> = store.records.iter().map(|record| record.key.clone()).collect();
    let job = |(key, run): (&String, &plan::Run)| Job {
        key: key.clone(),
        variant: plan.variants[run.variant].name.clone(),
        run: run.clone(),
    };
    let jobs: Vec<Job> =
        keys.iter().zip(&plan.runs).filter(|(key, _)| !known.contains(key)).map(job).collect();

    let signals = Signals::catch()?;
    let crew = Crew { launcher: std::env::current_exe()?, graph: plan.graph.clone(), processors };
    let mut progress = Progress::new(plan.runs.len(), &store.records);
    crew.work(
        jobs,
        || signals.count() > 0,
        |record| {
            progress.show(&record);
            store.append(record)
        },
    )?;
    progress.end();
    store.sort_by_key(|record| places.get(record.key.as_str()).copied().unwrap_or(usize::MAX))?;

    let records = &store.records;
    if records.is_empty() {
        warn("no run was finished");
        return Ok(false);
    }
    let complete = records.len() == plan.runs.len();
    write_tables(&out, &plan, records)?;
    let groups = report::groups(&plan, records);
    for figure in report::telling_figures(records) {
        plot::draw(&out.join("plots").join(plot::file_name(&figure)), &figure, &groups)?;
    }
    say(&report::tables(&plan, records, false));
    say_line(&computation(records));
    say_line(&format!("runs.csv, table.md and plots of these runs: {}", out.display()));
    if !complete {
        say_line(&format!(
            "{} of {} runs are done; the same command does the rest",
            records.len(),
            plan.runs.len()
        ));
    }
    let holds = report::verdicts(&plan, &groups).iter().all(report::Verdict::holds);
    let errors = records.iter().any(|record| record.outcome == Outcome::Error);
    Ok(complete && holds && !errors)
}

/// An experiment by path or by name.
fn found(file: &Path) -> PathBuf {
    let named = file.components().count() == 1 && file.extension().is_none() && !file.is_file();
    if !named {
        return file.to_owned();
    }
    let name = file.with_extension("toml");
    let beside = std::env::current_exe().ok();
    let beside = beside.as_deref().and_then(Path::parent).and_then(Path::parent);
    let folders = [PathBuf::from("experiments"), Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments")];
    let folders = folders.into_iter().chain(beside.map(|prefix| prefix.join("share/corkboard/experiments")));
    let mut files = folders.map(|folder| folder.join(&name));
    files.find(|file| file.is_file()).unwrap_or(name)
}

/// Checks every variant, in one situation each, and the first in every situation; the keys of all runs if nothing is refused.
fn checked_keys(plan: &Plan, build: bool) -> Option<Vec<String>> {
    let first_situation = plan.runs.first().map(|run| run.situation.clone())?;
    let mut prints: HashMap<usize, String> = HashMap::new();
    let mut seen: Vec<(usize, &[String])> = Vec::new();
    let mut hashes = HashMap::new();
    for run in &plan.runs {
        let worth_it = run.variant == 0 || run.situation == first_situation;
        if !worth_it || seen.contains(&(run.variant, &run.situation)) {
            continue;
        }
        seen.push((run.variant, &run.situation));
        let request = Request { graph: plan.graph.clone(), overrides: run.overrides.clone(), build };
        let Some(checked) = graph::prepare(&request) else {
            warn(&format!("so `{}` is refused, and no run was begun", plan.variants[run.variant].name));
            return None;
        };
        prints.entry(run.variant).or_insert_with(|| fingerprint(&checked, &mut hashes));
    }
    let key = |run: &plan::Run| {
        let print = prints.get(&run.variant).cloned().unwrap_or_default();
        let overrides = &run.overrides;
        let text = format!(
            "{print} {} {} {:?} {:?} {:?}",
            run.seed, run.limit_s, overrides.set, overrides.swap, overrides.without
        );
        blake3::hash(text.as_bytes()).to_hex().chars().take(16).collect()
    };
    Some(plan.runs.iter().map(key).collect())
}

/// Of everything that decides how a run goes: binaries, parameters, and the files that parameters name.
fn fingerprint(checked: &Checked, known: &mut HashMap<PathBuf, String>) -> String {
    let mut content = |path: PathBuf| {
        let hash =
            || fs::read(&path).map(|bytes| blake3::hash(&bytes).to_hex().to_string()).unwrap_or_default();
        match known.get(&path) {
            Some(hash) => hash.clone(),
            None => {
                let hash = hash();
                known.insert(path, hash.clone());
                hash
            }
        }
    };
    let mut hasher = blake3::Hasher::new();
    for service in &checked.services {
        // The seed is varied by run, the board by place.
        let word = format!("{} {} {:?}", service.role, service.parameters, service.launch.compute);
        hasher.update(word.as_bytes());
        hasher.update(content(service.binary.clone()).as_bytes());
        let texts =
            service.parameters.as_object().into_iter().flatten().filter_map(|(_, value)| value.as_str());
        for file in texts.map(|text| checked.folder.join(text)).filter(|file| file.is_file()) {
            hasher.update(content(file).as_bytes());
        }
    }
    hasher.update(format!("{:?}", checked.faults).as_bytes());
    hasher.finalize().to_hex().to_string()
}

/// A processor for each place; all that this process may use, unless another number is wanted.
fn processors(jobs: Option<usize>) -> Vec<usize> {
    let allowed = rustix::thread::sched_getaffinity(None).ok();
    let allowed: Vec<usize> =
        allowed.map(|set| (0..1024).filter(|&processor| set.is_set(processor)).collect()).unwrap_or_default();
    let allowed = if allowed.is_empty() { vec![0] } else { allowed };
    let jobs = jobs.unwrap_or(allowed.len()).max(1);
    allowed.iter().copied().cycle().take(jobs).collect()
}

fn print_plan(plan: &Plan, places: usize) {
    say_line(&format!("{}: {} runs of {}, {places} at once", plan.name, plan.runs.len(), plan.graph));
    for (index, variant) in plan.variants.iter().enumerate() {
        let runs = plan.runs.iter().filter(|run| run.variant == index).count();
        say_line(&format!("  {runs:>5} x {}", variant.name));
    }
}

fn write_tables(out: &Path, plan: &Plan, records: &[Record]) -> std::io::Result<()> {
    let title = format!("# {}: {} of {} runs\n\n", plan.name, records.len(), plan.runs.len());
    fs::write(out.join("table.md"), title + &report::tables(plan, records, true))
}

/// How long the runs took, each with all its processes on one processor. Not in the tables: it is not the same the next time.
fn computation(records: &[Record]) -> String {
    let took_s: Vec<f64> = records
        .iter()
        .filter(|record| record.outcome != Outcome::Error)
        .map(|record| record.wall_s)
        .collect();
    let mean_s = took_s.iter().sum::<f64>() / took_s.len().max(1) as f64;
    let most_s = took_s.iter().copied().fold(0.0, f64::max);
    format!("a run took {mean_s:.2} s on average, {most_s:.2} s at most")
}

/// A bar on a terminal; elsewhere a line for each twentieth.
struct Progress {
    bar: Option<ProgressBar>,
    total: usize,
    done: usize,
    passed: usize,
    began: messages::Time,
}

impl Progress {
    fn new(total: usize, records: &[Record]) -> Self {
        let done = records.len();
        let passed = records.iter().filter(|record| record.outcome == Outcome::Passed).count();
        let style = ProgressStyle::with_template("{bar:32} {pos} of {len} runs, {msg}, {eta} to go");
        let bar = std::io::stderr().is_terminal().then(|| ProgressBar::new(total as u64));
        if let (Some(bar), Ok(style)) = (&bar, style) {
            bar.set_style(style);
            bar.set_position(done as u64);
            bar.reset_eta();
        } else if done > 0 {
            warn(&format!("{done} of {total} runs are done already"));
        }
        Self { bar, total, done, passed, began: clock::monotonic() }
    }

    fn show(&mut self, record: &Record) {
        self.done += 1;
        self.passed += usize::from(record.outcome == Outcome::Passed);
        let message = format!("{} passed", self.passed);
        match &self.bar {
            Some(bar) => {
                bar.set_message(message);
                bar.set_position(self.done as u64);
            }
            None if self.done.is_multiple_of(self.total.div_ceil(20)) || self.done == self.total => {
                let took_s = clock::monotonic().seconds_since(self.began);
                warn(&format!("[{took_s:>8.1}] {} of {} runs, {message}", self.done, self.total));
            }
            None => {}
        }
    }

    fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
