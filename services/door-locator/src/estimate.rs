//! Where a door's centre line is, from the edges that the sensors of one side have seen of it.

use crate::profile::{Edge, End};

/// Standard deviation of an edge's place beside the distance between two readings: odometry and heading.
const PLACE_SIGMA_M: f64 = 0.010;

/// How far beyond a sensor's axis its cone still sees the wall, as a share of the wall's distance. A cone
/// shows the nearest thing in it, so it leaves the wall late at a door's near end and is back at the wall
/// early at the far end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lag {
    pub(crate) ratio: f64,
    pub(crate) sigma_ratio: f64,
}

/// The edges of one door, seen by the two sensors of a side.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Edges {
    /// Per sensor the near and the far edge.
    seen: [[Option<Edge>; 2]; 2],
}

/// A door's centre line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Centre {
    /// Along the hallway.
    pub(crate) at_m: f64,
    pub(crate) sigma_m: f64,
    /// What the edges say of the lag.
    pub(crate) lag: Lag,
}

impl Edges {
    pub(crate) fn add(&mut self, sensor: usize, edge: Edge) {
        self.seen[sensor][edge.end as usize] = Some(edge);
    }

    pub(crate) fn of(&self, sensor: usize, end: End) -> Option<Edge> {
        self.seen[sensor][end as usize]
    }

    /// Both sensors have seen the same end.
    pub(crate) fn pairs(&self) -> impl Iterator<Item = (Edge, Edge)> + '_ {
        [End::Near, End::Far].into_iter().filter_map(|end| self.of(0, end).zip(self.of(1, end)))
    }

    /// One sensor has seen both ends.
    pub(crate) fn is_whole(&self) -> bool {
        self.seen.iter().any(|ends| ends.iter().all(Option::is_some))
    }

    /// The weighted least squares of centre c and lag ratio r. An edge at `a` says `a + w/2 = c + r d` at the
    /// near end and `a - w/2 = c - r d` at the far end, where w is the door's width and d the wall's
    /// distance; `lag` is what was known of r.
    pub(crate) fn centre(&self, width_m: f64, lag: Lag) -> Option<Centre> {
        let prior = 1.0 / (lag.sigma_ratio * lag.sigma_ratio);
        let (mut cc, mut cr, mut rr) = (0.0, 0.0, prior);
        let (mut c, mut r) = (0.0, prior * lag.ratio);
        for edge in self.seen.iter().flatten().flatten() {
            let sign = if edge.end == End::Near { 1.0 } else { -1.0 };
            let (slope, says_m) = (sign * edge.wall_m, edge.at_m + sign * 0.5 * width_m);
            // Between two readings every place is as likely.
            let weight = 1.0 / (edge.gap_m * edge.gap_m / 12.0 + PLACE_SIGMA_M * PLACE_SIGMA_M);
            cc += weight;
            cr += weight * slope;
            rr += weight * slope * slope;
            c += weight * says_m;
            r += weight * slope * says_m;
        }
        let determinant = cc * rr - cr * cr;
        (cc > 0.0 && determinant > 0.0).then(|| Centre {
            at_m: (c * rr - r * cr) / determinant,
            sigma_m: (rr / determinant).sqrt(),
            lag: Lag { ratio: (r * cc - c * cr) / determinant, sigma_ratio: (cc / determinant).sqrt() },
        })
    }
}
