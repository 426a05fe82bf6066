//! The recorded drive in Malaga: 343 steps, three ultra-wideband beacons, one of which is wrong almost half
//! of the time.

use super::robot::{median, quantile};
use crate::*;
use messages::AnchorRange;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use std::io::Read;

/// Odometry's pose, the ranges by beacon, the truth.
struct Step {
    odometry: Pose2,
    ranges: Vec<(u32, f64)>,
    truth: Option<Pose2>,
}

/// Beacons in the frame of the truth, which lies at (1.99 m, 3.95 m, 0.007 rad) in theirs.
fn beacon(id: u32) -> [f64; 3] {
    let [x_m, y_m, z_m] = match id {
        1 => [0.21, -0.55, 1.94],
        2 => [6.71, -0.33, 1.04],
        _ => [6.7023, 4.3185, 1.33],
    };
    let at = Pose2::new(1.99, 3.95, 0.007).inverse_transform(geometry::Point2::new(x_m, y_m));
    [at.x, at.y, z_m]
}

fn recording() -> Vec<Step> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../launch/graphs/data/malaga/");
    let packed = std::fs::read(format!("{folder}log.txt.gz")).unwrap();
    let mut text = String::new();
    flate2::read::GzDecoder::new(&packed[..]).read_to_string(&mut text).unwrap();
    let mut steps: Vec<Step> = Vec::new();
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |index: usize| words[index].parse::<f64>().unwrap();
        match words[0] {
            "ODOM" => {
                let last = steps.last().map_or(Pose2::IDENTITY, |step| step.odometry);
                let odometry = last.compose(Pose2::new(number(2), number(3), number(4)));
                steps.push(Step { odometry, ranges: Vec::new(), truth: None });
            }
            "BEACON" => steps.last_mut().unwrap().ranges.push((number(2) as u32, number(3))),
            _ => {}
        }
    }
    for line in std::fs::read_to_string(format!("{folder}truth.txt")).unwrap().lines() {
        let numbers: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
        steps[numbers[0] as usize + 1].truth = Some(Pose2::new(numbers[1], numbers[2], numbers[3]));
    }
    steps
}

/// What is done to the recording before it is replayed.
#[derive(Debug, Clone, Copy, Default)]
struct Spoil {
    begin: usize,
    drop: f64,
    outliers: f64,
    noise_m: f64,
    without: u32,
    wheel_noise: f64,
}

struct Run {
    errors_m: Vec<f64>,
    unknown: usize,
    last: PoseEstimate,
    degraded: usize,
    /// Normalised squared errors, mean.
    consistency: f64,
}

fn replay(seed: u64, spoil: Spoil, params: Params) -> Run {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut localiser = TagLocaliser::new(params, HallwayWalls::default()).unwrap();
    let mut run = Run {
        errors_m: Vec::new(),
        unknown: 0,
        last: PoseEstimate::default(),
        degraded: 0,
        consistency: 0.0,
    };
    let (mut odometry, mut before) = (Pose2::IDENTITY, None::<Pose2>);
    for (index, step) in recording().iter().enumerate().skip(spoil.begin) {
        let now = Time::from_secs_f64(index as f64 * 1.05);
        let mut motion = before.map_or(Pose2::IDENTITY, |last| last.to(step.odometry));
        before = Some(step.odometry);
        let mut noisy =
            |value: f64| value * (1.0 + Normal::new(0.0, spoil.wheel_noise).unwrap().sample(&mut random));
        motion = Pose2::new(noisy(motion.x_m), noisy(motion.y_m), noisy(motion.heading_rad));
        odometry = odometry.compose(motion);
        let message = Odometry {
            x_m: odometry.x_m,
            y_m: odometry.y_m,
            heading_rad: odometry.heading_rad,
            ..Odometry::default()
        };
        let mut tag = TagRanges { antenna_x_m: 0.16, antenna_z_m: 1.12, ..TagRanges::default() };
        for &(id, range_m) in &step.ranges {
            let dropped = random.random::<f64>() < spoil.drop;
            let outlier = random.random::<f64>() < spoil.outliers;
            let elsewhere_m = random.random::<f64>() * 15.0;
            let noise_m = Normal::new(0.0, spoil.noise_m).unwrap().sample(&mut random);
            if dropped || id == spoil.without {
                continue;
            }
            let [x_m, y_m, z_m] = beacon(id);
            let range_m = if outlier { elsewhere_m } else { range_m + noise_m };
            tag.anchors[tag.anchor_count as usize] =
                AnchorRange { x_m, y_m, z_m, range_m, id, quality_percent: 100.0 };
            tag.anchor_count += 1;
        }
        let inputs = Inputs {
            odometry: Some(Stamped::new(now, &message)),
            tag: Some(Stamped::new(now, &tag)),
            ..Inputs::default()
        };
        run.last = localiser.step(now, inputs).pose;
        let Some(truth) = step.truth else { continue };
        match run.last.pose() {
            Ok(pose) => {
                run.errors_m.push(pose.distance_m(truth));
                let [xx, xy, _, _, yy, ..] = run.last.covariance;
                let (dx, dy) = (pose.x_m - truth.x_m, pose.y_m - truth.y_m);
                run.consistency += (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy);
            }
            Err(_) => run.unknown += 1,
        }
        run.degraded += usize::from(run.last.state == LocationStateName::Degraded);
    }
    run.consistency /= run.errors_m.len() as f64;
    run
}

