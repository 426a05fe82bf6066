//! `runs.csv`: a line a finished run, on disk before the next one begins.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The columns before those of the situation, after them, and after the figures.
const FIRST: [&str; 2] = ["key", "variant"];
const MIDDLE: [&str; 5] = ["seed", "outcome", "remark", "logical_s", "wall_s"];
const LAST: &str = "digest";

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outcome {
    /// The referee let it pass.
    Passed,
    /// The referee did not.
    Failed,
    /// The limit came before the referee's word.
    Unfinished,
    /// It could not be run. Such a run is done again.
    Error,
}

impl Outcome {
    const ALL: [(Self, &'static str); 4] = [
        (Self::Passed, "passed"),
        (Self::Failed, "failed"),
        (Self::Unfinished, "unfinished"),
        (Self::Error, "error"),
    ];

    pub(super) fn word(self) -> &'static str {
        Self::ALL.iter().find(|(outcome, _)| *outcome == self).map_or("error", |(_, word)| word)
    }

    fn of(word: &str) -> Option<Self> {
        Self::ALL.iter().find(|(_, known)| *known == word).map(|(outcome, _)| *outcome)
    }
}

/// One finished run.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Record {
    /// Tells runs apart, and the same run with other binaries, worlds or parameters.
    pub(super) key: String,
    pub(super) variant: String,
    /// Parallel to the experiment's axes.
    pub(super) situation: Vec<String>,
    pub(super) seed: u64,
    pub(super) outcome: Outcome,
    pub(super) remark: String,
    pub(super) logical_s: f64,
    pub(super) wall_s: f64,
    /// What the referee measured; what it does not know is left out.
    pub(super) figures: BTreeMap<String, f64>,
    pub(super) digest: String,
}

impl Record {
    /// What makes a run the one that it is, whatever has changed in it since.
    pub(super) fn identity(&self) -> (&str, &[String], u64) {
        (&self.variant, &self.situation, self.seed)
    }
}

/// What becomes of a record when an experiment goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Use {
    /// It is one of the runs that are wanted.
    Wanted,
    /// It is of another seed or variant: it stays in the file, and is not looked at.
    Aside,
    /// Something in it has changed since: it is moved to `runs-outdated.csv`.
    Outdated,
}

/// The file and all its records.
#[derive(Debug)]
pub(super) struct Store {
    path: PathBuf,
    axes: Vec<String>,
    figures: BTreeSet<String>,
    /// Those that are wanted.
    pub(super) records: Vec<Record>,
    /// Those that are kept beside them.
    pub(super) aside: Vec<Record>,
    /// Open at its end while the columns suffice.
    file: Option<File>,
}

impl Store {
    /// Opens the file, or begins it; `use_of` says what becomes of each record. How many are outdated is
    /// returned, too. Records of an experiment with other axes have no place in the same columns, and are
    /// outdated all.
    ///
    /// # Errors
    /// When the disk does not let it.
    pub(super) fn open(
        path: &Path,
        axes: &[String],
        use_of: impl Fn(&Record) -> Use,
    ) -> std::io::Result<(Self, usize)> {
        let (known_axes, known) = read(path)?;
        let use_of = |record: &Record| if known_axes == axes { use_of(record) } else { Use::Outdated };
        let count = known.iter().filter(|record| use_of(record) == Use::Outdated).count();
        if count > 0 {
            fs::copy(path, path.with_file_name("runs-outdated.csv"))?;
        }
        let mut store = Self {
            path: path.to_owned(),
            axes: axes.to_vec(),
            figures: BTreeSet::new(),
            records: Vec::new(),
            aside: Vec::new(),
            file: None,
        };
        for record in known {
            let place = match use_of(&record) {
                Use::Wanted => &mut store.records,
                Use::Aside => &mut store.aside,
                Use::Outdated => continue,
            };
            store.figures.extend(record.figures.keys().cloned());
            place.push(record);
        }
        store.rewrite()?;
        Ok((store, count))
    }

    /// Adds a record; it is on disk when this returns.
    ///
    /// # Errors
    /// When the disk does not let it.
    pub(super) fn append(&mut self, record: Record) -> std::io::Result<()> {
        let columns = self.figures.len();
        self.figures.extend(record.figures.keys().cloned());
        self.records.push(record);
        let (Some(file), true) = (&mut self.file, columns == self.figures.len()) else {
            return self.rewrite();
        };
        let line = lines(self.records.last().map(|record| row(record, &self.figures)));
        file.write_all(&line)?;
        file.sync_data()
    }

