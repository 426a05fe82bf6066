//! A service that is killed at any instant of its start-up harms nobody.

use crate::robot::{PATIENCE, Robot, await_message, itself, wait_for};
use crate::services::Count;
use board::clock;
use board::host;
use board::switchboard::SlotState;
use std::process::{ExitCode, Stdio};
use std::time::Duration;

/// Kills; the environment may ask for more.
const KILLS: u64 = 150;

/// The helper that cleans up, as the launcher starts one.
pub(crate) fn cleaner_process() -> ExitCode {
    let name = std::env::args().nth(1).expect("a board's name");
    match host::clean_dead(&name) {
        Ok(failures) => {
            println!("{failures}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

#[derive(Debug, Default)]
struct Tally {
    cleanings: u64,
    failed: u64,
    hung: u64,
    slowest_ms: u128,
}

pub(crate) fn deaths_during_start_up_break_nothing() {
    let kills =
        std::env::var("CORKBOARD_TEST_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(KILLS);
    let verbose = std::env::var_os("CORKBOARD_TEST_VERBOSE").is_some();
    let robot = Robot::new(&["count", "relayed", "seen"].map(|topic| (topic, "many-ports")));
    let mut random = 0x9e37_79b9_7f4a_7c15_u64;
    let mut next = || {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        random
    };
    let mut tally = Tally::default();
    let mut window = Duration::from_millis(40);
    for kill in 0..kills {
        let slot = robot.host.prepare("many-ports", true).expect("a free place");
        let mut command = robot.command("many-ports");
        command.args(["--slot", &slot.to_string()]).stderr(Stdio::null());
        let began = clock::monotonic();
        let mut service = command.spawn().unwrap();
        let entry = robot.host.switchboard().slot(slot).unwrap();
        if kill == 0 {
            // Undisturbed, to know how long a start-up takes here and now.
            wait_for("the first start", || entry.state() == SlotState::Running);
            window = clock::monotonic().since(began).mul_f64(1.2).min(Duration::from_millis(200));
        } else {
            clock::sleep(Duration::from_nanos(next() % window.as_nanos() as u64));
        }
        service.kill().unwrap();
        service.wait().unwrap();
        robot.host.switchboard().release(slot);
        // Not after each death: they may come faster than a helper is started.
        if next() % 3 != 0 {
            clean(&robot, &mut tally);
        }
    }
    // What was half made may be a second old before it counts as left behind.
    clock::sleep(Duration::from_millis(1100));
    clean(&robot, &mut tally);
    clean(&robot, &mut tally);
    if verbose {
        println!("window {window:?}, {tally:?}");
    }
    assert_eq!(tally.hung, 0, "{tally:?}");
    let mut robot = robot;
    let tap = robot.tap();
    let mut count = tap.reader("count").unwrap();
    let began = clock::monotonic();
    robot.start("many-ports");
    let joined = clock::monotonic().since(began);
    await_message::<Count>(&tap, &mut count, |_, message| message.number > 10);
    if verbose {
        println!("joined after {joined:?}");
    }
    drop((count, tap));
    robot.take_down();
}

fn clean(robot: &Robot, tally: &mut Tally) {
    let began = clock::monotonic();
    let mut cleaner = itself("cleaner")
        .arg(robot.name())
        .stdout(Stdio::null())
        .stderr(if std::env::var_os("CORKBOARD_TEST_VERBOSE").is_some() {
            Stdio::inherit()
        } else {
            Stdio::null()
        })
        .spawn()
        .unwrap();
    tally.cleanings += 1;
    let deadline = began.after(PATIENCE.min(Duration::from_secs(5)));
    loop {
        if let Some(status) = cleaner.try_wait().unwrap() {
            tally.failed += u64::from(!status.success());
            tally.slowest_ms = tally.slowest_ms.max(clock::monotonic().since(began).as_millis());
            return;
        }
        if clock::monotonic() > deadline {
            tally.hung += 1;
            if let Some(script) = std::env::var_os("CORKBOARD_TEST_ON_HANG") {
                let _ = std::process::Command::new(script)
                    .args([&cleaner.id().to_string(), robot.name()])
                    .status();
            }
            cleaner.kill().unwrap();
            cleaner.wait().unwrap();
            return;
        }
        clock::sleep(Duration::from_millis(1));
    }
}
