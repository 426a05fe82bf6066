//! The run as lines, for pipes and logs.

use crate::monitor::Monitor;
use crate::supervise::Supervisor;
use crate::up::Display;

/// Prints a line an event.
#[derive(Debug)]
pub(crate) struct Lines {
    printed: usize,
    only_trouble: bool,
    last_remark: String,
}

impl Lines {
    /// All events, or only those that went wrong.
    pub(crate) fn new(only_trouble: bool) -> Self {
        Self { printed: 0, only_trouble, last_remark: String::new() }
    }
}

/// A remark without its numbers: what only counts on is no news.
fn wording(remark: &str) -> String {
    remark.chars().filter(|letter| !letter.is_ascii_digit()).collect()
}

impl Display for Lines {
    fn show(&mut self, supervisor: &Supervisor, monitor: &mut Monitor) {
        let new = supervisor.event_count - self.printed;
        self.printed = supervisor.event_count;
        let kept = supervisor.events.len();
        for event in supervisor.events.iter().skip(kept.saturating_sub(new)) {
            if event.is_trouble || !self.only_trouble {
                let role = if event.role.is_empty() { "launch" } else { &event.role };
                println!("[{:>9.3}] {role}: {}", event.at_s, event.text);
            }
        }
        if let Some(summary) = monitor.summary().filter(|_| !self.only_trouble)
            && wording(summary.remark.as_str()) != self.last_remark
        {
            self.last_remark = wording(summary.remark.as_str());
            let at_s = board::clock::monotonic().seconds_since(supervisor.began);
            println!("[{at_s:>9.3}] referee: {}", summary.remark);
        }
    }

    fn wants_to_leave(&mut self) -> bool {
        false
    }

    fn close(&mut self) {}
}
