//! How it is known that a launcher lives: it has its board's lock file open for writing, and locked.
//!
//! The kernel lets go of both however the process ends. That the lock is free, or missing, is not enough to
//! call a launcher gone: files in shared memory can be deleted under a running robot (systemd does it to a
//! user who logs out,
//! `RemoveIPC` in logind.conf(5)), and whoever then clears the board away or starts a second one has two
//! robots on the same wheels. So the processes are looked through for one that still has the file open.
//! Whatever keeps us from looking is an error, and never means that a launcher is gone.

use crate::names::boards_folder;
use crate::place::Place;
use crate::private::{self, Identity, identity};
use rustix::fs::{FlockOperation, OFlags, flock};
use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

const LOCK: &str = "launcher.lock";

/// The lock of a board that this process has made; given back when it is dropped.
#[derive(Debug)]
pub(crate) struct Lock {
    path: PathBuf,
    identity: Option<Identity>,
    _file: File,
}

impl Lock {
    /// Takes the lock of a board whose folder has just been made.
    pub(crate) fn take(place: &Place) -> io::Result<Self> {
        let path = place.file(LOCK);
        let mut file = private::create(&path)?;
        writeln!(file, "{}", std::process::id()).map_err(private::at(&path))?;
        // It is ours but for the instant in which somebody looks whether it is held.
        flock(&file, FlockOperation::LockExclusive).map_err(io::Error::from).map_err(private::at(&path))?;
        Ok(Self { identity: identity(&path), path, _file: file })
    }

    /// Whether the file still stands where it was made, and with it the board's folder.
    pub(crate) fn is_in_place(&self) -> bool {
        identity(&self.path) == self.identity
    }
}

/// The process of the launcher that holds this board; `None` when there surely is none. Zero for a launcher
/// that lives where its number cannot be known.
pub(crate) fn holder(place: &Place) -> io::Result<Option<u32>> {
    let path = place.file(LOCK);
    let doubt = |error: io::Error| {
        let name = place.name();
        let text =
            format!("whether the launcher of `{name}` lives cannot be told, so nothing was touched: {error}");
        io::Error::new(error.kind(), text)
    };
    match open(&path) {
        Ok(mut file) => match flock(&file, FlockOperation::NonBlockingLockShared) {
            // Shared, so that two who look at the same time do not take each other for the launcher.
            Ok(()) => {}
            Err(rustix::io::Errno::WOULDBLOCK) => {
                let mut text = String::new();
                let _ = file.read_to_string(&mut text);
                return Ok(Some(text.trim().parse().unwrap_or(0)));
            }
            Err(error) => return Err(doubt(private::at(&path)(error.into()))),
        },
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => return Err(doubt(private::at(&path)(error))),
    }
    let holders = holders().map_err(doubt)?;
    Ok(holders.into_iter().find(|(held, _)| held == place).map(|(_, pid)| pid))
}

/// The boards of this user whose launchers live, with their processes, whether or not the boards' folders
/// still exist.
pub(crate) fn holders() -> io::Result<Vec<(Place, u32)>> {
    let mut found = Vec::new();
    for entry in read_folder(Path::new("/proc"))?.into_iter().flatten() {
        let Some(pid) = entry.to_str().and_then(|name| name.parse::<u32>().ok()) else { continue };
        // Processes end while we look, and those of other users are closed to us.
        let Some(descriptors) = read_folder(&PathBuf::from(format!("/proc/{pid}/fd")))? else { continue };
        for descriptor in descriptors {
            let descriptor = descriptor.to_string_lossy();
            let Ok(target) = std::fs::read_link(format!("/proc/{pid}/fd/{descriptor}")) else { continue };
            if let Some(place) = board_of(&target)
                && is_open_for_writing(pid, &descriptor)?
            {
                found.push((place, pid));
            }
        }
    }
    Ok(found)
}

fn open(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).custom_flags(OFlags::NOFOLLOW.bits() as i32).open(path)
}

/// The names in a folder of /proc; `None` when it went away, or is not for us to see.
fn read_folder(folder: &Path) -> io::Result<Option<Vec<std::ffi::OsString>>> {
    let names = std::fs::read_dir(folder).and_then(|entries| {
        entries.map(|entry| entry.map(|entry| entry.file_name())).collect::<io::Result<Vec<_>>>()
    });
    is_of_process(names).map_err(private::at(folder))
}

/// The board whose lock file this is, deleted or not.
fn board_of(target: &Path) -> Option<Place> {
    let target = target.to_str()?;
    let target = Path::new(target.strip_suffix(" (deleted)").unwrap_or(target));
    let folder = target.parent().filter(|_| target.file_name().is_some_and(|name| name == LOCK))?;
    let place = Place::new(folder.file_name()?.to_str()?).ok()?;
    (folder.parent() == Some(boards_folder().as_path())).then_some(place)
}

/// Those who only look whether the lock is held have it open for reading.
fn is_open_for_writing(pid: u32, descriptor: &str) -> io::Result<bool> {
    let path = PathBuf::from(format!("/proc/{pid}/fdinfo/{descriptor}"));
    let Some(text) = is_of_process(std::fs::read_to_string(&path)).map_err(private::at(&path))? else {
        return Ok(false);
    };
    let flags = text.lines().find_map(|line| line.strip_prefix("flags:"));
    let flags = flags.and_then(|digits| u32::from_str_radix(digits.trim(), 8).ok());
    Ok(flags.is_some_and(|flags| flags & OFlags::ACCMODE.bits() != OFlags::RDONLY.bits()))
}

/// What was read of a process; `None` when it has ended, or belongs to somebody else.
fn is_of_process<T>(read: io::Result<T>) -> io::Result<Option<T>> {
    match read {
        Ok(read) => Ok(Some(read)),
        Err(error) if error.raw_os_error() == Some(libc::ESRCH) => Ok(None),
        Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::PermissionDenied) => {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}
