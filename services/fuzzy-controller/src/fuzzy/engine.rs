//! A compiled fuzzy system: values in, values out, without allocation, locks or virtual calls.

use super::norms::{SNorm, TNorm};
use super::outputs::OutputPlan;
use super::premises::Premises;
use super::system::{Conclusion, Method, System};
use super::terms::TermError;

/// How an engine computes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Options {
    /// How areas are integrated.
    pub integration: Integration,
    /// Inputs nearer to a term's corner than this count as the corner, and rules whose activation is not above it do not
    /// fire. 0, the default, compares exactly; fuzzylite uses 1e-6.
    pub comparison_tolerance: f64,
}

/// How the area under an accumulated conclusion is integrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Integration {
    /// In closed form where terms are made of straight lines, by adaptive quadrature (to about 1e-10) where the centroid of
    /// curves is asked for. (Bisector and maxima of curves: 1000 samples.)
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
    /// An input with a term that is a Sugeno conclusion, or a linear conclusion with the wrong number of factors.
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

/// A compiled fuzzy system with the state of its last step.
#[derive(Debug, Clone)]
pub struct Engine {
    premises: Premises,
    outputs: Vec<OutputPlan>,
    values: Vec<f64>,
    labels: Vec<String>,
    tolerance: f64,
}

impl Engine {
    /// Checks and compiles a system.
    pub fn new(system: &System, options: Options) -> Result<Self, EngineError> {
        if options.integration == (Integration::Sampled { resolution: 0 }) {
            return Err(EngineError::NoSamples);
        }
        for input in &system.inputs {
            for named in &input.terms {
                let (variable, term) = (input.name.clone(), named.name.clone());
                if matches!(named.term, super::terms::Term::Linear(_)) {
                    return Err(EngineError::Linear { variable, term, inputs: system.inputs.len() });
                }
                named.term.check().map_err(|source| EngineError::Term { variable, term, source })?;
            }
            if input.range.is_some_and(|(low, high)| low >= high || low.is_nan() || high.is_nan()) {
                return Err(EngineError::Range { variable: input.name.clone() });
            }
        }
        for (output, conclusion) in system.blocks.iter().flat_map(|block| &block.rules).flat_map(|rule| {
            rule.conclusions.iter().map(|conclusion| (system.outputs.get(conclusion.output), conclusion))
        }) {
            let Conclusion { output: variable, term } = *conclusion;
            output
                .and_then(|output| output.terms.get(term))
                .ok_or(EngineError::NoSuchTerm { variable, term })?;
        }
        let outputs: Result<Vec<_>, _> = (0..system.outputs.len())
            .map(|index| OutputPlan::new(system, index, options.integration))
            .collect();
        let rules = system.blocks.iter().flat_map(|block| &block.rules);
        Ok(Self {
            premises: Premises::new(system, options.comparison_tolerance)?,
            outputs: outputs?,
            values: vec![f64::NAN; system.outputs.len()],
            labels: rules.map(|rule| rule.label.clone()).collect(),
            tolerance: options.comparison_tolerance,
        })
    }

    /// One inference: a value for each input in the system's order, out of it a value for each output. Infinite inputs are
    /// far away; with a missing input or a NaN no rule fires, and every output takes its default.
    pub fn step(&mut self, inputs: &[f64]) -> &[f64] {
        self.premises.evaluate(inputs, self.tolerance);
        for (value, output) in self.values.iter_mut().zip(&mut self.outputs) {
            *value = output.step(inputs, self.premises.activations(), self.tolerance);
        }
        &self.values
    }

    /// The outputs of the last step; NaN before the first.
    pub fn outputs(&self) -> &[f64] {
        &self.values
    }

    /// The activation of every rule in the last step, weight included, in the order of the rules, block after block.
    pub fn activations(&self) -> &[f64] {
        self.premises.activations()
    }

    /// The labels of the rules, in the order of `activations`.
    pub fn rule_labels(&self) -> &[String] {
        &self.labels
    }

    /// The degree to which an input belonged to a term in the last step, by their indices.
    pub fn membership(&self, input: usize, term: usize) -> Option<f64> {
        self.premises.membership(input, term)
    }

    /// How an output is defuzzified: `levels` and `walk` are exact, `quadrature` is exact to about 1e-10, `sampled`, `weighted`.
    pub fn kernel(&self, output: usize) -> Option<&'static str> {
        self.outputs.get(output).map(OutputPlan::kernel)
    }

    /// Forgets what outputs hold as "no change".
    pub fn reset(&mut self) {
        self.values.fill(f64::NAN);
        for output in &mut self.outputs {
            output.reset();
        }
    }
}

/// The operators and the method in force for one output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Operators {
    pub(crate) activation: TNorm,
    pub(crate) accumulation: SNorm,
    pub(crate) method: Method,
}
