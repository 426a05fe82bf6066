use super::*;
use geometry::{Point2, World};
use proptest::prelude::*;

/// Five anchors on floor 2, one on floor 3.
fn world() -> World {
    let anchors = [
        (1, 2, 0.0, 3.0),
        (2, 2, 5.0, -3.0),
        (3, 2, 10.0, 3.0),
        (4, 2, 15.0, -3.0),
        (5, 2, 60.0, 0.0),
        (6, 3, 0.0, 0.0),
    ];
    let anchors = anchors.map(|(id, floor, x, y)| {
        format!("[[anchor]]\nid = {id}\nfloor = {floor}\nx_m = {x:?}\ny_m = {y:?}\nz_m = 2.2\n")
    });
    World::parse(&format!("name = \"w\"\n[[floor]]\nnumber = 2\n[[floor]]\nnumber = 3\n{}", anchors.concat()))
        .unwrap()
}

fn at(ms: u64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

fn truth(x_m: f64, y_m: f64, floor: i32) -> WorldTruth {
    WorldTruth { x_m, y_m, floor, ..WorldTruth::default() }
}

fn clean() -> Params {
    Params { sigma_m: 0.0, outlier_fraction: 0.0, drop_out_fraction: 0.0, ..Params::default() }
}

fn tag(params: Params) -> SimulatedTag {
    SimulatedTag::in_world(params, &world(), 3).unwrap()
}

fn read(tag: &mut SimulatedTag, truth: &WorldTruth) -> TagRanges {
    tag.see(Some(Stamped::new(at(5), truth)));
    tag.read(at(5)).unwrap()
}

#[track_caller]
fn check_heard(params: Params, at: (f64, f64, i32), expected: &[u32]) {
    let ranges = read(&mut tag(params), &truth(at.0, at.1, at.2));
    let ids: Vec<u32> = ranges.heard().iter().map(|anchor| anchor.id).collect();
    assert_eq!(ids, expected);
    assert_eq!((ranges.floor, ranges.has_position), (at.2, u32::from(expected.len() >= 3)));
}

#[test]
fn hears_the_four_nearest_of_its_floor_within_reach() {
    check_heard(clean(), (1.0, 0.0, 2), &[1, 2, 3, 4]);
    check_heard(clean(), (14.0, 0.0, 2), &[4, 3, 2, 1]);
    check_heard(Params { reach_m: 10.0, ..clean() }, (1.0, 0.0, 2), &[1, 2, 3]);
    check_heard(clean(), (55.0, 0.0, 2), &[5]);
    check_heard(clean(), (1.0, 0.0, 3), &[6]);
    check_heard(clean(), (1.0, 0.0, 9), &[]);
    check_heard(clean(), (f64::NAN, 0.0, 2), &[]);
    check_heard(Params { dead_anchors: vec![2], reach_m: 70.0, ..clean() }, (1.0, 0.0, 2), &[1, 3, 4, 5]);
    check_heard(Params { drop_out_fraction: 1.0, ..clean() }, (1.0, 0.0, 2), &[]);
}

#[test]
fn distances_are_those_in_space_from_the_antenna() {
    let ranges = read(&mut tag(clean()), &truth(0.0, 0.0, 2));
    // 3 m aside and 1.2 m up.
    assert!((ranges.anchors[0].range_m - 3.231).abs() < 1e-9, "{}", ranges.anchors[0].range_m);
    let ahead = Params { antenna_x_m: 1.0, ..clean() };
    let turned = WorldTruth { heading_rad: std::f64::consts::FRAC_PI_2, ..truth(0.0, 0.0, 2) };
    let ranges = read(&mut tag(ahead), &turned);
    assert!((ranges.anchors[0].range_m - 2.0f64.hypot(1.2)).abs() < 6e-4);
    assert_eq!((ranges.antenna_x_m, ranges.antenna_z_m), (1.0, 1.0));
}

#[test]
fn errors_are_as_many_and_as_large_as_the_parameters_say() {
    let params = Params { drop_out_fraction: 0.1, outlier_fraction: 0.05, ..Params::default() };
    let (mut tag, place) = (tag(params), truth(4.0, 1.0, 2));
    let exact = read(&mut self::tag(clean()), &place);
    let exact_m = |id: u32| exact.heard().iter().find(|anchor| anchor.id == id).unwrap().range_m;
    let frames: Vec<TagRanges> = (0..3000).map(|_| read(&mut tag, &place)).collect();
    let errors: Vec<f64> = frames
        .iter()
        .flat_map(|frame| frame.heard().iter().map(|a| a.range_m - exact_m(a.id)).collect::<Vec<_>>())
        .collect();
    let missing = 1.0 - errors.len() as f64 / 12_000.0;
    assert!((0.085..0.115).contains(&missing), "{missing}");
    let (wrong, right): (Vec<f64>, Vec<f64>) = errors.iter().partition(|error| error.abs() > 0.5);
    assert!((0.04..0.06).contains(&(wrong.len() as f64 / errors.len() as f64)));
    assert!((wrong.iter().sum::<f64>() / wrong.len() as f64 - 1.0).abs() < 0.03);
    let sigma = (right.iter().map(|error| error * error).sum::<f64>() / right.len() as f64).sqrt();
    assert!((0.097..0.103).contains(&sigma), "{sigma}");
    let qualities =
        frames.iter().flat_map(|frame| frame.heard().iter().map(|a| a.quality_percent).collect::<Vec<_>>());
    assert!(
        qualities.clone().all(|quality| (40.0..=90.0).contains(&quality))
            && qualities.clone().any(|quality| quality > 85.0)
    );
}

#[test]
fn the_modules_own_position_is_good_to_a_few_decimetres() {
    let mut tag = tag(Params::default());
    let mut errors: Vec<f64> = (0..500)
        .map(|step| {
            let place = truth(1.0 + f64::from(step) * 0.02, 0.5, 2);
            let ranges = read(&mut tag, &place);
            if ranges.has_position == 0 {
                return 0.0;
            }
            (Point2::new(ranges.x_m, ranges.y_m) - Point2::new(place.x_m, place.y_m)).norm()
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    assert!(errors[250] < 0.2 && errors[250] > 0.02 && errors[475] < 0.8, "{} {}", errors[250], errors[475]);
}

#[test]
fn silent_before_the_first_truth_and_after_the_last() {
    let mut driver = TagDriver::with_device(Box::new(tag(clean())));
    assert_eq!(driver.step(at(0), Inputs::default()).ranges, None);
    let place = truth(0.0, 0.0, 2);
    let inputs = Inputs { truth: Some(Stamped::new(at(100), &place)) };
    assert!(driver.step(at(600), inputs).ranges.is_some());
    assert_eq!(driver.step(at(601), inputs).ranges, None);
}

#[test]
fn one_seed_one_noise() {
    let run = |seed| {
        read(&mut SimulatedTag::in_world(Params::default(), &world(), seed).unwrap(), &truth(1.0, 0.0, 2))
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[track_caller]
fn refuse(params: Params, text: &str) {
    let error = TagDriver::new(params, 0).expect_err("must be refused").to_string();
    assert!(error.contains(text), "{error}");
}

#[test]
fn refuses_nonsense_with_names_and_values() {
    refuse(Params { period_ms: 50, ..Params::default() }, "`period_ms` is 50");
    refuse(Params { sigma_m: f64::NAN, ..Params::default() }, "`sigma_m` is not a finite number");
    refuse(Params { dead_anchors: vec![9], ..Params::default() }, "dead_anchors names 0x0009");
    refuse(Params { world: "nowhere.toml".into(), ..Params::default() }, "nowhere.toml");
    assert!(TagDriver::new(Params::default(), 0).is_ok());
}

proptest! {
    /// Without noise the module finds its place to the millimetre.
    #[test]
    fn exact_distances_give_the_exact_place(x in 0.0f64..15.0, y in -2.0f64..2.0) {
        let mut tag = tag(clean());
        let place = truth(x, y, 2);
        // The search begins where the module was last.
        let ranges = (0..3).map(|_| read(&mut tag, &place)).last().unwrap();
        prop_assert!((Point2::new(ranges.x_m, ranges.y_m) - Point2::new(x, y)).norm() < 0.01, "{} {}", ranges.x_m, ranges.y_m);
    }

    /// Whatever the truth claims, the message stays readable.
    #[test]
    fn messages_stay_possible(x in any::<f64>(), y in any::<f64>(), heading in any::<f64>(), floor in any::<i32>()) {
        let ranges = read(&mut tag(Params::default()), &WorldTruth { heading_rad: heading, ..truth(x, y, floor) });
        prop_assert!(ranges.x_m.is_finite() && ranges.y_m.is_finite());
        prop_assert!(ranges.heard().iter().all(|anchor| anchor.range_m.is_finite() && anchor.range_m >= 0.0));
    }
}
