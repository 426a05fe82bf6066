//! The live view: what the launcher knows, on one screen.
//!
//! A [`Viewer`] is a thread that joins the board as any tool does, asks the launcher how everything stands over the control socket, and holds the terminal: the same for
//! `launch up` and `launch attach`, in either kind of time. So no terminal can hold up the launcher. `draw` is a pure function from a `Snapshot` to a frame;
//! what keys do is decided in `keys`, without a terminal.

mod frame;
mod keys;
mod map;
mod plan;
mod scene;
mod snapshot;
mod terminal;
#[cfg(test)]
mod tests;
mod viewer;

pub(crate) use terminal::{can_show, why_not};
pub(crate) use viewer::{OnQuit, Viewer, watch};
