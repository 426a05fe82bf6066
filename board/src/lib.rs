//! The message board: zero-copy publish and subscribe over shared memory.
//!
//! A service writes its `main` with [`run`]: the closure that it gives declares ports on the [`Node`] and
//! returns the step. The same closure answers `--interface`, so that a launcher can check a graph before
//! anything starts.
//!
//! ```no_run
//! use messages::{Misfit, Odometry, Parameters, RunSummary};
//! use schemars::JsonSchema;
//! use serde::{Deserialize, Serialize};
//! use std::process::ExitCode;
//!
//! /// What can be adjusted.
//! #[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
//! #[serde(deny_unknown_fields, default)]
//! struct Params {
//!     /// A robot that is faster than this drives.
//!     #[schemars(range(min = 0.0, max = 2.0))]
//!     standstill_mps: f64,
//! }
//!
//! impl Parameters for Params {
//!     type Error = Misfit;
//! }
//!
//! fn main() -> ExitCode {
//!     board::run(board::about!(), |node, params: Params| {
//!         let mut odometry = node.latest::<Odometry>("wheels/odometry")?;
//!         let mut summary = node.publisher::<RunSummary>("run/summary")?;
//!         node.wake_on(&odometry);
//!         Ok(move |_now| {
//!             if odometry.read().is_some_and(|odometry| odometry.forward_mps > params.standstill_mps) {
//!                 summary.publish(&RunSummary::default());
//!             }
//!         })
//!     })
//! }
//! ```
//!
//! Everything else here is for the launcher ([`host`], [`switchboard`], [`gate`]) and for tools ([`tap`],
//! [`place`], [`manifest`]). This is the only crate that knows the transport, signals and the clock.

pub mod arguments;
pub mod clock;
pub mod gate;
pub mod host;
pub mod logout;
pub mod manifest;
pub mod place;
pub mod private;
pub mod switchboard;
pub mod tap;
pub mod terminal;

mod damage;
mod example;
mod health;
mod host_error;
mod interface;
mod janitor;
mod kept;
mod known;
mod lack;
mod lock;
mod names;
mod need;
mod news;
mod node;
mod port;
mod run;
mod segments;
mod shape;
mod shared;
mod sweep;
mod transport;

pub use interface::{About, Direction, Interface, PortDescription};
pub use kept::Kept;
pub use lack::Lack;
pub use messages::Envelope;
pub use news::News;
pub use node::{Declared, JoinError, Node};
pub use port::{Latest, Loan, Publisher, Queue, Reader};
pub use run::{EXIT_SETUP, SetupError, run};
pub use transport::TransportError;
