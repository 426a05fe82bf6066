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
    let verbs = ["list", "info", "echo", "rate", "delay", "publish", "replay", "clean", "doctor", "completions"];
    let mut texts = vec![help(&["record"]), help(&[])];
    texts.extend(verbs.iter().map(|verb| help(&[verb])));
    let graph = Graph::load("coffee").set("navigator.default_order", "").start();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("ranges.bin"), [0; 64]).unwrap();
    let mut tried = 0;
    for example in texts.iter().flat_map(|text| examples(text)) {
        // Those that go on for ever are ended as by Ctrl-C; what other programs make of the words is theirs.
        let (command, _) = example.split_once(" | ").unwrap_or((example, ""));
        let command = command.replace("coffee", graph.board()).replacen("board ", "timeout -s INT 2 \"$TOOL\" ", 1);
        let named = if command.contains("--board") { "" } else { " --board \"$BOARD\"" };
        let (command, rest) = command.split_once(" || ").map_or((command.as_str(), ""), |(a, b)| (a, b));
        let (command, comment) = command.split_once("  #").map_or((command, ""), |(a, b)| (a, b));
        let (command, target) = command.split_once(" > ").map_or((command, ""), |(a, b)| (a, b));
        let _ = (rest, comment, target);
        let output = Command::new("sh")
            .args(["-c", &format!("{command}{named}")])
            .env("TOOL", &tool)
            .env("BOARD", graph.board())
            .current_dir(folder.path())
            .output()
            .unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        let code = output.status.code();
        assert!(!stderr.contains("error") && matches!(code, Some(0 | 124)) || command.contains("doctor"), "`{example}` ({code:?}): {stderr}");
        tried += 1;
    }
    assert!(tried >= 20, "only {tried} examples were found");
    let _ = graph.stop();
}
