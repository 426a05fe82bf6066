//! `[[fault]]`: what is done to services at logical moments.

use super::problem::{Problem, Problems};
use super::settings::{refuse_key, take};
use super::suggest::hint;
use super::tree::{Content, Entry, Node, Table};
use serde::Serialize;
use std::time::Duration;

/// A service is killed or stopped at a logical moment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Fault {
    /// When, in logical time.
    pub(crate) at: Duration,
    /// The service.
    pub(crate) role: String,
    /// What is done to it.
    pub(crate) kind: FaultKind,
}

/// What is done to a service.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum FaultKind {
    /// It is killed; its successor takes its first step so much later, if it is restarted at all.
    Kill {
        /// From the death to the successor's first step; `None` for the usual 0.1 s.
        down: Option<Duration>,
    },
    /// It hangs.
    Stop {
        /// For so long; `None` for ever, that is until it counts as hanging.
        lasting: Option<Duration>,
    },
}

const FORM: &str =
    "tables such as { at_s = 12.0, kill = \"planner\" } or { at_s = 12.0, stop = \"planner\", for_s = 0.5 }";

/// Reads the faults of a graph with these services.
pub(super) fn read_faults(entry: &Entry, roles: &[&str], problems: &mut Problems) -> Vec<Fault> {
    let Some(items) = take(entry.value.array(), entry, FORM, problems) else { return Vec::new() };
    let mut faults = Vec::new();
    for item in items {
        match &item.content {
            Content::Table(table) => faults.extend(read_fault(item, table, roles, problems)),
            _ => {
                let message = format!("`fault` takes tables, not {}", item.kind());
                problems.push(Problem::error(&item.place, message, format!("write {FORM}")));
            }
        }
    }
    faults
}

fn read_fault(node: &Node, table: &Table, roles: &[&str], problems: &mut Problems) -> Option<Fault> {
    const KEYS: [&str; 5] = ["at_s", "kill", "stop", "for_s", "down_s"];
    let unknown: Vec<&Entry> =
        table.entries.iter().filter(|entry| !KEYS.contains(&entry.key.as_str())).collect();
    unknown.iter().for_each(|entry| refuse_key(entry, "a fault", &KEYS, problems));
    let refused = |message: &str, problems: &mut Problems| {
        problems.push(Problem::error(&node.place, message, format!("write {FORM}")));
        None
    };
    let Some(at) = table.get("at_s") else {
        return refused("a fault lacks `at_s`, its logical moment", problems);
    };
    let at = seconds(at, problems)?;
    let (kill, stop) = (table.get("kill"), table.get("stop"));
    let ((Some(victim), None) | (None, Some(victim))) = (kill, stop) else {
        return refused("a fault has either `kill` or `stop`", problems);
    };
    let odd = if kill.is_some() { table.get("for_s") } else { table.get("down_s") };
    if let Some(odd) = odd {
        let message = format!("`{}` means nothing to `{}`", odd.key, victim.key);
        let help = "`for_s` says how long a stopped service hangs, `down_s` when the successor of a killed one takes its first step";
        problems.push(Problem::error(&odd.key_place, message, help));
        return None;
    }
    let role = take(victim.value.text(), victim, "the name of a service", problems)?;
    if !roles.contains(&role) {
        let message = format!("the graph has no service `{role}`");
        let help = hint(role, roles.iter().copied(), "services");
        problems.push(Problem::error(&victim.value.place, message, help));
        return None;
    }
    let span = |key: &str, problems: &mut Problems| match table.get(key) {
        Some(entry) => seconds(entry, problems).map(Some),
        None => Some(None),
    };
    let kind = match kill {
        Some(_) => FaultKind::Kill { down: span("down_s", problems)? },
        None => FaultKind::Stop { lasting: span("for_s", problems)? },
    };
    unknown.is_empty().then(|| Fault { at, role: role.to_owned(), kind })
}

fn seconds(entry: &Entry, problems: &mut Problems) -> Option<Duration> {
    // A day is longer than any run that is meant.
    let number = entry.value.number().filter(|number| (0.0..=86_400.0).contains(number));
    let number = take(number, entry, "seconds of logical time, not negative", problems)?;
    Some(Duration::from_nanos((number * 1e9).round() as u64))
}
