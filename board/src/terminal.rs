//! Text on its way to a terminal.
//!
//! What a message, a log or a name says is somebody else's: an escape sequence in it could retitle the
//! window, repaint the screen, or answer a question in the operator's name.

/// The text with everything that a terminal would obey written out, such as `\u{1b}` for an escape: control
/// characters of both sets, line ends among them, and the marks that turn the direction of writing. A tab
/// stays.
pub fn harmless(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for letter in text.chars() {
        if is_obeyed(letter) {
            shown.extend(letter.escape_unicode());
        } else {
            shown.push(letter);
        }
    }
    shown
}

/// A number of bytes as people read it, with three digits: `12.3 MiB`.
pub fn bytes(count: u64) -> String {
    let (size, unit) = match count {
        0..1024 => return format!("{count} B"),
        1024..1_048_576 => (count as f64 / 1024.0, "KiB"),
        1_048_576..1_073_741_824 => (count as f64 / 1_048_576.0, "MiB"),
        _ => (count as f64 / 1_073_741_824.0, "GiB"),
    };
    format!("{} {unit}", three_digits(size))
}

/// A number with about three digits.
pub fn three_digits(number: f64) -> String {
    match number.abs() {
        size if size < 10.0 => format!("{number:.2}"),
        size if size < 100.0 => format!("{number:.1}"),
        _ => format!("{number:.0}"),
    }
}

fn is_obeyed(letter: char) -> bool {
    match letter {
        '\t' => false,
        // Line and paragraph separators end a line on some terminals; the others turn the direction of what
        // follows.
        '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => true,
        _ => letter.is_control(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[track_caller]
    fn check(text: &str, shown: &str) {
        assert_eq!(harmless(text), shown);
    }

    #[test]
    fn what_a_terminal_obeys_is_written_out() {
        check("room 207", "room 207");
        check("Käse\t€ 日本", "Käse\t€ 日本");
        check("\u{1b}]0;o\u{7}", "\\u{1b}]0;o\\u{7}");
        check("a\r\nb", "a\\u{d}\\u{a}b");
        check("\u{9b}2J\u{7f}", "\\u{9b}2J\\u{7f}");
        check("\u{202e}drawkcab\u{2069}\u{200f}", "\\u{202e}drawkcab\\u{2069}\\u{200f}");
    }

    proptest! {
        #[test]
        fn nothing_obeyed_is_left(text in any::<String>()) {
            let shown = harmless(&text);
            prop_assert!(!shown.chars().any(is_obeyed), "{shown:?}");
        }
    }
}
