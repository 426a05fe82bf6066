//! Graph files: reading, checking against the binaries, drawing.

mod binaries;
mod build;
mod check;
mod diagram;
mod file;
mod find;
mod problem;
mod report;
mod schema;
mod settings;
mod source;
mod suggest;
#[cfg(test)]
mod tests;
mod topics;
mod tree;

pub(crate) use check::{Checked, CheckedService, CheckedTopic};
pub(crate) use file::{Overrides, shown};
pub(crate) use find::checkout;
pub(crate) use report::{Request, check_command, graph_command, prepare};
pub(crate) use settings::{Priority, ViewSettings};
