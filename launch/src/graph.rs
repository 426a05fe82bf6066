//! Graph files: reading, checking against the binaries, drawing.

mod ask;
mod binaries;
mod build;
mod check;
mod checked;
mod diagram;
mod faults;
mod file;
mod find;
mod keys;
mod log_level;
mod paths;
mod problem;
mod report;
mod schema;
mod settings;
mod source;
mod suggest;
#[cfg(test)]
mod tests;
mod text;
mod topics;
mod tree;

pub(crate) use checked::{Checked, CheckedService, CheckedTopic, Publisher};
pub(crate) use faults::{Fault, FaultKind};
pub(crate) use file::Overrides;
pub(crate) use find::{checkout, find, names_in};
pub(crate) use paths::shown;
pub(crate) use report::{Request, check_command, graph_command, prepare, prepare_recorded};
pub(crate) use settings::{Priority, ViewSettings};
pub(crate) use suggest::hint;
