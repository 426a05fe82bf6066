//! What a message says about itself at run time: names, types, offsets, units, docs, and the fingerprint of
//! the layout.

use serde::{Deserialize, Serialize};
use std::fmt::Write as _;

/// A type that may stand in a message.
pub trait Field {
    /// The type's run-time description.
    fn kind() -> Kind;
}

/// The type of a field.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Unsigned, 8 bits.
    U8,
    /// Unsigned, 16 bits.
    U16,
    /// Unsigned, 32 bits.
    U32,
    /// Unsigned, 64 bits.
    U64,
    /// Signed, 8 bits.
    I8,
    /// Signed, 16 bits.
    I16,
    /// Signed, 32 bits.
    I32,
    /// Signed, 64 bits.
    I64,
    /// IEEE 754, 32 bits.
    F32,
    /// IEEE 754, 64 bits.
    F64,
    /// A 32-bit integer with named values; any other value is an invalid state.
    State {
        /// Value and name of each state.
        names: Vec<(u32, String)>,
    },
    /// UTF-8, padded with zeros.
    Text {
        /// Bytes at most.
        capacity: usize,
    },
    /// Equal fields one behind the other.
    Array {
        /// The type of one.
        of: Box<Kind>,
        /// How many.
        count: usize,
    },
    /// Named fields.
    Record(Box<Description>),
}

impl Kind {
    /// Bytes of one value.
    pub fn size(&self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 | Self::State { .. } => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
            Self::Text { capacity } => *capacity,
            Self::Array { of, count } => of.size().saturating_mul(*count),
            Self::Record(description) => description.size,
        }
    }

    fn write_layout(&self, out: &mut String) {
        match self {
            Self::State { names } => {
                out.push_str("state(");
                for (value, name) in names {
                    let _ = write!(out, "{value}={name},");
                }
                out.push(')');
            }
            Self::Text { capacity } => {
                let _ = write!(out, "text{capacity}");
            }
            Self::Array { of, count } => {
                of.write_layout(out);
                let _ = write!(out, "[{count}]");
            }
            Self::Record(description) => description.write_layout(out),
            plain => out.push_str(plain.plain_name()),
        }
    }

    fn plain_name(&self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::U16 => "u16",
            Self::U32 => "u32",
            Self::U64 => "u64",
            Self::I8 => "i8",
            Self::I16 => "i16",
            Self::I32 => "i32",
            Self::I64 => "i64",
            Self::F32 => "f32",
            Self::F64 => "f64",
            Self::State { .. } => "state",
            Self::Text { .. } => "text",
            Self::Array { .. } => "array",
            Self::Record(_) => "record",
        }
    }
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Text { capacity } => write!(f, "text{capacity}"),
            Self::Array { of, count } => write!(f, "{of}[{count}]"),
            Self::Record(description) => f.write_str(&description.name),
            plain => f.write_str(plain.plain_name()),
        }
    }
}

/// One field of a record.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FieldDescription {
    /// Its name, with the unit last.
    pub name: String,
    /// Its type.
    pub kind: Kind,
    /// Bytes from the beginning of the record.
    pub offset: usize,
    /// Its unit as people write it (`m`, `rad/s`), empty for a pure number.
    pub unit: String,
    /// Its meaning.
    pub doc: String,
}

/// A message type: its fields, and the type of the elements that may follow.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Description {
    /// The type's name.
    pub name: String,
    /// Its meaning.
    pub doc: String,
    /// Bytes of the fixed part.
    pub size: usize,
    /// Alignment of the fixed part.
    pub alignment: usize,
    /// The fields in order.
    pub fields: Vec<FieldDescription>,
    /// The type of the elements behind the fixed part, if there are any.
    pub element: Option<Kind>,
}

