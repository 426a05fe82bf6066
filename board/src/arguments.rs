//! What numbers of a command line may be; the one place for all commands, as parsers for clap.

use std::time::Duration;

/// The longest time that a command line may ask for, in seconds: thirty years, which every clock and sum can
/// hold.
const LONGEST_S: f64 = 1e9;

/// A number above zero, and not an infinite one.
///
/// # Errors
/// For everything else, with what is wrong.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > 0.0 && number.is_finite() => Ok(number),
        Ok(number) => Err(format!("{number} is no finite number above zero")),
        Err(_) => Err("this is no number; give one above zero, such as 0.5".to_owned()),
    }
}

/// A time in seconds above zero, at most thirty years.
///
/// # Errors
/// As [`positive`], and for times that are longer.
pub fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = positive(text)?;
    if seconds > LONGEST_S {
        return Err(format!("{seconds} s is too long; at most {LONGEST_S} s"));
    }
    // Less than a nanosecond is rounded to nothing, which is not what was asked for.
    Ok(Duration::from_secs_f64(seconds).max(Duration::from_nanos(1)))
}

/// A frequency in hertz, as the time between two events: from once a day to a million times a second.
///
/// # Errors
/// As [`positive`], and for frequencies outside of that.
pub fn period(text: &str) -> Result<Duration, String> {
    let hertz = positive(text)?;
    let period_s = 1.0 / hertz;
    if !(1e-6..=86_400.0).contains(&period_s) {
        return Err(format!("{hertz} Hz is out of range; from once a day (1.16e-5) to 1e6"));
    }
    Ok(Duration::from_secs_f64(period_s))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[track_caller]
    fn check<T>(parser: fn(&str) -> Result<T, String>, text: &str, valid: bool) {
        assert_eq!(parser(text).is_ok(), valid, "{text:?}");
    }

    #[test]
    fn numbers() {
        check(positive, "0.5", true);
        check(positive, ".5", true);
        check(positive, "1e300", true);
        for text in
            ["nan", "-nan", "inf", "infinity", "-inf", "1e999", "0", "-0", "-1", "", "x", "1s", "0x10"]
        {
            check(positive, text, false);
            check(seconds, text, false);
            check(period, text, false);
        }
    }

    #[test]
    fn times() {
        check(seconds, "1e9", true);
        check(seconds, "1.1e9", false);
        check(seconds, "1e300", false);
        assert_eq!(seconds("0.25"), Ok(Duration::from_millis(250)));
        assert_eq!(seconds("1e-300"), Ok(Duration::from_nanos(1)));
        assert_eq!(period("50"), Ok(Duration::from_millis(20)));
        check(period, "1e-6", false);
        check(period, "1e7", false);
    }

    proptest! {
        #[test]
        fn nothing_panics(text in "[-+.0-9a-zA-Z]{0,12}") {
            let _ = (positive(&text), seconds(&text), period(&text));
        }
    }
}
