//! Parameters against the JSON schema that their service hands out.

use super::problem::{Problem, Problems};
use super::suggest::{nearest, quoted};
use super::tree::{Content, Entry, Node};
use messages::{Fault, Misfit, Schema, Step, unit_of};
use serde_json::Value;

/// How many names are listed where none resembles the one given.
const NAMES_MAX: usize = 8;

/// A default that is longer than this is not shown.
const DEFAULT_SHOWN_MAX: usize = 60;

/// Checks one parameter of a service by name, type and range.
pub(crate) fn check(service: &str, schema: Schema<'_>, entry: &Entry, problems: &mut Problems) {
    for misfit in schema.misfits(&entry.key, &entry.value.to_json()) {
        let (found, key) = locate(entry, &misfit.path);
        if found.is_nonsense() {
            continue;
        }
        problems.push(match &*misfit.fault {
            Fault::Unknown { known } => unknown(service, key.unwrap_or(entry), &misfit, known),
            fault => {
                let what = misfit.what(&format!(" of `{service}`"));
                Problem::error(&found.place, what, remedy(service, &misfit, fault, found))
            }
        });
    }
}

/// The value at a path, and the entry whose it is.
fn locate<'a>(entry: &'a Entry, path: &[Step]) -> (&'a Node, Option<&'a Entry>) {
    path.iter().skip(1).fold((&entry.value, Some(entry)), |(node, key), step| match (step, &node.content) {
        (Step::Key(name), Content::Table(table)) => {
            let found = table.entries.iter().find(|entry| entry.key == *name);
            (found.map_or(node, |found| &found.value), found.or(key))
        }
        (Step::Item(index), Content::Array(items)) => (items.get(*index).unwrap_or(node), key),
        _ => (node, key),
    })
}

fn remedy(service: &str, misfit: &Misfit, fault: &Fault, node: &Node) -> String {
    match fault {
        Fault::NoChoice { choices, value: Value::String(text) } => {
            match nearest(text, choices.iter().map(String::as_str)) {
                Some(choice) => format!("did you mean \"{choice}\"?"),
                None => misfit.remedy(),
            }
        }
        Fault::WrongType { wanted, .. } => {
            let wants = |kind: &str| wanted.iter().any(|wanted| wanted == kind);
            // A number in quotes, the most common slip, and a fraction where an integer is meant.
            let bare = node.text().map(str::trim).and_then(|text| text.parse::<f64>().ok());
            match (bare.filter(|number| number.is_finite()), node.number()) {
                (Some(bare), _) if wants("number") || wants("integer") => {
                    format!("write `{} = {bare}`, without quotes", misfit.name())
                }
                (_, Some(number)) if wants("integer") => {
                    format!("write a whole number, such as {}", number.round())
                }
                _ => default_help(service, misfit),
            }
        }
        Fault::NoChoice { .. } | Fault::WrongCount { .. } => default_help(service, misfit),
        Fault::Unknown { .. } | Fault::OutOfRange { .. } | Fault::Lacks { .. } => misfit.remedy(),
    }
}

fn default_help(service: &str, misfit: &Misfit) -> String {
    match (misfit.path.first(), misfit.default.as_ref().map(in_toml)) {
        (Some(Step::Key(key)), Some(default)) if default.len() <= DEFAULT_SHOWN_MAX => {
            format!("the default is `{key} = {default}`")
        }
        _ => format!("`{service} --example` shows how it is written"),
    }
}

fn unknown(service: &str, entry: &Entry, misfit: &Misfit, known: &[String]) -> Problem {
    let outer = Misfit { path: misfit.path[..misfit.path.len() - 1].to_vec(), ..misfit.clone() }.name();
    let owner = if outer.is_empty() { service.to_owned() } else { format!("{service}.{outer}") };
    let message = format!("`{owner}` has no parameter `{}`", entry.key);
    let known = || known.iter().map(String::as_str);
    let stem = |name: &str| name.strip_suffix(suffix_of(name)).unwrap_or(name).to_owned();
    let other_unit = known().find(|name| stem(name) == stem(&entry.key) && *name != entry.key);
    let help = match (other_unit, nearest(&entry.key, known())) {
        (Some(name), _) if !suffix_of(name).is_empty() => {
            format!("give it in {}: `{name}`", unit_of(name))
        }
        (_, Some(name)) => format!("did you mean `{name}`?"),
        _ if known().next().is_none() => "it takes none; remove the line".to_owned(),
        _ => {
            let more = known().count().saturating_sub(NAMES_MAX);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            format!("it has {}{more}", quoted(known().take(NAMES_MAX)))
        }
    };
    Problem::error(&entry.key_place, message, help)
}

/// The part of a name that is its unit, with the underscore.
fn suffix_of(name: &str) -> &str {
    if unit_of(name).is_empty() {
        return "";
    }
    let long = ["_m_per_s2", "_m_per_s", "_rad_per_s"].iter().find(|suffix| name.ends_with(**suffix));
    match long {
        Some(suffix) => &name[name.len() - suffix.len()..],
        None => name.rfind('_').map_or("", |start| &name[start..]),
    }
}

fn in_toml(value: &Value) -> String {
    match value {
        Value::Object(fields) => {
            let fields: Vec<_> =
                fields.iter().map(|(key, value)| format!("{key} = {}", in_toml(value))).collect();
            format!("{{ {} }}", fields.join(", "))
        }
        Value::Array(items) => format!("[{}]", items.iter().map(in_toml).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}
