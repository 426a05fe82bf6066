//! The live view: what the launcher knows, on one screen.
//!
//! `draw` is a pure function from a `Snapshot` to a frame; `Live` fills the snapshot from the board and holds the terminal.

mod frame;
mod live;
mod map;
mod plan;
mod snapshot;
#[cfg(test)]
mod tests;

pub(crate) use live::Live;
