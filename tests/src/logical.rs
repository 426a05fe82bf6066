//! Whole runs in logical time.

use crate::binaries::launcher;
use crate::graph::Graph;
use serde_json::Value;
use std::process::Command;

impl Graph {
    /// Runs the graph in lockstep to its end, on a board of its own, and returns what
    /// `launch up --lockstep --json` prints: `run` (`passed`, `remark`, `figures`), `digest`, `logical_s`.
    ///
    /// # Panics
    /// When the run cannot be made; not when it fails.
    #[allow(clippy::panic)]
    pub fn run_in_lockstep(&self) -> Value {
        let output = Command::new(launcher())
            .arg("up")
            .arg(self.file())
            .args(["--lockstep", "--json", "--no-view", "--no-build", "--board", &Self::board_name()])
            .args(self.arguments())
            .output()
            .unwrap_or_else(|error| panic!("the launcher does not start: {error}"));
        let words = String::from_utf8_lossy(&output.stderr);
        let printed = String::from_utf8_lossy(&output.stdout);
        let last = printed.lines().last().unwrap_or_default();
        serde_json::from_str(last).unwrap_or_else(|error| panic!("{error}: {printed}\n{words}"))
    }
}
