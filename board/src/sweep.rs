//! Clears away what is left of boards whose launchers are gone.

use crate::host_error::HostError;
use crate::janitor;
use crate::lock;
use crate::names::{SHARED_MEMORY, is_prefixed};
use crate::place::{self, Place, Turn, places};
use crate::private;
use crate::switchboard::{self, Switchboard};
use crate::transport::Member;
use std::io;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

/// The process of the launcher that holds this board; `None` when there surely is none.
///
/// # Errors When that cannot be told, for instance because this process may open no more files. It never
///   means that the launcher is gone.
pub fn living_launcher(place: &Place) -> io::Result<Option<u32>> {
    match place.check() {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => lock::holder(place),
    }
}

/// The boards of this user that are up, in order of their names.
///
/// # Errors
/// When that cannot be told.
pub fn boards_up() -> io::Result<Vec<Place>> {
    place::check_folder()?;
    let mut up = Vec::new();
    for place in places() {
        if living_launcher(&place)?.is_some() {
            up.push(place);
        }
    }
    Ok(up)
}

/// What was found of a board whose launcher is gone.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Swept {
    /// The board; empty for shared memory whose board is not known any more.
    pub board: String,
    /// Services that were still there and were ended: name and process.
    pub ended: Vec<(String, u32)>,
    /// Files and shared memory removed.
    pub files: usize,
}

/// Shared memory of this user's boards that belongs to no folder and no living launcher: somebody removed the
/// folder by hand. Ask for it under [`Turn`] only, or it may belong to a board that is being taken down.
///
/// # Errors
/// When it cannot be told whether a launcher lives.
pub fn orphans() -> io::Result<Vec<PathBuf>> {
    let prefixes: Vec<String> = places().iter().map(|place| place.prefix().to_owned()).collect();
    let user = rustix::process::getuid().as_raw();
    let entries = std::fs::read_dir(SHARED_MEMORY).map_err(private::at(Path::new(SHARED_MEMORY)))?;
    let mut orphans: Vec<PathBuf> = entries
        .flatten()
        .filter(|entry| {
            let name = entry.file_name();
            let name = name.to_string_lossy();
            is_prefixed(&name)
                && !prefixes.iter().any(|prefix| name.starts_with(prefix.as_str()))
                && entry.metadata().is_ok_and(|found| found.is_file() && found.uid() == user)
        })
        .map(|entry| entry.path())
        .collect();
    if !orphans.is_empty() {
        // A board whose folder was deleted under its launcher is no orphan: its robot may be driving.
        let held = lock::holders()?;
        let is_held = |file: &PathBuf| {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            held.iter().any(|(place, _)| name.starts_with(place.prefix()))
        };
        orphans.retain(|file| !is_held(file));
    }
    Ok(orphans)
}

/// Clears away every board of this user whose launcher is gone, and says what it was.
///
/// # Errors When something cannot be removed, or it cannot be told whether a launcher lives: then its board
///   stays as it is.
pub fn sweep() -> io::Result<Vec<Swept>> {
    let _turn = Turn::take()?;
    let mut swept = Vec::new();
    for place in places() {
        if living_launcher(&place)?.is_none() {
            swept.extend(clear_away(&place)?);
        }
    }
    let orphans = orphans()?;
    if !orphans.is_empty() {
        orphans.iter().try_for_each(|file| private::remove(file))?;
        swept.push(Swept { board: String::new(), ended: Vec::new(), files: orphans.len() });
    }
    Ok(swept)
}

/// Clears away as [`sweep`] does, but the board of this name alone where one is named: who says which board
/// is meant does not touch others.
///
/// # Errors
/// When something cannot be removed, or the name is none.
pub fn sweep_named(board: Option<&str>) -> io::Result<Vec<Swept>> {
    match board {
        None => sweep(),
        Some(name) => {
            let place =
                Place::new(name).map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error))?;
            Ok(clear(&place)?.into_iter().collect())
        }
    }
}

