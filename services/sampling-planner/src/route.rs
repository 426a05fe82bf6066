//! From a pose to a goal: the way out, draws of samples that grow until one holds a path (NXT-070 to
//! NXT-081).

use crate::search::Search;
use crate::space::View;
use geometry::{Point2, Segment, Vector2};
use messages::{PlanStateName, Waypoint};
use rand::Rng;
use std::f64::consts::TAU;

/// Where a free place nearby is looked for: on circles, and at places on each.
const CIRCLES: u32 = 25;
const PLACES: u32 = 32;
/// A sample is drawn again this often when it falls beside the space.
const DRAWS_MAX: u32 = 100;

/// What is asked, in the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Question {
    /// Where the robot's middle is.
    pub start: Point2<f64>,
    /// Where it shall be.
    pub goal: Point2<f64>,
    /// A goal that is not free may be replaced by a free place no farther away than this.
    pub tolerance_m: f64,
    /// A start that is not free may be left for a free place no farther away than this.
    pub escape_m: f64,
    /// Samples in the first draw, and in the largest.
    pub samples: [u32; 2],
    /// How many draws.
    pub tries_max: u32,
    /// At least one waypoint.
    pub literal: bool,
}

impl Question {
    /// Samples of a draw, counted from 0: N, 2 N, 4 N .. up to the most.
    fn samples_in(&self, draw: u32) -> u32 {
        let [first, most] = self.samples;
        let grown = u64::from(first) << draw.min(32);
        u32::try_from(grown).unwrap_or(most).min(most)
    }
}

/// Plans, and keeps its memory for the next time.
#[derive(Debug, Clone, Default)]
pub struct Router {
    search: Search,
    samples: Vec<Point2<f64>>,
    waypoints: Vec<Waypoint>,
    expanded: u64,
    tries: u32,
}

impl Router {
    /// Finds a way. Only `Found` leaves waypoints; the first is the start, the last the goal or the free
    /// place next to it.
    pub fn plan(&mut self, view: &View<'_>, question: &Question, rng: &mut impl Rng) -> PlanStateName {
        self.plan_some(view, question, 0, u32::MAX, rng).unwrap_or(PlanStateName::Unreachable)
    }

    /// Finds a way in portions: begins with draw number `first`, and gives up for now, with `None`, before it
    /// has drawn more than `budget` samples, one draw excepted. [`Router::tries`] says where to go on.
    pub fn plan_some(
        &mut self,
        view: &View<'_>,
        question: &Question,
        first: u32,
        budget: u32,
        rng: &mut impl Rng,
    ) -> Option<PlanStateName> {
        self.waypoints.clear();
        self.samples.clear();
        self.expanded = if first == 0 { 0 } else { self.expanded };
        self.tries = first;
        let [start, goal] = match ends(view, question) {
            Ok(ends) => ends,
            Err(state) => return Some(state),
        };
        let mut left = budget;
        while self.tries < question.tries_max {
            let wanted = question.samples_in(self.tries);
            if left < wanted && left < budget {
                return None;
            }
            left = left.saturating_sub(wanted);
            self.tries += 1;
            self.draw(view, start, wanted, rng);
            let is_open = |from, to| view.is_open(from, to);
            let found = self.search.find([start, goal], &self.samples, question.literal, is_open);
            self.expanded += self.search.expanded();
            if found.is_some() {
                let escaped = (start != question.start).then_some(question.start);
                let chosen = self.search.chosen().iter().map(|&index| self.samples[index]);
                let places = escaped.into_iter().chain([start]).chain(chosen).chain([goal]);
                self.waypoints.extend(places.map(|place| Waypoint { x_m: place.x, y_m: place.y }));
                return Some(PlanStateName::Found);
            }
            if self.tries == first + 1 && !view.may_connect(start, goal) {
                return Some(PlanStateName::Unreachable);
            }
        }
        Some(PlanStateName::Unreachable)
    }

    /// The way found last.
    pub fn waypoints(&self) -> &[Waypoint] {
        &self.waypoints
    }

    /// The samples of the last draw.
    pub fn samples(&self) -> &[Point2<f64>] {
        &self.samples
    }

    /// How many of the samples are on the way.
    pub fn chosen(&self) -> usize {
        self.search.chosen().len()
    }

    /// Samples looked at for the last way, in all draws.
    pub fn expanded(&self) -> u64 {
        self.expanded
    }

    /// Draws made for the last way.
    pub fn tries(&self) -> u32 {
        self.tries
    }

    /// Fills the space with samples, uniformly (NXT-071). A draw can come out smaller where hardly any of the
    /// space is free.
    fn draw(&mut self, view: &View<'_>, start: Point2<f64>, count: u32, rng: &mut impl Rng) {
        let lattice = view.space().lattice();
        let part = if view.space().has_outline() { None } else { lattice.part_at(start) };
        let cells = lattice.cells_of(part);
        self.samples.clear();
        for _ in 0..count {
            let places = (0..DRAWS_MAX).filter_map(|_| lattice.draw(cells, rng));
            self.samples.extend(places.into_iter().find(|&place| view.is_free(place)));
        }
    }
}

/// Length of a chain of waypoints.
pub fn length_m(waypoints: &[Waypoint]) -> f64 {
    let pieces =
        waypoints.windows(2).map(|ends| (ends[1].x_m - ends[0].x_m).hypot(ends[1].y_m - ends[0].y_m));
    // The sum of nothing would be -0.
    pieces.fold(0.0, |sum, piece| sum + piece)
}

/// Where the way begins and ends, as free places that may be connected, or why there is none.
fn ends(view: &View<'_>, question: &Question) -> Result<[Point2<f64>; 2], PlanStateName> {
    let space = view.space();
    if !space.covers(question.start) {
        return Err(PlanStateName::NoStart);
    }
    if !space.covers(question.goal) {
        return Err(PlanStateName::InvalidGoal);
    }
    let goal = nearest_free(view, question.goal, question.tolerance_m, false);
    let goal = goal.ok_or(PlanStateName::InvalidGoal)?;
    let start = nearest_free(view, question.start, question.escape_m, true);
    let start = start.ok_or(PlanStateName::Unreachable)?;
    if space.may_connect(start, goal) { Ok([start, goal]) } else { Err(PlanStateName::Unreachable) }
}

/// The place itself when it is free, else a free one nearby, the nearest of those tried. An escape does not
/// cross a wall, unless the place itself is within one.
fn nearest_free(view: &View<'_>, place: Point2<f64>, reach_m: f64, escape: bool) -> Option<Point2<f64>> {
    if view.is_free(place) {
        return Some(place);
    }
    let space = view.space();
    let around = (1..=CIRCLES).flat_map(|circle| {
        let radius_m = reach_m * f64::from(circle) / f64::from(CIRCLES);
        (0..PLACES).map(move |at| {
            let (sine, cosine) = (TAU * f64::from(at) / f64::from(PLACES)).sin_cos();
            place + Vector2::new(cosine, sine) * radius_m
        })
    });
    let within_wall = space.wall_m(place) <= 0.0;
    around.into_iter().find(|&other| {
        view.is_free(other) && (!escape || within_wall || !space.crosses_wall(&Segment::new(place, other)))
    })
}
