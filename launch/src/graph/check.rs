//! Whether a graph can run: every binary's word against the graph's.

use super::checked::{Checked, CheckedService};
use super::file::Overrides;
use super::paths::{self, CheckedPaths};
use super::problem::{Problem, Problems};
use super::schema;
use super::settings::{Graph, ServiceTable};
use super::suggest::{nearest, quoted};
use super::text::to_toml;
use super::topics::{Member, connect};
use super::tree::{Content, Entry, Node};
use board::Interface;
use board::switchboard::TOPICS;
use messages::Schema;
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Where binaries are, and what they say of themselves. Asked from several threads.
pub(crate) trait Binaries: Sync {
    /// The file that `run` names.
    fn locate(&self, run: &str) -> Result<PathBuf, NotFound>;
    /// What a binary says of itself: with its defaults, or with these parameters.
    fn interface(&self, binary: &Path, parameters: Option<&Value>) -> Result<Interface, QueryError>;
}

/// A binary that is not there.
#[derive(Debug, Clone, Default)]
pub(crate) struct NotFound {
    /// Where it was looked for.
    pub(crate) looked: Vec<PathBuf>,
    /// Binaries that are there.
    pub(crate) known: Vec<String>,
    /// A command that would make it.
    pub(crate) command: Option<String>,
}

/// A binary that does not say what it is.
#[derive(Debug, Clone, thiserror::Error)]
pub(crate) enum QueryError {
    /// It refuses these parameters.
    #[error("{0}")]
    Refused(String),
    /// It cannot be started, crashes, or answers nonsense.
    #[error("{0}")]
    Broken(String),
}

/// Compares the graph with its binaries, on a machine with `cpus` processors. What is wrong goes to
/// `problems`; the result is there if nothing refuses the graph, also nothing that was in `problems` before.
pub(crate) fn check(
    graph: &Graph,
    binaries: &dyn Binaries,
    cpus: usize,
    problems: &mut Problems,
) -> Option<Checked> {
    for service in &graph.services {
        check_machine(service, cpus, problems);
    }
    let asked = in_parallel(&graph.services, |service| ask_for_defaults(service, binaries));
    let mut members = Vec::new();
    let mut paths = CheckedPaths::default();
    let mut used_defaults = vec![false; graph.defaults.len()];
    for (service, answer) in graph.services.iter().zip(asked) {
        match answer {
            Ok((binary, defaults)) => {
                let mut found = Problems::default();
                paths.add(&service.role, &defaults.parameters);
                let given = choose_parameters(graph, service, &defaults, &mut used_defaults, &mut found);
                let settled = !found.refuse() && !given.iter().any(|entry| entry.value.has_nonsense());
                problems.extend(found);
                members.push(Asked { service, binary, interface: defaults, given, settled });
            }
            Err(problem) => problems.push(*problem),
        }
    }
    let complete = members.len() == graph.services.len();
    if complete {
        refuse_unused_defaults(graph, &used_defaults, &members, problems);
    }
    let answers = in_parallel(&members, |member| ask_with_parameters(graph, member, binaries));
    for (member, answer) in members.iter_mut().zip(answers) {
        match answer {
            Ok(Some(interface)) => member.interface = interface,
            Ok(None) => {}
            Err(problem) => problems.push(*problem),
        }
    }
    let ports: Vec<_> =
        members.iter().map(|member| Member { table: member.service, interface: &member.interface }).collect();
    let topics = connect(graph, &ports, complete, problems);
    // Each service has its health on the board.
    let on_board = topics.len() + members.len();
    if on_board > TOPICS {
        let message =
            format!("{on_board} topics, with the services' health, are more than the {TOPICS} of a board");
        problems.push(Problem::placeless(message, "leave out services, or run them on two boards"));
    }
    if problems.refuse() {
        return None;
    }
    let mut written = graph.written.clone();
    paths::rebase_all(&mut written, &paths, &graph.folder);
    let services = members.into_iter().map(|member| CheckedService {
        role: member.service.role.clone(),
        run: member.service.run.clone(),
        parameters: overlay(&member.interface.defaults, &member.given),
        binary: member.binary,
        launch: member.service.launch.clone(),
        interface: member.interface,
    });
    Some(Checked {
        name: graph.name.clone(),
        file: graph.file.clone(),
        folder: graph.folder.clone(),
        seed: graph.seed,
        finish: graph.finish.as_ref().map(|(topic, _)| topic.clone()),
        view: graph.view.clone(),
        services: services.collect(),
        topics,
        faults: graph.faults.clone(),
        text: to_toml(&written),
        overrides: Overrides::default(),
    })
}

