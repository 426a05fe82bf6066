//! Values against the JSON schema of those who take them.
//!
//! A parameter's type, range and length stand in one place: at its field in the service's `Params`, from
//! which the schema is derived. The launcher checks a graph against it before anything starts, and a service
//! checks what it was given: by this code, in the same words.

use crate::unit_of;
use serde_json::{Map, Value};
use std::fmt;

/// What a service takes, as it describes it.
#[derive(Debug, Clone, Copy)]
pub struct Schema<'a> {
    /// The JSON schema of the whole table.
    pub root: &'a Value,
    /// The defaults of the whole table.
    pub defaults: &'a Value,
}

/// A value that does not fit. Its text tells what is wrong, and what would be right.
#[derive(Debug, Clone, PartialEq)]
pub struct Misfit {
    /// Where it stands, from the outermost table: the parameter's name first.
    pub path: Vec<Step>,
    /// What is wrong.
    pub fault: Box<Fault>,
    /// The default of the whole parameter, if it has one.
    pub default: Option<Value>,
}

/// A step into a value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// To the value of this key.
    Key(String),
    /// To this item, counted from 0.
    Item(usize),
}

/// What can be wrong with a value.
#[derive(Debug, Clone, PartialEq)]
pub enum Fault {
    /// Nothing has the last name of the path.
    Unknown {
        /// What there is.
        known: Vec<String>,
    },
    /// None of the texts that are allowed.
    NoChoice {
        /// Those.
        choices: Vec<String>,
        /// What is there.
        value: Value,
    },
    /// Another type.
    WrongType {
        /// The types that are allowed, as JSON schemas call them.
        wanted: Vec<String>,
        /// What is there.
        value: Value,
    },
    /// A number that is too small or too large. NaN, which JSON has no number for, is `null`.
    OutOfRange {
        /// The number.
        value: Value,
        /// What is allowed.
        bounds: Bounds,
    },
    /// Too few or too many values.
    WrongCount {
        /// How many.
        count: usize,
        /// At least.
        min: usize,
        /// At most.
        max: usize,
    },
    /// A table without something that it needs.
    Lacks {
        /// Its name.
        key: String,
    },
}

/// What a schema allows a number to be.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bounds {
    /// At least this.
    pub min: Option<f64>,
    /// At most this.
    pub max: Option<f64>,
    /// More than this.
    pub above: Option<f64>,
    /// Less than this.
    pub below: Option<f64>,
}

impl Bounds {
    fn of(schema: &Value) -> Self {
        let bound = |key: &str| schema.get(key).and_then(Value::as_f64);
        Self {
            min: bound("minimum"),
            max: bound("maximum"),
            above: bound("exclusiveMinimum"),
            below: bound("exclusiveMaximum"),
        }
    }

    /// Whether a number keeps them. NaN keeps none.
    pub fn hold(&self, number: f64) -> bool {
        !number.is_nan()
            && self.min.is_none_or(|min| number >= min)
            && self.max.is_none_or(|max| number <= max)
            && self.above.is_none_or(|above| number > above)
            && self.below.is_none_or(|below| number < below)
    }

    /// In words: `from 0.1 to 4 m`.
    pub fn in_words(&self, unit: &str) -> String {
        let unit = spaced(unit);
        if let (Some(min), Some(max)) = (self.min, self.max) {
            return format!("from {min} to {max}{unit}");
        }
        let lower = self.above.map(|above| format!("above {above}"));
        let lower = lower.or(self.min.map(|min| format!("at least {min}")));
        let upper = self.below.map(|below| format!("below {below}"));
        let upper = upper.or(self.max.map(|max| format!("at most {max}")));
        let both = lower.into_iter().chain(upper).collect::<Vec<_>>();
        if both.is_empty() { "a number".to_owned() } else { format!("{}{unit}", both.join(" and ")) }
    }
}

impl Misfit {
    /// The path as one reads it: `motion.gains[2]`.
    pub fn name(&self) -> String {
        let mut name = String::new();
        for step in &self.path {
            match step {
                Step::Key(key) if name.is_empty() => name.clone_from(key),
                Step::Key(key) => name = format!("{name}.{key}"),
                Step::Item(index) => name = format!("{name}[{index}]"),
            }
        }
        name
    }

    /// What is wrong. `of` is who takes it, in words that follow the parameter's name: empty, or
    /// `" of `planner`"`.
    pub fn what(&self, of: &str) -> String {
        let name = self.name();
        match &*self.fault {
            Fault::Unknown { .. } => format!("there is no parameter `{name}`{of}"),
            Fault::NoChoice { value: Value::String(text), .. } => {
                format!("`{name}`{of} cannot be \"{text}\"")
            }
            Fault::NoChoice { choices, value } => {
                format!("`{name}`{of} takes one of {}, not {}", in_quotes(choices), kind_of(value))
            }
            Fault::WrongType { wanted, value } => {
                let wanted: Vec<_> = wanted.iter().filter_map(|kind| kind_in_words(kind)).collect();
                format!("`{name}`{of} takes {}, not {}", wanted.join(" or "), kind_of(value))
            }
            Fault::OutOfRange { value: Value::Null, .. } => format!("`{name}`{of} is not a finite number"),
            Fault::OutOfRange { value, .. } => {
                format!("`{name}`{of} is {value}{}, which is out of range", spaced(self.unit()))
            }
            Fault::WrongCount { count, min, max } => {
                let wanted = match (min, max) {
                    (min, max) if min == max => min.to_string(),
                    (min, &usize::MAX) => format!("at least {min}"),
                    (min, max) => format!("{min} to {max}"),
                };
                format!("`{name}`{of} takes {wanted} values, not {count}")
            }
            Fault::Lacks { key } => format!("`{name}`{of} lacks `{key}`"),
        }
    }

