//! A message's bytes as CDR and back, by its description alone.
//!
//! Plain CDR (XCDR1, OMG DDS-XTypes 1.3, 7.4.3) aligns every number to its own size, counted from behind the
//! 4-byte header; structures and arrays have no alignment of their own. The fixed part of our messages, which
//! has no padding, is that already, byte for byte: it is one run to copy. The elements follow as a sequence:
//! a `uint32` count and the elements, which may begin at a multiple of four where in memory it is one of
//! eight. All layouts are computed once, when the recording is opened; a message is then a handful of copies.

use messages::ros2msg::flattened;
use messages::{Description, Kind, elements_offset};

/// CDR, little-endian, no options.
const HEADER: [u8; 4] = [0, 1, 0, 0];
/// The largest fixed part that is believed.
const FIXED_MAX: usize = 64 << 20;
/// The largest message in memory that is believed: a map of 64 MiB, and more.
pub(crate) const MESSAGE_MAX: usize = 80 << 20;
/// Rust's layout puts at most seven bytes beside each that is used.
const BYTES_PER_BYTE_MAX: usize = 8;

/// The most separate numbers that are laid out one by one: ours have a hundred.
const LEAVES_MAX: usize = 4000;

/// A description that contradicts itself; those that `#[derive(Message)]` makes never do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum InvalidDescription {
    /// A field beyond the end.
    #[error("field `{field}` of `{message}` ends at byte {end}, and the message at {size}")]
    FieldOutside {
        /// The message.
        message: String,
        /// The field.
        field: String,
        /// Where it ends.
        end: usize,
        /// The message's size.
        size: usize,
    },
    /// More separate numbers than anything that can be meant.
    #[error("`{message}` has more than {LEAVES_MAX} separate numbers; arrays of numbers count as one")]
    TooManyFields {
        /// The message.
        message: String,
    },
    /// Much more room than its fields fill: a few bytes of a file would ask for any amount of memory.
    #[error("`{message}` is laid out in {size} bytes, of which its fields fill {filled}")]
    Hollow {
        /// The message.
        message: String,
        /// Bytes that it or its element is said to have.
        size: usize,
        /// Bytes that hold something.
        filled: usize,
    },
    /// Larger than anything that can be meant.
    #[error("`{message}` has {size} bytes; {FIXED_MAX} is the limit")]
    TooLarge {
        /// The message.
        message: String,
        /// Its size.
        size: usize,
    },
}

/// Bytes that are not the message they claim to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{bytes} bytes are no message of this type")]
pub struct Misfit {
    /// How many there are.
    pub bytes: usize,
}

/// Numbers of one size, one behind the other.
#[derive(Debug, Clone, Copy)]
struct Leaf {
    offset: usize,
    bytes: usize,
    align: usize,
}

/// Bytes that lie together on both sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Run {
    /// In memory.
    from: usize,
    /// In CDR, from the beginning of the layout.
    to: usize,
    bytes: usize,
}

/// Where the bytes of a record go.
#[derive(Debug, Clone)]
struct Layout {
    runs: Vec<Run>,
    /// Bytes in CDR, with padding before and between.
    bytes: usize,
}

impl Layout {
    /// The layout of these leaves when the first byte falls on `phase`, modulo 8.
    fn new(leaves: &[Leaf], phase: usize) -> Self {
        let mut runs: Vec<Run> = Vec::new();
        let mut end = 0;
        for leaf in leaves {
            let to = (phase + end).next_multiple_of(leaf.align) - phase;
            match runs.last_mut() {
                Some(last) if last.from + last.bytes == leaf.offset && last.to + last.bytes == to => {
                    last.bytes += leaf.bytes;
                }
                _ => runs.push(Run { from: leaf.offset, to, bytes: leaf.bytes }),
            }
            end = to + leaf.bytes;
        }
        Self { runs, bytes: end }
    }

    /// Whether memory and CDR are the same `size` bytes.
    fn is_plain(&self, size: usize) -> bool {
        self.bytes == size && self.runs == [Run { from: 0, to: 0, bytes: size }]
    }

