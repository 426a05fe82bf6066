//! Where the robot was when a scan was taken.

use geometry::{Pose2, angle};
use messages::Time;
use std::time::Duration;

/// The two newest poses.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Track {
    before: Option<(Time, Pose2)>,
    newest: Option<(Time, Pose2)>,
}

impl Track {
    /// A new pose. One from the past begins a new track, as in a log that is played again.
    pub(crate) fn push(&mut self, time: Time, pose: Pose2) {
        self.before = self.newest.filter(|(newest, _)| *newest < time);
        self.newest = Some((time, pose));
    }

    /// Forgets both.
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Whether a pose has come that is no older than `time`.
    pub(crate) fn reaches(&self, time: Time) -> bool {
        self.newest.is_some_and(|(newest, _)| newest >= time)
    }

    /// The pose at a time: between the two newest, or the nearer one of them, when they are no farther away
    /// than `max_age`.
    pub(crate) fn at(&self, time: Time, max_age: Duration) -> Option<Pose2> {
        let apart = |other: Time| time.since(other).max(other.since(time));
        let newest = self.newest?;
        if let Some(before) = self.before
            && before.0 <= time
            && time <= newest.0
            && newest.0.since(before.0) <= 2 * max_age
        {
            let share = time.seconds_since(before.0) / newest.0.seconds_since(before.0);
            return Some(between(before.1, newest.1, share));
        }
        let near = self.before.into_iter().chain([newest]).min_by_key(|(other, _)| apart(*other))?;
        (apart(near.0) <= max_age).then_some(near.1)
    }
}

fn between(from: Pose2, to: Pose2, share: f64) -> Pose2 {
    let turn_rad = angle::difference(to.heading_rad, from.heading_rad);
    Pose2::new(
        from.x_m + (to.x_m - from.x_m) * share,
        from.y_m + (to.y_m - from.y_m) * share,
        from.heading_rad + turn_rad * share,
    )
}
