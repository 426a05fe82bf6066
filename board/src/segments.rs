//! What the transport cannot be told about its segments of shared memory: that they are really there before
//! anybody writes into them, and that they belong to their owner alone.
//!
//! iceoryx2 0.10 sizes a segment with `ftruncate`, which promises memory that need not exist: with shared
//! memory full, whoever first writes to a page of it is ended by SIGBUS, in the middle of a drive. And it
//! makes the one that holds a board's processes together readable and writable by everybody, so that any user
//! can end the robot with a few random bytes. It has no setting for either. So this crate provides the
//! `ftruncate` and the `fchmod` that it calls: for a segment of a board the one allocates as well, and a lack
//! is an error of the call; the other leaves the owner's bits alone. For every other file both are the system
//! call and nothing else.

use crate::names::is_segment;
use std::cell::Cell;
use std::ffi::c_int;
use std::os::fd::BorrowedFd;
use std::path::PathBuf;

/// What the owner may do with a file.
const OWNER: libc::mode_t = 0o700;

thread_local! {
    /// What was asked for and could not be had, in bytes, since somebody looked.
    static REFUSED: Cell<u64> = const { Cell::new(0) };
    /// The size of the last segment that was asked for, in bytes.
    static LAST: Cell<u64> = const { Cell::new(0) };
}

/// How much was asked for in this thread and could not be had since the last call, in bytes; zero for
/// nothing.
pub(crate) fn take_refused() -> u64 {
    REFUSED.take()
}

/// The size of the segment that this thread asked for last, in bytes.
pub(crate) fn last_bytes() -> u64 {
    LAST.get()
}

/// Nothing is asked of the caller: a descriptor that is none is an error of the system call.
#[unsafe(no_mangle)]
extern "C" fn ftruncate(descriptor: c_int, length: libc::off_t) -> c_int {
    // SAFETY: a plain system call without pointers.
    if unsafe { libc::syscall(libc::SYS_ftruncate, descriptor, length) } != 0 {
        return -1;
    }
    let (Some(segment), Ok(bytes)) = (segment(descriptor), u64::try_from(length)) else { return 0 };
    LAST.set(bytes);
    let Err(error) = allocate(descriptor, bytes) else { return 0 };
    REFUSED.set(bytes);
    // Half made it would be waited for by whoever wants to open it.
    let _ = std::fs::remove_file(segment);
    // SAFETY: the address of this thread's error number is always valid.
    unsafe { *libc::__errno_location() = error.raw_os_error() };
    -1
}

/// Nothing is asked of the caller: a descriptor that is none is an error of the system call.
#[unsafe(no_mangle)]
extern "C" fn fchmod(descriptor: c_int, mode: libc::mode_t) -> c_int {
    let mode = if segment(descriptor).is_some() { mode & OWNER } else { mode };
    // SAFETY: a plain system call without pointers.
    let changed = unsafe { libc::syscall(libc::SYS_fchmod, descriptor, mode) };
    if changed == 0 { 0 } else { -1 }
}

/// The path of a descriptor that is a segment of some board.
fn segment(descriptor: c_int) -> Option<PathBuf> {
    let path = std::fs::read_link(format!("/proc/self/fd/{descriptor}")).ok()?;
    is_segment(&path).then_some(path)
}

fn allocate(descriptor: c_int, bytes: u64) -> rustix::io::Result<()> {
    // SAFETY: the descriptor was truncated just now, so it is open, and the borrow ends with this call.
    let file = unsafe { BorrowedFd::borrow_raw(descriptor) };
    let allocated = rustix::io::retry_on_intr(|| {
        rustix::fs::fallocate(file, rustix::fs::FallocateFlags::empty(), 0, bytes)
    });
    match allocated {
        // Not a tmpfs; `board doctor` says so.
        Err(rustix::io::Errno::OPNOTSUPP | rustix::io::Errno::NOSYS) => Ok(()),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::fd::AsRawFd as _;
    use std::os::unix::fs::MetadataExt as _;
    use std::path::Path;

    fn check(path: &Path, allocated: bool, mode: u32) {
        let file = std::fs::File::create_new(path).unwrap();
        assert_eq!(ftruncate(file.as_raw_fd(), 1 << 20), 0);
        assert_eq!(fchmod(file.as_raw_fd(), 0o666), 0);
        let found = file.metadata().unwrap();
        std::fs::remove_file(path).unwrap();
        assert_eq!((found.len(), found.mode() & 0o777), (1 << 20, mode));
        assert_eq!(found.blocks() * 512 >= 1 << 20, allocated, "{}", path.display());
    }

    #[test]
    fn a_boards_segment_is_there_and_its_owners() {
        let number = std::process::id();
        check(Path::new(&format!("/dev/shm/c00000000_test-{number}")), true, 0o600);
        check(Path::new(&format!("/dev/shm/t-other-{number}")), false, 0o666);
        assert_eq!((ftruncate(-1, 1), fchmod(-1, 0o600)), (-1, -1));
    }
}
