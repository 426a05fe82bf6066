//! What the command line makes of an experiment: some of its variants, other seeds, a sweep, a parameter for
//! all.

use super::refusal::{PlanError, RUNS_MAX};
use crate::cli::ExperimentArgs;
use toml::{Table, Value};

/// Nothing is chosen by default: the experiment is as its file says.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Choice {
    /// Variants, by their names in the file; all of them without.
    pub(super) only: Vec<String>,
    /// Seeds for every variant, in the place of the file's.
    pub(super) seeds: Option<Vec<u64>>,
    /// Of every variant one for each combination of these values.
    pub(super) sweep: Table,
}

impl Choice {
    /// # Errors
    /// When seeds or sweeps are not written as such.
    pub(super) fn of(args: &ExperimentArgs) -> Result<Self, PlanError> {
        Ok(Self {
            only: args.only.clone(),
            seeds: args.seeds.as_deref().map(seeds).transpose()?,
            sweep: sweep(&args.sweep, &args.set)?,
        })
    }
}

/// What is swept, and what has one value in all variants.
pub(super) fn sweep(sweeps: &[String], sets: &[String]) -> Result<Table, PlanError> {
    let mut all = Table::new();
    let one = |text: &String| swept(text, false);
    for (key, values) in sweeps
        .iter()
        .map(|text| swept(text, true))
        .chain(sets.iter().map(one))
        .collect::<Result<Vec<_>, _>>()?
    {
        if all.insert(key.clone(), Value::Array(values)).is_some() {
            return Err(PlanError::GivenTwice { key });
        }
    }
    Ok(all)
}

/// `1..20` (both ends), `3,5,8`, and both mixed.
pub(super) fn seeds(text: &str) -> Result<Vec<u64>, PlanError> {
    let wrong = || PlanError::Seeds { given: text.to_owned() };
    let number = |text: &str| text.trim().parse::<u64>().map_err(|_| wrong());
    let mut seeds = Vec::new();
    for part in text.split(',') {
        let (from, to) = match part.split_once("..") {
            Some((from, to)) => (number(from)?, number(to.trim_start_matches('='))?),
            None => (number(part)?, number(part)?),
        };
        if to < from {
            return Err(wrong());
        }
        let runs = (to - from).saturating_add(seeds.len() as u64);
        if runs >= RUNS_MAX as u64 {
            return Err(PlanError::Size { runs: usize::try_from(runs).unwrap_or(usize::MAX) });
        }
        seeds.extend((from..=to).filter(|seed| !seeds.contains(seed)).collect::<Vec<_>>());
    }
    Ok(seeds)
}

/// `role.key=a,b,c`, and `role=one-binary,another`; or one value, commas and all. Values are TOML; what is
/// none is a text.
pub(super) fn swept(text: &str, several: bool) -> Result<(String, Vec<Value>), PlanError> {
    let wrong = || PlanError::Sweep { given: text.to_owned() };
    let (key, values) = text.split_once('=').ok_or_else(wrong)?;
    let (key, values) = (key.trim(), values.trim());
    if key.is_empty() || values.is_empty() {
        return Err(wrong());
    }
    let parsed = |values: &str| -> Option<Vec<Value>> {
        let mut table: Table = format!("values = [{values}]").parse().ok()?;
        match table.remove("values") {
            Some(Value::Array(values)) if table.is_empty() => Some(values),
            _ => None,
        }
    };
    let text = |value: &str| Value::String(value.trim().to_owned());
    let one = |value: &str| match parsed(value) {
        Some(mut values) if values.len() == 1 => values.swap_remove(0),
        _ => text(value),
    };
    let values = match parsed(values) {
        _ if !several => vec![one(values)],
        Some(values) => values,
        None => values.split(',').map(one).collect(),
    };
    Ok((key.to_owned(), values))
}
