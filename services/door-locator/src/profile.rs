//! The wall as one sensor passes it: flat wall, and where it becomes deeper or flat again.

use crate::Params;
use std::collections::VecDeque;

/// The most readings of which the wall's distance is the median.
const WALL_READINGS: usize = 15;

/// Readings closer together than this along the wall are the same point of it.
const SAME_POINT_M: f64 = 0.004;

/// Something deeper than the wall for longer than this is no door but another wall.
const LONGEST_M: f64 = 2.5;

/// The most readings that are kept of what is passed.
const MOST_READINGS: usize = 1024;

/// Which end of a door an edge is, in the direction in which the hallway is counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    /// Where the door begins.
    Near,
    /// Where it ends.
    Far,
}

/// A place along the wall where a door begins or ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Edge {
    pub(crate) end: End,
    /// Along the hallway, halfway between the last reading on one side and the first on the other.
    pub(crate) at_m: f64,
    /// Between these two readings.
    pub(crate) gap_m: f64,
    /// Distance of the flat wall.
    pub(crate) wall_m: f64,
    /// How much deeper the door is; NaN for an open one.
    pub(crate) step_m: f64,
}

/// Readings that deviate from what was before, and may become an edge.
#[derive(Debug, Clone)]
struct Run {
    kind: Kind,
    /// Where it began, and the reading before.
    begin_m: f64,
    before_m: f64,
    /// Valid readings.
    readings_m: Vec<f64>,
    noisy: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Wall,
    Deep,
    /// Nearer than the wall.
    Raised,
}

/// What a sensor has passed.
#[derive(Debug, Clone, Default)]
pub(crate) struct Profile {
    wall_m: VecDeque<f64>,
    /// Where the last reading was taken along the wall.
    last_m: Option<f64>,
    /// The door or opening that the sensor looks into.
    inside: Option<Run>,
    pending: Option<Run>,
}

impl Profile {
    /// Distance of the flat wall, once it is known.
    pub(crate) fn wall_m(&self) -> Option<f64> {
        if self.wall_m.len() < 3 {
            return None;
        }
        let mut sorted: Vec<_> = self.wall_m.iter().copied().collect();
        Some(median(&mut sorted))
    }

    /// Whether the sensor looks at flat wall and nothing else is about to begin.
    pub(crate) fn is_at_wall(&self) -> bool {
        self.inside.is_none() && self.pending.is_none() && self.wall_m().is_some()
    }

    /// Whether what the sensor looks into, or last looked into, shows as noise: an open door (COF-110).
    pub(crate) fn is_open(&self) -> Option<bool> {
        let run = self.inside.as_ref()?;
        Some(2 * run.noisy >= run.len() || spread_m(&run.readings_m) > 0.040)
    }

    /// Takes in a reading (`None`: noise or nothing in range) of the wall's point at `at_m` along the
    /// hallway.
    pub(crate) fn take(&mut self, at_m: f64, reading_m: Option<f64>, params: &Params) -> Option<Edge> {
        let before_m = self.last_m.unwrap_or(at_m);
        if self.last_m.is_some() && (at_m - before_m).abs() < SAME_POINT_M {
            return None;
        }
        self.last_m = Some(at_m);
        let reading_m = reading_m.filter(|&m| m <= params.noise_m);
        let Some(wall_m) = self.wall_m() else {
            self.wall_m.extend(reading_m);
            return None;
        };
        let kind = match reading_m {
            None => Kind::Deep,
            Some(m) if m > wall_m + params.edge_m => Kind::Deep,
            Some(m) if m < wall_m - params.edge_m => Kind::Raised,
            Some(_) => Kind::Wall,
        };
        // What the sensor looks at already: no edge.
        let current = if self.inside.is_some() { Kind::Deep } else { Kind::Wall };
        if kind == current {
            self.pending = None;
            self.go_on(at_m, reading_m);
            return None;
        }
        let run = self.pending.take().filter(|run| run.kind == kind);
        let mut run = run.unwrap_or(Run { kind, begin_m: at_m, before_m, readings_m: Vec::new(), noisy: 0 });
        run.add(reading_m);
        let long = (at_m - run.begin_m).abs() >= params.edge_run_m;
        if run.len() >= params.edge_readings as usize && long {
            return self.enter(run, wall_m, at_m);
        }
        self.pending = Some(run);
        None
    }

    fn go_on(&mut self, at_m: f64, reading_m: Option<f64>) {
        match &mut self.inside {
            None => self.add_wall(reading_m),
            Some(inside) => {
                inside.add(reading_m);
                if (at_m - inside.begin_m).abs() > LONGEST_M {
                    *self = Self { last_m: self.last_m, ..Self::default() };
                }
            }
        }
    }

    fn add_wall(&mut self, reading_m: Option<f64>) {
        self.wall_m.extend(reading_m);
        if self.wall_m.len() > WALL_READINGS {
            self.wall_m.pop_front();
        }
    }

    /// A run has become long enough to be believed.
    fn enter(&mut self, mut run: Run, wall_m: f64, at_m: f64) -> Option<Edge> {
        let forward = at_m > run.before_m;
        let level_m = median(&mut run.readings_m.clone());
        let open = 2 * run.noisy >= run.len();
        let edge = |deepens: bool, wall_m: f64, step_m: f64| Edge {
            end: if deepens == forward { End::Near } else { End::Far },
            at_m: 0.5 * (run.before_m + run.begin_m),
            gap_m: (run.begin_m - run.before_m).abs(),
            wall_m,
            step_m,
        };
        match run.kind {
            Kind::Deep => {
                let found = edge(true, wall_m, if open { f64::NAN } else { level_m - wall_m });
                self.inside = Some(run);
                Some(found)
            }
            Kind::Wall => {
                let inside = self.inside.take();
                let step_m = inside.map_or(f64::NAN, |mut inside| {
                    if 2 * inside.noisy >= inside.len() {
                        f64::NAN
                    } else {
                        median(&mut inside.readings_m) - wall_m
                    }
                });
                let found = edge(false, wall_m, step_m);
                run.readings_m.iter().for_each(|&m| self.add_wall(Some(m)));
                Some(found)
            }
            // What was taken for the wall was a door, or something stands before the wall. Either way this is
            // the wall now.
            Kind::Raised => {
                let was_door = self.inside.is_none();
                let found = edge(false, level_m, wall_m - level_m);
                self.inside = None;
                self.wall_m = std::mem::take(&mut run.readings_m).into();
                was_door.then_some(found)
            }
        }
    }
}

impl Run {
    fn len(&self) -> usize {
        self.readings_m.len() + self.noisy
    }

    fn add(&mut self, reading_m: Option<f64>) {
        // A robot that goes to and fro learns nothing new.
        if self.len() >= MOST_READINGS {
            return;
        }
        match reading_m {
            Some(reading_m) => self.readings_m.push(reading_m),
            None => self.noisy += 1,
        }
    }
}

/// The middle value; NaN of none.
fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => f64::NAN,
        count if count % 2 == 1 => values[count / 2],
        count => 0.5 * (values[count / 2 - 1] + values[count / 2]),
    }
}

/// Between the first and the last quarter.
fn spread_m(readings_m: &[f64]) -> f64 {
    let mut sorted = readings_m.to_vec();
    sorted.sort_by(f64::total_cmp);
    let quarter = sorted.len() / 4;
    match (sorted.get(quarter), sorted.get((sorted.len().max(1) - 1) - quarter)) {
        (Some(low_m), Some(high_m)) => high_m - low_m,
        _ => 0.0,
    }
}
