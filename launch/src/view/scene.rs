//! What moves on the map, read from the board as any tool reads it.

use super::keys::Choice;
use super::snapshot::{BodyMark, Scene, Snapshot};
use crate::control::Status;
use crate::graph::ViewSettings;
use board::place::Place;
use board::tap::{Tap, TapReader};
use geometry::Pose2;
use messages::{
    BodyKind, Clearance, Message, MissionStatus, Path, PoseEstimate, RunSummary, TruePose, View, WorldTruth,
};

/// Places of the robot's trail that are kept, and how far they lie apart.
const TRAIL_MAX: usize = 2000;
const TRAIL_STEP_M: f64 = 0.1;

/// Reads the topics that a view shows; one that the graph lacks, or that is of another type, is left out.
pub(crate) struct SceneReader {
    readers: Readers,
    state: SceneState,
    /// Holds the place on the board.
    _tap: Option<Tap>,
}

#[derive(Default)]
struct SceneState {
    scene: Scene,
    has_truth: bool,
    mission: Option<MissionStatus>,
    clearance: Option<Clearance>,
    summary: Option<RunSummary>,
}

/// What is read for the view; each may be missing in a graph.
#[derive(Default)]
struct Readers {
    truth: Option<TapReader>,
    true_pose: Option<TapReader>,
    pose: Option<TapReader>,
    path: Option<TapReader>,
    mission: Option<TapReader>,
    clearance: Option<TapReader>,
    summary: Option<TapReader>,
}

impl SceneReader {
    /// Joins the board.
    pub(crate) fn open(place: &Place, settings: &ViewSettings) -> Self {
        let tap = Tap::join(place.clone(), "view").ok();
        let readers = tap.as_ref().map(|tap| Readers::open(tap, settings)).unwrap_or_default();
        Self { readers, state: SceneState::default(), _tap: tap }
    }

    /// Takes in what came since the last look.
    pub(crate) fn update(&mut self) {
        self.state.update(&mut self.readers);
    }

    /// Everything that one frame shows.
    pub(crate) fn snapshot(&self, status: Status, log: Vec<String>) -> Snapshot {
        Snapshot {
            status,
            summary: self.state.summary,
            mission: self.state.mission,
            clearance: self.state.clearance,
            scene: self.state.scene.clone(),
            log,
            is_attached: false,
            choice: Choice::default(),
        }
    }
}

impl Readers {
    fn open(tap: &Tap, settings: &ViewSettings) -> Self {
        let reader = |topic: &str, name: &str| {
            let (_, found) = tap.manifest().topic(topic)?;
            (found.message.name == name).then(|| tap.reader(topic).ok())?
        };
        let summary = tap.manifest().topics.iter().find(|topic| topic.message.name == RunSummary::NAME);
        Self {
            truth: reader(&settings.truth, WorldTruth::NAME),
            true_pose: reader("truth/pose", TruePose::NAME),
            pose: reader(&settings.pose, PoseEstimate::NAME),
            path: reader(&settings.path, Path::NAME),
            mission: reader(&settings.mission, MissionStatus::NAME),
            clearance: reader(&settings.clearance, Clearance::NAME),
            summary: summary.and_then(|topic| tap.reader(&topic.name).ok()),
        }
    }
}

impl SceneState {
    fn update(&mut self, readers: &mut Readers) {
        self.mission = readers.mission.as_mut().and_then(TapReader::newest).or(self.mission);
        self.clearance = readers.clearance.as_mut().and_then(TapReader::newest).or(self.clearance);
        self.summary = readers.summary.as_mut().and_then(TapReader::newest).or(self.summary);
        if let Some(reader) = &mut readers.truth
            && let Some((truth, bodies)) = newest_with_elements::<WorldTruth>(reader)
        {
            self.take_truth(&truth, &bodies);
        }
        if let Some(truth) = readers.true_pose.as_mut().and_then(TapReader::newest::<TruePose>) {
            self.has_truth = true;
            self.move_robot(
                truth.floor,
                Pose2 { x_m: truth.x_m, y_m: truth.y_m, heading_rad: truth.heading_rad },
            );
        }
        if let Some(estimate) = readers.pose.as_mut().and_then(TapReader::newest::<PoseEstimate>) {
            self.scene.estimate = estimate.pose().ok();
            if let (false, Some(pose)) = (self.has_truth, self.scene.estimate) {
                self.move_robot(estimate.floor, pose);
            }
        }
        if let Some(reader) = &mut readers.path
            && let Some((_, waypoints)) = newest_with_elements::<Path>(reader)
        {
            let places = waypoints.iter().map(|waypoint| [waypoint.x_m, waypoint.y_m]);
            self.scene.path = places.filter(|place| place.iter().all(|number| number.is_finite())).collect();
        }
    }

    fn take_truth(&mut self, truth: &WorldTruth, bodies: &[messages::TrueBody]) {
        self.has_truth = true;
        self.move_robot(
            truth.floor,
            Pose2 { x_m: truth.x_m, y_m: truth.y_m, heading_rad: truth.heading_rad },
        );
        self.scene.open_doors = u128::from(truth.open_doors[1]) << 64 | u128::from(truth.open_doors[0]);
        self.scene.bodies = bodies
            .iter()
            .filter(|body| body.floor == truth.floor)
            .filter_map(|body| {
                let pose = Pose2 { x_m: body.x_m, y_m: body.y_m, heading_rad: body.heading_rad };
                let kind = body.kind.get().ok().filter(|kind| *kind != BodyKind::None)?;
                pose.is_finite().then_some(BodyMark { kind, pose })
            })
            .collect();
    }

    fn move_robot(&mut self, floor: i32, pose: Pose2) {
        if !pose.is_finite() {
            return;
        }
        if floor != self.scene.floor {
            self.scene.floor = floor;
            self.scene.trail.clear();
        }
        self.scene.robot = Some(pose);
        let place = [pose.x_m, pose.y_m];
        let far = |last: &[f64; 2]| (last[0] - place[0]).hypot(last[1] - place[1]) >= TRAIL_STEP_M;
        if self.scene.trail.last().is_none_or(far) {
            if self.scene.trail.len() >= TRAIL_MAX {
                self.scene.trail.drain(..TRAIL_MAX / 2);
            }
            self.scene.trail.push(place);
        }
    }
}

fn newest_with_elements<T: Message>(reader: &mut TapReader) -> Option<(T, Vec<T::Element>)> {
    let mut newest = None;
    while let Some((_, bytes)) = reader.next() {
        if let Ok(view) = View::<T>::parse(bytes) {
            newest = Some((*view.message, view.elements.to_vec()));
        }
    }
    newest
}
