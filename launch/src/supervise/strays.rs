//! Processes that services have started and left behind: they end with those who started them.
//!
//! A service leads a group of its own, which is ended with it. A child that has left the group becomes the launcher's when its parent dies, since the launcher asks the
//! kernel for such orphans; then it is ended here.

use super::process::MARK;
use rustix::process::{Pid, Signal, WaitOptions, kill_process, set_child_subreaper, waitpid};
use std::fs;

/// Looks after orphans when there may be some.
#[derive(Debug, Default)]
pub(super) struct Strays {
    /// Looks that are due: an orphan is ended at one and gone at the next.
    due: u32,
}

/// Looks after a death.
const LOOKS: u32 = 20;

impl Strays {
    /// From now on orphans of this process's descendants become its own.
    pub(super) fn begin() -> Self {
        // An old kernel, or one that forbids it: groups are ended all the same.
        let _ = set_child_subreaper(Some(rustix::process::getpid()));
        Self::default()
    }

    /// A service has died.
    pub(super) fn expect(&mut self) {
        self.due = LOOKS;
    }

    /// Whether there may be some.
    pub(super) fn are_expected(&self) -> bool {
        self.due > 0
    }

    /// Ends every child of this process that is not one of `ours`; whether there was any.
    pub(super) fn end_all(&mut self, board: &str, ours: &[u32]) -> bool {
        self.due = self.due.saturating_sub(1);
        let mut found = false;
        for pid in children().into_iter().filter(|pid| !ours.contains(pid)) {
            let Some(process) = i32::try_from(pid).ok().and_then(Pid::from_raw) else { continue };
            // The first process of a container gets the orphans of all others too.
            if std::process::id() == 1 && !is_marked(pid, board) {
                continue;
            }
            found = true;
            let _ = kill_process(process, Signal::KILL);
            let _ = waitpid(Some(process), WaitOptions::NOHANG);
        }
        if found {
            // Its own children come next.
            self.due = self.due.max(2);
        }
        found
    }
}

/// The children of this process.
fn children() -> Vec<u32> {
    let tasks = fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let lists = tasks.filter_map(|task| fs::read_to_string(task.path().join("children")).ok());
    lists
        .flat_map(|list| list.split_whitespace().filter_map(|pid| pid.parse().ok()).collect::<Vec<u32>>())
        .collect()
}

fn is_marked(pid: u32, board: &str) -> bool {
    let mark = format!("{MARK}={board}");
    let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
    // A zombie has no environment any more.
    environment.is_empty() || environment.split(|&byte| byte == 0).any(|word| word == mark.as_bytes())
}
