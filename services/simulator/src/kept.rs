//! The world goes on where it was when its simulator dies: what a successor needs.

use crate::Simulator;
use crate::elevator::KeptCar;
use geometry::Pose2;
use serde::{Deserialize, Serialize};

/// A world that is under way. Its noise is not kept: a successor draws anew.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    world_time_s: f64,
    pose: Pose2,
    floor: i32,
    contacts: u64,
    travel_m: [f64; 2],
    /// For each door, since when it moves.
    doors: Vec<Option<f64>>,
    /// For each person: whether they have set out, how far they are, and how long they have waited.
    people: Vec<(bool, f64, f64)>,
    car: Option<KeptCar>,
}

#[cfg(test)]
impl Snapshot {
    pub(crate) fn travel(&self) -> [f64; 2] {
        self.travel_m
    }
}

impl Simulator {
    /// What a successor needs.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot {
            world_time_s: self.truth.world_time_s,
            pose: self.pose,
            floor: self.truth.floor,
            contacts: self.truth.contacts,
            travel_m: [self.drive.left_travel_m, self.drive.right_travel_m],
            doors: self.doors.iter().map(|door| door.moves_since_s).collect(),
            people: self.people.iter().map(crate::people::Person::kept).collect(),
            car: self.car.as_ref().map(crate::elevator::Car::kept),
        }
    }

    /// Goes on where a predecessor was, before the first step; the wheels stand. The world of another file is
    /// left out.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        let same_world = snapshot.doors.len() == self.doors.len()
            && snapshot.people.len() == self.people.len()
            && snapshot.car.is_some() == self.car.is_some();
        if !same_world || !snapshot.pose.is_finite() || !snapshot.world_time_s.is_finite() {
            return;
        }
        self.pose = snapshot.pose;
        (self.truth.world_time_s, self.truth.floor) = (snapshot.world_time_s, snapshot.floor);
        self.truth.contacts = snapshot.contacts;
        [self.drive.left_travel_m, self.drive.right_travel_m] = snapshot.travel_m;
        for (door, since_s) in self.doors.iter_mut().zip(&snapshot.doors) {
            door.moves_since_s = *since_s;
        }
        for (person, kept) in self.people.iter_mut().zip(&snapshot.people) {
            person.go_on(*kept);
        }
        if let (Some(car), Some(kept)) = (&mut self.car, &snapshot.car) {
            car.go_on(kept);
            for floor in self.floors.iter_mut().filter(|floor| car.floors().contains(&floor.floor)) {
                floor.open(crate::obstacles::LeafOf::Elevator(0), car.opening_at(floor.floor));
            }
        }
        self.move_doors(0.0);
        self.in_contact = self.touched(self.pose, crate::obstacles::RELEASE_M);
        self.write_truth();
    }
}
