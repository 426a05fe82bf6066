//! What is wrong with a graph: where, what, and what to do about it.

use super::source::Place;
use anstyle::{AnsiColor, Style};
use std::fmt::Write as _;

/// Longest source line that is shown whole, in characters.
const LINE_MAX: usize = 110;
/// Longest sentence: names of a file stand in it, however long they are there.
const WORDS_MAX: usize = 2000;

/// How bad a problem is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Severity {
    /// The graph is refused.
    Error,
    /// Worth knowing; the graph runs.
    Note,
}

/// One thing that is wrong.
#[derive(Debug, Clone)]
pub(crate) struct Problem {
    /// How bad it is.
    pub(crate) severity: Severity,
    /// Where; nowhere for what is wrong with no line in particular.
    pub(crate) place: Option<Place>,
    /// What is wrong.
    pub(crate) message: String,
    /// What to do.
    pub(crate) help: String,
    /// Other places that have to do with it, and how.
    pub(crate) related: Vec<(Place, String)>,
}

impl Problem {
    /// A reason to refuse the graph.
    pub(crate) fn error(place: &Place, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self {
            severity: Severity::Error,
            place: Some(place.clone()),
            message: files::clipped(&message.into(), WORDS_MAX),
            help: files::clipped(&help.into(), WORDS_MAX),
            related: Vec::new(),
        }
    }

    /// A reason to refuse the graph that no line holds.
    pub(crate) fn placeless(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self {
            severity: Severity::Error,
            place: None,
            message: files::clipped(&message.into(), WORDS_MAX),
            help: files::clipped(&help.into(), WORDS_MAX),
            related: Vec::new(),
        }
    }

    /// Something worth knowing.
    pub(crate) fn note(place: &Place, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { severity: Severity::Note, ..Self::error(place, message, help) }
    }

    /// The same with another place that has to do with it.
    pub(crate) fn see(mut self, place: &Place, how: impl Into<String>) -> Self {
        self.related.push((place.clone(), files::clipped(&how.into(), WORDS_MAX)));
        self
    }

    /// All of it for a person: headline, source line, caret, what to do.
    pub(crate) fn render(&self, palette: &Palette) -> String {
        let word = match self.severity {
            Severity::Error => palette.paint(palette.error, "error"),
            Severity::Note => palette.paint(palette.note, "note"),
        };
        let mut out = String::new();
        if let Some(place) = &self.place {
            let _ = write!(out, "{}: ", palette.paint(palette.strong, &place.to_string()));
        }
        let _ = writeln!(out, "{word}: {}", palette.paint(palette.strong, &self.message));
        let Some(place) = &self.place else {
            if !self.help.is_empty() {
                let _ = writeln!(out, "     {} {}", palette.paint(palette.frame, "="), self.help);
            }
            return out;
        };
        self.render_excerpt(place, palette, &mut out);
        for (other, how) in &self.related {
            let mark = palette.paint(palette.frame, "=");
            let _ = writeln!(out, "     {mark} {how}: {}", palette.paint(palette.strong, &other.to_string()));
        }
        out
    }

    fn render_excerpt(&self, place: &Place, palette: &Palette, out: &mut String) {
        let (line, column) = place.line_and_column();
        let bar = palette.paint(palette.frame, "|");
        let text: Vec<char> =
            place.line_text().chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect();
        // A long line is shown around the place in question.
        let from = if text.len() > LINE_MAX { (column - 1).saturating_sub(LINE_MAX / 3) } else { 0 };
        let shown: String = text.iter().skip(from).take(LINE_MAX).collect();
        let number = if place.source().is_file { line.to_string() } else { String::new() };
        let gutter = palette.paint(palette.frame, &format!("{number:>4}"));
        let _ = writeln!(out, "{gutter} {bar} {}", shown.trim_end());
        let indent = column - 1 - from;
        let room = shown.chars().count().saturating_sub(indent).max(1);
        let carets = "^".repeat(place.length().min(room));
        let style = if self.severity == Severity::Error { palette.error } else { palette.note };
        let marked = format!("{:indent$}{}", "", palette.paint(style, &carets));
        let width = indent + carets.len() + 1 + self.help.chars().count();
        if width <= LINE_MAX && !self.help.contains('\n') {
            let _ = writeln!(out, "     {bar} {marked} {}", self.help);
        } else {
            let _ = writeln!(out, "     {bar} {marked}");
            for line in self.help.lines() {
                let _ = writeln!(out, "     {} {line}", palette.paint(palette.frame, "="));
            }
        }
    }

