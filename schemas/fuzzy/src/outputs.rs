//! One output of a compiled system: which rules speak for which term, and how their degrees become a number.

use super::levels::Levels;
use super::norms::{SNorm, TNorm, keyword_of, larger};
use super::options::{EngineError, Integration, Operators};
use super::quadrature::Quadrature;
use super::sampled::Sampled;
use super::system::{Fallback, Method, Output, System};
use super::terms::{Piece, Term};
use super::walk::Walk;
use std::ops::Range;

const SAMPLES_OF_CURVES: usize = 1000;

#[derive(Debug, Clone)]
pub(crate) struct OutputPlan {
    /// Rules by entry; an entry is a term, or a single conclusion where repeated conclusions add up.
    rules: Vec<u32>,
    spans: Vec<Range<u32>>,
    degrees: Vec<f64>,
    /// How the degrees of one entry's rules are joined.
    join: SNorm,
    method: Method,
    kernel: Kernel,
    lock: Option<(f64, f64)>,
    fallback: Fallback,
    last: Option<f64>,
}

#[derive(Debug, Clone)]
enum Kernel {
    Levels(Box<Levels>),
    Walk(Box<Walk>),
    Quadrature(Box<Quadrature>),
    Sampled(Box<Sampled>),
    /// Each entry's value; and the factors of those that are linear in the inputs.
    Weighted(Vec<f64>, Vec<(usize, Vec<f64>)>),
}

impl OutputPlan {
    pub(crate) fn new(system: &System, index: usize, integration: Integration) -> Result<Self, EngineError> {
        let output = &system.outputs[index];
        let operators = operators(system, index)?;
        let weighted = matches!(operators.method, Method::WeightedAverage | Method::WeightedSum);
        let mut conclusions: Vec<(usize, u32)> = Vec::new();
        for (rule, number) in system.blocks.iter().flat_map(|block| &block.rules).zip(0_u32..) {
            for conclusion in rule.conclusions.iter().filter(|conclusion| conclusion.output == index) {
                conclusions.push((conclusion.term, number));
            }
        }
        let by_term = weighted || operators.accumulation == SNorm::Maximum;
        if by_term {
            conclusions.sort_unstable();
        }
        let (mut terms, mut rules, mut spans): (Vec<usize>, Vec<u32>, Vec<Range<u32>>) = Default::default();
        for (place, (term, rule)) in (0_u32..).zip(conclusions) {
            rules.push(rule);
            match spans.last_mut() {
                Some(span) if by_term && terms.last() == Some(&term) => span.end = place + 1,
                _ => {
                    terms.push(term);
                    spans.push(place..place + 1);
                }
            }
        }
        let kernel = kernel(system, output, &terms, operators, integration)?;
        Ok(Self {
            degrees: vec![0.0; terms.len()],
            rules,
            spans,
            join: if weighted { operators.accumulation } else { SNorm::Maximum },
            method: operators.method,
            kernel,
            lock: output.range.filter(|_| output.lock_range),
            fallback: output.default,
            last: None,
        })
    }

    pub(crate) fn kernel(&self) -> &'static str {
        match self.kernel {
            Kernel::Levels(_) => "levels",
            Kernel::Walk(_) => "walk",
            Kernel::Quadrature(_) => "quadrature",
            Kernel::Sampled(_) => "sampled",
            Kernel::Weighted(..) => "weighted",
        }
    }

    pub(crate) fn reset(&mut self) {
        self.last = None;
    }

    pub(crate) fn step(&mut self, inputs: &[f64], activations: &[f64], tolerance: f64) -> f64 {
        let value = if self.gather(activations, tolerance) { self.defuzzify(inputs) } else { None };
        let value = value.map(|value| match self.lock {
            Some((low, high)) => value.clamp(low, high),
            None => value,
        });
        self.last = value.or(self.last);
        value.unwrap_or(match self.fallback {
            Fallback::Nothing => f64::NAN,
            Fallback::Value(value) => value,
            Fallback::Previous => self.last.unwrap_or(f64::NAN),
            Fallback::PreviousOr(value) => self.last.unwrap_or(value),
        })
    }

    /// Joins the activations of each entry's rules. False if none speaks.
    #[inline]
    fn gather(&mut self, activations: &[f64], tolerance: f64) -> bool {
        let mut highest = 0.0;
        for (degree, span) in self.degrees.iter_mut().zip(&self.spans) {
            let rules = &self.rules[span.start as usize..span.end as usize];
            let speaking = rules.iter().map(|rule| activations[*rule as usize]);
            *degree = if tolerance > 0.0 {
                speaking.filter(|degree| *degree > tolerance).fold(0.0, |a, b| self.join.accumulate(a, b))
            } else if self.join == SNorm::Maximum {
                speaking.fold(0.0, larger)
            } else {
                speaking.fold(0.0, |a, b| self.join.accumulate(a, b))
            };
            highest = larger(highest, *degree);
        }
        highest > 0.0
    }

    #[inline]
    fn defuzzify(&mut self, inputs: &[f64]) -> Option<f64> {
        match &mut self.kernel {
            Kernel::Levels(levels) => levels.centroid(&self.degrees),
            Kernel::Walk(walk) => walk.defuzzify(&self.degrees, self.method),
            Kernel::Quadrature(quadrature) => quadrature.centroid(&self.degrees),
            Kernel::Sampled(sampled) => sampled.defuzzify(&self.degrees, self.method),
            Kernel::Weighted(values, linear) => {
                for (entry, factors) in linear.iter() {
                    if let Some((constant, factors)) = factors.split_last() {
                        values[*entry] =
                            constant + factors.iter().zip(inputs).map(|(a, x)| a * x).sum::<f64>();
                    }
                }
                let (mut sum, mut weights) = (0.0, 0.0);
                for (value, degree) in values.iter().zip(&self.degrees) {
                    sum += value * degree;
                    weights += degree;
                }
                if self.method == Method::WeightedSum {
                    Some(sum)
                } else {
                    (weights > 0.0).then(|| sum / weights)
                }
            }
        }
    }
}

