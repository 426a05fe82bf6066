//! Experiments by name.

use crate::graph::{hint, names_in};
use std::path::{Path, PathBuf};

/// An experiment by path or by name.
///
/// # Errors
/// When there is none of this name: with the one that may be meant.
pub(super) fn find(file: &Path) -> Result<PathBuf, String> {
    let named = file.components().count() == 1 && file.extension().is_none() && !file.is_file();
    if !named {
        return Ok(file.to_owned());
    }
    let folders = folders();
    let name = file.with_extension("toml");
    folders.iter().map(|folder| folder.join(&name)).find(|file| file.is_file()).ok_or_else(|| {
        let known = names_in(folders.iter());
        let name = file.display().to_string();
        let hint = hint(&name, known.iter().map(String::as_str), "experiments");
        format!("there is no experiment `{name}`: {hint}")
    })
}

/// Where experiments are looked for: here, in the source checkout, and beside an installed launcher.
fn folders() -> Vec<PathBuf> {
    let beside = std::env::current_exe().ok();
    let beside = beside.as_deref().and_then(Path::parent).and_then(Path::parent);
    let folders = [PathBuf::from("experiments"), Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments")];
    folders.into_iter().chain(beside.map(|prefix| prefix.join("share/corkboard/experiments"))).collect()
}
