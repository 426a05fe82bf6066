//! How much shared memory a board's graph takes, known before anything of it is made.

use crate::lack::Lack;
use crate::manifest::Manifest;

/// What is lacking for this board, if anything is.
pub(crate) fn lack_for(_manifest: &Manifest) -> Option<Lack> {
    None
}