/// The operators that hold for an output: its own accumulation, or else the one its rule blocks agree on.
fn operators(system: &System, index: usize) -> Result<Operators, EngineError> {
    let output = &system.outputs[index];
    let concludes =
        |rule: &super::system::Rule| rule.conclusions.iter().any(|conclusion| conclusion.output == index);
    let mut agreed: Option<(TNorm, SNorm)> = None;
    for block in system.blocks.iter().filter(|block| block.rules.iter().any(concludes)) {
        let accumulation = output.accumulation.or(block.accumulation).unwrap_or(SNorm::Maximum);
        let these = (block.activation(), accumulation);
        if agreed.is_some_and(|others| others != these) {
            return Err(EngineError::MixedOperators { variable: output.name.clone() });
        }
        agreed = Some(these);
    }
    let (activation, accumulation) = agreed.unwrap_or((TNorm::Minimum, SNorm::Maximum));
    Ok(Operators { activation, accumulation, method: output.method })
}

fn kernel(
    system: &System,
    output: &Output,
    terms: &[usize],
    operators: Operators,
    integration: Integration,
) -> Result<Kernel, EngineError> {
    let weighted = matches!(operators.method, Method::WeightedAverage | Method::WeightedSum);
    for named in &output.terms {
        let (variable, term) = (output.name.clone(), named.name.clone());
        let method = keyword_of(&Method::KEYWORDS, &operators.method);
        named.term.check().map_err(|source| EngineError::Term {
            variable: variable.clone(),
            term: term.clone(),
            source,
        })?;
        match &named.term {
            Term::Linear(factors) if factors.len() != system.inputs.len() + 1 => {
                return Err(EngineError::Linear { variable, term, inputs: system.inputs.len() });
            }
            Term::Singleton(_) | Term::Linear(_) if !weighted => {
                return Err(EngineError::ValueIntegrated { variable, term, method });
            }
            Term::Singleton(_) | Term::Linear(_) => {}
            _ if weighted => return Err(EngineError::AreaWeighed { variable, term, method }),
            _ => {}
        }
    }
    let chosen: Vec<Term> = terms.iter().map(|term| output.terms[*term].term.clone()).collect();
    if weighted {
        let values = chosen.iter().map(|term| if let Term::Singleton(value) = term { *value } else { 0.0 });
        let linear = chosen.iter().enumerate().filter_map(|(entry, term)| match term {
            Term::Linear(factors) => Some((entry, factors.clone())),
            _ => None,
        });
        return Ok(Kernel::Weighted(values.collect(), linear.collect()));
    }
    let universe = output.universe().filter(|(low, high)| low < high && low.is_finite() && high.is_finite());
    let universe = universe.ok_or_else(|| EngineError::Range { variable: output.name.clone() })?;
    let Operators { activation, accumulation, method } = operators;
    let sampled = |resolution| {
        Kernel::Sampled(Box::new(Sampled::new(&chosen, universe, resolution, activation, accumulation)))
    };
    if let Integration::Sampled { resolution } = integration {
        return Ok(sampled(resolution));
    }
    let pieces: Option<Vec<Vec<Piece>>> =
        chosen.iter().map(|term| term.pieces(universe.0, universe.1)).collect();
    if let Some(pieces) = pieces {
        let overlaps = accumulation == SNorm::Maximum;
        let closed = method == Method::Centroid
            && activation == TNorm::Minimum
            && (overlaps || accumulation == SNorm::NormalisedSum);
        let levels = if closed { Levels::new(&pieces, universe.0, universe.1, overlaps) } else { None };
        if let Some(levels) = levels {
            return Ok(Kernel::Levels(Box::new(levels)));
        }
        if let Some(walk) = Walk::new(&pieces, universe, activation, accumulation) {
            return Ok(Kernel::Walk(Box::new(walk)));
        }
    }
    if method == Method::Centroid {
        return Ok(Kernel::Quadrature(Box::new(Quadrature::new(chosen, universe, activation, accumulation))));
    }
    Ok(sampled(SAMPLES_OF_CURVES))
}