    /// What would be right.
    pub fn remedy(&self) -> String {
        let default = self.default.as_ref();
        match &*self.fault {
            Fault::OutOfRange { bounds, .. } => {
                let default = default.filter(|default| default.is_number());
                let default =
                    default.map(|default| format!("; the default is {default}")).unwrap_or_default();
                format!("it must be {}{default}", bounds.in_words(self.unit()))
            }
            Fault::Lacks { key } => format!("add `{key} = ..`"),
            Fault::NoChoice { choices, .. } => format!("choose one of {}", in_quotes(choices)),
            Fault::Unknown { .. } | Fault::WrongType { .. } | Fault::WrongCount { .. } => default
                .map(|default| format!("the default is {default}"))
                .unwrap_or_else(|| "leave it out".to_owned()),
        }
    }

    /// The unit of the whole parameter.
    fn unit(&self) -> &'static str {
        match self.path.iter().rev().find(|step| matches!(step, Step::Key(_))) {
            Some(Step::Key(key)) => unit_of(key),
            _ => "",
        }
    }
}

impl fmt::Display for Misfit {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: {}", self.what(""), self.remedy())
    }
}

impl std::error::Error for Misfit {}

impl Schema<'_> {
    /// Whether there is a parameter of that name.
    pub fn has(&self, key: &str) -> bool {
        self.root.get("properties").and_then(|properties| properties.get(key)).is_some()
    }

    /// The names of the parameters.
    pub fn names(&self) -> Vec<&str> {
        properties_of(self.root)
            .map(|properties| properties.keys().map(String::as_str).collect())
            .unwrap_or_default()
    }

    /// All that does not fit in the value of one parameter.
    pub fn misfits(&self, key: &str, value: &Value) -> Vec<Misfit> {
        let mut walk = Walk {
            root: self.root,
            default: self.defaults.get(key),
            path: vec![Step::Key(key.to_owned())],
            misfits: Vec::new(),
        };
        match properties_of(self.root).and_then(|properties| properties.get(key)) {
            Some(schema) => walk.value(schema, value),
            None => walk.complain(Fault::Unknown { known: names(self.root) }),
        }
        walk.misfits
    }

    /// The first value of a whole table that does not fit.
    pub fn first_misfit(&self, values: &Value) -> Option<Misfit> {
        let values = values.as_object()?.iter();
        values.flat_map(|(key, value)| self.misfits(key, value)).next()
    }
}

/// How many references are followed: a broken schema may point in circles.
const REFERENCES_MAX: usize = 16;

struct Walk<'a> {
    root: &'a Value,
    default: Option<&'a Value>,
    path: Vec<Step>,
    misfits: Vec<Misfit>,
}

impl<'a> Walk<'a> {
    fn complain(&mut self, fault: Fault) {
        self.misfits.push(Misfit {
            path: self.path.clone(),
            fault: fault.into(),
            default: self.default.cloned(),
        });
    }

    fn within(&mut self, step: Step, schema: &'a Value, value: &Value) {
        self.path.push(step);
        self.value(schema, value);
        self.path.pop();
    }

    fn value(&mut self, schema: &'a Value, value: &Value) {
        let schema = self.resolve(schema);
        if let Some(choices) = self.choices(schema) {
            let fits = value.as_str().is_some_and(|text| choices.contains(&text));
            if !fits {
                let choices = choices.into_iter().map(str::to_owned).collect();
                self.complain(Fault::NoChoice { choices, value: value.clone() });
            }
            return;
        }
        for all in schema.get("allOf").and_then(Value::as_array).into_iter().flatten() {
            self.value(all, value);
        }
        let options = schema.get("anyOf").or_else(|| schema.get("oneOf")).and_then(Value::as_array);
        if let Some(options) = options {
            return self.any(options, value);
        }
        let kinds = kinds(schema);
        let is_numeric = kinds.iter().any(|kind| matches!(*kind, "number" | "integer"));
        if !kinds.is_empty() && !kinds.iter().any(|kind| is_kind(value, kind)) {
            self.complain(if is_numeric && value.is_null() {
                Fault::OutOfRange { value: Value::Null, bounds: Bounds::of(schema) }
            } else {
                let wanted = kinds.into_iter().map(str::to_owned).collect();
                Fault::WrongType { wanted, value: value.clone() }
            });
            return;
        }
        match value {
            Value::Number(number) => {
                let bounds = Bounds::of(schema);
                if number.as_f64().is_some_and(|number| !bounds.hold(number)) {
                    self.complain(Fault::OutOfRange { value: value.clone(), bounds });
                }
            }
            Value::Array(items) => self.array(schema, items),
            Value::Object(table) => self.table(schema, table),
            _ => {}
        }
    }

