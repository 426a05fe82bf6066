//! What makes a run end before its own end: signals, `launch stop`, and `q` in a view. All are counted at one place, which the supervising loop looks at, and
//! which wakes it.

use std::io::{Read as _, Write as _};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicUsize, Ordering};

/// Who asked for the end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Wish {
    /// Ctrl-C.
    Interrupt = 1,
    /// The signal TERM: another program, or the machine that goes down.
    Terminate,
    /// The signal HUP, or a terminal that is not there any more.
    HangUp,
    /// `launch stop`.
    Command,
    /// A key in the view.
    Key,
}

impl Wish {
    /// In words.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Interrupt => "stopped by Ctrl-C",
            Self::Terminate => "stopped by a signal (TERM)",
            Self::HangUp => "stopped because its terminal was closed",
            Self::Command => "stopped by `launch stop`",
            Self::Key => "stopped by a key in the view",
        }
    }

    fn of(value: u8) -> Option<Self> {
        let all = [Self::Interrupt, Self::Terminate, Self::HangUp, Self::Command, Self::Key];
        all.into_iter().find(|wish| *wish as u8 == value)
    }
}

/// INT, TERM, HUP and requests as a count, with a descriptor that becomes readable when it grows.
#[derive(Debug)]
pub(crate) struct Signals {
    reader: UnixStream,
    alarm: Alarm,
    /// Ctrl-Z was pressed.
    suspended: Arc<AtomicBool>,
}

/// Wakes the supervising loop, and can ask it to end; for the threads beside it.
#[derive(Debug, Clone)]
pub(crate) struct Alarm {
    writer: Arc<UnixStream>,
    count: Arc<AtomicUsize>,
    /// The first wish.
    first: Arc<AtomicU8>,
}

impl Signals {
    /// Catches the signals of this process.
    ///
    /// # Errors
    /// When descriptors or handlers cannot be had.
    pub(crate) fn catch() -> std::io::Result<Self> {
        let (reader, writer) = UnixStream::pair()?;
        reader.set_nonblocking(true)?;
        writer.set_nonblocking(true)?;
        let alarm = Alarm { writer: Arc::new(writer), count: Arc::default(), first: Arc::default() };
        let wishes =
            [(libc::SIGINT, Wish::Interrupt), (libc::SIGTERM, Wish::Terminate), (libc::SIGHUP, Wish::HangUp)];
        for (signal, wish) in wishes {
            let alarm = alarm.clone();
            // SAFETY: the handler counts up an atomic and writes one byte, both allowed in signal handlers.
            unsafe {
                signal_hook::low_level::register(signal, move || alarm.ask_to_end(wish))?;
            }
        }
        stay_awake()?;
        let suspended = Arc::new(AtomicBool::new(false));
        let (alarm_too, asked) = (alarm.clone(), Arc::clone(&suspended));
        // SAFETY: as above.
        unsafe {
            signal_hook::low_level::register(libc::SIGTSTP, move || {
                asked.store(true, Ordering::Release);
                alarm_too.wake();
            })?;
        }
        Ok(Self { reader, alarm, suspended })
    }

    /// How often somebody has asked for the end. The second time means: without waiting.
    pub(crate) fn count(&self) -> usize {
        self.alarm.count.load(Ordering::Acquire)
    }

    /// Who asked first, in words.
    pub(crate) fn why(&self) -> &'static str {
        Wish::of(self.alarm.first.load(Ordering::Acquire)).map_or("stopped", Wish::words)
    }

    /// Whether somebody has pressed Ctrl-Z since the last look; it has no effect.
    pub(crate) fn was_to_be_suspended(&self) -> bool {
        self.suspended.swap(false, Ordering::AcqRel)
    }

    /// For other threads.
    pub(crate) fn alarm(&self) -> Alarm {
        self.alarm.clone()
    }

    /// Forgets that the loop was woken.
    pub(crate) fn drain(&self) {
        let mut bytes = [0; 64];
        while matches!((&self.reader).read(&mut bytes), Ok(read) if read > 0) {}
    }
}

impl AsFd for Signals {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.reader.as_fd()
    }
}

impl Alarm {
    /// Lets the loop look about now. Safe in a signal handler.
    pub(crate) fn wake(&self) {
        // Full means that it was woken already.
        let _ = (&*self.writer).write(&[1]);
    }

    /// Asks for the end. Safe in a signal handler.
    pub(crate) fn ask_to_end(&self, wish: Wish) {
        let _ = self.first.compare_exchange(0, wish as u8, Ordering::AcqRel, Ordering::Relaxed);
        self.count.fetch_add(1, Ordering::AcqRel);
        self.wake();
    }

    /// Asks for the end without waiting for anybody, as a second Ctrl-C does.
    pub(crate) fn ask_to_end_at_once(&self, wish: Wish) {
        self.ask_to_end(wish);
        self.ask_to_end(wish);
    }
}

/// What a terminal does to those in the background that read or set it would leave a robot that drives without its launcher.
fn stay_awake() -> std::io::Result<()> {
    // SAFETY: ignoring a signal is a plain system call.
    unsafe {
        for signal in [libc::SIGTTIN, libc::SIGTTOU] {
            if libc::signal(signal, libc::SIG_IGN) == libc::SIG_ERR {
                return Err(std::io::Error::last_os_error());
            }
        }
    }
    Ok(())
}

/// For a process that is about to become a service: the signals of a shell mean again what they mean to others.
pub(crate) fn forget_in_child() {
    // SAFETY: plain system calls, between fork and exec.
    unsafe {
        for signal in [libc::SIGTTIN, libc::SIGTTOU] {
            libc::signal(signal, libc::SIG_DFL);
        }
    }
}
