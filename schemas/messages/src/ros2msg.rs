//! A message's description as a ROS 2 message definition, so that the tools of that world read our
//! recordings.
//!
//! The text follows <https://docs.ros.org/en/rolling/Concepts/Basic/About-Interfaces.html>, several
//! definitions in one as MCAP's `ros2msg` encoding wants it (<https://mcap.dev/spec/registry#ros2msg>). A
//! state becomes a `uint32` with its names as constants before it, a text `uint8[N]`, a nested record a
//! definition of its own, and the elements behind the fixed part a sequence called `elements`.

use crate::{Description, FieldDescription, Kind};
use std::collections::{BTreeSet, VecDeque};
use std::fmt::Write as _;

/// The package that our messages appear in.
pub const PACKAGE: &str = "corkboard";
/// The name of the sequence that holds the elements.
const ELEMENTS: &str = "elements";
/// What ROS 2 puts into a message without fields; one byte on the wire.
const PLACEHOLDER: &str = "uint8 structure_needs_at_least_one_member";

impl Description {
    /// The name under which the message appears in ROS 2: `corkboard/msg/Odometry`.
    pub fn ros2msg_name(&self) -> String {
        format!("{PACKAGE}/msg/{}", type_name(&self.name))
    }

    /// The definition as text, with those of the nested records behind it.
    pub fn ros2msg(&self) -> String {
        let mut writer =
            Writer { queue: VecDeque::new(), known: vec![(type_name(&self.name), without_elements(self))] };
        let mut text = writer.definition(self);
        while let Some((name, description)) = writer.queue.pop_front() {
            let _ = writeln!(text, "{}\nMSG: {PACKAGE}/{name}", "=".repeat(80));
            text.push_str(&writer.definition(&description));
        }
        text
    }
}

/// What a value of this kind is in a definition without arrays of arrays: the type of one, and how many.
pub fn flattened(kind: &Kind) -> (&Kind, usize) {
    match kind {
        Kind::Array { of, count } => {
            let (inner, times) = flattened(of);
            (inner, times.saturating_mul(*count))
        }
        Kind::Text { capacity } => (&Kind::U8, *capacity),
        other => (other, 1),
    }
}

struct Writer {
    /// Records that were named and have no definition yet.
    queue: VecDeque<(String, Description)>,
    /// The types named so far.
    known: Vec<(String, Description)>,
}

impl Writer {
    fn definition(&mut self, description: &Description) -> String {
        let mut text = String::new();
        if !description.doc.is_empty() {
            let _ = writeln!(text, "# {}", one_line(&description.doc));
        }
        let mut fields = BTreeSet::new();
        let mut constants = BTreeSet::new();
        let mut is_empty = true;
        for field in &description.fields {
            // ROS 2 knows no arrays of length zero, and they have no bytes.
            if field.kind.size() == 0 {
                continue;
            }
            is_empty = false;
            let array = match (&field.kind, flattened(&field.kind)) {
                (Kind::Array { .. } | Kind::Text { .. }, (_, count)) => format!("[{count}]"),
                _ => String::new(),
            };
            self.field(&mut text, field, &array, &mut fields, &mut constants);
        }
        if let Some(element) = description.element.as_ref().filter(|element| element.size() > 0) {
            is_empty = false;
            let field = FieldDescription {
                name: ELEMENTS.into(),
                kind: element.clone(),
                offset: 0,
                unit: String::new(),
                doc: String::new(),
            };
            self.field(&mut text, &field, "[]", &mut fields, &mut constants);
        }
        if is_empty {
            let _ = writeln!(text, "{PLACEHOLDER}");
        }
        text
    }

    fn field(
        &mut self,
        text: &mut String,
        field: &FieldDescription,
        array: &str,
        fields: &mut BTreeSet<String>,
        constants: &mut BTreeSet<String>,
    ) {
        let name = unique(snake_case(&field.name), fields);
        let (kind, _) = flattened(&field.kind);
        if let Kind::State { names } = kind {
            for (value, state) in names {
                let constant = format!("{}_{}", name.to_uppercase(), snake_case(state).to_uppercase());
                let _ = writeln!(text, "uint32 {}={value}", unique(constant, constants));
            }
        }
        let _ = write!(text, "{}{array} {name}", self.type_of(kind));
        let unit = if field.unit.is_empty() { String::new() } else { format!(" [{}]", field.unit) };
        let remark = format!("{unit} {}", one_line(&field.doc));
        let encoding = if matches!(innermost(&field.kind), Kind::Text { .. }) {
            " UTF-8, padded with zeros."
        } else {
            ""
        };
        let remark = format!("{}{encoding}", remark.trim_end());
        if !remark.is_empty() {
            let _ = write!(text, "  #{remark}");
        }
        text.push('\n');
    }

    fn type_of(&mut self, kind: &Kind) -> String {
        match kind {
            Kind::I8 => "int8".into(),
            Kind::U16 => "uint16".into(),
            Kind::I16 => "int16".into(),
            Kind::U32 | Kind::State { .. } => "uint32".into(),
            Kind::I32 => "int32".into(),
            Kind::U64 => "uint64".into(),
            Kind::I64 => "int64".into(),
            Kind::F32 => "float32".into(),
            Kind::F64 => "float64".into(),
            Kind::U8 | Kind::Text { .. } | Kind::Array { .. } => "uint8".into(),
            Kind::Record(description) => self.record(description),
        }
    }

