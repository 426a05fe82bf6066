//! A fuzzy inference engine of Mamdani's and Sugeno's kind, and the language in which its systems are written (FCL,
//! IEC 61131-7).
//!
//! `fcl::read` makes a [`System`] out of a text, [`Engine::new`] compiles it, [`Engine::step`] infers.

mod engine;
pub mod fcl;
mod levels;
mod norms;
mod options;
mod outputs;
mod premises;
mod quadrature;
mod sampled;
mod system;
mod terms;
#[cfg(test)]
mod tests;
mod walk;

pub use engine::Engine;
pub use norms::{Hedge, SNorm, TNorm};
pub use options::{EngineError, Integration, Options};
pub use system::{
    Conclusion, Condition, Fallback, Input, Method, NamedTerm, Output, Rule, RuleBlock, System,
};
pub use terms::{Term, TermError};
