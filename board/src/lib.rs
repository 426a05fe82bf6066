//! The message board: zero-copy publish and subscribe over shared memory.
//!
//! A service writes `fn main()` with [`run`] and declares its ports on the [`Node`]; everything else here is for the launcher and for tools.
//! This is the only crate that knows the transport, signals and the clock.

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