    /// Puts the records into an order and writes all anew, so that an interrupted experiment leaves the same
    /// file as another.
    ///
    /// # Errors
    /// When the disk does not let it.
    pub(super) fn sort_by_key(&mut self, place: impl Fn(&Record) -> usize) -> std::io::Result<()> {
        self.records.sort_by_key(place);
        self.rewrite()
    }

    fn rewrite(&mut self) -> std::io::Result<()> {
        let first = FIRST.iter().map(|name| (*name).to_owned());
        let middle = MIDDLE.iter().map(|name| (*name).to_owned());
        let header = first
            .chain(self.axes.iter().cloned())
            .chain(middle)
            .chain(self.figures.iter().cloned())
            .chain([LAST.to_owned()]);
        let rows = self.records.iter().chain(&self.aside).map(|record| row(record, &self.figures));
        let text = lines(std::iter::once(header.collect()).chain(rows));
        // The old file stays whole until the new one is.
        let new = self.path.with_extension("csv.new");
        let mut file = File::create(&new)?;
        file.write_all(&text)?;
        file.sync_data()?;
        fs::rename(&new, &self.path)?;
        self.file = Some(file);
        Ok(())
    }
}

fn row(record: &Record, figures: &BTreeSet<String>) -> Vec<String> {
    let first = [record.key.clone(), record.variant.clone()];
    let middle = [
        record.seed.to_string(),
        record.outcome.word().to_owned(),
        record.remark.clone(),
        record.logical_s.to_string(),
        record.wall_s.to_string(),
    ];
    let figures = figures.iter().map(|name| record.figures.get(name).map(f64::to_string).unwrap_or_default());
    first
        .into_iter()
        .chain(record.situation.iter().cloned())
        .chain(middle)
        .chain(figures)
        .chain([record.digest.clone()])
        .collect()
}

fn lines(rows: impl IntoIterator<Item = Vec<String>>) -> Vec<u8> {
    let mut writer = csv::WriterBuilder::new().flexible(true).from_writer(Vec::new());
    for row in rows {
        // Writing to memory does not fail.
        let _ = writer.write_record(&row);
    }
    writer.into_inner().unwrap_or_default()
}

/// The axes and the records of a file; nothing when there is none.
///
/// # Errors
/// When it is there and cannot be read.
pub(super) fn read(path: &Path) -> std::io::Result<(Vec<String>, Vec<Record>)> {
    match fs::read(path) {
        Ok(text) => Ok(parse(&text)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Default::default()),
        Err(error) => Err(error),
    }
}

/// The axes and the records of a text. A line that a crash cut short, or that means nothing, is left out:
/// that run is done again.
pub(super) fn parse(text: &[u8]) -> (Vec<String>, Vec<Record>) {
    // What does not end in a line's end was being written.
    let end = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |place| place + 1);
    let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(&text[..end]);
    let Ok(header) = reader.headers().cloned() else { return Default::default() };
    let place = |name: &str| header.iter().position(|column| column == name);
    let (Some(seed), Some(wall)) = (place("seed"), place("wall_s")) else { return Default::default() };
    let sound = header.len() > wall + 1
        && header.iter().take(2).eq(FIRST)
        && header.iter().skip(seed).take(MIDDLE.len()).eq(MIDDLE)
        && header.iter().next_back() == Some(LAST);
    if !sound {
        return Default::default();
    }
    let axes = header.iter().take(seed).skip(FIRST.len()).map(str::to_owned).collect();
    let rows = reader.records().filter_map(Result::ok).filter(|row| row.len() == header.len());
    let records = rows.filter_map(|row| {
        let text = |index: usize| row.get(index).unwrap_or_default();
        let figures = (wall + 1..header.len() - 1)
            .filter_map(|index| Some((header.get(index)?.to_owned(), text(index).parse().ok()?)));
        Some(Record {
            key: text(0).to_owned(),
            variant: text(1).to_owned(),
            situation: (FIRST.len()..seed).map(|index| text(index).to_owned()).collect(),
            seed: text(seed).parse().ok()?,
            outcome: Outcome::of(text(seed + 1))?,
            remark: text(seed + 2).to_owned(),
            logical_s: text(seed + 3).parse().ok()?,
            wall_s: text(wall).parse().ok()?,
            figures: figures.collect(),
            digest: text(header.len() - 1).to_owned(),
        })
    });
    (axes, records.collect())
}
