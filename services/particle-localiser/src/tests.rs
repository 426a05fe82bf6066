//! Cases, one line each.

mod echoes;
mod pieces;
