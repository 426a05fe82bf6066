use crate::{Point2, Polygon, PolygonError, Pose2, Segment, Shape};
use proptest::prelude::*;

#[track_caller]
fn refused(corners: &[[f64; 2]], because: PolygonError) {
    assert_eq!(Polygon::from_coordinates(corners), Err(because));
}

#[test]
fn broken_polygons_are_refused() {
    refused(&[[0.0, 0.0], [1.0, 0.0]], PolygonError::TooFewCorners { corners: 2 });
    refused(&[[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]], PolygonError::TooFewCorners { corners: 2 });
    refused(
        &[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        PolygonError::NotSimple { first: 0, second: 1 },
    );
    refused(
        &[[0.0, 0.0], [1.0, 0.0], [0.5, 0.0], [0.0, 1.0]],
        PolygonError::NotSimple { first: 0, second: 1 },
    );
    refused(
        &[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]],
        PolygonError::NotSimple { first: 0, second: 2 },
    );
    let error = Polygon::from_coordinates(&[[0.0, 0.0], [1.0, f64::NAN], [1.0, 0.0]]);
    assert!(matches!(error, Err(PolygonError::NotFinite { corner: 1, .. })));
    assert!(Polygon::rectangle(0.0, 1.0).is_err() && Polygon::rectangle(1.0, -0.0).is_err());
    assert!(Polygon::rectangle(f64::INFINITY, 1.0).is_err() && Polygon::regular(2, 1.0).is_err());
}

/// The three arenas of the ultrasonic robot, in centimetres, and their areas in square centimetres.
#[test]
fn arenas_have_the_published_areas() {
    let arenas: [(&[[f64; 2]], f64); 2] = [
        (
            &[[0., 0.], [60., 0.], [60., 45.], [45., 45.], [45., 59.], [106., 59.], [106., 105.], [0., 105.]],
            8206.0,
        ),
        (
            &[
                [0., 0.],
                [60., 0.],
                [60., 50.],
                [100., 50.],
                [70., 0.],
                [110., 0.],
                [150., 80.],
                [30., 80.],
                [30., 40.],
                [0., 80.],
            ],
            8550.0,
        ),
    ];
    for (corners, area) in arenas {
        let polygon = Polygon::from_coordinates(corners).expect("an arena");
        assert!((polygon.area_m2() - area).abs() < 1e-9);
        let mut turned: Vec<_> = corners.to_vec();
        turned.reverse();
        assert!((Polygon::from_coordinates(&turned).expect("an arena").area_m2() - area).abs() < 1e-9);
        assert!(polygon.contains(Point2::new(20.0, 20.0)) && !polygon.contains(Point2::new(65.0, 20.0)));
    }
}

#[test]
fn a_notch_is_outside() {
    let notched = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0]];
    let polygon = Polygon::from_coordinates(&notched).expect("simple");
    assert!(!polygon.is_convex() && Polygon::regular(7, 2.0).expect("regular").is_convex());
    assert!(!polygon.contains(Point2::new(2.0, 2.0)) && polygon.contains(Point2::new(2.0, 0.5)));
    let across = Segment::between([-1.0, 0.5], [5.0, 0.5]);
    assert!(polygon.distance_to_segment_m(&across).abs() < 1e-12);
    let in_notch = Segment::between([1.9, 3.0], [2.1, 3.0]);
    assert!(polygon.distance_to_segment_m(&in_notch) > 0.5);
    let inside = Segment::between([1.0, 0.5], [3.0, 0.5]);
    assert!(polygon.distance_to_segment_m(&inside).abs() < 1e-12);
    let disc = Shape::Disc { centre: Point2::new(2.0, 3.0), radius_m: 0.1 };
    assert!(
        (disc.distance_to_shape_m(&Shape::Polygon(polygon.clone()))
            - (polygon.distance_m(Point2::new(2.0, 3.0)) - 0.1))
            .abs()
            < 1e-12
    );
}

