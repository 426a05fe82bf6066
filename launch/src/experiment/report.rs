//! What the runs have shown, as tables.

use super::compare::{Group, Pairs, Verdict, differing_figures, groups, pairs, telling_figures, verdicts};
use super::plan::Plan;
use super::store::{Outcome, Record};
use crate::numbers::{number, signed};
use crate::statistics::{Summary, summary, wilson};
use comfy_table::{Cell, CellAlignment, Table, presets};
use std::fmt::Write as _;

/// Figures that a terminal shows unasked.
const FIGURES_SHOWN: usize = 5;
/// Other ends that a terminal shows unasked.
const ENDINGS_SHOWN: usize = 8;

/// How much is wanted, and where.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Show {
    /// Everything, as Markdown.
    File,
    /// On a terminal: everything, or what tells most; and by this axis of the situations.
    Terminal {
        /// Everything.
        all: bool,
        /// An axis.
        by: Option<usize>,
    },
}

impl Show {
    fn is_markdown(self) -> bool {
        self == Self::File
    }

    fn is_short(self) -> bool {
        matches!(self, Self::Terminal { all: false, .. })
    }
}

/// All tables of an experiment, from the same runs.
struct Report<'a> {
    plan: &'a Plan,
    records: &'a [Record],
    groups: Vec<Group<'a>>,
    pairs: Vec<Pairs<'a>>,
    show: Show,
    text: String,
}

/// The tables that are wanted.
pub(super) fn tables(plan: &Plan, records: &[Record], show: Show) -> String {
    let groups = groups(plan, records);
    let pairs = pairs(&groups);
    Report { plan, records, groups, pairs, show, text: String::new() }.write()
}

