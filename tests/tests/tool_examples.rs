//! The examples of the `board` tool's help work, word for word, beside the coffee robot.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use std::process::Command;
use tests::{Graph, build};

/// The example lines of a help text.
fn examples(help: &str) -> impl Iterator<Item = &str> {
    let after = help.split_once("Example").map_or("", |(_, after)| after);
    after.lines().filter_map(|line| line.strip_prefix("  ")).filter(|line| line.starts_with("board "))
}

#[test]
fn every_example_works() {
    let tool = build().join("board");
    let help = |arguments: &[&str]| {
        let output = Command::new(&tool).args(arguments).arg("--help").output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    // In this order, since a replay wants a recording.
    let verbs =
        ["list", "info", "echo", "rate", "delay", "publish", "replay", "clean", "doctor", "completions"];
    let mut texts = vec![help(&["record"]), help(&[])];
    texts.extend(verbs.iter().map(|verb| help(&[verb])));
    let graph = Graph::load("coffee").set("navigator.default_order", "").start();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("ranges.bin"), [0; 64]).unwrap();
    let mut tried = 0;
    for example in texts.iter().flat_map(|text| examples(text)) {
        // What other programs and the shell make of the words is theirs.
        let ends = [" | ", " || ", " > ", "  #"].iter().filter_map(|mark| example.find(mark));
        let command = &example[..ends.min().unwrap_or(example.len())];
        // Those that go on for ever are ended as by Ctrl-C.
        let command = command.replacen("board ", "timeout -s INT 3 \"$TOOL\" ", 1);
        let command = match command.contains("--board") {
            true => command.replace("coffee", graph.board()),
            false => format!("{command} --board {}", graph.board()),
        };
        let mut shell = Command::new("sh");
        shell.args(["-c", &command]).env("TOOL", &tool).current_dir(folder.path());
        let output = shell.output().unwrap();
        let words = String::from_utf8_lossy(&output.stderr);
        // A doctor may find something on the machine of the test.
        let is_well = matches!(output.status.code(), Some(0 | 124)) || command.contains("doctor");
        assert!(is_well && !words.contains("error"), "`{example}` ended with {}: {words}", output.status);
        tried += 1;
    }
    assert!(tried >= 20, "only {tried} examples were found");
    graph.stop();
}
