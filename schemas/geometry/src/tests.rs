//! Cases, one line each, and properties against brute force.

mod cast;
mod grid;
mod map_file;
mod polygon;
mod world;
