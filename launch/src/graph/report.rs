//! From a graph's name to its verdict, on the screen or as JSON.

use super::binaries::{Installed, processors, services_in_checkout};
use super::build::build;
use super::check::check;
use super::checked::Checked;
use super::diagram::{dot, mermaid};
use super::file::{Overrides, load, load_text};
use super::find::find;
use super::paths::shown;
use super::problem::{Palette, Problem, Problems, Severity};
use super::settings::Graph;
use super::source::Source;
use crate::console::{say, say_line, warn_text};
use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::Path;
use std::process::ExitCode;

/// Which graph is meant, and what is different about it this time.
#[derive(Debug, Clone, Default)]
pub(crate) struct Request {
    /// A name or a path.
    pub(crate) graph: String,
    /// What the command line changes.
    pub(crate) overrides: Overrides,
    /// Whether a source checkout is built first.
    pub(crate) build: bool,
}

/// Reads and checks a graph and prints what is wrong to stderr; `None` if it is refused. Starts no process but those that ask each
/// binary for its interface.
pub(crate) fn prepare(request: &Request) -> Option<Checked> {
    let mut problems = Problems::default();
    let checked = examine(request, &mut problems);
    warn_text(&listing(&problems, &Palette::of(&std::io::stderr()), false));
    checked
}

/// `launch check`.
pub(crate) fn check_command(request: &Request, as_json: bool) -> ExitCode {
    let mut problems = Problems::default();
    let checked = examine(request, &mut problems);
    if as_json {
        let list: Vec<_> = problems.sorted().into_iter().map(Problem::to_json).collect();
        say_line(&format!(
            "{:#}",
            serde_json::json!({ "ok": checked.is_some(), "problems": list, "graph": checked })
        ));
    } else {
        warn_text(&listing(&problems, &Palette::of(&std::io::stderr()), true));
        if let Some(checked) = &checked {
            say(&praise(checked, &Palette::of(&std::io::stdout())));
        }
    }
    if checked.is_some() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// `launch graph`.
pub(crate) fn graph_command(request: &Request, as_dot: bool) -> ExitCode {
    let Some(checked) = prepare(request) else { return ExitCode::FAILURE };
    say(&if as_dot { dot(&checked) } else { mermaid(&checked) });
    ExitCode::SUCCESS
}

/// As [`prepare`], of a graph's text that was kept in a recording; `file` is where it was read from then, `name` how it is called in complaints.
pub(crate) fn prepare_recorded(
    name: &str,
    text: &str,
    file: &Path,
    overrides: &Overrides,
    build: bool,
) -> Option<Checked> {
    let mut problems = Problems::default();
    let graph = load_text(file, &Source::file(name, text), overrides, &mut problems);
    let checked = graph.and_then(|graph| examine_loaded(&graph, overrides, build, &mut problems));
    warn_text(&listing(&problems, &Palette::of(&std::io::stderr()), false));
    checked
}

fn examine(request: &Request, problems: &mut Problems) -> Option<Checked> {
    let path = match find(&request.graph) {
        Ok(path) => path,
        Err(unknown) => {
            problems.push(Problem::placeless(unknown.to_string(), unknown.help()));
            return None;
        }
    };
    let graph = load(&path, &request.overrides, problems)?;
    examine_loaded(&graph, &request.overrides, request.build, problems)
}

fn examine_loaded(
    graph: &Graph,
    overrides: &Overrides,
    wants_build: bool,
    problems: &mut Problems,
) -> Option<Checked> {
    let mut built = HashMap::new();
    if wants_build {
        let in_checkout = services_in_checkout();
        let mut wanted: Vec<_> = graph.services.iter().map(|service| service.run.clone()).collect();
        wanted.retain(|run| in_checkout.contains(run));
        wanted.sort();
        wanted.dedup();
        match build(&wanted) {
            Ok(binaries) => built = binaries,
            Err(error) => {
                problems.push(Problem::placeless(error.to_string(), "correct what the compiler says"));
                return None;
            }
        }
    }
    let binaries = Installed { folder: graph.folder.clone(), built };
    let checked = check(graph, &binaries, processors(), problems)?;
    Some(Checked { overrides: overrides.clone(), ..checked })
}

fn listing(problems: &Problems, palette: &Palette, with_notes: bool) -> String {
    let mut out = String::new();
    let list = problems.sorted();
    let errors = list.iter().filter(|problem| problem.severity == Severity::Error).count();
    for problem in &list {
        match problem.severity {
            Severity::Error => {
                let _ = writeln!(out, "{}", problem.render(palette));
            }
            // Notes are a line each: nothing has to be done.
            Severity::Note if with_notes => {
                let place = problem.place.as_ref().map(|place| format!("{place}: ")).unwrap_or_default();
                let _ = writeln!(out, "{place}{}: {}", palette.paint(palette.note, "note"), problem.message);
            }
            Severity::Note => {}
        }
    }
    if problems.more() > 0 {
        let _ = writeln!(out, "and {} more", problems.more());
    }
    let errors = errors + problems.more();
    if errors > 0 {
        let count = counted(errors, "error");
        let _ = writeln!(out, "{}; no process was started", palette.paint(palette.error, &count));
    }
    out
}

fn praise(checked: &Checked, palette: &Palette) -> String {
    let mut out = String::new();
    let (services, topics) = (checked.services.len(), checked.topics.len());
    let _ = writeln!(
        out,
        "{} {}: {}, {}, seed {}",
        palette.paint(palette.good, "in order"),
        palette.paint(palette.strong, &shown(&checked.file)),
        counted(services, "service"),
        counted(topics, "topic"),
        checked.seed
    );
    out
}

fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}
