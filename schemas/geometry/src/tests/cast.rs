use crate::{Body, BodyKind, Cone, Hit, Point2, Polygon, Pose2, Ray, Scene, Segment, Surface, Walls, World};
use proptest::prelude::*;

fn brute(segments: &[Segment], origin: Point2<f64>, heading_rad: f64) -> Option<f64> {
    let direction = crate::Vector2::new(heading_rad.cos(), heading_rad.sin());
    segments.iter().filter_map(|wall| wall.cast_m(origin, direction)).min_by(f64::total_cmp)
}

fn coordinate() -> impl Strategy<Value = f64> {
    // Round numbers make corners, parallels and touching walls likely.
    prop_oneof![(-20..20).prop_map(f64::from), -20.0..20.0]
}

fn segment() -> impl Strategy<Value = Segment> {
    [coordinate(), coordinate(), coordinate(), coordinate()]
        .prop_map(|[a, b, c, d]| Segment::between([a, b], [c, d]))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn cells_see_what_trying_every_wall_sees(
        segments in prop::collection::vec(segment(), 0..120),
        rays in prop::collection::vec((-25.0..25.0, -25.0..25.0, -7.0..7.0), 20),
    ) {
        let walls = Walls::new(segments.clone());
        for (x, y, heading_rad) in rays {
            let origin = Point2::new(x, y);
            let expected = brute(&segments, origin, heading_rad);
            let found = walls.cast(origin, heading_rad, f64::INFINITY).map(|hit| hit.range_m);
            let same = |expected: Option<f64>| match (expected, found) {
                (Some(expected), Some(found)) => (expected - found).abs() < 1e-5,
                (expected, found) => expected == found,
            };
            // A ray past an end by a hair may meet the wall all the same.
            let longer: Vec<_> = segments.iter().map(|wall| Segment::new(wall.at(-3e-7), wall.at(1.0 + 3e-7))).collect();
            prop_assert!(same(expected) || same(brute(&longer, origin, heading_rad)), "{expected:?} but {found:?}");
            if !same(expected) { continue; }
            if let Some(range_m) = expected {
                prop_assert!(walls.cast(origin, heading_rad, range_m * 0.999 - 1e-6).is_none());
                let end = origin + crate::Vector2::new(heading_rad.cos(), heading_rad.sin()) * (range_m + 1e-3);
                prop_assert!(!walls.is_free(origin, end));
            }
        }
    }

    #[test]
    fn a_closed_room_does_not_leak(
        corners in 3_usize..40, heading_rad in -4.0..4.0_f64, x in -0.3..0.3, y in -0.3..0.3,
    ) {
        let room = Polygon::regular(corners, 1.0).expect("regular");
        let walls = Walls::new(room.edges());
        let corner = room.corners()[corners / 2] - Point2::new(x, y);
        for heading_rad in [heading_rad, corner.y.atan2(corner.x)] {
            let hit = walls.cast(Point2::new(x, y), heading_rad, 10.0);
            prop_assert!(hit.is_some_and(|hit| hit.range_m < 1.5));
        }
    }

    #[test]
    fn clearance_is_that_of_parry(
        x in -2.0..2.0, y in -2.0..2.0, turn in -4.0..4.0, wall in segment(),
    ) {
        let footprint = Polygon::rectangle(0.61, 0.51).expect("a rectangle");
        let scene = Scene::new([wall]);
        prop_assume!(wall.length_m() > 1e-6);
        let ours = scene.clearance_m(&footprint, Pose2::new(x, y, turn), [0.0, 1.0], None);
        use parry2d_f64::{math::Vector, query, shape};
        let vector = |p: Point2<f64>| Vector::new(p.x, p.y);
        let theirs = query::distance(
            &parry2d_f64::math::Pose::new(Vector::new(x, y), turn),
            &shape::Cuboid::new(Vector::new(0.305, 0.255)),
            &parry2d_f64::math::Pose::identity(),
            &shape::Segment::new(vector(wall.a), vector(wall.b)),
        ).expect("supported").distance;
        prop_assert!((ours - theirs).abs() < 1e-6, "{ours} but parry says {theirs}");
    }

    #[test]
    fn a_pushed_footprint_stops_at_the_first_touch(
        x in -3.0..3.0, y in -3.0..3.0, turn in -4.0..4.0, heading_rad in -4.0..4.0_f64,
        walls in prop::collection::vec(segment(), 1..6),
    ) {
        let notched = [[-0.3, -0.3], [0.3, -0.3], [0.0, 0.0], [0.3, 0.3], [-0.3, 0.3]];
        let footprint = Polygon::from_coordinates(&notched).expect("simple");
        prop_assume!(walls.iter().all(|wall| wall.length_m() > 0.1));
        let scene = Scene::new(walls.clone());
        let pose = Pose2::new(x, y, turn);
        prop_assume!(scene.clearance_m(&footprint, pose, [0.0, 1.0], None) > 1e-3);
        let direction = crate::Vector2::new(heading_rad.cos(), heading_rad.sin());
        // The first touch is that of a corner on an edge: of the footprint's corners, or of a wall's ends.
        let placed = footprint.transformed(pose);
        let forward = placed.corners().iter().flat_map(|&corner| walls.iter().filter_map(move |wall| wall.cast_m(corner, direction)));
        let ends = walls.iter().flat_map(|wall| [wall.a, wall.b]);
        let backward = ends.flat_map(|end| placed.edges().filter_map(move |edge| edge.cast_m(end, -direction)).collect::<Vec<_>>());
        let expected = forward.chain(backward).fold(10.0, f64::min);
        let found = scene.free_way_m(&footprint, pose, heading_rad, 10.0, [0.0, 1.0], None);
        prop_assert!((found - expected).abs() < 1e-6, "{found} but {expected}");
    }
}

