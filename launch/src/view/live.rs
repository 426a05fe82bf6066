//! The view on a terminal, fed from the board.

use super::frame::draw;
use super::plan::Plan;
use super::snapshot::{BodyMark, Scene, Snapshot};
use crate::graph::{Checked, ViewSettings};
use crate::monitor::{Monitor, newest};
use crate::supervise::Supervisor;
use crate::up::Display;
use board::tap::TapReader;
use crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use geometry::{Pose2, World};
use messages::{BodyKind, Clearance, Message, MissionStatus, Path, PoseEstimate, TruePose, View, WorldTruth};
use ratatui::DefaultTerminal;
use std::path::PathBuf;
use std::time::Duration;

/// Places of the robot's trail that are kept, and how far they lie apart.
const TRAIL_MAX: usize = 2000;
const TRAIL_STEP_M: f64 = 0.1;

/// Holds the terminal while a graph runs.
pub(crate) struct Live {
    terminal: Terminal,
    settings: ViewSettings,
    graph: PathBuf,
    plan: Option<Plan>,
    readers: Option<Readers>,
    snapshot: SceneState,
    help: bool,
    leaving: bool,
}

/// The terminal is taken with the first frame, so that what goes wrong before is read as lines.
enum Terminal {
    NotYet,
    Ours(Box<DefaultTerminal>),
    GivenBack,
}

#[derive(Default)]
struct SceneState {
    scene: Scene,
    has_truth: bool,
    mission: Option<MissionStatus>,
    clearance: Option<Clearance>,
}

/// What is read for the view; each may be missing in a graph.
struct Readers {
    truth: Option<TapReader>,
    true_pose: Option<TapReader>,
    pose: Option<TapReader>,
    path: Option<TapReader>,
    mission: Option<TapReader>,
    clearance: Option<TapReader>,
}

impl Live {
    /// A view of this graph.
    pub(crate) fn new(graph: &Checked) -> Self {
        // A world that cannot be read is the simulator's to refuse; the view does without.
        let world = graph.view.world.as_ref().and_then(|world| World::load(graph.folder.join(world)).ok());
        Self {
            terminal: Terminal::NotYet,
            settings: graph.view.clone(),
            graph: graph.file.clone(),
            plan: world.as_ref().map(Plan::of),
            readers: None,
            snapshot: SceneState::default(),
            help: false,
            leaving: false,
        }
    }

    fn read_keys(&mut self) {
        while event::poll(Duration::ZERO).unwrap_or(false) {
            let Ok(event) = event::read() else { return };
            let Event::Key(key) = event else { continue };
            if key.kind != KeyEventKind::Press {
                continue;
            }
            match key.code {
                KeyCode::Char('q') => self.leaving = true,
                // A terminal in raw mode sends no signal for it.
                KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => self.leaving = true,
                KeyCode::Char('?' | 'h') => self.help = !self.help,
                KeyCode::Esc => self.help = false,
                _ => {}
            }
        }
    }
}

impl Display for Live {
    fn show(&mut self, supervisor: &Supervisor, monitor: &mut Monitor) {
        if matches!(self.terminal, Terminal::NotYet) {
            // Without a terminal the run goes on unseen.
            self.terminal = ratatui::try_init()
                .map_or(Terminal::GivenBack, |terminal| Terminal::Ours(Box::new(terminal)));
        }
        self.read_keys();
        let readers = self.readers.get_or_insert_with(|| Readers::open(monitor, &self.settings));
        self.snapshot.update(readers);
        let snapshot = Snapshot {
            status: monitor.status(supervisor, &self.graph),
            mode: "live",
            summary: monitor.summary().copied(),
            mission: self.snapshot.mission,
            clearance: self.snapshot.clearance,
            scene: self.snapshot.scene.clone(),
            help: self.help,
        };
        if let Terminal::Ours(terminal) = &mut self.terminal {
            // A terminal that is gone sends a signal, which ends the run.
            let _ = terminal.draw(|frame| draw(frame, &snapshot, self.plan.as_ref()));
        }
    }

    fn wants_to_leave(&mut self) -> bool {
        self.leaving
    }

    fn close(&mut self) {
        // The readers hold places on the board.
        self.readers = None;
        if matches!(std::mem::replace(&mut self.terminal, Terminal::GivenBack), Terminal::Ours(_)) {
            ratatui::restore();
        }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.close();
    }
}

impl Readers {
    fn open(monitor: &Monitor, settings: &ViewSettings) -> Self {
        // A topic that the graph lacks, or that is of another type, is left out.
        let reader = |topic: &str, name: &str| {
            let (_, found) = monitor.tap.manifest().topic(topic)?;
            (found.message.name == name).then(|| monitor.tap.reader(topic).ok())?
        };
        Self {
            truth: reader(&settings.truth, WorldTruth::NAME),
            true_pose: reader("truth/pose", TruePose::NAME),
            pose: reader(&settings.pose, PoseEstimate::NAME),
            path: reader(&settings.path, Path::NAME),
            mission: reader(&settings.mission, MissionStatus::NAME),
            clearance: reader(&settings.clearance, Clearance::NAME),
        }
    }
}

impl SceneState {
    fn update(&mut self, readers: &mut Readers) {
        self.mission = readers.mission.as_mut().and_then(newest).or(self.mission);
        self.clearance = readers.clearance.as_mut().and_then(newest).or(self.clearance);
        if let Some(reader) = &mut readers.truth
            && let Some((truth, bodies)) = newest_with_elements::<WorldTruth>(reader)
        {
            self.take_truth(&truth, &bodies);
        }
        if let Some(truth) = readers.true_pose.as_mut().and_then(newest::<TruePose>) {
            self.has_truth = true;
            self.move_robot(
                truth.floor,
                Pose2 { x_m: truth.x_m, y_m: truth.y_m, heading_rad: truth.heading_rad },
            );
        }
        if let Some(estimate) = readers.pose.as_mut().and_then(newest::<PoseEstimate>) {
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
