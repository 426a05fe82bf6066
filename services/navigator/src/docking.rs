//! Halting at a door: creep along the hallway until its centre line is known, halt on it, correct what was
//! missed.

use crate::params::Params;
use geometry::{Pose2, angle};
use messages::{DoorSighting, Time};

/// The turn before the search ends within this angle.
const ALIGNED_RAD: f64 = 0.10;
/// A turn begins only beyond this angle.
const ASKEW_RAD: f64 = 0.35;
/// A turn that does not end is given up.
const TURN_MAX_S: f64 = 12.0;
/// A robot told to halt stands after this time.
const SETTLE_S: f64 = 0.8;
/// Corrections before the result is accepted or the approach repeated.
const CORRECTIONS_MAX: u32 = 4;
/// Halting earlier than this makes no sense.
const FINEST_M: f64 = 0.01;

/// What to do next at the door.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum DockingStep {
    /// Turn to the hallway's direction.
    Turn,
    /// Drive forward at this speed.
    Creep(f64),
    /// Drive backward at this speed.
    BackOff(f64),
    /// Stand.
    Hold,
    /// The robot stands at the door.
    Done,
    /// It does not work: approach the door again.
    Repeat,
}

/// One approach to a door.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Docking {
    began: Time,
    turning: bool,
    /// Reading of the odometer at which the robot's middle is on the centre line, once the door was seen.
    seen_at_m: Option<f64>,
    /// The door was not seen where it had to be: the map decides.
    by_map: bool,
    halted: Option<Time>,
    corrections: u32,
}

/// What is known in one step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DockingView {
    pub(crate) now: Time,
    pub(crate) pose: Pose2,
    /// Direction of the hallway.
    pub(crate) heading_rad: f64,
    /// The door's centre line ahead of the robot by the map.
    pub(crate) map_offset_m: f64,
    /// A sighting of this very door, young enough.
    pub(crate) sighting: Option<DoorSighting>,
    /// Path travelled forward since some beginning.
    pub(crate) odometer_m: f64,
    /// Speed forward.
    pub(crate) speed_mps: f64,
}

impl Docking {
    pub(crate) fn new(now: Time) -> Self {
        Self { began: now, turning: true, seen_at_m: None, by_map: false, halted: None, corrections: 0 }
    }

    pub(crate) fn step(&mut self, view: &DockingView, params: &Params) -> DockingStep {
        let Some(offset_m) = self.offset_m(view, params) else { return self.search(view, params) };
        let near_m =
            view.speed_mps.powi(2) / (2.0 * params.brake_m_per_s2) + view.speed_mps.abs() * params.latency_s;
        if let Some(halted) = self.halted {
            if view.now.seconds_since(halted) < SETTLE_S {
                return DockingStep::Hold;
            }
            if offset_m.abs() <= params.halt_tolerance_m {
                return DockingStep::Done;
            }
            if self.corrections >= CORRECTIONS_MAX {
                let accepted = offset_m.abs() <= params.halt_accept_m;
                return if accepted { DockingStep::Done } else { DockingStep::Repeat };
            }
            self.corrections += 1;
            self.halted = None;
        }
        if offset_m.abs() <= near_m.max(FINEST_M) {
            self.halted = Some(view.now);
            return DockingStep::Hold;
        }
        // Slower towards the line, so that the last correction is small.
        let speed = |most_mps: f64| {
            offset_m.abs().clamp(params.crawl_speed_mps, most_mps.max(params.crawl_speed_mps))
        };
        if offset_m > 0.0 {
            DockingStep::Creep(speed(params.creep_speed_mps))
        } else {
            DockingStep::BackOff(speed(params.back_off_speed_mps))
        }
    }

    /// How far ahead the centre line is, once that is known.
    fn offset_m(&mut self, view: &DockingView, params: &Params) -> Option<f64> {
        if let Some(sighting) = view.sighting.filter(|sighting| believable(sighting, view, params)) {
            self.seen_at_m = Some(view.odometer_m + sighting.offset_m);
        }
        match self.seen_at_m {
            Some(seen_at_m) => Some(seen_at_m - view.odometer_m),
            None => self.by_map.then_some(view.map_offset_m),
        }
    }

    fn search(&mut self, view: &DockingView, params: &Params) -> DockingStep {
        let askew_rad = angle::difference(view.heading_rad, view.pose.heading_rad).abs();
        let limit_rad = if self.turning && self.began == view.now { ASKEW_RAD } else { ALIGNED_RAD };
        self.turning &= askew_rad > limit_rad && view.now.seconds_since(self.began) < TURN_MAX_S;
        if self.turning {
            return DockingStep::Turn;
        }
        if view.map_offset_m < -params.overrun_m {
            self.by_map = true;
            return DockingStep::Hold;
        }
        DockingStep::Creep(params.creep_speed_mps)
    }
}

fn believable(sighting: &DoorSighting, view: &DockingView, params: &Params) -> bool {
    // A comparison with NaN is false.
    sighting.confidence >= params.min_confidence
        && (sighting.offset_m - view.map_offset_m).abs() <= params.sighting_gate_m
}
