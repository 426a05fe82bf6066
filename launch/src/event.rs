//! What the launcher tells.

/// Something that the operator wants to know.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub(crate) struct Event {
    /// Seconds since `up`.
    pub(crate) at_s: f64,
    /// The service, empty for the whole set.
    pub(crate) role: String,
    /// What happened.
    pub(crate) text: String,
    /// Whether something went wrong.
    pub(crate) is_trouble: bool,
}
