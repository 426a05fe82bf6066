//! The parameters of the base driver.

use crate::{BaseDevice, SimulatedBase, speed};
use geometry::Hull;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What drives the wheels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Device {
    /// The motors of the simulator: encoders from `world/truth`.
    #[default]
    Simulated,
}

/// Where the hull may go, beside what the guard's signal says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Room {
    /// Where nothing is that the guard sees or has just seen; back only over ground that it has just covered.
    #[default]
    Seen,
    /// Where it was ordered on `motion/command`: for a robot whose sensor looks ahead only, and whose orders
    /// come from a service that has looked around.
    Ordered,
    /// Wherever the controller wants, as fast as it wants, while the signal is GO: for experiments with the
    /// guard alone.
    Unchecked,
}

/// The parameters of the base driver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// What drives the wheels.
    pub device: Device,
    /// Period of the odometry, and the longest time from one step to the next.
    #[schemars(range(min = 5, max = 50))]
    pub period_ms: u32,
    /// The wheels stop when the guard's last GO is older than this. The guard speaks at least every 50 ms, so
    /// 100 ms is one word missed.
    #[schemars(range(min = 10, max = 1000))]
    pub guard_deadline_ms: u32,
    /// The wheels stop when the last command is older than this. A controller at 20 Hz may be a whole period
    /// late and not more: a longer deadline would only hide that it missed a step, and a stop of a few
    /// milliseconds is smoothed by the motors' own ramps.
    #[schemars(range(min = 10, max = 1000))]
    pub command_deadline_ms: u32,
    /// The wheels stop when the encoders were last heard longer ago than this.
    #[schemars(range(min = 10, max = 1000))]
    pub device_deadline_ms: u32,
    /// The motors stop by themselves when they hear nothing for this long. Until then a hanging driver's last
    /// word holds.
    #[schemars(range(min = 10, max = 1000))]
    pub motor_watchdog_ms: u32,
    /// A command with a wheel faster than this is nonsense.
    #[schemars(range(min = 0.05, max = 3.0))]
    pub max_wheel_speed_mps: f64,
    /// No wheel is told to turn faster, whatever else would allow it.
    #[schemars(range(min = 0.01, max = 3.0))]
    pub top_speed_mps: f64,
    /// A wheel gains speed no faster than this; it loses speed as fast as the motor can.
    #[schemars(range(min = 0.05, max = 10.0))]
    pub max_speed_up_m_per_s2: f64,
    /// The least deceleration of the motors, fully loaded: all ways in which the robot stops are worked out
    /// from it.
    #[schemars(range(min = 0.05, max = 20.0))]
    pub deceleration_m_per_s2: f64,
    /// Distance between the middles of the two driven wheels.
    #[schemars(range(min = 0.05, max = 2.0))]
    pub wheel_track_m: f64,
    /// From the turning centre to the hull's front edge.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub hull_front_m: f64,
    /// From the turning centre to the hull's rear edge.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub hull_rear_m: f64,
    /// From the turning centre to the hull's sides.
    #[schemars(range(min = 0.01, max = 5.0))]
    pub hull_side_m: f64,
    /// What the guard watches ahead of the hull, for the check of `top_speed_mps`; while it runs the guard's
    /// own word counts.
    #[schemars(range(min = 0.0, max = 4.0))]
    pub front_radius_m: f64,
    /// How old the readings behind a GO may be, for the check of `top_speed_mps`.
    #[schemars(range(min = 10, max = 5000))]
    pub max_age_ms: u32,
    /// Where the hull may go.
    pub room: Room,
    /// The fastest that the robot goes back, over ground that it has just covered: slow enough that a person
    /// who has stepped there meanwhile is pushed rather than hit. From 0.1 m/s it stands within 2 cm.
    #[schemars(range(min = 0.01, max = 0.3))]
    pub reverse_speed_mps: f64,
    /// How much of the way just driven is remembered, so that the robot can go back over it.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub trail_m: f64,
    /// Whether a STOP only for something in front lets the robot go back over ground that it has just
    /// covered, so that it can free itself.
    pub allow_escape: bool,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            device: Device::Simulated,
            period_ms: 20,
            guard_deadline_ms: 100,
            command_deadline_ms: 100,
            device_deadline_ms: 100,
            motor_watchdog_ms: 100,
            max_wheel_speed_mps: 1.0,
            top_speed_mps: 0.36,
            max_speed_up_m_per_s2: 0.6,
            deceleration_m_per_s2: 0.8,
            wheel_track_m: 0.40,
            hull_front_m: 0.305,
            hull_rear_m: 0.305,
            hull_side_m: 0.255,
            front_radius_m: 0.200,
            max_age_ms: 150,
            room: Room::Seen,
            reverse_speed_mps: 0.10,
            trail_m: 1.0,
            allow_escape: true,
        }
    }
}

