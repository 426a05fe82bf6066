//! `launch up --detach`: the launcher goes on by itself.

use crate::console::{say, say_line, warn};
use crate::control;
use board::clock;
use board::host;
use board::logout;
use board::place::Place;
use rustix::event::{PollFd, PollFlags, poll};
use std::io::{PipeReader, Read as _};
use std::os::fd::AsFd as _;
use std::os::unix::process::CommandExt as _;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Bytes of a launcher's words at its start that are shown.
const WORDS_MAX: usize = 1 << 20;
/// Between two looks at the board.
const LOOK: Duration = Duration::from_millis(20);

/// Starts this very command again, without `--detach`, in a session of its own, and waits until its services are ready.
///
/// # Errors
/// With the launcher's words, when the graph does not come up.
pub(crate) fn detach(board: &str) -> Result<(), String> {
    let place = Place::new(board).map_err(|error| error.to_string())?;
    if let Some(pid) = host::living_launcher(&place).map_err(|error| error.to_string())? {
        return Err(format!(
            "the board `{board}` is up already (launcher {pid}); stop it with `launch stop --board {board}`"
        ));
    }
    // A pipe rather than a file: nothing lies about that somebody else could read, replace or have written through.
    let (mut reader, writer) = std::io::pipe().map_err(|error| error.to_string())?;
    let copy = writer.try_clone().map_err(|error| error.to_string())?;
    let launcher = std::env::current_exe().map_err(|error| error.to_string())?;
    let arguments = std::env::args_os().skip(1).filter(|argument| argument != "--detach");
    let mut command = Command::new(launcher);
    command.args(arguments).arg("--plain").stdin(Stdio::null()).stdout(writer).stderr(copy);
    // SAFETY: setsid is a plain system call; it cannot fail in a process that was just made.
    unsafe {
        command.pre_exec(|| {
            let _ = rustix::process::setsid();
            Ok(())
        });
    }
    let mut child = command.spawn().map_err(|error| error.to_string())?;
    // The launcher has its own ends now; with ours closed, its end is the end of its words.
    drop(command);
    let mut words = Vec::new();
    loop {
        hear(&mut reader, &mut words, LOOK);
        if let Ok(Some(status)) = child.try_wait() {
            while hear(&mut reader, &mut words, Duration::ZERO) {}
            let words = String::from_utf8_lossy(&words).into_owned();
            // One that is over already has done what it was to do.
            return if status.success() {
                say(&words);
                Ok(())
            } else {
                Err(last_words(&words))
            };
        }
        if let Ok(control::Answer::Status(status)) = control::ask(&place, &control::Request::Status)
            && status.services.iter().all(|service| matches!(service.state.as_str(), "running" | "finished"))
        {
            break;
        }
    }
    say_line(&format!(
        "the board `{board}` is up (launcher {}); `launch attach`, `launch ps`, `launch logs`, `launch stop`",
        child.id()
    ));
    if let Some(why) = logout::removes_shared_memory() {
        warn(&format!("warning: {why}"));
    }
    Ok(())
}

/// Takes in what the launcher says within this time; false when it says nothing more.
fn hear(reader: &mut PipeReader, words: &mut Vec<u8>, limit: Duration) -> bool {
    let mut descriptors = [PollFd::from_borrowed_fd(reader.as_fd(), PollFlags::IN)];
    let limit = rustix::time::Timespec { tv_sec: 0, tv_nsec: i64::from(limit.subsec_nanos()) };
    if !poll(&mut descriptors, Some(&limit)).is_ok_and(|ready| ready > 0) {
        return false;
    }
    let mut bytes = [0; 4096];
    let read = reader.read(&mut bytes).unwrap_or(0);
    if read == 0 && !limit.eq(&rustix::time::Timespec { tv_sec: 0, tv_nsec: 0 }) {
        // Closed: its end is near.
        clock::sleep(LOOK);
    }
    let room = WORDS_MAX.saturating_sub(words.len());
    words.extend_from_slice(&bytes[..read.min(room)]);
    read > 0
}

/// What it said, without what is said once more in front of it.
fn last_words(words: &str) -> String {
    let words = words.trim_end();
    words.strip_prefix("error: ").unwrap_or(words).to_owned()
}
