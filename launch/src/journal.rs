//! The logs of a run: a thread that writes down what happened, and keeps each service's log within bounds.
//!
//! A service writes its log by itself, into a file that this thread looks at now and then: one that has grown beyond [`LOG_MAX`] becomes its own predecessor (`NAME.log.1`) and
//! begins anew. So a service that talks without end fills neither memory nor disk, and one whose launcher is gone or stands still can still speak.

use crate::event::Event;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::thread::JoinHandle;
use std::time::Duration;

/// The launcher's own log in the folder of the logs.
pub(crate) const LAUNCHER: &str = "launch";
/// Bytes of a log and of its predecessor, each.
pub(crate) const LOG_MAX: u64 = 1024 * 1024;
/// Between two looks at the sizes.
const LOOK: Duration = Duration::from_millis(200);
const EVENTS_MAX: usize = 1024;

/// The file of a role's log.
pub(crate) fn log_file(folder: &Path, role: &str) -> PathBuf {
    folder.join(format!("{role}.log"))
}

/// Writes until it is dropped.
#[derive(Debug)]
pub(crate) struct Journal {
    events: Option<SyncSender<String>>,
    thread: Option<JoinHandle<()>>,
}

impl Journal {
    /// Begins a journal of the logs in this folder.
    pub(crate) fn begin(folder: &Path) -> Self {
        let (events, lines) = mpsc::sync_channel(EVENTS_MAX);
        let folder = folder.to_owned();
        let thread =
            std::thread::Builder::new().name("journal".to_owned()).spawn(move || keep(&folder, &lines));
        // Without a thread nothing is written down, and the robot runs all the same.
        Self { events: Some(events), thread: thread.ok() }
    }

    /// Writes an event down.
    pub(crate) fn note(&self, event: &Event) {
        let role = if event.role.is_empty() { LAUNCHER } else { &event.role };
        let trouble = if event.is_trouble { "WARN " } else { "" };
        let line = format!("{:>10.3}s {trouble}{role}: {}\n", event.at_s, event.text);
        // A disk that does not take its lines holds up nobody.
        let _ = self.events.as_ref().map(|events| events.try_send(line));
    }

    /// Writes what is left, for as long as a disk may take.
    pub(crate) fn end(&mut self) {
        self.events = None;
        let deadline = board::clock::monotonic().after(Duration::from_secs(1));
        while self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
            && board::clock::monotonic() < deadline
        {
            board::clock::sleep(Duration::from_millis(1));
        }
        self.thread = None;
    }
}

impl Drop for Journal {
    fn drop(&mut self) {
        self.end();
    }
}

fn keep(folder: &Path, lines: &Receiver<String>) {
    let mut own =
        OpenOptions::new().create(true).append(true).mode(0o600).open(log_file(folder, LAUNCHER)).ok();
    loop {
        match lines.recv_timeout(LOOK) {
            Ok(line) => _ = own.as_mut().map(|own| own.write_all(line.as_bytes())),
            Err(RecvTimeoutError::Timeout) => {
                for said in bound_all(folder) {
                    let _ = own.as_mut().map(|own| own.write_all(said.as_bytes()));
                }
            }
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// Looks at every log; what was lost is said.
fn bound_all(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let logs = entries.filter(|entry| entry.path().extension().is_some_and(|end| end == "log"));
    let too_large =
        logs.filter(|entry| entry.metadata().is_ok_and(|found| found.is_file() && found.len() > LOG_MAX));
    let lost = too_large.filter_map(|entry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        match bound(&entry.path()) {
            Ok(0) => None,
            Ok(lost) => Some(format!("{name}: {lost} bytes were left out, it grows too fast\n")),
            Err(error) => Some(format!("{name}: cannot begin anew: {error}\n")),
        }
    });
    lost.collect()
}

/// Makes a log its own predecessor, of which the last [`LOG_MAX`] bytes are kept, and empties it. Bytes that are lost: those before, and what was written meanwhile.
fn bound(path: &Path) -> io::Result<u64> {
    let mut log = OpenOptions::new()
        .read(true)
        .write(true)
        .custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK)
        .open(path)?;
    let length = log.metadata()?.len();
    let begin = length.saturating_sub(LOG_MAX);
    log.seek(SeekFrom::Start(begin))?;
    let mut last = Vec::new();
    (&log).take(LOG_MAX).read_to_end(&mut last)?;
    let kept = path.with_extension("log.1");
    let beside = path.with_extension("log.new");
    let _ = fs::remove_file(&beside);
    let mut file: File = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&beside)?;
    file.write_all(&last)?;
    fs::rename(&beside, &kept)?;
    // Its writer appends, so it goes on at the new end.
    let before = log.metadata()?.len();
    log.set_len(0)?;
    Ok(begin + before.saturating_sub(length))
}

