//! Routes of the body among the walls of the arenas.

use crate::arena::Arena;
use crate::route::{Leg, Route, View, route};
use geometry::{Point2, Polygon, Pose2, World};
use proptest::prelude::*;

/// Turns below 4 mrad are left out, and ways are shorter than this by that.
const END_M: f64 = 0.004;
/// Room that is wanted around the body.
const WANTED_M: f64 = 0.015;

fn arena(number: u32) -> Arena {
    let file = format!("{}/../../launch/worlds/arena-{number}.toml", env!("CARGO_MANIFEST_DIR"));
    let world = World::load(file).expect("an arena");
    Arena::of_world(&world, Polygon::rectangle(0.16, 0.14).expect("a body"))
}

/// Where legs lead, and the least room on them; what the body begins with does not count.
fn follow(arena: &Arena, from: Pose2, legs: &[Leg]) -> (Pose2, f64) {
    let (mut pose, mut least_m) = (from, f64::INFINITY);
    let start_m = arena.room_m(from);
    for leg in legs {
        let begin = pose;
        for step in 1..=200 {
            let part = f64::from(step) / 200.0;
            pose = begin.compose(match leg {
                Leg::Turn(turn_rad) => Pose2::new(0.0, 0.0, part * turn_rad),
                Leg::Move(way_m) => Pose2::new(part * way_m, 0.0, 0.0),
            });
            let room_m = arena.room_m(pose);
            // A body that stands at a wall leaves it.
            if room_m > start_m + 1e-3 || start_m > WANTED_M {
                least_m = least_m.min(room_m);
            }
        }
    }
    (pose, least_m)
}

#[track_caller]
fn check_route(number: u32, pose: Pose2, to: [f64; 2], first: impl Fn(&Leg) -> bool) {
    let arena = arena(number);
    let views = [View { arena: &arena, pose }];
    let found = route(&views, WANTED_M, pose.inverse_transform(Point2::from(to)));
    let Route::There(legs) = found else { panic!("no way there: {found:?}") };
    assert!(first(&legs[0]), "{legs:?}");
    let (end, room_m) = follow(&arena, pose, &legs);
    assert!((end.position() - Point2::from(to)).norm() < END_M, "{end:?} after {legs:?}");
    assert!(room_m > 0.003, "{room_m} m on {legs:?}");
}

#[test]
fn a_robot_that_cannot_turn_where_it_stands_finds_room_first() {
    // In the open it just turns.
    check_route(1, Pose2::new(0.3, 0.2, 0.0), [0.3, 0.9], |leg| matches!(leg, Leg::Turn(_)));
    // With its nose at a wall it drives back.
    let is_back = |leg: &Leg| matches!(leg, Leg::Move(way_m) if *way_m < 0.0);
    check_route(3, Pose2::new(-0.201, 0.2, 3.118), [0.5, 0.2], is_back);
    // With its back to it, ahead.
    check_route(
        3,
        Pose2::new(-0.201, 0.2, 0.0),
        [-0.2, 0.3],
        |leg| matches!(leg, Leg::Move(way_m) if *way_m > 0.0),
    );
    // Beside a wall it can do neither as it likes.
    check_route(2, Pose2::new(0.125, 0.465, -2.6), [0.15, 0.14], |_| true);
}

#[test]
fn where_it_may_be_at_two_places_a_way_is_free_at_both() {
    let arena = arena(1);
    let open = Pose2::new(0.3, 0.2, 0.0);
    let views = [View { arena: &arena, pose: open }];
    let ahead = Point2::new(0.2, 0.0);
    assert!(matches!(route(&views, WANTED_M, ahead), Route::There(_)));
    // The same way leads through a wall if the robot is at the other place.
    let both = [views[0], View { arena: &arena, pose: Pose2::new(0.48, 0.2, 0.0) }];
    assert!(matches!(route(&both, WANTED_M, ahead), Route::Away(_)));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, max_global_rejects: 50_000, max_shrink_iters: 40, ..ProptestConfig::default() })]
    #[test]
    fn routes_end_where_they_should_and_touch_nothing(
        number in 1_u32..4, from in (0.0..1.0_f64, 0.0..1.0_f64, -3.0..3.0_f64), to in (-0.4..0.4_f64, -0.4..0.4_f64),
    ) {
        let arena = arena(number);
        let (low, high) = arena.outline().expect("an outline").bounds();
        let place = |x: f64, y: f64| Point2::new(low.x + x * (high.x - low.x), low.y + y * (high.y - low.y));
        let begin = place(from.0, from.1);
        let end = Point2::new(begin.x + to.0, begin.y + to.1);
        let pose = Pose2::new(begin.x, begin.y, from.2);
        prop_assume!(arena.free_m(begin) > 0.1 && arena.free_m(end) > 0.1);
        prop_assume!(arena.room_m(pose) > 0.001);
        let views = [View { arena: &arena, pose }];
        if let Route::There(legs) = route(&views, WANTED_M, pose.inverse_transform(end)) {
            let (last, room_m) = follow(&arena, pose, &legs);
            prop_assert!((last.position() - end).norm() < END_M);
            prop_assert!(room_m > 0.0, "{} m on {:?}", room_m, legs);
        }
    }
}
