//! The part of YAML that map files use: one level of `key: value`, where a value is a word, a quoted text, or a list of
//! numbers in brackets or on lines of their own.

/// A value and where it stands.
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
}

/// What is wrong, and in which line.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct YamlError {
    pub(super) line: usize,
    pub(super) problem: String,
}

/// Reads the entries of a text, in their order.
pub(super) fn parse(text: &str) -> Result<Vec<Entry>, YamlError> {
    let mut entries: Vec<Entry> = Vec::new();
    let mut lines = text.trim_start_matches('\u{feff}').lines().enumerate();
    while let Some((index, raw)) = lines.next() {
        let line = index + 1;
        let fail = |problem: &str| YamlError { line, problem: problem.to_owned() };
        let content = without_comment(raw).trim_end();
        if content.trim().is_empty() || (entries.is_empty() && (content == "---" || content.starts_with('%')))
        {
            continue;
        }
        if content == "..." || content == "---" {
            break;
        }
        if let Some(item) = content.trim_start().strip_prefix("- ") {
            let Some(Entry { value: Value::List(list), .. }) = entries.last_mut() else {
                return Err(fail("a list item that belongs to no key"));
            };
            list.push(scalar(item).map_err(|problem| fail(&problem))?);
            continue;
        }
        if content.starts_with([' ', '\t']) {
            return Err(fail("an indented line: only `key: value` is understood"));
        }
        let (key, mut rest) = split_key(content).ok_or_else(|| fail("this is not `key: value`"))?;
        let key = scalar(key).map_err(|problem| fail(&problem))?;
        if entries.iter().any(|entry| entry.key == key) {
            return Err(fail(&format!("{key} is given twice")));
        }
        let mut joined = String::new();
        if rest.starts_with('[') && !rest.ends_with(']') {
            joined.push_str(rest);
            while !joined.trim_end().ends_with(']') {
                let (_, more) = lines.next().ok_or_else(|| fail("a list without its closing bracket"))?;
                joined.push(' ');
                joined.push_str(without_comment(more).trim());
            }
            rest = joined.trim_end();
        }
        let value = if let Some(inner) = rest.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
            let items = inner.trim().trim_end_matches(',');
            let items = items.split(',').filter(|_| !items.trim().is_empty()).map(scalar);
            Value::List(items.collect::<Result<_, _>>().map_err(|problem| fail(&problem))?)
        } else if rest.is_empty() {
            // Items on the following lines, or nothing at all.
            Value::List(Vec::new())
        } else {
            Value::Text(scalar(rest).map_err(|problem| fail(&problem))?)
        };
        entries.push(Entry { key, value, line });
    }
    Ok(entries)
}

fn split_key(content: &str) -> Option<(&str, &str)> {
    let end = content.find(": ").or_else(|| content.strip_suffix(':').map(str::len))?;
    Some((&content[..end], content[end + 1..].trim()))
}

/// The line up to a `#` that begins it or follows a space, outside of quotes.
fn without_comment(line: &str) -> &str {
    let mut quote = None;
    let mut before = ' ';
    let mut escaped = false;
    for (at, letter) in line.char_indices() {
        match quote {
            Some('"') if escaped => escaped = false,
            Some('"') if letter == '\\' => escaped = true,
            Some(open) if letter == open => quote = None,
            Some(_) => {}
            None if letter == '#' && before.is_whitespace() => return &line[..at],
            None if matches!(letter, '"' | '\'')
                && (before.is_whitespace() || matches!(before, '[' | ',')) =>
            {
                quote = Some(letter);
            }
            None => {}
        }
        before = letter;
    }
    line
}

/// A plain word, or a text in single or double quotes.
fn scalar(text: &str) -> Result<String, String> {
    let text = text.trim();
    if let Some(rest) = text.strip_prefix('\'') {
        let inner = rest.strip_suffix('\'').ok_or_else(|| format!("{text} has no closing quote"))?;
        return Ok(inner.replace("''", "'"));
    }
    let Some(rest) = text.strip_prefix('"') else {
        let special = text.starts_with(['&', '*', '!', '|', '>', '{', '}', '[', ']', '@', '`']);
        return if special { Err(format!("{text:?} is not understood here")) } else { Ok(text.to_owned()) };
    };
    let mut plain = String::new();
    let mut letters = rest.chars();
    loop {
        match letters.next() {
            None => return Err(format!("{text} has no closing quote")),
            Some('"') => break,
            Some('\\') => match letters.next() {
                Some('n') => plain.push('\n'),
                Some('t') => plain.push('\t'),
                Some(letter @ ('\\' | '"' | '/')) => plain.push(letter),
                other => return Err(format!("the escape \\{} is not understood", other.unwrap_or(' '))),
            },
            Some(letter) => plain.push(letter),
        }
    }
    if letters.as_str().is_empty() {
        Ok(plain)
    } else {
        Err(format!("text after the closing quote of {text}"))
    }
}

/// A text in double quotes that [`scalar`] reads back.
pub(super) fn quoted(text: &str) -> String {
    let escaped = text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n").replace('\t', "\\t");
    format!("\"{escaped}\"")
}
