//! Sends the ultrasonic robot to its target: scan, turn to the nearest wall, scan again, localise, plan,
//! drive, and localise once more (NXT-095, Fig. 8). It is the layer between planner and controller that
//! decides what comes next (an executive, after Gat 1998).

mod arena;
mod flow;
mod params;
mod resolve;
mod route;

#[cfg(test)]
mod tests;

pub use params::{Params, ParamsError};

use arena::Arena;
use flow::{Count, Task};
use geometry::{Point2, Polygon, Pose2, World};
use messages::{
    FixedText, JourneyStageName, JourneyStatus, LocationStateName, MotionCommand, MotionReport, Once,
    Parameters, Particle, ParticleCloud, Path, PlanRequest, PoseEstimate, RangeScan, SonarCommand, Stamped,
    Time, WallSurvey,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// What the executive looks at.
#[derive(Debug, Clone, Copy, Default)]
pub struct Inputs<'a> {
    /// The newest raw scan.
    pub raw: Option<Stamped<'a, RangeScan>>,
    /// What the newest scan shows.
    pub survey: Option<Stamped<'a, WallSurvey>>,
    /// How the newest motion stands.
    pub report: Option<Stamped<'a, MotionReport>>,
    /// Where the robot is.
    pub pose: Option<Stamped<'a, PoseEstimate>>,
    /// Where else it may be.
    pub cloud: Option<Stamped<'a, ParticleCloud>>,
    /// The newest path.
    pub path: Option<Stamped<'a, Path>>,
}

/// What the executive says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outputs {
    /// For `sonar/command`.
    pub sonar: SonarCommand,
    /// For `motion/command`.
    pub motion: MotionCommand,
    /// For `plan/request`.
    pub request: PlanRequest,
    /// For `journey/status`.
    pub status: JourneyStatus,
}

/// The executive.
#[derive(Debug, Clone)]
pub struct Executive {
    params: Params,
    rng: Pcg64,
    arena: Arena,
    footprint: Polygon,
    floor: i32,
    target: Option<Point2<f64>>,
    task: Task,
    /// The newest pose, whether it is certain or not.
    belief: Option<Belief>,
    /// What the newest scan has shown, in the frame of the robot then.
    seen: Option<Arena>,
    /// The scan that it shows.
    scan: Once,
    /// The belief's pose when that scan was taken, or weighed.
    seen_at: Pose2,
    /// The belief's pose when `places` were found.
    placed_at: Pose2,
    /// Where it may be.
    places: resolve::Places,
    cloud: Once,
    /// Since when the robot waits for another service.
    waits_since: Option<Time>,
    /// Whether the robot has come to the end of a path.
    at_end: bool,
    /// Motions since the last scan that only made room for others.
    detours: u32,
    /// Looks in a row for the sake of certainty.
    looks: u32,
    only_localising: bool,
    count: Count,
    remark: FixedText<64>,
    sonar: SonarCommand,
    motion: MotionCommand,
    request: PlanRequest,
    /// The number of the last order, of whatever kind; zero before the first step.
    last_id: u64,
}

/// What the localiser says.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Belief {
    pose: Pose2,
    /// Standard deviations.
    sigma_m: f64,
    sigma_rad: f64,
    state: LocationStateName,
    /// Scans that it has taken in, or refused.
    scans: u64,
}

/// Tells the random numbers of a target from those of a roadmap.
const TARGET_STREAM: u64 = 0x5441_5247_4554;

impl Executive {
    /// An executive at the beginning of its journey.
    ///
    /// # Errors
    /// When the parameters make no sense, or the world file cannot be used.
    pub fn new(params: Params, seed: u64) -> Result<Self, ParamsError> {
        params.check()?;
        let world = if params.world.is_empty() { World::default() } else { World::load(&params.world)? };
        Self::in_world(params, &world, seed)
    }

    /// An executive in a world that is at hand already; `params.world` only names it.
    ///
    /// # Errors
    /// When the parameters make no sense, or the world has no target.
    pub fn in_world(params: Params, world: &World, seed: u64) -> Result<Self, ParamsError> {
        params.check()?;
        let (length_m, width_m) = (params.body_length_m, params.body_width_m);
        let footprint =
            Polygon::rectangle(length_m, width_m).map_err(|_| ParamsError::NoBody { length_m, width_m })?;
        let arena = Arena::of_world(world, footprint.clone());
        let target = Self::find_target(&params, world, &arena, seed)?;
        Ok(Self {
            rng: Pcg64::seed_from_u64(seed),
            arena,
            footprint,
            floor: world.floors.first().map_or(0, |floor| floor.number),
            target,
            task: Task::Waiting,
            belief: None,
            seen: None,
            scan: Once::default(),
            seen_at: Pose2::IDENTITY,
            placed_at: Pose2::IDENTITY,
            places: resolve::Places::default(),
            cloud: Once::default(),
            waits_since: None,
            at_end: false,
            detours: 0,
            looks: 0,
            only_localising: false,
            count: Count::default(),
            remark: FixedText::EMPTY,
            sonar: SonarCommand::default(),
            motion: MotionCommand::default(),
            request: PlanRequest::default(),
            last_id: 0,
            params,
        })
    }

