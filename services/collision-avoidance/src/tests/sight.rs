//! Time-of-flight sensors that cannot see, and say "nothing there".

use super::*;

/// The last word of a guard that has driven for ten seconds, a step of so many metres a frame, with these
/// frames.
#[track_caller]
fn check_seen(step_m: f64, ranges: impl Fn(u32) -> TofRanges, expected: Why) {
    let mut bench = Bench::new(Params::default());
    for frame in 0..100 {
        bench.drive(step_m);
        bench.feed(&ranges(frame));
    }
    assert_eq!(bench.said.reason.get(), Ok(expected), "{:?}", bench.said);
    let faulty = expected == Why::SensorFault;
    assert_eq!(faulty, bench.said.front_m == 0.0 || bench.said.right_m == 0.0 || bench.said.left_m == 0.0);
}

/// A frame whose readings differ a little from one to the next, as those of real sensors do.
fn noisy(frame: u32, range_m: f32) -> TofRanges {
    everywhere(range_m + 0.001 * (frame % 7) as f32)
}

/// The same with the given sensors telling something else.
fn with(mut ranges: TofRanges, sensors: &[usize], status: u32) -> TofRanges {
    for &sensor in sensors {
        ranges.status[sensor] = RangeStatus(status);
    }
    ranges
}

#[test]
fn scattered_light_is_no_emptiness() {
    const ALL: [usize; 8] = [0, 1, 2, 3, 4, 5, 6, 7];
    for scatter in [1, 2] {
        check_seen(0.0, |frame| with(noisy(frame, 1.0), &ALL, scatter), Why::SensorFault);
        check_seen(0.0, |frame| with(noisy(frame, 1.0), &[2, 3, 4, 5], scatter), Why::SensorFault);
        check_seen(0.0, |frame| with(noisy(frame, 1.0), &[2, 3, 4], scatter), Why::SensorFault);
        check_seen(0.0, |frame| with(noisy(frame, 1.0), &[0, 1], scatter), Why::SensorFault);
        check_seen(0.0, |frame| with(noisy(frame, 1.0), &[6, 7], scatter), Why::SensorFault);
        // One sensor of a face makes up for another.
        check_seen(0.0, |frame| with(noisy(frame, 1.0), &[2, 5], scatter), Why::Clear);
        check_seen(0.0, |frame| with(noisy(frame, 1.0), &[0, 7], scatter), Why::Clear);
        // Now and then a sensor of an empty face has bad luck.
        let rarely = |frame: u32| if frame.is_multiple_of(4) { scatter } else { 4 };
        check_seen(0.0, |frame| with(noisy(frame, 1.0), &ALL, rarely(frame)), Why::Clear);
    }
    check_seen(0.0, |frame| with(noisy(frame, 1.0), &ALL, 1 + frame % 2), Why::SensorFault);
    check_seen(0.0, |frame| with(noisy(frame, 1.0), &ALL, 4), Why::Clear);
}

#[test]
fn no_news_for_ever_is_a_stop() {
    for status in [7, 10, 255] {
        for sensor in 0..8 {
            check_seen_stale(|frame| with(noisy(frame, 1.0), &[sensor], status));
        }
    }
}

#[track_caller]
fn check_seen_stale(ranges: impl Fn(u32) -> TofRanges) {
    let mut bench = Bench::new(Params::default());
    for frame in 0..3 {
        bench.feed(&noisy(frame, 1.0));
    }
    bench.expect(Verdict::Go, Why::Clear);
    for frame in 0..10 {
        bench.feed(&ranges(frame));
    }
    bench.expect(Verdict::Stop, Why::Stale);
}

#[test]
fn a_sensor_that_never_sees_what_its_neighbour_sees_is_blind() {
    // Nearer than a neighbour must see it, and farther than what is remembered when it vanishes.
    let beside_a_wall = |frame, blind: &[usize]| with(noisy(frame, 0.45), blind, 4);
    for sensor in 0..8 {
        check_seen(0.03, |frame| beside_a_wall(frame, &[sensor]), Why::SensorFault);
        // A robot that stands may well look past something.
        check_seen(0.0, |frame| beside_a_wall(frame, &[sensor]), Why::Clear);
        let now_and_then = [sensor];
        let blind = |frame: u32| if frame.is_multiple_of(20) { &[][..] } else { &now_and_then[..] };
        check_seen(0.03, |frame| beside_a_wall(frame, blind(frame)), Why::Clear);
    }
    // Nothing is near anybody.
    check_seen(0.03, |frame| with(noisy(frame, 2.0), &[3], 4), Why::Clear);
}

#[test]
fn readings_that_do_not_change_while_the_robot_drives_are_old_ones() {
    check_seen(0.03, |_| everywhere(0.7), Why::SensorFault);
    check_seen(0.0, |_| everywhere(0.7), Why::Clear);
    check_seen(0.03, |_| everywhere(FAR), Why::Clear);
    check_seen(0.03, |_| frame([0.3, 0.3, FAR, FAR, FAR, FAR, 0.9, 0.9]), Why::Clear);
    check_seen(0.03, |frame| noisy(frame, 0.7), Why::Clear);
}

#[test]
fn a_blind_sensor_that_sees_again_is_believed_again() {
    let mut bench = Bench::new(Params::default());
    for frame in 0..100 {
        bench.drive(0.03);
        bench.feed(&with(noisy(frame, 0.3), &[1], 4));
    }
    bench.expect(Verdict::Stop, Why::SensorFault);
    for frame in 0..3 {
        bench.feed(&noisy(frame, 0.3));
    }
    bench.expect(Verdict::Go, Why::Clear);
}

#[test]
fn without_odometry_nobody_knows_that_a_sensor_is_blind() {
    let mut bench = Bench::new(Params::default());
    bench.odometry = None;
    for frame in 0..100 {
        bench.feed(&with(noisy(frame, 0.3), &[1], 4));
    }
    bench.expect(Verdict::Go, Why::Clear);
}

proptest! {
    /// Random walls around, random statuses for some sensors: a face is never said to be farther than the
    /// nearest distance that a sensor of it tells.
    #[test]
    fn no_face_is_said_to_be_farther_than_it_is(
        frames in prop::collection::vec((prop::array::uniform8(0.06_f32..1.5), prop::array::uniform8(prop_oneof![6 => Just(0_u32), 4 => 0_u32..14])), 1..30)
    ) {
        let mut bench = Bench::new(Params::default());
        for (range_m, status) in frames {
            let ranges = TofRanges { range_m, status: status.map(RangeStatus) };
            let said = bench.feed(&ranges);
            let nearest = |sensors: std::ops::Range<usize>| sensors.filter_map(|sensor| match ranges.reading(sensor) {
                Reading::Distance(m) => Some(m),
                Reading::Fault => Some(0.0),
                Reading::NoTarget | Reading::Ignore => None,
            }).fold(f32::INFINITY, f32::min);
            for (said_m, true_m) in [(said.front_m, nearest(2..6)), (said.right_m, nearest(0..2)), (said.left_m, nearest(6..8))] {
                prop_assert!(said_m <= true_m, "{said_m} m said, {true_m} m true");
            }
        }
    }
}
