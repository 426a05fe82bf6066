//! FCL, the Fuzzy Control Language of IEC 61131-7:2000, read and written.
//!
//! Beyond the standard it reads what the field's tools share: named shapes (`TRIAN`, `Gaussian`, ...),
//! hedges, `RANGE` of inputs, also beside their declaration, `LOCK`, more norms, the accumulation in a rule
//! block or in an output, and rules without a closing semicolon. `IS any` needs no term, as in fuzzylite. One
//! file holds one function block. Keywords may be written in either case, names are taken as they are
//! written. What is given twice is refused: no second one wins in silence.

mod lexer;
mod parser;
mod rules;
mod words;
mod writer;

pub use parser::read;
pub use writer::write;

/// What is wrong with a text, and where.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("line {line}, column {column}: {kind}")]
pub struct FclError {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// What is wrong there.
    pub kind: FclErrorKind,
}

/// What can be wrong with a text.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FclErrorKind {
    /// Something else was expected.
    #[error("expected {expected}, found {found}")]
    Expected {
        /// What was expected.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// A character that no token begins with.
    #[error("the character {0:?} means nothing here")]
    Character(char),
    /// A number that cannot be read.
    #[error("{0} is no number")]
    Number(String),
    /// A comment without an end.
    #[error("the comment that begins here has no end")]
    OpenComment,
    /// A name that no variable has.
    #[error("there is no {kind} variable {name}")]
    UnknownVariable {
        /// "input" or "output".
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// A name that no term of the variable has.
    #[error("variable {variable} has no term {name}")]
    UnknownTerm {
        /// The variable.
        variable: String,
        /// The name.
        name: String,
    },
    /// A name that was given before.
    #[error("{0} is declared twice")]
    Twice(String),
    /// Something that may be said once.
    #[error("{0} is given twice here; keep one of the two")]
    Again(&'static str),
    /// The end of a comment that is over already.
    #[error("{}", stray(.ended))]
    StrayEnd {
        /// Line and column of the beginning and of the end of the comment before, if there was one.
        ended: Option<[usize; 4]>,
    },
    /// More of something than a controller of a robot has.
    #[error("more than {most} {what}")]
    TooMany {
        /// What, in words.
        what: &'static str,
        /// How many there may be.
        most: usize,
    },
    /// `any` of a variable without terms.
    #[error("variable {0} has no terms, so it is nothing, not even any")]
    AnyOfNothing(String),
    /// A keyword that is no operator, method or shape of its kind.
    #[error("{word} is no {kind}")]
    UnknownWord {
        /// What was expected, in words.
        kind: &'static str,
        /// The word.
        word: String,
    },
    /// A shape with the wrong count of numbers.
    #[error("{shape} does not take {count} numbers")]
    Count {
        /// The shape.
        shape: String,
        /// How many numbers it was given.
        count: usize,
    },
    /// A term whose numbers make no membership function.
    #[error("{0}")]
    Term(#[from] super::TermError),
    /// A universe whose lower end does not come first.
    #[error("the range from {0} to {1} is empty")]
    Range(f64, f64),
    /// A weight outside [0, 1].
    #[error("a weight lies in [0, 1], not {0}")]
    Weight(f64),
    /// A condition with more parts or deeper brackets than is reasonable.
    #[error("the condition has more than {0} parts or levels of brackets")]
    TooLong(usize),
}

fn stray(ended: &Option<[usize; 4]>) -> String {
    match ended {
        Some([line, column, end_line, end_column]) => format!(
            "a comment ends here that has not begun; comments do not nest: the one that begins in line {line}, column {column}, ended in line {end_line}, column {end_column}"
        ),
        None => "a comment ends here that has not begun".to_owned(),
    }
}
