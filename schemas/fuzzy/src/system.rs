//! A fuzzy system as its author writes it: variables, terms, rules and operators; no order of evaluation yet.

use super::norms::{Hedge, SNorm, TNorm};
use super::terms::Term;

/// A fuzzy system: what one FCL function block says.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct System {
    /// Its name.
    pub name: String,
    /// Input variables, in the order in which a step takes their values.
    pub inputs: Vec<Input>,
    /// Output variables, in the order in which a step gives their values.
    pub outputs: Vec<Output>,
    /// Blocks of rules, each with operators of its own.
    pub blocks: Vec<RuleBlock>,
}

/// A term with its name.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedTerm {
    /// The name that rules use.
    pub name: String,
    /// The membership function, or the value of a Sugeno conclusion.
    pub term: Term,
}

/// An input variable.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Input {
    /// The name that rules use.
    pub name: String,
    /// The universe, low then high, if the author gave one.
    pub range: Option<(f64, f64)>,
    /// Whether values outside the universe count as its nearest end.
    pub lock_range: bool,
    /// The linguistic terms.
    pub terms: Vec<NamedTerm>,
}

/// An output variable.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Output {
    /// The name that rules use.
    pub name: String,
    /// The universe, low then high. Without it: from the lowest to the highest corner of the terms.
    pub range: Option<(f64, f64)>,
    /// Whether the value is kept inside the universe.
    pub lock_range: bool,
    /// The linguistic terms.
    pub terms: Vec<NamedTerm>,
    /// How a fuzzy conclusion becomes a number.
    pub method: Method,
    /// How conclusions of several rules are put together; without it the rule block's, and then the maximum.
    pub accumulation: Option<SNorm>,
    /// The value while no rule speaks.
    pub default: Fallback,
}

/// What an output says while no rule speaks.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Fallback {
    /// "Not a number": nothing is known. The default of an output that names none.
    #[default]
    Nothing,
    /// This value.
    Value(f64),
    /// The last value that rules gave, and before the first one NaN (FCL `NC`, "no change").
    Previous,
    /// The last value that rules gave, and before the first one this value.
    PreviousOr(f64),
}

/// How a fuzzy conclusion becomes a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Method {
    /// Centre of gravity of the accumulated conclusion, FCL `COG`.
    #[default]
    Centroid,
    /// Average of the terms' values, weighted by their degrees, FCL `COGS`; also for Sugeno's systems.
    WeightedAverage,
    /// Sum of the terms' values times their degrees, `COGSS`.
    WeightedSum,
    /// The place that halves the area, FCL `COA`.
    Bisector,
    /// Mean of all places of the highest degree, FCL `MM`.
    MeanOfMaxima,
    /// The lowest place of the highest degree, FCL `LM`.
    Leftmost,
    /// The highest place of the highest degree, FCL `RM`.
    Rightmost,
}

impl Method {
    /// Every method with its FCL keyword.
    pub const KEYWORDS: [(&'static str, Self); 7] = [
        ("COG", Self::Centroid),
        ("COGS", Self::WeightedAverage),
        ("COGSS", Self::WeightedSum),
        ("COA", Self::Bisector),
        ("MM", Self::MeanOfMaxima),
        ("LM", Self::Leftmost),
        ("RM", Self::Rightmost),
    ];
}

/// Rules that share their operators.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RuleBlock {
    /// Its name; may be empty.
    pub name: String,
    /// AND; without it the dual of OR, and then the minimum.
    pub and: Option<TNorm>,
    /// OR; without it the dual of AND.
    pub or: Option<SNorm>,
    /// How a rule's degree limits its conclusions; without it the minimum.
    pub activation: Option<TNorm>,
    /// How conclusions of several rules are put together, where an output does not say it.
    pub accumulation: Option<SNorm>,
    /// The rules, in their order.
    pub rules: Vec<Rule>,
}

/// One rule.
#[derive(Debug, Clone, PartialEq)]
pub struct Rule {
    /// Its number or name.
    pub label: String,
    /// Its condition.
    pub condition: Condition,
    /// What it concludes: output variable and term, by their indices.
    pub conclusions: Vec<Conclusion>,
    /// What its degree is multiplied by, in [0, 1].
    pub weight: f64,
}

/// One conclusion of a rule.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Conclusion {
    /// Index into the system's outputs.
    pub output: usize,
    /// Index into that output's terms.
    pub term: usize,
}

/// A rule's condition.
#[derive(Debug, Clone, PartialEq)]
pub enum Condition {
    /// `input IS hedges term`.
    Is {
        /// Index into the system's inputs.
        input: usize,
        /// The hedges as they are read: the one nearest to the term is applied first.
        hedges: Vec<Hedge>,
        /// Index into that input's terms.
        term: usize,
    },
    /// Both.
    And(Box<Condition>, Box<Condition>),
    /// Either.
    Or(Box<Condition>, Box<Condition>),
    /// The opposite.
    Not(Box<Condition>),
}

impl RuleBlock {
    /// The AND in force.
    pub fn and(&self) -> TNorm {
        let of_or = |or| TNorm::KEYWORDS.iter().map(|entry| entry.1).find(|and| and.dual() == or);
        self.and.or_else(|| self.or.and_then(of_or)).unwrap_or(TNorm::Minimum)
    }

    /// The OR in force.
    pub fn or(&self) -> SNorm {
        self.or.unwrap_or_else(|| self.and().dual())
    }

    /// The activation in force.
    pub fn activation(&self) -> TNorm {
        self.activation.unwrap_or(TNorm::Minimum)
    }
}

impl Output {
    /// The universe: as given, or from the lowest to the highest corner of the terms.
    pub fn universe(&self) -> Option<(f64, f64)> {
        let joints = self.terms.iter().flat_map(|named| match &named.term {
            Term::Singleton(value) => vec![*value],
            term => term.joints(),
        });
        let (low, high) =
            joints.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        self.range.or((low < high).then_some((low, high)))
    }
}
