//! A commented table for a graph file, from the schema of a service's parameters.

use crate::interface::About;
use serde_json::Value;
use std::fmt::Write as _;

/// A table with every parameter at its default, its meaning and its range above it.
pub(crate) fn table(about: About, schema: &Value, defaults: &Value) -> String {
    let mut text = format!("# {}\n[{}]\n", about.description, about.name);
    let Some(defaults) = defaults.as_object() else { return text };
    for (name, default) in defaults {
        let property = resolve(schema, &schema["properties"][name]);
        for line in property["description"]
            .as_str()
            .or(schema["properties"][name]["description"].as_str())
            .unwrap_or("")
            .lines()
        {
            let _ = writeln!(text, "# {}", line.trim());
        }
        let range: Vec<String> = [("minimum", "at least"), ("maximum", "at most")]
            .iter()
            .filter_map(|(key, words)| property.get(*key).map(|limit| format!("{words} {limit}")))
            .collect();
        if !range.is_empty() {
            let _ = writeln!(text, "# ({})", range.join(", "));
        }
        let names: Vec<&str> = variants(property);
        if !names.is_empty() {
            let _ = writeln!(text, "# one of {}", names.join(" | "));
        }
        match toml_value(default) {
            Some(value) => _ = writeln!(text, "{name} = {value}"),
            None => _ = writeln!(text, "# {name} = (not set)"),
        }
    }
    text
}

fn resolve<'a>(schema: &'a Value, property: &'a Value) -> &'a Value {
    let reference = property["$ref"].as_str().or_else(|| property["allOf"][0]["$ref"].as_str());
    reference.and_then(|path| schema.pointer(path.trim_start_matches('#'))).unwrap_or(property)
}

fn variants(property: &Value) -> Vec<&str> {
    let plain = property["enum"].as_array().into_iter().flatten().filter_map(Value::as_str);
    let documented =
        property["oneOf"].as_array().into_iter().flatten().filter_map(|item| item["const"].as_str());
    plain.chain(documented).collect()
}

fn toml_value(value: &Value) -> Option<String> {
    match value {
        Value::Null => None,
        Value::Array(items) => {
            Some(format!("[{}]", items.iter().filter_map(toml_value).collect::<Vec<_>>().join(", ")))
        }
        Value::Object(fields) => {
            let pairs =
                fields.iter().filter_map(|(key, value)| Some(format!("{key} = {}", toml_value(value)?)));
            Some(format!("{{ {} }}", pairs.collect::<Vec<_>>().join(", ")))
        }
        Value::String(text) => Some(toml::Value::String(text.clone()).to_string()),
        plain => Some(plain.to_string()),
    }
}
