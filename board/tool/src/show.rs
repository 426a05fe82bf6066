//! How things look: tables, colours, durations, numbers.

use anstyle::{AnsiColor, Style};
pub(crate) use board::terminal::{bytes, harmless, three_digits as three};
use comfy_table::{Table, presets};
use serde_json::Value;
use std::io::{self, IsTerminal as _, Write as _};

/// A line on the standard output. What others have said, in a message or a name, goes through [`harmless`]
/// first.
pub(crate) fn line(text: &str) -> io::Result<()> {
    writeln!(io::stdout(), "{text}")
}

/// Bytes on the standard output, as they are.
pub(crate) fn raw(bytes: &[u8]) -> io::Result<()> {
    io::stdout().write_all(bytes)
}

/// A JSON document on a line.
pub(crate) fn json(value: &Value) -> io::Result<()> {
    line(&value.to_string())
}

/// A line beside the output, for whoever looks; where nobody does it is dropped.
pub(crate) fn note(text: &str) {
    let _ = writeln!(io::stderr(), "{}", harmless(text));
}

/// Why a command was not done.
pub(crate) fn error(error: &dyn std::error::Error) {
    let word = bad(io::stderr().is_terminal(), "error");
    let text = error.to_string();
    let lines: Vec<String> = text.lines().map(harmless).collect();
    let _ = writeln!(io::stderr(), "{word}: {}", lines.join("\n"));
}

/// On a terminal: what is going on, in the place of what was said before; an empty text takes it away.
pub(crate) fn progress(text: &str) {
    let _ = write!(io::stderr(), "\r\x1b[K{text}");
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

/// So many of something: `1 topic`, `2 topics`.
pub(crate) fn count(number: usize, one: &str) -> String {
    format!("{number} {one}{}", if number == 1 { "" } else { "s" })
}

/// A number as people read it: six digits, and no more zeros than they mean.
pub(crate) fn number(number: f64) -> String {
    const DIGITS: i32 = 6;
    if number == 0.0 || !number.is_finite() {
        return number.to_string();
    }
    let exponent = number.abs().log10().floor() as i32;
    if !(-5..15).contains(&exponent) {
        let text = format!("{number:.5e}");
        let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{exponent}", without_zeros(digits));
    }
    let decimals = (DIGITS - 1 - exponent).max(0) as usize;
    without_zeros(&format!("{number:.decimals$}")).to_owned()
}

/// Decimal digits without the zeros at their end.
fn without_zeros(digits: &str) -> &str {
    if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { digits }
}

/// A value of a message in one short piece, for a terminal.
pub(crate) fn value(value: &Value) -> String {
    match value {
        Value::String(text) => harmless(text),
        Value::Number(number) if number.is_f64() => self::number(number.as_f64().unwrap_or(f64::NAN)),
        Value::Array(items) => format!("[{}]", items.iter().map(self::value).collect::<Vec<_>>().join(", ")),
        plain => plain.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(number: f64, shown: &str) {
        assert_eq!(self::number(number), shown);
    }

    #[test]
    fn numbers_have_sensible_digits() {
        check(7.793750359095802, "7.79375");
        check(0.1, "0.1");
        check(0.1 + 0.2, "0.3");
        check(-1.5, "-1.5");
        check(1234567.891, "1234568");
        check(100.0, "100");
        check(0.000123456789, "0.000123457");
        check(1.23456789e-9, "1.23457e-9");
        check(1e-9, "1e-9");
        check(1e20, "1e20");
        check(0.0, "0");
        check(f64::NAN, "NaN");
        check(f64::NEG_INFINITY, "-inf");
    }

    #[test]
    fn a_message_says_nothing_to_the_terminal() {
        let text = Value::from("\u{1b}]0;o\u{7}");
        assert_eq!(value(&text), "\\u{1b}]0;o\\u{7}");
        assert_eq!(value(&Value::from(vec![text])), "[\\u{1b}]0;o\\u{7}]");
    }
}
