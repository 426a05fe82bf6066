//! Where the robot is, from the ranges or positions of its radio tag, odometry, and the side sensors as a
//! cross-check (COF-009).
//!
//! A bank of extended Kalman filters with probabilistic data association (Bar-Shalom, Willett and Tian 2011):
//! a range is good, or it is from anywhere, and an anchor that was wrong tends to stay wrong, because what
//! deflects or delays its signal stays where it is. Without a pose to begin with, every place where circles
//! around anchors cross is tried with twelve headings, and driving tells them apart. Nothing is random, and a
//! step allocates nothing.

mod anchors;
mod bank;
mod corrections;
mod hypothesis;
mod params;
mod places;
mod walls;

#[cfg(test)]
mod tests;

pub use params::{Params, ParamsError, Start};
pub use walls::HallwayWalls;

use anchors::{AnchorBits, Anchors};
use bank::{Bank, Estimate, HEADINGS};
use geometry::Pose2;
use hypothesis::{Hypothesis, MotionNoise, RangeReading};
use messages::{
    ANCHOR_CAPACITY, HeadingCorrection, LocationStateName, Odometry, Once, Parameters, PoseEstimate, Stamped,
    TagRanges, Time, TofRanges,
};
use places::{PLACE_LIMIT, Places};
use serde::{Deserialize, Serialize};

/// What a step sees. A message seen before is recognised by its stamp and count, and not used again, odometry
/// excepted, which is a state.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// Dead reckoning; its increments are used.
    pub odometry: Option<Stamped<'a, Odometry>>,
    /// What the tag heard.
    pub tag: Option<Stamped<'a, TagRanges>>,
    /// The time-of-flight sensors.
    pub ranges: Option<Stamped<'a, TofRanges>>,
    /// The angle to the hallway's wall.
    pub heading: Option<Stamped<'a, HeadingCorrection>>,
}

/// What a step says.
#[derive(Debug, Clone, Copy)]
pub struct Outputs {
    /// The estimate; state `Unknown` until place and heading are known.
    pub pose: PoseEstimate,
}

/// Heading and place must be this certain before the first `Tracking`.
const KNOWN_SIGMA_M: f64 = 0.7;
const KNOWN_SIGMA_RAD: f64 = 0.5;
/// From this share of rejected readings on, averaged over about ten, the estimate is degraded.
const MANY_REJECTED: f64 = 0.3;
/// From this share of side readings on that contradict the walls, though they agree with each other, averaged
/// over about ten frames, the estimate is degraded.
const SIDES_DISAGREE: f64 = 0.8;
/// Uncertainty that each tag message adds, so that a robot at rest can still be pushed.
const RESTLESS_SIGMA_M: f64 = 0.005;
const RESTLESS_SIGMA_RAD: f64 = 0.001;

/// The localiser.
#[derive(Debug, Clone)]
pub struct TagLocaliser {
    params: Params,
    walls: HallwayWalls,
    bank: Bank,
    anchors: Anchors,
    odometry: Option<Pose2>,
    seen: Seen,
    floor: Option<i32>,
    /// Another floor that lately sent, and how many messages in a row.
    other_floor: (i32, u32),
    accepted: u64,
    rejected: u64,
    /// Moving averages: 1 for a rejected reading, 1 for a side reading that contradicts the walls.
    rejected_share: f64,
    disagreeing_sides: f64,
    /// Tag messages in a row that the estimate does not explain.
    unexplained: u32,
    /// Whether the pose was known once.
    known: bool,
}

/// The least uncertainty of a belief that was taken over: it is some moments old.
const RESTORED_SIGMA_M: f64 = 0.05;
const RESTORED_SIGMA_RAD: f64 = 0.01;

/// Where a predecessor believed the robot, and what odometry said then.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    pose: [f64; 3],
    sigma_m: f64,
    sigma_rad: f64,
    floor: i32,
    odometry: Option<[f64; 3]>,
}

/// The stamps, and publisher's counts, of the messages used last.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    tag: Once,
    ranges: Option<Time>,
    heading: Once,
}

