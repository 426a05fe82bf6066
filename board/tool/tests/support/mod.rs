//! A board without services, and the tool beside it.
#![allow(dead_code, reason = "each test binary uses some of it")]
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use board::host::Host;
use board::manifest::{Manifest, Topic};
use messages::{Message as _, Order, Path, WheelSpeeds};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

/// A board with a few topics, and nobody on it.
pub(crate) fn host(name: &str) -> Host {
    let topic = |name: &str, message| Topic {
        name: name.into(),
        publisher: (name != "mission/order").then(|| "somebody".into()),
        readers: vec!["listener".into()],
        depth: 64,
        elements: 64,
        message,
    };
    let topics = vec![
        topic("wheels/desired", WheelSpeeds::description()),
        topic("plan/path", Path::description()),
        topic("mission/order", Order::description()),
        topic("health/somebody", messages::Health::description()),
    ];
    Host::create(name, Manifest { graph: "test".into(), seed: 5, topics, ..Manifest::default() }, false)
        .unwrap()
}

/// The tool, with JSON, begun.
pub(crate) fn tool(board: &str, arguments: &[&str]) -> Child {
    begun(command(board, arguments).arg("--json"))
}

/// The tool for a board, not yet begun.
pub(crate) fn command(board: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_board"));
    command.args(["--board", board]).args(arguments);
    command
}

/// Begins a command whose words can be had.
pub(crate) fn begun(command: &mut Command) -> Child {
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// What the tool says for people, and its exit code: standard output and error.
#[track_caller]
pub(crate) fn said(board: &str, arguments: &[&str]) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = begun(&mut command(board, arguments)).wait_with_output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let (stdout, stderr) = (text(stdout), text(stderr));
    assert!(!stderr.contains("panicked"), "{arguments:?}: {stderr}");
    (status.code(), stdout, stderr)
}

/// What a tool says that does what it is asked.
#[track_caller]
pub(crate) fn succeeds(child: Child) -> serde_json::Value {
    let Output { status, stdout, stderr } = child.wait_with_output().unwrap();
    assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
    serde_json::from_slice(&stdout).unwrap()
}

/// Waits for a condition.
#[track_caller]
pub(crate) fn wait_for(mut condition: impl FnMut() -> bool) {
    let deadline = board::clock::monotonic().after(Duration::from_secs(20));
    while !condition() {
        assert!(board::clock::monotonic() < deadline, "nothing happened for 20 s");
        board::clock::sleep(Duration::from_millis(5));
    }
}
