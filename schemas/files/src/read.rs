//! Reading: what is opened, how much of it, and as what.

use crate::{FileError, FileProblem, at};
use flate2::bufread::MultiGzDecoder;
use rustix::fs::{Mode, OFlags};
use std::fs::{File, FileType, Metadata};
use std::io::{BufRead as _, BufReader, ErrorKind, Read};
use std::os::unix::fs::FileTypeExt as _;
use std::path::Path;

/// So much is read at once.
const BLOCK: usize = 64 * 1024;

/// Opens a plain file, or what links lead to one, of at most `limit` bytes.
///
/// # Errors
/// When there is none, it cannot be read, it is no plain file, or it is larger.
pub fn open(path: &Path, limit: u64) -> Result<File, FileError> {
    // Without O_NONBLOCK the opening of a pipe waits until somebody writes.
    let flags = OFlags::RDONLY | OFlags::NONBLOCK | OFlags::CLOEXEC | OFlags::NOCTTY;
    let file = rustix::fs::open(path, flags, Mode::empty()).map_err(|error| match error {
        // A socket cannot be opened at all.
        rustix::io::Errno::NXIO => at(path)(not_plain_at(path)),
        error => at(path)(std::io::Error::from(error)),
    })?;
    let file = File::from(file);
    let found = file.metadata().map_err(at(path))?;
    judge(&found, limit).map_err(at(path))?;
    Ok(file)
}

/// Whether [`open`] would open it, without reading anything: for set-ups that are checked before they are
/// used.
///
/// # Errors
/// As of `open`.
pub fn check(path: &Path, limit: u64) -> Result<(), FileError> {
    open(path, limit).map(|_| ())
}

/// The bytes of a plain file of at most `limit` bytes.
///
/// # Errors
/// As of [`open`], or when the file turns out to be larger while it is read.
pub fn read(path: &Path, limit: u64) -> Result<Vec<u8>, FileError> {
    let file = open(path, limit)?;
    let length = file.metadata().map_or(0, |found| found.len());
    let mut bytes = Vec::with_capacity(usize::try_from(length.min(limit)).unwrap_or_default());
    // Files that grow, and those of /proc, have more than they say.
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes).map_err(at(path))?;
    if bytes.len() as u64 > limit {
        return Err(at(path)(FileProblem::TooLarge { bytes: None, limit, what: "content" }));
    }
    Ok(bytes)
}

/// The text of a plain file of at most `limit` bytes, in UTF-8, without a byte order mark.
///
/// # Errors
/// As of [`read`], or at the first byte that is no UTF-8.
pub fn read_text(path: &Path, limit: u64) -> Result<String, FileError> {
    text(read(path, limit)?).map_err(at(path))
}

/// Bytes as a text, without a byte order mark.
///
/// # Errors
/// At the first byte that is no UTF-8.
pub fn text(bytes: Vec<u8>) -> Result<String, FileProblem> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        let found = "the text begins as UTF-16 does".to_owned();
        return Err(FileProblem::NotText { line: 1, byte: 1, found });
    }
    let mut text = String::from_utf8(bytes).map_err(|error| {
        let (good, bad) = error.as_bytes().split_at(error.utf8_error().valid_up_to());
        let line_start = good.iter().rposition(|&byte| byte == b'\n').map_or(0, |newline| newline + 1);
        let line = good.iter().filter(|&&byte| byte == b'\n').count() + 1;
        let found = match bad.first() {
            Some(byte) => format!("the byte {byte:#04x} is no UTF-8"),
            None => "the text ends within a letter".to_owned(),
        };
        FileProblem::NotText { line, byte: good.len() - line_start + 1, found }
    })?;
    if text.starts_with('\u{feff}') {
        text.drain(..'\u{feff}'.len_utf8());
    }
    Ok(text)
}

/// What came out of a file that may be compressed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unpacked {
    /// The content, up to where the compression is damaged.
    pub bytes: Vec<u8>,
    /// What is wrong with the compression.
    pub damage: Option<String>,
}

/// The bytes of a plain file, unpacked if it begins as gzip does; at most `limit` bytes before and after. Of
/// a file whose compression is damaged the part before is kept.
///
/// # Errors
/// As of [`read`], or when more than `limit` bytes come out.
pub fn read_unpacked(path: &Path, limit: u64) -> Result<Unpacked, FileError> {
    let mut input = BufReader::with_capacity(BLOCK, open(path, limit)?.take(limit.saturating_add(1)));
    let is_packed = input.fill_buf().map_err(at(path))?.starts_with(&[0x1f, 0x8b]);
    let mut unpacked = Unpacked { bytes: Vec::new(), damage: None };
    let outcome = if is_packed {
        read_up_to(MultiGzDecoder::new(input), limit, &mut unpacked.bytes)
    } else {
        read_up_to(input, limit, &mut unpacked.bytes)
    };
    match outcome {
        Ok(true) => Ok(unpacked),
        Ok(false) => {
            let what = if is_packed { "unpacked content" } else { "content" };
            Err(at(path)(FileProblem::TooLarge { bytes: None, limit, what }))
        }
        Err(error) if is_packed && is_damage(&error) => {
            unpacked.damage = Some(error.to_string());
            Ok(unpacked)
        }
        Err(error) => Err(at(path)(error)),
    }
}

/// Whether an error is the decompressor's and not the disk's.
fn is_damage(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::InvalidData | ErrorKind::UnexpectedEof)
}

/// Reads to the end; `false` when there is more than `limit`.
fn read_up_to(mut input: impl Read, limit: u64, bytes: &mut Vec<u8>) -> std::io::Result<bool> {
    let mut block = vec![0; BLOCK];
    loop {
        let count = match input.read(&mut block) {
            Ok(0) => return Ok(true),
            Ok(count) => count,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        if bytes.len() as u64 + count as u64 > limit {
            return Ok(false);
        }
        bytes.extend_from_slice(&block[..count]);
    }
}

fn judge(found: &Metadata, limit: u64) -> Result<(), FileProblem> {
    if let Some(kind) = kind_unless_plain(found.file_type()) {
        return Err(FileProblem::NotPlain { kind });
    }
    if found.len() > limit {
        return Err(FileProblem::TooLarge { bytes: Some(found.len()), limit, what: "content" });
    }
    Ok(())
}

/// What something is that cannot even be opened.
fn not_plain_at(path: &Path) -> FileProblem {
    let kind = path.metadata().ok().and_then(|found| kind_unless_plain(found.file_type()));
    FileProblem::NotPlain { kind: kind.unwrap_or("a device that is not there") }
}

/// What it is in words; `None` for a plain file.
pub(crate) fn kind_unless_plain(kind: FileType) -> Option<&'static str> {
    if kind.is_file() {
        None
    } else if kind.is_dir() {
        Some("a folder")
    } else if kind.is_fifo() {
        Some("a pipe")
    } else if kind.is_socket() {
        Some("a socket")
    } else if kind.is_symlink() {
        Some("a link")
    } else {
        Some("a device")
    }
}
