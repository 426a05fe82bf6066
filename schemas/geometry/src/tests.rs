//! Cases, one line each, and properties against brute force.

mod cast;
mod world;
