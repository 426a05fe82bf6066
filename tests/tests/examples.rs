//! What the help texts show works: every example that names a graph is in order.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on shall stop")]

use std::process::Command;
use tests::launcher;

/// The commands of the launcher that take a graph.
const WITH_GRAPH: [&str; 4] = ["up", "check", "chaos", "graph"];
/// What of their options says something about the graph.
const ABOUT_GRAPH: [&str; 4] = ["--set", "--swap", "--without", "--seed"];

fn help(arguments: &[&str]) -> String {
    let output = Command::new(launcher()).args(arguments).arg("--help").output().unwrap();
    String::from_utf8(output.stdout).unwrap()
}

/// The arguments of each example that names the graph `coffee`, as far as they are about it.
fn examples(help: &str) -> Vec<Vec<String>> {
    let lines = help.lines().map(str::trim).filter_map(|line| line.strip_prefix("launch "));
    let lines = lines.map(|line| line.split("  ").next().unwrap_or(line));
    let mut examples = Vec::new();
    for line in lines {
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.len() < 2 || !WITH_GRAPH.contains(&words[0]) || words[1] != "coffee" {
            continue;
        }
        let mut kept = vec!["check".to_owned(), "coffee".to_owned(), "--no-build".to_owned()];
        for pair in words.windows(2).filter(|pair| ABOUT_GRAPH.contains(&pair[0])) {
            kept.extend([pair[0].to_owned(), pair[1].replace("\\\"", "\"").replace('\'', "")]);
        }
        examples.push(kept);
    }
    examples
}

#[test]
fn examples_that_name_a_graph_are_in_order() {
    let mut examples: Vec<Vec<String>> = examples(&help(&[]));
    for command in WITH_GRAPH {
        examples.extend(self::examples(&help(&[command])));
    }
    assert!(examples.len() > 5, "{examples:?}");
    for example in examples {
        let output = Command::new(launcher()).args(&example).output().unwrap();
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{}: {words}", example.join(" "));
    }
}
