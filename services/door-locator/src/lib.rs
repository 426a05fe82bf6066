//! Finds the door beside the robot, and how far ahead its centre line is: a door reads about 100 mm deeper
//! than the wall. Source: the coffee robot's paper, sections III.C, IV.C and V.C (COF-100 to COF-112), with
//! the gaps settled in X-25 (side and gate by the map) and X-26 (window by speed), and the detector of note
//! 2.6.
//!
//! Two detectors look at the same readings. The paper's sliding window fires when the robot is at the door or
//! almost past it (COF-104, COF-111). The finer one locates the door's edges along the wall, by odometry, for
//! each sensor of the side: wall, then three readings or more that are deeper. Each edge says where the
//! centre line is, and all of them together say it best: while the robot approaches the centre, the near edge
//! of the front sensor, and 277 mm later that of the back sensor, which confirms the door; after it, the far
//! edges as well. A sensor's cone leaves the wall late and is back early; by how much is learnt from doors
//! passed.
//!
//! A sighting is published with every frame from the first edge on until the door is `gate_m` behind. Its
//! `confidence` is 0.5 with one sensor, 0.8 confirmed by the second, 0.95 when a sensor has seen both ends,
//! and 0 when the second contradicts: no door.

mod doors;
mod estimate;
mod hallway;
mod params;
mod profile;
#[cfg(test)]
mod tests;
mod window;

pub use params::{Params, ParamsError};

use doors::Door;
use estimate::{Edges, Lag};
use geometry::{Pose2, world::World};
use hallway::{Hallway, Station};
use messages::{
    DoorSighting, DoorState, MissionStatus, Odometry, Once, Parameters, PoseEstimate, Reading, RoomName,
    Side, Stamped, Time, TofRanges,
};
use profile::{Edge, End, Profile};
use window::Window;

/// With the wall at a greater angle than this the side sensors do not look at it.
const OBLIQUE_RAD: f64 = 0.5;

/// From the robot's centre line to its side sensors.
const SENSOR_ASIDE_M: f64 = 0.255;

/// What is read.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// `tof/ranges`.
    pub ranges: Option<Stamped<'a, TofRanges>>,
    /// `location/pose`.
    pub location: Option<Stamped<'a, PoseEstimate>>,
    /// `wheels/odometry`.
    pub odometry: Option<Stamped<'a, Odometry>>,
    /// `mission/status`: the room that is looked for. Without one every door is an entrance.
    pub mission: Option<Stamped<'a, MissionStatus>>,
}

/// What to publish.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// For `door/sighting`, while there is a door.
    pub sighting: Option<DoorSighting>,
}

/// One side sensor.
#[derive(Debug, Clone, Default)]
struct Lane {
    profile: Profile,
    window: Window,
    /// Where along the hallway it looks.
    looks_at_m: f64,
}

/// A door that one side has begun to see.
#[derive(Debug, Clone)]
struct Candidate {
    door: Door,
    edges: Edges,
    is_announced: bool,
    window_fired: bool,
    state: DoorState,
}

/// One side: its front sensor, then its back sensor.
#[derive(Debug, Clone)]
struct Flank {
    side: Side,
    lanes: [Lane; 2],
    candidate: Option<Candidate>,
}

/// The door locator.
#[derive(Debug, Clone)]
pub struct DoorLocator {
    params: Params,
    doors: Vec<Door>,
    hallway: Hallway,
    flanks: [Flank; 2],
    lag: Lag,
    sightings: u64,
    frame: Once,
    /// Smoothed time between frames.
    period_s: Option<f64>,
}

impl DoorLocator {
    /// Reads the world file, if one is named.
    ///
    /// # Errors
    /// When the parameters make no sense or the world file cannot be used.
    pub fn new(params: Params) -> Result<Self, ParamsError> {
        let world = if params.world.is_empty() { World::default() } else { World::load(&params.world)? };
        Self::with_world(params, &world)
    }

    /// A locator in a world that is read already.
    ///
    /// # Errors
    /// When the parameters make no sense.
    pub fn with_world(params: Params, world: &World) -> Result<Self, ParamsError> {
        params.check()?;
        let lag = Lag { ratio: params.edge_lag_ratio, sigma_ratio: params.edge_lag_sigma_ratio };
        let flank = |side| Flank { side, lanes: Default::default(), candidate: None };
        let flanks = [flank(Side::Right), flank(Side::Left)];
        let doors = doors::doors(world);
        let hallway = Hallway::default();
        Ok(Self { params, doors, hallway, flanks, lag, sightings: 0, frame: Once::default(), period_s: None })
    }

