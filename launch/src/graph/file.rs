//! From a file's name to one table: includes, and what the command line changes.

use super::find::find_included;
use super::paths::shown;
use super::problem::{Problem, Problems};
use super::settings::{Graph, read_graph};
use super::source::{Place, Source};
use super::suggest::hint;
use super::tree::{Content, Entry, Node, Table, parse, parse_value};
use files::{FileError, FileProblem};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What the command line changes in a graph.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Overrides {
    /// `role.key=value`: parameters, `run`, and `role.launch.key`.
    pub(crate) set: Vec<String>,
    /// `role=binary`: other binaries for roles.
    pub(crate) swap: Vec<String>,
    /// Roles that are left out.
    pub(crate) without: Vec<String>,
    /// Another seed.
    pub(crate) seed: Option<u64>,
    /// Another name for the board.
    pub(crate) board: Option<String>,
}

/// The largest graph of ours has 3 KiB; one of as many services as a board has room for, each with a hundred
/// parameters, has 400.
const FILE_MAX: u64 = 1 << 20;
/// Files that include each other in a row, and files in all: no graph is made of more parts.
const INCLUDES_DEEP: usize = 16;
const INCLUDES_MAX: usize = 100;
/// So many names lead to a parameter at most: tables within tables are walked through one within the other.
const KEYS_MAX: usize = 32;

/// Reads a graph file with everything it includes. What is wrong goes to `problems`; the graph is there
/// unless the mistakes leave nothing to look at.
pub(crate) fn load(path: &Path, overrides: &Overrides, problems: &mut Problems) -> Option<Graph> {
    let text = match files::read_text(path, FILE_MAX) {
        Ok(text) => text,
        Err(FileError { problem, .. }) => {
            let message = format!("cannot read the graph file {}: {problem}", shown(path));
            problems.push(Problem::placeless(message, what_to_do(&problem)));
            return None;
        }
    };
    read(path, &Source::file(shown(path), text), overrides, problems)
}

fn what_to_do(problem: &FileProblem) -> &'static str {
    match problem {
        FileProblem::NotText { .. } => "correct that byte, or save the file as UTF-8",
        FileProblem::Io(error) if error.kind() != std::io::ErrorKind::NotFound => "see that it can be read",
        _ => "name a graph file that exists",
    }
}

/// The same of a text that was kept; `path` is where the file was, from which other files count.
pub(crate) fn load_text(
    path: &Path,
    source: &Arc<Source>,
    overrides: &Overrides,
    problems: &mut Problems,
) -> Option<Graph> {
    read(path, source, overrides, problems)
}

fn read(path: &Path, source: &Arc<Source>, overrides: &Overrides, problems: &mut Problems) -> Option<Graph> {
    let mut reader = Reader { problems, open: Vec::new(), done: Vec::new() };
    let mut table = reader.read(path, source)?;
    if reader.problems.refuse() {
        return None;
    }
    if !table.entries.iter().any(|entry| !is_ours(&entry.key)) {
        let help = "add a table for each service, such as [simulator]";
        problems.push(Problem::error(&Place::top(source), "this graph has no services", help));
        return None;
    }
    let written = table.clone();
    apply(overrides, &mut table, problems);
    let graph = read_graph(path, source, &table, problems)?;
    Some(Graph { written, ..graph })
}

struct Reader<'a> {
    problems: &'a mut Problems,
    // The files that are being read, each included by the one before it.
    open: Vec<(PathBuf, String)>,
    // The files that were read: two parts may include a third.
    done: Vec<PathBuf>,
}

