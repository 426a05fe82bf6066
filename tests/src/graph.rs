//! A graph that is about to be started.

use crate::running::Running;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// A graph file and what is changed about it.
#[derive(Debug, Clone)]
pub struct Graph {
    file: PathBuf,
    arguments: Vec<String>,
    in_lockstep: bool,
    is_recorded: bool,
}

impl Graph {
    /// The graph with this name in `launch/graphs`, or the one at this path.
    pub fn load(graph: &str) -> Self {
        let file = if graph.contains('/') {
            PathBuf::from(graph)
        } else {
            PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../launch/graphs"))
                .join(format!("{graph}.toml"))
        };
        Self { file, arguments: Vec::new(), in_lockstep: false, is_recorded: true }
    }

    /// Sets a parameter: `role.parameter`.
    pub fn set(self, parameter: &str, value: impl Into<serde_json::Value>) -> Self {
        // JSON's numbers, texts and arrays are TOML's.
        let value = value.into();
        self.with(&["--set", &format!("{parameter}={value}")])
    }

    /// Runs another binary in a role.
    pub fn swap(self, role: &str, binary: &str) -> Self {
        self.with(&["--swap", &format!("{role}={binary}")])
    }

    /// Leaves a service out.
    pub fn without(self, role: &str) -> Self {
        self.with(&["--without", role])
    }

    /// The seed of all randomness.
    pub fn seed(self, seed: u64) -> Self {
        self.with(&["--seed", &seed.to_string()])
    }

    /// Runs it in logical time with this seed. The graph then stands still but for [`Running::advance`] and
    /// [`Running::wait_for`]: the same test sees the same messages in every run, however busy the machine is.
    pub fn lockstep(self, seed: u64) -> Self {
        Self { in_lockstep: true, ..self.seed(seed) }
    }

    /// Keeps no recording for the case that the test fails: for measurements.
    pub fn without_recording(self) -> Self {
        Self { is_recorded: false, ..self }
    }

    /// Further arguments for `launch up`.
    pub fn with(mut self, arguments: &[&str]) -> Self {
        self.arguments.extend(arguments.iter().map(|argument| (*argument).to_owned()));
        self
    }

    /// Starts it on a board of its own and waits until every service is ready; in logical time also until the
    /// first instant is over.
    ///
    /// # Panics
    /// When it does not start, with the launcher's words.
    pub fn start(self) -> Running {
        Running::start(&self)
    }

    /// A board that no other test has.
    pub(crate) fn board_name() -> String {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        format!("t{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed))
    }

    pub(crate) fn file(&self) -> &Path {
        &self.file
    }

    pub(crate) fn arguments(&self) -> &[String] {
        &self.arguments
    }

    pub(crate) fn is_in_lockstep(&self) -> bool {
        self.in_lockstep
    }

    pub(crate) fn is_recorded(&self) -> bool {
        self.is_recorded
    }
}
