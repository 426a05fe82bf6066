//! Nothing outside can hold up the launcher: not a terminal, not a client, not a service. The robot heals
//! meanwhile, and stops when it is asked to.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use board::clock;
use board::place::Place;
use board::switchboard::process_lives;
use board::tap::Tap;
use messages::{AppliedWheels, View, WorldTruth};
use std::io::Write as _;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use tests::{Graph, OnTerminal, Running, launcher, signal};

/// `launch up coffee` with logs of its own, on a board of its own.
struct Robot {
    board: String,
    logs: tempfile::TempDir,
}

impl Robot {
    fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let board = format!("sv{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        Self { board, logs: tempfile::tempdir().unwrap() }
    }

    fn up(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(launcher());
        command
            .args(["up", "coffee", "--no-build", "--board", &self.board, "--log-dir"])
            .arg(self.logs.path());
        command.args(arguments);
        command
    }

    fn launch(&self, arguments: &[&str]) -> Output {
        Command::new(launcher()).args(arguments).args(["--board", &self.board]).output().unwrap()
    }

    fn place(&self) -> Place {
        Place::new(&self.board).unwrap()
    }

    /// Waits until the robot drives.
    fn wait_until_driving(&self) -> Tap {
        let mut tap = None;
        until("the board is there", || {
            tap = Tap::join(self.place(), "test").ok();
            tap.is_some()
        });
        let tap = tap.unwrap();
        let mut wheels = tap.reader("wheels/applied").unwrap();
        until("the robot drives", || {
            tap.wait(tap.bell(), Duration::from_millis(5));
            let mut drives = false;
            while let Some((_, bytes)) = wheels.next() {
                drives =
                    View::<AppliedWheels>::parse(bytes).is_ok_and(|wheels| wheels.message.left_mps > 0.1);
            }
            drives
        });
        tap
    }

    fn pid(&self, role: &str) -> u32 {
        let mut pid = 0;
        until(&format!("{role} runs"), || {
            let Ok(tap) = Tap::join(self.place(), "test") else { return false };
            let mut services = board::host::services(tap.switchboard()).into_iter();
            let slot = services.find(|(_, known, _)| known == role).map(|(slot, ..)| slot);
            pid = slot
                .and_then(|slot| tap.switchboard().slot(slot))
                .map_or(0, |slot| slot.pid.load(Ordering::Acquire));
            pid != 0 && process_lives(pid)
        });
        pid
    }

    /// A service that is killed comes back.
    fn check_that_it_heals(&self, role: &str) {
        let old = self.pid(role);
        signal(old, "KILL");
        until(&format!("{role} comes back"), || !process_lives(old));
        until(&format!("{role} comes back"), || self.pid(role) != old);
    }

    fn is_gone(&self) -> bool {
        !self.place().exists() && self.place().shared_memory().is_empty()
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        let _ = board::host::clear(&self.place());
    }
}

#[track_caller]
fn until(what: &str, mut condition: impl FnMut() -> bool) {
    let deadline = clock::monotonic().after(Duration::from_secs(60));
    while !condition() {
        assert!(clock::monotonic() < deadline, "never: {what}");
        clock::sleep(Duration::from_millis(5));
    }
}

fn has_ended(child: &mut Child) -> bool {
    child.try_wait().unwrap().is_some()
}

/// Ends a launcher that a test has not ended.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_terminal_that_is_closed_stops_the_robot() {
    for arguments in [&[][..], &["--plain"], &["--lockstep", "--speed", "1"]] {
        let robot = Robot::new();
        let mut terminal = OnTerminal::start(&mut robot.up(arguments), false);
        robot.wait_until_driving();
        terminal.close();
        until("the launcher ends", || has_ended(&mut terminal.child));
        assert!(robot.is_gone(), "{arguments:?}");
    }
}