#[test]
fn segments_meet_where_they_should() {
    let level = Segment::between([0.0, 0.0], [4.0, 0.0]);
    let meet = |a, b, expected: Option<[f64; 2]>| {
        let other = Segment::between(a, b);
        let found = level.intersection(&other);
        assert_eq!(found.map(|p| [p.x, p.y]), expected);
        assert_eq!(other.intersects(&level), expected.is_some());
    };
    meet([1.0, -1.0], [1.0, 1.0], Some([1.0, 0.0]));
    meet([4.0, 0.0], [4.0, 1.0], Some([4.0, 0.0]));
    meet([4.1, -1.0], [4.1, 1.0], None);
    meet([2.0, 0.0], [9.0, 0.0], Some([2.0, 0.0]));
    meet([-3.0, 0.0], [9.0, 0.0], Some([0.0, 0.0]));
    meet([5.0, 0.0], [9.0, 0.0], None);
    meet([0.0, 1.0], [4.0, 1.0], None);
    meet([2.0, 0.0], [2.0, 0.0], Some([2.0, 0.0]));
    assert!(Segment::between([1.0, 1.0], [1.0, 1.0]).direction().is_none());
}

fn point() -> impl Strategy<Value = [f64; 2]> {
    prop_oneof![[-3.0..3.0, -3.0..3.0], (-3..3, -3..3).prop_map(|(x, y)| [f64::from(x), f64::from(y)])]
}

proptest! {
    #[test]
    fn segment_distance_is_the_smallest_of_many(a in point(), b in point(), c in point(), d in point()) {
        let (p, q) = (Segment::between(a, b), Segment::between(c, d));
        let distance = p.distance_to_segment_m(&q);
        let sampled = (0..=400).map(|i| p.distance_m(q.at(f64::from(i) / 400.0))).fold(f64::INFINITY, f64::min);
        prop_assert!(distance <= sampled + 1e-9 && sampled - distance <= 0.5 * q.length_m() / 400.0 + 1e-9);
        prop_assert!((distance - q.distance_to_segment_m(&p)).abs() < 1e-12);
        prop_assert_eq!(p.intersects(&q), q.intersects(&p));
    }

    #[test]
    fn moving_changes_neither_area_nor_inside(
        corners in 3_usize..12, x in -5.0..5.0, y in -5.0..5.0, turn in -4.0..4.0, probe in point(),
    ) {
        let polygon = Polygon::regular(corners, 2.0).expect("regular");
        let pose = Pose2::new(x, y, turn);
        let moved = polygon.transformed(pose);
        prop_assert!((polygon.area_m2() - moved.area_m2()).abs() < 1e-9);
        prop_assert!((moved.centroid() - pose.position()).norm() < 1e-9);
        let probe = Point2::from(probe);
        prop_assume!(polygon.distance_to_boundary_m(probe) > 1e-9);
        prop_assert_eq!(polygon.contains(probe), moved.contains(pose.transform(probe)));
        let nearest_to_centre = 2.0 * (std::f64::consts::PI / corners as f64).cos();
        if probe.coords.norm() < nearest_to_centre - 1e-9 { prop_assert!(polygon.contains(probe)); }
        if probe.coords.norm() > 2.0 { prop_assert!(!polygon.contains(probe)); }
    }
}

#[test]
fn random_places_keep_away_from_the_boundary() {
    let polygon =
        Polygon::from_coordinates(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]])
            .expect("an L");
    let mut state = 1_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    for _ in 0..200 {
        let place = polygon.random_place(0.3, &mut uniform).expect("there is room");
        assert!(polygon.contains(place) && polygon.distance_to_boundary_m(place) >= 0.3);
    }
    assert_eq!(polygon.random_place(0.6, &mut uniform), None);
    assert_eq!(polygon.random_place(0.1, || f64::NAN), None);
}
