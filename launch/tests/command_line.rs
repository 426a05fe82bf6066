//! The launcher's commands that start no service, with scripts in place of services.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::{Command, Output};

const SPEAKER: &str = r#"{"service":"speaker","version":"0.1.0","description":"","ports":[{"topic":"talk/words","direction":"publish","required":false,"depth":1,"wakes":false,"message":{"name":"Words","doc":"","size":8,"alignment":8,"fields":[],"element":null},"fingerprint":"00"}],"period_ns":null,"parameters":{"type":"object","properties":{"rate_hz":{"type":"number","minimum":1,"maximum":100},"quiet_hz":{"type":"number"}}},"defaults":{"rate_hz":10.0,"quiet_hz":1.0}}"#;
const LISTENER: &str = r#"{"service":"listener","version":"0.1.0","description":"","ports":[{"topic":"talk/words","direction":"queue","required":true,"depth":8,"wakes":true,"message":{"name":"Words","doc":"","size":8,"alignment":8,"fields":[],"element":null},"fingerprint":"00"}],"period_ns":null,"parameters":{"type":"object","properties":{}},"defaults":{}}"#;
const GRAPH: &str = "[graph]\nname = \"talk\"\n[speaker]\nrun = \"./speaker\"\nrate_hz = 20\n[listener]\nrun = \"./listener\"\n";

/// A folder with two services and a graph.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    // The script refuses what the schema cannot: `quiet_hz` above `rate_hz`.
    let speaker = format!(
        "#!/bin/sh\ncase \"$3\" in *'\"quiet_hz\":50'*) echo 'error: quiet_hz = 50 is above rate_hz' >&2; exit 2;; esac\ncat <<'END'\n{SPEAKER}\nEND\n"
    );
    script(&folder.path().join("speaker"), &speaker);
    script(&folder.path().join("listener"), &format!("#!/bin/sh\ncat <<'END'\n{LISTENER}\nEND\n"));
    script(&folder.path().join("hangs"), "#!/bin/sh\nsleep 60 &\nwait\n");
    script(&folder.path().join("crashes"), "#!/bin/sh\nkill -SEGV $$\n");
    script(&folder.path().join("babbles"), "#!/bin/sh\necho hello\n");
    std::fs::write(folder.path().join("talk.toml"), GRAPH).unwrap();
    folder
}

fn script(path: &Path, text: &str) {
    std::fs::write(path, text).unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

fn launch(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_launch"));
    command.args(arguments).current_dir(folder).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[track_caller]
fn check(arguments: &[&str], code: i32, stdout: &str, stderr: &str) {
    let folder = folder();
    let output = launch(folder.path(), arguments);
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(code), "{out}{err}");
    assert!(out.contains(stdout), "no `{stdout}` in stdout:\n{out}{err}");
    assert!(err.contains(stderr), "no `{stderr}` in stderr:\n{out}{err}");
    assert!(!err.contains('\u{1b}'), "colours without a terminal: {err}");
}

#[test]
fn a_graph_is_found_by_name_and_by_path() {
    check(&["check", "talk", "--no-build"], 0, "in order talk.toml: 2 services, 1 topic, seed 1", "");
    check(&["check", "./talk.toml", "--no-build"], 0, "in order talk.toml", "");
    check(
        &["check", "nowhere/talk.toml", "--no-build"],
        1,
        "",
        "error: cannot read the graph file nowhere/talk.toml",
    );
    check(&["check", "no-such-graph", "--no-build"], 1, "", "error: there is no graph `no-such-graph`");
}

#[test]
fn a_wrong_graph_is_refused_with_file_and_line() {
    let expected = "talk.toml:5:11: error: `rate_hz` of `speaker` is 200";
    let folder = folder();
    std::fs::write(folder.path().join("talk.toml"), GRAPH.replace("20", "200")).unwrap();
    let output = launch(folder.path(), &["check", "talk", "--no-build"]);
    assert_eq!(output.status.code(), Some(1));
    let err = text(&output.stderr);
    assert!(err.starts_with(expected), "{err}");
    assert!(err.ends_with("1 error; no process was started\n"), "{err}");
}

#[test]
fn what_the_binary_refuses_is_refused() {
    let set = ["check", "talk", "--no-build", "--set", "speaker.quiet_hz=50"];
    check(
        &set,
        1,
        "",
        "command line: error: `speaker` refuses its parameters: quiet_hz = 50 is above rate_hz",
    );
}

#[test]
fn a_binary_that_is_no_service_is_named() {
    let swap = |binary| check_swap(&format!("speaker=./{binary}"));
    swap("hangs").contains_or_panic("does not say what it is: no answer within 10 s in which it only waited");
    swap("crashes").contains_or_panic("does not say what it is: signal: 11");
    swap("babbles").contains_or_panic("its answer is no interface");
    swap("missing").contains_or_panic("there is no binary `./missing`");
}

fn check_swap(argument: &str) -> Complaint {
    let folder = folder();
    let output = launch(folder.path(), &["check", "talk", "--no-build", "--swap", argument]);
    assert_eq!(output.status.code(), Some(1));
    Complaint(text(&output.stderr))
}

struct Complaint(String);

impl Complaint {
    #[track_caller]
    fn contains_or_panic(&self, part: &str) {
        assert!(self.0.contains(part), "no `{part}` in:\n{}", self.0);
    }
}

#[test]
fn the_verdict_as_json() {
    let folder = folder();
    let output = launch(folder.path(), &["check", "talk", "--no-build", "--json", "--seed", "7"]);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["ok"], true);
    assert_eq!(json["graph"]["seed"], 7);
    assert_eq!(
        json["graph"]["services"][0]["parameters"],
        serde_json::json!({ "quiet_hz": 1.0, "rate_hz": 20 })
    );
    assert_eq!(json["graph"]["topics"][0]["publisher"]["service"], "speaker");
    let output = launch(folder.path(), &["check", "talk", "--no-build", "--json", "--without", "speaker"]);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["ok"], false);
    assert_eq!(json["problems"][0]["place"]["line"], 6);
}

#[test]
fn drawings_and_completions() {
    check(&["graph", "talk", "--no-build"], 0, "flowchart LR\n  s0[\"speaker\"]", "");
    check(&["graph", "talk", "--no-build", "--dot"], 0, "t0 -> s1 [style=bold, penwidth=2.5];", "");
    for shell in ["bash", "zsh", "fish"] {
        check(&["completions", shell], 0, "launch", "");
    }
    check(&["--help"], 0, "launch up coffee", "");
    check(&["bogus"], 2, "", "unrecognized subcommand");
}
