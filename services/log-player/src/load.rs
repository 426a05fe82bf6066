//! Reading log files; the only part that touches the disk, before the first step.

use crate::log::{Fault, Log};
use crate::params::{Format, Params};
use crate::{carmen, steps};
use files::FileError;
use std::path::{Path, PathBuf};

/// A log that cannot be read at all.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file cannot be read.
    #[error("cannot read {0}")]
    Unreadable(#[from] FileError),
    /// Nothing in it can be played.
    #[error("{} holds nothing that can be played as format {format:?}{}", path.display(), first_problem(problem.as_deref()))]
    Empty {
        /// The file.
        path: PathBuf,
        /// The format asked for.
        format: Format,
        /// The first thing wrong with it.
        problem: Option<String>,
    },
}

fn first_problem(problem: Option<&str>) -> String {
    problem.map(|problem| format!(": {problem}")).unwrap_or_default()
}

/// Larger logs are refused, packed or not: a drive of eight hours has a third of it, and with what is made of
/// it in memory this is half a gigabyte.
const TEXT_MAX: u64 = 128 << 20;
/// The true poses beside a log: a line a step.
const TRUTH_MAX: u64 = 32 << 20;

/// Whether the files that the parameters name can be opened at all. Reads nothing of them.
///
/// # Errors
/// When one is not there, no plain file, or too large.
pub fn check_files(params: &Params) -> Result<(), LoadError> {
    for (path, limit) in [(&params.file, TEXT_MAX), (&params.truth, TRUTH_MAX)] {
        if !path.is_empty() {
            files::check(Path::new(path), limit)?;
        }
    }
    Ok(())
}

/// Reads the log that the parameters name; an empty log when they name none.
///
/// # Errors
/// When a file cannot be opened, or nothing in it can be played. What is garbled or cut off is left out, and
/// told in `Log::problems`.
pub fn load(params: &Params) -> Result<Log, LoadError> {
    if params.file.is_empty() {
        return Ok(Log::default());
    }
    let (text, damage) = read_text(&params.file, TEXT_MAX)?;
    let damaged_from = text.lines().count() + 1;
    let mut log = match params.format {
        Format::Steps => {
            let truth =
                if params.truth.is_empty() { String::new() } else { read_text(&params.truth, TRUTH_MAX)?.0 };
            steps::read(&text, &truth, params.truth_step_offset, params.period_s)
        }
        Format::Carmen => carmen::read_as(&text, params),
    };
    if let Some(cause) = damage {
        log.note(damaged_from, Fault::Damaged { cause });
    }
    if log.entries.is_empty() {
        let problem = log.problems.first().map(ToString::to_string);
        let problem = problem.or_else(|| log.remarks.first().map(ToString::to_string));
        return Err(LoadError::Empty { path: params.file.clone().into(), format: params.format, problem });
    }
    Ok(log)
}

/// The text of a file, unpacked if need be, and what was wrong with the compression. Of a damaged file the
/// whole lines before the damage are kept; bytes that are no text stay visible as such.
fn read_text(path: &str, limit: u64) -> Result<(String, Option<String>), LoadError> {
    let mut unpacked = files::read_unpacked(Path::new(path), limit)?;
    if unpacked.damage.is_some() {
        let whole = unpacked.bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
        unpacked.bytes.truncate(whole);
    }
    let text = String::from_utf8(unpacked.bytes)
        .unwrap_or_else(|error| String::from_utf8_lossy(error.as_bytes()).into_owned());
    Ok((text, unpacked.damage))
}
