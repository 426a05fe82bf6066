//! A graph that is about to be started.

use crate::running::Running;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// A graph file and what is changed about it.
#[derive(Debug, Clone)]
pub struct Graph {
    file: PathBuf,
    arguments: Vec<String>,
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
        Self { file, arguments: Vec::new() }
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

    /// Further arguments for `launch up`.
    pub fn with(mut self, arguments: &[&str]) -> Self {
        self.arguments.extend(arguments.iter().map(|argument| (*argument).to_owned()));
        self
    }

    /// Starts it on a board of its own and waits until every service is ready.
    ///
    /// # Panics
    /// When it does not start, with the launcher's words.
    pub fn start(self) -> Running {
        Running::start(&self.file, &Self::board_name(), &self.arguments)
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
}
