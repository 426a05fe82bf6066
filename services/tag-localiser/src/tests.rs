mod malaga;
mod robot;

use crate::*;
use geometry::Segment;
use geometry::angle;
use messages::{AnchorRange, LocationState};
use robot::{Hallway, Wheels, hallway_anchors, median, quantile, range_to};

fn localiser(params: Params) -> TagLocaliser {
    TagLocaliser::new(params, HallwayWalls::default()).unwrap()
}

fn known_start() -> Params {
    let start = Start { x_m: 2.0, y_m: 1.0, heading_rad: 0.0, sigma_m: 0.1, sigma_rad: 0.05, floor: 2 };
    Params { start: Some(start), ..Params::default() }
}

fn at(second: f64) -> Time {
    Time::from_secs_f64(second)
}

/// Four anchors in the corners of a room of 10 m by 8 m, heard from a pose without noise.
fn tag_at(pose: Pose2) -> TagRanges {
    let mut tag =
        TagRanges { antenna_x_m: 0.16, antenna_z_m: 1.0, floor: 2, anchor_count: 4, ..TagRanges::default() };
    for (id, (anchor, at_m)) in
        tag.anchors.iter_mut().zip([[0.0, 0.0], [10.0, 0.0], [10.0, 8.0], [0.0, 8.0]]).enumerate()
    {
        *anchor = AnchorRange {
            x_m: at_m[0],
            y_m: at_m[1],
            z_m: 2.5,
            id: id as u32,
            quality_percent: 80.0,
            range_m: 0.0,
        };
        anchor.range_m = range_to(pose, [0.16, 0.0, 1.0], [at_m[0], at_m[1], 2.5]);
    }
    tag
}

fn hear(localiser: &mut TagLocaliser, second: f64, tag: &TagRanges) -> PoseEstimate {
    let tag = Some(Stamped::new(at(second), tag));
    localiser.step(at(second), Inputs { tag, ..Inputs::default() }).pose
}

#[track_caller]
fn check_refused(change: impl Fn(&mut Params), named: &str) {
    let mut params = Params::default();
    change(&mut params);
    let error = TagLocaliser::new(params, HallwayWalls::default()).unwrap_err().to_string();
    assert!(error.contains(named), "{error}");
}

#[test]
fn nonsense_parameters_are_refused() {
    check_refused(|params| params.range_sigma_m = 0.0, "`range_sigma_m` is 0");
    check_refused(|params| params.range_sigma_m = f64::NAN, "`range_sigma_m` is not a finite number");
    check_refused(|params| params.silent_messages = 0, "`silent_messages` is 0");
    check_refused(|params| params.lost_sigma_m = -1.0, "lost_sigma_m");
    check_refused(
        |params| (params.outlier_chance, params.recovery_chance) = (0.4, 0.8),
        "outlier_chance = 0.4",
    );
    check_refused(
        |params| params.start = Some(Start { x_m: f64::INFINITY, ..known_start().start.unwrap() }),
        "start.x_m",
    );
}

#[test]
fn nothing_heard_is_nothing_known() {
    let pose = localiser(Params::default()).step(at(1.0), Inputs::default()).pose;
    assert_eq!(pose.state, LocationStateName::Unknown);
    assert!(pose.pose().is_err());
}

#[test]
fn a_known_start_is_degraded_until_the_tag_is_heard() {
    let mut localiser = localiser(known_start());
    let before = localiser.step(at(1.0), Inputs::default()).pose;
    assert_eq!(
        (before.state, before.x_m, before.floor),
        (LocationState::from(LocationStateName::Degraded), 2.0, 2)
    );
    let after = hear(&mut localiser, 1.1, &tag_at(Pose2::new(2.0, 1.0, 0.0)));
    assert_eq!(after.state, LocationStateName::Tracking);
    assert_eq!((after.accepted, after.rejected, after.alive_anchors, after.dead_anchors), (4, 0, 0b1111, 0));
    assert!((after.x_m - 2.0).hypot(after.y_m - 1.0) < 0.03);
}

