//! Variants against the first one: the same situations with the same seeds, run by run.

use super::plan::Plan;
use super::store::{Outcome, Record};
use crate::statistics::{Summary, mcnemar, summary};
use std::collections::{BTreeMap, BTreeSet};

/// The runs of one variant.
#[derive(Debug)]
pub(super) struct Group<'a> {
    pub(super) name: &'a str,
    /// Those that could be run at all.
    pub(super) runs: Vec<&'a Record>,
    pub(super) errors: usize,
}

impl<'a> Group<'a> {
    pub(super) fn count(&self, outcome: Outcome) -> usize {
        self.runs.iter().filter(|run| run.outcome == outcome).count()
    }

    /// The values of a figure, of all runs or of those that passed.
    pub(super) fn values(&self, figure: &str, only_passed: bool) -> Vec<f64> {
        let runs = self.runs.iter().filter(|run| !only_passed || run.outcome == Outcome::Passed);
        runs.filter_map(|run| run.figures.get(figure).copied()).filter(|value| value.is_finite()).collect()
    }

    /// The sum of one figure by that of another, over the runs that have both; `None` without any.
    pub(super) fn ratio(&self, [above, below]: &[String; 2]) -> Option<f64> {
        let both = |run: &&Record| Some([*run.figures.get(above)?, *run.figures.get(below)?]);
        let both =
            self.runs.iter().filter_map(both).filter(|pair| pair.iter().all(|value| value.is_finite()));
        let [above, below] = both.fold([0.0, 0.0], |sum, pair| [sum[0] + pair[0], sum[1] + pair[1]]);
        Some(above / below).filter(|ratio| ratio.is_finite())
    }

    /// The runs in which an axis of the situations has this value.
    pub(super) fn at(&self, axis: usize, value: &str) -> Group<'a> {
        let is_there = |run: &&&Record| run.situation.get(axis).is_some_and(|label| label == value);
        Group { name: self.name, runs: self.runs.iter().filter(is_there).copied().collect(), errors: 0 }
    }
}

/// The records by variant, in the order of the experiment file.
pub(super) fn groups<'a>(plan: &'a Plan, records: &'a [Record]) -> Vec<Group<'a>> {
    let group = |name: &'a str| {
        let (errors, runs): (Vec<_>, Vec<_>) = records
            .iter()
            .filter(|record| record.variant == name)
            .partition(|record| record.outcome == Outcome::Error);
        Group { name, runs, errors: errors.len() }
    };
    plan.variants.iter().map(|variant| group(&variant.name)).collect()
}

/// The figures that are not the same everywhere.
pub(super) fn telling_figures(records: &[Record]) -> Vec<String> {
    let names: BTreeSet<&String> = records.iter().flat_map(|record| record.figures.keys()).collect();
    let tells = |name: &&String| {
        let mut values = records.iter().filter_map(|record| record.figures.get(*name));
        let first = values.next();
        values.any(|value| Some(value) != first)
    };
    names.into_iter().filter(tells).cloned().collect()
}

/// Runs of two variants that belong together: the same situation, the same seed.
#[derive(Debug)]
pub(super) struct Pairs<'a> {
    pairs: Vec<[&'a Record; 2]>,
}

/// Who passed where the other did not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Passes {
    pub(super) only_first: usize,
    pub(super) only_other: usize,
    /// How likely it is that they part so unevenly by chance alone.
    pub(super) p: f64,
}

impl<'a> Pairs<'a> {
    /// The pairs of a variant with the first one; those of the first with itself are none.
    pub(super) fn of(first: &Group<'a>, other: &Group<'a>) -> Self {
        if first.name == other.name {
            return Self { pairs: Vec::new() };
        }
        let key = |run: &'a Record| (run.situation.as_slice(), run.seed);
        let known: BTreeMap<_, &'a Record> = first.runs.iter().map(|run| (key(run), *run)).collect();
        let pair = |run: &&'a Record| Some([*known.get(&key(run))?, *run]);
        Self { pairs: other.runs.iter().filter_map(pair).collect() }
    }

    /// How many.
    pub(super) fn count(&self) -> usize {
        self.pairs.len()
    }

    /// By how much a figure is larger than that of the first: over all pairs that have it, or those in which
    /// both passed. `None` without such pairs.
    pub(super) fn difference(&self, figure: &str, only_passed: bool) -> Option<Summary> {
        let counts =
            |pair: &&[&Record; 2]| !only_passed || pair.iter().all(|run| run.outcome == Outcome::Passed);
        let values = self.pairs.iter().filter(counts).filter_map(|[first, other]| {
            let by = other.figures.get(figure)? - first.figures.get(figure)?;
            by.is_finite().then_some(by)
        });
        summary(&values.collect::<Vec<_>>())
    }

    /// Who passed where the other did not; `None` without pairs.
    pub(super) fn passes(&self) -> Option<Passes> {
        let passed = |run: &Record| run.outcome == Outcome::Passed;
        let only = |side: usize| {
            self.pairs.iter().filter(|pair| passed(pair[side]) && !passed(pair[1 - side])).count()
        };
        let (only_first, only_other) = (only(0), only(1));
        (!self.pairs.is_empty()).then(|| Passes {
            only_first,
            only_other,
            p: mcnemar(only_first, only_other),
        })
    }
}

/// Every variant's pairs with the first, parallel to the groups.
pub(super) fn pairs<'a>(groups: &[Group<'a>]) -> Vec<Pairs<'a>> {
    let Some(first) = groups.first() else { return Vec::new() };
    groups.iter().map(|group| Pairs::of(first, group)).collect()
}

/// Of these figures those in which a variant differs from the first beyond chance, the clearest first.
pub(super) fn differing_figures(figures: &[String], pairs: &[Pairs<'_>]) -> Vec<String> {
    let clearness = |figure: &String| {
        let differences = pairs.iter().filter_map(|pairs| pairs.difference(figure, false));
        let clear = differences.filter(Summary::is_apart_from_zero);
        clear.map(|found| found.mean.abs() / found.margin.max(1e-12)).reduce(f64::max)
    };
    let mut clear: Vec<(f64, &String)> =
        figures.iter().filter_map(|figure| Some((clearness(figure)?, figure))).collect();
    clear.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    clear.into_iter().map(|(_, figure)| figure.clone()).collect()
}

/// How a variant did against what the file expects of it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Verdict {
    pub(super) variant: String,
    pub(super) figure: String,
    pub(super) bounds: [f64; 2],
    /// The mean, the ratio, or the share of passes; `None` without a run.
    pub(super) found: Option<f64>,
}

impl Verdict {
    pub(super) fn holds(&self) -> bool {
        self.found.is_some_and(|found| (self.bounds[0]..=self.bounds[1]).contains(&found))
    }
}

/// Every expectation of the file.
pub(super) fn verdicts(plan: &Plan, groups: &[Group<'_>]) -> Vec<Verdict> {
    let pairs = plan.variants.iter().zip(groups);
    pairs
        .flat_map(|(variant, group)| {
            variant.expect.iter().map(|(figure, &bounds)| Verdict {
                variant: variant.name.clone(),
                figure: figure.clone(),
                bounds,
                found: if figure == "passes" {
                    let share = group.count(Outcome::Passed) as f64 / group.runs.len() as f64;
                    Some(share).filter(|share| share.is_finite())
                } else if let Some(parts) = plan.ratios.get(figure) {
                    group.ratio(parts)
                } else {
                    summary(&group.values(figure, false)).map(|summary| summary.mean)
                },
            })
        })
        .collect()
}