/// The last lines of a log, with those of its predecessor where it has just begun anew. Never more than a screen's worth is read.
pub(crate) fn last_lines(folder: &Path, role: &str, count: usize) -> Vec<String> {
    let path = log_file(folder, role);
    let mut lines = lines_at_end(&path, count);
    if lines.len() < count {
        let mut before = lines_at_end(&path.with_extension("log.1"), count - lines.len());
        before.append(&mut lines);
        lines = before;
    }
    lines
}

fn lines_at_end(path: &Path, count: usize) -> Vec<String> {
    let Ok(mut file) = File::open(path) else { return Vec::new() };
    let length = file.metadata().map_or(0, |found| found.len());
    let room = (count as u64).saturating_mul(512).clamp(16 * 1024, LOG_MAX);
    let begin = length.saturating_sub(room);
    let mut bytes = Vec::new();
    if file.seek(SeekFrom::Start(begin)).is_err() || file.take(room).read_to_end(&mut bytes).is_err() {
        return Vec::new();
    }
    let text = String::from_utf8_lossy(&bytes);
    let mut lines: Vec<&str> = text.lines().collect();
    // The first is a part of a line.
    if begin > 0 && lines.len() > 1 {
        lines.remove(0);
    }
    lines[lines.len().saturating_sub(count)..].iter().map(|line| (*line).to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_that_grows_begins_anew_and_its_end_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = log_file(folder.path(), "planner");
        let mut log = OpenOptions::new().create(true).append(true).open(&path).unwrap();
        let line = "a line that says nothing\n";
        let lines = 3 * LOG_MAX as usize / line.len();
        log.write_all(line.repeat(lines).as_bytes()).unwrap();
        log.write_all(b"the last one\n").unwrap();
        let said = bound_all(folder.path());
        assert_eq!(said.len(), 1);
        assert!(said[0].contains("planner.log") && said[0].contains("bytes were left out"), "{said:?}");
        assert_eq!(fs::metadata(&path).unwrap().len(), 0);
        assert_eq!(fs::metadata(path.with_extension("log.1")).unwrap().len(), LOG_MAX);
        // The service goes on with the file that it has open.
        log.write_all(b"a new one\n").unwrap();
        assert_eq!(last_lines(folder.path(), "planner", 2), ["the last one", "a new one"]);
        assert_eq!(last_lines(folder.path(), "planner", 1), ["a new one"]);
        assert!(bound_all(folder.path()).is_empty());
    }

    #[test]
    fn events_are_written_down_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let mut journal = Journal::begin(folder.path());
        for number in 0..100 {
            let event = Event {
                at_s: f64::from(number),
                role: String::new(),
                text: number.to_string(),
                is_trouble: number == 7,
            };
            journal.note(&event);
        }
        journal.end();
        let lines = last_lines(folder.path(), LAUNCHER, 1000);
        assert_eq!(lines.len(), 100);
        assert_eq!(lines[7].trim(), "7.000s WARN launch: 7");
    }
}
