//! The queue of orders: every order counts, repeated numbers count once, impossible ones are refused with a
//! remark.

use crate::building::Building;
use messages::{FixedText, Order, OrderReport, OrderStateName, Stamped, Time};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Bytes of a remark.
const REMARK_MAX: usize = 128;
/// Orders that may wait.
const WAITING_MAX: usize = 100;
/// Numbers remembered, to know repeated orders.
const SEEN_MAX: usize = 256;
/// Orders without a number get one from here on.
const OWN_NUMBERS: u64 = 1 << 32;

/// An accepted order.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Job {
    /// Its number, not zero.
    pub order_id: u64,
    /// A room that exists.
    pub room: String,
}

/// What is known of orders, past and waiting.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct OrderBook {
    waiting: VecDeque<Job>,
    seen: VecDeque<u64>,
    own_numbers: u64,
    /// Stamp and sequence of the last order read, so that the board's last message is not taken twice after a
    /// restart.
    last_read: (u64, u64),
    default_taken: bool,
}

impl OrderBook {
    /// How many wait.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// The next order, taken out.
    pub(crate) fn next(&mut self) -> Option<Job> {
        self.waiting.pop_front()
    }

    /// Takes the order of the parameters, once in the life of this book.
    pub(crate) fn take_default(&mut self, room: &str, building: &Building) -> Option<OrderReport> {
        if self.default_taken || room.is_empty() {
            return None;
        }
        self.default_taken = true;
        Some(self.judge(0, room, building))
    }

    /// Takes an order from the board; nothing when it was taken before.
    pub(crate) fn take(
        &mut self,
        now: Time,
        order: &Stamped<'_, Order>,
        building: &Building,
    ) -> Option<OrderReport> {
        if self.last_read.0 > now.as_nanos() {
            // The clock began anew.
            self.last_read = (0, 0);
        }
        let read = (order.stamp.as_nanos(), order.sequence.saturating_add(1));
        if read <= self.last_read {
            return None;
        }
        self.last_read = read;
        Some(self.judge(order.order_id, order.room.as_str(), building))
    }

    fn judge(&mut self, order_id: u64, room: &str, building: &Building) -> OrderReport {
        let before = u32::try_from(self.waiting.len()).unwrap_or(u32::MAX);
        let (order_id, state, remark) = match self.accept(order_id, room, building) {
            Ok(Some(order_id)) => (order_id, OrderStateName::Accepted, String::new()),
            Ok(None) => (order_id, OrderStateName::Repeated, String::new()),
            Err(why) => (order_id, OrderStateName::Refused, why),
        };
        let room = FixedText::truncated(room);
        OrderReport { order_id, room, state: state.into(), before, remark: FixedText::truncated(&remark) }
    }

    /// The number of an order that is new, nothing for one that is known; the error is a remark for people.
    fn accept(&mut self, order_id: u64, room: &str, building: &Building) -> Result<Option<u64>, String> {
        if order_id != 0 && self.seen.contains(&order_id) {
            return Ok(None);
        }
        let known = building.room(room).ok_or_else(|| no_room(room, building))?;
        let home = building.home.ok_or_else(|| "the tea room is not known".to_owned())?;
        let rides = |floor: &i32| building.lift.as_ref().is_some_and(|lift| lift.floors.contains(floor));
        if known.door.floor != home.floor && !(rides(&known.door.floor) && rides(&home.floor)) {
            return Err(format!("no elevator goes to room {room}"));
        }
        if self.waiting.len() >= WAITING_MAX {
            return Err(format!("{WAITING_MAX} orders wait already; try again later"));
        }
        let order_id = if order_id == 0 {
            self.own_numbers += 1;
            OWN_NUMBERS + self.own_numbers
        } else {
            order_id
        };
        self.seen.push_back(order_id);
        if self.seen.len() > SEEN_MAX {
            self.seen.pop_front();
        }
        self.waiting.push_back(Job { order_id, room: room.to_owned() });
        Ok(Some(order_id))
    }
}

/// That there is no such room, and which there are, as many as fit into a remark.
fn no_room(room: &str, building: &Building) -> String {
    let mut rooms: Vec<&str> = building.rooms.iter().map(|room| room.name.as_str()).collect();
    rooms.sort_unstable();
    let mut words = format!("there is no room `{room}`");
    let mut gap = "; rooms: ";
    for name in rooms {
        if words.len() + gap.len() + name.len() > REMARK_MAX - " ..".len() {
            words += " ..";
            break;
        }
        words += gap;
        words += name;
        gap = ", ";
    }
    words
}