/// Clears away what is left of a board whose launcher is gone; a board that is up stays as it is.
///
/// # Errors
/// When something cannot be removed.
pub fn clear(place: &Place) -> io::Result<Option<Swept>> {
    let _turn = Turn::take()?;
    if living_launcher(place)?.is_some() {
        return Ok(None);
    }
    clear_away(place)
}

pub(crate) fn clear_away(place: &Place) -> io::Result<Option<Swept>> {
    let shared_memory = place.shared_memory().len();
    if !place.exists() && shared_memory == 0 {
        return Ok(None);
    }
    let ended = if place.exists() { end_services(place) } else { Vec::new() };
    let files = shared_memory + count_files(place.root());
    place.remove()?;
    Ok(Some(Swept { board: place.name().to_owned(), ended, files }))
}

/// Ends the services of a board whose launcher is gone: politely first, since the base driver stops the
/// wheels on its way out.
fn end_services(place: &Place) -> Vec<(String, u32)> {
    let Ok(switchboard) = Switchboard::open(&place.file(switchboard::FILE)) else { return Vec::new() };
    let living = || -> Vec<(String, u32)> {
        switchboard
            .taken()
            .filter(|(_, slot)| slot.is_service.load(Ordering::Relaxed) != 0)
            .map(|(_, slot)| (slot.role(), slot.pid.load(Ordering::Relaxed)))
            .filter(|&(_, pid)| is_of_board(pid, place))
            .collect()
    };
    let ended = living();
    let send = |signal| {
        for (_, pid) in living() {
            if let Some(pid) = i32::try_from(pid).ok().and_then(rustix::process::Pid::from_raw) {
                let _ = rustix::process::kill_process(pid, signal);
            }
        }
    };
    send(rustix::process::Signal::TERM);
    let deadline = crate::clock::monotonic().after(Duration::from_millis(500));
    while !living().is_empty() && crate::clock::monotonic() < deadline {
        crate::clock::sleep(Duration::from_millis(5));
    }
    send(rustix::process::Signal::KILL);
    let deadline = crate::clock::monotonic().after(Duration::from_millis(500));
    while !living().is_empty() && crate::clock::monotonic() < deadline {
        crate::clock::sleep(Duration::from_millis(2));
    }
    ended
}

/// Whether this process lives and has the board's page mapped: process numbers are used again, and a page
/// that was written by a broken process must not make us end a stranger.
fn is_of_board(pid: u32, place: &Place) -> bool {
    let page = place.file(switchboard::FILE);
    pid != 0
        && pid != std::process::id()
        && switchboard::process_lives(pid)
        && std::fs::read_to_string(format!("/proc/{pid}/maps"))
            .is_ok_and(|maps| maps.lines().any(|line| line.ends_with(&*page.to_string_lossy())))
}

fn count_files(folder: &Path) -> usize {
    let Ok(entries) = std::fs::read_dir(folder) else { return 0 };
    entries
        .flatten()
        .map(|entry| if entry.path().is_dir() { 1 + count_files(&entry.path()) } else { 1 })
        .sum()
}

/// Cleans up after processes of this board that died: their ports, their memory, and what they had half made.
/// It can hang when a process died at a bad moment, so the launcher runs it in a helper process with a time
/// limit.
///
/// # Errors
/// When the board cannot be joined.
pub fn clean_dead(name: &str) -> Result<usize, HostError> {
    let place = Place::new(name)?;
    // Joining would make the transport's part of a board that is not there.
    place.check()?;
    // Those who died while they made a file leave it half made, and the transport, here and in the services,
    // waits for its end.
    let failed = janitor::beside(&place, || Member::join(&place).map(|member| member.clean()))?;
    if let Ok(switchboard) = Switchboard::open(&place.file(switchboard::FILE)) {
        let dead: Vec<u32> = switchboard.dead_tools().map(|(index, _)| index).collect();
        dead.into_iter().for_each(|index| switchboard.release_dead(index));
    }
    Ok(failed)
}

/// Shared memory of a board that was begun by a process which is dead; [`clean_dead`] removes it.
pub fn half_made(place: &Place) -> Vec<PathBuf> {
    janitor::half_made(place)
}
