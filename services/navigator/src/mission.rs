//! Where a delivery stands: the part of the navigator that must survive its process.

use crate::building::{Building, Spot};
use crate::orders::{Job, OrderBook};
use messages::DeliveryStatusName;
use serde::{Deserialize, Serialize};

/// The steps of a delivery (note 2.4).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// Waiting for an order.
    #[default]
    Idle,
    /// An order was just taken.
    Ordered,
    /// On the way to the tea room.
    Collecting,
    /// Loading there.
    Loading,
    /// On the way to the place where the search for the door begins.
    Travelling,
    /// Searching the door, and halting at it.
    NearDoor,
    /// Waiting there for the coffee to be taken.
    AtDoor,
    /// It was taken.
    Delivered,
    /// On the way home.
    Returning,
}

/// The steps of a ride.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ride {
    /// No ride is needed.
    #[default]
    None,
    /// Driving to the place before the elevator.
    Approaching,
    /// Waiting there for an open car.
    Waiting,
    /// Driving in.
    Entering,
    /// In the car.
    Riding,
    /// Driving out.
    Leaving,
}

/// All that a navigator has to know to go on with a delivery where another one, or its own process before it
/// was killed, left off.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Snapshot {
    /// Orders, past and waiting.
    pub orders: OrderBook,
    /// The order being served.
    pub job: Option<Job>,
    /// Where it stands.
    pub stage: Stage,
    /// Where the ride stands.
    pub ride: Ride,
    /// Direction in which the door of this order is passed, in (-π, π].
    pub door_heading_rad: f64,
    /// Orders delivered.
    pub delivered: u64,
    /// Paths asked for.
    pub plans: u64,
    /// The number of the last path asked for.
    pub request_id: u64,
    /// The number of the last call of the elevator.
    pub call_id: u64,
}

impl Snapshot {
    /// The status by name, before troubles.
    pub(crate) fn status(&self) -> DeliveryStatusName {
        if self.ride != Ride::None {
            return DeliveryStatusName::Elevator;
        }
        match self.stage {
            Stage::Idle => DeliveryStatusName::Idle,
            Stage::Ordered => DeliveryStatusName::Ordered,
            Stage::Collecting | Stage::Loading => DeliveryStatusName::Collecting,
            Stage::Travelling => DeliveryStatusName::Travelling,
            Stage::NearDoor => DeliveryStatusName::NearDoor,
            Stage::AtDoor => DeliveryStatusName::AtDoor,
            Stage::Delivered => DeliveryStatusName::Delivered,
            Stage::Returning => DeliveryStatusName::Returning,
        }
    }

    /// The door of the order being served: its middle, and the unit vector into the room.
    pub(crate) fn door(&self, building: &Building) -> Option<(Spot, [f64; 2])> {
        let room = building.room(&self.job.as_ref()?.room)?;
        Some((room.door, room.into))
    }
}
