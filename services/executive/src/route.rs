//! How the body gets to a place by turns and straight ways without touching a wall: A* over its poses, each
//! of which is tried with a turn and a straight way to the end (the analytic expansion of Dolgov et al.
//! 2008).
//!
//! The body is a box that is longer than wide: where it can drive along a wall it cannot always turn. All
//! that is known of the surroundings counts: where several places look alike, a way must be free at each of
//! them.

use crate::arena::Arena;
use geometry::{Point2, Pose2, angle};
use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashSet};
use std::f64::consts::{PI, TAU};

/// What the robot knows of its surroundings, and where it is in them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View<'a> {
    pub(crate) arena: &'a Arena,
    pub(crate) pose: Pose2,
}

/// A part of a route.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Leg {
    /// So far around, counter-clockwise.
    Turn(f64),
    /// So far ahead, or back.
    Move(f64),
}

/// Turns and ways are looked at in steps of these.
const SWEEP_RAD: f64 = 0.07;
const SWEEP_M: f64 = 0.02;
/// The search turns by this, and drives this far.
const TURN_RAD: f64 = PI / 12.0;
const MOVES_M: [f64; 4] = [0.02, -0.02, 0.06, -0.06];
/// Poses nearer to each other are one.
const SAME_M: f64 = 0.01;
/// Metres that a radian of turning is worth, and a leg more: each has errors of its own.
const COST_PER_RAD: f64 = 0.04;
const COST_PER_LEG: f64 = 0.03;
/// How many metres ahead a metre back costs: no sensor looks there.
const COST_BACK: f64 = 1.5;
/// How many steps with all the room that is wanted a step without any costs.
const COST_NARROW: f64 = 30.0;
/// The least room of a route; only a body that leaves a wall may have less.
const NO_ROOM_M: f64 = 0.004;
/// Room that grows by more from step to step is that of a body that leaves a wall.
const LEAVING_M: f64 = 1e-4;
/// The most poses that the search looks at.
const MOST_POSES: usize = 2500;
/// What is left of the way counts for more than it is, which finds a good route sooner than the best one.
const EAGERNESS: f64 = 1.5;
/// Turns smaller than this are left out.
const NO_TURN_RAD: f64 = 0.004;

/// A pose of the search, as seen from where the robot is.
#[derive(Debug, Clone, Copy)]
struct Node {
    pose: Pose2,
    cost: f64,
    room_m: f64,
    /// The node before, and the leg from there.
    before: Option<(usize, Leg)>,
    /// Whether it is the end of the route.
    is_end: bool,
}

/// An entry of the queue: the cheapest comes first, of equals the oldest.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Entry {
    total: f64,
    node: usize,
}

impl Eq for Entry {}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        other.total.total_cmp(&self.total).then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Room around the body at a pose as seen from the robot, in all views; more than `enough_m` need not be told
/// apart.
fn room_m(views: &[View<'_>], seen: Pose2, enough_m: f64) -> f64 {
    let room_m = |view: &View<'_>| view.arena.room_up_to_m(view.pose.compose(seen), enough_m);
    views.iter().map(room_m).fold(f64::INFINITY, f64::min)
}

/// Where a search has led.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Route {
    /// To the place: the last leg is a straight way ahead.
    There(Vec<Leg>),
    /// No farther than to where the body has more room than anywhere else that it can get to.
    Away(Vec<Leg>),
}

/// The legs to a place, given as seen from the robot, with `wanted_m` of room around the body where that is
/// to be had.
pub(crate) fn route(views: &[View<'_>], wanted_m: f64, place: Point2<f64>) -> Route {
    let start = Node {
        pose: Pose2::IDENTITY,
        cost: 0.0,
        room_m: room_m(views, Pose2::IDENTITY, wanted_m),
        before: None,
        is_end: false,
    };
    let mut search = Search { views, wanted_m, nodes: vec![start], queue: BinaryHeap::new() };
    let mut done = HashSet::new();
    let mut roomiest = 0;
    search.queue.push(Entry { total: 0.0, node: 0 });
    while let Some(Entry { node, .. }) = search.queue.pop() {
        if search.nodes[node].is_end {
            return Route::There(search.legs(node));
        }
        if !done.insert(key(&search.nodes[node])) {
            continue;
        }
        if done.len() > MOST_POSES {
            break;
        }
        if search.nodes[node].room_m > search.nodes[roomiest].room_m + LEAVING_M {
            roomiest = node;
        }
        search.finish(node, place);
        for turn_rad in [TURN_RAD, -TURN_RAD] {
            search.go(node, Leg::Turn(turn_rad), place);
        }
        for way_m in MOVES_M {
            search.go(node, Leg::Move(way_m), place);
        }
    }
    Route::Away(search.legs(roomiest))
}

/// Poses with the same key are one to the search. How a pose was reached counts: turning on is cheaper than
/// beginning to turn.
fn key(node: &Node) -> (i32, i32, i32, bool) {
    let cell = |metres: f64| (metres / SAME_M).round() as i32;
    let direction = (node.pose.heading_rad.rem_euclid(TAU) / TURN_RAD).round() as i32;
    let turned = matches!(node.before, Some((_, Leg::Turn(_))));
    (cell(node.pose.x_m), cell(node.pose.y_m), direction, turned)
}

struct Search<'a> {
    views: &'a [View<'a>],
    wanted_m: f64,
    nodes: Vec<Node>,
    queue: BinaryHeap<Entry>,
}

