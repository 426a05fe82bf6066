//! A fuzzy inference engine of Mamdani's and Sugeno's kind, and the language in which its systems are written
//! (FCL, IEC 61131-7).
//!
//! [`fcl::read`] makes a [`System`] out of a text, [`Engine::new`] compiles it, [`Engine::step`] infers,
//! without allocation.
//!
//! ```
//! use fuzzy::{Engine, Options, fcl};
//!
//! let system = fcl::read(
//!     "FUNCTION_BLOCK brake
//!     VAR_INPUT ahead_m : REAL; END_VAR
//!     VAR_OUTPUT speed_mps : REAL; END_VAR
//!     FUZZIFY ahead_m
//!         TERM near := (0.2, 1) (1.0, 0);
//!         TERM far := (0.2, 0) (1.0, 1);
//!     END_FUZZIFY
//!     DEFUZZIFY speed_mps
//!         TERM stop := 0;
//!         TERM cruise := 0.4;
//!         METHOD : COGS;
//!     END_DEFUZZIFY
//!     RULEBLOCK rules
//!         RULE 1 : IF ahead_m IS near THEN speed_mps IS stop;
//!         RULE 2 : IF ahead_m IS far THEN speed_mps IS cruise;
//!     END_RULEBLOCK
//!     END_FUNCTION_BLOCK",
//! )?;
//! let mut engine = Engine::new(&system, Options::default())?;
//! assert!((engine.step(&[0.6])[0] - 0.2).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

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