#[track_caller]
fn check_bad_reading(spoil: impl Fn(&mut TagRanges)) {
    let mut localiser = localiser(known_start());
    let mut tag = tag_at(Pose2::new(2.0, 1.0, 0.0));
    spoil(&mut tag);
    let pose = hear(&mut localiser, 1.0, &tag);
    assert_eq!((pose.accepted, pose.rejected), (3, 1));
    assert!((pose.x_m - 2.0).hypot(pose.y_m - 1.0) < 0.05, "{pose:?}");
    assert!(pose.covariance.iter().all(|number| number.is_finite()));
}

#[test]
fn a_bad_reading_is_rejected_and_counted() {
    check_bad_reading(|tag| tag.anchors[2].range_m = f64::NAN);
    check_bad_reading(|tag| tag.anchors[2].range_m = f64::INFINITY);
    check_bad_reading(|tag| tag.anchors[2].range_m = -3.0);
    check_bad_reading(|tag| tag.anchors[2].range_m = 0.0);
    check_bad_reading(|tag| tag.anchors[2].range_m = 61.0);
    check_bad_reading(|tag| tag.anchors[2].range_m += 4.0);
    check_bad_reading(|tag| tag.anchors[2].range_m -= 2.0);
    check_bad_reading(|tag| tag.anchors[0].x_m = f64::NAN);
    check_bad_reading(|tag| tag.anchors[0].z_m = f64::NEG_INFINITY);
    check_bad_reading(|tag| tag.anchors[1].quality_percent = 10.0);
    check_bad_reading(|tag| tag.anchors[1].quality_percent = f32::NAN);
    check_bad_reading(|tag| tag.anchors[1].id = 0);
}

#[test]
fn a_position_serves_where_ranges_are_missing() {
    let mut localiser = localiser(known_start());
    let tag = TagRanges {
        x_m: 2.36,
        y_m: 1.3,
        has_position: 1,
        quality_percent: 60.0,
        antenna_x_m: 0.16,
        floor: 2,
        ..TagRanges::default()
    };
    for step in 0..60 {
        hear(&mut localiser, f64::from(step) * 0.1, &tag);
    }
    let pose = hear(&mut localiser, 6.0, &tag);
    assert!((pose.x_m - 2.2).abs() < 0.05 && (pose.y_m - 1.3).abs() < 0.05, "{pose:?}");
    assert_eq!(pose.rejected, 0);
    let far = hear(&mut localiser, 6.1, &TagRanges { x_m: 3.4, ..tag });
    assert_eq!(far.rejected, 1);
    let poor = hear(&mut localiser, 6.2, &TagRanges { quality_percent: 20.0, ..tag });
    assert_eq!(poor.rejected, 2);
}

#[test]
fn the_floor_changes_after_several_messages() {
    let mut localiser = localiser(known_start());
    let here = tag_at(Pose2::new(2.0, 1.0, 0.0));
    let upstairs = TagRanges { floor: 3, ..here };
    for step in 0..4 {
        let pose = hear(&mut localiser, f64::from(step), &upstairs);
        assert_eq!((pose.floor, pose.state), (2, LocationState::from(LocationStateName::Degraded)));
    }
    assert_eq!(hear(&mut localiser, 4.0, &here).floor, 2);
    for step in 5..9 {
        assert_eq!(hear(&mut localiser, f64::from(step), &upstairs).floor, 2);
    }
    assert_eq!(hear(&mut localiser, 9.0, &upstairs).floor, 3);
}

