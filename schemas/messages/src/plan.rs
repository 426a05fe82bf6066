//! Paths: asked for and found.

use crate::Message;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// A path is wanted. Published by `navigator` on `plan/request`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct PlanRequest {
    /// Counts requests; the path that answers carries it. Zero is no request.
    pub request_id: u64,
    /// The goal in the map.
    pub goal_x_m: f64,
    /// The goal in the map.
    pub goal_y_m: f64,
    /// How near the path must come.
    pub tolerance_m: f64,
    /// The floor of start and goal.
    pub floor: i32,
    /// Always zero.
    pub reserved: u32,
}

crate::state! {
    /// What became of a request.
    PlanState, PlanStateName {
        /// Nothing was asked.
        Idle = 0,
        /// The elements lead from the robot to the goal.
        Found = 1,
        /// No path exists on the map as it is known.
        Unreachable = 2,
        /// The goal lies in an obstacle or outside the map.
        InvalidGoal = 3,
        /// The robot's pose is unknown, or outside the map.
        NoStart = 4,
    }
}

/// A place on a path.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub struct Waypoint {
    /// In the map.
    pub x_m: f64,
    /// In the map.
    pub y_m: f64,
}

/// The planner's answer: the header, then the waypoints from the robot to the goal. Published by the planner
/// on `plan/path`.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[message(element = Waypoint)]
#[repr(C)]
pub struct Path {
    /// The request that it answers.
    pub request_id: u64,
    /// Counts the paths for this request: a re-plan is a new revision.
    pub revision: u64,
    /// Length of the path.
    pub length_m: f64,
    /// Nodes expanded in the search.
    pub expanded: u64,
    /// The floor.
    pub floor: i32,
    /// What became of the request.
    pub state: PlanState,
}
