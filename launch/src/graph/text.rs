//! A graph as text again: the file with all that it includes, for those who keep it.

use super::tree::{Content, Entry, Node, Table};
use std::fmt::Write as _;

/// The tables as TOML that reads back as the same tables, in the same order.
pub(super) fn to_toml(table: &Table) -> String {
    let mut text = String::new();
    // What stands outside of tables comes first, or it would belong to one.
    for entry in table.entries.iter().filter(|entry| entry.value.table().is_none()) {
        line(&mut text, entry);
    }
    for entry in &table.entries {
        let Some(inner) = entry.value.table() else { continue };
        let _ = writeln!(text, "\n[{}]", key(&entry.key));
        inner.entries.iter().for_each(|entry| line(&mut text, entry));
    }
    text
}

fn line(text: &mut String, entry: &Entry) {
    let _ = writeln!(text, "{} = {}", key(&entry.key), value(&entry.value));
}

fn key(key: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_';
    if !key.is_empty() && key.bytes().all(plain) { key.to_owned() } else { quoted(key) }
}

fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for letter in text.chars() {
        match letter {
            '"' | '\\' => quoted.extend(['\\', letter]),
            letter if letter.is_control() => _ = write!(quoted, "\\u{:04x}", u32::from(letter)),
            letter => quoted.push(letter),
        }
    }
    quoted + "\""
}

fn value(node: &Node) -> String {
    match &node.content {
        Content::Text(text) => quoted(text),
        Content::Date(date) => date.clone(),
        Content::Number(number) => number.to_string(),
        Content::Boolean(value) => value.to_string(),
        // A graph that holds it is refused.
        Content::Nonsense => "nan".to_owned(),
        Content::Array(items) => format!("[{}]", items.iter().map(value).collect::<Vec<_>>().join(", ")),
        Content::Table(table) => {
            let pairs: Vec<_> = table
                .entries
                .iter()
                .map(|entry| format!("{} = {}", key(&entry.key), value(&entry.value)))
                .collect();
            format!("{{ {} }}", pairs.join(", "))
        }
    }
}
