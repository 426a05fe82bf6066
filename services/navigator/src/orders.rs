//! The queue of orders: every order counts, repeated numbers count once, impossible ones are refused with a remark.

use crate::building::Building;
use messages::{Order, Stamped, Time};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

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
    /// Stamp and sequence of the last order read, so that the board's last message is not taken twice after a restart.
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
    pub(crate) fn take_default(&mut self, room: &str, building: &Building) -> Result<(), String> {
        if self.default_taken || room.is_empty() {
            return Ok(());
        }
        self.default_taken = true;
        self.accept(0, room, building)
    }

    /// Takes an order from the board. The error is a remark for people.
    pub(crate) fn take(
        &mut self,
        now: Time,
        order: &Stamped<'_, Order>,
        building: &Building,
    ) -> Result<(), String> {
        if self.last_read.0 > now.as_nanos() {
            // The clock began anew.
            self.last_read = (0, 0);
        }
        let read = (order.stamp.as_nanos(), order.sequence.saturating_add(1));
        if read <= self.last_read {
            return Ok(());
        }
        self.last_read = read;
        self.accept(order.order_id, order.room.as_str(), building)
    }

    fn accept(&mut self, order_id: u64, room: &str, building: &Building) -> Result<(), String> {
        if order_id != 0 && self.seen.contains(&order_id) {
            return Ok(());
        }
        let known = building.room(room).ok_or_else(|| format!("refused: there is no room `{room}`"))?;
        let home = building.home.ok_or_else(|| "refused: the tea room is not known".to_owned())?;
        let rides = |floor: &i32| building.lift.as_ref().is_some_and(|lift| lift.floors.contains(floor));
        if known.door.floor != home.floor && !(rides(&known.door.floor) && rides(&home.floor)) {
            return Err(format!("refused: no elevator to room {room}"));
        }
        if self.waiting.len() >= WAITING_MAX {
            return Err(format!("refused: {WAITING_MAX} orders wait before room {room}"));
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
        Ok(())
    }
}
