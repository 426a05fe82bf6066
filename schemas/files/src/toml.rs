//! The door for TOML that people write.
//!
//! The parser descends once for each bracket that stands open, and its own guard against too many of them is
//! talked out of its count by closing brackets that open nothing: twenty thousand lines of `{ a =.0]` end the
//! process. What is read here has been counted before.

use std::ops::Range;

use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Error};
use toml_parser::{Source, lexer::TokenKind};

/// Brackets that stand open at once, and parts of the dotted keys within them.
const NESTING_MAX: usize = 64;

/// What is said of more.
const TOO_DEEP: &str = "brackets and dotted keys are more than 64 deep in each other";

/// A text that is no TOML, or not what was to be read.
#[derive(Debug, thiserror::Error)]
pub enum TomlError {
    /// The parser refuses it.
    #[error("{0}")]
    Malformed(#[from] Error),
    /// Too much in each other.
    #[error("line {line}: {TOO_DEEP}")]
    TooDeep {
        /// Line, counted from 1.
        line: usize,
        /// Where in the text, in bytes.
        span: Range<usize>,
    },
}

impl TomlError {
    /// Why, without the place.
    pub fn message(&self) -> &str {
        match self {
            Self::Malformed(error) => error.message(),
            Self::TooDeep { .. } => TOO_DEEP,
        }
    }

    /// Where, in bytes of the text, if it is known.
    pub fn span(&self) -> Option<Range<usize>> {
        match self {
            Self::Malformed(error) => error.span(),
            Self::TooDeep { span, .. } => Some(span.clone()),
        }
    }
}

/// Reads a TOML document.
#[expect(clippy::disallowed_methods, reason = "here its depth is known")]
pub fn parse<T: DeserializeOwned>(text: &str) -> Result<T, TomlError> {
    check_depth(text)?;
    Ok(toml::from_str(text)?)
}

/// Reads a TOML document with the places of its values: what could be read, and every mistake.
pub fn parse_recoverable(text: &str) -> Result<(Spanned<DeTable<'_>>, Vec<TomlError>), TomlError> {
    check_depth(text)?;
    let (table, errors) = DeTable::parse_recoverable(text);
    Ok((table, errors.into_iter().map(TomlError::Malformed).collect()))
}

/// Reads a single TOML value with its place.
#[expect(clippy::disallowed_methods, reason = "here its depth is known")]
pub fn parse_value(text: &str) -> Result<Spanned<DeValue<'_>>, TomlError> {
    check_depth(text)?;
    Ok(DeValue::parse(text)?)
}

/// Counts as many brackets as the parser can have open at each place, or more: all that open, less those that
/// are closed by their like. A key `a.b.c` makes a table in a table in a table without a bracket.
fn check_depth(text: &str) -> Result<(), TomlError> {
    let mut open: Vec<(TokenKind, usize)> = Vec::new();
    let mut dots = 0;
    let mut depth = 0;
    for token in Source::new(text).lex() {
        match token.kind() {
            kind @ (TokenKind::LeftCurlyBracket | TokenKind::LeftSquareBracket) => {
                open.push((kind, dots));
                dots = 0;
                depth += 1;
            }
            kind @ (TokenKind::RightCurlyBracket | TokenKind::RightSquareBracket) => {
                let opening = if kind == TokenKind::RightCurlyBracket {
                    TokenKind::LeftCurlyBracket
                } else {
                    TokenKind::LeftSquareBracket
                };
                if let Some((_, outer)) = open.pop_if(|(innermost, _)| *innermost == opening) {
                    depth -= dots + 1;
                    dots = outer;
                }
            }
            TokenKind::Dot => {
                dots += 1;
                depth += 1;
            }
            TokenKind::Comma | TokenKind::Newline => {
                depth -= dots;
                dots = 0;
            }
            _ => {}
        }
        if depth > NESTING_MAX {
            let span = token.span().start()..token.span().end();
            let line = text.get(..span.start).unwrap_or_default().matches('\n').count() + 1;
            return Err(TomlError::TooDeep { line, span });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn depth_is_refused(text: &str) -> bool {
        matches!(parse::<toml::Table>(text), Err(TomlError::TooDeep { .. }))
    }

    #[test]
    fn what_people_write_is_read() {
        let text = "a.b = { c = [[1.5, 2.5], [{ d = \"[[[[\" }]] } # [[[\n[e.f]\ng = '{'\n[[h]]\ni = 1.25\n";
        let table: toml::Table = parse(text).unwrap();
        assert_eq!(table["a"]["b"]["c"][0][1].as_float(), Some(2.5));
        let long: String =
            (0..1000).map(|at| format!("[[place]]\nat = [{at}.5, {{ x.y = 2.5 }}]\n")).collect();
        assert_eq!(parse::<toml::Table>(&long).unwrap()["place"].as_array().unwrap().len(), 1000);
        let deepest = format!("a = {}{}", "[".repeat(NESTING_MAX), "]".repeat(NESTING_MAX));
        assert!(parse::<toml::Table>(&deepest).is_ok());
        assert!(depth_is_refused(&format!(
            "a = {}{}",
            "[".repeat(NESTING_MAX + 1),
            "]".repeat(NESTING_MAX + 1)
        )));
    }

    /// Each ended the process by its stack, or would have in the next release of the parser.
    #[test]
    fn depth_is_refused_before_the_parser_descends() {
        let many = 200_000;
        for text in [
            "{ passes =.0]\n".repeat(many),
            format!("a = {}", "{ b =.0] ".repeat(many)),
            format!("a = {}", "{ b = [ } ".repeat(many)),
            format!("a = {}", "[".repeat(many)),
            format!("a = {}", "{b=".repeat(many)),
            format!("{}a = 1", "a.".repeat(many)),
            format!("[{}a]", "a.".repeat(many)),
            format!("a = {}", "{ b.b.b.b.b.b.b.b = ".repeat(many)),
        ] {
            assert!(depth_is_refused(&text), "{}", crate::in_brief(&text));
            assert!(matches!(parse_recoverable(&text), Err(TomlError::TooDeep { .. })));
            assert!(matches!(parse_value(&text), Err(TomlError::TooDeep { .. })));
        }
        let error = parse::<toml::Table>(&format!("a = 1\nb = {}", "[".repeat(many))).unwrap_err();
        assert_eq!(error.to_string(), "line 2: brackets and dotted keys are more than 64 deep in each other");
        assert_eq!(error.span(), Some(74..75));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Long texts of little pieces, on a stack that 1000 open brackets would overflow.
        #[test]
        fn no_text_takes_the_parser_deep(
            pieces in proptest::collection::vec(proptest::sample::select(vec![
                "[", "]", "{", "}", "a", " = ", ".", ",", "\n", "1", "\"", "'", "#", "{ a =", "{ a =.0]", "[ } ",
            ]), 1..12),
        ) {
            let text = format!("k = {}", pieces.concat().repeat(3000));
            let reader = std::thread::Builder::new().stack_size(1 << 19);
            let read = reader.spawn(move || drop(parse_recoverable(&text))).unwrap();
            prop_assert!(read.join().is_ok());
        }
    }
}
