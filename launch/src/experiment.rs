//! `launch experiment`: variants of a graph in the same situations, in lockstep, and what they differ in.
//!
//! The experiment file is spelt out into runs ([`plan`]); every variant is checked before the first run; a
//! [`crew`] of child processes does the runs; each is written to `runs.csv` at once ([`store`]), so that an
//! interrupted experiment goes on where it was; variants are compared run by run ([`compare`]); tables
//! ([`report`]) and box plots ([`plot`]) say what came of it.

mod choice;
mod compare;
mod crew;
mod find;
mod plan;
mod plot;
mod refusal;
mod report;
mod store;
#[cfg(test)]
mod tests;

use crate::cli::ExperimentArgs;
use crate::console::{say, say_line, warn};
use crate::graph::{self, Checked, Request, hint};
use crate::numbers::{number, spoken_time};
use crate::signals::Signals;
use crate::statistics::{quantile, sorted, summary};
use board::clock;
use board::terminal::harmless;
use choice::Choice;
use crew::{Crew, Job};
use indicatif::{ProgressBar, ProgressStyle};
use plan::{Plan, Run};
use report::Show;
use std::collections::{HashMap, HashSet};
use std::fs;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use store::{Outcome, Record, Store, Use};

/// The longest word of refusal, in characters: names of the file stand in it.
const WORDS_MAX: usize = 5000;

/// `launch experiment`. Fails when a variant is refused, a run could not be done, an expectation does not
/// hold, or the person left early.
pub(crate) fn command(args: &ExperimentArgs) -> ExitCode {
    match conduct(args) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            warn(&format!("error: {}", files::clipped(&error.to_string(), WORDS_MAX)));
            ExitCode::FAILURE
        }
    }
}

fn conduct(args: &ExperimentArgs) -> Result<bool, Box<dyn std::error::Error>> {
    let mut plan = plan::read(&find::find(&args.file)?, &Choice::of(args)?)?;
    let by = args.by.as_deref().map(|name| axis(&plan, name)).transpose()?;
    if !leave_out_what_lacks_files(&mut plan) {
        return Ok(false);
    }
    let Some(keys) = checked_keys(&plan, !args.no_build) else { return Ok(false) };
    let processors = processors(args.jobs);
    let out = args.out.clone().unwrap_or_else(|| Path::new("results").join(&plan.name));
    let csv = out.join("runs.csv");
    let places: HashMap<&str, usize> = keys.iter().enumerate().map(|(at, key)| (key.as_str(), at)).collect();
    let wanted: HashSet<(&str, &[String], u64)> = plan.runs.iter().map(|run| plan.identity(run)).collect();
    let use_of = |record: &Record| {
        // A run that could not be done is done again.
        let is_done = !args.fresh && record.outcome != Outcome::Error;
        match places.contains_key(record.key.as_str()) {
            true if is_done => Use::Wanted,
            false if !wanted.contains(&record.identity()) => Use::Aside,
            _ => Use::Outdated,
        }
    };
    if args.dry_run {
        let (axes, known) = store::read(&csv)?;
        let is_done = |record: &&Record| axes == plan.axes && use_of(record) == Use::Wanted;
        let done: Vec<&str> = known.iter().filter(is_done).map(|record| record.key.as_str()).collect();
        let left = keys.iter().zip(&plan.runs).filter(|(key, _)| !done.contains(&key.as_str()));
        let left: Vec<&Run> = left.map(|(_, run)| run).collect();
        print_plan(&plan, processors.len());
        say_line(&forecast(&plan, &left, &known, processors.len()));
        return Ok(true);
    }
    fs::create_dir_all(out.join("plots"))?;
    let (mut store, outdated) = Store::open(&csv, &plan.axes, use_of)?;
    if outdated > 0 {
        warn(&format!(
            "{outdated} runs are done again: they failed to run, or something in them has changed since (kept in {})",
            out.join("runs-outdated.csv").display()
        ));
    }
    let known: HashSet<String> = store.records.iter().map(|record| record.key.clone()).collect();
    let job = |(key, run): (&String, &Run)| Job {
        key: key.clone(),
        variant: plan.variants[run.variant].name.clone(),
        run: run.clone(),
    };
    let jobs: Vec<Job> =
        keys.iter().zip(&plan.runs).filter(|(key, _)| !known.contains(*key)).map(job).collect();

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
    write_files(&out, &plan, records)?;
    let tables = report::tables(&plan, records, Show::Terminal { all: args.all, by });
    // Remarks come from services.
    say(&tables.lines().map(|line| harmless(line) + "\n").collect::<String>());
    say_line(&closing_words(&plan, &store, &out));
    let verdicts = compare::verdicts(&plan, &compare::groups(&plan, records));
    let holds = verdicts.iter().all(compare::Verdict::holds);
    let errors = records.iter().any(|record| record.outcome == Outcome::Error);
    Ok(complete && holds && !errors)
}

