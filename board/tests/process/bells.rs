//! Wake-ups between two processes: none may be lost.

use crate::robot::{PATIENCE, itself};
use board::clock;
use board::switchboard::Switchboard;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Duration;

const PING: u32 = 0;
const PONG: u32 = 1;
/// As often on two processors, where they race, as on one, where each has to be woken.
const APART: u64 = 30_000;
const TOGETHER: u64 = 70_000;

pub(crate) fn bells_wake_across_processes() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("page");
    let switchboard = Switchboard::create(&page).unwrap();
    for slot in [PING, PONG] {
        assert_eq!(switchboard.claim("bell", std::process::id(), false), Some(slot));
    }
    for slot in [PING, PONG] {
        switchboard.topic(slot).unwrap().set_wake(1 - slot, true);
    }
    let mut other = itself("bell").arg(&page).spawn().unwrap();
    let result = exchange(&switchboard, PING);
    assert!(other.wait().unwrap().success(), "the other process missed a wake-up");
    result.unwrap();
}

/// The process at the other end.
pub(crate) fn other_process() -> ExitCode {
    let page = std::env::args().nth(1).expect("the page's path");
    let switchboard = Switchboard::open(Path::new(&page)).expect("a page");
    match exchange(&switchboard, PONG) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Counts to and fro, each waiting for the other without looking at a clock.
fn exchange(switchboard: &Switchboard, side: u32) -> Result<(), String> {
    let before = rustix::thread::sched_getaffinity(None).map_err(|error| error.to_string())?;
    let (own, others) = (switchboard.topic(side).unwrap(), switchboard.topic(1 - side).unwrap());
    let slot = switchboard.slot(side).unwrap();
    for number in 1..=APART + TOGETHER {
        if number == APART {
            let mut one = rustix::thread::CpuSet::new();
            one.set((0..1024).find(|&processor| before.is_set(processor)).unwrap_or(0));
            rustix::thread::sched_setaffinity(None, &one).map_err(|error| error.to_string())?;
        }
        if side == PING {
            own.count.store(number, Ordering::Release);
            switchboard.ring_readers(side);
        }
        loop {
            let heard = slot.bell();
            if others.count.load(Ordering::Acquire) == number {
                break;
            }
            let since = clock::monotonic();
            slot.wait(heard, Some(PATIENCE));
            let slept = clock::monotonic().since(since);
            if slept >= PATIENCE - Duration::from_millis(10) {
                return Err(format!("side {side} was not woken for message {number}"));
            }
        }
        if side == PONG {
            own.count.store(number, Ordering::Release);
            switchboard.ring_readers(side);
        }
    }
    rustix::thread::sched_setaffinity(None, &before).map_err(|error| error.to_string())
}