#[test]
fn a_terminal_that_stands_still_holds_up_nobody() {
    for arguments in [&[][..], &["--plain"]] {
        let robot = Robot::new();
        let mut terminal = OnTerminal::start(&mut robot.up(arguments), true);
        robot.wait_until_driving();
        // More than a terminal takes without being read.
        for _ in 0..3 {
            robot.check_that_it_heals("planner");
        }
        let stopped = robot.launch(&["stop"]);
        assert!(stopped.status.success(), "{stopped:?}");
        until("the launcher ends", || has_ended(&mut terminal.child));
        assert!(robot.is_gone(), "{arguments:?}");
    }
}

#[test]
fn keys_reach_the_launcher_through_the_view() {
    let robot = Robot::new();
    let mut terminal = OnTerminal::start(&mut robot.up(&[]), false);
    robot.wait_until_driving();
    let old = robot.pid("simulator");
    // The first service of the list, anew.
    terminal.type_keys("ry");
    until("the simulator is another process", || robot.pid("simulator") != old);
    terminal.type_keys("o999\r");
    until("the refusal is shown", || terminal.seen().contains("there is no room"));
    terminal.type_keys("q");
    until("the launcher ends", || has_ended(&mut terminal.child));
    assert!(terminal.child.wait().unwrap().success());
    assert!(robot.is_gone());
}

