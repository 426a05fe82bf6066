//! Graphs by name.

use super::paths::shown;
use super::suggest::nearest;
use std::path::{Path, PathBuf};

/// A name that is no graph's.
#[derive(Debug, Clone, thiserror::Error)]
#[error("there is no graph `{name}`")]
pub(crate) struct UnknownGraph {
    /// The name given.
    pub(crate) name: String,
    /// The graphs there are.
    pub(crate) known: Vec<String>,
    /// The folders that were searched.
    pub(crate) looked: Vec<PathBuf>,
}

impl UnknownGraph {
    /// What to do.
    pub(crate) fn help(&self) -> String {
        if Path::new(&self.name).exists() {
            let name = &self.name;
            return format!(
                "a graph file ends in .toml; to try the file of that name all the same, write ./{name}"
            );
        }
        let looked: Vec<_> = self.looked.iter().map(|folder| shown(folder)).collect();
        let looked = format!("looked in {}", looked.join(", "));
        if let Some(name) = nearest(&self.name, self.known.iter().map(String::as_str)) {
            return format!("did you mean `{name}`?");
        }
        if self.known.is_empty() {
            return format!("give the path of a graph file; {looked}");
        }
        format!("graphs: {}; or give the path of a file ({looked})", self.known.join(", "))
    }
}

/// The file of a graph: a path if it has a slash or ends in `.toml`, else a name.
pub(crate) fn find(graph: &str) -> Result<PathBuf, UnknownGraph> {
    if is_path(graph) { Ok(PathBuf::from(graph)) } else { find_by_name(graph, None) }
}

/// The file that another one includes: a path counts from the folder of that one, and there a name is looked
/// for first.
pub(crate) fn find_included(graph: &str, folder: &Path) -> Result<PathBuf, UnknownGraph> {
    if is_path(graph) { Ok(folder.join(graph)) } else { find_by_name(graph, Some(folder)) }
}

fn is_path(graph: &str) -> bool {
    graph.contains('/') || graph.ends_with(".toml")
}

fn find_by_name(graph: &str, first: Option<&Path>) -> Result<PathBuf, UnknownGraph> {
    let folders: Vec<PathBuf> = first.map(Path::to_owned).into_iter().chain(folders()).collect();
    let files = folders.iter().map(|folder| folder.join(format!("{graph}.toml")));
    files.into_iter().find(|file| file.is_file()).ok_or_else(|| UnknownGraph {
        name: graph.to_owned(),
        known: known_in(&folders),
        looked: folders,
    })
}

/// The folder of a source checkout's launcher, if this binary was built in one that still exists.
pub(crate) fn checkout() -> Option<&'static Path> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    folder.join("../services").is_dir().then_some(folder)
}

/// Where graphs are looked for: here, in the source checkout, and beside an installed launcher.
fn folders() -> Vec<PathBuf> {
    let mut folders = vec![PathBuf::from("."), PathBuf::from("graphs")];
    folders.extend(checkout().map(|folder| folder.join("graphs")));
    let beside = std::env::current_exe().ok();
    let beside = beside.as_deref().and_then(Path::parent).and_then(Path::parent);
    folders.extend(beside.map(|prefix| prefix.join("share/corkboard/graphs")));
    folders.retain(|folder| folder.is_dir());
    folders
}

fn known_in(folders: &[PathBuf]) -> Vec<String> {
    // The current folder may hold any TOML; graphs have a folder of their own.
    names_in(folders.iter().filter(|folder| folder.ends_with("graphs")))
}

/// The names of the TOML files in these folders, in order.
pub(crate) fn names_in<'a>(folders: impl Iterator<Item = &'a PathBuf>) -> Vec<String> {
    let entries = folders.filter_map(|folder| std::fs::read_dir(folder).ok()).flatten().flatten();
    let mut names: Vec<String> = entries
        .filter_map(|entry| {
            let path = entry.path();
            let stem = path.file_stem()?.to_str()?.to_owned();
            (path.extension()? == "toml").then_some(stem)
        })
        .collect();
    names.sort();
    names.dedup();
    names
}
