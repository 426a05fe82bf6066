//! How a system is computed, and why it cannot be.

use super::norms::{SNorm, TNorm};
use super::system::Method;
use super::terms::TermError;

/// How an engine computes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Options {
    /// How areas are integrated.
    pub integration: Integration,
    /// Inputs nearer to a term's corner than this count as the corner, and rules whose activation is not
    /// above it do not fire. 0, the default, compares exactly; fuzzylite uses 1e-6.
    pub comparison_tolerance: f64,
}

/// How the area under an accumulated conclusion is integrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Integration {
    /// In closed form where terms are made of straight lines, by adaptive quadrature (to about 1e-10) where
    /// the centroid of curves is asked for. (Bisector and maxima of curves: 1000 samples.)
    #[default]
    Exact,
    /// Over this many samples, each in the middle of its step.
    Sampled {
        /// The number of samples.
        resolution: usize,
    },
}

/// Why a system cannot be compiled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EngineError {
    /// A term whose numbers make no membership function.
    #[error("term {term} of {variable}: {source}")]
    Term {
        /// The variable.
        variable: String,
        /// The term.
        term: String,
        /// What is wrong.
        source: TermError,
    },
    /// An input with a term that is a Sugeno conclusion, or a linear conclusion with the wrong number of
    /// factors.
    #[error(
        "term {term} of {variable}: a linear function of the {inputs} inputs stands in an output and has {inputs} factors and a constant"
    )]
    Linear {
        /// The variable.
        variable: String,
        /// The term.
        term: String,
        /// How many inputs there are.
        inputs: usize,
    },
    /// A weighted average or sum over a term that is no single value.
    #[error("term {term} of {variable} is an area, but {method} weighs single values (COG takes areas)")]
    AreaWeighed {
        /// The variable.
        variable: String,
        /// The term.
        term: String,
        /// The method in force, by its keyword.
        method: &'static str,
    },
    /// An area asked of a term that is a single value.
    #[error(
        "term {term} of {variable} is a single value, but {method} takes areas (COGS weighs single values)"
    )]
    ValueIntegrated {
        /// The variable.
        variable: String,
        /// The term.
        term: String,
        /// The method in force, by its keyword.
        method: &'static str,
    },
    /// A universe that is empty, upside down or unknown.
    #[error("{variable} has no universe: give it a RANGE with the lower end first")]
    Range {
        /// The variable.
        variable: String,
    },
    /// Rules of several blocks conclude on one output with different operators.
    #[error("{variable}: its rule blocks disagree on ACT or ACCU")]
    MixedOperators {
        /// The variable.
        variable: String,
    },
    /// A rule whose weight is outside [0, 1].
    #[error("rule {rule}: a weight lies in [0, 1], not {weight}")]
    Weight {
        /// The rule's label.
        rule: String,
        /// Its weight.
        weight: f64,
    },
    /// A rule names a term that does not exist.
    #[error("there is no term {term} in variable {variable} (indices)")]
    NoSuchTerm {
        /// Index of the variable.
        variable: usize,
        /// Index of the term.
        term: usize,
    },
    /// More terms or rules than the engine counts (65 535 and 4 294 967 295).
    #[error("too many terms or rules")]
    TooManyTerms,
    /// No samples.
    #[error("a sampled defuzzification needs at least one sample")]
    NoSamples,
}

/// The operators and the method in force for one output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Operators {
    pub(crate) activation: TNorm,
    pub(crate) accumulation: SNorm,
    pub(crate) method: Method,
}
