//! TOML values that remember where they were written.

use super::problem::{Problem, Problems};
use super::source::{Place, Source};
use files::toml::TomlError;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value and where it stands.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    /// What it is.
    pub(crate) content: Content,
    /// Where it stands.
    pub(crate) place: Place,
}

/// A value.
#[derive(Debug, Clone)]
pub(crate) enum Content {
    /// A text.
    Text(String),
    /// An integer or a finite number.
    Number(serde_json::Number),
    /// True or false.
    Boolean(bool),
    /// A date, which no parameter takes.
    Date(String),
    /// Values in a row.
    Array(Vec<Node>),
    /// Named values.
    Table(Table),
    /// What was complained about already, such as `nan`.
    Nonsense,
}

/// A name, a value, and where both stand.
#[derive(Debug, Clone)]
pub(crate) struct Entry {
    /// The name.
    pub(crate) key: String,
    /// Where the name stands.
    pub(crate) key_place: Place,
    /// The value.
    pub(crate) value: Node,
}

/// Named values, in the order in which they were written.
#[derive(Debug, Clone, Default)]
pub(crate) struct Table {
    /// The entries.
    pub(crate) entries: Vec<Entry>,
}

impl Table {
    /// The entry of that name.
    pub(crate) fn get(&self, key: &str) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.key == key)
    }

    /// Puts an entry in, in the place of one of the same name.
    pub(crate) fn put(&mut self, entry: Entry) {
        match self.entries.iter_mut().find(|known| known.key == entry.key) {
            Some(known) => *known = entry,
            None => self.entries.push(entry),
        }
    }

    /// Takes an entry out.
    pub(crate) fn remove(&mut self, key: &str) -> Option<Entry> {
        let index = self.entries.iter().position(|entry| entry.key == key)?;
        Some(self.entries.remove(index))
    }
}

impl Node {
    /// What it is, in words: for "takes a number, not ..".
    pub(crate) fn kind(&self) -> &'static str {
        match &self.content {
            Content::Text(_) => "a text",
            Content::Number(number) if number.is_f64() => "a fraction",
            Content::Number(_) => "an integer",
            Content::Boolean(_) => "a boolean",
            Content::Date(_) => "a date",
            Content::Array(_) => "an array",
            Content::Table(_) => "a table",
            Content::Nonsense => "nonsense",
        }
    }

    /// Whether it was complained about already.
    pub(crate) fn is_nonsense(&self) -> bool {
        matches!(self.content, Content::Nonsense)
    }

    /// The same of it or anything within.
    pub(crate) fn has_nonsense(&self) -> bool {
        match &self.content {
            Content::Nonsense => true,
            Content::Array(items) => items.iter().any(Self::has_nonsense),
            Content::Table(table) => table.entries.iter().any(|entry| entry.value.has_nonsense()),
            _ => false,
        }
    }

    /// The table it is, if it is one.
    pub(crate) fn table(&self) -> Option<&Table> {
        if let Content::Table(table) = &self.content { Some(table) } else { None }
    }

    /// The text it is, if it is one.
    pub(crate) fn text(&self) -> Option<&str> {
        if let Content::Text(text) = &self.content { Some(text) } else { None }
    }

    /// Its truth value.
    pub(crate) fn boolean(&self) -> Option<bool> {
        if let Content::Boolean(value) = self.content { Some(value) } else { None }
    }

    /// The number it is, if it is one.
    pub(crate) fn number(&self) -> Option<f64> {
        if let Content::Number(number) = &self.content { number.as_f64() } else { None }
    }

    /// The integer it is, if it is one.
    pub(crate) fn integer(&self) -> Option<i64> {
        if let Content::Number(number) = &self.content { number.as_i64() } else { None }
    }

    /// The values it holds, if it is an array.
    pub(crate) fn array(&self) -> Option<&[Node]> {
        if let Content::Array(items) = &self.content { Some(items) } else { None }
    }

    /// The same value without its places.
    pub(crate) fn to_json(&self) -> serde_json::Value {
        match &self.content {
            Content::Text(text) | Content::Date(text) => text.clone().into(),
            Content::Number(number) => number.clone().into(),
            Content::Boolean(value) => (*value).into(),
            Content::Nonsense => serde_json::Value::Null,
            Content::Array(items) => items.iter().map(Self::to_json).collect(),
            Content::Table(table) => {
                let pairs = table.entries.iter().map(|entry| (entry.key.clone(), entry.value.to_json()));
                serde_json::Value::Object(pairs.collect())
            }
        }
    }
}

/// Mistakes in the syntax that are told: after so many the file is no TOML at all.
const SYNTAX_ERRORS_MAX: usize = 20;

/// Keys of one table: a graph has its services, a service its parameters.
const KEYS_MAX: usize = 1000;

/// Reads a TOML file. Every mistake in its syntax is reported; with one there is no table.
pub(crate) fn parse(source: &Arc<Source>, problems: &mut Problems) -> Option<Table> {
    let (table, errors) = files::toml::parse_recoverable(&source.text)
        .map_err(|error| problems.push(syntax_problem(source, &error)))
        .ok()?;
    for error in errors.iter().take(SYNTAX_ERRORS_MAX) {
        problems.push(syntax_problem(source, error));
    }
    let table = Convert { source, offset: 0, problems }.table(table.get_ref());
    errors.is_empty().then_some(table).flatten()
}

