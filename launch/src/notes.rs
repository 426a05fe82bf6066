//! What a recording says of its run, so that the run can be made again.

use crate::graph::{Checked, Fault, Overrides};
use crate::run::Outcome;
use messages::Time;
use recording::{Manifest, Recorder};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Everything that decides how a run goes, beside the seed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Origins {
    /// The graph file; other files count from its folder.
    pub(crate) file: PathBuf,
    /// Its text, with all that it includes.
    pub(crate) text: String,
    /// What the command line changed.
    pub(crate) overrides: Overrides,
    /// The binaries by role.
    binaries: BTreeMap<String, Binary>,
    /// The hashes of the files that parameters name.
    files: BTreeMap<PathBuf, String>,
}

/// Enough to see that a binary was built anew.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Binary {
    path: PathBuf,
    bytes: u64,
    modified_ns: u64,
}

/// The note with the [`Origins`], as JSON.
const ORIGINS: &str = "run";
/// The note with the last instant, in nanoseconds.
const END: &str = "end_ns";
/// The note with the faults that a test has ordered, as a JSON array.
const ORDERED: &str = "ordered_faults";
/// The note with the topics on which something came from outside, as a JSON array.
const OUTSIDE: &str = "outside";
/// The note with the roles that ran alone on recorded inputs, as a JSON array.
pub(crate) const DRIVEN: &str = "driven";

/// The notes for a recording of this graph.
pub(crate) fn of_graph(graph: &Checked) -> BTreeMap<String, String> {
    let origins = Origins::of(graph);
    serde_json::to_string(&origins).map(|json| (ORIGINS.to_owned(), json)).into_iter().collect()
}

/// The notes that are known at the end only.
pub(crate) fn at_end<'a>(
    recorder: &mut Recorder,
    outcome: Option<&Outcome>,
    outside: impl Iterator<Item = &'a str>,
) {
    if let Some(outcome) = outcome {
        recorder.note(END, &outcome.end.as_nanos().to_string());
        recorder.note(ORDERED, &serde_json::json!(outcome.ordered).to_string());
    }
    recorder.note(OUTSIDE, &serde_json::json!(outside.collect::<Vec<_>>()).to_string());
}

/// Of which run a recording is; `None` when it was made otherwise than by `launch up --lockstep --record`.
pub(crate) fn origins(manifest: &Manifest) -> Option<Origins> {
    serde_json::from_str(manifest.notes.get(ORIGINS)?).ok()
}

/// The last instant; `None` when the run did not end in order.
pub(crate) fn end(manifest: &Manifest) -> Option<Time> {
    manifest.notes.get(END)?.parse().ok().map(Time::from_nanos)
}

/// Faults that a test ordered while it ran.
pub(crate) fn ordered(manifest: &Manifest) -> Vec<Fault> {
    manifest.notes.get(ORDERED).and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default()
}

/// Topics on which something came from outside; all of them when that is not known.
pub(crate) fn outside(manifest: &Manifest) -> Vec<String> {
    let known = manifest.notes.get(OUTSIDE).and_then(|text| serde_json::from_str(text).ok());
    known.unwrap_or_else(|| manifest.topics.iter().map(|topic| topic.name.clone()).collect())
}

/// The roles that ran alone; none when the whole graph ran.
pub(crate) fn driven(manifest: &Manifest) -> Vec<String> {
    manifest.notes.get(DRIVEN).and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default()
}

impl Origins {
    fn of(graph: &Checked) -> Self {
        let file = graph.file.file_name().map_or_else(|| graph.file.clone(), |name| graph.folder.join(name));
        let binaries = graph.services.iter().filter_map(|service| {
            let found = std::fs::metadata(&service.binary).ok()?;
            let modified = found.modified().ok()?.duration_since(std::time::UNIX_EPOCH).ok()?;
            let modified_ns = u64::try_from(modified.as_nanos()).unwrap_or(u64::MAX);
            let binary = Binary { path: service.binary.clone(), bytes: found.len(), modified_ns };
            Some((service.role.clone(), binary))
        });
        let texts = graph
            .services
            .iter()
            .filter_map(|service| service.parameters.as_object())
            .flat_map(|parameters| parameters.values().filter_map(|value| value.as_str()))
            .filter(|text| !text.is_empty());
        let files = texts.filter_map(|text| Some((PathBuf::from(text), hash(&graph.folder.join(text))?)));
        Self {
            file,
            text: graph.text.clone(),
            overrides: graph.overrides.clone(),
            binaries: binaries.collect(),
            files: files.collect(),
        }
    }

    /// What decides how a run goes and is not what it was: in words, nothing when all is the same. Only these roles count.
    pub(crate) fn changes(&self, graph: &Checked, roles: &[String]) -> Vec<String> {
        let now = Self::of(graph);
        let mut changes = Vec::new();
        for (role, binary) in self.binaries.iter().filter(|(role, _)| roles.contains(role)) {
            if now.binaries.get(role).is_some_and(|other| other.path == binary.path && other != binary) {
                changes.push(format!("`{role}` was built anew"));
            }
        }
        for (file, hash) in &self.files {
            if now.files.get(file).is_some_and(|other| other != hash) {
                changes.push(format!("{} was changed", file.display()));
            }
        }
        changes
    }
}

/// Larger files are no part of what a recording knows again: no binary, map or log is.
const HASHED_MAX: u64 = 256 << 20;

fn hash(file: &Path) -> Option<String> {
    Some(blake3::hash(&files::read(file, HASHED_MAX).ok()?).to_hex().chars().take(32).collect())
}