struct Asked<'a> {
    service: &'a ServiceTable,
    binary: PathBuf,
    interface: Interface,
    // Parameters that the graph gives, with those for everybody.
    given: Vec<Entry>,
    // Whether name, type and range of all of them are right, so that the binary may judge them together.
    settled: bool,
}

/// How many binaries are asked at once: more only wait for each other.
const AT_ONCE: usize = 16;

/// Asks for all items, several at once; here and one after the other when no thread can be started.
fn in_parallel<T: Sync, R: Send>(items: &[T], ask: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let answers: Mutex<Vec<(usize, R)>> = Mutex::new(Vec::new());
    let work = || {
        while let index = next.fetch_add(1, Ordering::Relaxed)
            && let Some(item) = items.get(index)
        {
            let answer = ask(item);
            answers.lock().unwrap_or_else(PoisonError::into_inner).push((index, answer));
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..items.len().min(AT_ONCE) {
            if std::thread::Builder::new().spawn_scoped(scope, work).is_err() {
                break;
            }
        }
        work();
    });
    let mut answers = answers.into_inner().unwrap_or_else(PoisonError::into_inner);
    answers.sort_by_key(|(index, _)| *index);
    answers.into_iter().map(|(_, answer)| answer).collect()
}

fn check_machine(service: &ServiceTable, cpus: usize, problems: &mut Problems) {
    if let Some(cpu) = service.launch.cpu.iter().find(|cpu| **cpu >= cpus) {
        let message = format!("`{}` cannot run on processor {cpu}: this machine has {cpus}", service.role);
        let help = format!("`cpu` of [{}.launch] counts from 0 to {}", service.role, cpus.saturating_sub(1));
        let place = service.cpu_place.as_ref().unwrap_or(&service.place);
        problems.push(Problem::error(place, message, help));
    }
}

fn ask_for_defaults(
    service: &ServiceTable,
    binaries: &dyn Binaries,
) -> Result<(PathBuf, Interface), Box<Problem>> {
    let binary = binaries.locate(&service.run).map_err(|missing| not_found(service, &missing))?;
    let answer = binaries.interface(&binary, None);
    let interface = answer.map_err(|error| {
        let message = format!("`{}` does not say what it is: {error}", service.run);
        let help = format!("try `{} --interface`; is it a service of this board?", binary.display());
        Box::new(Problem::error(&service.run_place, message, help))
    })?;
    Ok((binary, interface))
}

fn not_found(service: &ServiceTable, missing: &NotFound) -> Box<Problem> {
    let message = format!("there is no binary `{}`", service.run);
    let mut help = Vec::new();
    let others = missing.known.iter().map(String::as_str).filter(|name| *name != service.run);
    if let Some(name) = nearest(&service.run, others).filter(|_| missing.command.is_none()) {
        help.push(format!("did you mean `{name}`?"));
    } else if let Some(command) = &missing.command {
        help.push(format!("build it: {command}"));
    } else if service.run == service.role {
        help.push(format!("install it, or name another one: `run = \"..\"` below [{}]", service.role));
    }
    if !missing.looked.is_empty() {
        let looked: Vec<_> = missing.looked.iter().map(|path| path.display().to_string()).collect();
        help.push(format!("looked for {}", looked.join(", ")));
    }
    Box::new(Problem::error(&service.run_place, message, help.join("\n")))
}

/// The parameters a service gets: its own, and of those for everybody the ones that it has.
fn choose_parameters(
    graph: &Graph,
    service: &ServiceTable,
    interface: &Interface,
    used_defaults: &mut [bool],
    problems: &mut Problems,
) -> Vec<Entry> {
    let known = Schema { root: &interface.parameters, defaults: &interface.defaults };
    let mut given = Vec::new();
    for entry in &service.parameters {
        let swapped = !service.run_place.source().is_file;
        if swapped && entry.key_place.source().is_file && !known.has(&entry.key) {
            // The table was written for the binary that is swapped out.
            let message = format!("`{}` has no parameter `{}`, and does without", service.run, entry.key);
            problems.push(Problem::note(&entry.key_place, message, "it was written for another binary"));
            continue;
        }
        let entry = unquoted_text(entry, interface);
        schema::check(&service.role, known, &entry, problems);
        given.push(located(&entry, graph, interface));
    }
    for (entry, used) in graph.defaults.iter().zip(used_defaults) {
        if known.has(&entry.key) {
            *used = true;
            if !given.iter().any(|own| own.key == entry.key) {
                schema::check(&service.role, known, entry, problems);
                given.push(located(entry, graph, interface));
            }
        }
    }
    given
}