impl TagLocaliser {
    /// A localiser that knows the walls; pass the default for none.
    ///
    /// # Errors
    /// When the parameters make no sense.
    pub fn new(params: Params, walls: HallwayWalls) -> Result<Self, ParamsError> {
        params.check()?;
        let mut bank = Bank::new();
        if let Some(start) = params.start {
            let pose = Pose2::new(start.x_m, start.y_m, start.heading_rad);
            bank.push(Hypothesis::new(pose, start.sigma_m, start.sigma_rad, 0.0, params.outlier_chance));
        }
        Ok(Self {
            floor: params.start.map(|start| start.floor),
            known: false,
            params,
            walls,
            bank,
            anchors: Anchors::new(),
            odometry: None,
            seen: Seen::default(),
            other_floor: (0, 0),
            accepted: 0,
            rejected: 0,
            rejected_share: 0.0,
            disagreeing_sides: 0.0,
            unexplained: 0,
        })
    }

    /// What a successor needs to go on where this one was; `None` while the robot is not known to be
    /// anywhere.
    pub fn snapshot(&self) -> Option<Snapshot> {
        let best = self.bank.estimate().filter(|best| self.known && best.sigma_m() < KNOWN_SIGMA_M)?;
        let pair = |pose: Pose2| [pose.x_m, pose.y_m, pose.heading_rad];
        Some(Snapshot {
            pose: pair(best.pose),
            sigma_m: best.sigma_m(),
            sigma_rad: best.sigma_rad(),
            floor: self.floor?,
            odometry: self.odometry.map(pair),
        })
    }

