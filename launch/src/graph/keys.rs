//! Keys of a table: what they take, and which there are.

use super::problem::{Problem, Problems};
use super::suggest::hint;
use super::tree::Entry;

/// The value, or a problem that says what the key takes.
pub(super) fn take<T>(value: Option<T>, entry: &Entry, wanted: &str, problems: &mut Problems) -> Option<T> {
    if value.is_none() && !entry.value.is_nonsense() {
        let written = entry.value.place.text();
        let message = if written.is_empty() || written.contains('\n') || entry.value.table().is_some() {
            format!("`{}` takes {wanted}", entry.key)
        } else {
            format!("`{}` takes {wanted}, not {written}", entry.key)
        };
        problems.push(Problem::error(&entry.value.place, message, "write such a value, or remove the line"));
    }
    value
}

pub(super) fn refuse_key(entry: &Entry, table: &str, known: &[&str], problems: &mut Problems) {
    let message = format!("{table} has no key `{}`", entry.key);
    let help = hint(&entry.key, known.iter().copied(), "its keys");
    problems.push(Problem::error(&entry.key_place, message, help));
}