/// `--set mission.room=207` means a text where a text is wanted.
fn unquoted_text(entry: &Entry, interface: &Interface) -> Entry {
    let is_argument = !entry.value.place.source().is_file;
    let wants_text = interface.defaults.get(&entry.key).is_some_and(Value::is_string);
    if !is_argument || !wants_text || entry.value.text().is_some() {
        return entry.clone();
    }
    let place = entry.value.place.clone();
    let content = Content::Text(place.text().to_owned());
    Entry { value: Node { content, place }, ..entry.clone() }
}

/// A path, from the graph's folder on.
fn located(entry: &Entry, graph: &Graph, interface: &Interface) -> Entry {
    let mut entry = entry.clone();
    if paths::is_path(&interface.parameters, &entry.key) {
        paths::rebase(&mut entry, &graph.folder);
    }
    entry
}

fn refuse_unused_defaults(graph: &Graph, used: &[bool], members: &[Asked<'_>], problems: &mut Problems) {
    for (entry, _) in graph.defaults.iter().zip(used).filter(|(_, used)| !**used) {
        let names: Vec<&str> = members
            .iter()
            .filter_map(|member| member.interface.parameters.get("properties")?.as_object())
            .flat_map(|properties| properties.keys().map(String::as_str))
            .collect();
        let message = format!("no service of this graph has a parameter `{}`", entry.key);
        let help = match nearest(&entry.key, names) {
            Some(name) => format!("did you mean `{name}`?"),
            None => "remove the line".to_owned(),
        };
        problems.push(Problem::error(&entry.key_place, message, help));
    }
}

/// Asks again when there is something to ask: whether the parameters make sense together, and which ports
/// they lead to.
fn ask_with_parameters(
    graph: &Graph,
    member: &Asked<'_>,
    binaries: &dyn Binaries,
) -> Result<Option<Interface>, Box<Problem>> {
    if !member.settled || member.given.is_empty() {
        return Ok(None);
    }
    let parameters = overlay(&member.interface.defaults, &member.given);
    let role = &member.service.role;
    match binaries.interface(&member.binary, Some(&parameters)) {
        Ok(interface) => Ok(Some(interface)),
        Err(QueryError::Refused(why)) => {
            // The sentence names the parameters; point at the one it names first, of those that were given.
            let words: Vec<&str> =
                why.split(|letter: char| !letter.is_alphanumeric() && letter != '_').collect();
            let position =
                |entry: &&Entry| words.iter().position(|word| *word == entry.key).unwrap_or(usize::MAX);
            let named = member.given.iter().filter(|entry| words.contains(&entry.key.as_str()));
            let named = named.min_by_key(position);
            let place = named.map_or(&member.service.place, |entry| &entry.key_place);
            let message = format!("`{role}` refuses its parameters: {why}");
            let given = quoted(member.given.iter().map(|entry| entry.key.as_str()));
            let help = format!("change what it names; this graph gives it {given}");
            let folder = place.source().folder.as_deref().unwrap_or(&graph.folder).display();
            let help = if why.contains("No such file") {
                format!("{help}; files count from {folder}")
            } else {
                help
            };
            Err(Box::new(Problem::error(place, message, help)))
        }
        Err(error @ QueryError::Broken(_)) => {
            let message = format!("`{role}` does not say what it is with these parameters: {error}");
            let help = format!("try `{} --interface --params '..'`", member.binary.display());
            Err(Box::new(Problem::error(&member.service.place, message, help)))
        }
    }
}

fn overlay(defaults: &Value, given: &[Entry]) -> Value {
    let mut all = match defaults {
        Value::Object(defaults) => defaults.clone(),
        _ => Map::new(),
    };
    for entry in given {
        all.insert(entry.key.clone(), entry.value.to_json());
    }
    Value::Object(all)
}