/// Why parameters of the base driver are refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParamsError {
    /// A value that does not fit its field.
    #[error(transparent)]
    Misfit(#[from] messages::Misfit),
    /// The driver would sleep through a deadline.
    #[error(
        "{name} = {deadline_ms} is shorter than period_ms = {period_ms}; lengthen the deadline or shorten the period"
    )]
    DeadlineBelowPeriod {
        /// The deadline.
        name: &'static str,
        /// Its value.
        deadline_ms: u32,
        /// The period.
        period_ms: u32,
    },
    /// One speed above another.
    #[error("{name} = {value} is above {limit_name} = {limit}; lower the first")]
    Above {
        /// What is too large.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must not exceed.
        limit_name: &'static str,
        /// Its value.
        limit: f64,
    },
    /// The robot cannot stop within what the guard watches.
    #[error(
        "at top_speed_mps = {top_mps} the robot needs {way_m:.3} m to stop ({reaction_s} s until the wheels are told, then {deceleration} \
         m/s²), but the guard watches front_radius_m = {radius_m} m; lower top_speed_mps to {fastest_mps:.2}, raise front_radius_m to \
         {way_m:.3}, or shorten max_age_ms or guard_deadline_ms"
    )]
    TooFastToStop {
        /// The speed.
        top_mps: f64,
        /// What it needs.
        way_m: f64,
        /// Until the wheels are told.
        reaction_s: f64,
        /// The motors' deceleration.
        deceleration: f64,
        /// What is watched.
        radius_m: f64,
        /// The speed that would do.
        fastest_mps: f64,
    },
    /// A command could hold for longer than the motors wait for the next.
    #[error(
        "motor_watchdog_ms = {watchdog_ms} is not above period_ms = {period_ms}, so the motors would stop between two commands; shorten \
         the period"
    )]
    WatchdogBelowPeriod {
        /// The watchdog.
        watchdog_ms: u32,
        /// The period.
        period_ms: u32,
    },
}

impl Params {
    /// The motor controller that they name.
    pub fn open_device(&self) -> Box<dyn BaseDevice> {
        match self.device {
            Device::Simulated => {
                Box::new(SimulatedBase::new(Duration::from_millis(self.device_deadline_ms.into())))
            }
        }
    }

    /// The robot from above.
    pub(crate) fn hull(&self) -> Hull {
        Hull { front_m: self.hull_front_m, rear_m: self.hull_rear_m, side_m: self.hull_side_m }
    }

    /// Between two steps without a message.
    pub fn period(&self) -> Duration {
        Duration::from_millis(self.period_ms.into())
    }
}

impl messages::Parameters for Params {
    type Error = ParamsError;

    fn check_together(&self) -> Result<(), ParamsError> {
        let deadlines = [
            ("guard_deadline_ms", self.guard_deadline_ms),
            ("command_deadline_ms", self.command_deadline_ms),
            ("device_deadline_ms", self.device_deadline_ms),
        ];
        for (name, deadline_ms) in deadlines {
            if deadline_ms < self.period_ms {
                return Err(ParamsError::DeadlineBelowPeriod {
                    name,
                    deadline_ms,
                    period_ms: self.period_ms,
                });
            }
        }
        if self.motor_watchdog_ms <= self.period_ms {
            let (watchdog_ms, period_ms) = (self.motor_watchdog_ms, self.period_ms);
            return Err(ParamsError::WatchdogBelowPeriod { watchdog_ms, period_ms });
        }
        let (speed_up, slow_down) = (self.max_speed_up_m_per_s2, self.deceleration_m_per_s2);
        not_above("max_speed_up_m_per_s2", speed_up, "deceleration_m_per_s2", slow_down)?;
        self.check_top_speed()
    }
}

impl Params {
    /// Where the guard's radius is what the robot must be able to stop within.
    fn check_top_speed(&self) -> Result<(), ParamsError> {
        let (deceleration, radius_m) = (self.deceleration_m_per_s2, self.front_radius_m);
        let reaction_s = self.reaction_s(self.max_age_ms);
        let way_m = speed::stopping_way_m(self.top_speed_mps, reaction_s, deceleration);
        if self.room == Room::Seen && way_m > radius_m {
            let fastest_mps = speed::fastest_mps(radius_m, reaction_s, deceleration);
            let top_mps = self.top_speed_mps;
            return Err(ParamsError::TooFastToStop {
                top_mps,
                way_m,
                reaction_s,
                deceleration,
                radius_m,
                fastest_mps,
            });
        }
        Ok(())
    }
}

fn not_above(
    name: &'static str,
    value: f64,
    limit_name: &'static str,
    limit: f64,
) -> Result<(), ParamsError> {
    if value <= limit { Ok(()) } else { Err(ParamsError::Above { name, value, limit_name, limit }) }
}