    /// All of it for a program.
    pub(crate) fn to_json(&self) -> serde_json::Value {
        let at = |place: &Place| {
            let (line, column) = place.line_and_column();
            let line = place.source().is_file.then_some(line);
            serde_json::json!({ "file": place.source().name, "line": line, "column": column })
        };
        serde_json::json!({
            "severity": if self.severity == Severity::Error { "error" } else { "note" },
            "place": self.place.as_ref().map(at),
            "message": self.message,
            "help": self.help,
            "related": self.related.iter().map(|(place, how)| serde_json::json!({ "place": at(place), "how": how })).collect::<Vec<_>>(),
        })
    }
}

/// Nobody reads more of them; and each is looked up in its file.
const PROBLEMS_MAX: usize = 200;

/// Problems as they are found.
#[derive(Debug, Clone, Default)]
pub(crate) struct Problems {
    list: Vec<Problem>,
    /// Errors beyond those listed.
    more: usize,
}

impl Problems {
    /// One more.
    pub(crate) fn push(&mut self, problem: Problem) {
        if self.list.len() < PROBLEMS_MAX {
            self.list.push(problem);
        } else {
            self.more += usize::from(problem.severity == Severity::Error);
        }
    }

    /// All of another list.
    pub(crate) fn extend(&mut self, others: Problems) {
        others.list.into_iter().for_each(|problem| self.push(problem));
        self.more += others.more;
    }

    /// Whether one of them refuses the graph.
    pub(crate) fn refuse(&self) -> bool {
        self.more > 0 || self.list.iter().any(|problem| problem.severity == Severity::Error)
    }

    /// Errors beyond those listed.
    pub(crate) fn more(&self) -> usize {
        self.more
    }

    /// The problems, errors first, each kind in the order of files and lines.
    pub(crate) fn sorted(&self) -> Vec<&Problem> {
        let mut list: Vec<_> = self.list.iter().collect();
        list.sort_by_key(|problem| {
            let place = problem.place.as_ref();
            let place = place.map(|place| (place.source().name.clone(), place.start()));
            (problem.severity, place)
        });
        list
    }
}

/// Colours, or none.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Palette {
    /// What refuses.
    pub(crate) error: Style,
    /// What is worth knowing.
    pub(crate) note: Style,
    /// What is as it should be.
    pub(crate) good: Style,
    /// What matters.
    pub(crate) strong: Style,
    /// What frames it.
    pub(crate) frame: Style,
}

impl Palette {
    /// No colours.
    pub(crate) const PLAIN: Self = Self {
        error: Style::new(),
        note: Style::new(),
        good: Style::new(),
        strong: Style::new(),
        frame: Style::new(),
    };

    /// Colours if `stream` is a terminal and the user has nothing against them (<https://no-color.org>).
    pub(crate) fn of(stream: &impl std::io::IsTerminal) -> Self {
        let unwanted = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty())
            || std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        if unwanted || !stream.is_terminal() {
            return Self::PLAIN;
        }
        Self {
            error: AnsiColor::Red.on_default().bold(),
            note: AnsiColor::Yellow.on_default().bold(),
            good: AnsiColor::Green.on_default().bold(),
            strong: Style::new().bold(),
            frame: AnsiColor::Blue.on_default(),
        }
    }

    /// A text in a style.
    pub(crate) fn paint(&self, style: Style, text: &str) -> String {
        format!("{style}{text}{style:#}")
    }
}