#[test]
fn output_that_nobody_reads_or_that_is_cut_off_holds_up_nobody() {
    for cut_off in [false, true] {
        let robot = Robot::new();
        let mut child =
            Ended(robot.up(&["--plain"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap());
        if cut_off {
            drop(child.0.stdout.take());
            drop(child.0.stderr.take());
        }
        robot.wait_until_driving();
        robot.check_that_it_heals("planner");
        signal(child.0.id(), "TERM");
        until("the launcher ends", || has_ended(&mut child.0));
        assert_eq!(child.0.wait().unwrap().code(), Some(0));
        assert!(robot.is_gone());
    }
    let robot = Robot::new();
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let output = robot.up(&["--plain", "--lockstep", "--until", "1"]).stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
}

#[test]
fn clients_that_dawdle_hold_up_nobody() {
    let robot = Robot::new();
    let mut child = Ended(robot.up(&["--plain"]).stdout(Stdio::null()).spawn().unwrap());
    robot.wait_until_driving();
    let socket = robot.place().file("control.sock");
    // Some say nothing at all, one says a letter at a time, one says too much, and one hangs up in the
    // middle.
    let mut clients: Vec<UnixStream> = (0..300).filter_map(|_| UnixStream::connect(&socket).ok()).collect();
    let mut slow = UnixStream::connect(&socket).unwrap();
    let _ = UnixStream::connect(&socket).map(|mut client| client.write_all(&vec![b'x'; 6 << 20]));
    let _ = UnixStream::connect(&socket).map(|mut client| client.write_all(b"\"status"));
    for round in 0..3 {
        let _ = slow.write_all(b"{");
        robot.check_that_it_heals("planner");
        let status = robot.launch(&["ps", "--json"]);
        assert!(status.status.success(), "{round}: {status:?}");
        clients.extend((0..100).filter_map(|_| UnixStream::connect(&socket).ok()));
    }
    let stopped = robot.launch(&["stop"]);
    assert!(stopped.status.success(), "{stopped:?}");
    until("the launcher ends", || has_ended(&mut child.0));
    assert!(robot.is_gone());
}

#[test]
fn a_launcher_that_stands_still_is_said_to_and_is_stopped_all_the_same() {
    let robot = Robot::new();
    let mut child = Ended(robot.up(&["--plain"]).stdout(Stdio::null()).spawn().unwrap());
    robot.wait_until_driving();
    signal(child.0.id(), "STOP");
    until("it stands still", || {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", child.0.id())).unwrap();
        stat.contains(") T ")
    });
    let status = robot.launch(&["ps"]);
    let words = String::from_utf8_lossy(&status.stderr).into_owned();
    assert!(!status.status.success() && words.contains("is suspended"), "{words}");
    let stopped = robot.launch(&["stop"]);
    assert!(stopped.status.success(), "{stopped:?}");
    until("the launcher ends", || has_ended(&mut child.0));
    assert!(robot.is_gone());
}

#[test]
fn in_logical_time_a_service_that_does_not_end_its_turn_holds_up_nobody() {
    for by_command in [false, true] {
        let robot = Robot::new();
        let arguments = ["--plain", "--lockstep", "--speed", "1"];
        let mut child = Ended(robot.up(&arguments).stdout(Stdio::null()).spawn().unwrap());
        robot.wait_until_driving();
        signal(robot.pid("controller"), "STOP");
        let status = robot.launch(&["ps"]);
        assert!(status.status.success(), "{status:?}");
        if by_command {
            let stopped = robot.launch(&["stop"]);
            assert!(stopped.status.success(), "{stopped:?}");
        } else {
            signal(child.0.id(), "INT");
        }
        until("the launcher ends", || has_ended(&mut child.0));
        assert!(robot.is_gone());
    }
}

#[test]
fn a_board_whose_folder_is_removed_stops_its_robot() {
    let robot = Robot::new();
    let child = robot.up(&["--plain"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    robot.wait_until_driving();
    std::fs::remove_dir_all(robot.place().root()).unwrap();
    let ended = child.wait_with_output().unwrap();
    let words = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(1), "{words}");
    assert!(words.contains("removed or replaced"), "{words}");
    assert!(robot.is_gone());
}

#[test]
fn the_end_of_a_run_is_kept_with_its_logs() {
    let home = tempfile::tempdir().unwrap();
    let board = format!("last{}", std::process::id());
    let launch = |arguments: &[&str]| {
        let mut command = Command::new(launcher());
        command.args(arguments).env("XDG_STATE_HOME", home.path()).output().unwrap()
    };
    let up = ["up", "coffee", "--no-build", "--lockstep", "--plain", "--until", "2", "--board", &board];
    assert!(launch(&up).status.success());
    let last = launch(&["last", "--json", "--board", &board]);
    let last: serde_json::Value = serde_json::from_slice(&last.stdout).unwrap();
    assert_eq!(last["run"]["end"]["code"], 0, "{last:#}");
    assert_eq!(last["run"]["mode"], "lockstep");
    assert!(last["run"]["end"]["summary"].as_str().unwrap().contains("digest"), "{last:#}");
    let folder = Path::new(last["folder"].as_str().unwrap());
    assert!(folder.starts_with(home.path()) && folder.join("planner.log").is_file());
    let logs = launch(&["logs", "launch", "--board", &board]);
    assert!(String::from_utf8_lossy(&logs.stdout).contains("ready after"), "{logs:?}");
    // Where nothing can be kept, the robot drives all the same, and says so.
    let output = Command::new(launcher()).args(up).env("XDG_STATE_HOME", "/dev/null/no").output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stdout).contains("the logs lie in shared memory"), "{output:?}");
}

/// Waits until the truth says that the robot stands.
#[track_caller]
fn wait_until_it_stands(graph: &Running) {
    let mut truth = graph.reader("world/truth");
    until("the robot stands", || {
        Running::newest::<WorldTruth>(&mut truth)
            .is_some_and(|truth| truth.left_mps == 0.0 && truth.right_mps == 0.0)
    });
}

#[test]
fn an_order_that_cannot_be_carried_out_is_refused_where_it_is_given() {
    let graph = Graph::load("coffee").set("navigator.default_order", "").start();
    wait_until_it_stands(&graph);
    let order = |room: &str| {
        Command::new(launcher()).args(["order", room, "--board", graph.board()]).output().unwrap()
    };
    for room in ["999", "", "a-very-long-name", "207\n208"] {
        let refused = order(room);
        let words = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(1), "{words}");
        assert!(words.contains("there is no room"), "{words}");
        assert!(!words.trim_end().contains('\n'), "{words:?}");
    }
    let taken = order("207");
    assert!(taken.status.success(), "{taken:?}");
}
