//! From an experiment file to its runs.

use super::choice::Choice;
use super::refusal::{PlanError, RUNS_MAX};
use crate::graph::{Overrides, hint};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// What a variant is called that changes nothing.
const UNCHANGED: &str = "as the graph is";
/// The largest experiment of ours has 3 KiB.
const FILE_MAX: u64 = 1 << 20;
/// What the runs of an experiment change, in bytes, all together.
const CHANGES_MAX: usize = 256 << 20;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: Option<String>,
    graph: String,
    limit_s: f64,
    seeds: Seeds,
    #[serde(default)]
    worlds: Vec<String>,
    #[serde(default)]
    set: Table,
    #[serde(default)]
    swap: Table,
    #[serde(default)]
    without: Vec<String>,
    #[serde(default)]
    ratio: BTreeMap<String, [String; 2]>,
    #[serde(default)]
    vary: Table,
    #[serde(default)]
    across: Table,
    #[serde(default)]
    variant: Vec<VariantTable>,
    #[serde(default)]
    needs: Vec<String>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct VariantTable {
    name: String,
    #[serde(default)]
    set: Table,
    #[serde(default)]
    swap: Table,
    #[serde(default)]
    without: Vec<String>,
    seeds: Option<Seeds>,
    limit_s: Option<f64>,
    /// Its own values of some of the situations' axes.
    #[serde(default)]
    across: Table,
    #[serde(default)]
    expect: BTreeMap<String, [f64; 2]>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "seeds are { from = 1, count = 20 } or a list of numbers")]
enum Seeds {
    Range(SeedRange),
    List(Vec<u64>),
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct SeedRange {
    from: u64,
    count: u64,
}

impl Seeds {
    fn list(&self) -> Vec<u64> {
        match self {
            Self::List(list) => list.clone(),
            Self::Range(range) => {
                let count = range.count.min(RUNS_MAX as u64 + 1);
                (range.from..range.from.saturating_add(count)).collect()
            }
        }
    }
}

/// An experiment, spelt out.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub(super) name: String,
    /// A name or a path, as `launch up` takes it.
    pub(super) graph: String,
    pub(super) variants: Vec<Variant>,
    /// Figures of a whole variant: the sum of one figure over all runs by that of another.
    pub(super) ratios: BTreeMap<String, [String; 2]>,
    /// What the situations differ in, the seed apart.
    pub(super) axes: Vec<String>,
    /// Variant by variant.
    pub(super) runs: Vec<Run>,
    /// Parameters that name a file without which a variant cannot be run.
    needs: Vec<String>,
}

/// What is compared with the others.
#[derive(Debug, Clone)]
pub(super) struct Variant {
    pub(super) name: String,
    /// Bounds of the mean of a figure, of a ratio, and of `passes`: the share of runs that pass.
    pub(super) expect: BTreeMap<String, [f64; 2]>,
}

/// One run of one variant in one situation.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Run {
    pub(super) variant: usize,
    /// Parallel to the axes.
    pub(super) situation: Vec<String>,
    pub(super) seed: u64,
    pub(super) limit_s: f64,
    /// All that is different from the graph file, the seed included.
    pub(super) overrides: Overrides,
}

/// Changes in a graph, and how people call them.
#[derive(Debug, Clone, Default)]
struct Changes {
    labels: Vec<String>,
    set: Vec<String>,
    swap: Vec<String>,
    without: Vec<String>,
}

impl Changes {
    /// These, and over them others.
    fn and(&self, more: &Self) -> Self {
        let join = |one: &[String], other: &[String]| [one, other].concat();
        Self {
            labels: join(&self.labels, &more.labels),
            set: join(&self.set, &more.set),
            swap: join(&self.swap, &more.swap),
            without: join(&self.without, &more.without),
        }
    }

    /// How much they take in memory, about.
    fn bytes(&self) -> usize {
        let texts = [&self.labels, &self.set, &self.swap, &self.without];
        texts.into_iter().flatten().map(|text| text.len() + size_of::<String>()).sum()
    }

    fn overrides(&self, seed: u64) -> Overrides {
        Overrides {
            set: self.set.clone(),
            swap: self.swap.clone(),
            without: self.without.clone(),
            seed: Some(seed),
            board: None,
        }
    }

    fn of_tables(set: &Table, swap: &Table, without: &[String]) -> Result<Self, PlanError> {
        let mut changes = Self { without: without.to_vec(), ..Self::default() };
        for (key, value) in set {
            match value {
                // [set.role] with its parameters below reads as well as "role.parameter".
                Value::Table(inner) if !key.contains('.') => {
                    changes.set.extend(inner.iter().map(|(name, value)| format!("{key}.{name}={value}")));
                }
                value => changes.set.push(format!("{key}={value}")),
            }
        }
        for (role, binary) in swap {
            changes.swap.push(swapped(role, binary)?);
        }
        Ok(changes)
    }

