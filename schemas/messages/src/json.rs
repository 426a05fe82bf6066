//! Messages to JSON and back, by their description alone: for tools that never heard of the type.

use crate::message::elements_offset;
use crate::{Description, Kind};
use serde_json::{Map, Value};

/// Why a JSON value is not the message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JsonError {
    /// A field that the message does not have.
    #[error("`{message}` has no field `{field}`; it has {known}")]
    UnknownField {
        /// The message.
        message: String,
        /// The field given.
        field: String,
        /// The fields there are.
        known: String,
    },
    /// A value of another type, or one that does not fit.
    #[error("field `{field}` takes {expected}, not {found}")]
    WrongValue {
        /// The field's path.
        field: String,
        /// What it takes.
        expected: String,
        /// What was given.
        found: String,
    },
}

impl Kind {
    /// The value in these bytes as JSON; null when there are too few.
    pub fn to_json(&self, bytes: &[u8]) -> Value {
        bytes.get(..self.size()).map_or(Value::Null, |part| value_to_json(self, part))
    }
}

impl Description {
    /// The message in these bytes as JSON, field by field. Bytes that are missing show as null; NaN and
    /// infinities as texts.
    pub fn to_json(&self, bytes: &[u8]) -> Value {
        let mut object = record_to_json(self, bytes);
        if let (Some(element), Value::Object(fields)) = (&self.element, &mut object) {
            let size = element.size().max(1);
            let rest = bytes.get(elements_offset(self.size)..).unwrap_or_default();
            fields.insert(
                "elements".into(),
                Value::Array(rest.chunks_exact(size).map(|chunk| value_to_json(element, chunk)).collect()),
            );
        }
        object
    }

    /// The bytes of a message from JSON. Fields that are not given are zero.
    ///
    /// # Errors
    /// For a field that does not exist and for a value that does not fit.
    pub fn from_json(&self, value: &Value) -> Result<Vec<u8>, JsonError> {
        let mut bytes = vec![0; self.size];
        let Value::Object(fields) = value else {
            return Err(wrong(&self.name, "an object", value));
        };
        let mut fields = fields.clone();
        let elements = if self.element.is_some() { fields.remove("elements") } else { None };
        record_from_json(self, &self.name, &Value::Object(fields), &mut bytes)?;
        if let Some(kind) = &self.element {
            bytes.resize(elements_offset(self.size), 0);
            match elements {
                None => {}
                Some(Value::Array(items)) => {
                    for (index, item) in items.iter().enumerate() {
                        let start = bytes.len();
                        bytes.resize(start + kind.size(), 0);
                        value_from_json(kind, &format!("elements[{index}]"), item, &mut bytes[start..])?;
                    }
                }
                Some(other) => return Err(wrong("elements", "an array", &other)),
            }
        }
        Ok(bytes)
    }
}

fn record_to_json(description: &Description, bytes: &[u8]) -> Value {
    let fields = description.fields.iter().map(|field| {
        let value = bytes
            .get(field.offset..field.offset + field.kind.size())
            .map_or(Value::Null, |part| value_to_json(&field.kind, part));
        (field.name.clone(), value)
    });
    Value::Object(fields.collect::<Map<_, _>>())
}

macro_rules! number {
    ($type:ty, $bytes:expr) => {{
        let mut raw = [0; size_of::<$type>()];
        raw.copy_from_slice(&$bytes[..size_of::<$type>()]);
        <$type>::from_le_bytes(raw)
    }};
}

fn value_to_json(kind: &Kind, bytes: &[u8]) -> Value {
    match kind {
        Kind::U8 => number!(u8, bytes).into(),
        Kind::U16 => number!(u16, bytes).into(),
        Kind::U32 => number!(u32, bytes).into(),
        Kind::U64 => number!(u64, bytes).into(),
        Kind::I8 => number!(i8, bytes).into(),
        Kind::I16 => number!(i16, bytes).into(),
        Kind::I32 => number!(i32, bytes).into(),
        Kind::I64 => number!(i64, bytes).into(),
        // The shortest decimal that reads back as the same f32, not the digits of its f64 neighbour.
        Kind::F32 => float_to_json(number!(f32, bytes).to_string().parse().unwrap_or(f64::NAN)),
        Kind::F64 => float_to_json(number!(f64, bytes)),
        Kind::State { names } => {
            let value = number!(u32, bytes);
            names
                .iter()
                .find(|(known, _)| *known == value)
                .map_or_else(|| value.into(), |(_, name)| name.clone().into())
        }
        Kind::Text { .. } => {
            let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
            String::from_utf8_lossy(&bytes[..end]).into_owned().into()
        }
        Kind::Array { of, .. } => {
            Value::Array(bytes.chunks_exact(of.size().max(1)).map(|part| value_to_json(of, part)).collect())
        }
        Kind::Record(description) => record_to_json(description, bytes),
    }
}

