//! A command on a terminal of its own, as a person has it in front of them: the terminal can be typed into,
//! stand still, and be closed.

use rustix::event::{PollFd, PollFlags, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::os::fd::OwnedFd;
use std::os::unix::process::CommandExt as _;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// A process that has a terminal.
#[derive(Debug)]
pub struct OnTerminal {
    /// The process; it is killed when this is dropped.
    pub child: Child,
    ours: Option<OwnedFd>,
    seen: Arc<Mutex<Vec<u8>>>,
    /// Reads what is written, and ends when the terminal is closed.
    reader: Option<JoinHandle<()>>,
    closing: Arc<AtomicBool>,
}

#[allow(clippy::panic)]
impl OnTerminal {
    /// Starts a command on a terminal of 160 x 45. What it writes is read by a thread, unless the terminal
    /// `stands_still`: then nobody ever reads it.
    ///
    /// # Panics
    /// When there is no terminal, or the command cannot be started.
    pub fn start(command: &mut Command, stands_still: bool) -> Self {
        let (ours, name) = new_terminal().unwrap_or_else(|error| panic!("no terminal: {error}"));
        let theirs = File::options()
            .read(true)
            .write(true)
            .open(&name)
            .unwrap_or_else(|error| panic!("no terminal: {error}"));
        let ends = [0; 3].map(|_| theirs.try_clone().unwrap_or_else(|error| panic!("no terminal: {error}")));
        let [input, output, errors] = ends.map(Stdio::from);
        command
            .stdin(input)
            .stdout(output)
            .stderr(errors)
            .env("TERM", "xterm-256color")
            .env("LC_ALL", "C.UTF-8");
        // SAFETY: plain system calls between fork and exec: a session of its own, whose terminal is this one.
        unsafe {
            command.pre_exec(|| {
                rustix::process::setsid()?;
                rustix::process::ioctl_tiocsctty(rustix::stdio::stdin())?;
                Ok(())
            });
        }
        let child = command.spawn().unwrap_or_else(|error| panic!("{command:?} does not start: {error}"));
        let seen = Arc::new(Mutex::new(Vec::new()));
        let closing = Arc::new(AtomicBool::new(false));
        let reader = (!stands_still).then(|| {
            let reader = ours.try_clone().unwrap_or_else(|error| panic!("no terminal: {error}"));
            let (seen, closing) = (Arc::clone(&seen), Arc::clone(&closing));
            std::thread::spawn(move || read(reader, &seen, &closing))
        });
        Self { child, ours: Some(ours), seen, reader, closing }
    }

    /// Presses keys.
    ///
    /// # Panics
    /// When the terminal takes none.
    pub fn type_keys(&self, keys: &str) {
        let ours = self.ours.as_ref().and_then(|ours| ours.try_clone().ok());
        let typed = ours.map(|ours| File::from(ours).write_all(keys.as_bytes()));
        assert!(matches!(typed, Some(Ok(()))), "the terminal takes no keys");
    }

    /// Everything that was written on it so far, with what moves the cursor.
    pub fn seen(&self) -> String {
        String::from_utf8_lossy(&self.seen.lock().unwrap_or_else(PoisonError::into_inner)).into_owned()
    }

    /// Closes the terminal, as a window is closed or a connection breaks. The kernel tells the process with
    /// SIGHUP.
    pub fn close(&mut self) {
        self.closing.store(true, Ordering::Release);
        if let Some(reader) = self.reader.take() {
            let _ = reader.join();
        }
        self.ours = None;
    }
}

/// A terminal: our end, and the path of the other one.
fn new_terminal() -> rustix::io::Result<(OwnedFd, String)> {
    let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&ours)?;
    unlockpt(&ours)?;
    tcsetwinsize(&ours, Winsize { ws_row: 45, ws_col: 160, ws_xpixel: 0, ws_ypixel: 0 })?;
    let name = ptsname(&ours, Vec::new())?.to_string_lossy().into_owned();
    Ok((ours, name))
}

fn read(ours: OwnedFd, seen: &Mutex<Vec<u8>>, closing: &AtomicBool) {
    let mut reader = File::from(ours);
    let mut bytes = [0; 65536];
    let pause = rustix::time::Timespec { tv_sec: 0, tv_nsec: 20_000_000 };
    while !closing.load(Ordering::Acquire) {
        let mut descriptors = [PollFd::new(&reader, PollFlags::IN)];
        if !poll(&mut descriptors, Some(&pause)).is_ok_and(|ready| ready > 0) {
            continue;
        }
        match reader.read(&mut bytes) {
            Ok(read) if read > 0 => {
                seen.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(&bytes[..read]);
            }
            // Nobody has the other end.
            _ => return,
        }
    }
}

impl Drop for OnTerminal {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.close();
    }
}
