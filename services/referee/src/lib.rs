//! Judges a run against the truth and says at any time how it stands: a delivery by contacts, clearance and
//! where the robot halts (COF-004, COF-104), a localisation by its errors against a log with ground truth,
//! the way to a target in an arena by the columns of Table I of the ultrasonic robot (NXT-102 to NXT-104).

mod arena;
mod delivery;
mod errors;
mod params;
mod shortest;

#[cfg(test)]
mod tests;

pub use params::{Mode, Params, ParamsError};

pub use shortest::shortest_m;

use arena::ArenaRun;
use delivery::{Delivery, Ruling};
use geometry::{Pose2, World};
use messages::{
    AppliedWheels, Clearance, FixedText, JourneyStatus, MissionStatus, Parameters, PoseEstimate, RunState,
    RunSummary, Stamped, Time, TruePose, WorldTruth,
};

/// How long after the last true pose poses that answer the last readings may still arrive.
const AFTERMATH_S: f64 = 0.5;

/// What the referee looks at.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// The newest of `world/truth`.
    pub truth: Option<Stamped<'a, WorldTruth>>,
    /// The newest of `mission/status`.
    pub mission: Option<Stamped<'a, MissionStatus>>,
    /// The newest of `journey/status`.
    pub journey: Option<Stamped<'a, JourneyStatus>>,
    /// The newest of `location/pose`.
    pub location: Option<Stamped<'a, PoseEstimate>>,
    /// The newest of `wheels/applied`.
    pub applied: Option<Stamped<'a, AppliedWheels>>,
    /// The newest of `safety/clearance`.
    pub clearance: Option<Stamped<'a, Clearance>>,
    /// The newest of `truth/pose`.
    pub true_pose: Option<Stamped<'a, TruePose>>,
}

/// What the referee says.
#[derive(Debug, Clone, PartialEq)]
pub struct Outputs {
    /// For `run/summary`: once a period, and at once when the run is over.
    pub summary: Option<RunSummary>,
}

/// The referee.
#[derive(Debug, Clone)]
pub struct Referee {
    params: Params,
    run: Delivery,
    arena: ArenaRun,
    log_ended: Option<Time>,
    verdict: Option<RunSummary>,
    next: Option<Time>,
}

impl Referee {
    /// A referee before the run.
    ///
    /// # Errors
    /// When the parameters make no sense, or the world file cannot be used.
    pub fn new(params: Params) -> Result<Self, ParamsError> {
        params.check()?;
        let world = if params.world.is_empty() { World::default() } else { World::load(&params.world)? };
        Self::in_world(params, world)
    }

    /// A referee in a world that is at hand already.
    ///
    /// # Errors
    /// When the parameters make no sense.
    pub fn in_world(params: Params, world: World) -> Result<Self, ParamsError> {
        params.check()?;
        let arena = ArenaRun::new(&params, &world);
        let run = Delivery::new(&params, world);
        Ok(Self { params, run, arena, log_ended: None, verdict: None, next: None })
    }

    /// Looks, and says how the run stands. A verdict is final.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs {
        if self.verdict.is_none() {
            let (state, remark) = match self.params.mode {
                Mode::Delivery => self.run.look(&self.params, now, &inputs),
                Mode::Localisation => self.follow_log(now, &inputs),
                Mode::Arena => self.arena.look(&self.params, now, &inputs),
            };
            if state != RunState::Running {
                let summary = self.summary(state, &remark);
                self.verdict = Some(summary);
                self.next = None;
            } else if self.is_due(now) {
                return self.say(now, self.summary(state, &remark));
            }
        }
        match self.verdict {
            Some(verdict) if self.is_due(now) => self.say(now, verdict),
            _ => Outputs { summary: None },
        }
    }

    fn is_due(&self, now: Time) -> bool {
        self.next.is_none_or(|next| now >= next)
    }

    fn say(&mut self, now: Time, summary: RunSummary) -> Outputs {
        // Half a look's tolerance, as timers may fire a little early.
        let wait_ms = u64::from(self.params.period_ms.saturating_sub(self.params.sample_ms / 2));
        self.next = Some(now.after(std::time::Duration::from_millis(wait_ms)));
        Outputs { summary: Some(summary) }
    }

    fn follow_log(&mut self, now: Time, inputs: &Inputs<'_>) -> Ruling {
        let comparison = &mut self.run.comparison;
        if let Some(location) = inputs.location {
            comparison.pose(location);
        }
        if let Some(truth) = inputs.true_pose {
            comparison.truth(truth.stamp, Pose2::new(truth.x_m, truth.y_m, truth.heading_rad), truth.floor);
            if truth.is_last == 1 {
                self.log_ended.get_or_insert(now);
            }
        }
        let ended = self.log_ended.is_some_and(|ended| now.seconds_since(ended) >= AFTERMATH_S);
        comparison.settle(ended);
        let errors = &comparison.errors;
        if !ended {
            return (RunState::Running, format!("{} poses compared", errors.count));
        }
        let (median_m, p95_m) = (errors.quantile_m(0.5), errors.quantile_m(0.95));
        let median_deg = comparison.turns.quantile_m(0.5);
        let Params { max_median_m, max_p95_m, max_median_heading_deg, .. } = self.params;
        // Without a single pose both are NaN, and no bound holds.
        let passed = median_m <= max_median_m && p95_m <= max_p95_m && median_deg <= max_median_heading_deg;
        let state = if passed { RunState::Passed } else { RunState::Failed };
        (
            state,
            format!(
                "median {median_m:.3} m (bound {max_median_m} m), 95 % {p95_m:.3} m (bound {max_p95_m} m), {median_deg:.2} deg"
            ),
        )
    }

    fn summary(&self, state: RunState, remark: &str) -> RunSummary {
        let mut summary =
            RunSummary { state: state.into(), remark: FixedText::truncated(remark), ..RunSummary::default() };
        let comparison = &self.run.comparison;
        match self.params.mode {
            Mode::Delivery => self.run.write(&mut summary),
            Mode::Arena => self.arena.write(&mut summary),
            Mode::Localisation => {
                summary.push("poses compared", comparison.errors.count as f64, "");
                summary.push("error, median", comparison.errors.quantile_m(0.5), "m");
                summary.push("error, 95 %", comparison.errors.quantile_m(0.95), "m");
                summary.push(
                    "error, largest",
                    if comparison.errors.count > 0 { comparison.errors.max_m } else { f64::NAN },
                    "m",
                );
                summary.push("heading error, median", comparison.turns.quantile_m(0.5), "deg");
                summary.push("ranges accepted", comparison.accepted as f64, "");
                summary.push("ranges rejected", comparison.rejected as f64, "");
                summary.push("poses on a wrong floor", comparison.wrong_floor as f64, "");
            }
        }
        summary
    }
}