    /// One value of an axis: a key with a dot is a parameter, one without is a role.
    fn of_axis(key: &str, value: &Value) -> Result<Self, PlanError> {
        let label = match value {
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        let mut changes = Self { labels: vec![label], ..Self::default() };
        if key.contains('.') {
            changes.set.push(format!("{key}={value}"));
        } else {
            changes.swap.push(swapped(key, value)?);
        }
        Ok(changes)
    }
}

fn swapped(role: &str, binary: &Value) -> Result<String, PlanError> {
    match binary {
        Value::String(binary) => Ok(format!("{role}={binary}")),
        other => Err(PlanError::NotABinary { role: role.to_owned(), value: other.to_string() }),
    }
}

impl Plan {
    /// What makes a run the one that it is, whatever has changed in it since it was done.
    pub(super) fn identity<'a>(&'a self, run: &'a Run) -> (&'a str, &'a [String], u64) {
        (&self.variants[run.variant].name, &run.situation, run.seed)
    }

    /// Takes the variants out that need a file which is not there; `folder` is that from which the paths of
    /// parameters count. Each with its name, and the file that is missing.
    pub(super) fn leave_out_what_lacks_files(&mut self, folder: &Path) -> Vec<(String, PathBuf)> {
        let lacks = |variant: usize| {
            let run = self.runs.iter().find(|run| run.variant == variant)?;
            let named = self.needs.iter().filter_map(|key| set_text(&run.overrides.set, key));
            named.map(|file| folder.join(file)).find(|file| !file.is_file())
        };
        let lacking: Vec<Option<PathBuf>> = (0..self.variants.len()).map(lacks).collect();
        let variants = std::mem::take(&mut self.variants).into_iter().zip(&lacking);
        let (gone, kept): (Vec<_>, Vec<_>) = variants.partition(|(_, file)| file.is_some());
        self.variants = kept.into_iter().map(|(variant, _)| variant).collect();
        self.runs.retain(|run| lacking[run.variant].is_none());
        for run in &mut self.runs {
            run.variant -= lacking[..run.variant].iter().flatten().count();
        }
        gone.into_iter().filter_map(|(variant, file)| Some((variant.name, file.clone()?))).collect()
    }
}

/// Reads an experiment file.
///
/// # Errors
/// Names what is wrong with it, or with what is chosen of it.
pub(super) fn read(file: &Path, choice: &Choice) -> Result<Plan, PlanError> {
    let shown = file.display().to_string();
    let text = files::read_text(file, FILE_MAX)
        .map_err(|error| PlanError::Unreadable { file: shown.clone(), cause: error.problem })?;
    let stem = file.file_stem().and_then(|stem| stem.to_str()).unwrap_or("experiment");
    parse(&text, stem, file.parent().unwrap_or(Path::new("")), choice).map_err(|error| match error {
        PlanError::Malformed { cause, .. } => PlanError::Malformed { file: shown, cause },
        other => other,
    })
}

/// The same of a text; `folder` is that of the file.
pub(super) fn parse(text: &str, stem: &str, folder: &Path, choice: &Choice) -> Result<Plan, PlanError> {
    let mut file: File = files::toml::parse(text)
        .map_err(|cause| PlanError::Malformed { file: stem.to_owned(), cause: Box::new(cause) })?;
    if !file.worlds.is_empty() {
        let worlds = file.worlds.iter().cloned().map(Value::String).collect();
        file.across.insert("graph.defaults.world".to_owned(), Value::Array(worlds));
    }
    if let Some((name, _)) = file.ratio.iter().find(|(name, parts)| parts.contains(name)) {
        return Err(PlanError::RatioOfItself { name: name.clone() });
    }
    let for_all = Changes::of_tables(&file.set, &file.swap, &file.without)?;
    let combinations = product(&file.vary)?;
    if file.variant.is_empty() {
        file.variant.push(VariantTable {
            name: String::new(),
            set: Table::new(),
            swap: Table::new(),
            without: Vec::new(),
            seeds: None,
            limit_s: None,
            across: Table::new(),
            expect: BTreeMap::new(),
        });
    }
    let is_varied = |key: &&String| file.across.contains_key(*key) || file.vary.contains_key(*key);
    if let Some(key) = choice.sweep.keys().find(is_varied) {
        return Err(PlanError::VariedAlready { key: key.clone() });
    }
    let sweep = product(&choice.sweep)?;
    let (mut variants, mut runs): (Vec<Variant>, Vec<Run>) = (Vec::new(), Vec::new());
    let (mut known, mut bytes) = (BTreeSet::new(), 0_usize);
    for table in &file.variant {
        let own = for_all.and(&Changes::of_tables(&table.set, &table.swap, &table.without)?);
        let limit_s = table.limit_s.unwrap_or(file.limit_s);
        if !(limit_s > 0.0 && limit_s.is_finite()) {
            return Err(PlanError::NoLimit { limit_s });
        }
        let situations = product(&own_axes(&file.across, &table.across)?)?;
        let seeds = table.seeds.as_ref().unwrap_or(&file.seeds);
        let seeds = choice.seeds.clone().unwrap_or_else(|| seeds.list());
        for combination in &combinations {
            let in_file = variant_name(&table.name, &file.vary, &combination.labels);
            if !known.insert(in_file.clone()) {
                return Err(PlanError::SameName { name: in_file });
            }
            if !choice.only.is_empty() && !choice.only.contains(&in_file) {
                continue;
            }
            for swept in &sweep {
                let (name, expect) = match choice.sweep.is_empty() {
                    true => (in_file.clone(), table.expect.clone()),
                    // What the file expects, it expects of its own variants.
                    false => (swept_name(&in_file, &choice.sweep, &swept.labels), BTreeMap::new()),
                };
                variants.push(Variant { name, expect });
                let more = seeds.len().saturating_mul(situations.len()).saturating_add(runs.len());
                if seeds.is_empty() || more > RUNS_MAX {
                    return Err(PlanError::Size { runs: more });
                }
                let variant = variants.len() - 1;
                let changes = own.and(combination).and(swept);
                for situation in &situations {
                    let changes = changes.and(situation);
                    bytes = bytes.saturating_add(changes.bytes().saturating_mul(seeds.len()));
                    if bytes > CHANGES_MAX {
                        return Err(PlanError::TooMuch);
                    }
                    runs.extend(seeds.iter().map(|&seed| Run {
                        variant,
                        situation: situation.labels.clone(),
                        seed,
                        limit_s,
                        overrides: changes.overrides(seed),
                    }));
                }
            }
        }
    }
    if let Some(name) = choice.only.iter().find(|name| !known.contains(*name)) {
        let hint = hint(name, known.iter().map(String::as_str), "variants");
        return Err(PlanError::NoSuchVariant { name: name.clone(), hint });
    }
    Ok(Plan {
        name: file.name.unwrap_or_else(|| stem.to_owned()),
        graph: located(&file.graph, folder),
        variants,
        ratios: file.ratio,
        axes: file.across.keys().cloned().collect(),
        runs,
        needs: file.needs,
    })
}

