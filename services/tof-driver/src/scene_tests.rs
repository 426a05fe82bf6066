//! The paper's obstacles, driven at (COF-121 to COF-126): what the sensors see of them from far to near.

use crate::tests::{HALLWAY, at, frame, sensors, silent_noise, truth};
use crate::{Params, TofDevice};
use messages::{BodyKind, Reading, Stamped, TofRanges, TrueBody};

/// The readings of some sensors while the robot drives along x at `y_m`, in steps of 4 cm, from `from_m` to
/// `to_m`.
fn drive(params: Params, furniture: &str, y_m: f64, from_m: f64, to_m: f64) -> Vec<(f64, TofRanges)> {
    let mut device = sensors(params, &format!("{HALLWAY}\n[[furniture]]\nfloor = 2\n{furniture}\n"));
    let steps = ((to_m - from_m) / 0.04).round() as u32;
    (0..=steps)
        .map(|step| {
            let x_m = from_m + f64::from(step) * 0.04;
            (x_m, frame(&mut device, &truth(x_m, y_m, 0.0)))
        })
        .collect()
}

/// From the robot's front edge, in metres, when it stands at `x_m`.
fn ahead_m(x_m: f64, obstacle_m: f64) -> f64 {
    obstacle_m - (x_m + 0.305)
}

fn sees_below(ranges: &TofRanges, sensor: usize, limit_m: f32) -> bool {
    matches!(ranges.reading(sensor), Reading::Distance(range_m) if range_m < limit_m)
}

#[test]
fn the_mail_carts_low_shelf_vanishes_at_close_range() {
    // Against the right wall, its front edge at x = 0; the robot close to the right wall, so that the two
    // sensors in the middle look between the bars (COF-122).
    let cart = "kind = \"mail-cart\"\npose = { x_m = 0.45, y_m = -0.60 }";
    let mut device = sensors(silent_noise(), &format!("{HALLWAY}\n[[furniture]]\nfloor = 2\n{cart}\n"));
    let mut share_seen = |edge_m: f64| {
        let place = truth(-0.305 - edge_m, -0.53, 0.0);
        f64::from((0..500).map(|_| u32::from(sees_below(&frame(&mut device, &place), 3, 0.9))).sum::<u32>())
            / 500.0
    };
    let (far, middle, close) = (share_seen(0.5), share_seen(0.25), share_seen(0.05));
    assert!(far > 0.6 && middle > 0.9, "the shelf is seen from afar: {far}, {middle}");
    assert!(close < 0.35, "and vanishes under the beam: {close}");
}

#[test]
fn the_pole_of_a_spinning_chair_flickers() {
    // The pole's front lies 0.35 m before sensor 4, the base below its cone: the sensor sees now the pole,
    // and now past it (COF-123).
    let chair = "kind = \"spinning-chair\"\npose = { x_m = 0.0, y_m = 0.0575 }";
    let mut device = sensors(silent_noise(), &format!("{HALLWAY}\n[[furniture]]\nfloor = 2\n{chair}\n"));
    let mut share_seen = |aside_m: f64| {
        let place = truth(-0.305 - 0.375, -aside_m, 0.0);
        f64::from((0..400).map(|_| u32::from(sees_below(&frame(&mut device, &place), 4, 0.42))).sum::<u32>())
            / 400.0
    };
    let (straight, edge, past) = (share_seen(0.0), share_seen(0.08), share_seen(0.14));
    assert!(
        (0.5..0.95).contains(&straight) && (0.3..0.9).contains(&edge) && past < 0.02,
        "{straight} {edge} {past}"
    );
}

#[test]
fn the_sofa_is_seen_steadily() {
    // Against the left wall, its right half in the way (COF-124).
    let sofa = "kind = \"sofa\"\npose = { x_m = 0.8, y_m = 0.45, heading_rad = -1.5707963 }";
    let run = drive(silent_noise(), sofa, 0.37, -1.2, -0.4);
    for (x_m, ranges) in &run {
        let expected_m = ahead_m(*x_m, 0.0);
        if (0.08..0.95).contains(&expected_m) {
            for sensor in [3, 4, 5] {
                let Reading::Distance(range_m) = ranges.reading(sensor) else {
                    panic!("sensor {sensor} at {x_m}")
                };
                assert!((f64::from(range_m) - expected_m).abs() < 0.02, "{range_m} instead of {expected_m}");
            }
        }
        assert!(sees_below(ranges, 7, 0.26), "series 8 sees the wall at about 200 mm");
    }
}

#[test]
fn a_wooden_chairs_legs_are_missed_from_some_sides() {
    let share = |y_m: f64| {
        let chair = format!("kind = \"wooden-chair\"\npose = {{ x_m = 0.0, y_m = {y_m} }}");
        let run = drive(silent_noise(), &chair, 0.0, -1.0, -0.65);
        let seen = run.iter().filter(|(_, ranges)| (2..6).any(|sensor| sees_below(ranges, sensor, 0.8)));
        seen.count() as f64 / run.len() as f64
    };
    let shares: Vec<f64> = (-6..=6).map(|step| share(f64::from(step) * 0.05)).collect();
    assert!(shares.iter().any(|&share| share > 0.9), "{shares:?}");
    assert!(shares.iter().any(|&share| share < 0.9), "{shares:?}");
}

#[test]
fn thin_things_pass_between_the_cones() {
    // A pole at 0.15 m ahead, between sensors 3 and 4: the cones meet only at 240 mm (COF-028).
    let pole = |y_m: f64| {
        let stick = format!(
            "kind = \"cardboard-box\"\nsize_m = [0.02, 0.02, 1.0]\npose = {{ x_m = 0.465, y_m = {y_m} }}"
        );
        let mut device = sensors(silent_noise(), &format!("{HALLWAY}\n[[furniture]]\nfloor = 2\n{stick}\n"));
        let place = truth(0.0, 0.0, 0.0);
        (0..50).any(|_| (2..6).any(|sensor| sees_below(&frame(&mut device, &place), sensor, 0.9)))
    };
    assert!(!pole(0.0));
    assert!(pole(0.0575));
}

#[test]
fn people_doors_and_elevators_are_where_the_truth_has_them() {
    let more = r#"
[[walker]]
name = "w"
floor = 2
path = [[5.0, 0.0]]
"#;
    let mut device = sensors(silent_noise(), &format!("{HALLWAY}{more}"));
    let person = |x_m: f64| TrueBody { x_m, floor: 2, kind: BodyKind::Walker.into(), ..TrueBody::default() };
    let mut front = |x_m: f64| {
        let place = truth(0.0, 0.0, 0.0);
        let bodies = [person(x_m)];
        device.see(Some(Stamped::with_elements(at(5), &place, &bodies)));
        let ranges = device.read(at(5)).unwrap();
        (2..6).any(|sensor| sees_below(&ranges, sensor, 0.9))
    };
    assert!(!front(5.0));
    assert!(front(0.8));
    assert!(!front(f64::NAN) || front(0.8), "a person who is nowhere stays where they were");
    // An open door is far away: noise, not a surface.
    let mut device = sensors(silent_noise(), HALLWAY);
    let closed = frame(&mut device, &truth(10.0, -0.35, 0.0));
    let open = frame(&mut device, &messages::WorldTruth { open_doors: [1, 0], ..truth(10.0, -0.35, 0.0) });
    assert_eq!((closed.reading(0), open.reading(0)), (Reading::Distance(0.345), Reading::NoTarget));
}
