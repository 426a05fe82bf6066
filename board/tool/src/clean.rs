//! `board clean`: what was left behind goes.

use crate::{Common, Outcome, show};
use board::clock;
use board::host::{boards_up, sweep_named};
use board::place::Place;
use serde_json::json;
use std::io;
use std::process::{Command, ExitCode, Stdio};
use std::time::Duration;

/// How long the helper may take that cleans up after the dead of a board.
const LIMIT: Duration = Duration::from_secs(5);

pub(crate) fn run(common: &Common) -> Outcome {
    let swept = sweep_named(common.board.as_deref())?;
    let mut boards = boards_up()?;
    boards.retain(|place| common.board.as_deref().is_none_or(|name| place.name() == name));
    let mut up = Vec::new();
    for place in boards {
        let cleaned = clean_dead(&place)?;
        up.push((place.name().to_owned(), cleaned));
    }
    let all_well = up.iter().all(|&(_, cleaned)| cleaned);
    let code = if all_well { ExitCode::SUCCESS } else { ExitCode::FAILURE };
    if common.json {
        let up: Vec<_> =
            up.iter().map(|(board, cleaned)| json!({ "board": board, "cleaned": cleaned })).collect();
        show::json(&json!({ "swept": swept, "up": up }))?;
        return Ok(code);
    }
    for swept in &swept {
        if swept.board.is_empty() {
            let files = show::count(swept.files, "file");
            show::line(&format!("removed {files} in shared memory that belonged to no board"))?;
            continue;
        }
        let files = show::count(swept.files, "file");
        show::line(&format!("board `{}`: its launcher is gone; removed {files}", swept.board))?;
        for (service, pid) in &swept.ended {
            show::line(&format!("  ended service `{}` (process {pid})", show::harmless(service)))?;
        }
    }
    for (name, cleaned) in &up {
        show::line(&if *cleaned {
            format!("board `{name}` is up; nothing of dead processes is left on it")
        } else {
            format!(
                "board `{name}` is up; cleaning up after its dead took too long and was broken off, try again"
            )
        })?;
    }
    if swept.is_empty() && up.is_empty() {
        show::line("nothing to clear away")?;
    }
    Ok(code)
}

/// Cleans up after the dead of a board that is up, in a process of its own; false when it had to be broken
/// off.
pub(crate) fn clean_dead(place: &Place) -> io::Result<bool> {
    let mut helper = Command::new(std::env::current_exe()?)
        .args(["clean-dead", place.name()])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()?;
    let deadline = clock::monotonic().after(LIMIT);
    loop {
        if let Some(status) = helper.try_wait()? {
            return Ok(status.success());
        }
        if clock::monotonic() >= deadline {
            helper.kill()?;
            helper.wait()?;
            return Ok(false);
        }
        clock::sleep(Duration::from_millis(2));
    }
}
