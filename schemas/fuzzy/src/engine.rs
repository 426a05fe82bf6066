//! A compiled fuzzy system: values in, values out, without allocation, locks or virtual calls.

use super::options::{EngineError, Integration, Options};
use super::outputs::OutputPlan;
use super::premises::Premises;
use super::system::{Conclusion, System};

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

    /// One inference: a value for each input in the system's order, out of it a value for each output.
    /// Infinite inputs are far away; with a missing input or a NaN no rule fires, and every output takes its
    /// default.
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

    /// The activation of every rule in the last step, weight included, in the order of the rules, block after
    /// block.
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

    /// How an output is defuzzified: `levels` and `walk` are exact, `quadrature` is exact to about 1e-10,
    /// `sampled`, `weighted`.
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
