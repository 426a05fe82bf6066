//! The terminal: whether there is one that can show a picture, and whether it is still there.

use rustix::event::{PollFd, PollFlags, poll};
use std::io::{IsTerminal as _, stdin, stdout};
use std::os::fd::AsFd as _;
use std::time::Duration;

/// Whether a picture can be shown here.
pub(crate) fn can_show() -> bool {
    stdin().is_terminal() && stdout().is_terminal() && why_not().is_none()
}

/// Why there is no picture although there is a terminal: in words, with what to do.
pub(crate) fn why_not() -> Option<&'static str> {
    if !stdin().is_terminal() || !stdout().is_terminal() {
        return None;
    }
    let variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    if variable("TERM").as_deref() == Some("dumb") {
        return Some("TERM=dumb: this terminal shows lines only");
    }
    let locale = variable("LC_ALL").or_else(|| variable("LC_CTYPE")).or_else(|| variable("LANG"));
    if matches!(locale.as_deref(), Some("C" | "POSIX")) {
        return Some("the locale has no letters for a picture, so there are lines; LC_ALL=C.UTF-8 has them");
    }
    if !is_in_foreground() {
        return Some("in the background there are lines; `launch attach` shows the picture");
    }
    None
}

/// Whether the terminal listens to this process: one that was started with `&` has no keys, and would be stopped if it read them.
fn is_in_foreground() -> bool {
    rustix::termios::tcgetpgrp(stdin()).is_ok_and(|group| group == rustix::process::getpgrp())
}

/// What the terminal has for us.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ready {
    /// Something was typed.
    Keys,
    /// Nothing within the time.
    Nothing,
    /// It is gone: closed, or its line is cut.
    Gone,
}

/// Waits for keys. A terminal that is gone is always readable and never says anything, so it is asked whether it is there before it is read.
pub(super) fn wait_for_keys(limit: Duration) -> Ready {
    let input = stdin();
    let mut descriptors = [PollFd::from_borrowed_fd(input.as_fd(), PollFlags::IN)];
    let limit = rustix::time::Timespec { tv_sec: 0, tv_nsec: i64::from(limit.subsec_nanos()) };
    match poll(&mut descriptors, Some(&limit)) {
        Ok(0) | Err(rustix::io::Errno::INTR) => Ready::Nothing,
        Ok(_) if descriptors[0].revents().intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL) => {
            Ready::Gone
        }
        Ok(_) => Ready::Keys,
        Err(_) => Ready::Gone,
    }
}