impl Reader<'_> {
    fn read(&mut self, path: &Path, source: &Arc<Source>) -> Option<Table> {
        let identity = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        self.open.push((identity.clone(), source.name.clone()));
        let table = parse(source, self.problems).map(|own| self.with_includes(path, own));
        self.open.pop();
        self.done.push(identity);
        table
    }

    fn with_includes(&mut self, path: &Path, mut own: Table) -> Table {
        let mut merged = Table::default();
        let graph = own.entries.iter_mut().find(|entry| entry.key == "graph");
        let include = match graph {
            Some(Entry { value: Node { content: Content::Table(graph), .. }, .. }) => graph.remove("include"),
            _ => None,
        };
        let files = include.map(|entry| self.included_files(&entry)).unwrap_or_default();
        for item in files {
            if let Some(part) = self.read_include(path, &item) {
                self.refuse_siblings(&merged, &part);
                merge(&mut merged, part);
            }
        }
        merge(&mut merged, own);
        merged
    }

    fn included_files(&mut self, entry: &Entry) -> Vec<(String, Place)> {
        let items = match entry.value.array() {
            Some(items) => items,
            None => std::slice::from_ref(&entry.value),
        };
        let mut files = Vec::new();
        for item in items {
            match item.text() {
                Some(text) => files.push((text.to_owned(), item.place.clone())),
                None => self.problems.push(Problem::error(
                    &item.place,
                    format!("`include` takes graphs by name and files, not {}", item.kind()),
                    "write include = [\"coffee\"], or [\"parts/tof.toml\"]",
                )),
            }
        }
        files
    }

    fn read_include(&mut self, including: &Path, (name, place): &(String, Place)) -> Option<Table> {
        let folder = including.parent().unwrap_or(Path::new(""));
        let path = match find_included(name, folder) {
            Ok(path) => path,
            Err(unknown) => {
                self.problems.push(Problem::error(place, unknown.to_string(), unknown.help()));
                return None;
            }
        };
        let identity = path.canonicalize().unwrap_or_else(|_| path.clone());
        if let Some(start) = self.open.iter().position(|(open, _)| *open == identity) {
            let chain: Vec<_> = self.open[start..].iter().map(|(_, name)| name.as_str()).collect();
            let message = format!("the files include each other: {} -> {}", chain.join(" -> "), chain[0]);
            self.problems.push(Problem::error(place, message, "remove one of these includes"));
            return None;
        }
        if self.done.contains(&identity) {
            return None;
        }
        if self.open.len() >= INCLUDES_DEEP || self.done.len() >= INCLUDES_MAX {
            let message = format!(
                "more than {INCLUDES_DEEP} files include each other in a row, or {INCLUDES_MAX} are included in all"
            );
            self.problems.push(Problem::error(place, message, "put some of them together"));
            return None;
        }
        match files::read_text(&path, FILE_MAX) {
            Ok(text) => {
                let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
                let folder = folder.unwrap_or(Path::new("."));
                self.read(&path, &Source::included(shown(&path), text, folder))
            }
            Err(FileError { problem, .. }) => {
                let message = format!("cannot read the included file {}: {problem}", shown(&path));
                let help = match problem {
                    FileProblem::NotText { .. } => what_to_do(&problem),
                    _ => "the name counts from the folder of this file",
                };
                self.problems.push(Problem::error(place, message, help));
                None
            }
        }
    }

    fn refuse_siblings(&mut self, before: &Table, part: &Table) {
        for entry in part.entries.iter().filter(|entry| !is_ours(&entry.key)) {
            if let Some(first) = before.get(&entry.key) {
                let message = format!("[{}] is in two included files", entry.key);
                let help = "keep one of the two; only the including file may override a table";
                let problem = Problem::error(&entry.key_place, message, help);
                self.problems.push(problem.see(&first.key_place, "first here"));
            }
        }
    }
}

/// Whether a key at the top belongs to the graph and is no service.
fn is_ours(key: &str) -> bool {
    matches!(key, "graph" | "fault")
}

/// Lays `over` on `base`: services key by key, their values as wholes.
fn merge(base: &mut Table, over: Table) {
    for entry in over.entries {
        let known = base.entries.iter_mut().find(|known| known.key == entry.key);
        match (known, entry) {
            (
                Some(Entry { value: Node { content: Content::Table(known), .. }, .. }),
                Entry { value: Node { content: Content::Table(table), .. }, .. },
            ) => merge_service(known, table),
            // Each part may bring faults of its own.
            (
                Some(Entry { key, value: Node { content: Content::Array(known), .. }, .. }),
                Entry { value: Node { content: Content::Array(more), .. }, .. },
            ) if key == "fault" => known.extend(more),
            (_, entry) => base.put(entry),
        }
    }
}

fn merge_service(base: &mut Table, over: Table) {
    for entry in over.entries {
        let known = base.entries.iter_mut().find(|known| known.key == entry.key);
        match (known, entry) {
            (
                Some(Entry { key, value: Node { content: Content::Table(known), .. }, .. }),
                Entry { value: Node { content: Content::Table(table), .. }, .. },
            ) if matches!(key.as_str(), "launch" | "defaults" | "view") => {
                table.entries.into_iter().for_each(|entry| known.put(entry));
            }
            // Topics from outside add up: each part names those that it needs.
            (
                Some(Entry { key, value: Node { content: Content::Array(known), .. }, .. }),
                Entry { value: Node { content: Content::Array(more), .. }, .. },
            ) if key == "external" => known.extend(more),
            (_, entry) => base.put(entry),
        }
    }
}

