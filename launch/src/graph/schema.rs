//! Parameters against the JSON schema that their service hands out.

use super::problem::{Problem, Problems};
use super::suggest::{nearest, quoted};
use super::tree::{Content, Entry, Node};
use messages::unit_of;
use serde_json::Value;

/// How many names are listed where none resembles the one given.
const NAMES_MAX: usize = 8;

/// A service's parameters as it describes them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Schema<'a> {
    /// Who takes them.
    pub(crate) service: &'a str,
    /// The JSON schema.
    pub(crate) root: &'a Value,
    /// The defaults.
    pub(crate) defaults: &'a Value,
}

impl Schema<'_> {
    /// Whether there is a parameter of that name.
    pub(crate) fn has(&self, key: &str) -> bool {
        self.root.get("properties").and_then(|properties| properties.get(key)).is_some()
    }

    /// The names of the parameters.
    pub(crate) fn names(&self) -> Vec<&str> {
        names_of(self.root)
    }

    /// Checks one parameter by name, type and range.
    pub(crate) fn check(&self, entry: &Entry, problems: &mut Problems) {
        let Some(schema) = self.root.get("properties").and_then(|properties| properties.get(&entry.key))
        else {
            problems.push(unknown(self.service, entry, &self.names()));
            return;
        };
        let default = self.defaults.get(&entry.key);
        Walk { root: self.root, service: self.service, default }.value(
            schema,
            &entry.key,
            &entry.value,
            problems,
        );
    }
}

struct Walk<'a> {
    root: &'a Value,
    service: &'a str,
    // The default of the whole parameter, for what to do.
    default: Option<&'a Value>,
}

