//! Cleaning up after the dead, in a helper process, since the transport can hang on what a process left half made.

use board::clock;
use messages::Time;
use std::io;
use std::os::unix::process::CommandExt as _;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// How long the helper may take.
const LIMIT: Duration = Duration::from_secs(3);

/// At most one helper at a time; who dies while it works is cleaned up after by the next one.
#[derive(Debug, Default)]
pub(crate) struct Cleaner {
    helper: Option<(Child, Time)>,
    again: bool,
}

impl Cleaner {
    /// Starts the helper, or notes that another one is needed after it.
    pub(crate) fn clean(&mut self, board: &str) -> io::Result<()> {
        if self.helper.is_some() {
            self.again = true;
            return Ok(());
        }
        self.again = false;
        // Not by its path: the launcher's file may have been replaced since.
        let child = Command::new("/proc/self/exe")
            .args(["clean-dead", board])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .process_group(0)
            .spawn()?;
        self.helper = Some((child, clock::monotonic()));
        Ok(())
    }

    /// Looks after the helper.
    pub(crate) fn tend(&mut self, board: &str, now: Time) -> io::Result<()> {
        let Some((helper, since)) = &mut self.helper else { return Ok(()) };
        let mut broken_off = false;
        if matches!(helper.try_wait(), Ok(None)) {
            if now.since(*since) < LIMIT {
                return Ok(());
            }
            let _ = helper.kill();
            let _ = helper.wait();
            broken_off = true;
        }
        self.helper = None;
        if self.again {
            self.clean(board)?;
        }
        if broken_off { Err(io::Error::other("it took too long and was broken off")) } else { Ok(()) }
    }

    /// The helper's process.
    pub(crate) fn pid(&self) -> Option<u32> {
        self.helper.as_ref().map(|(helper, _)| helper.id())
    }

    /// Whether a helper is at work.
    pub(crate) fn is_busy(&self) -> bool {
        self.helper.is_some()
    }

    /// Breaks off what is going on.
    pub(crate) fn stop(&mut self) {
        if let Some((mut helper, _)) = self.helper.take() {
            let _ = helper.kill();
            let _ = helper.wait();
        }
    }
}
