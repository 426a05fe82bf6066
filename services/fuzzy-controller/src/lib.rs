//! x

pub mod fuzzy;
