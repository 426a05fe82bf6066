//! Whether the time-of-flight sensors see at all. "Nothing there" is the answer of an empty hallway, and also
//! that of a sensor whose light is lost: so emptiness must be confirmed now and then.

use crate::{Params, memory::Motion};
use geometry::Pose2;
use messages::{Face, RangeStatusName, Reading, TOF_COUNT, Time, TofRanges};
use std::ops::Range;

/// The sensors of each face.
const FACES: [(Face, Range<usize>); 3] = [(Face::Right, 0..2), (Face::Front, 2..6), (Face::Left, 6..8)];
/// What a neighbour sees nearer than this, a sensor sees as well.
const NEIGHBOUR_SEES_M: f32 = 0.5;
/// Farther ahead a sensor at the usual height sees the floor, which stays where it is.
const SURELY_A_THING_M: f32 = 0.9;
/// A robot does not get this far from one frame to the next.
const JUMP_M: f64 = 0.5;

/// What is known of the sensors' sight.
#[derive(Debug, Clone, Default)]
pub(crate) struct Eyes {
    /// When each last gave a distance, or said that the light came back from nowhere.
    confirmed: [Option<Time>; TOF_COUNT],
    /// How far the robot has driven since each last saw anything while a neighbour saw something.
    blind_m: [f64; TOF_COUNT],
    /// The last frame, and how far the robot has driven since it changed.
    last: Option<TofRanges>,
    frozen_m: f64,
    place: Option<Pose2>,
}

impl Eyes {
    /// Takes in a new frame.
    pub(crate) fn take(&mut self, now: Time, ranges: &TofRanges, motion: Option<Motion>) {
        let way_m = self.way_m(motion);
        for (_, sensors) in &FACES {
            let near = |sensor: usize| matches!(ranges.reading(sensor), Reading::Distance(m) if m < NEIGHBOUR_SEES_M);
            let is_near = sensors.clone().any(near);
            for sensor in sensors.clone() {
                match ranges.reading(sensor) {
                    Reading::Distance(_) => {
                        self.blind_m[sensor] = 0.0;
                        self.confirmed[sensor] = Some(now);
                    }
                    Reading::NoTarget => {
                        self.blind_m[sensor] += if is_near { way_m } else { 0.0 };
                        if !is_scatter(ranges, sensor) {
                            self.confirmed[sensor] = Some(now);
                        }
                    }
                    Reading::Ignore | Reading::Fault => {}
                }
            }
        }
        let same = self.last.replace(*ranges).is_some_and(|last| last == *ranges);
        // What is seen ahead comes nearer when the robot drives; walls beside it may well stay where they
        // are.
        let is_thing =
            |sensor: usize| matches!(ranges.reading(sensor), Reading::Distance(m) if m < SURELY_A_THING_M);
        let sees_ahead = FACES[1].1.clone().any(is_thing);
        self.frozen_m = if same && sees_ahead { self.frozen_m + way_m } else { 0.0 };
    }

    /// Whether a sensor can be believed when it sees nothing, and whether any can be believed at all.
    pub(crate) fn trusts(&self, now: Time, sensor: usize, params: &Params) -> bool {
        let limited = |way_m: f64| params.blind_way_m <= 0.0 || way_m <= params.blind_way_m;
        limited(self.frozen_m) && limited(self.blind_m[sensor]) && self.is_confirmed(now, sensor, params)
    }

    /// A sensor that cannot tell is made up for by its neighbours: half of a face is enough.
    fn is_confirmed(&self, now: Time, sensor: usize, params: &Params) -> bool {
        let is_fresh = |sensor: usize| {
            self.confirmed[sensor].is_some_and(|confirmed| now.since(confirmed) <= params.scatter_max())
        };
        let face = FACES.iter().find(|(_, sensors)| sensors.contains(&sensor));
        face.is_some_and(|(_, sensors)| {
            2 * sensors.clone().filter(|sensor| is_fresh(*sensor)).count() >= sensors.len()
        })
    }

    fn way_m(&mut self, motion: Option<Motion>) -> f64 {
        let Some(motion) = motion else { return 0.0 };
        let way_m = self.place.replace(motion.pose).map_or(0.0, |last| last.distance_m(motion.pose));
        if way_m <= JUMP_M { way_m } else { 0.0 }
    }
}

/// Whether a sensor has told of light that was too little or too scattered: that is no target, and no
/// emptiness either.
fn is_scatter(ranges: &TofRanges, sensor: usize) -> bool {
    let status = ranges.status.get(sensor).and_then(|status| status.get().ok());
    matches!(status, Some(RangeStatusName::SigmaFail | RangeStatusName::SignalFail))
}