impl Description {
    /// A hash over names, types and offsets (FNV-1a, 64 bits): equal for equal layouts and meanings, whatever
    /// the docs say.
    pub fn fingerprint(&self) -> u64 {
        let mut layout = String::new();
        self.write_layout(&mut layout);
        layout.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
        })
    }

    /// Where this layout first differs from `other`, in words; `None` when they agree.
    pub fn first_difference(&self, other: &Self) -> Option<String> {
        if self.name != other.name {
            return Some(format!("the message is `{}` here and `{}` there", self.name, other.name));
        }
        for (mine, theirs) in self.fields.iter().zip(&other.fields) {
            if mine.name != theirs.name {
                return Some(format!("field `{}` here is `{}` there", mine.name, theirs.name));
            }
            if mine.kind != theirs.kind {
                if let (Kind::Record(a), Kind::Record(b)) = (&mine.kind, &theirs.kind)
                    && let Some(inner) = a.first_difference(b)
                {
                    return Some(format!("in field `{}`: {inner}", mine.name));
                }
                return Some(format!(
                    "field `{}` is {} here and {} there",
                    mine.name, mine.kind, theirs.kind
                ));
            }
            if mine.offset != theirs.offset {
                return Some(format!(
                    "field `{}` lies at byte {} here and at byte {} there",
                    mine.name, mine.offset, theirs.offset
                ));
            }
        }
        let (more, fewer) = (self.fields.len(), other.fields.len());
        if more > fewer {
            return Some(format!("field `{}` is missing there", self.fields[fewer].name));
        }
        if fewer > more {
            return Some(format!("field `{}` is missing here", other.fields[more].name));
        }
        if self.element != other.element {
            let name = |element: &Option<Kind>| element.as_ref().map_or("none".to_owned(), Kind::to_string);
            return Some(format!(
                "the elements are {} here and {} there",
                name(&self.element),
                name(&other.element)
            ));
        }
        (self.fingerprint() != other.fingerprint()).then(|| "the named states differ".to_owned())
    }

    /// The unit of the field at a path as tools write it (`anchors[3].range_m`, `elements[].x_m`, the
    /// index left out or not); empty for a pure number, and when there is no such field.
    pub fn unit_at(&self, path: &str) -> &str {
        let mut steps = path.split('.').map(|step| step.split('[').next().unwrap_or_default()).peekable();
        let mut record = self;
        if let (Some(Kind::Record(element)), Some(&"elements")) = (&self.element, steps.peek()) {
            record = element;
            steps.next();
        }
        while let Some(step) = steps.next() {
            let Some(field) = record.fields.iter().find(|field| field.name == step) else { return "" };
            if steps.peek().is_none() {
                return &field.unit;
            }
            let mut kind = &field.kind;
            while let Kind::Array { of, .. } = kind {
                kind = of;
            }
            let Kind::Record(inner) = kind else { return "" };
            record = inner;
        }
        ""
    }

    fn write_layout(&self, out: &mut String) {
        let _ = write!(out, "{}{{", self.name);
        for field in &self.fields {
            let _ = write!(out, "{}:", field.name);
            field.kind.write_layout(out);
            let _ = write!(out, "@{};", field.offset);
        }
        out.push('}');
        if let Some(element) = &self.element {
            out.push_str("[]");
            element.write_layout(out);
        }
    }
}

/// The unit that a field's name ends in, as people write it; empty when the name has none.
pub fn unit_of(field_name: &str) -> &'static str {
    const UNITS: [(&str, &str); 17] = [
        ("_m_per_s2", "m/s²"),
        ("_mps", "m/s"),
        ("_m_per_s", "m/s"),
        ("_rad_per_s", "rad/s"),
        ("_radps", "rad/s"),
        ("_m2", "m²"),
        ("_mm", "mm"),
        ("_cm", "cm"),
        ("_m", "m"),
        ("_rad", "rad"),
        ("_deg", "deg"),
        ("_ns", "ns"),
        ("_us", "us"),
        ("_ms", "ms"),
        ("_hz", "Hz"),
        ("_percent", "%"),
        ("_s", "s"),
    ];
    UNITS.iter().find(|(suffix, _)| field_name.ends_with(suffix)).map_or("", |(_, unit)| unit)
}

macro_rules! primitive {
    ($($rust:ty => $kind:ident),*) => { $(
        impl Field for $rust {
            fn kind() -> Kind { Kind::$kind }
        }
    )* };
}
primitive!(u8 => U8, u16 => U16, u32 => U32, u64 => U64, i8 => I8, i16 => I16, i32 => I32, i64 => I64, f32 => F32, f64 => F64);

impl<T: Field, const N: usize> Field for [T; N] {
    fn kind() -> Kind {
        Kind::Array { of: Box::new(T::kind()), count: N }
    }
}
