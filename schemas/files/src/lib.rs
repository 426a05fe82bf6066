//! Files that people hand in and get back: plain files only, read within a limit, and written as a whole or
//! not at all.
//!
//! Whatever reads a file of a user's does it through here. A pipe or a device in a file's place is refused
//! instead of waited for, and nothing is taken into memory that is larger than its reader has allowed for.
//! What is written appears under its name only when all of it is on the disk, and takes the place of nothing
//! but a plain file.
//!
//! ```
//! use std::io::Write as _;
//!
//! # let folder = tempfile::tempdir()?;
//! let path = folder.path().join("limits.toml");
//! files::Draft::write(&path, |file| writeln!(file, "top_speed_mps = 0.3"))?.put()?;
//!
//! let table: toml::Table = files::toml::parse(&files::read_text(&path, 1024)?)?;
//! assert_eq!(table["top_speed_mps"].as_float(), Some(0.3));
//!
//! let error = files::read_text(&path, 4).unwrap_err();
//! assert!(error.to_string().contains("which is the limit"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod read;
pub mod toml;
mod write;

pub use read::{Unpacked, check, open, read, read_text, read_unpacked, text};
pub use write::{Draft, check_place};

use std::path::{Path, PathBuf};

/// A file that cannot be used. The text names the file.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", shown(path))]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: FileProblem,
}

/// What can be wrong with a file.
#[derive(Debug, thiserror::Error)]
pub enum FileProblem {
    /// The operating system refuses.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// A folder, a pipe, a device or a socket.
    #[error("this is {kind}, and only plain files are read and written")]
    NotPlain {
        /// What it is, in words.
        kind: &'static str,
    },
    /// More bytes than the reader has allowed for.
    #[error("it has {}more than {} of {what}, which is the limit", size(*.bytes), bytes_in_words(*limit))]
    TooLarge {
        /// Bytes of the file; `None` when it is only known that there are more than `limit`.
        bytes: Option<u64>,
        /// The limit, in bytes.
        limit: u64,
        /// What there is too much of: "content", "unpacked content".
        what: &'static str,
    },
    /// Bytes that are no UTF-8.
    #[error("line {line}, byte {byte}: {found}; save the file as UTF-8")]
    NotText {
        /// Line, counted from 1.
        line: usize,
        /// The byte's place in its line, counted from 1.
        byte: usize,
        /// What stands there, in words.
        found: String,
    },
    /// A name under which nothing can be written.
    #[error("{0}")]
    BadPlace(String),
}

fn size(bytes: Option<u64>) -> String {
    bytes.map(|bytes| format!("{}, ", bytes_in_words(bytes))).unwrap_or_default()
}

/// A size for people: `16 MiB`, `3.2 GiB`, `512 bytes`.
pub fn bytes_in_words(bytes: u64) -> String {
    let units = [(1_u64 << 30, "GiB"), (1 << 20, "MiB"), (1 << 10, "KiB")];
    match units.into_iter().find(|(unit, _)| bytes >= *unit) {
        Some((unit, name)) if bytes.is_multiple_of(unit) => format!("{} {name}", bytes / unit),
        Some((unit, name)) => format!("{:.1} {name}", bytes as f64 / unit as f64),
        None => format!("{bytes} bytes"),
    }
}

/// The longest path that the system takes, in bytes.
const PATH_MAX: usize = 4096;

/// A path for a sentence about it. One that a file of the user's has made up may be endless.
pub fn shown(path: &Path) -> String {
    clipped(&path.display().to_string(), PATH_MAX)
}

/// Text of a file for a sentence about it: if it is long, its first 80 characters and its size.
pub fn in_brief(text: &str) -> String {
    clipped(text, 80)
}

/// The first characters of a text, and its size if that is not all.
pub fn clipped(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        None => text.to_owned(),
        Some((end, _)) => format!("{} .. ({} in all)", &text[..end], bytes_in_words(text.len() as u64)),
    }
}

/// Says which file a problem is in.
fn at<P: Into<FileProblem>>(path: &Path) -> impl Fn(P) -> FileError {
    move |problem| FileError { path: path.to_owned(), problem: problem.into() }
}

#[cfg(test)]
mod tests;
