//! What a successor needs to go on where its predecessor was, after a crash or in a swap: the belief as a
//! thinned set of particles, and where the odometry stood.

use crate::filter::Belief;
use crate::{Travel, Update};
use geometry::Pose2;
use serde::{Deserialize, Serialize};

/// Particles that are handed over at most.
pub(crate) const HANDED_OVER: usize = 256;

/// The localiser's state, thinned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    pub(crate) belief: Belief,
    /// The odometry's last pose, and what has been travelled since the last scan that was used.
    pub(crate) odometry: Option<[f64; 3]>,
    pub(crate) motion: [f64; 3],
    pub(crate) path_m: f64,
    pub(crate) turn_rad: f64,
    pub(crate) is_found: bool,
    pub(crate) accepted: u64,
    pub(crate) rejected: u64,
}

pub(crate) fn numbers(pose: Pose2) -> [f64; 3] {
    [pose.x_m, pose.y_m, pose.heading_rad]
}

pub(crate) fn pose([x_m, y_m, heading_rad]: [f64; 3]) -> Pose2 {
    Pose2::new(x_m, y_m, heading_rad)
}

impl Snapshot {
    /// Whether every number is one: a state in shared memory may have been written by anything.
    pub(crate) fn is_sound(&self) -> bool {
        let numbers =
            self.odometry.into_iter().flatten().chain(self.motion).chain([self.path_m, self.turn_rad]);
        numbers.into_iter().all(f64::is_finite)
    }

    pub(crate) fn travel(&self) -> Travel {
        Travel { motion: pose(self.motion), path_m: self.path_m, turn_rad: self.turn_rad }
    }
}

impl crate::ParticleLocaliser {
    /// What a successor needs; nothing before the first scan was used.
    pub fn snapshot(&self) -> Option<Snapshot> {
        self.update.as_ref()?;
        Some(Snapshot {
            belief: self.filter.belief(HANDED_OVER)?,
            odometry: self.odometry.map(numbers),
            motion: numbers(self.travel.motion),
            path_m: self.travel.path_m,
            turn_rad: self.travel.turn_rad,
            is_found: self.is_found,
            accepted: self.accepted,
            rejected: self.rejected,
        })
    }

    /// Takes over the belief of a predecessor, before the first step. Odometry tells how far the robot went
    /// meanwhile. An invalid state is left alone.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        if !snapshot.is_sound() {
            return;
        }
        let Some(clusters) = self.filter.take_over(&snapshot.belief) else { return };
        let particles = self.filter.particles();
        self.update = Some(Update {
            clusters,
            effective: particles.effective(),
            fit: self.filter.fit(),
            wanted: particles.len(),
            ..Update::default()
        });
        self.odometry = snapshot.odometry.map(pose);
        self.travel = snapshot.travel();
        self.is_found = snapshot.is_found;
        (self.accepted, self.rejected) = (snapshot.accepted, snapshot.rejected);
    }
}