#[test]
fn a_pushed_footprint_passes_what_it_passes() {
    let mut scene = hallway();
    scene.add_body(Body::cylinder(0.2, 0.3), Pose2::new(5.0, 0.85, 0.0), Surface::Furniture(0));
    let id = scene.add_body(Body::cylinder(0.1, 1.0), Pose2::new(2.0, 0.85, 0.0), Surface::Robot(0));
    let footprint = Polygon::rectangle(0.61, 0.51).expect("a rectangle");
    let way = |y, heights, own| scene.free_way_m(&footprint, Pose2::new(2.0, y, 0.0), 0.0, 9.0, heights, own);
    assert!((way(0.85, [0.0, 1.0], Some(id)) - (3.0 - 0.2 - 0.305)).abs() < 1e-6);
    assert!((way(0.85, [0.4, 1.0], Some(id)) - 9.0).abs() < 1e-12);
    assert!(way(0.85, [0.0, 1.0], None).abs() < 1e-12);
    assert!((way(0.30, [0.0, 1.0], Some(id)) - 9.0).abs() < 1e-12);
    assert!(way(f64::NAN, [0.0, 1.0], Some(id)).abs() < 1e-12);
}

#[test]
fn nonsense_hits_nothing() {
    let walls = Walls::new((0..30).map(|i| Segment::between([f64::from(i), -1.0], [f64::from(i), 1.0])));
    for (x, heading_rad, range_m) in [(f64::NAN, 0.0, 9.0), (0.5, f64::NAN, 9.0), (0.5, 0.0, f64::NAN)] {
        assert!(walls.cast(Point2::new(x, 0.0), heading_rad, range_m).is_none());
    }
    assert!(walls.cast(Point2::new(0.5, 0.0), 0.0, 9.0).is_some());
}

fn hallway() -> Scene {
    Scene::new([Segment::between([0.0, 0.0], [20.0, 0.0]), Segment::between([0.0, 1.7], [20.0, 1.7])])
}

#[track_caller]
fn sees(scene: &Scene, ray: Ray, range_m: f64, surface: Surface) -> Hit {
    let hit = scene.cast_ray(&ray, 4.0).expect("it meets something");
    assert!((hit.range_m - range_m).abs() < 1e-9 && hit.surface == surface, "{hit:?}");
    hit
}

#[test]
fn a_level_ray_passes_over_the_lower_shelf() {
    let mut scene = hallway();
    scene.add_body(Body::of(BodyKind::MailCart), Pose2::new(5.0, 0.25, 0.0), Surface::Furniture(0));
    let ray = |y, elevation_rad: f64| Ray::rising(Point2::new(4.0, y), 0.0, 0.25, elevation_rad);
    // Between the bars: nothing within 4 m. At a bar: its front. Downwards by atan(0.03 / 0.55): the shelf's
    // front.
    assert!(scene.cast_ray(&ray(0.25, 0.0), 4.0).is_none());
    sees(&scene, ray(0.02, 0.0), 0.55, Surface::Furniture(0));
    let down_rad = -(0.03_f64 / 0.55).atan();
    sees(&scene, ray(0.25, down_rad), 0.55_f64.hypot(0.03), Surface::Furniture(0));
    // From nearby the same ray passes above the edge and grazes the shelf's top.
    let near = Ray { origin: Point2::new(4.5, 0.25), ..ray(0.25, down_rad) };
    let top = scene.cast_ray(&near, 4.0).expect("the top");
    assert!((top.range_m - 0.02_f64 / -down_rad.sin()).abs() < 1e-9, "{top:?}");
    assert!(top.incidence_cos < 0.06, "{top:?}");
}

#[test]
fn a_falling_ray_meets_the_floor() {
    let hit = sees(
        &hallway(),
        Ray::rising(Point2::new(1.0, 0.8), 0.0, 0.25, -0.2),
        0.25 / 0.2_f64.sin(),
        Surface::Floor,
    );
    assert!((hit.incidence_cos - 0.2_f64.sin()).abs() < 1e-12);
}