#[track_caller]
fn check(spoil: Spoil, median_m: f64, most_m: f64, most_unknown: usize) {
    let seeds =
        if spoil.drop + spoil.outliers + spoil.noise_m + spoil.wheel_noise > 0.0 { 1..=5 } else { 1..=1 };
    for seed in seeds {
        let run = replay(seed, spoil, Params::default());
        let (middle_m, high_m) = (median(&run.errors_m), quantile(&run.errors_m, 0.95));
        println!(
            "{spoil:?} seed {seed}: median {middle_m:.3} m, 95 % {high_m:.3} m, most {:.3} m, unknown {}, degraded {}, consistency {:.2}, accepted {}, rejected {}",
            quantile(&run.errors_m, 1.0),
            run.unknown,
            run.degraded,
            run.consistency,
            run.last.accepted,
            run.last.rejected
        );
        assert!(
            middle_m <= median_m && high_m <= most_m && run.unknown <= most_unknown,
            "{spoil:?}, seed {seed}"
        );
    }
}

#[test]
fn the_drive_as_recorded() {
    check(Spoil::default(), 0.25, 0.8, 20);
    let run = replay(1, Spoil::default(), Params::default());
    assert!((100..250).contains(&run.last.rejected), "{}", run.last.rejected);
    assert!(run.last.accepted > 700, "{}", run.last.accepted);
    assert!(run.degraded > 60 && run.degraded < 250, "{}", run.degraded);
}

#[test]
fn the_drive_from_other_beginnings() {
    for begin in [30, 60, 100, 150, 200, 250, 280] {
        check(Spoil { begin, ..Spoil::default() }, 0.25, 0.8, 25);
    }
}

#[test]
fn the_drive_made_harder() {
    check(Spoil { drop: 0.5, ..Spoil::default() }, 0.25, 0.8, 30);
    check(Spoil { outliers: 0.2, ..Spoil::default() }, 0.25, 0.8, 30);
    check(Spoil { noise_m: 0.1, ..Spoil::default() }, 0.25, 0.8, 30);
    check(Spoil { wheel_noise: 0.1, ..Spoil::default() }, 0.25, 0.8, 30);
    check(Spoil { without: 1, ..Spoil::default() }, 0.25, 0.8, 60);
    check(Spoil { drop: 0.3, outliers: 0.1, noise_m: 0.05, ..Spoil::default() }, 0.30, 0.9, 40);
}

#[test]
fn the_drive_from_a_known_start() {
    let start = Start { x_m: 0.0, y_m: 0.0, heading_rad: 0.0, sigma_m: 0.2, sigma_rad: 0.1, floor: 0 };
    let run = replay(1, Spoil::default(), Params { start: Some(start), ..Params::default() });
    assert_eq!(run.unknown, 0);
    assert!(median(&run.errors_m) <= 0.25 && quantile(&run.errors_m, 0.95) <= 0.8);
}
