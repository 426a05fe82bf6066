//! The building's world file: what the paper says of it, and that a robot can live in it.

use crate::{
    Inputs, Params, Simulator,
    obstacles::{Footprint, Obstacles},
};
use geometry::world::AreaKind;
use geometry::{Point2, Pose2, Ray, Scene, Surface, World};
use messages::{Surroundings, Time};
use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;

const FLOORS: [i32; 2] = [2, 3];
/// Where the robot's place may lie along the hallway.
const ALONG_M: std::ops::Range<i32> = 0..300;

fn path() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../launch/worlds/cs-building.toml")
}

fn building() -> World {
    World::load(path()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn has_the_rooms_of_the_paper() {
    let world = building();
    let rooms = |floor| {
        let mut rooms: Vec<_> =
            world.doors.iter().filter(|door| door.floor == floor).map(|door| door.room.clone()).collect();
        rooms.sort();
        rooms
    };
    assert_eq!(rooms(2), (201..=213).map(|room| room.to_string()).collect::<Vec<_>>());
    assert_eq!(rooms(3), (302..=313).map(|room| room.to_string()).collect::<Vec<_>>());
    for door in &world.doors {
        let odd = door.room.parse::<u32>().unwrap() % 2 == 1;
        assert_eq!(door.at[1], if odd { -0.85 } else { 0.85 }, "{}", door.room);
        assert_eq!((door.width_m, door.recess_m), (0.91, 0.100), "{}", door.room);
    }
    // The elevator lies next to 213 and 313.
    let lift = &world.elevators[0];
    for room in ["213", "313"] {
        let to_lift = |at: [f64; 2]| (at[0] - lift.at[0]).abs();
        let nearest = world
            .doors
            .iter()
            .filter(|door| room.starts_with(&door.room[..1]))
            .min_by(|a, b| to_lift(a.at).total_cmp(&to_lift(b.at)));
        assert_eq!(nearest.unwrap().room, room);
    }
}

/// The gaps across the hallway at `x_m`, from right to left, as a body of up to 1 m sees them.
fn widest_gap_m(obstacles: &mut Obstacles, x_m: f64) -> f64 {
    let slice = Footprint { half_length_m: 0.3, half_width_m: 0.005 };
    let (mut widest, mut gap) = (0, 0);
    for step in -85..=85 {
        let pose = Pose2::new(x_m, f64::from(step) * 0.01, 0.0);
        gap = if obstacles.touched(&slice, pose) { 0 } else { gap + 1 };
        widest = widest.max(gap);
    }
    f64::from(widest) * 0.01
}

#[test]
fn leaves_a_clear_width_everywhere() {
    let world = building();
    for floor in FLOORS {
        let mut obstacles = Obstacles::new(&world, floor, 1.0);
        for decimetre in ALONG_M.step_by(2) {
            let x_m = f64::from(decimetre) * 0.1;
            let gap_m = widest_gap_m(&mut obstacles, x_m);
            assert!(gap_m >= 0.85, "only {gap_m} m at x = {x_m} on floor {floor}");
        }
    }
}

/// Flood fill on a grid of 5 cm with a round robot of 0.32 m, a little more than the half of its width.
#[test]
fn every_room_can_be_reached() {
    let world = building();
    for (floor, from) in [(2, Point2::new(3.0, -0.30)), (3, Point2::new(1.6, 0.1))] {
        let mut obstacles = Obstacles::new(&world, floor, 1.0);
        let body = Footprint { half_length_m: 0.32, half_width_m: 0.32 };
        let pose = |(i, j): (i32, i32)| Pose2::new(f64::from(i) * 0.05, f64::from(j) * 0.05, 0.0);
        let cell = |value: f64| (value / 0.05).round() as i32;
        let start = (cell(from.x), cell(from.y));
        let mut seen = std::collections::HashSet::from([start]);
        let mut open = vec![start];
        while let Some((i, j)) = open.pop() {
            for next in [(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)] {
                if (-20..640).contains(&next.0)
                    && next.1.abs() < 20
                    && !seen.contains(&next)
                    && !obstacles.touched(&body, pose(next))
                {
                    seen.insert(next);
                    open.push(next);
                }
            }
        }
        for door in world.doors.iter().filter(|door| door.floor == floor) {
            let reached = seen.iter().any(|&cell| (pose(cell).x_m - door.at[0]).abs() < 0.03);
            assert!(reached, "{} cannot be reached", door.room);
        }
    }
}

/// In a measuring area the side sensors see flat wall, or far into a side hallway, wherever the robot stands
/// in it.
#[test]
fn measuring_areas_are_flat() {
    let world = building();
    let mut surroundings = Surroundings::new(&world);
    surroundings.show(&messages::WorldTruth::default(), &[]);
    for floor in FLOORS {
        assert!(world.areas_of(floor, Some(AreaKind::Measure)).count() >= 4);
        for area in world.areas_of(floor, Some(AreaKind::Measure)) {
            let rectangle = area.rectangle.unwrap();
            let reach_m = 0.277 + 0.1;
            let (from_m, to_m) = (rectangle.min[0] - reach_m, rectangle.max[0] + reach_m);
            let mut x_m = from_m;
            while x_m <= to_m {
                for side in [-1.0, 1.0] {
                    check_flat(surroundings.scene(floor).unwrap(), Point2::new(x_m, 0.0), side, &area.name);
                }
                x_m += 0.02;
            }
        }
    }
}

#[track_caller]
fn check_flat(scene: &Scene, from: Point2<f64>, side: f64, area: &str) {
    for height_m in [0.21, 0.25, 0.29] {
        let hit = scene.cast_ray(&Ray::level(from, side * FRAC_PI_2, height_m), 10.0).unwrap();
        let flat = matches!(hit.surface, Surface::Wall(_))
            && ((hit.range_m - 0.85).abs() < 1e-6 || hit.range_m > 2.0);
        assert!(flat, "{area}: {hit:?} at {from}, side {side}");
    }
}

#[test]
fn at_least_four_anchors_are_in_reach_everywhere() {
    let world = building();
    for floor in FLOORS {
        for decimetre in ALONG_M {
            let place = Point2::new(f64::from(decimetre) * 0.1, 0.0);
            let near = world
                .anchors
                .iter()
                .filter(|a| a.floor == floor && (Point2::new(a.x_m, a.y_m) - place).norm() < 15.0);
            assert!(near.count() >= 4, "at {place} on floor {floor}");
        }
    }
    assert!(world.anchors.iter().all(|anchor| anchor.z_m == 2.2));
}

#[test]
fn the_robot_begins_beside_the_tea_room_and_the_crossing_person_waits_for_it() {
    let world = building();
    let params = Params { world: path().to_string_lossy().into_owned(), ..Params::default() };
    let mut simulator = Simulator::new(params, 1).unwrap();
    let outputs = simulator.step(Time::ZERO, Inputs::default());
    let tea_room = world.areas_of(2, Some(AreaKind::TeaRoom)).next().unwrap().shape().unwrap();
    assert!(tea_room.contains(Point2::new(outputs.truth.x_m, outputs.truth.y_m)));
    assert_eq!((outputs.truth.floor, outputs.truth.contacts), (2, 0));
    assert_eq!(outputs.bodies.len(), world.furniture.len() + world.walkers.len());
    let crossing = &world.walkers[0];
    let crosses = crossing.path.windows(2).any(|leg| leg[0][1] < -0.85 && leg[1][1] > -0.85)
        && crossing.path.last().unwrap()[1] > 0.85;
    assert!(crosses && crossing.path[0][0] < world.door("207").unwrap().at[0]);
}
