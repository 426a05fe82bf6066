use super::*;
use geometry::angle::difference;
use messages::CarState;
use proptest::prelude::*;

/// A hall 20 m long and 4 m wide about the x axis, with an elevator that leads to a second one; the robot
/// begins at its left end.
const HALL: &str = r#"
name = "hall"
[[floor]]
number = 1
walls = [[[-1.0, -2.0], [19.0, -2.0], [19.0, 2.0], [-1.0, 2.0], [-1.0, -2.0]]]
[[floor]]
number = 2
walls = [[[-1.0, -2.0], [19.0, -2.0], [19.0, 2.0], [-1.0, 2.0], [-1.0, -2.0]]]
[[elevator]]
name = "lift"
floors = [1, 2]
at = [2.0, -2.0]
into_car = [0, -1]
[[start]]
floor = 1
pose = { x_m = 0.0, y_m = 0.0 }
"#;

const STEP_MS: u64 = 10;

fn at(ms: u64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

/// Equal motors, no slip, no noise: what textbooks drive with.
fn ideal() -> Params {
    Params { right_gain: 1.0, slip_fraction: 0.0, way_noise_m: 0.0, ..Params::default() }
}

struct Run {
    simulator: Simulator,
    now_ms: u64,
}

impl Run {
    fn new(params: Params, world: &str) -> Self {
        let world = if world.is_empty() { World::default() } else { World::parse(world).unwrap() };
        Self { simulator: Simulator::in_world(params, &world, 7).unwrap(), now_ms: 0 }
    }

    /// Drives for so long with wheels that are told these speeds all the time.
    fn drive(&mut self, left_mps: f64, right_mps: f64, seconds: f64) -> WorldTruth {
        self.drive_calling(left_mps, right_mps, seconds, None)
    }

    fn drive_calling(
        &mut self,
        left_mps: f64,
        right_mps: f64,
        seconds: f64,
        call: Option<ElevatorCall>,
    ) -> WorldTruth {
        let applied = AppliedWheels { left_mps, right_mps, ..AppliedWheels::default() };
        let mut truth = self.simulator.truth;
        for _ in 0..(seconds * 100.0).round() as u64 {
            let stamp = at(self.now_ms);
            self.now_ms += STEP_MS;
            // The first step of all only begins the world's time.
            self.simulator.last_step.get_or_insert(stamp);
            let inputs = Inputs {
                applied: Some(Stamped::new(stamp, &applied)),
                call: call.as_ref().map(|call| Stamped::new(stamp, call)),
            };
            truth = *self.simulator.step(at(self.now_ms), inputs).truth;
        }
        truth
    }
}

fn pose(truth: &WorldTruth) -> Pose2 {
    Pose2::new(truth.x_m, truth.y_m, truth.heading_rad)
}

/// Ideal motors that turn steadily drive an arc in closed form.
#[track_caller]
fn check_arc(left_mps: f64, right_mps: f64, seconds: f64) {
    let mut run = Run::new(ideal(), "");
    let before = run.drive(left_mps, right_mps, 1.0);
    let after = run.drive(left_mps, right_mps, seconds);
    let turn_rad = (right_mps - left_mps) * seconds / 0.40;
    let expected = pose(&before).after_arc(0.5 * (left_mps + right_mps) * seconds, turn_rad);
    assert!(pose(&after).distance_m(expected) < 1e-9, "{after:?} instead of {expected:?}");
    assert!(difference(after.heading_rad, expected.heading_rad).abs() < 1e-9);
    assert!((after.left_travel_m - before.left_travel_m - left_mps * seconds).abs() < 1e-9);
    assert!((after.right_travel_m - before.right_travel_m - right_mps * seconds).abs() < 1e-9);
}

#[test]
fn drives_arcs_in_closed_form() {
    check_arc(0.3, 0.3, 5.0);
    check_arc(0.2, 0.3, 5.0);
    check_arc(-0.2, 0.2, 4.0);
    check_arc(-0.4, -0.3, 6.0);
    check_arc(0.0, 0.0, 1.0);
}

#[test]
fn wheels_gain_and_lose_speed_within_their_limit() {
    let mut run = Run::new(ideal(), "");
    // v = a t for half a second; the step ends with its new speed, hence half a step more than a t^2 / 2.
    let truth = run.drive(0.4, 0.4, 0.5);
    assert!((truth.left_mps - 0.4).abs() < 1e-9);
    assert!((truth.x_m - (0.5 * 0.8 * 0.25 + 0.5 * 0.4 * 0.01)).abs() < 1e-9, "{}", truth.x_m);
    let halfway = run.drive(0.0, 0.0, 0.25);
    assert!((halfway.left_mps - 0.2).abs() < 1e-9);
    let stopped = run.drive(0.0, 0.0, 0.25);
    assert!(stopped.left_mps.abs() < 1e-9 && stopped.x_m < 0.21);
}

#[test]
fn unlike_motors_do_not_keep_a_straight_line() {
    let quiet = Params { slip_fraction: 0.0, way_noise_m: 0.0, ..Params::default() };
    let truth = Run::new(quiet, "").drive(0.3, 0.3, 5.0);
    // The right wheel is slower: to the right, by the difference of the ways over the track.
    let expected_rad = (truth.right_travel_m - truth.left_travel_m) / 0.40;
    assert!(expected_rad < -0.05);
    assert!((truth.heading_rad - expected_rad).abs() < 1e-9 && truth.y_m < -0.02);
}

#[test]
fn encoders_do_not_notice_slip() {
    let slipping = Params { slip_fraction: 0.1, ..ideal() };
    let truth = Run::new(slipping, "").drive(0.3, 0.3, 5.0);
    assert!((truth.x_m - 0.9 * truth.left_travel_m).abs() < 1e-9);
    assert!((truth.left_mps - 0.27).abs() < 1e-9);
}

#[test]
fn the_way_scatters_with_its_root() {
    let noisy = Params { way_noise_m: 0.01, ..ideal() };
    let world = World::default();
    let spread = |seconds: f64| {
        let ways = (0..200).map(|seed| {
            let simulator = Simulator::in_world(noisy.clone(), &world, seed).unwrap();
            let truth = Run { simulator, now_ms: 0 }.drive(0.5, 0.5, seconds);
            truth.x_m - truth.left_travel_m
        });
        let ways: Vec<f64> = ways.collect();
        let mean = ways.iter().sum::<f64>() / 200.0;
        (ways.iter().map(|way| (way - mean).powi(2)).sum::<f64>() / 199.0).sqrt()
    };
    // The mean of two wheels scatters by 0.01 m / sqrt(2) a metre.
    let (one_m, four_m) = (spread(2.3125), spread(8.3125));
    assert!((0.0055..0.0090).contains(&one_m), "{one_m}");
    assert!((1.6..2.5).contains(&(four_m / one_m)), "{four_m} {one_m}");
}

#[test]
fn the_watchdog_stops_the_wheels() {
    let mut run = Run::new(ideal(), "");
    run.drive(0.3, 0.3, 1.0);
    let applied = AppliedWheels { left_mps: 0.3, right_mps: 0.3, ..AppliedWheels::default() };
    let spoken = at(run.now_ms);
    let mut speed_mps = |after_ms: u64| {
        let inputs = Inputs { applied: Some(Stamped::new(spoken, &applied)), call: None };
        run.simulator.step(at(1000 + after_ms), inputs).truth.left_mps
    };
    assert!((speed_mps(50) - 0.3).abs() < 1e-9);
    assert!((speed_mps(100) - 0.3).abs() < 1e-9);
    assert!((speed_mps(110) - 0.292).abs() < 1e-9);
    assert!(speed_mps(500).abs() < 1e-9);
}

#[test]
fn commands_that_are_none_are_no_commands() {
    for nonsense in [f64::NAN, f64::INFINITY, 1e300, -4.0] {
        let truth = Run::new(ideal(), "").drive(nonsense, 0.1, 0.5);
        assert_eq!((truth.x_m, truth.y_m, truth.heading_rad), (0.0, 0.0, 0.0));
    }
}

#[test]
fn walls_stop_the_robot_and_count_once() {
    let mut run = Run::new(ideal(), HALL);
    let truth = run.drive(-0.5, -0.5, 4.0);
    assert_eq!(truth.contacts, 1);
    assert!(truth.x_m - 0.305 > -1.0 && truth.x_m - 0.305 < -0.99, "{}", truth.x_m);
    assert!(
        truth.left_travel_m > -0.71,
        "the encoders stand while the motors stall: {}",
        truth.left_travel_m
    );
    // Away and against it again is another contact.
    assert_eq!(run.drive(0.3, 0.3, 1.0).contacts, 1);
    assert_eq!(run.drive(-0.3, -0.3, 2.0).contacts, 2);
}

#[test]
fn furniture_stops_the_robot() {
    for kind in ["mail-cart", "spinning-chair", "sofa", "wooden-chair", "cardboard-box"] {
        let world = format!(
            "{HALL}\n[[furniture]]\nkind = \"{kind}\"\nfloor = 1\npose = {{ x_m = 3.0, y_m = 0.0 }}\n"
        );
        let truth = Run::new(ideal(), &world).drive(0.5, 0.5, 8.0);
        assert_eq!(truth.contacts, 1, "{kind}");
        assert!(truth.x_m < 2.7, "{kind}: {}", truth.x_m);
        let other = world
            .replace("kind = \"", "name = \"upstairs\"\nkind = \"")
            .replace("floor = 1\npose = { x_m = 3.0", "floor = 2\npose = { x_m = 3.0");
        assert_eq!(Run::new(ideal(), &other).drive(0.5, 0.5, 8.0).contacts, 0, "{kind} on the other floor");
    }
}

#[test]
fn a_start_inside_a_wall_is_refused() {
    let world = World::parse(&HALL.replace("x_m = 0.0, y_m = 0.0", "x_m = -0.9, y_m = 0.0")).unwrap();
    let error = Simulator::in_world(Params::default(), &world, 1).expect_err("blocked").to_string();
    assert!(error.contains("lies in a wall"), "{error}");
    let world = World::parse(&HALL.replace("[[start]]", "[[start]]\nrobot = \"other\"")).unwrap();
    let error = Simulator::in_world(Params::default(), &world, 1).expect_err("no start").to_string();
    assert!(error.contains("no [[start]] for robot \"coffee\""), "{error}");
}

/// Somebody who walks along the hall towards the robot when it is within 6 m.
fn walker() -> String {
    format!(
        "{HALL}\n[[walker]]\nname = \"w\"\nfloor = 1\npath = [[5.0, 0.0], [-0.8, 0.0]]\nstarts = {{ near_m = 4.5 }}\n"
    )
}

#[test]
fn people_set_out_when_the_robot_is_near() {
    let mut run = Run::new(ideal(), &walker());
    run.drive(0.0, 0.0, 1.0);
    assert_eq!(run.simulator.bodies[0].x_m, 5.0);
    run.drive(0.5, 0.5, 1.5);
    assert!(run.simulator.bodies[0].x_m < 4.9);
}

#[test]
fn people_wait_rather_than_walk_into_the_robot() {
    let mut run = Run::new(ideal(), &walker());
    run.drive(0.5, 0.5, 1.5);
    run.drive(0.0, 0.0, 5.0);
    let gap_m = |run: &Run| run.simulator.bodies[0].x_m - 0.2 - (run.simulator.pose.x_m + 0.305);
    assert!((gap_m(&run) - 0.4).abs() < 0.02, "{}", gap_m(&run));
    // Straight ahead there is no way past a robot that stands: they come nearer, and touch nothing.
    let truth = run.drive(0.0, 0.0, 10.0);
    assert!((gap_m(&run) - 0.12).abs() < 0.02 && truth.contacts == 0, "{}", gap_m(&run));
    // From a robot that comes nearer still they step back.
    assert_eq!(run.drive(0.1, 0.1, 4.0).contacts, 0);
    assert!(gap_m(&run) > 0.15, "{}", gap_m(&run));
    // Backwards the robot clears the way, and they come after it.
    let before_m = run.simulator.bodies[0].x_m;
    assert_eq!(run.drive(-0.2, -0.2, 4.0).contacts, 0);
    assert!(run.simulator.bodies[0].x_m < before_m - 0.1);
}

#[test]
fn people_who_do_not_wait_bump_into_the_robot() {
    let mut run = Run::new(Params { walkers_wait: false, ..ideal() }, &walker());
    run.drive(0.5, 0.5, 1.5);
    assert_eq!(run.drive(0.0, 0.0, 6.0).contacts, 1);
}

#[test]
fn doors_open_and_close_on_schedule() {
    let doors = r#"
[[door]]
room = "a"
floor = 1
at = [6.0, 2.0]
into_room = [0, 1]
moves = { at_s = 2.0 }
returns_after_s = 3.0
[[door]]
room = "b"
floor = 1
at = [10.0, 2.0]
into_room = [0, 1]
open = true
"#;
    let mut run = Run::new(ideal(), &format!("{HALL}{doors}"));
    assert_eq!(run.drive(0.0, 0.0, 1.9).open_doors, [0b10, 0]);
    assert_eq!(run.drive(0.0, 0.0, 1.0).open_doors, [0b11, 0]);
    assert_eq!(run.drive(0.0, 0.0, 2.0).open_doors, [0b11, 0]);
    assert_eq!(run.drive(0.0, 0.0, 1.5).open_doors, [0b10, 0]);
}

fn call(call_id: u64, floor: i32, hold_doors: u32) -> Option<ElevatorCall> {
    Some(ElevatorCall { call_id, floor, hold_doors })
}

#[test]
fn the_elevator_comes_holds_closes_and_carries_the_robot() {
    let hall = HALL.replace(
        "pose = { x_m = 0.0, y_m = 0.0 }",
        "pose = { x_m = 2.0, y_m = -1.4, heading_rad = -1.5707963267948966 }",
    );
    let mut run = Run::new(ideal(), &hall);
    let state = |run: &Run| {
        (
            run.simulator.car.as_ref().unwrap().say().state.get().unwrap(),
            run.simulator.truth.elevator_door_percent,
        )
    };
    run.drive(0.0, 0.0, 5.0);
    assert_eq!(state(&run), (CarState::Closed, 0));
    // A closed door stops the robot.
    assert_eq!(run.drive(0.2, 0.2, 3.0).contacts, 1);
    run.drive(-0.2, -0.2, 1.0);
    // It opens, and stays open while it is held.
    run.drive_calling(0.0, 0.0, 1.0, call(1, 1, 1));
    assert_eq!(state(&run).0, CarState::Opening);
    run.drive_calling(0.0, 0.0, 20.0, call(1, 1, 1));
    assert_eq!(state(&run), (CarState::Open, 100));
    // Half way in, the light barrier keeps it open.
    let truth = run.drive_calling(0.2, 0.2, 4.0, call(1, 1, 0));
    assert!(truth.y_m < -1.9, "{truth:?}");
    run.drive_calling(0.0, 0.0, 20.0, call(1, 1, 0));
    assert_eq!(state(&run), (CarState::Open, 100));
    let inside = run.drive_calling(0.2, 0.2, 5.0, call(1, 1, 1));
    assert!(inside.y_m < -2.65 && inside.contacts == 1 && inside.floor == 1, "{inside:?}");
    // Up: two seconds to close, eight to ride, two to open.
    run.drive_calling(0.0, 0.0, 5.0, call(2, 2, 0));
    assert_eq!(state(&run), (CarState::Moving, 0));
    let arrived = run.drive_calling(0.0, 0.0, 10.0, call(2, 2, 0));
    assert_eq!((arrived.floor, state(&run)), (2, (CarState::Open, 100)));
    let out = run.drive_calling(-0.3, -0.3, 7.0, call(2, 2, 1));
    assert!(out.y_m > -1.6 && out.contacts == 1, "{out:?}");
    // Nobody holds it: it closes by itself.
    run.drive_calling(0.0, 0.0, 13.0, call(2, 2, 0));
    assert_eq!(state(&run), (CarState::Closed, 0));
    // It leaves without the robot.
    let stayed = run.drive_calling(0.0, 0.0, 20.0, call(3, 1, 0));
    assert_eq!((stayed.floor, run.simulator.car.as_ref().unwrap().say().floor), (2, 1));
}

#[test]
fn calls_to_floors_that_do_not_exist_are_ignored() {
    let mut run = Run::new(ideal(), HALL);
    run.drive_calling(0.0, 0.0, 5.0, call(9, 77, 0));
    assert_eq!(run.simulator.car.as_ref().unwrap().say().state, CarState::Closed);
}

#[test]
fn the_elevator_speaks_with_every_change_and_ten_times_a_second() {
    let world = World::parse(HALL).unwrap();
    let mut simulator = Simulator::in_world(ideal(), &world, 7).unwrap();
    let said =
        (0..=100).filter(|ms| simulator.step(at(ms * 10), Inputs::default()).elevator.is_some()).count();
    assert_eq!(said, 11);
}

#[test]
fn one_seed_one_world() {
    let run = |seed| {
        let simulator = Simulator::in_world(Params::default(), &World::parse(HALL).unwrap(), seed).unwrap();
        Run { simulator, now_ms: 0 }.drive(0.4, 0.4, 3.0)
    };
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
}

#[test]
fn time_that_was_lost_is_not_made_up_for_in_one_leap() {
    let mut run = Run::new(ideal(), "");
    run.drive(0.3, 0.3, 1.0);
    let truth = run.simulator.step(at(100_000), Inputs::default()).truth;
    assert!(truth.world_time_s < 1.6, "{}", truth.world_time_s);
}

#[track_caller]
fn refuse(params: Params, text: &str) {
    let error = Simulator::new(params, 0).expect_err("must be refused").to_string();
    assert!(error.contains(text), "{error}");
}

#[test]
fn refuses_nonsense_with_names_and_values() {
    refuse(Params { period_ms: 0, ..Params::default() }, "`period_ms` is 0");
    refuse(Params { right_gain: 7.0, ..Params::default() }, "`right_gain` is 7");
    refuse(Params { slip_fraction: f64::NAN, ..Params::default() }, "`slip_fraction` is not a finite number");
    refuse(Params { world: "nowhere.toml".into(), ..Params::default() }, "nowhere.toml");
    assert!(Simulator::new(Params::default(), 0).is_ok());
}

proptest! {
    /// Whatever the motors are told, the truth stays finite, and the robot's middle within the hall, with the
    /// niche of the elevator's door.
    #[test]
    fn nothing_drives_through_walls(commands in proptest::collection::vec((-1.2f64..1.2, -1.2f64..1.2, 0.1f64..2.0), 1..12)) {
        let mut run = Run::new(Params::default(), HALL);
        for (left_mps, right_mps, seconds) in commands {
            let truth = run.drive(left_mps, right_mps, seconds);
            prop_assert!(pose(&truth).is_finite());
            prop_assert!((-1.0 + 0.25..=19.0 - 0.25).contains(&truth.x_m) && (-2.0 + 0.15..=2.0 - 0.25).contains(&truth.y_m), "{:?}", truth);
        }
    }
}

#[test]
fn a_successor_goes_on_with_the_world_as_it_was() {
    let mut run = Run::new(ideal(), HALL);
    let call = ElevatorCall { call_id: 1, floor: 1, hold_doors: 0 };
    let before = run.drive_calling(0.3, 0.2, 2.0, Some(call));
    let text = serde_json::to_string(&run.simulator.snapshot()).unwrap();
    let mut successor = Run::new(ideal(), HALL);
    successor.simulator.restore(&serde_json::from_str(&text).unwrap());
    let after = successor.drive_calling(0.0, 0.0, 0.01, Some(call));
    assert!(before.x_m > 0.3);
    assert!((after.x_m - before.x_m).hypot(after.y_m - before.y_m) < 1e-9, "{after:?}");
    assert_eq!((after.left_travel_m, after.right_travel_m), (before.left_travel_m, before.right_travel_m));
    assert!(after.world_time_s >= before.world_time_s && after.contacts == before.contacts);
    assert!(after.elevator_door_percent >= before.elevator_door_percent);
    assert_eq!(after.left_mps, 0.0);
    // Another world's state is no state of this one.
    let mut other = Run::new(ideal(), "");
    other.simulator.restore(&serde_json::from_str(&text).unwrap());
    assert_eq!(other.simulator.snapshot().travel(), [0.0; 2]);
}
