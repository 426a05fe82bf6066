//! Paths count from the file in which they are written: those of an included file from its folder, all others
//! (also those of the command line) from the graph's.

use super::source::Place;
use super::tree::{Content, Entry, Table};
use serde_json::Value;
use std::path::{Component, Path, PathBuf};

/// Which parameters name files, by role.
#[derive(Debug, Clone, Default)]
pub(super) struct CheckedPaths(Vec<(String, Vec<String>)>);

impl CheckedPaths {
    /// Those of a role.
    pub(super) fn of_role<'a>(&'a self, role: &'a str) -> impl Iterator<Item = &'a str> {
        let roles = self.0.iter().filter(move |(known, _)| known == role);
        roles.flat_map(|(_, keys)| keys.iter().map(String::as_str))
    }

    /// Those of any role.
    pub(super) fn all(&self) -> impl Iterator<Item = &str> {
        self.0.iter().flat_map(|(_, keys)| keys.iter().map(String::as_str))
    }

    pub(super) fn add(&mut self, role: &str, schema: &Value) {
        let properties = schema.get("properties").and_then(Value::as_object);
        let keys = properties.into_iter().flat_map(|properties| properties.keys());
        let keys = keys.filter(|key| is_path(schema, key)).cloned().collect();
        self.0.push((role.to_owned(), keys));
    }
}

/// A path as services in the graph's folder find it; `None` when it is so already.
pub(super) fn rebased(text: &str, place: &Place, graph_folder: &Path) -> Option<String> {
    let folder = place.source().folder.as_deref().filter(|folder| *folder != graph_folder)?;
    let is_relative = !text.is_empty() && Path::new(text).is_relative();
    is_relative.then(|| from(graph_folder, folder).join(text).to_string_lossy().into_owned())
}

/// The same of an entry whose value is a path.
pub(super) fn rebase(entry: &mut Entry, graph_folder: &Path) {
    if let Content::Text(text) = &mut entry.value.content
        && let Some(path) = rebased(text, &entry.value.place, graph_folder)
    {
        *text = path;
    }
}

/// The same of all paths in a graph as it was written.
pub(super) fn rebase_all(table: &mut Table, paths: &CheckedPaths, graph_folder: &Path) {
    for entry in &mut table.entries {
        let Content::Table(inner) = &mut entry.value.content else { continue };
        if entry.key != "graph" {
            let is_path = |key: &str| key == "run" || paths.of_role(&entry.key).any(|path| path == key);
            inner.entries.iter_mut().filter(|entry| is_path(&entry.key)).for_each(|entry| {
                // A binary by name is looked for everywhere.
                let is_name = entry.key == "run" && !entry.value.text().is_some_and(|run| run.contains('/'));
                if !is_name {
                    rebase(entry, graph_folder);
                }
            });
            continue;
        }
        for group in &mut inner.entries {
            let Content::Table(inner) = &mut group.value.content else { continue };
            let is_path = |key: &str| match group.key.as_str() {
                "defaults" => paths.all().any(|path| path == key),
                "view" => key == "world",
                _ => false,
            };
            let entries = inner.entries.iter_mut().filter(|entry| is_path(&entry.key));
            entries.for_each(|entry| rebase(entry, graph_folder));
        }
    }
}

/// Whether a parameter names a file, as its schema has it.
pub(super) fn is_path(schema: &Value, key: &str) -> bool {
    let format = schema.get("properties").and_then(|properties| properties.get(key)?.get("format"));
    format.and_then(Value::as_str) == Some("path")
}

/// The way from one folder to another, both absolute: short as long as they move together.
fn from(here: &Path, there: &Path) -> PathBuf {
    let (mut up, mut down) = (here.components().peekable(), there.components().peekable());
    while up.peek().is_some() && up.peek() == down.peek() {
        up.next();
        down.next();
    }
    let way = up.map(|_| Component::ParentDir).chain(down).collect::<PathBuf>();
    if here.is_absolute() && there.is_absolute() { way } else { there.to_owned() }
}

/// A path as people would type it: relative to the current folder if it lies within.
pub(crate) fn shown(path: &Path) -> String {
    let inside =
        std::env::current_dir().ok().and_then(|here| path.strip_prefix(here).ok().map(Path::to_owned));
    let path = inside.unwrap_or_else(|| path.to_owned());
    let path = path.strip_prefix(".").unwrap_or(&path);
    if path.as_os_str().is_empty() { ".".to_owned() } else { path.display().to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_between_folders() {
        let way = |here: &str, there: &str| from(Path::new(here), Path::new(there)).display().to_string();
        assert_eq!(way("/a/b", "/a/b/c"), "c");
        assert_eq!(way("/a/b", "/a/c/d"), "../c/d");
        assert_eq!(way("/home/me/g", "/opt/corkboard/graphs"), "../../../opt/corkboard/graphs");
        assert_eq!(way("/a", "parts"), "parts");
    }
}