#[test]
fn a_silent_tag_degrades() {
    let mut localiser = localiser(known_start());
    assert_eq!(
        hear(&mut localiser, 1.0, &tag_at(Pose2::new(2.0, 1.0, 0.0))).state,
        LocationStateName::Tracking
    );
    assert_eq!(localiser.step(at(3.9), Inputs::default()).pose.state, LocationStateName::Tracking);
    let silent = localiser.step(at(4.1), Inputs::default()).pose;
    assert_eq!((silent.state, silent.alive_anchors), (LocationState::from(LocationStateName::Degraded), 0));
}

#[test]
fn a_dead_anchor_is_named_and_forgiven() {
    let mut localiser = localiser(known_start());
    let whole = tag_at(Pose2::new(2.0, 1.0, 0.0));
    let mut three = whole;
    three.anchor_count = 3;
    hear(&mut localiser, 1.0, &whole);
    let mut pose = PoseEstimate::default();
    for step in 0..15 {
        pose = hear(&mut localiser, 1.1 + f64::from(step) * 0.1, &three);
    }
    assert_eq!(
        (pose.state, pose.alive_anchors, pose.dead_anchors),
        (LocationState::from(LocationStateName::Degraded), 0b111, 0b1000)
    );
    let again = hear(&mut localiser, 3.0, &whole);
    assert_eq!(
        (again.state, again.alive_anchors, again.dead_anchors),
        (LocationState::from(LocationStateName::Tracking), 0b1111, 0)
    );
}

#[test]
fn an_anchor_that_is_always_wrong_is_dead() {
    let mut localiser = localiser(known_start());
    let mut tag = tag_at(Pose2::new(2.0, 1.0, 0.0));
    tag.anchors[1].range_m += 1.5;
    let mut pose = PoseEstimate::default();
    for step in 0..20 {
        pose = hear(&mut localiser, f64::from(step) * 0.1, &tag);
    }
    assert_eq!((pose.dead_anchors, pose.alive_anchors, pose.rejected), (0b10, 0b1101, 20));
    assert_eq!(pose.state, LocationStateName::Degraded);
    assert!((pose.x_m - 2.0).hypot(pose.y_m - 1.0) < 0.05);
}

#[test]
fn odometry_that_begins_anew_moves_nothing() {
    let mut localiser = localiser(known_start());
    let far = Odometry { x_m: 40.0, y_m: 3.0, ..Odometry::default() };
    let origin = Odometry::default();
    let broken = Odometry { x_m: f64::NAN, ..Odometry::default() };
    for (second, odometry) in [(0.0, &far), (0.1, &origin), (0.2, &broken), (0.3, &origin)] {
        let odometry = Some(Stamped::new(at(second), odometry));
        localiser.step(at(second), Inputs { odometry, ..Inputs::default() });
    }
    let pose = hear(&mut localiser, 0.4, &tag_at(Pose2::new(2.0, 1.0, 0.0)));
    assert!((pose.x_m - 2.0).hypot(pose.y_m - 1.0) < 0.1, "{pose:?}");
}

#[test]
fn a_wall_turns_the_heading_from_either_end() {
    for wall_heading_rad in [0.0, std::f64::consts::PI] {
        let mut localiser = localiser(known_start());
        let correction = HeadingCorrection {
            angle_rad: 0.06,
            wall_heading_rad,
            sigma_rad: 0.01,
            valid: 1,
            ..HeadingCorrection::default()
        };
        let mut heading_rad = 0.0;
        for step in 0..30 {
            let heading = Some(Stamped::new(at(f64::from(step)), &correction));
            heading_rad =
                localiser.step(at(f64::from(step)), Inputs { heading, ..Inputs::default() }).pose.heading_rad;
        }
        assert!((heading_rad - 0.06).abs() < 0.01, "{heading_rad}");
    }
}

fn hallway_walls() -> HallwayWalls {
    HallwayWalls::from_segments(
        2,
        [Segment::between([0.0, -0.85], [40.0, -0.85]), Segment::between([0.0, 0.85], [40.0, 0.85])],
    )
}

