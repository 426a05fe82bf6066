//! Cases, one line each.

mod pieces;
