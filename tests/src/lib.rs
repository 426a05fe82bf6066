//! The harness for process graphs: start a graph on a board of its own, talk to it, wait for what it does,
//! kill its services, and leave nothing behind, also when the test panics.
//!
//! A graph runs in host time, or in logical time with [`Graph::lockstep`]; the same words drive both. A test
//! that fails prints the last messages and log lines of each service, and keeps the recording of the graph in
//! `target/tmp/failed-graphs`.
//!
//! ```no_run
//! use tests::Graph;
//! use std::time::Duration;
//!
//! let graph = Graph::load("coffee").set("navigator.default_order", "").start();
//! graph.publish("mission/orders", serde_json::json!({"room": "205"}));
//! let status = graph.wait_for("mission/status", |status| status["room"] == "205", Duration::from_secs(5));
//! assert_eq!(status["waiting"], 0);
//! ```

mod binaries;
mod failure;
mod graph;
mod keeper;
mod logical;
mod running;
mod steering;
mod terminal;

pub use binaries::{build, launcher};
pub use graph::Graph;
pub use keeper::folder as failed_graphs;
pub use running::{Running, signal};
pub use terminal::OnTerminal;