/// Errors of place (m) and heading (rad) while the robot drives through the hallway, from the tenth second
/// on.
fn drive_hallway(
    seed: u64,
    params: Params,
    walls: HallwayWalls,
    with_sides: bool,
    outliers: f64,
) -> (Vec<f64>, Vec<f64>) {
    let mut localiser = TagLocaliser::new(params, walls).unwrap();
    let mut hallway = Hallway::new(seed, Wheels::default(), outliers);
    let (mut places, mut headings) = (Vec::new(), Vec::new());
    for step in 0..1000_u32 {
        let now = at(f64::from(step) * 0.05);
        let frame = hallway.step(step);
        let inputs = Inputs {
            odometry: Some(Stamped::new(now, &frame.odometry)),
            tag: (step % 2 == 0).then_some(Stamped::new(now, &frame.tag)),
            ranges: with_sides.then_some(Stamped::new(now, &frame.ranges)),
            heading: None,
        };
        let pose = localiser.step(now, inputs).pose;
        if step >= 200 {
            places.push((pose.x_m - frame.truth.x_m).hypot(pose.y_m - frame.truth.y_m));
            headings.push(angle::difference(pose.heading_rad, frame.truth.heading_rad).abs());
        }
    }
    (places, headings)
}

#[track_caller]
fn check_hallway(with_sides: bool, outliers: f64, median_m: f64, most_m: f64, most_deg: f64) {
    for seed in 1..=5 {
        let walls = if with_sides { hallway_walls() } else { HallwayWalls::default() };
        let (places, headings) = drive_hallway(seed, Params::default(), walls, with_sides, outliers);
        let figures = (median(&places), quantile(&places, 0.95), quantile(&headings, 0.95).to_degrees());
        println!(
            "sides {with_sides}, outliers {outliers}, seed {seed}: median {:.3} m, 95 % {:.3} m, heading 95 % {:.2} deg",
            figures.0, figures.1, figures.2
        );
        assert!(
            figures.0 < median_m && figures.1 < most_m && figures.2 < most_deg,
            "seed {seed}: {figures:?}"
        );
    }
}

#[test]
fn the_hallway_is_driven_within_its_bounds() {
    check_hallway(false, 0.02, 0.06, 0.14, 4.0);
    check_hallway(true, 0.02, 0.03, 0.08, 3.0);
    check_hallway(false, 0.25, 0.08, 0.18, 6.0);
}

#[test]
fn the_claimed_covariance_is_honest() {
    // The normalised error squared of a Gaussian in two dimensions averages 2; an overconfident filter is far
    // above.
    let mut total = 0.0;
    let mut count = 0.0;
    for seed in 11..=16 {
        let mut localiser = localiser(Params::default());
        let mut hallway = Hallway::new(seed, Wheels::default(), 0.02);
        for step in 0..800_u32 {
            let now = at(f64::from(step) * 0.05);
            let frame = hallway.step(step);
            let inputs = Inputs {
                odometry: Some(Stamped::new(now, &frame.odometry)),
                tag: (step % 2 == 0).then_some(Stamped::new(now, &frame.tag)),
                ..Inputs::default()
            };
            let pose = localiser.step(now, inputs).pose;
            if step >= 200 && step % 20 == 0 {
                let [xx, xy, _, _, yy, ..] = pose.covariance;
                let (dx, dy) = (pose.x_m - frame.truth.x_m, pose.y_m - frame.truth.y_m);
                total += (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy);
                count += 1.0;
            }
        }
    }
    let mean = total / count;
    assert!((0.05..2.5).contains(&mean), "{mean}");
}

#[test]
fn a_carried_robot_is_found_again() {
    let mut localiser = localiser(known_start());
    for step in 0..20 {
        hear(&mut localiser, f64::from(step) * 0.1, &tag_at(Pose2::new(2.0, 1.0, 0.0)));
    }
    let mut pose = PoseEstimate::default();
    for step in 20..80 {
        pose = hear(&mut localiser, f64::from(step) * 0.1, &tag_at(Pose2::new(8.0, 6.0, 0.0)));
    }
    assert!((pose.x_m - 8.0).hypot(pose.y_m - 6.0) < 0.4, "{pose:?}");
}