/// Reads one TOML value that begins at byte `offset` of `source`, of an argument of the command line. What is
/// no TOML is a number where it can only be one, as `.5`, and else a text without quotes.
pub(crate) fn parse_value(source: &Arc<Source>, offset: usize, problems: &mut Problems) -> Node {
    let text = source.text.get(offset..).unwrap_or_default();
    let place = Place::new(source, offset..source.text.len());
    let number = || text.trim().parse().ok().and_then(serde_json::Number::from_f64);
    let content = match files::toml::parse_value(text) {
        Ok(value) => Convert { source, offset, problems }.value(value.get_ref(), &place),
        Err(_) => number().map_or_else(|| Content::Text(text.to_owned()), Content::Number),
    };
    Node { content, place }
}

fn syntax_problem(source: &Arc<Source>, error: &TomlError) -> Problem {
    let place = error.span().map_or_else(|| Place::top(source), |span| Place::new(source, span));
    let name = place.text().trim().trim_matches(['[', ']', '"']);
    if error.message() == "duplicate key" && !name.is_empty() {
        let header = format!("[{name}]");
        let before = source.text.get(..place.start()).unwrap_or_default();
        if !before.ends_with('[') {
            return Problem::error(
                &place,
                format!("`{name}` appears twice in this table"),
                "keep one of the two",
            );
        }
        let help = format!(
            "a service has one table; for a second `{name}` choose another name and add `run = \"{name}\"`"
        );
        let problem = Problem::error(&place, format!("{header} appears twice in this file"), help);
        return match before.find(&header) {
            Some(start) => problem.see(&Place::new(source, start + 1..start + 1 + name.len()), "first here"),
            None => problem,
        };
    }
    let mut message = error.message().lines();
    let what = message.next().unwrap_or("a mistake").to_owned();
    let rest = message.map(str::trim).collect::<Vec<_>>().join("; ");
    let help = if rest.is_empty() {
        "correct the line; see https://toml.io for the syntax".to_owned()
    } else {
        rest
    };
    Problem::error(&place, format!("no TOML: {what}"), help)
}

/// Gives what the parser has read its places.
struct Convert<'a> {
    source: &'a Arc<Source>,
    /// Where in the source the text begins that was parsed.
    offset: usize,
    problems: &'a mut Problems,
}

impl Convert<'_> {
    fn place(&self, span: std::ops::Range<usize>) -> Place {
        Place::new(self.source, span.start + self.offset..span.end + self.offset)
    }

    /// `None` for one that is too large, which is told.
    fn table(&mut self, table: &DeTable<'_>) -> Option<Table> {
        let first = table.iter().map(|(key, _)| key.span()).min_by_key(|span| span.start);
        if let Some(first) = first.filter(|_| table.len() > KEYS_MAX) {
            let message = format!("{} keys in one table are more than {KEYS_MAX}", table.len());
            self.problems.push(Problem::error(&self.place(first), message, "leave out what is not needed"));
            return None;
        }
        let mut entries: Vec<Entry> = Vec::with_capacity(table.len());
        for (key, value) in table.iter() {
            let key_place = self.place(key.span());
            entries.push(Entry { key: key.get_ref().to_string(), key_place, value: self.node(value) });
        }
        // The parser hands them out by name.
        entries.sort_by_key(|entry| entry.key_place.start());
        Some(Table { entries })
    }

    fn node(&mut self, value: &Spanned<DeValue<'_>>) -> Node {
        let place = self.place(value.span());
        Node { content: self.value(value.get_ref(), &place), place }
    }

    fn value(&mut self, value: &DeValue<'_>, place: &Place) -> Content {
        match value {
            DeValue::String(text) => Content::Text(text.to_string()),
            DeValue::Boolean(value) => Content::Boolean(*value),
            DeValue::Datetime(date) => Content::Date(date.to_string()),
            DeValue::Array(items) => Content::Array(items.iter().map(|item| self.node(item)).collect()),
            DeValue::Table(table) => self.table(table).map_or(Content::Nonsense, Content::Table),
            DeValue::Integer(integer) => {
                let (digits, radix) = (integer.as_str(), integer.radix());
                let number = i64::from_str_radix(digits, radix).map(serde_json::Number::from);
                let number =
                    number.or_else(|_| u64::from_str_radix(digits, radix).map(serde_json::Number::from));
                let message = "this integer does not fit into 64 bits";
                number.map_or_else(|_| self.nonsense(place, message, "write a smaller one"), Content::Number)
            }
            DeValue::Float(float) => {
                let number = float.as_str().replace('_', "").parse().ok();
                let number = number.and_then(serde_json::Number::from_f64).map(Content::Number);
                let message = format!("`{float}` is no number that a robot can work with");
                number.unwrap_or_else(|| self.nonsense(place, &message, "write a finite number"))
            }
        }
    }

    fn nonsense(&mut self, place: &Place, message: &str, help: &str) -> Content {
        self.problems.push(Problem::error(place, message, help));
        Content::Nonsense
    }
}
