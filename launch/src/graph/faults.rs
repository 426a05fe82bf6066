//! `[[fault]]`: what is done to services at logical moments.

use super::keys::{refuse_key, take};
use super::problem::{Problem, Problems};
use super::suggest::hint;
use super::tree::{Content, Entry, Node, Table};
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// A service is killed or stopped at a logical moment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Fault {
    /// When, in logical time.
    pub(crate) at: Duration,
    /// The service.
    pub(crate) role: String,
    /// What is done to it.
    pub(crate) kind: FaultKind,
}

/// What is done to a service.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
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

/// `None` when something is wrong with it: all of it is told.
fn read_fault(node: &Node, table: &Table, roles: &[&str], problems: &mut Problems) -> Option<Fault> {
    const KEYS: [&str; 5] = ["at_s", "kill", "stop", "for_s", "down_s"];
    let unknown: Vec<&Entry> =
        table.entries.iter().filter(|entry| !KEYS.contains(&entry.key.as_str())).collect();
    unknown.iter().for_each(|entry| refuse_key(entry, "a fault", &KEYS, problems));
    let mut refused = |message: &str| {
        problems.push(Problem::error(&node.place, message, format!("write {FORM}")));
    };
    let at = table.get("at_s");
    if at.is_none() {
        refused("a fault lacks `at_s`, its logical moment");
    }
    let (kill, stop) = (table.get("kill"), table.get("stop"));
    if kill.is_some() == stop.is_some() {
        refused("a fault has either `kill` or `stop`");
    }
    let at = at.and_then(|at| seconds(at, problems));
    let roles: Vec<Option<&str>> =
        [kill, stop].into_iter().flatten().map(|victim| role_of(victim, roles, problems)).collect();
    let mut span = |key: &str| table.get(key).map(|entry| (entry, seconds(entry, problems)));
    let (lasting, down) = (span("for_s"), span("down_s"));
    let odd = match (kill, stop) {
        (Some(victim), None) => lasting.as_ref().map(|(odd, _)| (*odd, victim)),
        (None, Some(victim)) => down.as_ref().map(|(odd, _)| (*odd, victim)),
        _ => None,
    };
    if let Some((odd, victim)) = odd {
        let message = format!("`{}` means nothing to `{}`", odd.key, victim.key);
        let help = "`for_s` says how long a stopped service hangs, `down_s` when the successor of a killed one takes its first step";
        problems.push(Problem::error(&odd.key_place, message, help));
    }
    let ([Some(role)], Some(at), None, true) = (roles.as_slice(), at, odd, unknown.is_empty()) else {
        return None;
    };
    // A span that was given and is wrong was told.
    let whole = |span: Option<(&Entry, Option<Duration>)>| match span {
        Some((_, span)) => span.map(Some),
        None => Some(None),
    };
    let kind = match kill {
        Some(_) => FaultKind::Kill { down: whole(down)? },
        None => FaultKind::Stop { lasting: whole(lasting)? },
    };
    Some(Fault { at, role: (*role).to_owned(), kind })
}

/// The service that a fault strikes.
fn role_of<'a>(victim: &'a Entry, roles: &[&str], problems: &mut Problems) -> Option<&'a str> {
    let role = take(victim.value.text(), victim, "the name of a service", problems)?;
    if !roles.contains(&role) {
        let message = format!("the graph has no service `{role}`");
        let help = hint(role, roles.iter().copied(), "services");
        problems.push(Problem::error(&victim.value.place, message, help));
        return None;
    }
    Some(role)
}

fn seconds(entry: &Entry, problems: &mut Problems) -> Option<Duration> {
    // A day is longer than any run that is meant.
    let number = entry.value.number().filter(|number| (0.0..=86_400.0).contains(number));
    let number = take(number, entry, "seconds of logical time, not negative", problems)?;
    Some(Duration::from_nanos((number * 1e9).round() as u64))
}