    fn encode(&self, raw: &[u8], out: &mut Vec<u8>) {
        let begin = out.len();
        for run in &self.runs {
            out.resize(begin + run.to, 0);
            out.extend_from_slice(&raw[run.from..run.from + run.bytes]);
        }
    }

    fn decode(&self, cdr: &[u8], raw: &mut [u8]) {
        for run in &self.runs {
            raw[run.from..run.from + run.bytes].copy_from_slice(&cdr[run.to..run.to + run.bytes]);
        }
    }
}

/// The elements behind the fixed part.
#[derive(Debug)]
struct Elements {
    /// Bytes of an element in memory.
    element: usize,
    /// Bytes of what the sequence counts: the element, or what it is an array of.
    unit: usize,
    /// The layout of one by the position of its first byte, modulo 8.
    layouts: [Layout; 8],
    /// Whether from this position on all elements are the same bytes in memory and in CDR.
    plain: [bool; 8],
}

/// Turns the messages of one type into CDR and back.
#[derive(Debug)]
pub struct Codec {
    size: usize,
    fixed: Layout,
    elements: Option<Elements>,
    /// A message without any byte has one on the wire.
    placeholder: bool,
}

impl Codec {
    /// Computes the layouts of a type.
    ///
    /// # Errors
    /// When the description contradicts itself.
    pub fn new(description: &Description) -> Result<Self, InvalidDescription> {
        let named = |error| match error {
            InvalidDescription::TooManyFields { .. } => {
                InvalidDescription::TooManyFields { message: description.name.clone() }
            }
            error => error,
        };
        let mut leaves = Vec::new();
        let hollow = |size, leaves: &[Leaf]| {
            let filled: usize = leaves.iter().map(|leaf| leaf.bytes).sum();
            let message = || description.name.clone();
            let is_hollow = size / BYTES_PER_BYTE_MAX > filled;
            if is_hollow {
                Err(InvalidDescription::Hollow { message: message(), size, filled })
            } else {
                Ok(())
            }
        };
        record_leaves(description, 0, &mut leaves).map_err(named)?;
        hollow(description.size, &leaves)?;
        let fixed = Layout::new(&leaves, 0);
        let elements = match description.element.as_ref().filter(|element| element.size() > 0) {
            None => None,
            Some(element) => {
                let (kind, _) = flattened(element);
                let mut leaves = Vec::new();
                kind_leaves(kind, 0, &mut leaves).map_err(named)?;
                hollow(kind.size(), &leaves)?;
                let layouts: [Layout; 8] = std::array::from_fn(|phase| Layout::new(&leaves, phase));
                let unit = kind.size();
                // After eight elements every position that can come has come.
                let plain = std::array::from_fn(|phase| {
                    (0..8).all(|index| layouts[(phase + index * unit) % 8].is_plain(unit))
                });
                Some(Elements { element: element.size(), unit, layouts, plain })
            }
        };
        let placeholder = elements.is_none() && fixed.bytes == 0;
        Ok(Self { size: description.size, fixed, elements, placeholder })
    }

    /// Writes a message's bytes as CDR into `out`, replacing what is there.
    ///
    /// # Errors
    /// When there are too few bytes, or a fraction of an element too many.
    pub fn encode(&self, raw: &[u8], out: &mut Vec<u8>) -> Result<(), Misfit> {
        let misfit = Misfit { bytes: raw.len() };
        out.clear();
        out.extend_from_slice(&HEADER);
        let Some(elements) = &self.elements else {
            if raw.len() != self.size {
                return Err(misfit);
            }
            self.fixed.encode(raw, out);
            out.resize(out.len() + usize::from(self.placeholder), 0);
            return Ok(());
        };
        let mut rest = raw.get(elements_offset(self.size)..).ok_or(misfit)?;
        if !rest.len().is_multiple_of(elements.element) {
            return Err(misfit);
        }
        self.fixed.encode(raw, out);
        let count = u32::try_from(rest.len() / elements.unit).map_err(|_| misfit)?;
        out.resize(out.len().next_multiple_of(4), 0);
        out.extend_from_slice(&count.to_le_bytes());
        while !rest.is_empty() {
            // The header's four bytes do not count for the alignment.
            let phase = (out.len() - HEADER.len()) % 8;
            if elements.plain[phase] {
                out.extend_from_slice(rest);
                break;
            }
            let (unit, after) = rest.split_at(elements.unit);
            elements.layouts[phase].encode(unit, out);
            rest = after;
        }
        Ok(())
    }