impl Search<'_> {
    /// The node after a leg, if the body has room on it.
    fn after(&self, from: &Node, leg: Leg, before: usize) -> Option<Node> {
        let (steps, cost) = match leg {
            Leg::Turn(turn_rad) => (turn_rad.abs() / SWEEP_RAD, COST_PER_RAD * turn_rad.abs()),
            Leg::Move(way_m) => (way_m.abs() / SWEEP_M, if way_m < 0.0 { -COST_BACK * way_m } else { way_m }),
        };
        let goes_on = matches!(
            (from.before, leg),
            (Some((_, Leg::Turn(_))), Leg::Turn(_)) | (Some((_, Leg::Move(_))), Leg::Move(_))
        );
        let steps = steps.ceil().clamp(1.0, 500.0) as u32;
        let mut node = Node {
            cost: from.cost + if goes_on { 0.0 } else { COST_PER_LEG },
            before: Some((before, leg)),
            ..*from
        };
        for step in 1..=steps {
            let part = f64::from(step) / f64::from(steps);
            let pose = from.pose.compose(match leg {
                Leg::Turn(turn_rad) => Pose2::new(0.0, 0.0, part * turn_rad),
                Leg::Move(way_m) => Pose2::new(part * way_m, 0.0, 0.0),
            });
            let room_m = room_m(self.views, pose, self.wanted_m);
            if room_m < NO_ROOM_M && room_m <= node.room_m + LEAVING_M {
                return None;
            }
            let missing = (1.0 - room_m / self.wanted_m.max(1e-6)).clamp(0.0, 1.0);
            node.cost += cost / f64::from(steps) * (1.0 + COST_NARROW * missing * missing);
            (node.pose, node.room_m) = (pose, room_m);
        }
        Some(node)
    }

    fn push(&mut self, node: Node, left_m: f64) {
        self.queue.push(Entry { total: node.cost + EAGERNESS * left_m, node: self.nodes.len() });
        self.nodes.push(node);
    }

    fn go(&mut self, from: usize, leg: Leg, place: Point2<f64>) {
        if let Some(node) = self.after(&self.nodes[from], leg, from) {
            let left_m = (place - node.pose.position()).norm();
            self.push(node, left_m);
        }
    }

    /// From a node straight to the place, after a turn to it, either way around.
    fn finish(&mut self, from: usize, place: Point2<f64>) {
        let seen = self.nodes[from].pose.inverse_transform(place);
        let short_rad = seen.y.atan2(seen.x);
        let turns = [short_rad, short_rad - TAU.copysign(short_rad)];
        let turns = if short_rad.abs() < NO_TURN_RAD { &turns[..1] } else { &turns[..] };
        for turn_rad in turns {
            let mut last = from;
            if turn_rad.abs() >= NO_TURN_RAD {
                let Some(turned) = self.after(&self.nodes[from], Leg::Turn(*turn_rad), from) else {
                    continue;
                };
                last = self.nodes.len();
                self.nodes.push(turned);
            }
            let way = Leg::Move(seen.coords.norm());
            if let Some(end) = self.after(&self.nodes[last], way, last) {
                self.push(Node { is_end: true, ..end }, 0.0);
            }
        }
    }

    /// The way to a node; legs of one kind that follow each other are one.
    fn legs(&self, end: usize) -> Vec<Leg> {
        let mut legs: Vec<Leg> = Vec::new();
        let mut at = end;
        while let Some((before, leg)) = self.nodes[at].before {
            match (legs.last_mut(), leg) {
                (Some(Leg::Turn(sum)), Leg::Turn(turn_rad)) => *sum += turn_rad,
                (Some(Leg::Move(sum)), Leg::Move(way_m)) if sum.signum() == way_m.signum() => *sum += way_m,
                _ => legs.push(leg),
            }
            at = before;
        }
        legs.reverse();
        legs.retain(|leg| match leg {
            Leg::Turn(turn_rad) => turn_rad.abs() >= NO_TURN_RAD,
            Leg::Move(way_m) => way_m.abs() > 0.0,
        });
        for leg in &mut legs {
            if let Leg::Turn(turn_rad) = leg
                && turn_rad.abs() > TAU
            {
                *turn_rad = angle::wrap(*turn_rad);
            }
        }
        legs
    }
}
