//! The loop of Algorithm 1 (NXT-073 to NXT-076) without its enumeration: fewest waypoints, then the shortest
//! way.

use geometry::Point2;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Stands for the start among predecessors.
const START: u32 = u32::MAX;

/// Chooses waypoints, and keeps its memory for the next time.
///
/// Layer k holds the best length to every sample that takes k waypoints, that one included, and no fewer. The
/// paper tries all choices of i waypoints before one of i + 1; a way with as few as possible enters each
/// layer once, so a sample that was reached in one layer is of no use in a later one, and the layers find
/// what the enumeration finds, in at most N²/2 looks at links instead of N!/(N - i)! (note 1.7). Links are
/// looked at only when they could be the best.
#[derive(Debug, Clone, Default)]
pub struct Search {
    /// Length of the best way to each sample that was reached.
    length_m: Vec<f64>,
    /// The sample before it.
    before: Vec<u32>,
    /// The last layer, the layer being filled, and what was not reached yet.
    layer: Vec<u32>,
    next: Vec<u32>,
    rest: Vec<u32>,
    /// Lengths through each sample of the last layer, the shortest on top; lengths are never negative, so
    /// their bits sort as they do.
    queue: BinaryHeap<Reverse<(u64, u32)>>,
    chosen: Vec<usize>,
    expanded: u64,
}

impl Search {
    /// The best way from `start` to `goal` over `samples`, where `is_open` says which links are free: its
    /// length, or `None` when there is none. `literal` leaves out the direct link, as the printed algorithm
    /// does.
    pub fn find(
        &mut self,
        [start, goal]: [Point2<f64>; 2],
        samples: &[Point2<f64>],
        literal: bool,
        mut is_open: impl FnMut(Point2<f64>, Point2<f64>) -> bool,
    ) -> Option<f64> {
        self.chosen.clear();
        self.expanded = 0;
        if !literal && is_open(start, goal) {
            return Some((goal - start).norm());
        }
        self.length_m.clear();
        self.length_m.extend(samples.iter().map(|sample| (sample - start).norm()));
        self.before.clear();
        self.before.resize(samples.len(), START);
        self.next.clear();
        self.rest.clear();
        for (index, sample) in (0_u32..).zip(samples) {
            let list = if is_open(start, *sample) { &mut self.next } else { &mut self.rest };
            list.push(index);
        }
        while !self.next.is_empty() {
            std::mem::swap(&mut self.layer, &mut self.next);
            self.next.clear();
            self.expanded += self.layer.len() as u64;
            if let Some((last, length_m)) = self.best_before(goal, samples, &mut is_open) {
                self.trace(last);
                return Some(length_m);
            }
            let mut rest = std::mem::take(&mut self.rest);
            rest.retain(|&index| {
                let found = self.best_before(samples[index as usize], samples, &mut is_open);
                if let Some((before, length_m)) = found {
                    self.length_m[index as usize] = length_m;
                    self.before[index as usize] = before;
                    self.next.push(index);
                }
                found.is_none()
            });
            self.rest = rest;
        }
        None
    }

    /// Indices of the waypoints found last, from start to goal.
    pub fn chosen(&self) -> &[usize] {
        &self.chosen
    }

    /// Samples whose links onwards were looked at in the last search.
    pub fn expanded(&self) -> u64 {
        self.expanded
    }

    /// The sample of the last layer over which `to` is reached on the shortest way, and that length.
    fn best_before(
        &mut self,
        to: Point2<f64>,
        samples: &[Point2<f64>],
        is_open: &mut impl FnMut(Point2<f64>, Point2<f64>) -> bool,
    ) -> Option<(u32, f64)> {
        let mut candidates = std::mem::take(&mut self.queue).into_vec();
        candidates.clear();
        candidates.extend(self.layer.iter().map(|&index| {
            let length_m = self.length_m[index as usize] + (to - samples[index as usize]).norm();
            Reverse((length_m.to_bits(), index))
        }));
        self.queue = candidates.into();
        while let Some(Reverse((bits, index))) = self.queue.pop() {
            if is_open(samples[index as usize], to) {
                return Some((index, f64::from_bits(bits)));
            }
        }
        None
    }

    fn trace(&mut self, last: u32) {
        let mut index = last;
        while index != START {
            self.chosen.push(index as usize);
            index = self.before[index as usize];
        }
        self.chosen.reverse();
    }
}
