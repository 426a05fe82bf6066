//! A run in logical time that goes on only when it is told to, for tests: orders come as lines on the standard input, answers as JSON lines on the
//! standard output.
//!
//! `advance SECONDS` plays on; `look` brings the recording up to date; `kill ROLE` kills a service now; `end` and the end of the input end the run.

use messages::Time;
use rustix::event::{PollFd, PollFlags, poll};
use std::collections::VecDeque;
use std::io::Write as _;
use std::time::Duration;

/// What a person, or a test, wants.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Order {
    /// Play on for so long.
    Advance(Duration),
    /// Bring the recording up to date.
    Look,
    /// Kill a service.
    Kill(String),
    /// End the run.
    End,
}

impl Order {
    fn parse(line: &str) -> Result<Self, String> {
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        match (word, rest.trim()) {
            ("advance", rest) => match rest.parse::<f64>() {
                Ok(seconds) if (0.0..=1e9).contains(&seconds) => {
                    Ok(Self::Advance(Duration::from_nanos((seconds * 1e9).round() as u64)))
                }
                _ => Err(format!("`advance` takes seconds, not `{rest}`")),
            },
            ("kill", role) if !role.is_empty() => Ok(Self::Kill(role.to_owned())),
            ("look", "") => Ok(Self::Look),
            ("end", "") => Ok(Self::End),
            _ => Err(format!("`{line}` is none of: advance SECONDS, look, kill ROLE, end")),
        }
    }
}

/// Listens to the standard input.
#[derive(Debug, Default)]
pub(crate) struct Steering {
    target: Time,
    bytes: Vec<u8>,
    lines: VecDeque<String>,
    /// Whether an order was carried out that has not been answered.
    owes_answer: bool,
}

impl Steering {
    pub(crate) fn new() -> Self {
        // The first rest is after the first instant, and says that the graph is ready.
        Self { owes_answer: true, ..Self::default() }
    }

    /// The moment up to which the run may go.
    pub(crate) fn target(&self) -> Time {
        self.target
    }

    /// Answers the last order and waits for the next.
    pub(crate) fn next_order(&mut self, now: Time, wants_to_leave: impl Fn() -> bool) -> Order {
        if std::mem::take(&mut self.owes_answer) {
            answer(&serde_json::json!({"now_ns": now.as_nanos()}));
        }
        loop {
            let Some(line) = self.next_line(&wants_to_leave) else { return Order::End };
            match Order::parse(line.trim()) {
                Ok(order) => {
                    self.owes_answer = true;
                    if let Order::Advance(duration) = order {
                        self.target = now.after(duration);
                    }
                    return order;
                }
                Err(error) => answer(&serde_json::json!({"error": error})),
            }
        }
    }

    /// Says that the run is over.
    pub(crate) fn say_end(&mut self) {
        if std::mem::take(&mut self.owes_answer) {
            answer(&serde_json::json!({"ended": true}));
        }
    }

    fn next_line(&mut self, wants_to_leave: impl Fn() -> bool) -> Option<String> {
        loop {
            if let Some(line) = self.lines.pop_front() {
                return Some(line);
            }
            if wants_to_leave() {
                return None;
            }
            let input = std::io::stdin();
            let pause = rustix::time::Timespec { tv_sec: 0, tv_nsec: 100_000_000 };
            let mut descriptors = [PollFd::new(&input, PollFlags::IN)];
            if !poll(&mut descriptors, Some(&pause)).is_ok_and(|ready| ready > 0) {
                continue;
            }
            let mut bytes = [0; 4096];
            match rustix::io::read(&input, &mut bytes) {
                Ok(read) if read > 0 => self.bytes.extend_from_slice(&bytes[..read]),
                Err(rustix::io::Errno::INTR) => {}
                _ => return None,
            }
            while let Some(end) = self.bytes.iter().position(|&byte| byte == b'\n') {
                let line: Vec<u8> = self.bytes.drain(..=end).collect();
                self.lines.push_back(String::from_utf8_lossy(&line).into_owned());
            }
        }
    }
}

fn answer(value: &serde_json::Value) {
    // Whoever does not listen any more has closed our input too.
    let mut output = std::io::stdout().lock();
    let _ = writeln!(output, "{value}").and_then(|()| output.flush());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(line: &str, order: Order) {
        assert_eq!(Order::parse(line), Ok(order));
    }

    #[test]
    fn orders() {
        check("advance 1.5", Order::Advance(Duration::from_millis(1500)));
        check("kill planner", Order::Kill("planner".to_owned()));
        check("look", Order::Look);
        check("end", Order::End);
        for wrong in ["", "advance", "advance -1", "advance NaN", "kill", "dance"] {
            assert!(Order::parse(wrong).is_err(), "{wrong}");
        }
    }
}
