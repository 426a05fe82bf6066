//! Numbers as people read them: as many digits as tell something, and none without a meaning.

/// Four significant digits, or the whole number; `-` for what is not known.
pub(crate) fn number(value: f64) -> String {
    number_within(value, 6)
}

/// As [`number`], with at most so many decimals.
pub(crate) fn number_within(value: f64, decimals_most: usize) -> String {
    if value.is_nan() {
        return "-".to_owned();
    }
    if value.is_infinite() || (value.fract() == 0.0 && value.abs() < 1e9) {
        // Minus zero is zero.
        return format!("{:.0}", value + 0.0);
    }
    let smallest = 10.0_f64.powi(-(decimals_most as i32));
    if value.abs() >= 1e9 || (value.abs() < smallest && decimals_most >= 6) {
        return format!("{value:.2e}");
    }
    let whole_digits = value.abs().log10().floor() as i32 + 1;
    let decimals = usize::try_from((4 - whole_digits).max(0)).unwrap_or(0).min(decimals_most);
    let text = format!("{value:.decimals$}");
    if text.trim_start_matches(['-', '0', '.']).is_empty() { text.replace('-', "") } else { text }
}

/// A difference: as [`number`], with its sign.
pub(crate) fn signed(value: f64) -> String {
    let text = number(value);
    if value > 0.0 { format!("+{text}") } else { text }
}

/// A number with its unit, if it has one; a number that is not known has none.
pub(crate) fn with_unit(number: &str, unit: &str) -> String {
    if unit.is_empty() || number == "-" { number.to_owned() } else { format!("{number} {unit}") }
}

/// Numbers below each other: so that their points stand in one column, with spaces before and behind.
pub(crate) fn aligned(numbers: &[String]) -> Vec<String> {
    // What has an exponent or no digits at all stands with its end where the others have their point.
    let parts = numbers.iter().map(|number| match number.split_once('.') {
        Some((whole, rest)) if !rest.contains('e') => (whole.to_owned(), format!(".{rest}")),
        _ => (number.clone(), String::new()),
    });
    let parts: Vec<(String, String)> = parts.collect();
    let before = parts.iter().map(|(whole, _)| whole.chars().count()).max().unwrap_or(0);
    let behind = parts.iter().map(|(_, rest)| rest.chars().count()).max().unwrap_or(0);
    parts.iter().map(|(whole, rest)| format!("{whole:>before$}{rest:<behind$}")).collect()
}

/// A length of time as people speak of it.
pub(crate) fn spoken_time(seconds: f64) -> String {
    match seconds {
        seconds if seconds < 90.0 => format!("{:.0} s", seconds.ceil()),
        seconds if seconds < 5400.0 => format!("{:.0} min", seconds / 60.0),
        seconds => format!("{:.1} h", seconds / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(value: f64, expected: &str) {
        assert_eq!(number(value), expected);
    }

    #[test]
    fn numbers_have_four_digits() {
        check(0.0, "0");
        check(-0.0, "0");
        check(3.0, "3");
        check(123_456.0, "123456");
        check(117.25, "117.2");
        check(0.012_345, "0.01235");
        check(0.000_012_3, "0.000012");
        check(-0.5, "-0.5000");
        check(12_345.6, "12346");
        check(1e-7, "1.00e-7");
        check(-2.5e12, "-2.50e12");
        check(f64::NAN, "-");
        check(f64::INFINITY, "inf");
        check(f64::NEG_INFINITY, "-inf");
    }

    #[test]
    fn a_summary_needs_no_more_than_a_thousandth() {
        assert_eq!(number_within(0.012_345, 3), "0.012");
        assert_eq!(number_within(-0.000_01, 3), "0.000");
        assert_eq!(number_within(45.678_9, 3), "45.68");
    }

    #[test]
    fn signs_and_units() {
        assert_eq!([1.5, -1.5, 0.0].map(signed), ["+1.500", "-1.500", "0"]);
        assert_eq!([with_unit("3", "m"), with_unit("3", ""), with_unit("-", "m")], ["3 m", "3", "-"]);
        assert_eq!([0.4, 45.0, 125.0, 5400.0].map(spoken_time), ["1 s", "45 s", "2 min", "1.5 h"]);
    }

    #[test]
    fn points_stand_in_a_column() {
        let numbers = ["1", "0.012", "117.2", "-", "1.00e-7"].map(str::to_owned);
        assert_eq!(
            aligned(&numbers),
            ["      1    ", "      0.012", "    117.2  ", "      -    ", "1.00e-7    "]
        );
    }
}
