//! How things look: tables, colours, durations, numbers.

use anstyle::{AnsiColor, Style};
use comfy_table::{Table, presets};
use serde_json::Value;
use std::io::{self, IsTerminal as _, Write as _};

/// A line on the standard output.
pub(crate) fn line(text: &str) -> io::Result<()> {
    writeln!(io::stdout(), "{text}")
}

/// A JSON document on a line.
pub(crate) fn json(value: &Value) -> io::Result<()> {
    line(&value.to_string())
}

/// Whether the standard output takes colours.
pub(crate) fn colours() -> bool {
    io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}

fn styled(on: bool, style: Style, text: &str) -> String {
    if on { format!("{style}{text}{style:#}") } else { text.to_owned() }
}

pub(crate) fn good(on: bool, text: &str) -> String {
    styled(on, AnsiColor::Green.on_default(), text)
}

pub(crate) fn doubtful(on: bool, text: &str) -> String {
    styled(on, AnsiColor::Yellow.on_default(), text)
}

pub(crate) fn bad(on: bool, text: &str) -> String {
    styled(on, AnsiColor::Red.on_default().bold(), text)
}

pub(crate) fn faint(on: bool, text: &str) -> String {
    styled(on, Style::new().dimmed(), text)
}

/// A table without frames, as wide as the terminal.
pub(crate) fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_content_arrangement(comfy_table::ContentArrangement::Dynamic);
    table.set_header(header.iter().map(|title| title.to_uppercase()).collect::<Vec<_>>());
    table
}

/// A duration with three digits: `830 ns`, `12.5 ms`, `3.2 s`, `12 min`.
pub(crate) fn duration(nanoseconds: f64) -> String {
    let size = nanoseconds.abs();
    match size {
        _ if size < 1e3 => format!("{nanoseconds:.0} ns"),
        _ if size < 1e6 => format!("{} us", three(nanoseconds / 1e3)),
        _ if size < 1e9 => format!("{} ms", three(nanoseconds / 1e6)),
        _ if size < 120e9 => format!("{} s", three(nanoseconds / 1e9)),
        _ if size < 7200e9 => format!("{:.0} min", nanoseconds / 60e9),
        _ => format!("{:.1} h", nanoseconds / 3600e9),
    }
}

/// Bytes with three digits.
pub(crate) fn bytes(count: u64) -> String {
    match count {
        0..1024 => format!("{count} B"),
        1024..1_048_576 => format!("{} KiB", three(count as f64 / 1024.0)),
        1_048_576..1_073_741_824 => format!("{} MiB", three(count as f64 / 1_048_576.0)),
        _ => format!("{} GiB", three(count as f64 / 1_073_741_824.0)),
    }
}

/// A number with about three digits.
pub(crate) fn three(number: f64) -> String {
    match number.abs() {
        size if size < 10.0 => format!("{number:.2}"),
        size if size < 100.0 => format!("{number:.1}"),
        _ => format!("{number:.0}"),
    }
}

/// A value of a message in one short piece.
pub(crate) fn value(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        plain => plain.to_string(),
    }
}
