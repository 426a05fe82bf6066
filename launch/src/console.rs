//! What the launcher prints. A person, a pipe or a full disk at the other end may take its time, break off or refuse; none of that may hold up a robot.
//!
//! A run prints through a [`Console`]: a thread of its own behind a queue that drops lines when it is full, and says how many. A command that only answers
//! prints with [`say`], and ends quietly when nobody reads any more, as `head` makes it.

use std::io::{self, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Lines that may wait for a slow reader.
const WAITING_MAX: usize = 1024;
/// For so long a run waits at its end for the last lines to be read.
const LAST_WORDS: Duration = Duration::from_millis(300);

/// Where a line goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stream {
    Out,
    Error,
}

#[derive(Debug)]
enum Item {
    Text(Stream, String),
    /// Answered when everything before it was written.
    Flush(SyncSender<()>),
}

/// The output of a run; clones write to the same place, in order.
#[derive(Debug, Clone)]
pub(crate) struct Console {
    queue: SyncSender<Item>,
    dropped: Arc<AtomicU64>,
    /// While a view holds the terminal, what is printed waits here; nothing otherwise.
    held: Arc<Mutex<Option<Vec<Item>>>>,
}

impl Console {
    /// Starts the thread that writes.
    pub(crate) fn start() -> Self {
        Self::writing_to(io::stdout(), io::stderr())
    }

    fn writing_to(out: impl Write + Send + 'static, error: impl Write + Send + 'static) -> Self {
        let (queue, items) = mpsc::sync_channel(WAITING_MAX);
        let dropped = Arc::new(AtomicU64::new(0));
        let count = Arc::clone(&dropped);
        // Without a thread nothing is printed, and the robot runs all the same.
        let _ = std::thread::Builder::new()
            .name("console".to_owned())
            .spawn(move || write_all(&items, out, error, &count));
        Self { queue, dropped, held: Arc::default() }
    }

    /// Prints a line on the standard output.
    pub(crate) fn line(&self, line: &str) {
        self.print(&format!("{line}\n"));
    }

    /// Prints a text on the standard output.
    pub(crate) fn print(&self, text: &str) {
        self.put(Item::Text(Stream::Out, text.to_owned()));
    }

    /// Prints a line on the standard error.
    pub(crate) fn error(&self, line: &str) {
        self.put(Item::Text(Stream::Error, format!("{line}\n")));
    }

    /// From now on lines wait, because a view has the terminal.
    pub(crate) fn hold(&self) {
        self.held.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_default();
    }

    /// The terminal is free again: prints what has waited.
    pub(crate) fn release(&self) {
        let held = self.held.lock().unwrap_or_else(PoisonError::into_inner).take();
        held.into_iter().flatten().for_each(|item| self.send(item));
    }

    /// Waits until all is written, for as long as a run may be held up by its reader at its end.
    pub(crate) fn flush(&self) {
        self.release();
        let (done, written) = mpsc::sync_channel(1);
        if self.queue.try_send(Item::Flush(done)).is_ok() {
            let _ = written.recv_timeout(LAST_WORDS);
        }
    }

    fn put(&self, item: Item) {
        if let Some(held) = self.held.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
            if held.len() < WAITING_MAX {
                held.push(item);
            } else {
                self.dropped.fetch_add(1, Ordering::Relaxed);
            }
            return;
        }
        self.send(item);
    }

    fn send(&self, item: Item) {
        if let Err(TrySendError::Full(_)) = self.queue.try_send(item) {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

fn write_all(items: &Receiver<Item>, mut out: impl Write, mut error: impl Write, dropped: &AtomicU64) {
    loop {
        let item = match items.recv_timeout(Duration::from_secs(1)) {
            Ok(item) => Some(item),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => return,
        };
        let missing = dropped.swap(0, Ordering::Relaxed);
        if missing > 0 {
            let _ = writeln!(error, "({missing} lines were left out: nobody read them in time)");
        }
        // Who does not listen any more is not told; the log of the run has all of it.
        match item {
            Some(Item::Text(Stream::Out, text)) => {
                _ = out.write_all(text.as_bytes()).and_then(|()| out.flush())
            }
            Some(Item::Text(Stream::Error, text)) => _ = error.write_all(text.as_bytes()),
            Some(Item::Flush(done)) => _ = done.try_send(()),
            None => {}
        }
    }
}

/// Prints an answer. When nobody reads any more, as with `| head`, the process ends quietly; when the output cannot be written, it ends with an error.
pub(crate) fn say(text: &str) {
    let mut out = io::stdout().lock();
    if let Err(error) = out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        give_up(&error);
    }
}

/// As [`say`], with a line's end.
pub(crate) fn say_line(line: &str) {
    say(&format!("{line}\n"));
}

/// Prints a line on the standard error, if anybody reads there.
pub(crate) fn warn(line: &str) {
    let _ = writeln!(io::stderr().lock(), "{line}");
}

/// As [`warn`], with lines' ends of its own.
pub(crate) fn warn_text(text: &str) {
    let _ = write!(io::stderr().lock(), "{text}");
}

fn give_up(error: &io::Error) -> ! {
    if error.kind() == io::ErrorKind::BrokenPipe {
        std::process::exit(0);
    }
    warn(&format!("error: the output cannot be written: {error}"));
    std::process::exit(1);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes nothing before it is let.
    struct Stuck(Receiver<()>);

    impl Write for Stuck {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let _ = self.0.recv();
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[derive(Clone, Default)]
    struct Kept(Arc<Mutex<Vec<u8>>>);

    impl Write for Kept {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().extend_from_slice(bytes);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Kept {
        fn text(&self) -> String {
            String::from_utf8(self.0.lock().unwrap().clone()).unwrap()
        }
    }

    #[test]
    fn an_output_that_stands_still_holds_up_nobody_and_what_is_left_out_is_counted() {
        let (go, wait) = mpsc::channel();
        let errors = Kept::default();
        let console = Console::writing_to(Stuck(wait), errors.clone());
        // The queue, and what the thread may have taken already.
        let count = WAITING_MAX + 100;
        (0..count).for_each(|line| console.line(&line.to_string()));
        console.flush();
        drop(go);
        console.error("the end");
        let deadline = board::clock::monotonic().after(Duration::from_secs(10));
        while !errors.text().contains("the end") {
            assert!(board::clock::monotonic() < deadline, "{}", errors.text());
            console.error("the end");
            board::clock::sleep(Duration::from_millis(1));
        }
        assert!(errors.text().contains("lines were left out"), "{}", errors.text());
    }

    #[test]
    fn lines_come_in_order_and_after_the_view() {
        let out = Kept::default();
        let console = Console::writing_to(out.clone(), io::sink());
        console.line("one");
        console.hold();
        console.line("two");
        console.line("three");
        console.flush();
        assert_eq!(out.text(), "one\ntwo\nthree\n");
    }

    #[test]
    fn a_console_whose_reader_is_gone_goes_on() {
        struct Gone;
        impl Write for Gone {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(io::ErrorKind::BrokenPipe.into())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let errors = Kept::default();
        let console = Console::writing_to(Gone, errors.clone());
        console.line("one");
        console.error("two");
        console.flush();
        assert_eq!(errors.text(), "two\n");
    }
}
