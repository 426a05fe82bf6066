//! From characters to tokens with their places.

use super::{FclError, FclErrorKind};

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Token {
    Word(String),
    Number(f64),
    Symbol(&'static str),
    End,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Placed {
    pub(super) token: Token,
    pub(super) line: usize,
    pub(super) column: usize,
}

/// A system of ten thousand rules has as many.
const MOST_TOKENS: usize = 300_000;
/// Names stand in what is said about them.
const MOST_CHARACTERS: usize = 200;

/// The longest first.
const SYMBOLS: [&str; 11] = [":=", "..", ":", ";", "(", ")", ",", "|", "-", "+", "."];

impl std::fmt::Display for Token {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Word(word) => f.write_str(word),
            Self::Number(number) => write!(f, "{number}"),
            Self::Symbol(symbol) => write!(f, "'{symbol}'"),
            Self::End => f.write_str("the end of the text"),
        }
    }
}

struct Cursor<'a> {
    rest: &'a str,
    line: usize,
    column: usize,
    /// Where the last comment began, and where it ended.
    comment: Option<[usize; 4]>,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, bytes: usize) -> &'a str {
        let (taken, rest) = self.rest.split_at(bytes);
        for character in taken.chars() {
            (self.line, self.column) =
                if character == '\n' { (self.line + 1, 1) } else { (self.line, self.column + 1) };
        }
        self.rest = rest;
        taken
    }

    fn take_while(&mut self, test: impl Fn(char) -> bool) -> &'a str {
        let end = self.rest.find(|character| !test(character)).unwrap_or(self.rest.len());
        self.take(end)
    }

    fn error(&self, kind: FclErrorKind) -> FclError {
        FclError { line: self.line, column: self.column, kind }
    }

    /// Skips blanks and comments: `// ...`, `/* ... */`, `(* ... *)`.
    fn skip(&mut self) -> Result<(), FclError> {
        loop {
            self.take_while(|character| character.is_whitespace() || character == '\u{feff}');
            if self.rest.starts_with("//") {
                self.take_while(|character| character != '\n');
            } else if let Some(close) = [("/*", "*/"), ("(*", "*)")]
                .iter()
                .find(|(open, _)| self.rest.starts_with(open))
                .map(|pair| pair.1)
            {
                let end = self.rest[2..].find(close).ok_or_else(|| self.error(FclErrorKind::OpenComment))?;
                let begun = [self.line, self.column];
                self.take(end + 4);
                self.comment = Some([begun[0], begun[1], self.line, self.column - 1]);
            } else {
                return Ok(());
            }
        }
    }
}

/// All tokens, the last of them `End`.
pub(super) fn tokens(text: &str) -> Result<Vec<Placed>, FclError> {
    let mut cursor = Cursor { rest: text, line: 1, column: 1, comment: None };
    let mut all = Vec::new();
    loop {
        cursor.skip()?;
        let (line, column) = (cursor.line, cursor.column);
        let token = match cursor.rest.chars().next() {
            None => Token::End,
            Some(first) if first.is_alphabetic() || first == '_' => {
                let word = cursor.take_while(|character| character.is_alphanumeric() || character == '_');
                if word.chars().nth(MOST_CHARACTERS).is_some() {
                    let kind = FclErrorKind::TooMany { what: "characters in a name", most: MOST_CHARACTERS };
                    return Err(FclError { line, column, kind });
                }
                Token::Word(word.to_string())
            }
            Some(first) => {
                let length = number_length(cursor.rest);
                if length > 0 {
                    let digits = cursor.take(length);
                    let number = digits.replace('_', "").parse();
                    let number = number.map_err(|_| FclErrorKind::Number(files::in_brief(digits)));
                    Token::Number(number.map_err(|kind| FclError { line, column, kind })?)
                } else if let Some(symbol) = SYMBOLS.iter().find(|symbol| cursor.rest.starts_with(**symbol)) {
                    cursor.take(symbol.len());
                    Token::Symbol(symbol)
                } else if cursor.rest.starts_with("*)") || cursor.rest.starts_with("*/") {
                    return Err(cursor.error(FclErrorKind::StrayEnd { ended: cursor.comment }));
                } else {
                    return Err(cursor.error(FclErrorKind::Character(first)));
                }
            }
        };
        if all.len() >= MOST_TOKENS {
            return Err(cursor.error(FclErrorKind::TooMany { what: "words", most: MOST_TOKENS }));
        }
        let done = token == Token::End;
        all.push(Placed { token, line, column });
        if done {
            return Ok(all);
        }
    }
}

/// The length in bytes of the number that the text begins with, or 0. In `0..1` the number ends before the
/// dots. Between digits an underscore may stand, as in IEC 61131-3.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| {
        let is_digit = |at: usize| bytes.get(at).is_some_and(u8::is_ascii_digit);
        let belongs = |at: &usize| {
            is_digit(*at)
                || (bytes.get(*at) == Some(&b'_') && *at > from && is_digit(*at - 1) && is_digit(*at + 1))
        };
        (from..bytes.len()).take_while(belongs).count()
    };
    let sign = usize::from(matches!(bytes.first(), Some(b'-' | b'+')));
    let whole = digits(sign);
    let mut end = sign + whole;
    let mut fraction = 0;
    if bytes.get(end) == Some(&b'.') && bytes.get(end + 1) != Some(&b'.') {
        fraction = digits(end + 1);
        if whole + fraction > 0 {
            end += 1 + fraction;
        }
    }
    if whole + fraction == 0 {
        return 0;
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'-' | b'+')));
        let exponent = digits(end + 1 + sign);
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    end
}
