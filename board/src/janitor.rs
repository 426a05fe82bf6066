//! Clears away what the transport cannot clear by itself: files that a process had begun and not finished when it died.
//!
//! The transport waits for the end of a file that is being made. For an ordinary user it gives up after a second; for root, who may open
//! the file whatever its mode, it waits for ever (seen in iceoryx2 0.10.0: a connection of mode 0200 and size 0). A service can hang on
//! such a file as well as the cleaner, so it goes at once when nobody has it open any more.

use crate::place::Place;
use std::collections::HashSet;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Write-protected when whole, shared memory that is being made can only be written.
const MODE_HALF_MADE: u32 = 0o200;
/// A node's folder is there an instant before the file that says that the node lives.
const NODE_AGE: Duration = Duration::from_secs(1);

/// Runs `work`, and clears away half-made files as long as it runs: the work may be waiting for just these.
pub(crate) fn beside<R>(place: &Place, work: impl FnOnce() -> R) -> R {
    remove_half_made(place);
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !done.load(Ordering::Acquire) {
                std::thread::park_timeout(Duration::from_millis(20));
                remove_half_made(place);
            }
        });
        let result = work();
        done.store(true, Ordering::Release);
        result
    })
}

/// Shared memory of a board that was begun by a process which is dead.
pub(crate) fn half_made(place: &Place) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> =
        place.shared_memory().into_iter().filter(|file| mode(file) == Some(MODE_HALF_MADE)).collect();
    if !files.is_empty() {
        let held = held_files(place);
        // Finished while we looked: then it is no concern of ours.
        files.retain(|file| !held.contains(file) && mode(file) == Some(MODE_HALF_MADE));
    }
    files
}

fn remove_half_made(place: &Place) {
    for file in half_made(place) {
        tracing::info!(file = %file.display(), "half made by a process that died; removed");
        let _ = std::fs::remove_file(file);
    }
    let nodes = place.file("nodes");
    let entries = std::fs::read_dir(&nodes).into_iter().flatten().flatten();
    for folder in entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir())) {
        let id = folder.file_name().to_string_lossy().into_owned();
        let monitor = nodes.join(format!("{}{id}.node_monitor", place.prefix()));
        if !monitor.exists() && older(&folder.path(), NODE_AGE) {
            let _ = std::fs::remove_dir_all(folder.path());
        }
    }
}

/// The board's shared memory that any process of this user has open: whoever makes a file has it open until it is whole.
fn held_files(place: &Place) -> HashSet<PathBuf> {
    let prefix = format!("/dev/shm/{}", place.prefix());
    let processes = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    processes
        .filter(|entry| entry.file_name().to_string_lossy().bytes().all(|byte| byte.is_ascii_digit()))
        .flat_map(|process| std::fs::read_dir(process.path().join("fd")).into_iter().flatten().flatten())
        .filter_map(|descriptor| std::fs::read_link(descriptor.path()).ok())
        .filter(|target| target.to_string_lossy().starts_with(&prefix))
        .collect()
}

fn mode(path: &Path) -> Option<u32> {
    std::fs::symlink_metadata(path).ok().map(|found| found.mode() & 0o777)
}

fn older(path: &Path, age: Duration) -> bool {
    let modified = std::fs::symlink_metadata(path).and_then(|found| found.modified());
    modified.is_ok_and(|time| time.elapsed().is_ok_and(|passed| passed >= age))
}
