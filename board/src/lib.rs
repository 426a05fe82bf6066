//! The message board: zero-copy publish and subscribe over shared memory.
//!
//! A service writes `fn main()` with [`run`] and declares its ports on the [`Node`]; everything else here is for the launcher and for tools.
//! This is the only crate that knows the transport, signals and the clock.

pub mod clock;
pub mod gate;
pub mod host;
pub mod manifest;
pub mod place;
pub mod switchboard;
pub mod tap;

mod example;
mod health;
mod interface;
mod janitor;
mod kept;
mod node;
mod port;
mod run;
mod shared;
mod transport;

pub use interface::{About, Direction, Interface, PortDescription};
pub use kept::Kept;
pub use node::{Declared, JoinError, Node};
pub use port::{Latest, Loan, Publisher, Queue, Reader};
pub use run::{EXIT_SETUP, SetupError, run};
pub use transport::{Envelope, TransportError};
