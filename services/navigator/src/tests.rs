//! Deliveries by a tiny robot, and what can go wrong on the way.

mod robot;

use crate::{Building, Inputs, Navigator, Params, ParamsError, Ride, Stage};
use messages::DeliveryStatusName::{self as Status, *};
use messages::*;
use proptest::prelude::*;
use robot::{HOME, World, building};

fn params() -> Params {
    Params { load_s: 1.0, dwell_s: 1.0, ..Params::default() }
}

const WHOLE: [Status; 8] = [Idle, Ordered, Collecting, Travelling, NearDoor, AtDoor, Delivered, Returning];

#[track_caller]
fn check_delivery(room: &str) -> World {
    let mut world = World::new(params());
    world.bias_m = [0.15, -0.05];
    world.run(0.3);
    world.order(0, room);
    world.run_until(Returning, 300.0);
    world.run_until(Idle, 300.0);
    let without_ride: Vec<Status> = world.said.iter().copied().filter(|status| *status != Elevator).collect();
    let mut once = without_ride.clone();
    once.dedup();
    assert_eq!(once[..8], WHOLE, "{:?}", world.said);
    assert_eq!((world.last_status.delivered, world.halts_m.len()), (1, 1));
    assert!(world.halts_m[0] <= 0.05, "{room}: {} m from the centre line", world.halts_m[0]);
    assert!(
        (world.pose.x_m + 0.15 - HOME.x_m).hypot(world.pose.y_m - 0.05 - HOME.y_m) < 0.25 && world.floor == 2
    );
    world
}

#[test]
fn every_room_on_the_second_floor() {
    for room in building().rooms.iter().filter(|room| room.door.floor == 2) {
        let world = check_delivery(&room.name);
        assert!(!world.said.contains(&Elevator));
    }
}

#[test]
fn rooms_on_the_third_floor() {
    for room in ["302", "309"] {
        let world = check_delivery(room);
        assert_eq!(world.said.iter().filter(|status| **status == Elevator).count(), 2, "{:?}", world.said);
    }
}

#[test]
fn the_map_decides_where_no_door_is_seen() {
    let mut world = World::new(params());
    (world.sees_doors, world.bias_m) = (false, [0.04, 0.0]);
    world.order(1, "207");
    world.run_until(AtDoor, 300.0);
    assert!(world.halts_m[0] <= 0.10, "{}", world.halts_m[0]);
}

#[test]
fn orders_are_served_in_turn_and_numbers_count_once() {
    let mut world = World::new(params());
    for (order_id, room) in [(7, "211"), (8, "209"), (7, "211"), (8, "213"), (0, "213")] {
        world.order(order_id, room);
    }
    world.run(0.5);
    assert_eq!((world.last_status.order_id, world.last_status.waiting), (7, 2));
    world.run_until(Idle, 600.0);
    assert_eq!((world.last_status.delivered, world.halts_m.len()), (3, 3), "{:?}", world.said);
}

#[track_caller]
fn check_refused(world: &mut World, room: &str, remark: &str) {
    world.order(0, room);
    world.run(0.5);
    assert_eq!(world.last_status.remark.as_str(), remark);
    assert_eq!((world.last_status.status, world.last_status.waiting), (Idle.into(), 0));
}

#[test]
fn impossible_orders_are_refused_and_do_not_stop_the_queue() {
    let mut world = World::new(params());
    check_refused(&mut world, "999", "refused: there is no room `999`");
    check_refused(&mut world, "", "refused: there is no room ``");
    world.order(1, "213");
    world.run_until(Delivered, 200.0);
    let mut stairs = World::new(params());
    stairs.navigator = Navigator::with_building(params(), Building { lift: None, ..building() }).unwrap();
    check_refused(&mut stairs, "302", "refused: no elevator goes to room 302");
    let mut nowhere = World::new(params());
    nowhere.navigator = Navigator::with_building(params(), Building { home: None, ..building() }).unwrap();
    check_refused(&mut nowhere, "207", "refused: the tea room is not known");
}