impl Walk<'_> {
    fn value(&self, schema: &Value, path: &str, node: &Node, problems: &mut Problems) {
        if node.is_nonsense() {
            return;
        }
        let schema = self.resolve(schema);
        if let Some(choices) = self.choices(schema) {
            return self.choice(&choices, path, node, problems);
        }
        for all in schema.get("allOf").and_then(Value::as_array).into_iter().flatten() {
            self.value(all, path, node, problems);
        }
        let options = schema.get("anyOf").or_else(|| schema.get("oneOf")).and_then(Value::as_array);
        if let Some(options) = options {
            return self.any(options, path, node, problems);
        }
        let kinds = kinds_of(schema);
        if !kinds.is_empty() && !kinds.iter().any(|kind| is_kind(node, kind)) {
            problems.push(self.wrong_type(&kinds, path, node));
            return;
        }
        match &node.content {
            Content::Number(_) => self.range(schema, path, node, problems),
            Content::Array(items) => self.array(schema, path, node, items, problems),
            Content::Table(table) if schema.get("properties").is_some() => {
                self.table(schema, path, node, &table.entries, problems);
            }
            Content::Table(table) => {
                // A map: any names, values of one type.
                if let Some(inner) = schema.get("additionalProperties").filter(|inner| inner.is_object()) {
                    for entry in &table.entries {
                        self.value(inner, &format!("{path}.{}", entry.key), &entry.value, problems);
                    }
                }
            }
            _ => {}
        }
    }

    fn resolve<'s>(&'s self, schema: &'s Value) -> &'s Value {
        let mut schema = schema;
        // A broken schema may point in circles.
        for _ in 0..16 {
            let Some(target) = schema.get("$ref").and_then(Value::as_str) else { break };
            match target.strip_prefix('#').and_then(|pointer| self.root.pointer(pointer)) {
                Some(found) => schema = found,
                None => break,
            }
        }
        schema
    }

    /// The texts a schema allows, when it allows nothing but certain texts.
    fn choices<'s>(&'s self, schema: &'s Value) -> Option<Vec<&'s str>> {
        if let Some(list) = schema.get("enum").and_then(Value::as_array) {
            return list.iter().map(Value::as_str).collect();
        }
        if let Some(single) = schema.get("const") {
            return single.as_str().map(|single| vec![single]);
        }
        let options = schema.get("oneOf").or_else(|| schema.get("anyOf"))?.as_array()?;
        let lists: Option<Vec<_>> = options.iter().map(|option| self.choices(self.resolve(option))).collect();
        lists.map(|lists| lists.concat())
    }

    fn choice(&self, choices: &[&str], path: &str, node: &Node, problems: &mut Problems) {
        let list = choices.iter().map(|choice| format!("\"{choice}\"")).collect::<Vec<_>>().join(", ");
        let Some(text) = node.text() else {
            let message = format!("`{path}` of `{}` takes one of {list}, not {}", self.service, node.kind());
            problems.push(Problem::error(&node.place, message, self.default_help(path)));
            return;
        };
        if !choices.contains(&text) {
            let message = format!("`{path}` of `{}` cannot be \"{text}\"", self.service);
            let help = match nearest(text, choices.iter().copied()) {
                Some(choice) => format!("did you mean \"{choice}\"?"),
                None => format!("choose one of {list}"),
            };
            problems.push(Problem::error(&node.place, message, help));
        }
    }

    fn any(&self, options: &[Value], path: &str, node: &Node, problems: &mut Problems) {
        let mut best: Option<(bool, Problems)> = None;
        for option in options {
            let mut found = Problems::default();
            self.value(option, path, node, &mut found);
            if found.len() == 0 {
                return;
            }
            // Blame the option whose type fits; "null" fits nothing that TOML can write.
            let kinds = kinds_of(self.resolve(option));
            if kinds == ["null"] {
                continue;
            }
            let fits = kinds.iter().any(|kind| is_kind(node, kind));
            let better = best.as_ref().is_none_or(|(known, problems)| {
                (fits, std::cmp::Reverse(found.len())) > (*known, std::cmp::Reverse(problems.len()))
            });
            if better {
                best = Some((fits, found));
            }
        }
        problems.extend(best.map(|(_, found)| found).unwrap_or_default());
    }

    fn range(&self, schema: &Value, path: &str, node: &Node, problems: &mut Problems) {
        let Some(number) = node.number() else { return };
        let bound = |key: &str| schema.get(key).and_then(Value::as_f64);
        let (min, max) = (bound("minimum"), bound("maximum"));
        let (above, below) = (bound("exclusiveMinimum"), bound("exclusiveMaximum"));
        let fits = min.is_none_or(|min| number >= min)
            && max.is_none_or(|max| number <= max)
            && above.is_none_or(|above| number > above)
            && below.is_none_or(|below| number < below);
        if fits {
            return;
        }
        let unit = unit_of(path.split(['.', '[']).next().unwrap_or(path));
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        let lower = above.map(|above| format!("above {above}")).or(min.map(|min| format!("at least {min}")));
        let upper = below.map(|below| format!("below {below}")).or(max.map(|max| format!("at most {max}")));
        let wanted = match (min, max, lower, upper) {
            (Some(min), Some(max), ..) => format!("from {min} to {max}{unit}"),
            (.., Some(lower), Some(upper)) => format!("{lower} and {upper}{unit}"),
            (.., lower, upper) => format!("{}{unit}", lower.or(upper).unwrap_or_default()),
        };
        let message = format!(
            "`{path}` of `{}` is {}{unit}, which is out of range",
            self.service,
            node.place.text().trim()
        );
        let help = format!("it must be {wanted}{}", self.default_clause());
        problems.push(Problem::error(&node.place, message, help));
    }

    fn array(&self, schema: &Value, path: &str, node: &Node, items: &[Node], problems: &mut Problems) {
        let bound =
            |key: &str| schema.get(key).and_then(Value::as_u64).and_then(|count| usize::try_from(count).ok());
        let (min, max) = (bound("minItems").unwrap_or(0), bound("maxItems").unwrap_or(usize::MAX));
        if !(min..=max).contains(&items.len()) {
            let wanted = if min == max {
                min.to_string()
            } else if max == usize::MAX {
                format!("at least {min}")
            } else {
                format!("{min} to {max}")
            };
            let message =
                format!("`{path}` of `{}` takes {wanted} values, not {}", self.service, items.len());
            problems.push(Problem::error(&node.place, message, self.default_help(path)));
        }
        let each = schema.get("items").filter(|each| each.is_object());
        let first = schema.get("prefixItems").and_then(Value::as_array);
        for (index, item) in items.iter().enumerate() {
            if let Some(inner) = first.and_then(|first| first.get(index)).or(each) {
                self.value(inner, &format!("{path}[{index}]"), item, problems);
            }
        }
    }

    fn table(&self, schema: &Value, path: &str, node: &Node, entries: &[Entry], problems: &mut Problems) {
        let known = names_of(schema);
        for entry in entries {
            match schema.get("properties").and_then(|properties| properties.get(&entry.key)) {
                Some(inner) => self.value(inner, &format!("{path}.{}", entry.key), &entry.value, problems),
                None if schema
                    .get("additionalProperties")
                    .is_some_and(|more| more == &Value::Bool(false)) =>
                {
                    problems.push(unknown(&format!("{}.{path}", self.service), entry, &known));
                }
                None => {}
            }
        }
        let required = schema.get("required").and_then(Value::as_array).into_iter().flatten();
        for key in required.filter_map(Value::as_str) {
            if !entries.iter().any(|entry| entry.key == key) {
                let message = format!("`{path}` of `{}` lacks `{key}`", self.service);
                problems.push(Problem::error(&node.place, message, format!("add `{key} = ..`")));
            }
        }
    }

    fn wrong_type(&self, kinds: &[&str], path: &str, node: &Node) -> Problem {
        let wanted: Vec<_> = kinds.iter().filter_map(|kind| kind_in_words(kind)).collect();
        let message =
            format!("`{path}` of `{}` takes {}, not {}", self.service, wanted.join(" or "), node.kind());
        // A number in quotes, the most common slip, and a fraction where an integer is meant.
        let bare = node.text().map(str::trim).filter(|text| text.parse::<f64>().is_ok_and(f64::is_finite));
        let whole = node.number().filter(|_| kinds.contains(&"integer"));
        let help = match (bare, whole) {
            (Some(bare), _) if kinds.contains(&"number") || kinds.contains(&"integer") => {
                // As TOML has it, which wants a digit before the point.
                let bare = bare.parse::<f64>().map_or(bare.to_owned(), |number| number.to_string());
                format!("write `{path} = {bare}`, without quotes")
            }
            (_, Some(number)) => format!("write a whole number, such as {}", number.round()),
            _ => self.default_help(path),
        };
        Problem::error(&node.place, message, help)
    }

    fn default_help(&self, path: &str) -> String {
        let key = path.split(['.', '[']).next().unwrap_or(path);
        match self.default.map(in_toml) {
            Some(default) if default.len() <= 60 => format!("the default is `{key} = {default}`"),
            _ => format!("`{} --example` shows how it is written", self.service),
        }
    }

    fn default_clause(&self) -> String {
        match self.default {
            Some(default @ Value::Number(_)) => format!("; the default is {default}"),
            _ => String::new(),
        }
    }
}