/// The axes of all, with a variant's own values for some of them.
fn own_axes(all: &Table, own: &Table) -> Result<Table, PlanError> {
    let mut axes = all.clone();
    for (key, values) in own {
        match axes.get_mut(key) {
            Some(known) => *known = values.clone(),
            None => return Err(PlanError::NotAnAxis { key: key.clone() }),
        }
    }
    Ok(axes)
}

/// Every combination of the axes' values; one without changes if there are no axes.
fn product(axes: &Table) -> Result<Vec<Changes>, PlanError> {
    let mut combinations = vec![Changes::default()];
    for (key, values) in axes {
        let Value::Array(values) = values else {
            return Err(PlanError::NotAList { key: key.clone(), value: values.to_string() });
        };
        if values.is_empty() {
            return Err(PlanError::EmptyList { key: key.clone() });
        }
        let runs = combinations.len().saturating_mul(values.len());
        if runs > RUNS_MAX {
            return Err(PlanError::Size { runs });
        }
        let values = values.iter().map(|value| Changes::of_axis(key, value));
        let values = values.collect::<Result<Vec<_>, _>>()?;
        combinations =
            combinations.iter().flat_map(|known| values.iter().map(|value| known.and(value))).collect();
    }
    Ok(combinations)
}

/// The name in the file, and what is varied beside it.
fn variant_name(name: &str, axes: &Table, labels: &[String]) -> String {
    let short = |key: &str| key.rsplit('.').next().unwrap_or(key).to_owned();
    // Of a path the file tells it.
    let varied = axes.keys().zip(labels).map(|(key, label)| match key.contains('.') {
        true => format!("{}={}", short(key), label.rsplit('/').next().unwrap_or(label)),
        false => label.clone(),
    });
    let parts: Vec<String> =
        Some(name.to_owned()).filter(|name| !name.is_empty()).into_iter().chain(varied).collect();
    if parts.is_empty() { UNCHANGED.to_owned() } else { parts.join(", ") }
}

/// The same of a variant of which a sweep makes several.
fn swept_name(in_file: &str, axes: &Table, labels: &[String]) -> String {
    variant_name(if in_file == UNCHANGED { "" } else { in_file }, axes, labels)
}

/// The text that a parameter is set to; `None` when it is not set, or to something else.
fn set_text(set: &[String], key: &str) -> Option<String> {
    let values = set.iter().filter_map(|set| set.split_once('='));
    let (_, value) = values.rev().find(|(known, _)| known.trim() == key)?;
    match format!("value = {value}").parse::<Table>().ok().and_then(|mut table| table.remove("value")) {
        Some(Value::String(text)) => Some(text),
        Some(_) => None,
        // As on the command line, where a text needs no quotes.
        None => Some(value.trim().to_owned()),
    }
}

/// A graph's path counts from the experiment's folder; a bare name is looked up.
fn located(graph: &str, folder: &Path) -> String {
    if !graph.contains('/') && !graph.ends_with(".toml") {
        return graph.to_owned();
    }
    let path: PathBuf = folder.join(graph);
    path.canonicalize().unwrap_or(path).display().to_string()
}