#[test]
fn the_order_of_the_parameters_comes_first_and_once() {
    let with_order = Params { default_order: "213".into(), ..params() };
    let mut world = World::new(with_order.clone());
    world.run_until(Delivered, 200.0);
    world.kill(with_order);
    world.run_until(Idle, 100.0);
    world.run(10.0);
    assert_eq!((world.last_status.status, world.last_status.delivered), (Idle.into(), 1));
}

/// Kills the navigator `seconds` after the order; the delivery is completed all the same.
#[track_caller]
fn check_killed(room: &str, every_s: f64) {
    let mut world = World::new(params());
    world.order(1, room);
    for _ in 0..(400.0 / every_s) as usize {
        world.run(every_s);
        if world.last_status.delivered == 1 && world.last_status.status == Idle {
            break;
        }
        world.kill(params());
    }
    assert_eq!(
        (world.last_status.status, world.last_status.delivered),
        (Idle.into(), 1),
        "{:?} {:?}",
        world.said,
        world.pose
    );
    assert!(world.halts_m.iter().all(|halt_m| *halt_m <= 0.10), "{:?}", world.halts_m);
}

#[test]
fn killed_at_any_time_the_delivery_is_completed() {
    for every_s in [3.1, 7.3, 11.9, 17.7, 29.3, 41.1] {
        check_killed("207", every_s);
        check_killed("302", every_s);
    }
}

#[test]
fn a_walker_that_passes_is_no_reason_to_plan_anew() {
    let mut world = World::new(params());
    world.order(1, "207");
    world.run_until(Travelling, 60.0);
    world.run(10.0);
    let plans = world.last_status.plans;
    world.guard_stops = true;
    world.run(4.0);
    assert_eq!(
        (world.last_status.status, world.last_status.remark.as_str()),
        (Blocked.into(), "an obstacle is in the way")
    );
    world.guard_stops = false;
    world.run(2.0);
    assert_eq!((world.last_status.status, world.last_status.plans), (Travelling.into(), plans));
}

#[test]
fn a_lasting_stop_leads_to_backing_off_new_plans_a_fault_and_recovery() {
    let mut world = World::new(params());
    world.order(1, "207");
    world.run_until(Travelling, 60.0);
    world.run(10.0);
    let plans = world.last_status.plans;
    world.guard_stops = true;
    world.run(6.0);
    assert_eq!(world.command.mode, DriveModeName::BackOff);
    world.run(2.0);
    assert_eq!((world.last_status.status, world.last_status.plans), (Blocked.into(), plans + 1));
    world.run_until(Fault, 60.0);
    assert!(world.last_status.remark.as_str().contains("human help"), "{}", world.last_status.remark);
    world.run(1.0);
    assert_eq!(world.command.mode, DriveModeName::Hold);
    world.guard_stops = false;
    world.run_until(Delivered, 200.0);
}

#[test]
fn an_unreachable_goal_is_asked_for_again_and_then_a_fault() {
    let mut world = World::new(params());
    world.order(1, "207");
    world.plan_state = PlanStateName::Unreachable;
    world.pose.x_m = 8.0;
    world.run_until(Blocked, 10.0);
    assert_eq!(world.last_status.remark.as_str(), "there is no way to the goal");
    world.run_until(Fault, 60.0);
    assert!(world.last_status.plans >= 4);
    world.plan_state = PlanStateName::Found;
    world.run_until(Delivered, 300.0);
}

#[test]
fn without_a_place_the_robot_stands_and_plans_anew_when_it_is_found() {
    let mut world = World::new(params());
    world.order(1, "207");
    world.run_until(Travelling, 60.0);
    world.run(5.0);
    let plans = world.last_status.plans;
    world.is_located = false;
    world.run(3.0);
    assert_eq!(
        (world.last_status.status, world.last_status.remark.as_str()),
        (Blocked.into(), "location lost")
    );
    assert_eq!(world.command.mode, DriveModeName::Hold);
    world.is_located = true;
    world.run(1.0);
    assert_eq!((world.last_status.status, world.last_status.plans), (Travelling.into(), plans + 1));
    world.run_until(Delivered, 200.0);
}