fn unknown(service: &str, entry: &Entry, known: &[&str]) -> Problem {
    let message = format!("`{service}` has no parameter `{}`", entry.key);
    let stem = |name: &str| name.strip_suffix(suffix_of(name)).unwrap_or(name).to_owned();
    let other_unit = known.iter().find(|name| stem(name) == stem(&entry.key) && **name != entry.key);
    let help = match (other_unit, nearest(&entry.key, known.iter().copied())) {
        (Some(name), _) if !suffix_of(name).is_empty() => {
            format!("give it in {}: `{name}`", unit_of(name))
        }
        (_, Some(name)) => format!("did you mean `{name}`?"),
        _ if known.is_empty() => "it takes none; remove the line".to_owned(),
        _ => {
            let more = known.len().saturating_sub(NAMES_MAX);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            format!("it has {}{more}", quoted(known.iter().copied().take(NAMES_MAX)))
        }
    };
    Problem::error(&entry.key_place, message, help)
}

/// The part of a name that is its unit, with the underscore.
fn suffix_of(name: &str) -> &str {
    if unit_of(name).is_empty() {
        return "";
    }
    let long = ["_m_per_s2", "_m_per_s", "_rad_per_s"].iter().find(|suffix| name.ends_with(**suffix));
    match long {
        Some(suffix) => &name[name.len() - suffix.len()..],
        None => name.rfind('_').map_or("", |start| &name[start..]),
    }
}

fn names_of(schema: &Value) -> Vec<&str> {
    let properties = schema.get("properties").and_then(Value::as_object);
    properties.map(|properties| properties.keys().map(String::as_str).collect()).unwrap_or_default()
}

fn kinds_of(schema: &Value) -> Vec<&str> {
    match schema.get("type") {
        Some(Value::String(kind)) => vec![kind],
        Some(Value::Array(kinds)) => kinds.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    }
}

fn is_kind(node: &Node, kind: &str) -> bool {
    match (&node.content, kind) {
        (Content::Text(_), "string")
        | (Content::Boolean(_), "boolean")
        | (Content::Array(_), "array")
        | (Content::Table(_), "object")
        | (Content::Number(_), "number") => true,
        (Content::Number(number), "integer") => !number.is_f64(),
        _ => false,
    }
}

fn kind_in_words(kind: &str) -> Option<&'static str> {
    Some(match kind {
        "string" => "a text",
        "boolean" => "true or false",
        "array" => "an array",
        "object" => "a table",
        "number" => "a number",
        "integer" => "an integer",
        _ => return None,
    })
}

fn in_toml(value: &Value) -> String {
    match value {
        Value::Object(fields) => {
            let fields: Vec<_> =
                fields.iter().map(|(key, value)| format!("{key} = {}", in_toml(value))).collect();
            format!("{{ {} }}", fields.join(", "))
        }
        Value::Array(items) => format!("[{}]", items.iter().map(in_toml).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}
