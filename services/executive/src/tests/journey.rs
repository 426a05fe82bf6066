use crate::{Executive, Inputs, Params};
use geometry::World;
use messages::{
    JourneyStageName, LocationState, MotionKindName, MotionReport, MotionState, MotionStateName, Parameters,
    Particle, ParticleCloud, Path, PlanState, PoseEstimate, RangeScan, SonarModeName, Stamped, Time,
    WallSurvey, Waypoint,
};
use proptest::prelude::*;

/// A box, two metres long and one metre wide, with a target in its middle.
const BOX: &str = "name = \"box\"\n[[floor]]\nnumber = 0\noutline = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]\n\
    [[place]]\nname = \"target\"\nfloor = 0\npose = { x_m = 1.0, y_m = 0.5 }\n";

fn executive(params: Params) -> Executive {
    Executive::in_world(params, &World::parse(BOX).expect("a box"), 1).expect("default")
}

#[test]
fn the_target_is_the_places_or_a_random_one() {
    let status = executive(Params::default()).step(Time::ZERO, Inputs::default()).status;
    assert_eq!((status.target_x_m, status.target_y_m), (1.0, 0.5));
    let random = Params { random_target: true, ..Params::default() };
    let status = executive(random.clone()).step(Time::ZERO, Inputs::default()).status;
    assert!((0.1..=1.9).contains(&status.target_x_m) && (0.1..=0.9).contains(&status.target_y_m));
    let again = executive(random).step(Time::ZERO, Inputs::default()).status;
    assert_eq!((status.target_x_m, status.target_y_m), (again.target_x_m, again.target_y_m));
}

#[test]
fn worlds_without_a_target_are_refused() {
    let world = World::parse(BOX).expect("a box");
    let nowhere = Params { target: "nowhere".to_owned(), ..Params::default() };
    assert!(
        Executive::in_world(nowhere, &world, 1).is_err_and(|error| error.to_string().contains("nowhere"))
    );
    let far = Params { random_target: true, target_clearance_m: 0.6, ..Params::default() };
    assert!(Executive::in_world(far, &world, 1).is_err());
    let params = Params { way_sigmas: f64::NAN, ..Params::default() };
    assert!(
        params.check().is_err_and(|error| error.to_string().contains("`way_sigmas` is not a finite number"))
    );
}

/// The other services, as they answer at once: the robot is where it is told to be.
struct Others {
    executive: Executive,
    now_ms: u64,
    pose: PoseEstimate,
    survey: WallSurvey,
    report: MotionReport,
    waypoints: Vec<Waypoint>,
}

impl Others {
    fn step(&mut self) -> crate::Outputs {
        self.now_ms += 50;
        let now = Time::from_nanos(self.now_ms * 1_000_000);
        let header = RangeScan {
            angle_step_rad: std::f64::consts::TAU / 36.0,
            range_max_m: 2.55,
            ..RangeScan::default()
        };
        let ranges = [0.45_f32; 36];
        let cloud = ParticleCloud::default();
        let path =
            Path { request_id: self.executive.request.request_id, state: PlanState(1), ..Path::default() };
        let outputs = self.executive.step(
            now,
            Inputs {
                raw: Some(Stamped::with_elements(now, &header, &ranges)),
                survey: Some(Stamped::new(now, &self.survey)),
                report: Some(Stamped::new(now, &self.report)),
                pose: Some(Stamped::new(now, &self.pose)),
                cloud: Some(Stamped::new(now, &cloud)),
                path: Some(Stamped::with_elements(now, &path, &self.waypoints)),
            },
        );
        self.survey.command_id = outputs.sonar.command_id;
        self.pose.accepted += u64::from(outputs.sonar.measure);
        // Motions are carried out at once.
        if outputs.motion.command_id != self.report.command_id {
            self.report.command_id = outputs.motion.command_id;
            self.report.state = MotionStateName::Done.into();
            match outputs.motion.kind.get() {
                Ok(MotionKindName::Turn) => self.pose.heading_rad += outputs.motion.turn_rad,
                Ok(MotionKindName::Move) => {
                    let (sine, cosine) = self.pose.heading_rad.sin_cos();
                    self.pose.x_m += outputs.motion.distance_m * cosine;
                    self.pose.y_m += outputs.motion.distance_m * sine;
                }
                _ => {}
            }
        }
        outputs
    }
}

