//! What the parameters of every service have in common.

use serde::{Serialize, de::DeserializeOwned};

/// The parameters of a service: defaults, a schema with units and ranges, and a check that they make sense together.
pub trait Parameters: Default + Clone + Serialize + DeserializeOwned + schemars::JsonSchema {
    /// What can be wrong.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Whether the values make sense, each alone and all together.
    ///
    /// # Errors
    /// Names the parameters and their values.
    fn check(&self) -> Result<(), Self::Error>;
}