impl Report<'_> {
    fn write(mut self) -> String {
        let telling = telling_figures(self.records);
        let figures = self.figures_shown(&telling);
        let verdicts = verdicts(self.plan, &self.groups);
        let table = self.passes();
        self.section("Passed", table, "");
        self.write_figures(&figures, telling.len());
        // Where nothing differs, an axis that was asked for still has something to tell.
        let by_axis =
            if figures.is_empty() { &telling[..telling.len().min(FIGURES_SHOWN)] } else { &figures };
        self.write_axes(by_axis);
        if !self.plan.ratios.is_empty() {
            let table = self.ratios();
            self.section("Ratios of sums over all runs", table, "");
        }
        if !verdicts.is_empty() {
            let table = self.expectations(&verdicts);
            self.section("Expected", table, "");
        }
        let is_other =
            |group: &Group<'_>| group.count(Outcome::Passed) < group.runs.len() || group.errors > 0;
        if self.groups.iter().any(is_other) {
            let (table, left_out) = self.endings();
            let more = match left_out {
                0 => String::new(),
                count => format!("{count} more in table.md"),
            };
            self.section("How the others ended", table, &more);
        }
        self.text
    }

    /// Of the figures that vary those that are shown.
    fn figures_shown(&self, telling: &[String]) -> Vec<String> {
        match self.show.is_short() {
            false => telling.to_vec(),
            // Without anything to compare with, what there is.
            true if !self.has_pairs() => telling.iter().take(2 * FIGURES_SHOWN).cloned().collect(),
            true => differing_figures(telling, &self.pairs).into_iter().take(FIGURES_SHOWN).collect(),
        }
    }

    /// A heading, a table, and what has to be said about it.
    fn section(&mut self, title: &str, table: Table, words: &str) {
        let hashes = if self.show.is_markdown() { "## " } else { "" };
        let _ = writeln!(self.text, "{hashes}{title}\n\n{}\n", table.trim_fmt());
        if !words.is_empty() {
            let _ = writeln!(self.text, "{words}\n");
        }
    }

    fn has_pairs(&self) -> bool {
        self.pairs.iter().any(|pairs| pairs.count() > 0)
    }

    fn first(&self) -> &str {
        self.groups.first().map_or("", |group| group.name)
    }

    fn write_figures(&mut self, figures: &[String], of: usize) {
        if figures.is_empty() {
            if self.show.is_short() && self.has_pairs() {
                let first = self.first();
                let words = format!(
                    "No figure differs from `{first}` beyond chance (95 %); the {of} that vary are in table.md, and with --all here."
                );
                let _ = writeln!(self.text, "{words}\n");
            }
            return;
        }
        let some_passed = self.groups.iter().any(|group| group.count(Outcome::Passed) > 0);
        let words = self.meaning();
        if some_passed && !self.show.is_short() {
            let table = self.figures(figures, true);
            self.section("Figures of the runs that passed", table, "");
        }
        let table = self.figures(figures, false);
        let title = match self.show.is_short() && figures.len() < of {
            true if !self.has_pairs() => format!("Figures of all runs: {} of {of}", figures.len()),
            true => format!("Figures of all runs, those that differ most clearly: {} of {of}", figures.len()),
            false => "Figures of all runs".to_owned(),
        };
        self.section(&title, table, &words);
    }

    /// What the intervals and the differences are.
    fn meaning(&self) -> String {
        let t = "95 % intervals of the mean by Student's t (n - 1 degrees of freedom)";
        if !self.has_pairs() {
            return format!("{t}.");
        }
        format!(
            "{t}. Difference: the variant less `{}`, run by run in the same situation with the same seed; `*` where its interval leaves out 0, \
             as one in twenty does by chance.",
            self.first()
        )
    }

    fn passes(&self) -> Table {
        // On a terminal without the ways in which no run has ended.
        let others =
            [("failed", Outcome::Failed), ("unfinished", Outcome::Unfinished), ("errors", Outcome::Error)];
        let count = |group: &Group<'_>, outcome| match outcome {
            Outcome::Error => group.errors,
            outcome => group.count(outcome),
        };
        let is_shown = |&(_, outcome): &(&str, Outcome)| {
            !self.show.is_short() || self.groups.iter().any(|group| count(group, outcome) > 0)
        };
        let others: Vec<(&str, Outcome)> = others.into_iter().filter(is_shown).collect();
        let mut header = vec!["variant", "runs", "passed", "share", "95 % interval"];
        header.extend(others.iter().map(|(name, _)| *name));
        if self.has_pairs() {
            header.extend(["pairs", "only this", "only the first", "p (McNemar)"]);
        }
        let mut table = self.table(&header, 1);
        for (group, pairs) in self.groups.iter().zip(&self.pairs) {
            let (runs, passed) = (group.runs.len(), group.count(Outcome::Passed));
            let interval = wilson(passed, runs);
            let mut row = vec![
                group.name.to_owned(),
                runs.to_string(),
                passed.to_string(),
                if runs > 0 { percent(passed as f64 / runs as f64) } else { "-".to_owned() },
                interval.map_or("-".to_owned(), |(low, high)| interval_of([percent(low), percent(high)])),
            ];
            row.extend(others.iter().map(|&(_, outcome)| count(group, outcome).to_string()));
            if self.has_pairs() {
                row.extend(match pairs.passes() {
                    None => ["-"; 4].map(str::to_owned),
                    Some(found) => [
                        pairs.count().to_string(),
                        found.only_other.to_string(),
                        found.only_first.to_string(),
                        if found.p < 0.001 { "< 0.001".to_owned() } else { format!("{:.3}", found.p) },
                    ],
                });
            }
            table.add_row(row);
        }
        table
    }

    fn figures(&self, figures: &[String], only_passed: bool) -> Table {
        let mut header = vec!["figure", "variant", "n", "mean"];
        if !self.show.is_short() {
            header.push("std. dev.");
        }
        header.push("95 % interval");
        if self.has_pairs() {
            header.extend(["pairs", "difference", "95 % interval"]);
        }
        let mut table = self.table(&header, 2);
        for figure in figures {
            for (group, pairs) in self.groups.iter().zip(&self.pairs) {
                let Some(sample) = summary(&group.values(figure, only_passed)) else { continue };
                let mut row = vec![
                    figure.clone(),
                    group.name.to_owned(),
                    sample.count.to_string(),
                    number(sample.mean),
                ];
                if !self.show.is_short() {
                    row.push(number(sample.deviation));
                }
                row.push(interval(&sample, number));
                if self.has_pairs() {
                    row.extend(match pairs.difference(figure, only_passed) {
                        None => ["-"; 3].map(str::to_owned),
                        Some(found) => {
                            let mark = if found.is_apart_from_zero() { " *" } else { "" };
                            [
                                found.count.to_string(),
                                format!("{}{mark}", signed(found.mean)),
                                interval(&found, signed),
                            ]
                        }
                    });
                }
                table.add_row(row);
            }
        }
        table
    }

    /// A table an axis of the situations: all in the file and with `all`, else the one that was asked for.
    fn write_axes(&mut self, figures: &[String]) {
        let wanted = |axis: &usize| match self.show {
            Show::File | Show::Terminal { all: true, .. } => true,
            Show::Terminal { by, .. } => by == Some(*axis),
        };
        let axes: Vec<usize> = (0..self.plan.axes.len()).filter(wanted).collect();
        for axis in axes {
            let values = self.values_of(axis);
            if values.len() > 1 || !self.show.is_markdown() {
                let table = self.by_axis(axis, &values, figures);
                let title = format!("By {}: passed, and means over all runs", self.plan.axes[axis]);
                self.section(&title, table, "");
            }
        }
    }

    /// The values of an axis in the order in which they are run.
    fn values_of(&self, axis: usize) -> Vec<String> {
        let mut values: Vec<String> = Vec::new();
        for label in self.plan.runs.iter().filter_map(|run| run.situation.get(axis)) {
            if !values.contains(label) {
                values.push(label.clone());
            }
        }
        values
    }

    fn by_axis(&self, axis: usize, values: &[String], figures: &[String]) -> Table {
        let key = &self.plan.axes[axis];
        let name = key.rsplit('.').next().unwrap_or(key);
        let mut header = vec!["figure", name];
        header.extend(self.groups.iter().map(|group| group.name));
        let mut table = self.table(&header, 2);
        let mut add = |figure: &str, cell: &dyn Fn(&Group<'_>) -> String| {
            for value in values {
                let cells = self.groups.iter().map(|group| cell(&group.at(axis, value)));
                table.add_row([figure.to_owned(), value.clone()].into_iter().chain(cells));
            }
        };
        add("passed", &|group| match group.runs.len() {
            0 => "-".to_owned(),
            runs => format!("{} of {runs}", group.count(Outcome::Passed)),
        });
        for figure in figures {
            add(figure, &|group| {
                summary(&group.values(figure, false)).map_or("-".to_owned(), |sample| number(sample.mean))
            });
        }
        table
    }

    fn ratios(&self) -> Table {
        let mut table = self.table(&["ratio", "of", "variant", "value"], 3);
        for (name, parts) in &self.plan.ratios {
            for group in &self.groups {
                let value = group.ratio(parts).map_or("-".to_owned(), number);
                table.add_row([name.clone(), parts.join(" / "), group.name.to_owned(), value]);
            }
        }
        table
    }

    fn expectations(&self, verdicts: &[Verdict]) -> Table {
        let mut table = self.table(&["variant", "figure", "expected", "found", ""], 2);
        for verdict in verdicts {
            table.add_row([
                verdict.variant.clone(),
                verdict.figure.clone(),
                interval_of(verdict.bounds.map(number)),
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

    /// How runs ended that did not pass, and how many ways were left out.
    fn endings(&self) -> (Table, usize) {
        let mut table = self.table(&["variant", "how", "runs", "for instance"], 2);
        let mut rows: Vec<(&str, usize, &Record)> = Vec::new();
        for variant in &self.plan.variants {
            rows.extend(
                kinds(self.records, &variant.name)
                    .into_iter()
                    .map(|(count, record)| (variant.name.as_str(), count, record)),
            );
        }
        let shown = if self.show.is_short() { ENDINGS_SHOWN } else { usize::MAX };
        for (variant, count, record) in rows.iter().take(shown) {
            let situation = record.situation.iter().cloned().chain([format!("seed {}", record.seed)]);
            let situation: Vec<String> = situation.collect();
            table.add_row([
                (*variant).to_owned(),
                format!("{}: {}", record.outcome.word(), record.remark),
                count.to_string(),
                situation.join(", "),
            ]);
        }
        (table, rows.len().saturating_sub(shown))
    }

    /// A table whose columns from `numbers_from` on hold numbers.
    fn table(&self, header: &[&str], numbers_from: usize) -> Table {
        let mut table = Table::new();
        table.load_style(if self.show.is_markdown() { presets::ASCII_MARKDOWN } else { presets::NOTHING });
        table.set_header(header.iter().map(Cell::new));
        for column in table.column_iter_mut().skip(numbers_from) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        table
    }
}

/// The ways in which runs of a variant ended that did not pass: how many, and the first of them.
fn kinds<'a>(records: &'a [Record], variant: &str) -> Vec<(usize, &'a Record)> {
    let others =
        records.iter().filter(|record| record.variant == variant && record.outcome != Outcome::Passed);
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
    seen.into_iter().map(|(_, count, record)| (count, record)).collect()
}

fn interval(sample: &Summary, shown: impl Fn(f64) -> String) -> String {
    sample.interval().map_or("-".to_owned(), |ends| interval_of(ends.map(shown)))
}

fn interval_of([low, high]: [String; 2]) -> String {
    format!("{low} to {high}")
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}
