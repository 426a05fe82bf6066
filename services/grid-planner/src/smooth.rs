//! From a path of grid steps to straight pieces in any direction.

use crate::field::Field;

/// Points between which straight pieces are tried.
const CANDIDATES: usize = 96;
/// How many candidates ahead a straight piece may reach in the first pass.
const AHEAD: usize = 48;
/// What a corner costs, in cells: of two equally good paths the one with fewer corners is taken.
const CORNER: f64 = 0.05;

/// Memory of the smoothing, used again for every plan.
#[derive(Debug, Clone, Default)]
pub(crate) struct Smoother {
    candidates: Vec<[f64; 2]>,
    best: Vec<(f64, u32)>,
    chosen: Vec<[f64; 2]>,
}

impl Smoother {
    /// The cheapest chain of straight pieces from the first to the last point through some of the others, in
    /// units of cells; no piece touches a blocked cell. Costs count along the pieces as they do in the
    /// search, so the lane is kept.
    pub(crate) fn straighten(&mut self, field: &Field, points: &[[f64; 2]]) -> &[[f64; 2]] {
        self.choose_candidates(points);
        self.cheapest_chain(field, AHEAD);
        // Long pieces that the window did not reach.
        std::mem::swap(&mut self.candidates, &mut self.chosen);
        self.cheapest_chain(field, usize::MAX);
        &self.chosen
    }

    /// All corners, and points between them at equal distances.
    fn choose_candidates(&mut self, points: &[[f64; 2]]) {
        self.candidates.clear();
        let spacing = points.len().div_ceil(CANDIDATES / 2).max(4);
        let mut since = 0;
        for (at, &point) in points.iter().enumerate() {
            let is_corner = match (at.checked_sub(1).map(|before| points[before]), points.get(at + 1)) {
                (Some(before), Some(after)) => {
                    let (u, v) = (
                        [point[0] - before[0], point[1] - before[1]],
                        [after[0] - point[0], after[1] - point[1]],
                    );
                    (u[0] * v[1] - u[1] * v[0]).abs() > 1e-9
                }
                _ => true,
            };
            since += 1;
            if is_corner || since >= spacing {
                self.candidates.push(point);
                since = 0;
            }
        }
    }

    /// Shortest path over the candidates in order.
    fn cheapest_chain(&mut self, field: &Field, ahead: usize) {
        let count = self.candidates.len();
        self.chosen.clear();
        if count == 0 {
            return;
        }
        self.best.clear();
        self.best.resize(count, (f64::INFINITY, 0));
        self.best[0].0 = 0.0;
        for from in 0..count {
            let so_far = self.best[from].0;
            let mut to = from + 1;
            while to < count && to - from <= ahead {
                let (a, b) = (self.candidates[from], self.candidates[to]);
                // The straight distance is the least that the piece can cost.
                let least = so_far + (b[0] - a[0]).hypot(b[1] - a[1]) + CORNER;
                if least < self.best[to].0
                    && let Some(cost) =
                        field.line_cost(a, b).or_else(|| (to == from + 1).then_some(least - so_far))
                    && so_far + cost + CORNER < self.best[to].0
                {
                    self.best[to] = (so_far + cost + CORNER, from as u32);
                }
                to += 1;
            }
        }
        let mut at = count - 1;
        self.chosen.push(self.candidates[at]);
        while at > 0 {
            at = self.best[at].1 as usize;
            self.chosen.push(self.candidates[at]);
        }
        self.chosen.reverse();
    }
}
