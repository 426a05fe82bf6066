//! What the runs have shown, as tables.

use super::plan::Plan;
use super::statistics::{summary, wilson};
use super::store::{Outcome, Record};
use comfy_table::{Cell, CellAlignment, Table, presets};
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// The runs of one variant.
#[derive(Debug)]
pub(super) struct Group<'a> {
    pub(super) name: &'a str,
    /// Those that could be run at all.
    pub(super) runs: Vec<&'a Record>,
    pub(super) errors: usize,
}

impl Group<'_> {
    fn count(&self, outcome: Outcome) -> usize {
        self.runs.iter().filter(|run| run.outcome == outcome).count()
    }

    /// The values of a figure, of all runs or of those that passed.
    pub(super) fn values(&self, figure: &str, only_passed: bool) -> Vec<f64> {
        let runs = self.runs.iter().filter(|run| !only_passed || run.outcome == Outcome::Passed);
        runs.filter_map(|run| run.figures.get(figure).copied()).filter(|value| value.is_finite()).collect()
    }
}

impl Group<'_> {
    /// The sum of one figure by that of another, over the runs that have both; `None` without any.
    fn ratio(&self, [above, below]: &[String; 2]) -> Option<f64> {
        let both = |run: &&Record| Some([*run.figures.get(above)?, *run.figures.get(below)?]);
        let both =
            self.runs.iter().filter_map(both).filter(|pair| pair.iter().all(|value| value.is_finite()));
        let [above, below] = both.fold([0.0, 0.0], |sum, pair| [sum[0] + pair[0], sum[1] + pair[1]]);
        Some(above / below).filter(|ratio| ratio.is_finite())
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

/// All tables, for a terminal or as Markdown.
pub(super) fn tables(plan: &Plan, records: &[Record], as_markdown: bool) -> String {
    let groups = groups(plan, records);
    let figures = telling_figures(records);
    let verdicts = verdicts(plan, &groups);
    let mut text = String::new();
    let mut section = |title: &str, table: Table| {
        let hashes = if as_markdown { "## " } else { "" };
        let _ = writeln!(text, "{hashes}{title}\n\n{}\n", table.trim_fmt());
    };
    section("Passed", passes(&groups, as_markdown));
    if groups.iter().any(|group| group.count(Outcome::Passed) > 0) {
        section("Figures of the runs that passed", means(&groups, &figures, true, as_markdown));
    }
    section("Figures of all runs", means(&groups, &figures, false, as_markdown));
    if !plan.ratios.is_empty() {
        section("Ratios of sums over all runs", ratios(plan, &groups, as_markdown));
    }
    if !verdicts.is_empty() {
        section("Expected", expectations(&verdicts, as_markdown));
    }
    if groups.iter().any(|group| group.count(Outcome::Passed) < group.runs.len() || group.errors > 0) {
        section("How the others ended", endings(plan, records, as_markdown));
    }
    text
}

fn passes(groups: &[Group<'_>], as_markdown: bool) -> Table {
    let header = ["variant", "runs", "passed", "share", "95 % interval", "failed", "unfinished", "errors"];
    let mut table = new_table(&header, 1, as_markdown);
    for group in groups {
        let (runs, passed) = (group.runs.len(), group.count(Outcome::Passed));
        let interval = wilson(passed, runs);
        table.add_row([
            group.name.to_owned(),
            runs.to_string(),
            passed.to_string(),
            if runs > 0 { percent(passed as f64 / runs as f64) } else { "-".to_owned() },
            interval.map_or("-".to_owned(), |(low, high)| format!("{} to {}", percent(low), percent(high))),
            group.count(Outcome::Failed).to_string(),
            group.count(Outcome::Unfinished).to_string(),
            group.errors.to_string(),
        ]);
    }
    table
}

fn means(groups: &[Group<'_>], figures: &[String], only_passed: bool, as_markdown: bool) -> Table {
    let header = ["figure", "variant", "n", "mean", "std. dev.", "95 % interval"];
    let mut table = new_table(&header, 2, as_markdown);
    for figure in figures {
        for group in groups {
            let Some(sample) = summary(&group.values(figure, only_passed)) else { continue };
            let interval = if sample.margin.is_nan() {
                "-".to_owned()
            } else {
                format!("{} to {}", number(sample.mean - sample.margin), number(sample.mean + sample.margin))
            };
            table.add_row([
                figure.clone(),
                group.name.to_owned(),
                sample.count.to_string(),
                number(sample.mean),
                number(sample.deviation),
                interval,
            ]);
        }
    }
    table
}

fn ratios(plan: &Plan, groups: &[Group<'_>], as_markdown: bool) -> Table {
    let mut table = new_table(&["ratio", "of", "variant", "value"], 3, as_markdown);
    for (name, parts) in &plan.ratios {
        for group in groups {
            let value = group.ratio(parts).map_or("-".to_owned(), number);
            table.add_row([name.clone(), parts.join(" / "), group.name.to_owned(), value]);
        }
    }
    table
}

fn expectations(verdicts: &[Verdict], as_markdown: bool) -> Table {
    let mut table = new_table(&["variant", "figure", "expected", "found", ""], 2, as_markdown);
    for verdict in verdicts {
        let [low, high] = verdict.bounds;
        table.add_row([
            verdict.variant.clone(),
            verdict.figure.clone(),
            format!("{} to {}", number(low), number(high)),
            verdict.found.map_or("-".to_owned(), number),
            match verdict.found {
                None => "not run yet",
                Some(_) if verdict.holds() => "holds",
                Some(_) => "DOES NOT HOLD",
            }
            .to_owned(),
        ]);
    }
    table
}

fn endings(plan: &Plan, records: &[Record], as_markdown: bool) -> Table {
    let mut table = new_table(&["variant", "how", "runs", "for instance"], 2, as_markdown);
    for variant in &plan.variants {
        let others = records
            .iter()
            .filter(|record| record.variant == variant.name && record.outcome != Outcome::Passed);
        let mut seen: Vec<(String, usize, &Record)> = Vec::new();
        for record in others {
            // Remarks that differ in their numbers alone say the same.
            let wording: String = record.remark.chars().filter(|letter| !letter.is_ascii_digit()).collect();
            let wording = format!("{}{wording}", record.outcome.word());
            match seen.iter_mut().find(|(known, ..)| *known == wording) {
                Some((_, count, _)) => *count += 1,
                None => seen.push((wording, 1, record)),
            }
        }
        for (_, count, record) in seen {
            let situation = record.situation.iter().cloned().chain([format!("seed {}", record.seed)]);
            let situation: Vec<String> = situation.collect();
            table.add_row([
                variant.name.clone(),
                format!("{}: {}", record.outcome.word(), record.remark),
                count.to_string(),
                situation.join(", "),
            ]);
        }
    }
    table
}

/// A table whose columns from `numbers_from` on hold numbers.
fn new_table(header: &[&str], numbers_from: usize, as_markdown: bool) -> Table {
    let mut table = Table::new();
    table.load_style(if as_markdown { presets::ASCII_MARKDOWN } else { presets::NOTHING });
    table.set_header(header.iter().map(Cell::new));
    for column in table.column_iter_mut().skip(numbers_from) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// Four significant digits or the whole number.
pub(super) fn number(value: f64) -> String {
    if !value.is_finite() {
        return if value.is_nan() { "-".to_owned() } else { value.to_string() };
    }
    if value.fract() == 0.0 && value.abs() < 1e9 {
        return format!("{value:.0}");
    }
    let whole_digits = value.abs().log10().floor().max(-6.0) as i32 + 1;
    let decimals = usize::try_from((4 - whole_digits).max(0)).unwrap_or(0).min(6);
    format!("{value:.decimals$}")
}
