//! Says whether the robot may move: GO only while every distance sensor confirms that nothing is within a
//! private sphere around the body, STOP in every other case. Source: the coffee robot's paper, sections
//! III.A, IV.A and V.A (COF-060 to COF-070), with the gaps settled in X-23 (bad and stale readings), X-24
//! (mail cart), X-27 (sides) and X-2B (a radius for each face).
//!
//! # What the signal means
//! - STOP from the start until every sensor gave `clear_frames` clear readings in a row (COF-061, COF-070).
//! - A reading **lower than** its face's radius is a STOP at once (COF-062, COF-063); 200 mm in front, 50 mm
//!   at the sides (COF-064).
//! - "No target" is far. A broken sensor, an invalid number, or silence for more than `max_age_ms` is a STOP
//!   (COF-069).
//! - A front obstacle nearer than `memory_m` that vanishes from one reading to the next, while the robot did
//!   not back off or turn away, is remembered where it was last seen. It stops the robot like a visible one,
//!   until the sensors have been clear for `memory_release_s` without forward motion, or the robot has backed
//!   off so far that it would be seen again. Without odometry its distance counts as zero. `strict_paper`
//!   switches memory off and lets one clear frame release the stop.
//!
//! The ranges published (`front_m` and so on) are what a controller slows down by: a remembered obstacle
//! counts, and a face with a sensor that cannot be trusted reads 0.
//!
//! # What "far" has to be confirmed by
//! - A face is believed when most of what looks out of it can be read: for a laser most beams of the hull's
//!   width and margin, with no gap in which something could hide within the radius; for time-of-flight
//!   sensors half of the face's.
//! - "Too near to be measured" (-inf) is the nearest there is.
//! - Sensors that tell nothing but scattered light, that see nothing where their neighbour sees something, or
//!   whose readings do not change while the robot drives, are broken.
//!
//! # What is told beside the signal
//! The radii, so that `base-driver` holds the robot to a speed from which it stops within them, and the
//! points that are known to be near the hull (`near`): it moves the hull only where it can stop before it
//! touches one.

mod eyes;
mod laser;
mod memory;
mod near;
mod params;
#[cfg(test)]
mod tests;

pub use params::{Params, ParamsError, Sensor};

use eyes::Eyes;
use geometry::Pose2;
use laser::Scan;
use memory::{Memory, Motion};
use messages::{
    Clearance, Face, GuardReasonName, KeptSighting, NearPoint, Odometry, Once, Parameters, PoseEstimate,
    RangeScan, Reading, Stamped, TOF_COUNT, Time, TofRanges, Verdict,
};
use near::Near;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What the guard reads.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// `tof/ranges`.
    pub ranges: Option<Stamped<'a, TofRanges>>,
    /// `laser/scan`.
    pub scan: Option<Stamped<'a, RangeScan>>,
    /// `wheels/odometry`: what was seen is remembered in its frame.
    pub odometry: Option<Stamped<'a, Odometry>>,
    /// `location/pose`: the walls of the map are near too.
    pub pose: Option<Stamped<'a, PoseEstimate>>,
}

/// What the guard says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs<'a> {
    /// The header for `safety/clearance`, in every step.
    pub clearance: Clearance,
    /// The elements for `safety/clearance`: what is near, in the frame of the robot where the header says
    /// that it was.
    pub near: &'a [NearPoint],
}

/// What a successor needs to remember.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    memory: memory::Snapshot,
    near: Vec<KeptSighting>,
}

/// A pose that is older than this is not used.
const POSE_MAX_AGE: Duration = Duration::from_millis(500);

/// The place of a robot that does not know where it is.
const NOWHERE: Pose2 = Pose2 { x_m: f64::NAN, y_m: f64::NAN, heading_rad: f64::NAN };

/// The nearest reading of each face in metres; infinite when nothing is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FaceRanges {
    front_m: f64,
    right_m: f64,
    left_m: f64,
}

impl FaceRanges {
    const FAR: Self = Self { front_m: f64::INFINITY, right_m: f64::INFINITY, left_m: f64::INFINITY };

    fn of_mut(&mut self, face: Face) -> &mut f64 {
        match face {
            Face::Front => &mut self.front_m,
            Face::Right => &mut self.right_m,
            Face::Left => &mut self.left_m,
        }
    }
}

/// One sensor that looks out of one face (or, with a laser, one face).
#[derive(Debug, Clone, Copy)]
struct Channel {
    face: Face,
    /// The last usable reading and when it was taken.
    last: Option<(Time, f64)>,
    /// Whether a usable reading ever came.
    known: bool,
    faulty: bool,
    /// Clear readings in a row.
    clear: u32,
}

