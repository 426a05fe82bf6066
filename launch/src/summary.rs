//! The last lines of a run.

use crate::numbers::{aligned, number_within};
use board::host::Swept;
use messages::{RunState, RunSummary};
use std::fmt::Write as _;

/// A millimetre and a millisecond are enough for a person.
const DECIMALS: usize = 3;

/// The referee's word as a small table.
pub(crate) fn text(word: &RunSummary, restarts: u32) -> String {
    let verdict = match word.state.get() {
        Ok(RunState::Passed) => "PASSED",
        Ok(RunState::Failed) => "FAILED",
        Ok(RunState::Running) => "stopped before its end",
        Err(_) => "the referee's word has no meaning",
    };
    let mut text = match word.remark.as_str() {
        "" => format!("{verdict}\n"),
        remark => format!("{verdict}: {remark}\n"),
    };
    let mut rows: Vec<(&str, String, &str)> = word
        .figures()
        .iter()
        .map(|figure| (figure.name.as_str(), number_within(figure.value, DECIMALS), figure.unit.as_str()))
        .collect();
    if restarts > 0 {
        rows.push(("restarts", restarts.to_string(), ""));
    }
    let width = rows.iter().map(|(name, ..)| name.chars().count()).max().unwrap_or(0);
    let values: Vec<String> = rows.iter().map(|(_, value, _)| value.clone()).collect();
    for ((name, value, unit), place) in rows.iter().zip(aligned(&values)) {
        // What is not known has no unit.
        let unit = if value == "-" { "" } else { unit };
        let _ = writeln!(text, "{}", format!("  {name:width$}  {place} {unit}").trim_end());
    }
    text
}

/// The referee's word as a line of JSON.
pub(crate) fn json(word: &RunSummary, restarts: u32) -> String {
    format!("{}\n", value(word, restarts))
}

/// The referee's word as JSON.
pub(crate) fn value(word: &RunSummary, restarts: u32) -> serde_json::Value {
    let figures: serde_json::Map<String, serde_json::Value> = word
        .figures()
        .iter()
        .map(|figure| {
            let name = format!("{} [{}]", figure.name, figure.unit).replace(" []", "");
            (name, serde_json::Number::from_f64(figure.value).map_or(serde_json::Value::Null, Into::into))
        })
        .collect();
    let passed = matches!(word.state.get(), Ok(RunState::Passed));
    let remark = word.remark.as_str();
    serde_json::json!({"passed": passed, "remark": remark, "figures": figures, "restarts": restarts})
}

/// What was found of a run that had not cleaned up.
pub(crate) fn swept(swept: &Swept) -> String {
    let mut text =
        format!("cleared away what was left of the board `{}`: {} files", swept.board, swept.files);
    if !swept.ended.is_empty() {
        let names: Vec<&str> = swept.ended.iter().map(|(role, _)| role.as_str()).collect();
        let _ = write!(text, ", and ended {}", names.join(", "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::FixedText;

    #[track_caller]
    fn check(state: RunState, remark: &str, figures: &[(&str, f64, &str)], restarts: u32, expected: &str) {
        let mut word = RunSummary { state: state.into(), ..RunSummary::default() };
        word.remark = FixedText::truncated(remark);
        figures.iter().for_each(|(name, value, unit)| word.push(name, *value, unit));
        assert_eq!(text(&word, restarts), expected);
    }

    #[test]
    fn a_summary_is_aligned_and_says_no_more_than_is_known() {
        check(
            RunState::Passed,
            "delivered to 207",
            &[
                ("deliveries", 1.0, ""),
                ("halt distance from door centre", 0.012_34, "m"),
                ("time", 117.25, "s"),
                ("localisation error", f64::NAN, "m"),
                ("least clearance", f64::INFINITY, "m"),
            ],
            2,
            "PASSED: delivered to 207
  deliveries                        1
  halt distance from door centre    0.012 m
  time                            117.2   s
  localisation error                -
  least clearance                 inf     m
  restarts                          2
",
        );
        check(RunState::Failed, "", &[], 0, "FAILED\n");
    }
}
