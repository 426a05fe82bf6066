//! The run as lines, for pipes and logs.

use crate::console::{Console, harmless};
use crate::supervise::Supervisor;
use messages::RunSummary;

/// Prints a line an event.
#[derive(Debug)]
pub(crate) struct Lines {
    console: Console,
    printed: usize,
    only_trouble: bool,
    last_remark: String,
}

impl Lines {
    /// All events, or only those that went wrong.
    pub(crate) fn new(console: Console, only_trouble: bool) -> Self {
        Self { console, printed: 0, only_trouble, last_remark: String::new() }
    }

    /// Prints what has happened since the last time.
    pub(crate) fn show(&mut self, supervisor: &Supervisor, summary: Option<&RunSummary>) {
        let new = supervisor.event_count - self.printed;
        self.printed = supervisor.event_count;
        let kept = supervisor.events.len();
        if new > kept {
            self.console.line(&format!("({} events were left out)", new - kept));
        }
        for event in supervisor.events.iter().skip(kept.saturating_sub(new)) {
            if event.is_trouble || !self.only_trouble {
                let role = if event.role.is_empty() { "launch" } else { &event.role };
                self.console.line(&format!("[{:>9.3}] {role}: {}", event.at_s, harmless(&event.text)));
            }
        }
        if let Some(summary) = summary.filter(|_| !self.only_trouble)
            && wording(summary.remark.as_str()) != self.last_remark
        {
            self.last_remark = wording(summary.remark.as_str());
            let at_s = board::clock::monotonic().seconds_since(supervisor.began);
            self.console.line(&format!("[{at_s:>9.3}] referee: {}", harmless(summary.remark.as_str())));
        }
    }
}

/// A remark without its numbers: what only counts on is no news.
fn wording(remark: &str) -> String {
    remark.chars().filter(|letter| !letter.is_ascii_digit()).collect()
}