#[test]
fn a_ray_from_inside_a_body_is_stopped_at_once() {
    let mut scene = hallway();
    let id = scene.add_body(Body::cylinder(0.2, 1.0), Pose2::new(5.0, 0.8, 0.0), Surface::Walker(3));
    let ray = Ray::level(Point2::new(5.1, 0.8), 0.0, 0.25);
    sees(&scene, ray, 0.0, Surface::Walker(3));
    assert!(scene.cast_ray_without(&ray, 4.0, id).is_none());
    scene.set_present(id, false);
    assert!(scene.cast_ray(&ray, 4.0).is_none());
}

#[test]
fn incidence_is_measured_from_the_normal() {
    let hit = hallway().cast_ray(&Ray::level(Point2::new(5.0, 0.7), 0.5, 0.25), 4.0).expect("the wall");
    assert!((hit.incidence_rad() - (std::f64::consts::FRAC_PI_2 - 0.5)).abs() < 1e-12);
    let mut scene = hallway();
    scene.add_body(Body::cylinder(0.2, 1.0), Pose2::new(2.0, 0.8, 0.0), Surface::Robot(0));
    let edge = scene.cast_ray(&Ray::level(Point2::new(1.0, 0.9), 0.0, 0.25), 4.0).expect("the body");
    assert!((edge.incidence_rad() - 30.0_f64.to_radians()).abs() < 1e-9, "{edge:?}");
}

#[test]
fn a_cone_is_its_rays() {
    let mut scene = hallway();
    for (i, kind) in [BodyKind::MailCart, BodyKind::SpinningChair, BodyKind::Sofa].into_iter().enumerate() {
        scene.add_body(Body::of(kind), Pose2::new(3.0 + i as f64, 0.6, 0.3), Surface::Furniture(i as u32));
    }
    let cone = Cone { half_width_rad: 0.23, half_height_rad: 0.2, columns: 7, rows: 5, max_range_m: 4.0 };
    let mut hits = Vec::new();
    for heading_rad in [-3.0, -1.5, -0.2, 0.0, 0.4, 2.0] {
        let sensor = Pose2::new(1.5, 0.7, heading_rad);
        scene.cast_cone(sensor, 0.25, &cone, &mut hits);
        assert_eq!(hits.len(), 35);
        for (i, hit) in hits.iter().enumerate() {
            let (azimuth_rad, elevation_rad) = cone.direction_rad(i);
            let ray = Ray::rising(sensor.position(), heading_rad + azimuth_rad, 0.25, elevation_rad);
            let alone = scene.cast_ray(&ray, 4.0);
            assert_eq!(hit.map(|hit| hit.surface), alone.map(|hit| hit.surface), "ray {i}");
            let (a, b) = (hit.map_or(0.0, |hit| hit.range_m), alone.map_or(0.0, |hit| hit.range_m));
            assert!((a - b).abs() < 1e-9);
        }
    }
}

#[test]
fn side_sensors_see_a_door_100_mm_deeper() {
    let world = World::parse(include_str!("../../tests/example-world.toml")).expect("the example is right");
    let mut floor = world.scene(2);
    let from = |x| Ray::level(Point2::new(x, 0.8), std::f64::consts::FRAC_PI_2, 0.25);
    let range = |scene: &Scene, x| scene.cast_ray(&from(x), 4.0).expect("something").range_m;
    assert!((range(&floor.scene, 5.0) - 0.9).abs() < 1e-9);
    assert!((range(&floor.scene, 4.0) - 1.0).abs() < 1e-9);
    // Open: the room's back wall, 3 m behind the leaf.
    let (index, leaf) = floor.bodies.doors[0];
    let geometry = world.door_geometry(&world.doors[index]).expect("on a wall");
    floor.scene.move_body(leaf, geometry.leaf_pose(1.0));
    assert!((floor.scene.cast_ray(&from(4.0), 5.0).expect("the back wall").range_m - 4.0).abs() < 1e-9);
}

#[test]
fn clearance_counts_only_what_is_at_the_robots_height() {
    let mut scene = Scene::new([]);
    scene.add_body(Body::of(BodyKind::MailCart), Pose2::IDENTITY, Surface::Furniture(0));
    let disc = Polygon::rectangle(0.1, 0.1).expect("a square");
    let clearance = |low_m, high_m| scene.clearance_m(&disc, Pose2::IDENTITY, [low_m, high_m], None);
    assert!(clearance(0.0, 0.5).abs() < 1e-12);
    assert!((clearance(0.24, 0.7) - (0.41_f64 - 0.05).hypot(0.21 - 0.05)).abs() < 1e-9);
    assert!(Scene::new([]).clearance_m(&disc, Pose2::IDENTITY, [0.0, 1.0], None).is_infinite());
}