/// The axis of the situations of this name: all of it, or what stands behind its last point.
fn axis(plan: &Plan, name: &str) -> Result<usize, String> {
    let short = |key: &str| key.rsplit('.').next().unwrap_or(key).to_owned();
    let found = plan.axes.iter().position(|key| key == name || short(key) == name);
    found.ok_or_else(|| {
        let hint = hint(name, plan.axes.iter().map(String::as_str), "axes");
        format!("the situations have no axis `{name}`: {hint}")
    })
}

/// Takes out the variants that need files which are not there, and says so; false when none is left.
fn leave_out_what_lacks_files(plan: &mut Plan) -> bool {
    // Who names no graph that can be found is told so by the check.
    let folder = graph::find(&plan.graph).ok().and_then(|file| file.parent().map(Path::to_owned));
    for (variant, file) in plan.leave_out_what_lacks_files(&folder.unwrap_or_default()) {
        warn(&format!("`{variant}` is left out: it needs {}, which is not there", graph::shown(&file)));
    }
    if plan.variants.is_empty() {
        warn("error: nothing is left to be run; the experiment's file says where it looks for its data");
    }
    !plan.variants.is_empty()
}

/// Checks every variant, in one situation each, and the first in every situation; the keys of all runs if
/// nothing is refused.
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
            let name = files::in_brief(&plan.variants[run.variant].name);
            warn(&format!("so `{name}` is refused, and no run was begun"));
            return None;
        };
        prints.entry(run.variant).or_insert_with(|| fingerprint(&checked, &mut hashes));
    }
    let key = |run: &Run| {
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

/// How long the runs that are left will take, as far as runs on record can tell.
fn forecast(plan: &Plan, left: &[&Run], known: &[Record], places: usize) -> String {
    let all = plan.runs.len();
    if left.is_empty() {
        return format!("all {all} runs are done; the same command without --dry-run shows the tables");
    }
    let mean_s = |variant: Option<&str>| {
        let known = known.iter().filter(|record| record.outcome != Outcome::Error);
        let took: Vec<f64> = known
            .filter(|record| variant.is_none_or(|name| record.variant == name))
            .map(|record| record.wall_s)
            .collect();
        summary(&took).map(|took| took.mean)
    };
    let Some(any_s) = mean_s(None) else {
        return format!("{all} runs are to be done; how long they take is known when the first are done");
    };
    let runs = |variant: usize| left.iter().filter(|run| run.variant == variant).count() as f64;
    let variants = plan.variants.iter().enumerate();
    let total_s: f64 =
        variants.map(|(index, variant)| runs(index) * mean_s(Some(&variant.name)).unwrap_or(any_s)).sum();
    format!(
        "{} of {all} runs are done; the others take about {}, as the {} on record did",
        all - left.len(),
        spoken_time(total_s / places.min(left.len()) as f64),
        known.len()
    )
}

fn write_files(out: &Path, plan: &Plan, records: &[Record]) -> Result<(), Box<dyn std::error::Error>> {
    let title = format!("# {}: {} of {} runs\n\n", plan.name, records.len(), plan.runs.len());
    fs::write(out.join("table.md"), title + &report::tables(plan, records, Show::File))?;
    let groups = compare::groups(plan, records);
    for figure in compare::telling_figures(records) {
        if let Some(svg) = plot::draw(&plan.name, &figure, &groups)? {
            fs::write(out.join("plots").join(plot::file_name(&figure)), svg)?;
        }
    }
    Ok(())
}

/// What there is beside the tables that were just shown.
fn closing_words(plan: &Plan, store: &Store, out: &Path) -> String {
    let records = &store.records;
    let mut lines = vec![computation(records)];
    lines.push(format!(
        "runs.csv, table.md (all figures, by {}) and plots: {}",
        if plan.axes.is_empty() { "variant".to_owned() } else { plan.axes.join(", ") },
        out.display()
    ));
    if !store.aside.is_empty() {
        lines.push(format!("runs.csv keeps {} runs of other seeds or variants too", store.aside.len()));
    }
    if records.len() < plan.runs.len() {
        let (done, all) = (records.len(), plan.runs.len());
        lines.push(format!("{done} of {all} runs are done; the same command does the rest"));
    }
    lines.join("\n")
}

/// How long the runs took, each with all its processes on one processor. Not in the tables: it is not the
/// same the next time.
fn computation(records: &[Record]) -> String {
    let run = records.iter().filter(|record| record.outcome != Outcome::Error);
    let took = sorted(&run.map(|record| record.wall_s).collect::<Vec<_>>());
    let [middle_s, most_s] = [0.5, 1.0].map(|share| quantile(&took, share).unwrap_or(f64::NAN));
    format!("a run took {} s (median), {} s at most", number(middle_s), number(most_s))
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
