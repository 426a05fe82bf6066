//! The harness for process graphs.
