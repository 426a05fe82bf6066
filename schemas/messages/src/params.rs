//! What the parameters of every service have in common.

use crate::schema::{Misfit, Schema};
use serde::{Serialize, de::DeserializeOwned};

/// The parameters of a service: defaults, a schema with units and ranges, and a check that they make sense
/// together.
///
/// A range is declared once, at its field: `#[schemars(range(min = 0.1, max = 4.0))]`. It is checked by the
/// launcher before anything starts, and by [`check`](Self::check) in the service, which both do by
/// [`Schema::misfits`].
pub trait Parameters: Default + Clone + Serialize + DeserializeOwned + schemars::JsonSchema {
    /// What can be wrong: [`Misfit`] alone, or that and more.
    type Error: std::error::Error + From<Misfit> + Send + Sync + 'static;

    /// What no schema can say: whether the values make sense together. They keep their ranges already.
    ///
    /// # Errors
    /// Names the parameters and their values.
    fn check_together(&self) -> Result<(), Self::Error> {
        Ok(())
    }

    /// Whether the values make sense, each alone and all together.
    ///
    /// # Errors
    /// Names the parameters and their values.
    fn check(&self) -> Result<(), Self::Error> {
        let in_json = |params: &Self| serde_json::to_value(params).unwrap_or_default();
        let (schema, defaults) = (schemars::schema_for!(Self), in_json(&Self::default()));
        match (Schema { root: schema.as_value(), defaults: &defaults }).first_misfit(&in_json(self)) {
            Some(misfit) => Err(misfit.into()),
            None => self.check_together(),
        }
    }
}