/// The collision guard.
#[derive(Debug, Clone)]
pub struct CollisionAvoidance {
    params: Params,
    channels: Vec<Channel>,
    eyes: Eyes,
    memory: Memory,
    near: Near,
    /// Stamp and sequence of the last frame, and when it was taken.
    frame: Once,
    /// When the newest frame was taken.
    taken: Option<Time>,
    /// Whether GO was ever said.
    confirmed: bool,
    verdict: Verdict,
    changes: u64,
}

impl CollisionAvoidance {
    /// A guard that says STOP.
    ///
    /// # Errors
    /// When the parameters make no sense, or the world file cannot be used.
    pub fn new(params: Params) -> Result<Self, ParamsError> {
        params.check()?;
        use Face::{Front, Left, Right};
        let faces: &[Face] = match params.sensor {
            Sensor::Tof => &[Right, Right, Front, Front, Front, Front, Left, Left],
            Sensor::Laser => &[Front, Right, Left],
        };
        let channel = |&face| Channel { face, last: None, known: false, faulty: false, clear: 0 };
        Ok(Self {
            channels: faces.iter().map(channel).collect(),
            near: Near::new(&params)?,
            params,
            eyes: Eyes::default(),
            memory: Memory::default(),
            frame: Once::default(),
            taken: None,
            confirmed: false,
            verdict: Verdict::Stop,
            changes: 0,
        })
    }