#[test]
fn an_elevator_that_does_not_come_is_called_again_and_then_a_fault() {
    let mut world = World::new(Params { elevator_timeout_s: 5.0, max_failures: 3, ..params() });
    (world.has_lift, world.pose.x_m) = (false, 3.0);
    world.order(1, "302");
    world.run_until(Elevator, 60.0);
    world.run_until(Fault, 100.0);
    assert!(world.navigator.snapshot().call_id >= 3);
    world.has_lift = true;
    world.run_until(Delivered, 400.0);
}

#[test]
fn the_snapshot_tells_the_stage() {
    let mut world = World::new(params());
    world.order(5, "302");
    world.run_until(Elevator, 100.0);
    let kept = world.navigator.snapshot();
    assert_eq!(
        (kept.stage, kept.ride != Ride::None, kept.job.unwrap().order_id),
        (Stage::Travelling, true, 5)
    );
}

#[track_caller]
fn check_params(change: impl Fn(&mut Params), expected: &str) {
    let mut params = Params::default();
    change(&mut params);
    let error: ParamsError = Navigator::new(params).unwrap_err();
    assert!(error.to_string().contains(expected), "{error}");
}

#[test]
fn bad_parameters_are_refused() {
    check_params(|params| params.dwell_s = f64::NAN, "`dwell_s` is not a finite number");
    check_params(
        |params| params.crawl_speed_mps = 0.2,
        "crawl_speed_mps = 0.2 is above creep_speed_mps = 0.15",
    );
    check_params(
        |params| params.halt_tolerance_m = 0.2,
        "halt_tolerance_m = 0.2 is above halt_accept_m = 0.1",
    );
    check_params(|params| params.max_failures = 0, "`max_failures` is 0");
    check_params(|params| params.world = "nowhere.toml".into(), "nowhere.toml");
    assert!(Navigator::new(Params::default()).is_ok());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn nonsense_is_survived(numbers in proptest::collection::vec(proptest::num::f64::ANY, 12), ints in proptest::collection::vec(any::<u32>(), 12), times in proptest::collection::vec(any::<u64>(), 24)) {
        let mut navigator = Navigator::with_building(params(), building()).unwrap();
        for (round, &time) in times.iter().enumerate() {
            let now = Time::from_nanos(time);
            let int = |at: usize| ints[(at + round) % ints.len()];
            let number = |at: usize| if (at + round).is_multiple_of(3) { numbers[(at + round) % numbers.len()] } else { f64::from(int(at) % 30) };
            let room = FixedText::truncated(["207", "302", "213", "x"][round % 4]);
            let order = Order { order_id: int(0).into(), room };
            let pose = PoseEstimate { x_m: number(0), y_m: number(1), heading_rad: number(2), floor: int(1) as i32 % 5, state: LocationState(int(2) % 5), ..PoseEstimate::default() };
            let path = Path { request_id: navigator.snapshot().request_id, state: PlanState(int(3) % 7), ..Path::default() };
            let waypoints = [Waypoint { x_m: number(3), y_m: number(4) }];
            let sighting = DoorSighting { offset_m: number(5), confidence: number(6), room, floor: 2, ..DoorSighting::default() };
            let clearance = Clearance { signal: GuardSignal(int(4) % 4), ..Clearance::default() };
            let car = ElevatorState { call_id: int(5).into(), floor: int(6) as i32 % 5, state: CarStateField(int(7) % 7) };
            let wheels = AppliedWheels { left_mps: number(7), right_mps: number(8), ..AppliedWheels::default() };
            let orders = [Stamped::new(now, &order)];
            let outputs = navigator.step(now, Inputs {
                orders: &orders,
                pose: Some(Stamped::new(now, &pose)),
                path: Some(Stamped::with_elements(now, &path, &waypoints)),
                sighting: Some(Stamped::new(now, &sighting)),
                clearance: Some(Stamped::new(now, &clearance)),
                elevator: Some(Stamped::new(now, &car)),
                wheels: Some(Stamped::new(now, &wheels)),
            });
            prop_assert!(outputs.command.max_speed_mps >= 0.0 && outputs.command.max_speed_mps <= 0.36);
            prop_assert!(outputs.command.heading_rad.is_finite() && outputs.command.mode.get().is_ok());
            let kept = navigator.snapshot();
            navigator.restore(&kept);
        }
    }
}