    /// The name of a nested record; two different records of one name get two names.
    fn record(&mut self, description: &Description) -> String {
        let description = without_elements(description);
        if let Some((name, _)) = self.known.iter().find(|(_, known)| *known == description) {
            return format!("{PACKAGE}/{name}");
        }
        let mut taken = self.known.iter().map(|(name, _)| name.clone()).collect();
        let name = unique(type_name(&description.name), &mut taken);
        self.known.push((name.clone(), description.clone()));
        self.queue.push_back((name.clone(), description));
        format!("{PACKAGE}/{name}")
    }
}

/// Inside another record a message has no elements.
fn without_elements(description: &Description) -> Description {
    Description { element: None, ..description.clone() }
}

fn innermost(kind: &Kind) -> &Kind {
    match kind {
        Kind::Array { of, .. } => innermost(of),
        other => other,
    }
}

/// The name, with a number behind it if it is taken; it is taken afterwards.
fn unique(name: String, taken: &mut BTreeSet<String>) -> String {
    let mut candidate = name.clone();
    let mut number = 2;
    while !taken.insert(candidate.clone()) {
        candidate = format!("{name}{number}");
        number += 1;
    }
    candidate
}

/// ROS 2 takes a capital followed by letters and digits.
fn type_name(name: &str) -> String {
    let mut letters = name.chars().filter(char::is_ascii_alphanumeric);
    match letters.next() {
        Some(first) if first.is_ascii_alphabetic() => {
            [first.to_ascii_uppercase()].into_iter().chain(letters).collect()
        }
        Some(first) => ['M', first].into_iter().chain(letters).collect(),
        None => "Message".into(),
    }
}

/// ROS 2 takes small letters, digits and single underscores between them, beginning with a letter.
fn snake_case(name: &str) -> String {
    let mut out = String::new();
    let mut after_lower = false;
    for letter in name.chars() {
        if letter.is_ascii_alphanumeric() {
            if letter.is_ascii_uppercase() && after_lower {
                out.push('_');
            }
            out.push(letter.to_ascii_lowercase());
            after_lower = letter.is_ascii_lowercase() || letter.is_ascii_digit();
        } else {
            if !out.ends_with('_') {
                out.push('_');
            }
            after_lower = false;
        }
    }
    let out = out.trim_matches('_');
    if out.starts_with(|first: char| first.is_ascii_alphabetic()) {
        out.to_owned()
    } else {
        format!("f{out}")
    }
}

fn one_line(doc: &str) -> String {
    doc.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Message as _, Path, RunSummary};

    #[test]
    fn nested_records_and_elements_have_definitions() {
        let path = Path::description();
        assert_eq!(path.ros2msg_name(), "corkboard/msg/Path");
        let text = path.ros2msg();
        assert!(text.contains("corkboard/Waypoint[] elements\n"), "{text}");
        assert!(text.contains(&format!("\n{}\nMSG: corkboard/Waypoint\n", "=".repeat(80))), "{text}");
        assert!(text.contains("float64 x_m  # [m] "), "{text}");

        let summary = RunSummary::description().ros2msg();
        assert!(summary.contains("corkboard/Metric[24] metrics"), "{summary}");
        assert!(summary.contains("uint8[120] remark"), "{summary}");
        assert!(
            summary.contains(
                "uint32 STATE_RUNNING=0\nuint32 STATE_PASSED=1\nuint32 STATE_FAILED=2\nuint32 state"
            ),
            "{summary}"
        );
    }

    #[track_caller]
    fn check_name(name: &str, expected: &str) {
        assert_eq!(snake_case(name), expected);
    }

    #[test]
    fn names_become_what_ros_takes() {
        check_name("x_m", "x_m");
        check_name("AtDoor", "at_door");
        check_name("__a__b__", "a_b");
        check_name("3d", "f3d");
        check_name("I2C", "i2_c");
        check_name("", "f");
        assert_eq!(type_name("range_scan"), "Rangescan");
        assert_eq!(type_name("2d"), "M2d");
        assert_eq!(type_name("_"), "Message");
    }

    #[test]
    fn two_records_of_one_name_get_two_names() {
        let mut description = RunSummary::description();
        let mut other = description.fields[0].clone();
        other.name = "others".into();
        if let Kind::Array { of, .. } = &mut other.kind
            && let Kind::Record(metric) = of.as_mut()
        {
            metric.fields.pop();
        }
        description.fields.push(other);
        let text = description.ros2msg();
        assert!(text.contains("corkboard/Metric2[24] others"), "{text}");
        assert!(text.contains("MSG: corkboard/Metric2\n"), "{text}");
    }

    #[test]
    fn a_message_without_fields_has_the_placeholder() {
        let mut description = Path::description();
        description.fields.clear();
        description.element = None;
        assert!(description.ros2msg().contains(PLACEHOLDER));
    }
}
