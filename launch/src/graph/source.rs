//! Where something was written: a file, or an argument of the command line.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A text that the user wrote.
#[derive(Debug)]
pub(crate) struct Source {
    /// What people call it: a file's path as they would type it.
    pub(crate) name: String,
    /// All of it.
    pub(crate) text: String,
    /// Whether it is a file, whose lines have numbers, and no argument.
    pub(crate) is_file: bool,
    /// The folder of an included file, from which its paths count; those of others count from the graph's.
    pub(crate) folder: Option<PathBuf>,
}

impl Source {
    /// A file's text.
    pub(crate) fn file(name: impl Into<String>, text: impl Into<String>) -> Arc<Self> {
        Arc::new(Self { name: name.into(), text: text.into(), is_file: true, folder: None })
    }

    /// The text of a file that another one includes.
    pub(crate) fn included(name: impl Into<String>, text: impl Into<String>, folder: &Path) -> Arc<Self> {
        let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        Arc::new(Self { name: name.into(), text: text.into(), is_file: true, folder: Some(folder) })
    }

    /// An option of the command line, such as `--set` with its argument.
    pub(crate) fn argument(option: &str, argument: &str) -> Arc<Self> {
        let text = format!("{option} {argument}");
        Arc::new(Self { name: "command line".to_owned(), text, is_file: false, folder: None })
    }
}

/// A piece of a source.
#[derive(Clone)]
pub(crate) struct Place {
    source: Arc<Source>,
    span: Range<usize>,
}

impl Place {
    /// The bytes `span` of `source`.
    pub(crate) fn new(source: &Arc<Source>, span: Range<usize>) -> Self {
        Self { source: Arc::clone(source), span }
    }

    /// The beginning of a source.
    pub(crate) fn top(source: &Arc<Source>) -> Self {
        Self::new(source, 0..0)
    }

    /// The source.
    pub(crate) fn source(&self) -> &Source {
        &self.source
    }

    /// Its first byte in the source.
    pub(crate) fn start(&self) -> usize {
        self.span.start
    }

    /// What is written there.
    pub(crate) fn text(&self) -> &str {
        self.source.text.get(self.span.clone()).unwrap_or_default()
    }

    /// Line and column in characters, both counted from 1.
    pub(crate) fn line_and_column(&self) -> (usize, usize) {
        let before = self.source.text.get(..self.span.start).unwrap_or(&self.source.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }

    /// The line in which it begins.
    pub(crate) fn line_text(&self) -> &str {
        let (line, _) = self.line_and_column();
        self.source.text.lines().nth(line - 1).unwrap_or_default()
    }

    /// Its length in characters, as far as its first line goes; at least 1.
    pub(crate) fn length(&self) -> usize {
        self.text().lines().next().map_or(0, |line| line.trim_end().chars().count()).max(1)
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (line, column) = self.line_and_column();
        if self.source.is_file {
            write!(f, "{}:{line}:{column}", self.source.name)
        } else {
            f.write_str(&self.source.name)
        }
    }
}

impl fmt::Debug for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