    /// What a successor needs to remember; it begins with STOP all the same.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot { memory: self.memory.snapshot(), near: self.near.kept() }
    }

    /// Takes over what a predecessor remembered, before the first step.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        self.memory.restore(&snapshot.memory);
        self.near.restore(&snapshot.near);
    }

    /// Judges the newest frame; a frame seen before counts once. Call it for every frame and once a
    /// heartbeat.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs<'_> {
        let motion = self.motion(now, inputs.odometry);
        match self.params.sensor {
            Sensor::Tof => {
                if let Some(ranges) = inputs.ranges.filter(|ranges| self.is_new(now, ranges)) {
                    self.take_tof(now, ranges, motion);
                }
            }
            Sensor::Laser => {
                if let Some(scan) = inputs.scan.filter(|scan| self.is_new(now, scan)) {
                    self.take_scan(now, scan, motion);
                }
            }
        }
        self.expire(now);

        let (nearest, violated) = self.faces(motion);
        let reason = self.reason(now, violated);
        let verdict = if reason == GuardReasonName::Clear { Verdict::Go } else { Verdict::Stop };
        self.changes += u64::from(verdict != self.verdict);
        self.verdict = verdict;
        self.confirmed |= verdict == Verdict::Go;
        let pose = inputs.pose.and_then(|pose| pose.fresh(now, POSE_MAX_AGE));
        self.near.show_walls(pose.map(|pose| pose.message), motion, &self.params.hull());
        let (at, near) = self.near.tell(motion, &self.params.hull());
        let at = at.unwrap_or(NOWHERE);
        Outputs {
            clearance: Clearance {
                signal: verdict.into(),
                reason: reason.into(),
                violated_faces: violated,
                front_m: nearest.front_m as f32,
                right_m: nearest.right_m as f32,
                left_m: nearest.left_m as f32,
                front_radius_m: self.params.front_radius_m as f32,
                right_radius_m: self.params.right_radius_m as f32,
                left_radius_m: self.params.left_radius_m as f32,
                max_age_ms: u32::try_from(self.params.max_age_ms).unwrap_or(u32::MAX),
                changes: self.changes,
                at_x_m: at.x_m,
                at_y_m: at.y_m,
                at_heading_rad: at.heading_rad,
            },
            near,
        }
    }

    /// Whether a frame was not seen before. One stamped farther ahead of now than readings may be old has no
    /// meaning and is not taken: it would never grow stale.
    fn is_new<T: messages::Message>(&self, now: Time, frame: &Stamped<'_, T>) -> bool {
        self.frame.is_new(frame) && frame.stamp.since(now) <= self.params.max_age()
    }

    fn motion(&self, now: Time, odometry: Option<Stamped<'_, Odometry>>) -> Option<Motion> {
        let odometry = odometry?.fresh(now, self.params.max_age())?;
        let forward_mps = odometry.forward_mps;
        forward_mps.is_finite().then_some(Motion { pose: odometry.pose().ok()?, forward_mps })
    }

    fn take_tof(&mut self, now: Time, ranges: Stamped<'_, TofRanges>, motion: Option<Motion>) {
        let taken = ranges.stamp.min(ranges.origin);
        self.frame.take(ranges);
        self.taken = Some(taken);
        self.eyes.take(now, ranges.message, motion);
        let mut readings_m = [None; TOF_COUNT];
        for (sensor, reading_m) in readings_m.iter_mut().enumerate() {
            match ranges.reading(sensor) {
                _ if !self.eyes.trusts(now, sensor, &self.params) => {}
                Reading::Distance(range_m) => *reading_m = Some(f64::from(range_m)),
                Reading::NoTarget => *reading_m = Some(f64::INFINITY),
                Reading::Ignore => continue,
                Reading::Fault => {}
            }
            self.take_reading(sensor, taken, *reading_m);
        }
        self.memory.take(now, &readings_m, motion, &self.params);
        self.near.take_tof(now, ranges.message, motion, &self.params.hull());
    }

    fn take_scan(&mut self, now: Time, message: Stamped<'_, RangeScan>, motion: Option<Motion>) {
        let taken = message.stamp.min(message.origin);
        self.frame.take(message);
        self.taken = Some(taken);
        let scan = Scan::of(&message);
        let faces = scan.as_ref().map_or([None; 3], |scan| scan.faces(&self.params));
        for (channel, reading_m) in faces.into_iter().enumerate() {
            self.take_reading(channel, taken, reading_m);
        }
        if let Some(scan) = scan {
            self.near.take_scan(now, &scan, motion, &self.params.hull());
        }
    }

    /// A reading of a channel, or `None` for a fault.
    fn take_reading(&mut self, index: usize, taken: Time, reading_m: Option<f64>) {
        let radius_m = self.params.radius_m(self.channels[index].face);
        let channel = &mut self.channels[index];
        channel.faulty = reading_m.is_none();
        channel.known |= reading_m.is_some();
        channel.last = reading_m.map(|reading_m| (taken, reading_m));
        channel.clear = match reading_m {
            Some(reading_m) if !is_within(reading_m, radius_m) => channel.clear.saturating_add(1),
            _ => 0,
        };
    }

    fn expire(&mut self, now: Time) {
        for channel in &mut self.channels {
            if channel.last.is_some_and(|(taken, _)| now.since(taken) > self.params.max_age()) {
                channel.last = None;
                channel.clear = 0;
            }
        }
    }

    /// The nearest of each face, 0 where that is not known, and the faces violated.
    fn faces(&self, motion: Option<Motion>) -> (FaceRanges, u32) {
        let mut nearest = FaceRanges::FAR;
        let mut violated = 0;
        for channel in &self.channels {
            let reading_m = channel.last.map_or(0.0, |(_, reading_m)| reading_m);
            if channel.last.is_some() && is_within(reading_m, self.params.radius_m(channel.face)) {
                violated |= channel.face as u32;
            }
            let face_m = nearest.of_mut(channel.face);
            *face_m = face_m.min(reading_m);
        }
        if let Some(remembered_m) = self.memory.nearest_m(motion, &self.params) {
            nearest.front_m = nearest.front_m.min(remembered_m);
            if is_within(remembered_m, self.params.front_radius_m) {
                violated |= Face::Front as u32;
            }
        }
        (nearest, violated)
    }

    fn reason(&self, now: Time, violated: u32) -> GuardReasonName {
        let Some(taken) = self.taken else { return GuardReasonName::Start };
        if now.since(taken) > self.params.max_age() {
            return GuardReasonName::Stale;
        }
        if self.channels.iter().any(|channel| channel.faulty) {
            return GuardReasonName::SensorFault;
        }
        if let Some(silent) = self.channels.iter().find(|channel| channel.last.is_none()) {
            return if silent.known { GuardReasonName::Stale } else { GuardReasonName::Start };
        }
        if violated != 0 {
            let seen = self.channels.iter().any(|channel| channel.clear == 0);
            return if seen { GuardReasonName::Violation } else { GuardReasonName::Remembered };
        }
        if self.channels.iter().any(|channel| channel.clear < self.params.frames_to_clear()) {
            // Before the first GO nothing was confirmed; afterwards the guard waits for calm.
            return if self.confirmed { GuardReasonName::Settling } else { GuardReasonName::Start };
        }
        GuardReasonName::Clear
    }
}

/// "Lower than the radius" (COF-063), compared in the precision of the sensors: a reading of 0.35 does not
/// violate a radius of 0.35.
fn is_within(reading_m: f64, radius_m: f64) -> bool {
    (reading_m as f32) < radius_m as f32
}
