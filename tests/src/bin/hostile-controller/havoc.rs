//! What it does beside driving badly.

use crate::params::Mode;
use std::cell::{Cell, RefCell};
use std::os::unix::process::CommandExt as _;
use std::process::Command;
use std::time::Duration;

/// It behaves for so long after it has begun, so that the robot is at speed.
const CALM_S: f64 = 1.0;
/// What it takes of the memory in a step, and at most: the machine is to live on.
const STEP_BYTES: usize = 8 << 20;
const MOST_STEPS: usize = 128;
/// Children, and how long they live: the test is to find them, and the machine is to be rid of them at last.
const CHILDREN: u32 = 4;
const CHILD_LIVES_S: &str = "120";

thread_local! {
    static TAKEN: RefCell<Vec<Vec<u8>>> = const { RefCell::new(Vec::new()) };
    static HAS_FORKED: Cell<bool> = const { Cell::new(false) };
}

/// One step of it, `since_s` after the controller has begun.
pub(crate) fn wreak(mode: Mode, since_s: f64) {
    match mode {
        Mode::Log => {
            for line in 0..2000 {
                tracing::error!(
                    line,
                    "there is nothing to say, and it is said all the same, again and again and again"
                );
                eprintln!("not even as a line of the log: {line}");
            }
        }
        Mode::Memory => TAKEN.with_borrow_mut(|taken| {
            if taken.len() < MOST_STEPS {
                taken.push(vec![1; STEP_BYTES]);
            }
        }),
        Mode::Fork if !HAS_FORKED.replace(true) => {
            for child in 0..CHILDREN {
                let mut command = Command::new("sleep");
                command.arg(CHILD_LIVES_S);
                if child % 2 == 1 {
                    // In a group of its own, where a signal to the parent's group does not reach it.
                    command.process_group(0);
                }
                let _ = command.spawn();
            }
            let _ = Command::new("setsid").args(["sleep", CHILD_LIVES_S]).spawn();
        }
        _ if since_s < CALM_S => {}
        Mode::ExitZero => std::process::exit(0),
        Mode::ExitTwo => std::process::exit(2),
        Mode::Abort => std::process::abort(),
        Mode::Panic => panic!("it has had enough"),
        Mode::Hang => board::clock::sleep(Duration::from_secs(3600)),
        Mode::Busy => loop {
            std::hint::spin_loop();
        },
        _ => {}
    }
}