    /// Takes over the belief of a predecessor, before the first step. Odometry tells how far the robot went
    /// meanwhile.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        let Snapshot { pose, sigma_m, sigma_rad, floor, odometry } = *snapshot;
        let numbers = pose.into_iter().chain(odometry.into_iter().flatten()).chain([sigma_m, sigma_rad]);
        if !numbers.into_iter().all(f64::is_finite) {
            return;
        }
        let of = |[x_m, y_m, heading_rad]: [f64; 3]| Pose2::new(x_m, y_m, heading_rad);
        let (sigma_m, sigma_rad) = (sigma_m.max(RESTORED_SIGMA_M), sigma_rad.max(RESTORED_SIGMA_RAD));
        self.bank = Bank::new();
        self.bank.push(Hypothesis::new(of(pose), sigma_m, sigma_rad, 0.0, self.params.outlier_chance));
        (self.floor, self.odometry, self.known) = (Some(floor), odometry.map(of), true);
    }

    /// Moves the belief with odometry, corrects it with what is new, and says where the robot is.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs {
        if let Some(odometry) = inputs.odometry {
            self.advance(&odometry);
        }
        if let Some(tag) = inputs.tag
            && self.seen.tag.take(tag).is_some()
        {
            self.hear(&tag);
        }
        if let Some(heading) = inputs.heading
            && self.seen.heading.take(heading).is_some()
        {
            self.turn_to_wall(&heading);
        }
        if let Some(ranges) = inputs.ranges
            && self.sides_are_due(ranges.stamp)
        {
            self.feel_walls(&ranges);
        }
        Outputs { pose: self.estimate(now) }
    }

    fn advance(&mut self, odometry: &Odometry) {
        let Ok(pose) = odometry.pose() else { return };
        let motion = self.odometry.map_or(Pose2::IDENTITY, |last| last.to(pose));
        self.odometry = Some(pose);
        if motion.position().coords.norm() > self.params.odometry_jump_m {
            // The driver began anew, or drove unseen; nothing is known of the motion but that it was not
            // this.
            self.bank.blur(0.5, 0.2);
            return;
        }
        let noise = MotionNoise {
            distance_sigma_m: self.params.distance_sigma_m,
            drift_sigma_rad: self.params.drift_sigma_rad,
            turn_sigma_rad: self.params.turn_sigma_rad,
        };
        self.bank.advance(motion, noise);
    }

    fn hear(&mut self, tag: &TagRanges) {
        if !self.is_on_floor(tag.floor) {
            self.reject(tag.heard().len().max(1));
            return;
        }
        let mut usable = [RangeReading::default(); ANCHOR_CAPACITY];
        let count = self.usable_ranges(tag, &mut usable);
        let readings = &usable[..count];
        let position = if count < 2 { self.usable_position(tag) } else { None };
        self.bank.blur(RESTLESS_SIGMA_M, RESTLESS_SIGMA_RAD);
        if self.bank.is_empty() {
            self.begin(readings, position, antenna_of(tag));
            if self.bank.is_empty() {
                return;
            }
        }
        let mut explained = 0;
        for reading in readings {
            let share = self.bank.hear(reading, self.params.outlier_chance, self.params.recovery_chance);
            let good = share > 0.5;
            explained += usize::from(good);
            self.anchors.judge(reading.slot, good, reading.range_m);
            if good { self.accept() } else { self.reject(1) }
        }
        if let Some(place) = position {
            let good = self.place_at(place, antenna_of(tag));
            explained += usize::from(good);
            if good { self.accept() } else { self.reject(1) }
        }
        self.bank.grow_stale();
        self.bank.tidy();
        self.try_elsewhere(readings, explained, antenna_of(tag));
    }

    /// Whether a message from the anchors of a floor is of the robot's floor; changes the floor after enough
    /// of them.
    fn is_on_floor(&mut self, floor: i32) -> bool {
        match self.floor {
            None => self.floor = Some(floor),
            Some(own) if own == floor => {}
            Some(_) => {
                let (last, times) = self.other_floor;
                let times = if last == floor { times + 1 } else { 1 };
                self.other_floor = (floor, times);
                if times < self.params.floor_messages {
                    return false;
                }
                self.floor = Some(floor);
            }
        }
        self.other_floor = (floor, 0);
        true
    }

    /// Ranges that are numbers, of enough quality, no nearer than the anchor's height and no farther than
    /// radio reaches; the others are rejected.
    fn usable_ranges(&mut self, tag: &TagRanges, usable: &mut [RangeReading; ANCHOR_CAPACITY]) -> usize {
        let (floor, antenna_m) = (tag.floor, antenna_of(tag));
        self.anchors.begin(tag.heard().len());
        let mut count = 0;
        for anchor in tag.heard() {
            let numbers = [anchor.x_m, anchor.y_m, anchor.z_m, anchor.range_m, tag.antenna_z_m];
            let finite = numbers.iter().all(|number| number.abs() < 1e6);
            let rise_m = anchor.z_m - tag.antenna_z_m;
            let nearest_m = rise_m.abs() - 4.0 * self.params.range_sigma_m;
            let reading = finite
                && anchor.range_m > nearest_m.max(0.0)
                && anchor.range_m <= self.params.longest_range_m
                && f64::from(anchor.quality_percent) >= self.params.min_quality_percent;
            let slot = if finite { self.anchors.hear(floor, anchor) } else { None };
            let (Some(slot), true) = (slot, reading) else {
                if let Some(slot) = slot {
                    self.anchors.judge(slot, false, 0.0);
                }
                self.reject(1);
                continue;
            };
            usable[count] = RangeReading {
                slot,
                anchor_m: [anchor.x_m, anchor.y_m],
                rise_m,
                antenna_m,
                range_m: anchor.range_m,
                variance: self.params.range_sigma_m * self.params.range_sigma_m,
                prior: 0.0,
                wrong_density: WRONG_RANGE_DENSITY,
            };
            count += 1;
        }
        count
    }

    /// The module's own position, if it can be used.
    fn usable_position(&mut self, tag: &TagRanges) -> Option<[f64; 2]> {
        if tag.has_position != 1 {
            return None;
        }
        let good = tag.x_m.abs() < 1e6
            && tag.y_m.abs() < 1e6
            && f64::from(tag.quality_percent) >= self.params.min_quality_percent;
        if !good {
            self.reject(1);
        }
        good.then_some([tag.x_m, tag.y_m])
    }

    /// The first belief: all places that the readings allow, with all headings.
    fn begin(&mut self, readings: &[RangeReading], position: Option<[f64; 2]>, antenna_m: [f64; 2]) {
        if let Some(at_m) = position {
            self.bank.scatter(
                at_m,
                antenna_m,
                2.0 * self.params.position_sigma_m,
                0.0,
                self.params.outlier_chance,
            );
            return;
        }
        let places = Places::find(readings);
        // Two anchors always agree on some place; the ranges that do not agree with it are judged by what
        // follows.
        for place in places.as_slice() {
            self.bank.scatter(place.at_m, antenna_m, 3.0 * self.params.range_sigma_m, 0.0, NEW_WRONG);
        }
    }

    /// When the readings contradict the belief for long, and agree among each other on another place, that
    /// place is tried beside it.
    fn try_elsewhere(&mut self, readings: &[RangeReading], explained: usize, antenna_m: [f64; 2]) {
        let contradicted = 2 * explained < readings.len().max(1) + 1 && explained < 3;
        // Nothing explained at all weighs double.
        let weight = if explained == 0 && readings.len() > 1 { 2 } else { 1 };
        self.unexplained = if contradicted { self.unexplained + weight } else { 0 };
        if self.unexplained < self.params.recovery_messages {
            return;
        }
        self.unexplained = 0;
        let places = Places::find(readings);
        let better = |place: &&places::Place| place.explained > explained;
        if places.as_slice().iter().any(|place| better(&place)) {
            // The best hypothesis has weight one; newcomers must earn more than e^3 times their due.
            self.bank.keep_best(bank::CAPACITY - PLACE_LIMIT * HEADINGS);
            for place in places.as_slice().iter().filter(better) {
                self.bank.scatter(place.at_m, antenna_m, 3.0 * self.params.range_sigma_m, -3.0, NEW_WRONG);
            }
        }
    }

    fn accept(&mut self) {
        self.accepted += 1;
        self.rejected_share -= 0.1 * self.rejected_share;
    }

    fn reject(&mut self, count: usize) {
        self.rejected += count as u64;
        self.rejected_share += 0.1 * (1.0 - self.rejected_share);
    }

    fn estimate(&mut self, now: Time) -> PoseEstimate {
        let floor = self.floor.unwrap_or_default();
        let best = self.bank.estimate();
        let place = best.map(|one| [one.pose.x_m, one.pose.y_m]);
        let silent =
            self.seen.tag.last().is_none_or(|last| now.seconds_since(last.stamp) > self.params.tag_timeout_s);
        let mut bits = self.anchors.bits(floor, place, self.params.silent_messages);
        if silent {
            bits = AnchorBits { alive: 0, dead: bits.alive | bits.dead };
        }
        let message = PoseEstimate {
            accepted: self.accepted,
            rejected: self.rejected,
            floor,
            alive_anchors: bits.alive,
            dead_anchors: bits.dead,
            ..PoseEstimate::default()
        };
        let Some(best) = best else { return message };
        let state = self.state(&best, silent, bits);
        let least = self.params.floor_sigma_m * self.params.floor_sigma_m;
        let mut covariance = best.covariance;
        covariance[(0, 0)] += least;
        covariance[(1, 1)] += least;
        // The matrix is symmetric: row by row and column by column are the same.
        let mut rows = [0.0; 9];
        rows.copy_from_slice(covariance.as_slice());
        PoseEstimate {
            x_m: best.pose.x_m,
            y_m: best.pose.y_m,
            heading_rad: best.pose.heading_rad,
            covariance: rows,
            state: state.into(),
            ..message
        }
    }

    fn state(&mut self, best: &Estimate, silent: bool, bits: AnchorBits) -> LocationStateName {
        let certain = best.sigma_m() < KNOWN_SIGMA_M && best.sigma_rad() < KNOWN_SIGMA_RAD;
        self.known |= certain;
        if !self.known {
            return LocationStateName::Unknown;
        }
        if best.sigma_m() > self.params.lost_sigma_m {
            return LocationStateName::Lost;
        }
        let degraded = !certain
            || silent
            || bits.dead != 0
            || self.rejected_share > MANY_REJECTED
            || self.disagreeing_sides > SIDES_DISAGREE
            || self.other_floor.1 > 0;
        if degraded { LocationStateName::Degraded } else { LocationStateName::Tracking }
    }

    /// How many hypotheses are held.
    pub fn hypotheses(&self) -> usize {
        self.bank.len()
    }
}

/// A wrong range is anywhere within 20 m.
const WRONG_RANGE_DENSITY: f64 = 0.05;
/// Probability, for a place just found, that an anchor was wrong there.
const NEW_WRONG: f64 = 0.3;

fn antenna_of(tag: &TagRanges) -> [f64; 2] {
    // An antenna outside of any robot is nonsense, and then the robot's middle is the best guess.
    if tag.antenna_x_m.abs() < 5.0 && tag.antenna_y_m.abs() < 5.0 {
        [tag.antenna_x_m, tag.antenna_y_m]
    } else {
        [0.0, 0.0]
    }
}