    fn find_target(
        params: &Params,
        world: &World,
        arena: &Arena,
        seed: u64,
    ) -> Result<Option<Point2<f64>>, ParamsError> {
        let name = params.world.clone();
        if world.floors.is_empty() {
            return Ok(None);
        }
        if !params.random_target {
            let place = world.destination(&params.target, 0.0);
            let target = params.target.clone();
            let (_, pose) = place.ok_or(ParamsError::NoTarget { world: name, target })?;
            return Ok(Some(pose.position()));
        }
        let clearance_m = params.target_clearance_m;
        let mut rng = Pcg64::seed_from_u64(seed ^ TARGET_STREAM);
        let place = arena.outline().and_then(|outline| outline.random_place(clearance_m, || rng.random()));
        Ok(Some(place.ok_or(ParamsError::NoRandomTarget { world: name, clearance_m })?))
    }

    /// Takes in what is new, and decides what comes next.
    pub fn step(&mut self, now: Time, inputs: Inputs<'_>) -> Outputs {
        if self.last_id == 0 {
            self.last_id = now.as_nanos() / 1_000_000;
        }
        if let Some(pose) = inputs.pose {
            self.believe(&pose);
        }
        if let Some(raw) = inputs.raw.and_then(|raw| self.scan.take(raw)) {
            self.seen = Arena::of_scan(raw.message, raw.elements, self.footprint.clone());
        }
        if let Some(cloud) = inputs.cloud.and_then(|cloud| self.cloud.take(cloud)) {
            let elements: &[Particle] = cloud.elements;
            self.places = resolve::Places::of_cloud(cloud.message, elements);
            let alike = cloud.places().iter().filter(|place| place.share > ALIKE_SHARE).count();
            self.count.places = u32::try_from(alike).unwrap_or(u32::MAX);
        }
        // One thing may lead to another at once; what waits for an answer ends the loop.
        for _ in 0..MOST_AT_ONCE {
            if !self.advance(now, &inputs) {
                break;
            }
        }
        Outputs { sonar: self.sonar, motion: self.motion, request: self.request, status: self.status() }
    }

    fn believe(&mut self, message: &PoseEstimate) {
        let pose = Pose2 { x_m: message.x_m, y_m: message.y_m, heading_rad: message.heading_rad };
        let Ok(state) = message.state.get() else { return };
        if !pose.is_finite() {
            return;
        }
        let sigma = |variance: f64| if variance >= 0.0 { variance.sqrt().min(10.0) } else { 10.0 };
        self.belief = Some(Belief {
            pose: Pose2::new(pose.x_m, pose.y_m, pose.heading_rad),
            sigma_m: sigma(message.covariance[0].max(message.covariance[4])),
            sigma_rad: sigma(message.covariance[8]),
            state,
            scans: message.accepted.saturating_add(message.rejected),
        });
    }

    /// The pose, if it is certain.
    fn place(&self) -> Option<Belief> {
        self.belief.filter(|belief| belief.state == LocationStateName::Tracking)
    }

    fn to_target_m(&self) -> f64 {
        match (self.place(), self.target) {
            (Some(belief), Some(target)) => (belief.pose.position() - target).norm(),
            _ => f64::NAN,
        }
    }

    fn status(&self) -> JourneyStatus {
        let stage = match &self.task {
            Task::Waiting => JourneyStageName::Waiting,
            Task::Surveying => JourneyStageName::Surveying,
            Task::Moving { stage, .. } => *stage,
            Task::Measuring { .. } | Task::Locating { .. } => JourneyStageName::Measuring,
            Task::Planning => JourneyStageName::Planning,
            Task::Ended { arrived: true } => JourneyStageName::Arrived,
            Task::Ended { arrived: false } => JourneyStageName::Failed,
        };
        let target = self.target.unwrap_or(Point2::new(f64::NAN, f64::NAN));
        JourneyStatus {
            target_x_m: target.x,
            target_y_m: target.y,
            distance_m: self.to_target_m(),
            scans: self.count.scans,
            located: self.count.located,
            ambiguous: self.count.ambiguous,
            retreats: self.count.retreats,
            plans: self.count.plans,
            places: self.count.places,
            rounds: self.count.rounds,
            only_localising: self.only_localising.into(),
            stage: stage.into(),
            remark: self.remark,
        }
    }
}

/// Clusters with a larger share of the weight are places that look alike.
const ALIKE_SHARE: f64 = 0.05;
/// The most decisions that are taken in one step.
const MOST_AT_ONCE: usize = 8;
