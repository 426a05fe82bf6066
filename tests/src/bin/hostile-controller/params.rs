//! What it does, and when.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What it does once it has begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Mode {
    /// Both wheels ahead as fast as they go.
    #[default]
    Max,
    /// Both wheels back as fast as they go.
    MaxBackwards,
    /// On the spot, to the left.
    Spin,
    /// On the spot, to the right.
    SpinRight,
    /// The wheels at `left_mps` and `right_mps`.
    Steady,
    /// Full speed ahead and back in turn.
    Oscillate,
    /// Full speed left and right in turn, with both wheels ahead.
    Waggle,
    /// Full speed on the spot, left and right in turn.
    Shake,
    /// Random speeds, for random times.
    Zigzag,
    /// As `Zigzag`, mostly ahead, so that it gets somewhere.
    Wander,
    /// Invalid numbers.
    Nan,
    /// Infinite numbers.
    Infinite,
    /// Numbers that no wheel can turn by.
    Huge,
    /// The decent controller's command, a little askew.
    Askew,
    /// As `Max`, a hundred times a step.
    Flood,
    /// As `Max`, but every other command comes late.
    Stale,
    /// Nothing any more.
    Silent,
    /// As `Max`; ends after a second as if it were done.
    ExitZero,
    /// As `Max`; ends after a second with code 2.
    ExitTwo,
    /// As `Max`; hangs after a second.
    Hang,
    /// As `Max`; never ends its step after a second.
    Busy,
    /// As `Max`; aborts after a second.
    Abort,
    /// As `Max`; panics after a second.
    Panic,
    /// As `Max`, with children that outlive it.
    Fork,
    /// As `Max`, with as many words in its log as fit.
    Log,
    /// As `Max`, and takes more and more memory.
    Memory,
}

/// Who drives before it begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Decency {
    /// Nobody: the robot stands.
    None,
    /// `fuzzy-controller`.
    #[default]
    Fuzzy,
    /// `move-controller`, whose reports go on afterwards.
    Motion,
}

/// The parameters of the hostile controller.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub(crate) struct Params {
    /// What it does once it has begun.
    pub(crate) mode: Mode,
    /// It begins so long after its start.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub(crate) begins_s: f64,
    /// Who drives before.
    pub(crate) decent: Decency,
    /// What it takes for the fastest: 0 for 1 m/s.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub(crate) speed_mps: f64,
    /// The left wheel, for `steady`.
    #[schemars(range(min = -3.0, max = 3.0))]
    pub(crate) left_mps: f64,
    /// The right wheel, for `steady`.
    #[schemars(range(min = -3.0, max = 3.0))]
    pub(crate) right_mps: f64,
    /// Parameters of `move-controller`.
    pub(crate) motion: move_controller::Params,
    /// Parameters of `fuzzy-controller`, beside these, so that its table suits.
    #[serde(flatten)]
    pub(crate) fuzzy: fuzzy_controller::Params,
}

impl Params {
    /// Between two commands.
    pub(crate) fn period(&self) -> Duration {
        match (self.mode, self.decent) {
            (Mode::Flood, _) => Duration::from_millis(2),
            (_, Decency::Motion) => self.motion.period(),
            _ => Duration::from_millis(50),
        }
    }

    pub(crate) fn fastest_mps(&self) -> f64 {
        if self.speed_mps > 0.0 { self.speed_mps } else { 1.0 }
    }
}

impl messages::Parameters for Params {
    type Error = fuzzy_controller::ParamsError;

    fn check_together(&self) -> Result<(), Self::Error> {
        self.fuzzy.check_together()
    }
}
