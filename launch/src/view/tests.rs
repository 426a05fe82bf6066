//! The view on screens of several sizes.

use super::keys::Choice;
use super::plan::Plan;
use super::snapshot::{BodyMark, Scene, Snapshot};
use super::{frame::draw, map::is_worthwhile};
use crate::control::{EventLine, ServiceStatus, Status};
use geometry::{Pose2, World};
use messages::{
    BodyKind, Clearance, DeliveryStatusName, FixedText, GuardReasonName, MissionStatus, RunState, RunSummary,
    Verdict,
};
use ratatui::Terminal;
use ratatui::backend::TestBackend;

const HALL: &str = r#"
name = "hall"
[[floor]]
number = 2
name = "second floor"
walls = [
  [[0.0, -0.85], [30.0, -0.85]],
  [[0.0, 0.85], [13.0, 0.85], [13.0, 4.5], [15.0, 4.5], [15.0, 0.85], [30.0, 0.85]],
  [[0.0, -0.85], [0.0, 0.85]],
  [[30.0, -0.85], [30.0, 0.85]],
]
[[door]]
room = "209"
floor = 2
at = [6.0, -0.85]
into_room = [0, -1]
room_depth_m = 2.0
[[door]]
room = "207"
floor = 2
at = [20.0, -0.85]
into_room = [0, -1]
room_depth_m = 2.0
open = true
"#;

fn service(role: &str, state: &str, restarts: u32) -> ServiceStatus {
    ServiceStatus {
        role: role.to_owned(),
        run: role.to_owned(),
        state: state.to_owned(),
        pid: Some(4711),
        restarts,
        rate_hz: 30.0,
        cpu_percent: 1.25,
        memory_kib: 2048,
        step_p50_us: 42.0,
        step_p99_us: 1234.0,
        step_max_us: 5000.0,
        late_steps: 0,
        lost_messages: u64::from(restarts),
        invalid_messages: 0,
        swap: None,
    }
}

fn snapshot() -> Snapshot {
    let roles = [
        "simulator",
        "tof-driver",
        "tag-driver",
        "tag-localiser",
        "collision-avoidance",
        "angle-correction",
        "door-locator",
        "current-state",
        "navigator",
        "grid-planner",
        "fuzzy-controller",
        "base-driver",
        "referee",
    ];
    let mut services: Vec<_> = roles.iter().map(|role| service(role, "running", 0)).collect();
    services[3] = service("tag-localiser", "restarting", 2);
    let event = |at_s: f64, role: &str, text: &str, is_trouble| EventLine {
        at_s,
        role: role.to_owned(),
        text: text.to_owned(),
        is_trouble,
    };
    let mut summary = RunSummary { remark: FixedText::truncated("on its way"), ..RunSummary::default() };
    summary.state = RunState::Running.into();
    summary.push("collisions", 0.0, "");
    summary.push("mean speed", 0.4567, "m/s");
    summary.push("time at door", f64::NAN, "s");
    Snapshot {
        status: Status {
            overrides: crate::graph::Overrides::default(),
            board: "coffee".to_owned(),
            graph: "graphs/coffee.toml".to_owned(),
            launcher_pid: 1,
            uptime_s: 3723.4,
            logs: String::new(),
            mode: "live".to_owned(),
            services,
            events: vec![
                event(0.05, "", "all 13 services are ready after 48 ms", false),
                event(60.2, "tag-localiser", "died: signal 9 (KILL); starts again in 100 ms", true),
            ],
            ..Status::default()
        },
        summary: Some(summary),
        mission: Some(MissionStatus {
            room: FixedText::truncated("207"),
            status: DeliveryStatusName::NearDoor.into(),
            distance_m: 3.25,
            delivered: 1,
            ..MissionStatus::default()
        }),
        clearance: Some(Clearance {
            signal: Verdict::Go.into(),
            reason: GuardReasonName::Clear.into(),
            front_m: 1.5,
            ..Clearance::default()
        }),
        scene: Scene {
            floor: 2,
            robot: Some(Pose2::new(16.5, 0.0, 0.1)),
            estimate: Some(Pose2::new(16.9, 0.1, 0.1)),
            trail: (0..30).map(|step| [13.0 + 0.1 * f64::from(step), 0.0]).collect(),
            path: vec![[16.5, 0.0], [19.0, 0.2], [20.0, -0.3]],
            bodies: vec![
                BodyMark { kind: BodyKind::Walker, pose: Pose2::new(24.0, 0.3, 0.0) },
                BodyMark { kind: BodyKind::Sofa, pose: Pose2::new(10.0, 0.3, 1.57) },
            ],
            open_doors: 0b10,
        },
        log: Vec::new(),
        is_attached: false,
        choice: Choice::default(),
    }
}

fn screen(width: u16, height: u16, snapshot: &Snapshot, plan: Option<&Plan>) -> String {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| draw(frame, snapshot, plan)).unwrap();
    terminal.backend().to_string()
}

fn hall() -> Plan {
    Plan::of(&World::parse(HALL).unwrap())
}

#[test]
fn a_small_screen() {
    insta::assert_snapshot!(screen(80, 24, &snapshot(), Some(&hall())));
}

#[test]
fn a_large_screen() {
    insta::assert_snapshot!(screen(160, 50, &snapshot(), Some(&hall())));
}

#[test]
fn without_a_map() {
    let bare = Snapshot { scene: Scene::default(), mission: None, clearance: None, ..snapshot() };
    assert!(!is_worthwhile(None, &bare.scene));
    insta::assert_snapshot!(screen(100, 24, &bare, None));
}

#[test]
fn help_lies_on_top() {
    let text = screen(
        80,
        24,
        &Snapshot { choice: Choice { help: true, ..Choice::default() }, ..snapshot() },
        Some(&hall()),
    );
    assert!(text.contains("stop the robot, then its services"), "{text}");
}

#[test]
fn no_size_and_no_nonsense_breaks_it() {
    let plan = hall();
    let mut odd = snapshot();
    odd.scene.robot = Some(Pose2 { x_m: 1e300, y_m: f64::NAN, heading_rad: f64::INFINITY });
    odd.scene.path = vec![[f64::NAN, 0.0], [f64::INFINITY, 1.0]];
    odd.status.uptime_s = f64::NAN;
    odd.status.services[0].step_p50_us = f64::NAN;
    odd.summary = Some(RunSummary { metric_count: u32::MAX, ..RunSummary::default() });
    for (width, height) in [(1, 1), (3, 2), (10, 5), (20, 40), (39, 12), (80, 24), (200, 60), (300, 100)] {
        for plan in [None, Some(&plan)] {
            let text = screen(width, height, &odd, plan);
            assert_eq!(text.lines().count(), usize::from(height), "{text}");
        }
    }
}
