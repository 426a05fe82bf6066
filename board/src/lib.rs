//! The message board.
mod interface;
pub use interface::{About, Direction, Interface, PortDescription};