#[test]
fn two_runs_are_equal_to_the_bit() {
    let run = || drive_hallway(3, Params::default(), hallway_walls(), true, 0.1);
    assert_eq!(run(), run());
}

#[test]
fn anchors_lie_along_the_hallway() {
    // The simulated anchors must not make it easy: the hallway is long and narrow.
    let anchors = hallway_anchors();
    assert!(anchors.iter().all(|anchor| anchor[1].abs() <= 0.85 && anchor[0] <= 40.0));
}

proptest::proptest! {
    #[test]
    fn any_numbers_are_survived(
        numbers in proptest::collection::vec((proptest::num::f64::ANY, proptest::num::f64::ANY, proptest::num::f32::ANY), 24),
        count in proptest::num::u32::ANY,
        floor in 1..3_i32,
    ) {
        let mut localiser = TagLocaliser::new(known_start(), hallway_walls()).unwrap();
        for (step, chunk) in numbers.chunks(3).enumerate() {
            let now = at(step as f64 * 0.1);
            let good = tag_at(Pose2::new(2.0, 1.0, 0.0));
            let mut tag = TagRanges { anchor_count: count, floor, x_m: chunk[0].0, has_position: count % 2, antenna_z_m: chunk[1].1, ..good };
            tag.anchors[0].range_m = chunk[0].1;
            tag.anchors[1].x_m = chunk[1].0;
            tag.anchors[2].quality_percent = chunk[2].2;
            let odometry = Odometry { x_m: chunk[0].0, heading_rad: chunk[2].1, ..Odometry::default() };
            let heading = HeadingCorrection { angle_rad: chunk[1].1, sigma_rad: chunk[1].0, valid: 1, ..HeadingCorrection::default() };
            let ranges = TofRanges { range_m: [chunk[0].2; 8], ..TofRanges::default() };
            let inputs = Inputs {
                odometry: Some(Stamped::new(now, &odometry)),
                tag: Some(Stamped::new(now, &tag)),
                ranges: Some(Stamped::new(now, &ranges)),
                heading: Some(Stamped::new(now, &heading)),
            };
            let pose = localiser.step(now, inputs).pose;
            proptest::prop_assert!(pose.x_m.is_finite() && pose.y_m.is_finite() && pose.heading_rad.is_finite());
            proptest::prop_assert!(pose.covariance.iter().all(|number| number.is_finite()));
        }
    }
}

#[test]
fn a_successor_goes_on_where_its_predecessor_was() {
    let mut first = localiser(known_start());
    assert!(first.snapshot().is_none(), "nothing was heard yet");
    let odometry = |x_m: f64| Odometry { x_m, ..Odometry::default() };
    for step in 0..20_u32 {
        let now = f64::from(step) * 0.1;
        let still = odometry(5.0);
        first.step(at(now), Inputs { odometry: Some(Stamped::new(at(now), &still)), ..Inputs::default() });
        hear(&mut first, now, &tag_at(Pose2::new(2.0, 1.0, 0.0)));
    }
    let text = serde_json::to_string(&first.snapshot().expect("it knows the place")).unwrap();
    let mut successor = localiser(Params::default());
    successor.restore(&serde_json::from_str(&text).unwrap());
    // The robot went on by 0.2 m while nobody looked.
    let moved = odometry(5.2);
    let pose = successor
        .step(at(2.1), Inputs { odometry: Some(Stamped::new(at(2.1), &moved)), ..Inputs::default() })
        .pose;
    assert!((pose.x_m - 2.2).hypot(pose.y_m - 1.0) < 0.1, "{pose:?}");
    assert_eq!(pose.floor, 2);
    assert!(pose.pose().is_ok());
}