    fn resolve(&self, schema: &'a Value) -> &'a Value {
        let mut schema = schema;
        for _ in 0..REFERENCES_MAX {
            let Some(target) = schema.get("$ref").and_then(Value::as_str) else { break };
            match target.strip_prefix('#').and_then(|pointer| self.root.pointer(pointer)) {
                Some(found) => schema = found,
                None => break,
            }
        }
        schema
    }

    /// The texts that a schema allows, when it allows nothing but certain texts.
    fn choices(&self, schema: &'a Value) -> Option<Vec<&'a str>> {
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

    fn any(&mut self, options: &'a [Value], value: &Value) {
        let mut best: Option<(bool, Vec<Misfit>)> = None;
        for option in options {
            let before = self.misfits.len();
            self.value(option, value);
            let found = self.misfits.split_off(before);
            if found.is_empty() {
                return;
            }
            // Blame the option whose type fits; `null` is written by nobody.
            let kinds = kinds(self.resolve(option));
            if kinds == ["null"] {
                continue;
            }
            let fits = kinds.iter().any(|kind| is_kind(value, kind));
            let is_better = best.as_ref().is_none_or(|(known, misfits)| {
                (fits, std::cmp::Reverse(found.len())) > (*known, std::cmp::Reverse(misfits.len()))
            });
            if is_better {
                best = Some((fits, found));
            }
        }
        self.misfits.extend(best.map(|(_, found)| found).unwrap_or_default());
    }

    fn array(&mut self, schema: &'a Value, items: &[Value]) {
        let bound =
            |key: &str| schema.get(key).and_then(Value::as_u64).and_then(|count| usize::try_from(count).ok());
        let (min, max) = (bound("minItems").unwrap_or(0), bound("maxItems").unwrap_or(usize::MAX));
        if !(min..=max).contains(&items.len()) {
            self.complain(Fault::WrongCount { count: items.len(), min, max });
        }
        let each = schema.get("items").filter(|each| each.is_object());
        let first = schema.get("prefixItems").and_then(Value::as_array);
        for (index, item) in items.iter().enumerate() {
            if let Some(inner) = first.and_then(|first| first.get(index)).or(each) {
                self.within(Step::Item(index), inner, item);
            }
        }
    }

    fn table(&mut self, schema: &'a Value, table: &Map<String, Value>) {
        let properties = properties_of(schema);
        let others = schema.get("additionalProperties");
        for (key, value) in table {
            if let Some(inner) = properties.and_then(|properties| properties.get(key)) {
                self.within(Step::Key(key.clone()), inner, value);
            } else if properties.is_some() && others == Some(&Value::Bool(false)) {
                self.path.push(Step::Key(key.clone()));
                self.complain(Fault::Unknown { known: names(schema) });
                self.path.pop();
            } else if let Some(inner) = others.filter(|inner| inner.is_object()) {
                // A map: any names, values of one type.
                self.within(Step::Key(key.clone()), inner, value);
            }
        }
        let required = schema.get("required").and_then(Value::as_array).into_iter().flatten();
        for key in required.filter_map(Value::as_str).filter(|_| properties.is_some()) {
            if !table.contains_key(key) {
                self.complain(Fault::Lacks { key: key.to_owned() });
            }
        }
    }
}

fn properties_of(schema: &Value) -> Option<&Map<String, Value>> {
    schema.get("properties").and_then(Value::as_object)
}

fn names(schema: &Value) -> Vec<String> {
    properties_of(schema).map(|properties| properties.keys().cloned().collect()).unwrap_or_default()
}

fn kinds(schema: &Value) -> Vec<&str> {
    match schema.get("type") {
        Some(Value::String(kind)) => vec![kind],
        Some(Value::Array(kinds)) => kinds.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    }
}

fn is_kind(value: &Value, kind: &str) -> bool {
    match (value, kind) {
        (Value::Null, "null")
        | (Value::String(_), "string")
        | (Value::Bool(_), "boolean")
        | (Value::Array(_), "array")
        | (Value::Object(_), "object")
        | (Value::Number(_), "number") => true,
        (Value::Number(number), "integer") => !number.is_f64(),
        _ => false,
    }
}

fn kind_of(value: &Value) -> &'static str {
    match value {
        Value::Null => "nothing",
        Value::String(_) => "a text",
        Value::Bool(_) => "a boolean",
        Value::Array(_) => "an array",
        Value::Object(_) => "a table",
        Value::Number(number) if number.is_f64() => "a fraction",
        Value::Number(_) => "an integer",
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

fn in_quotes(choices: &[String]) -> String {
    choices.iter().map(|choice| format!("\"{choice}\"")).collect::<Vec<_>>().join(", ")
}

fn spaced(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(" {unit}") }
}

#[cfg(test)]
mod tests;