    /// Looks at the newest frame; one seen before is nothing new. Call it for every frame.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs {
        let nothing = Outputs { sighting: None };
        let fresh = inputs.ranges.and_then(|ranges| ranges.fresh(now, self.params.max_age()));
        let Some(ranges) = fresh.filter(|ranges| self.frame.is_new(ranges)) else {
            return nothing;
        };
        self.count_time(&ranges);
        let Some(odometry) = inputs.odometry.and_then(|odometry| odometry.fresh(now, self.params.max_age()))
        else {
            return nothing;
        };
        let location =
            inputs.location.and_then(|location| location.fresh(now, self.params.location_max_age()));
        let location = location.as_ref().and_then(|location| Some((location.pose().ok()?, location.message)));
        let (station, anew) = self.hallway.follow(ranges.origin, &odometry, location, &self.doors);
        if anew {
            self.forget();
        }
        let Some(station) = station else { return nothing };
        if station.off_rad.abs() > OBLIQUE_RAD {
            self.forget();
            return nothing;
        }
        let target = inputs.mission.map_or(RoomName::EMPTY, |mission| mission.room);
        let place = location.map(|(pose, _)| pose);
        let sightings = [0, 1].map(|flank| self.watch(flank, &ranges, &station, place, target));
        // With doors on both sides the one that is looked for comes first, then the nearer one.
        let rank = |sighting: &DoorSighting| (sighting.room != target, sighting.offset_m.abs());
        let better = |a: &DoorSighting, b: &DoorSighting| {
            let (a, b) = (rank(a), rank(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        };
        Outputs { sighting: sightings.into_iter().flatten().min_by(better) }
    }

    fn count_time(&mut self, ranges: &Stamped<'_, TofRanges>) {
        if let Some(before) = self.frame.last() {
            let step_s = ranges.stamp.seconds_since(before.stamp);
            let period_s = self.period_s.unwrap_or(step_s);
            self.period_s = Some(period_s + 0.2 * (step_s - period_s));
        }
        self.frame.take(*ranges);
    }

    fn forget(&mut self) {
        for flank in &mut self.flanks {
            *flank = Flank { side: flank.side, lanes: Default::default(), candidate: None };
        }
    }

    /// One side in one frame.
    fn watch(
        &mut self,
        index: usize,
        ranges: &TofRanges,
        station: &Station,
        place: Option<Pose2>,
        target: RoomName,
    ) -> Option<DoorSighting> {
        let flank = &mut self.flanks[index];
        let (side, lean) = (flank.side, if flank.side == Side::Right { 1.0 } else { -1.0 });
        let door_width_m = flank.candidate.as_ref().map_or(DOOR_WIDTH_M, |candidate| candidate.door.width_m);
        let period_s = self.period_s.unwrap_or(f64::NAN);
        let half = self.params.half_window(door_width_m, station.forward_mps, period_s);
        let moves = station.forward_mps.abs() >= self.params.standstill_mps;
        let mut edges = [None; 2];
        let mut fired = false;
        for (lane_index, lane) in flank.lanes.iter_mut().enumerate() {
            let sensor = if side == Side::Right { [1, 0] } else { [6, 7] }[lane_index];
            let reading_m = match ranges.reading(sensor) {
                Reading::Distance(range_m) => Some(f64::from(range_m)),
                Reading::NoTarget => None,
                Reading::Ignore | Reading::Fault => continue,
            };
            let wall_m = lane.profile.wall_m().or(reading_m).unwrap_or(0.3);
            let (sine, cosine) = station.off_rad.sin_cos();
            lane.looks_at_m = station.along_m
                + TofRanges::MOUNTS[sensor].x_m * cosine
                + lean * (SENSOR_ASIDE_M + wall_m) * sine;
            edges[lane_index] = lane.profile.take(lane.looks_at_m, reading_m, &self.params);
            fired |= moves && lane.window.take(reading_m, half, &self.params);
        }
        for (lane, edge) in edges.into_iter().enumerate() {
            if let Some(edge) = edge {
                self.take_edge(index, lane, edge, station, place);
            }
        }
        self.judge(index, fired, station, target)
    }

    /// Which door an edge belongs to: the one that is seen already, or that of the map which lies nearest to
    /// where its centre would be.
    fn take_edge(&mut self, index: usize, lane: usize, edge: Edge, station: &Station, place: Option<Pose2>) {
        let flank = &mut self.flanks[index];
        let centre_m = |door: &Door| {
            let lag_m = self.lag.ratio * edge.wall_m;
            let inwards_m = 0.5 * door.width_m - lag_m;
            if edge.end == End::Near { edge.at_m + inwards_m } else { edge.at_m - inwards_m }
        };
        let fits = |door: &Door| {
            edge.step_m.is_nan() || (edge.step_m - door.recess_m).abs() <= self.params.recess_tolerance_m
        };
        if let Some(candidate) = &mut flank.candidate
            && let Some(known) = candidate.edges.centre(candidate.door.width_m, self.lag)
            && (known.at_m - centre_m(&candidate.door)).abs() <= 0.5 * candidate.door.width_m
        {
            if fits(&candidate.door) {
                candidate.edges.add(lane, edge);
                if candidate.edges.is_whole()
                    && let Some(centre) = candidate.edges.centre(candidate.door.width_m, self.lag)
                    && (0.0..0.5).contains(&centre.lag.ratio)
                {
                    // Never surer than another wall and another leaf allow.
                    self.lag = Lag { sigma_ratio: centre.lag.sigma_ratio.max(0.02), ..centre.lag };
                }
            }
            return;
        }
        let Some(place) = place else { return };
        let off_m = |door: &Door| {
            let (ahead_m, side) = door.seen_from(place.position(), station.hallway_rad);
            let off_m = (station.along_m + ahead_m - centre_m(door)).abs();
            (door.floor == station.floor && side == flank.side && fits(door) && off_m <= self.params.gate_m)
                .then_some(off_m)
        };
        let near = self.doors.iter().filter_map(|door| Some((door, off_m(door)?)));
        if let Some((&door, _)) = near.min_by(|a, b| a.1.total_cmp(&b.1)) {
            let mut edges = Edges::default();
            edges.add(lane, edge);
            let state = DoorState::Unknown;
            flank.candidate =
                Some(Candidate { door, edges, is_announced: false, window_fired: false, state });
        }
    }

    /// What is to be said of the door on this side.
    fn judge(
        &mut self,
        index: usize,
        fired: bool,
        station: &Station,
        target: RoomName,
    ) -> Option<DoorSighting> {
        let flank = &mut self.flanks[index];
        let candidate = flank.candidate.as_mut()?;
        let centre = candidate.edges.centre(candidate.door.width_m, self.lag)?;
        let offset_m = centre.at_m - station.along_m;
        let half_m = 0.5 * candidate.door.width_m;
        candidate.window_fired |= fired && offset_m.abs() <= half_m + self.params.gate_m;
        let is_locked = flank.lanes.iter().any(|lane| lane.window.is_locked());
        let is_gone = offset_m.abs() > self.params.gate_m + half_m;
        let confirmed = confirmation(&candidate.edges, &flank.lanes, &self.params);
        let door = candidate.door;
        if is_gone || door.room.is_empty() {
            flank.candidate = flank.candidate.take().filter(|_| !is_gone);
            return None;
        }
        let open = flank.lanes.iter().filter_map(|lane| lane.profile.is_open()).reduce(|a, b| a || b);
        if let Some(open) = open {
            candidate.state = if open { DoorState::Open } else { DoorState::Closed };
        }
        if self.params.strict_paper && !candidate.window_fired {
            return None;
        }
        if !candidate.is_announced {
            candidate.is_announced = true;
            self.sightings += 1;
        }
        let confidence = match confirmed {
            Some(false) => 0.0,
            None => 0.5,
            Some(true) if candidate.edges.is_whole() => 0.95,
            Some(true) => 0.8,
        };
        let wanted = target.is_empty() || target == door.room;
        let at_window = candidate.window_fired && is_locked && offset_m.abs() <= half_m + self.params.gate_m;
        let at_centre = confirmed == Some(true) && offset_m.abs() <= self.params.entrance_m;
        let at_entrance = confidence > 0.0 && wanted && (at_window || at_centre && !self.params.strict_paper);
        let sighting = DoorSighting {
            centre_x_m: door.centre.x,
            centre_y_m: door.centre.y,
            offset_m,
            confidence,
            sightings: self.sightings,
            room: door.room,
            at_entrance: at_entrance.into(),
            side: flank.side.into(),
            state: candidate.state.into(),
            floor: door.floor,
        };
        if confirmed == Some(false) {
            flank.candidate = None;
        }
        Some(sighting)
    }
}

/// A door's usual width.
const DOOR_WIDTH_M: f64 = 0.91;

/// Whether the second sensor has seen the same edge, or has passed its place and seen flat wall.
fn confirmation(edges: &Edges, lanes: &[Lane; 2], params: &Params) -> Option<bool> {
    let tolerance_m = params.confirm_share * TofRanges::SIDE_BASE_M;
    let agree = |a: Edge, b: Edge| (a.at_m - b.at_m).abs() <= tolerance_m + 0.5 * (a.gap_m + b.gap_m);
    if edges.pairs().any(|(a, b)| agree(a, b)) {
        return Some(true);
    }
    if edges.pairs().next().is_some() {
        return Some(false);
    }
    // One sensor has seen an end that the other, which looks at flat wall now beyond it, should have seen.
    let missed = |seer: usize| {
        [End::Near, End::Far].into_iter().filter_map(|end| edges.of(seer, end)).any(|edge| {
            let other = &lanes[1 - seer];
            let inside_m = if edge.end == End::Near {
                other.looks_at_m - edge.at_m
            } else {
                edge.at_m - other.looks_at_m
            };
            let surely_m = tolerance_m + edge.gap_m + params.edge_run_m;
            other.profile.is_at_wall() && (surely_m..0.6).contains(&inside_m)
        })
    };
    (missed(0) || missed(1)).then_some(false)
}
