//! What is left when a process of the board is killed.

use crate::robot::{Robot, assert_nothing_left, board_name, itself, manifest, wait_for};
use board::host::{self, Host};
use board::place::Place;
use board::switchboard::{SlotState, Switchboard, process_lives};
use board::tap::Tap;
use std::io::{BufRead as _, BufReader};
use std::process::{ExitCode, Stdio};
use std::sync::atomic::Ordering;
use std::time::Duration;

/// A host with two services, one of which leaves when it is asked, and one that does not hear.
pub(crate) fn host_process() -> ExitCode {
    let name = std::env::args().nth(1).expect("a board's name");
    let host = Host::create(&name, manifest(&[("count", "counter")]), false).expect("a board");
    let mut services = Vec::new();
    for which in ["counter", "stuck"] {
        let slot = host.prepare(which, true).expect("a free place");
        let mut command = itself(which);
        command.args(["--board", &name, "--slot", &slot.to_string()]);
        services.push(command.spawn().expect("the test binary starts itself"));
        let entry = host.switchboard().slot(slot).expect("a place");
        wait_for("the service to run", || entry.state() == SlotState::Running);
        wait_for("its step", || entry.heartbeat_ns.load(Ordering::Relaxed) > 0);
    }
    println!("up");
    loop {
        board::clock::sleep(Duration::from_secs(3600));
    }
}

pub(crate) fn a_killed_host_is_swept_with_its_services() {
    let name = board_name();
    let place = Place::new(&name).unwrap();
    let mut host = itself("host").arg(&name).stdout(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(host.stdout.take().unwrap()).read_line(&mut line).unwrap();
    assert_eq!(line, "up\n");
    assert_eq!(host::living_launcher(&place).unwrap(), Some(host.id()));
    assert!(host::sweep().unwrap().iter().all(|swept| swept.board != name), "a board that is up was swept");
    let pids: Vec<u32> = {
        let switchboard = Switchboard::open(&place.file("switchboard")).unwrap();
        switchboard.taken().map(|(_, slot)| slot.pid.load(Ordering::Relaxed)).collect()
    };
    assert_eq!(pids.len(), 2);
    host.kill().unwrap();
    host.wait().unwrap();
    assert_eq!(host::living_launcher(&place).unwrap(), None);
    let swept =
        host::sweep().unwrap().into_iter().find(|swept| swept.board == name).expect("a board was swept");
    assert!(swept.files > 10, "{swept:?}");
    assert!(swept.ended.iter().any(|(role, pid)| role == "stuck" && pids.contains(pid)), "{swept:?}");
    assert!(pids.iter().all(|&pid| !process_lives(pid)));
    assert_nothing_left(&place);
    // The name can be used again.
    Host::create(&name, manifest(&[]), false).unwrap().take_down().unwrap();
}

/// A tool that stays until it is killed.
pub(crate) fn tool_process() -> ExitCode {
    let name = std::env::args().nth(1).expect("a board's name");
    let tap = Tap::join(Place::new(&name).expect("a name"), "tool").expect("a place on the board");
    let reader = tap.reader("count").expect("a topic");
    println!("joined");
    loop {
        tap.wait(tap.bell(), Duration::from_secs(3600));
        let _ = &reader;
    }
}

pub(crate) fn a_tools_place_is_taken_over_after_its_death() {
    let mut robot = Robot::new(&[("count", "counter")]);
    robot.start("counter");
    let page = robot.host.switchboard();
    let before = page.taken().count();
    // More than a topic takes readers, and a killed one cannot give its port back.
    for _ in 0..30 {
        let mut tool = itself("tool").arg(robot.name()).stdout(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(tool.stdout.take().unwrap()).read_line(&mut line).unwrap();
        assert_eq!(line, "joined\n");
        tool.kill().unwrap();
        tool.wait().unwrap();
        assert_eq!(page.dead_tools().count(), 1);
        let cleaned = itself("cleaner").arg(robot.name()).stdout(Stdio::null()).status().unwrap();
        assert!(cleaned.success());
        // The first claim after it takes its place, if no other is free.
        assert_eq!(page.taken().count(), before);
    }
    robot.take_down();
}

/// Tries to make and to sweep boards, as a user whose folder is somebody else's.
pub(crate) fn robbed_process() -> ExitCode {
    let created = Host::create("robbed", manifest(&[]), false).map(|_| ());
    let swept = host::sweep();
    println!("{}", created.err().map_or("a board was made".to_owned(), |error| error.to_string()));
    println!("{}", swept.map_or_else(|error| error.to_string(), |swept| format!("swept {swept:?}")));
    ExitCode::SUCCESS
}

pub(crate) fn a_folder_of_somebody_else_is_left_alone() {
    // A user whom no machine has.
    const USER: u32 = 3_054_321;
    if !rustix::process::getuid().is_root() {
        println!("skipped: only root can be two users");
        return;
    }
    let folder = std::path::PathBuf::from(format!("/dev/shm/corkboard-{USER}"));
    let elsewhere = tempfile::tempdir().unwrap();
    let check = |victim: &std::path::Path| {
        std::fs::create_dir_all(victim.join("robbed")).unwrap();
        std::fs::write(victim.join("robbed/file"), "precious").unwrap();
        std::os::unix::fs::chown(victim.join("robbed"), Some(USER), None).unwrap();
        let mut command = itself("robbed");
        std::os::unix::process::CommandExt::uid(&mut command, USER);
        let Ok(output) = command.output() else {
            println!("skipped: the test binary is not another user's to run");
            return;
        };
        let said = String::from_utf8_lossy(&output.stdout);
        assert_eq!(said.matches("is not a folder of this user").count(), 2, "{said}");
        assert!(victim.join("robbed/file").exists(), "somebody else's file was removed");
    };
    check(&folder);
    std::fs::remove_dir_all(&folder).unwrap();
    // A link is worse: it may lead anywhere, and may even belong to the right user.
    std::os::unix::fs::symlink(elsewhere.path(), &folder).unwrap();
    std::os::unix::fs::lchown(&folder, Some(USER), None).unwrap();
    std::os::unix::fs::chown(elsewhere.path(), Some(USER), None).unwrap();
    check(elsewhere.path());
    std::fs::remove_file(&folder).unwrap();
}
