//! Runs a binary that is to say what it is, and waits as long as it works at it.
//!
//! What counts is the processor's time: a busy machine makes nobody guilty. One thread waits for the end and
//! reads what comes meanwhile.

use super::check::QueryError;
use crate::supervise::pulse::{Doing, LOOK_MAX, vitals};
use board::clock;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::process::{Pid, PidfdFlags, Signal, kill_process_group, pidfd_open};
use std::fs::File;
use std::io::{ErrorKind, Read as _};
use std::os::fd::OwnedFd;
use std::os::unix::process::CommandExt as _;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

/// Longest answer, in bytes: a hundred ports and parameters with their descriptions have a tenth.
const ANSWER_MAX: usize = 16 << 20;

/// How long a binary may take to say what it is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Patience {
    /// So much of a processor's time: it does something that it should not do.
    pub(super) processor: Duration,
    /// So much time asleep: it waits for something that never comes, and neither for a processor nor for the disk.
    pub(super) asleep: Duration,
    /// And so much time on the wall, whatever it does.
    pub(super) wall: Duration,
    /// After so long somebody is told that it is slow.
    pub(super) first_word: Duration,
    /// And again each time so much has passed.
    pub(super) next_word: Duration,
}

/// For a person before a terminal, on a robot's computer that may be busy.
pub(super) const PATIENCE: Patience = Patience {
    processor: Duration::from_secs(10),
    asleep: Duration::from_secs(10),
    wall: Duration::from_secs(60),
    first_word: Duration::from_secs(3),
    next_word: Duration::from_secs(5),
};

/// How long a binary has been at it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spent {
    /// Since it was started.
    pub(super) wall: Duration,
    /// Of the processor.
    pub(super) processor: Duration,
}

/// Runs a command to its end, or until its time is up; `slow` is told now and then how long it takes.
pub(super) fn run(
    command: &mut Command,
    patience: Patience,
    mut slow: impl FnMut(Spent),
) -> Result<Output, QueryError> {
    let broken = |what: &str, error: std::io::Error| {
        let lack = board::Lack::behind(&error).map(|lack| format!(" ({lack})")).unwrap_or_default();
        QueryError::Broken(format!("{what}: {error}{lack}"))
    };
    // A group of its own, so that whatever it started ends with it.
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).process_group(0);
    let mut child = command.spawn().map_err(|error| broken("it cannot be started", error))?;
    let mut pipes = [Pipe::new(child.stdout.take()), Pipe::new(child.stderr.take())];
    let end = wait(&child, &mut pipes, patience, &mut slow);
    // With it goes what it has started and left behind.
    if let Some(pid) = pid_of(&child) {
        let _ = kill_process_group(pid, Signal::KILL);
    }
    let status = child.wait().map_err(|error| broken("it cannot be waited for", error))?;
    end?;
    let [stdout, stderr] = pipes.map(|pipe| pipe.bytes);
    Ok(Output { status, stdout, stderr })
}

fn pid_of(child: &Child) -> Option<Pid> {
    Pid::from_raw(i32::try_from(child.id()).ok()?)
}

fn wait(
    child: &Child,
    pipes: &mut [Pipe; 2],
    patience: Patience,
    slow: &mut impl FnMut(Spent),
) -> Result<(), QueryError> {
    let cannot = |why: std::io::Error| QueryError::Broken(format!("it cannot be watched: {why}"));
    let pid = pid_of(child).ok_or_else(|| cannot(ErrorKind::InvalidInput.into()))?;
    let pidfd = pidfd_open(pid, PidfdFlags::empty()).map_err(|error| cannot(error.into()))?;
    let begun = clock::monotonic();
    let mut next_word = patience.first_word;
    let (mut asleep, mut last) = (Duration::ZERO, begun);
    loop {
        let mut fds = vec![PollFd::new(&pidfd, PollFlags::IN)];
        fds.extend(
            pipes.iter().filter_map(|pipe| pipe.file.as_ref()).map(|file| PollFd::new(file, PollFlags::IN)),
        );
        // Often enough to see the processor's time.
        let tick = Timespec { tv_sec: 0, tv_nsec: 100_000_000 };
        let ready = poll(&mut fds, Some(&tick));
        let has_ended = ready.is_ok_and(|ready| ready > 0) && !fds[0].revents().is_empty();
        for pipe in pipes.iter_mut() {
            pipe.drain()?;
        }
        if has_ended {
            return Ok(());
        }
        let now = clock::monotonic();
        if vitals(child.id()).is_some_and(|vitals| vitals.doing == Doing::Rests) {
            asleep += now.since(last).min(LOOK_MAX);
        }
        last = now;
        let spent = Spent { wall: now.since(begun), processor: processor_time(child.id()) };
        if spent.processor > patience.processor {
            let (limit, what) = (patience.processor.as_secs_f64(), "of processor time");
            return Err(QueryError::Broken(format!("no answer within {limit} s {what}")));
        }
        if asleep > patience.asleep {
            let limit = patience.asleep.as_secs_f64();
            return Err(QueryError::Broken(format!("no answer within {limit} s in which it only waited")));
        }
        if spent.wall > patience.wall {
            let (limit, used) = (patience.wall.as_secs_f64(), spent.processor.as_secs_f64());
            return Err(QueryError::Broken(format!(
                "no answer within {limit} s ({used:.1} s of processor time)"
            )));
        }
        if spent.wall >= next_word {
            slow(spent);
            next_word = spent.wall + patience.next_word;
        }
    }
}