    /// Appends the message's bytes, as they lay in memory, to `raw`. Padding is zero.
    ///
    /// # Errors
    /// When this is no CDR of such a message.
    pub fn decode(&self, cdr: &[u8], raw: &mut Vec<u8>) -> Result<(), Misfit> {
        let misfit = Misfit { bytes: cdr.len() };
        let body = cdr.strip_prefix(&HEADER[..2]).and_then(|rest| rest.get(2..)).ok_or(misfit)?;
        if body.len() < self.fixed.bytes + usize::from(self.placeholder) {
            return Err(misfit);
        }
        let begin = raw.len();
        raw.resize(begin + self.size, 0);
        self.fixed.decode(body, &mut raw[begin..]);
        let Some(elements) = &self.elements else { return Ok(()) };
        raw.resize(begin + elements_offset(self.size), 0);
        let mut at = self.fixed.bytes.next_multiple_of(4);
        let count = body.get(at..).and_then(|rest| rest.first_chunk::<4>()).ok_or(misfit)?;
        let count = u32::from_le_bytes(*count) as usize;
        at += 4;
        if count.saturating_mul(elements.unit) > MESSAGE_MAX - self.size {
            return Err(misfit);
        }
        let mut left = count;
        while left > 0 {
            let rest = body.get(at..).ok_or(misfit)?;
            let layout = &elements.layouts[at % 8];
            if elements.plain[at % 8] {
                let bytes = left.checked_mul(elements.unit).ok_or(misfit)?;
                raw.extend_from_slice(rest.get(..bytes).ok_or(misfit)?);
                break;
            }
            // An element without bytes on the wire could be claimed any number of times.
            let cdr = rest.get(..layout.bytes).filter(|cdr| !cdr.is_empty()).ok_or(misfit)?;
            let begin = raw.len();
            raw.resize(begin + elements.unit, 0);
            layout.decode(cdr, &mut raw[begin..]);
            at += layout.bytes;
            left -= 1;
        }
        let whole = (count * elements.unit).is_multiple_of(elements.element);
        if whole { Ok(()) } else { Err(misfit) }
    }
}

fn record_leaves(
    description: &Description,
    base: usize,
    leaves: &mut Vec<Leaf>,
) -> Result<(), InvalidDescription> {
    if description.size > FIXED_MAX {
        return Err(InvalidDescription::TooLarge {
            message: description.name.clone(),
            size: description.size,
        });
    }
    for field in description.fields.iter().filter(|field| field.kind.size() > 0) {
        let end = field.offset.saturating_add(field.kind.size());
        if end > description.size {
            return Err(InvalidDescription::FieldOutside {
                message: description.name.clone(),
                field: field.name.clone(),
                end,
                size: description.size,
            });
        }
        kind_leaves(&field.kind, base + field.offset, leaves)?;
    }
    Ok(())
}

fn kind_leaves(kind: &Kind, base: usize, leaves: &mut Vec<Leaf>) -> Result<(), InvalidDescription> {
    match flattened(kind) {
        (Kind::Record(description), count) => {
            for index in 0..count {
                let before = leaves.len();
                record_leaves(description, base + index * description.size, leaves)?;
                if leaves.len() == before {
                    // None of the others has any, either.
                    break;
                }
            }
        }
        (number, count) => {
            if leaves.len() >= LEAVES_MAX {
                return Err(InvalidDescription::TooManyFields { message: String::new() });
            }
            leaves.push(Leaf { offset: base, bytes: number.size() * count, align: number.size() });
        }
    }
    Ok(())
}
