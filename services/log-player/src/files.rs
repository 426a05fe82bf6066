//! Reading log files; the only part that touches the disk, before the first step.

use crate::log::{Fault, Log};
use crate::params::{Format, Params};
use crate::{carmen, steps};
use std::io::Read;
use std::path::PathBuf;

/// A log that cannot be read at all.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The operating system refuses.
    #[error("cannot read {}: {cause}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        cause: std::io::Error,
    },
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

/// Text larger than this is cut off: no recording of a robot's drive, but a decompression without end.
const TEXT_LIMIT_BYTES: u64 = 1 << 30;

/// Reads the log that the parameters name; an empty log when they name none.
///
/// # Errors
/// When a file cannot be opened, or nothing in it can be played. What is garbled or cut off is left out, and told in
/// `Log::problems`.
pub fn load(params: &Params) -> Result<Log, LoadError> {
    if params.file.is_empty() {
        return Ok(Log::default());
    }
    let (text, damage) = read_text(&params.file)?;
    let mut log = match params.format {
        Format::Steps => {
            let truth = if params.truth.is_empty() { String::new() } else { read_text(&params.truth)?.0 };
            steps::read(&text, &truth, params.truth_step_offset, params.period_s)
        }
        Format::Carmen => carmen::read(&text, params.timing, params.period_s),
    };
    if let Some(cause) = damage {
        log.note(text.lines().count() + 1, Fault::Damaged { cause });
    }
    if log.entries.is_empty() {
        return Err(LoadError::Empty {
            path: params.file.clone().into(),
            format: params.format,
            problem: log.problems.first().map(ToString::to_string),
        });
    }
    Ok(log)
}

/// The text of a file, decompressed if need be, and what was wrong with the compression. Bytes that are no text stay visible as such.
fn read_text(path: &str) -> Result<(String, Option<String>), LoadError> {
    let bytes = std::fs::read(path).map_err(|cause| LoadError::Unreadable { path: path.into(), cause })?;
    let (bytes, damage) = unpack(bytes);
    Ok((String::from_utf8_lossy(&bytes).into_owned(), damage))
}

/// Decompresses what begins as gzip does. Of a damaged file the whole lines before the damage are kept.
pub(crate) fn unpack(bytes: Vec<u8>) -> (Vec<u8>, Option<String>) {
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return (bytes, None);
    }
    let mut text = Vec::new();
    let mut reader = flate2::read::MultiGzDecoder::new(&bytes[..]).take(TEXT_LIMIT_BYTES);
    let mut block = [0_u8; 64 * 1024];
    loop {
        match reader.read(&mut block) {
            Ok(0) => return (text, None),
            Ok(count) => text.extend_from_slice(&block[..count]),
            Err(error) => {
                let whole = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
                text.truncate(whole);
                return (text, Some(error.to_string()));
            }
        }
    }
}