/// What a child says, as far as it was read.
struct Pipe {
    /// Nothing once it is closed.
    file: Option<File>,
    bytes: Vec<u8>,
}

impl Pipe {
    fn new(pipe: Option<impl Into<OwnedFd>>) -> Self {
        let file = pipe.map(|pipe| File::from(pipe.into()));
        if let Some(file) = &file
            && let Ok(flags) = fcntl_getfl(file)
        {
            // What cannot be read at once is read the next time.
            let _ = fcntl_setfl(file, flags | OFlags::NONBLOCK);
        }
        Self { file, bytes: Vec::new() }
    }

    fn drain(&mut self) -> Result<(), QueryError> {
        let mut block = [0; 16 * 1024];
        while let Some(file) = &mut self.file {
            match file.read(&mut block) {
                Ok(0) => self.file = None,
                Ok(count) => self.bytes.extend_from_slice(&block[..count]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                // What arrived before an error is still worth showing.
                Err(_) => self.file = None,
            }
            if self.bytes.len() > ANSWER_MAX {
                return Err(QueryError::Broken(format!("it says more than {} MiB", ANSWER_MAX >> 20)));
            }
        }
        Ok(())
    }
}

/// What a process and the children that it has seen end have used of the processor; nothing for one that is
/// gone.
fn processor_time(pid: u32) -> Duration {
    // Linux counts hundredths of a second here, whatever its own clock.
    const TICK: Duration = Duration::from_millis(10);
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // The name in brackets may hold anything; the 14th to 17th words are ticks.
    let words = stat.rsplit_once(')').map_or("", |(_, rest)| rest).split_ascii_whitespace();
    let ticks: u32 = words.skip(11).take(4).filter_map(|word| word.parse::<u32>().ok()).sum();
    TICK * ticks
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHORT: Patience = Patience {
        processor: Duration::from_millis(300),
        asleep: Duration::from_millis(900),
        wall: Duration::from_millis(1500),
        first_word: Duration::from_millis(100),
        next_word: Duration::from_millis(200),
    };

    fn ask(script: &str, patience: Patience) -> (Result<Output, QueryError>, Vec<Spent>) {
        let mut words = Vec::new();
        let output = run(Command::new("sh").args(["-c", script]), patience, |spent| words.push(spent));
        (output, words)
    }

    #[track_caller]
    fn refused(script: &str, why: &str) -> Vec<Spent> {
        let (output, words) = ask(script, SHORT);
        let error = output.expect_err(script).to_string();
        assert!(error.contains(why), "{error}");
        words
    }

    #[test]
    fn an_answer_is_read_to_its_end() {
        let (output, _) = ask("echo out; echo err >&2; exit 3", PATIENCE);
        let output = output.unwrap();
        assert_eq!((output.stdout.as_slice(), output.stderr.as_slice()), (&b"out\n"[..], &b"err\n"[..]));
        assert_eq!(output.status.code(), Some(3));
        // More than a pipe holds.
        let (output, _) = ask("head -c 3000000 /dev/zero; echo >&2", PATIENCE);
        assert_eq!(output.unwrap().stdout.len(), 3_000_000);
    }

    #[test]
    fn who_works_is_measured_by_the_processor() {
        let words = refused("while :; do :; done", "no answer within 0.3 s of processor time");
        assert!(words.iter().all(|spent| spent.processor <= SHORT.processor + spent.wall));
    }

    #[test]
    fn who_waits_is_measured_by_its_sleep() {
        let words = refused("sleep 60", "no answer within 0.9 s in which it only waited");
        assert!(
            !words.is_empty() && words.windows(2).all(|pair| pair[1].wall - pair[0].wall >= SHORT.next_word)
        );
    }

    #[test]
    fn who_says_too_much_is_stopped() {
        refused("head -c 40000000 /dev/zero", "it says more than 16 MiB");
    }

    #[test]
    fn what_is_left_behind_is_not_waited_for_and_ended() {
        let (output, _) = ask("sleep 600 & echo $!", PATIENCE);
        let pid = String::from_utf8(output.unwrap().stdout).unwrap();
        let state = || {
            let stat = std::fs::read_to_string(format!("/proc/{}/stat", pid.trim())).unwrap_or_default();
            stat.rsplit_once(')').map(|(_, rest)| rest.trim_start().chars().next())
        };
        // Gone, or dead and not yet cleared away by whoever inherits it.
        while !matches!(state(), None | Some(Some('Z' | 'X'))) {
            std::thread::yield_now();
        }
    }
}
