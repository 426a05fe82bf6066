//! The last lines of a run.

use board::host::Swept;
use messages::{RunState, RunSummary};
use std::fmt::Write as _;

/// The referee's word as a small table.
pub(crate) fn text(word: &RunSummary, restarts: u32) -> String {
    let verdict = match word.state.get() {
        Ok(RunState::Passed) => "PASSED",
        Ok(RunState::Failed) => "FAILED",
        Ok(RunState::Running) => "stopped before its end",
        Err(_) => "the referee's word has no meaning",
    };
    let mut text = format!("{verdict}: {}\n", word.remark);
    let width = word.figures().iter().map(|figure| figure.name.as_str().chars().count()).max().unwrap_or(0);
    for figure in word.figures() {
        let value = if figure.value.is_nan() { "-".to_owned() } else { rounded(figure.value) };
        let unit = figure.unit;
        let _ = writeln!(text, "  {:width$}  {value:>10} {unit}", figure.name.as_str());
    }
    if restarts > 0 {
        let _ = writeln!(text, "  {:width$}  {restarts:>10}", "restarts");
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

fn rounded(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e9 { format!("{value:.0}") } else { format!("{value:.3}") }
}
