//! Where the boards' files lie in shared memory, and what they are called.

use std::path::{Path, PathBuf};

/// Where shared memory lies.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

/// The folder in which the boards of this user lie.
pub fn boards_folder() -> PathBuf {
    // Shared memory rather than the temporary directory: three times faster to set up, and gone after a power loss.
    PathBuf::from(format!("{SHARED_MEMORY}/corkboard-{}", rustix::process::getuid().as_raw()))
}

/// Whether this is a segment of some board, by its name.
pub(crate) fn is_segment(path: &Path) -> bool {
    path.parent() == Some(Path::new(SHARED_MEMORY))
        && path.file_name().is_some_and(|name| is_prefixed(&name.to_string_lossy()))
}

/// Whether a name in shared memory begins as a board's memory does: `c`, eight hexadecimal digits, `_`.
pub(crate) fn is_prefixed(name: &str) -> bool {
    let bytes = name.as_bytes();
    bytes.len() > 10
        && bytes[0] == b'c'
        && bytes[9] == b'_'
        && bytes[1..9].iter().all(|byte| byte.is_ascii_digit() || (b'a'..=b'f').contains(byte))
}
