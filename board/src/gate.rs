//! Lockstep: messages from outside come between two instants, so that either all steps of an instant see them or none does.
//!
//! One word on the switchboard. Closed while an instant is played. Who wants to publish says so (`WISHED`); the conductor opens the gate when the
//! instant is over, and goes on when the message is there. While the conductor is at rest, the gate stays open.

use crate::clock;
use crate::switchboard::Switchboard;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

const CLOSED: u32 = 0;
const WISHED: u32 = 1;
const OPEN: u32 = 2;
const USED: u32 = 3;
/// Open, and somebody has come and gone.
const LEFT: u32 = 4;

/// Between two looks at the word of whoever waits for it. An instant takes some tens of microseconds.
const LOOK: Duration = Duration::from_micros(20);
/// A conductor that does not open for so long is none, or hangs; then it does not matter any more what its steps see.
const PATIENCE: Duration = Duration::from_secs(3);
/// So long the conductor keeps the gate open for somebody who wished: who does not come has died.
const COURTESY: Duration = Duration::from_millis(20);
/// So long a message may take: who is not done then has died with the gate in hand.
const USE_LIMIT: Duration = Duration::from_millis(200);

/// For tools: acts between two instants.
pub(crate) fn between_instants<R>(board: &Switchboard, act: impl FnOnce() -> R) -> R {
    let gate = &board.header().gate;
    let deadline = clock::monotonic().after(PATIENCE);
    let enter = || change(gate, OPEN, USED) || change(gate, LEFT, USED);
    let mut entered = enter();
    while !entered && clock::monotonic() < deadline {
        change(gate, CLOSED, WISHED);
        clock::sleep(LOOK);
        entered = enter();
    }
    let result = act();
    if entered {
        change(gate, USED, LEFT);
    }
    result
}

/// For the conductor, when an instant is over: lets in whoever wishes. Costs one load when nobody does.
pub fn let_in(board: &Switchboard) {
    let gate = &board.header().gate;
    if gate.load(Ordering::Acquire) == CLOSED {
        return;
    }
    open(board);
    let deadline = clock::monotonic().after(COURTESY);
    while gate.load(Ordering::Acquire) == OPEN && clock::monotonic() < deadline {
        clock::sleep(LOOK);
    }
    close(board);
}

/// For the conductor, when it comes to rest: who wants to publish may.
pub fn open(board: &Switchboard) {
    board.header().gate.store(OPEN, Ordering::Release);
}

/// For the conductor, before it goes on.
pub fn close(board: &Switchboard) {
    let gate = &board.header().gate;
    let deadline = clock::monotonic().after(USE_LIMIT);
    while clock::monotonic() < deadline {
        let seen = gate.load(Ordering::Acquire);
        if seen != USED && change(gate, seen, CLOSED) {
            return;
        }
        clock::sleep(LOOK);
    }
    gate.store(CLOSED, Ordering::Release);
}

fn change(gate: &AtomicU32, from: u32, to: u32) -> bool {
    gate.compare_exchange(from, to, Ordering::AcqRel, Ordering::Acquire).is_ok()
}
