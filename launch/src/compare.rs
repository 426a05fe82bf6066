//! `launch digest` and `launch diff`: are two runs the same, and where do they part?

use crate::console::{say, warn_text};
use messages::Time;
use recording::{Recording, first_difference};
use serde_json::{Value, json};
use std::path::Path;
use std::process::ExitCode;

/// `launch digest FILE`.
pub(crate) fn digest(file: &Path, as_json: bool) -> Result<(), String> {
    let run = open(file)?;
    let cut_at = cut_at(&run)?;
    let digest = run.digest().map_err(|error| error.to_string())?;
    if as_json {
        let mut value = serde_json::to_value(&digest).map_err(|error| error.to_string())?;
        value["complete"] = json!(cut_at.is_none());
        say(&format!("{value:#}\n"));
        return Ok(());
    }
    if let Some(cut_at) = cut_at {
        warn_text(&format!("note: {}; the digest is of what is there", cut(file, cut_at)));
    }
    let mut text = format!("{}  {} messages\n", digest.digest, digest.messages);
    for (topic, (count, hash)) in &digest.topics {
        text += &format!("  {hash}  {count:>8}  {topic}\n");
    }
    say(&text);
    Ok(())
}

/// `launch diff A B`: exit code 0 when the runs are the same, 1 when they differ, or when one of them was
/// cut.
pub(crate) fn diff(a: &Path, b: &Path, as_json: bool) -> Result<ExitCode, String> {
    let runs = [open(a)?, open(b)?];
    let cuts = [cut_at(&runs[0])?, cut_at(&runs[1])?];
    let difference = first_difference(&runs[0], &runs[1]).map_err(|error| error.to_string())?;
    // What a run that was cut does not have is no difference of the runs.
    let differs = difference.filter(|difference| {
        let is_behind = |cut: Option<Time>| cut.is_some_and(|at| difference.stamp_ns >= at.as_nanos());
        let lacks = |value: &Value, cut| difference.field == "message" && value.is_null() && is_behind(cut);
        !lacks(&difference.a, cuts[0]) && !lacks(&difference.b, cuts[1])
    });
    let same = differs.is_none() && cuts.iter().all(Option::is_none);
    let text = if as_json {
        let complete = cuts.map(|cut_at| cut_at.is_none());
        format!("{}\n", json!({ "same": same, "difference": differs, "complete": complete }))
    } else {
        let cuts = [a, b].into_iter().zip(cuts).filter_map(|(file, cut_at)| Some(cut(file, cut_at?)));
        let cuts: Vec<String> = cuts.collect();
        match (&differs, cuts.is_empty()) {
            (None, true) => "the runs are the same\n".to_owned(),
            (None, false) => format!("{}; up to there the runs are the same\n", cuts.join(", and ")),
            (Some(difference), true) => format!("{difference}\n"),
            (Some(difference), false) => format!("{difference}\n({})\n", cuts.join(", and ")),
        }
    };
    say(&text);
    Ok(if same { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn open(file: &Path) -> Result<Recording, String> {
    Recording::open(file).map_err(|error| error.to_string())
}

fn cut_at(run: &Recording) -> Result<Option<Time>, String> {
    run.cut_at().map_err(|error| error.to_string())
}

fn cut(file: &Path, at: Time) -> String {
    format!("{} was cut after {:.2} s", file.display(), at.as_nanos() as f64 * 1e-9)
}
