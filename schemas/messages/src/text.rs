//! Short texts inside messages.

use crate::kind::{Field, Kind};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// UTF-8 text of at most `N` bytes, padded with zeros. Bytes that are not UTF-8 are read as no text at all.
#[derive(Clone, Copy, PartialEq, Eq, Hash, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(transparent)]
pub struct FixedText<const N: usize>([u8; N]);

/// A text that does not fit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` has {} bytes, and the field holds {capacity}", text.len())]
pub struct TextTooLong {
    /// The text.
    pub text: String,
    /// How many bytes the field holds.
    pub capacity: usize,
}

impl<const N: usize> FixedText<N> {
    /// No text.
    pub const EMPTY: Self = Self([0; N]);

    /// A text that must fit.
    ///
    /// # Errors
    /// When it is longer than `N` bytes.
    pub fn new(text: &str) -> Result<Self, TextTooLong> {
        if text.len() > N {
            return Err(TextTooLong { text: text.to_owned(), capacity: N });
        }
        Ok(Self::truncated(text))
    }

    /// As much of a text as fits, cut between characters.
    pub fn truncated(text: &str) -> Self {
        let end = (0..=text.len().min(N)).rev().find(|&end| text.is_char_boundary(end)).unwrap_or(0);
        let mut bytes = [0; N];
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Self(bytes)
    }

    /// The text, or `None` for bytes that are not UTF-8.
    pub fn get(&self) -> Option<&str> {
        let end = self.0.iter().position(|&byte| byte == 0).unwrap_or(N);
        std::str::from_utf8(&self.0[..end]).ok()
    }

    /// The text, empty for bytes that are not UTF-8.
    pub fn as_str(&self) -> &str {
        self.get().unwrap_or_default()
    }

    /// Whether nothing readable is in it.
    pub fn is_empty(&self) -> bool {
        self.as_str().is_empty()
    }
}

impl<const N: usize> Default for FixedText<N> {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl<const N: usize> std::fmt::Debug for FixedText<N> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.get() {
            Some(text) => write!(f, "{text:?}"),
            None => write!(f, "{:?}", self.0),
        }
    }
}

impl<const N: usize> std::fmt::Display for FixedText<N> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl<const N: usize> Field for FixedText<N> {
    fn kind() -> Kind {
        Kind::Text { capacity: N }
    }
}