fn apply(overrides: &Overrides, table: &mut Table, problems: &mut Problems) {
    for role in &overrides.without {
        let source = Source::argument("--without", role);
        let place = Place::new(&source, "--without ".len()..source.text.len());
        if find_service(table, role, &place, problems) {
            table.remove(role);
        }
    }
    for swap in &overrides.swap {
        let source = Source::argument("--swap", swap);
        let Some(change) = split(&source, "--swap", "role=binary", problems) else { continue };
        let role = Key { name: change.path.clone(), place: change.path_place.clone() };
        if !find_service(table, &role.name, &role.place, problems) {
            continue;
        }
        let place = Place::new(&source, change.value_offset..source.text.len());
        let content = Content::Text(place.text().to_owned());
        let run = Key { name: "run".to_owned(), place: role.place.clone() };
        put_at(table, &[role, run], Node { content, place });
    }
    for set in &overrides.set {
        let source = Source::argument("--set", set);
        let Some(change) = split(&source, "--set", "role.parameter=value", problems) else { continue };
        let keys = keys_of(&change, &source);
        let [role, rest @ ..] = keys.as_slice() else { continue };
        if rest.is_empty() || keys.iter().any(|key| key.name.is_empty()) {
            let message = format!("`{}` names no parameter", change.path);
            let help = format!("write --set {}.parameter=value", role.name);
            problems.push(Problem::error(&change.path_place, message, help));
        } else if keys.len() > KEYS_MAX {
            let message = format!("`{}` has {} parts", files::in_brief(&change.path), keys.len());
            let help = format!("a parameter lies no deeper than {KEYS_MAX} tables");
            problems.push(Problem::error(&change.path_place, message, help));
        } else if role.name == "graph" || find_service(table, &role.name, &role.place, problems) {
            let value = parse_value(&source, change.value_offset, problems);
            put_at(table, &keys, value);
        }
    }
    let values = [
        ("--seed", "seed", overrides.seed.map(|seed| (seed.to_string(), Content::Number(seed.into())))),
        ("--board", "name", overrides.board.clone().map(|name| (name.clone(), Content::Text(name)))),
    ];
    for (option, key, value) in values {
        let Some((text, content)) = value else { continue };
        let source = Source::argument(option, &text);
        let place = Place::new(&source, option.len() + 1..source.text.len());
        let keys = ["graph", key].map(|name| Key { name: name.to_owned(), place: place.clone() });
        put_at(table, &keys, Node { content, place });
    }
}

/// A key, and where it stands.
struct Key {
    name: String,
    place: Place,
}

/// The keys of a dotted path, each with its own place.
fn keys_of(change: &Change, source: &Arc<Source>) -> Vec<Key> {
    let text = change.path_place.text();
    let mut start = change.path_place.start();
    let mut keys = Vec::new();
    for piece in text.split('.') {
        let name = piece.trim();
        let begin = start + (piece.len() - piece.trim_start().len());
        keys.push(Key { name: name.to_owned(), place: Place::new(source, begin..begin + name.len()) });
        start += piece.len() + 1;
    }
    keys
}

struct Change {
    path: String,
    path_place: Place,
    value_offset: usize,
}

fn split(source: &Arc<Source>, option: &str, form: &str, problems: &mut Problems) -> Option<Change> {
    let start = option.len() + 1;
    let Some(equals) = source.text.get(start..).and_then(|text| text.find('=')) else {
        let place = Place::new(source, start..source.text.len());
        let message = format!("`{}` has no `=`", place.text());
        problems.push(Problem::error(&place, message, format!("write {option} {form}")));
        return None;
    };
    let path_place = Place::new(source, start..start + equals);
    let path = path_place.text().trim().to_owned();
    Some(Change { path, path_place, value_offset: start + equals + 1 })
}

fn find_service(table: &Table, role: &str, place: &Place, problems: &mut Problems) -> bool {
    let known = table.entries.iter().map(|entry| entry.key.as_str()).filter(|key| !is_ours(key));
    if known.clone().any(|key| key == role) {
        return true;
    }
    let message = format!("the graph has no service `{role}`");
    problems.push(Problem::error(place, message, hint(role, known, "services")));
    false
}

fn put_at(table: &mut Table, keys: &[Key], value: Node) {
    let [key, rest @ ..] = keys else { return };
    let entry = |value| Entry { key: key.name.clone(), key_place: key.place.clone(), value };
    if rest.is_empty() {
        table.put(entry(value));
        return;
    }
    if table.get(&key.name).is_none_or(|entry| entry.value.table().is_none()) {
        let empty = Node { content: Content::Table(Table::default()), place: key.place.clone() };
        table.put(entry(empty));
    }
    let inner = table.entries.iter_mut().find(|entry| entry.key == key.name);
    if let Some(Entry { value: Node { content: Content::Table(inner), .. }, .. }) = inner {
        put_at(inner, rest, value);
    }
}
