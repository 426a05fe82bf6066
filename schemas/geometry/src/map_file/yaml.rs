//! The keys of a map's YAML. Only values that can mean something to a map are kept: a word, a text, or a flat
//! list of them. Whatever else stands below a key is skipped, however deep, and never expanded.

use saphyr_parser::{Event, Parser, ScanError, StrInput};
use std::borrow::Cow;
use std::collections::HashMap;

/// A key with its value, and where the key stands.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entry {
    pub(super) key: String,
    pub(super) value: Value,
    /// Counted from 1.
    pub(super) line: usize,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Text(String),
    List(Vec<String>),
    /// A table, or a list of lists: nothing that a map's keys take.
    Other,
}

/// What is wrong, and in which line.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct YamlError {
    pub(super) line: usize,
    pub(super) problem: String,
}

/// Longer lists are no list of a map, and are skipped.
const LONGEST_LIST: usize = 16;

/// Reads the entries of the first document of a text, in their order.
pub(super) fn parse(text: &str) -> Result<Vec<Entry>, YamlError> {
    let text = without_tabs_after_keys(text);
    let mut reader = Reader { events: Parser::new_from_str(&text), anchors: HashMap::new() };
    let mut entries: Vec<Entry> = Vec::new();
    loop {
        match reader.next()? {
            (Event::StreamStart | Event::DocumentStart(_) | Event::Nothing, _) => {}
            (Event::MappingStart(..), _) => break,
            (Event::StreamEnd | Event::DocumentEnd, _) => return Ok(entries),
            // A file of comments alone.
            (Event::Scalar(text, ..), _) if text.is_empty() => return Ok(entries),
            (_, line) => {
                return Err(YamlError { line, problem: "this is not `key: value`".to_owned() });
            }
        }
    }
    loop {
        let (event, line) = reader.next()?;
        let key = match event {
            Event::MappingEnd => return Ok(entries),
            Event::Scalar(key, ..) => key.into_owned(),
            other => {
                // A key that is no word means nothing to a map.
                reader.value(other)?;
                let (value, _) = reader.next()?;
                reader.value(value)?;
                continue;
            }
        };
        if entries.iter().any(|entry| entry.key == key) {
            return Err(YamlError { line, problem: format!("{key} is given twice") });
        }
        let (event, _) = reader.next()?;
        let value = reader.value(event)?;
        entries.push(Entry { key, value, line });
    }
}

struct Reader<'a> {
    events: Parser<'a, StrInput<'a>>,
    /// What stands at each anchor.
    anchors: HashMap<usize, Value>,
}

impl<'a> Reader<'a> {
    /// The next event and its line.
    fn next(&mut self) -> Result<(Event<'a>, usize), YamlError> {
        match self.events.next_event() {
            Some(Ok((event, span))) => Ok((event, span.start.line())),
            Some(Err(error)) => Err(no_yaml(&error)),
            None => Ok((Event::StreamEnd, 0)),
        }
    }

    /// The value that begins with an event, to its end.
    fn value(&mut self, first: Event<'a>) -> Result<Value, YamlError> {
        let (value, anchor) = match first {
            Event::Scalar(text, _, anchor, _) => (Value::Text(text.into_owned()), anchor),
            Event::Alias(anchor) => (self.anchors.get(&anchor).cloned().unwrap_or(Value::Other), 0),
            Event::SequenceStart(anchor, _) => (self.list()?, anchor),
            Event::MappingStart(anchor, _) => {
                self.skip_to_end()?;
                (Value::Other, anchor)
            }
            _ => (Value::Other, 0),
        };
        if anchor > 0 {
            self.anchors.insert(anchor, value.clone());
        }
        Ok(value)
    }

    fn list(&mut self) -> Result<Value, YamlError> {
        let mut items = Vec::new();
        loop {
            match self.next()?.0 {
                Event::SequenceEnd => return Ok(Value::List(items)),
                Event::Scalar(text, _, anchor, _) if items.len() < LONGEST_LIST => {
                    if anchor > 0 {
                        self.anchors.insert(anchor, Value::Text(text.clone().into_owned()));
                    }
                    items.push(text.into_owned());
                }
                Event::Alias(anchor) if matches!(self.anchors.get(&anchor), Some(Value::Text(_))) => {
                    if let Some(Value::Text(text)) = self.anchors.get(&anchor)
                        && items.len() < LONGEST_LIST
                    {
                        items.push(text.clone());
                    }
                }
                Event::StreamEnd => return Ok(Value::Other),
                other => {
                    let begins = matches!(other, Event::SequenceStart(..) | Event::MappingStart(..));
                    if begins {
                        self.skip_to_end()?;
                    }
                    self.skip_to_end()?;
                    return Ok(Value::Other);
                }
            }
        }
    }

    /// Skips to the end of the list or table that is open.
    fn skip_to_end(&mut self) -> Result<(), YamlError> {
        let mut open = 1_usize;
        while open > 0 {
            match self.next()?.0 {
                Event::SequenceStart(..) | Event::MappingStart(..) => open += 1,
                Event::SequenceEnd | Event::MappingEnd => open -= 1,
                Event::StreamEnd => return Ok(()),
                _ => {}
            }
        }
        Ok(())
    }
}

/// The same text with a blank for each tab between a key and its value, which the parser does not take for
/// white space.
fn without_tabs_after_keys(text: &str) -> Cow<'_, str> {
    if !text.contains(":\t") {
        return Cow::Borrowed(text);
    }
    let mend = |line: &str| match line.split_once(":\t") {
        Some((key, value))
            if key.chars().all(|letter| letter.is_alphanumeric() || " _\"'".contains(letter)) =>
        {
            let bare = value.trim_start_matches('\t');
            format!("{key}:{}{bare}", " ".repeat(1 + value.len() - bare.len()))
        }
        _ => line.to_owned(),
    };
    Cow::Owned(text.split_inclusive('\n').map(mend).collect())
}

fn no_yaml(error: &ScanError) -> YamlError {
    let marker = error.marker();
    let problem = format!("no YAML: {} (column {})", error.info(), marker.col() + 1);
    YamlError { line: marker.line(), problem }
}

/// A text in double quotes that reads back as it is.
pub(super) fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for letter in text.chars() {
        match letter {
            '"' | '\\' => quoted.extend(['\\', letter]),
            letter if letter.is_control() || letter == '\u{feff}' => {
                quoted.push_str(&format!("\\u{:04x}", u32::from(letter)));
            }
            letter => quoted.push(letter),
        }
    }
    quoted + "\""
}
