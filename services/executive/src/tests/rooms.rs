use crate::arena::{Arena, View, manoeuvre};
use geometry::{Point2, Polygon, Pose2, World};

fn arena(number: u32) -> Arena {
    let file = format!("{}/../../launch/worlds/arena-{number}.toml", env!("CARGO_MANIFEST_DIR"));
    let world = World::load(file).expect("an arena");
    Arena::of_world(&world, Polygon::rectangle(0.16, 0.14).expect("a body"))
}

#[track_caller]
fn check_turn(number: u32, pose: Pose2, to: [f64; 2], first: std::ops::RangeInclusive<f64>) {
    let arena = arena(number);
    let views = [View { arena: &arena, pose }];
    let found = manoeuvre(&views, 0.012, pose.inverse_transform(Point2::from(to)));
    assert!(found.room_m >= 0.012 && first.contains(&found.first_m), "{found:?}");
}

#[test]
fn a_robot_that_cannot_turn_where_it_stands_finds_room_first() {
    // In the open it just turns.
    check_turn(1, Pose2::new(0.3, 0.2, 0.0), [0.3, 0.9], 0.0..=0.0);
    // With its nose at a wall it drives back.
    check_turn(3, Pose2::new(-0.201, 0.2, 3.118), [0.5, 0.2], -0.06..=-0.02);
    // With its back to it, ahead.
    check_turn(3, Pose2::new(-0.201, 0.2, 0.0), [-0.2, 0.3], 0.02..=0.06);
}