fn float_to_json(value: f64) -> Value {
    serde_json::Number::from_f64(value).map_or_else(|| value.to_string().into(), Value::Number)
}

fn record_from_json(
    description: &Description,
    path: &str,
    value: &Value,
    bytes: &mut [u8],
) -> Result<(), JsonError> {
    let Value::Object(fields) = value else {
        return Err(wrong(path, "an object", value));
    };
    for (name, value) in fields {
        let Some(field) = description.fields.iter().find(|field| field.name == *name) else {
            return Err(JsonError::UnknownField {
                message: description.name.clone(),
                field: name.clone(),
                known: description
                    .fields
                    .iter()
                    .map(|field| format!("`{}`", field.name))
                    .collect::<Vec<_>>()
                    .join(", "),
            });
        };
        let end = field.offset + field.kind.size();
        if let Some(part) = bytes.get_mut(field.offset..end) {
            value_from_json(&field.kind, &format!("{path}.{name}"), value, part)?;
        }
    }
    Ok(())
}

fn value_from_json(kind: &Kind, path: &str, value: &Value, bytes: &mut [u8]) -> Result<(), JsonError> {
    macro_rules! integer {
        ($type:ty) => {{
            let number = value
                .as_u64()
                .and_then(|number| <$type>::try_from(number).ok())
                .or_else(|| value.as_i64().and_then(|number| <$type>::try_from(number).ok()))
                .ok_or_else(|| {
                    wrong(path, &format!("an integer from {} to {}", <$type>::MIN, <$type>::MAX), value)
                })?;
            bytes.copy_from_slice(&number.to_le_bytes());
        }};
    }
    match kind {
        Kind::U8 => integer!(u8),
        Kind::U16 => integer!(u16),
        Kind::U32 => integer!(u32),
        Kind::U64 => integer!(u64),
        Kind::I8 => integer!(i8),
        Kind::I16 => integer!(i16),
        Kind::I32 => integer!(i32),
        Kind::I64 => integer!(i64),
        Kind::F32 => bytes.copy_from_slice(&(float_from_json(path, value)? as f32).to_le_bytes()),
        Kind::F64 => bytes.copy_from_slice(&float_from_json(path, value)?.to_le_bytes()),
        Kind::State { names } => {
            let known = || names.iter().map(|(_, name)| name.as_str()).collect::<Vec<_>>().join(" | ");
            let number = match value {
                Value::String(text) => names.iter().find(|(_, name)| name == text).map(|(value, _)| *value),
                other => other.as_u64().and_then(|number| u32::try_from(number).ok()),
            };
            bytes.copy_from_slice(&number.ok_or_else(|| wrong(path, &known(), value))?.to_le_bytes());
        }
        Kind::Text { capacity } => {
            let text = value.as_str().filter(|text| text.len() <= *capacity);
            let text =
                text.ok_or_else(|| wrong(path, &format!("a text of at most {capacity} bytes"), value))?;
            bytes[..text.len()].copy_from_slice(text.as_bytes());
        }
        Kind::Array { of, count } => {
            let items = value
                .as_array()
                .filter(|items| items.len() <= *count)
                .ok_or_else(|| wrong(path, &format!("an array of at most {count}"), value))?;
            for (index, (item, part)) in
                items.iter().zip(bytes.chunks_exact_mut(of.size().max(1))).enumerate()
            {
                value_from_json(of, &format!("{path}[{index}]"), item, part)?;
            }
        }
        Kind::Record(description) => record_from_json(description, path, value, bytes)?,
    }
    Ok(())
}

fn float_from_json(path: &str, value: &Value) -> Result<f64, JsonError> {
    match value {
        Value::String(text) if text == "NaN" => Ok(f64::NAN),
        Value::String(text) if text == "inf" => Ok(f64::INFINITY),
        Value::String(text) if text == "-inf" => Ok(f64::NEG_INFINITY),
        other => other.as_f64().ok_or_else(|| wrong(path, "a number, \"NaN\", \"inf\" or \"-inf\"", value)),
    }
}

fn wrong(field: &str, expected: &str, found: &Value) -> JsonError {
    JsonError::WrongValue { field: field.to_owned(), expected: expected.to_owned(), found: found.to_string() }
}