fn others(state: u32) -> Others {
    let pose = PoseEstimate {
        x_m: 0.4,
        y_m: 0.4,
        covariance: [1e-5, 0.0, 0.0, 0.0, 1e-5, 0.0, 0.0, 0.0, 1e-5],
        state: LocationState(state),
        ..PoseEstimate::default()
    };
    let waypoints = [[0.4, 0.4], [0.7, 0.7], [1.0, 0.5]].map(|[x_m, y_m]| Waypoint { x_m, y_m }).to_vec();
    let survey = WallSurvey { bearing_rad: 0.8, range_m: 0.4, ..WallSurvey::default() };
    let executive = executive(Params::default());
    Others { executive, now_ms: 0, pose, survey, report: MotionReport::default(), waypoints }
}

#[test]
fn scan_turn_scan_plan_drive_scan() {
    let mut others = others(1);
    let mut stages = Vec::new();
    for _ in 0..200 {
        let outputs = others.step();
        let stage = outputs.status.stage.get().expect("a stage");
        if stages.last() != Some(&stage) {
            stages.push(stage);
        }
        if outputs.sonar.command_id != 0 {
            assert_eq!(outputs.sonar.mode, SonarModeName::Ultrascan);
        }
    }
    use JourneyStageName::{Aligning, Arrived, Driving, Measuring, Surveying};
    assert_eq!(stages.first(), Some(&Surveying));
    assert_eq!(stages.last(), Some(&Arrived), "{stages:?}");
    for stage in [Aligning, Measuring, Driving] {
        assert!(stages.contains(&stage), "{stages:?}");
    }
    let status = others.step().status;
    assert!(status.distance_m < 0.02 && status.rounds == 1 && status.ambiguous == 0, "{status:?}");
}

#[test]
fn a_robot_that_never_knows_its_place_gives_up() {
    let mut others = others(3);
    let status = (0..5000).map(|_| others.step().status).last().expect("many");
    assert_eq!(status.stage, JourneyStageName::Failed);
    assert!(status.ambiguous > 5, "{status:?}");
}

#[test]
fn near_walls_are_followed_by_another_look() {
    let mut others = others(1);
    while others.step().status.stage != JourneyStageName::Driving {}
    let scans = others.step().status.scans;
    others.report.state = MotionStateName::NearWall.into();
    let status = others.step().status;
    assert_eq!((status.retreats, status.scans), (1, scans + 1));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_message_is_survived(
        steps in proptest::collection::vec((proptest::array::uniform9(any::<f64>()), proptest::array::uniform6(any::<u32>()), any::<bool>()), 1..25),
        floats in proptest::collection::vec(any::<f32>(), 0..50),
    ) {
        let mut executive = executive(Params::default());
        let mut last = executive.step(Time::ZERO, Inputs::default());
        for (step, (n, states, follows)) in (1..).zip(steps) {
            let now = Time::from_nanos(step * 50_000_000);
            let raw = RangeScan {
                sensor_x_m: 0.0, sensor_y_m: 0.0, sensor_heading_rad: n[0], angle_min_rad: n[1], angle_step_rad: n[2], range_max_m: n[3],
            };
            let id = |id: u64| if follows { id } else { u64::from(states[0]) };
            let survey = WallSurvey { command_id: id(last.sonar.command_id), bearing_rad: n[4], range_m: n[5], ..WallSurvey::default() };
            let report = MotionReport { command_id: id(last.motion.command_id), state: MotionState(states[1] % 7), ..MotionReport::default() };
            let pose = PoseEstimate { x_m: n[6], y_m: n[7], heading_rad: n[8], covariance: n, state: LocationState(states[2] % 5), accepted: step, ..PoseEstimate::default() };
            let cloud = ParticleCloud { cluster_count: states[3], origin_x_m: n[0], ..ParticleCloud::default() };
            let particles = [Particle { x_m: n[1] as f32, weight: n[2] as f32, ..Particle::default() }; 3];
            let path = Path { request_id: id(last.request.request_id), state: PlanState(states[4] % 6), ..Path::default() };
            let waypoints = [Waypoint { x_m: n[3], y_m: n[4] }; 4];
            last = executive.step(now, Inputs {
                raw: Some(Stamped::with_elements(now, &raw, &floats)),
                survey: Some(Stamped::new(now, &survey)),
                report: Some(Stamped::new(now, &report)),
                pose: Some(Stamped::new(now, &pose)),
                cloud: Some(Stamped::with_elements(now, &cloud, &particles)),
                path: Some(Stamped::with_elements(now, &path, &waypoints[..states[5] as usize % 5])),
            });
            prop_assert!(last.status.stage.get().is_ok());
            prop_assert!(!last.motion.retreat_m.is_nan());
        }
    }
}
