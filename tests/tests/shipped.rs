//! Graphs and experiments as they are shipped: nothing in them counts on what is outside of the repository,
//! and what they need is asked for before anything starts.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on shall stop")]

use std::path::{Path, PathBuf};
use std::process::Command;
use tests::launcher;

fn launch(arguments: &[&str]) -> (bool, String) {
    let output = Command::new(launcher()).args(arguments).output().unwrap();
    let words = [output.stdout, output.stderr].map(|said| String::from_utf8_lossy(&said).into_owned());
    (output.status.success(), words.concat())
}

#[track_caller]
fn check_refused(arguments: &[&str], expected: &str) {
    let (succeeded, words) = launch(arguments);
    assert!(!succeeded && words.contains(expected), "{arguments:?}: {words}");
}

#[test]
fn a_graph_without_its_log_is_refused_with_the_way_to_name_one() {
    for graph in ["laser-log", "laser-map"] {
        check_refused(&["check", graph, "--no-build"], "--set log-player.file=PATH");
        let board = format!("shipped-{}", std::process::id());
        check_refused(
            &["up", graph, "--no-build", "--lockstep", "--board", &board],
            "--set log-player.file=PATH",
        );
    }
}

#[test]
fn an_experiment_leaves_out_what_lacks_its_data() {
    let arguments =
        ["experiment", "laser-logs", "--dry-run", "--no-build", "--set", "log-player.file=nowhere.log"];
    check_refused(&arguments, "`csail, file=nowhere.log` is left out: it needs ");
    check_refused(&arguments, "nothing is left to be run");
}

#[test]
fn a_misspelt_experiment_or_variant_is_guessed() {
    check_refused(&["experiment", "coffe"], "did you mean `coffee`?");
    let arguments = ["experiment", "coffee", "--dry-run", "--only", "fuzy rules"];
    check_refused(&arguments, "did you mean `fuzzy rules`?");
    check_refused(&["experiment", "coffee", "--dry-run", "--by", "default_ordr"], "navigator.default_order");
}

#[test]
fn no_path_leads_out_of_the_repository() {
    let launch = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("launch");
    let mut files = 0;
    for folder in ["graphs", "experiments", "worlds"] {
        // Of experiments most paths count from the graph's folder, which lies as deep.
        for file in std::fs::read_dir(launch.join(folder)).unwrap().map(|entry| entry.unwrap().path()) {
            if file.extension().is_some_and(|end| end == "toml") {
                files += 1;
                let value: toml::Value =
                    std::fs::read_to_string(&file).unwrap().parse::<toml::Table>().unwrap().into();
                check_paths(&file, &value);
            }
        }
    }
    assert!(files > 8, "{files} files");
}

/// Texts that climb farther than from `launch/graphs` to the top of the repository, or begin at the root.
fn check_paths(file: &Path, value: &toml::Value) {
    match value {
        toml::Value::String(text) => {
            let climbs = PathBuf::from(text).components().filter(|part| part.as_os_str() == "..").count();
            assert!(climbs <= 2 && !text.starts_with('/'), "{}: {text}", file.display());
        }
        toml::Value::Array(values) => values.iter().for_each(|value| check_paths(file, value)),
        toml::Value::Table(table) => table.values().for_each(|value| check_paths(file, value)),
        _ => {}
    }
}
