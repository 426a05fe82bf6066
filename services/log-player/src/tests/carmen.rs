//! CARMEN's lines in every version, and its clocks.

use super::carmen_log as read;
use crate::*;
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write as _;

/// So many ranges of 2 m, as a line holds them.
fn beams(count: usize) -> String {
    format!("{count}{}", " 2.00".repeat(count))
}

fn odom(x: f64, at_s: f64) -> String {
    format!("ODOM {x} 0 0 0.1 0 0 {at_s} h {at_s}\n")
}

fn flaser(x: f64, at_s: f64) -> String {
    format!("FLASER {} {x} 0 0 {x} 0 0 {at_s} h {at_s}\n", beams(181))
}

fn told(log: &Log) -> Vec<String> {
    let problems = log.problems.iter().map(ToString::to_string);
    problems.chain(log.remarks.iter().map(ToString::to_string)).collect()
}

#[track_caller]
fn says(log: &Log, words: &str) {
    assert!(told(log).iter().any(|line| line.contains(words)), "{words:?} is not told: {:#?}", told(log));
}

/// Sensor, first beam, step and maximum range of every scan, of which there are some and all alike.
#[track_caller]
fn scans(log: &Log, count: usize) -> (Pose2, f64, f64, Option<f64>) {
    let found: Vec<_> = log
        .entries
        .iter()
        .filter_map(|entry| match &entry.record {
            Record::Scan { sensor, angle_min_rad, angle_step_rad, range_max_m, .. } => {
                Some((*sensor, *angle_min_rad, *angle_step_rad, *range_max_m))
            }
            _ => None,
        })
        .collect();
    assert_eq!(found.len(), count, "{:#?}", told(log));
    assert!(found.iter().all(|scan| *scan == found[0]));
    found[0]
}

fn truths(log: &Log) -> Vec<Pose2> {
    let truth = |entry: &Entry| match entry.record {
        Record::Truth(pose) => Some(pose),
        _ => None,
    };
    log.entries.iter().filter_map(truth).collect()
}

/// A line with directions: settings, then 181 beams, then the rest.
fn robot_laser(keyword: &str, settings: &str, rest: &str) -> String {
    format!("{keyword} {settings} {} {rest} 10.5 h 10.5\n", beams(181))
}

#[track_caller]
fn check_version(settings: &str, rest: &str) {
    let log = read(&(odom(1.0, 10.0) + &robot_laser("ROBOTLASER1", settings, rest)));
    assert_eq!(log.problems, [], "{settings} {rest}");
    let (sensor, first, step, range_max_m) = scans(&log, 1);
    assert!((sensor.x_m - 0.2).abs() < 1e-9 && sensor.heading_rad == 0.0, "{sensor:?}");
    assert_eq!((first, step, range_max_m), (-1.55, 0.017453, Some(40.0)));
    assert_eq!(truths(&log), [Pose2::new(1.0, 2.0, 0.0)]);
}

#[test]
fn lines_with_directions_are_read_in_every_version() {
    let (new, old) = ("0 -1.55 3.141593 0.017453 40 0.01 0", "0 -1.55 3.141593 0.017453 40 0.01");
    let poses = "1.2 2 0 1 2 0";
    for settings in [new, old] {
        for strengths in ["0 ", "3 0.5 0.6 0.7 ", ""] {
            check_version(settings, &format!("{strengths}{poses} 0 0 0.5 0.3 0.2"));
        }
        check_version(settings, &format!("3 0.5 0.6 0.7 {poses} 0 0 0.5 0.3"));
    }
    // As CARMEN's manual shows it: a robot at (1, 2), and the laser in its middle.
    let log = read(&robot_laser("ROBOTLASER1", new, "0 1 2 0 1 2 0 0 0 0.5 0.3 0.2").repeat(3));
    assert_eq!(scans(&log, 3).0, Pose2::IDENTITY);
    says(&log, "it has no lines ODOM; the odometry is taken from ROBOTLASER1");
    assert_eq!(log.entries.iter().filter(|entry| matches!(entry.record, Record::Odometry(_))).count(), 3);
}

#[test]
fn lines_without_poses_are_read_too() {
    let param = "PARAM robot_frontlaser_offset 0.3 nohost 0\nPARAM robot_rearlaser_offset -0.2 nohost 0\n";
    for settings in ["0 -2.35 4.7 0.0261111 30 0.01 0", "0 -2.35 4.7 0.0261111 30 0.01"] {
        for strengths in [" 0", " 2 0.5 0.6", ""] {
            let line = format!("RAWLASER1 {settings} {}{strengths} 10.5 h 10.5\n", beams(181));
            let log = read(&(param.to_owned() + &odom(0.0, 10.0) + &line));
            assert_eq!(log.problems, [], "{settings}{strengths}");
            assert_eq!(scans(&log, 1), (Pose2::new(0.3, 0.0, 0.0), -2.35, 0.0261111, Some(30.0)));
            assert_eq!(truths(&log), []);
        }
    }
    let log = read(&(param.to_owned() + &odom(0.0, 10.0) + &format!("LASER3 {} 10.5 h 10.5\n", beams(361))));
    assert_eq!(scans(&log, 1), (Pose2::new(0.3, 0.0, 0.0), -FRAC_PI_2, 0.5_f64.to_radians(), None));
    let log = read(
        &(param.to_owned()
            + &odom(0.0, 10.0)
            + &format!("RAWLASER2 0 -1.5 3 0 30 0.01 0 {} 0 10.5 h 10.5\n", beams(31))),
    );
    // A step of nothing is the field of view's.
    assert_eq!(scans(&log, 1), (Pose2::new(-0.2, 0.0, PI), -1.5, 0.1, Some(30.0)));
}

#[track_caller]
fn left_out(line: &str, words: &str) {
    let log = read(&(odom(0.0, 10.0) + line + "\n" + &odom(1.0, 10.1)));
    assert_eq!((log.entries.len(), log.problem_count), (2, 1), "{line}");
    assert!(log.problems[0].to_string().starts_with("line 2: "), "{}", log.problems[0]);
    says(&log, words);
}

#[test]
fn a_wrong_count_of_beams_leaves_the_line_out() {
    left_out("FLASER 180 2 2 2 1 2 0 1 2 0 10.0 h 10.0", "FLASER needs 191 words, and there are 14");
    left_out(
        &format!("FLASER 180{} 1 2 0 1 2 0 10.0 h 10.0", " 2".repeat(181)),
        "FLASER needs 191 words, and there are 192",
    );
    left_out(
        &format!("FLASER 180{} 1 2 0 1 2 0 10.0 h 10.0", " 2".repeat(179)),
        "FLASER needs 191 words, and there are 190",
    );
    left_out("FLASER 0 1 2 0 1 2 0 10.0 h 10.0", "FLASER: 0 beams are none");
    left_out("FLASER 1e9 1 2 0 1 2 0 10.0 h 10.0", "1000000000 beams are none, or more than 10000");
    left_out("FLASER 2 2 x 1 2 0 1 2 0 10.0 h 10.0", "FLASER: `x` is not a number");
    left_out("FLASER 2 2 2 nan 2 0 1 2 0 10.0 h 10.0", "FLASER: `nan` is not a number");
    left_out(
        "RAWLASER1 0 -1.57 3.14 9 80 0.01 0 3 2 2 2 0 10.0 h 10.0",
        "from -1.57 rad on every 9 rad: no laser looks so",
    );
    left_out("RAWLASER1 0 -1.57 0 0 80 0.01 0 3 2 2 2 0 10.0 h 10.0", "every 0 rad: no laser looks so");
    left_out("RAWLASER1 0 -90 180 1 80 0.01 0 3 2 2 2 0 10.0 h 10.0", "from -90 rad on");
    left_out("TRUEPOS 1 2 0 1 2 10.0 h 10.0", "TRUEPOS needs 10 words, and there are 9");
}

#[test]
fn a_wrong_count_in_a_line_with_directions_leaves_it_out() {
    let settings = "0 -1.57 3.14 1.57 80 0.01 0";
    let good = format!("ROBOTLASER1 {settings} 3 2 2 2 0 1 2 0 1 2 0 0 0 0.5 0.3 0.2 10.0 h 10.0\n");
    for wrong in [
        good.replace(" 3 2 2 2 ", " 4 2 2 2 "),
        good.replace(" 3 2 2 2 ", " 3 2 2 2 2 "),
        good.replace(" 0 0 0.5", " 0.5"),
    ] {
        let log = read(&(good.repeat(2) + &wrong + &good));
        assert_eq!(scans(&log, 3).1, -1.57);
        assert_eq!(log.problem_count, 1, "{wrong}");
        says(&log, "line 3: ROBOTLASER1 of ");
        says(&log, "words does not fit its count of beams");
        assert!(truths(&log).iter().all(|truth| *truth == Pose2::new(1.0, 2.0, 0.0)));
    }
    let good = format!("RAWLASER1 {settings} 3 2 2 2 0 10.0 h 10.0\n");
    let log = read(&(good.repeat(2) + &good.replace(" 3 2", " 4 2")));
    scans(&log, 2);
    says(&log, "line 3: RAWLASER1 of 16 words");
}

#[test]
fn beams_without_an_echo_keep_their_scan() {
    for line in [
        "FLASER 5 inf nan -inf 0 2 1 2 0 1 2 0 10.0 h 10.0\n",
        "ROBOTLASER1 0 -1.57 3.14 0.5 80 0.01 0 5 INF NaN -Infinity -0 2 0 1 2 0 1 2 0 0 0 0.5 0.3 0.2 10.0 h 10.0\n",
        "RAWLASER1 0 -1.57 3.14 0.5 80 0.01 0 5 +inf -nan -1.#INF 0 2.000 0 10.0 h 10.0\n",
    ] {
        let log = read(line);
        assert_eq!(log.problems, []);
        let ranges = log.entries.iter().find_map(|entry| match &entry.record {
            Record::Scan { ranges_m, .. } => Some(ranges_m.iter().map(f32::to_string).collect::<Vec<_>>()),
            _ => None,
        });
        let ranges: Vec<String> = ranges.unwrap().iter().map(|range| range.replace("-0", "0")).collect();
        assert_eq!(ranges, ["inf", "NaN", "-inf", "0", "2"], "{line}");
    }
}

#[test]
fn one_laser_is_played_and_the_others_are_counted() {
    let settings = "0 -1.55 3.141593 0.017453 40 0.01 0";
    let front = robot_laser("ROBOTLASER1", settings, "0 1 0 0 1 0 0 0 0 0.5 0.3 0.2");
    let rear = robot_laser("ROBOTLASER2", settings, "0 0.8 0 3.141592653589793 1 0 0 0 0 0.5 0.3 0.2");
    let raw = format!("RAWLASER1 {settings} {} 0 10.5 h 10.5\n", beams(181));
    let other = "SONAR 0.3 0 10.5 h 10.5\nXYZ 1\nNEFF 3 0.5\nSYNC start 10 h 10\n";
    let text = odom(1.0, 10.0) + &front.repeat(3) + &rear.repeat(2) + &raw.repeat(4) + other;
    let log = read(&text);
    assert_eq!(scans(&log, 3).0, Pose2::IDENTITY);
    says(&log, "its scans are those of 3 lines ROBOTLASER1; not read: 4 lines RAWLASER1");
    says(&log, "line 5: 2 lines ROBOTLASER2 are not read");
    says(&log, "line 11: 1 lines SONAR are not read");
    says(&log, "line 12: 1 lines XYZ are not read");
    says(&log, "1 lines NEFF, 1 lines SYNC hold nothing to be played");
    let choose = |laser| carmen::read_as(&text, &Params { laser, ..Params::default() });
    let log = choose(Laser::Rear);
    let sensor = scans(&log, 2).0;
    assert!((sensor.x_m + 0.2).abs() < 1e-9 && (sensor.heading_rad.abs() - PI).abs() < 1e-9, "{sensor:?}");
    says(&log, "3 lines ROBOTLASER1 are not read");
    let log = choose(Laser::Third);
    says(&log, "the log holds no scans of laser 3, which `laser` asks for");
    says(&log, "3 lines ROBOTLASER1 are not read");
    // The old lines with poses beat more of the new ones without.
    let log = read(&(odom(0.0, 10.0) + &flaser(0.0, 10.0) + &raw.repeat(2)));
    says(&log, "its scans are those of 1 lines FLASER; not read: 2 lines RAWLASER1");
    // To the rear alone is better than nothing.
    let log = read(&(odom(0.0, 10.0) + &flaser(0.0, 10.0).replace("FLASER", "RLASER")));
    says(&log, "its scans are those of 1 lines RLASER");
    scans(&log, 1);
}

#[track_caller]
fn check_beams(count: usize, more: &str, first_deg: f64, step_deg: f64, words: &str) {
    let log = read(&format!("{more}FLASER {} 0 0 0 0 0 0 10.0 h 10.0\n", beams(count)));
    let (_, first, step, _) = scans(&log, 1);
    assert!(
        (first.to_degrees() - first_deg).abs() < 1e-6 && (step.to_degrees() - step_deg).abs() < 1e-6,
        "{count}: {} {}",
        first.to_degrees(),
        step.to_degrees()
    );
    let remark = log.remarks.iter().find(|remark| matches!(remark, Remark::Beams { .. }));
    let remark = remark.map(|remark| (remark.is_doubtful(), remark.to_string()));
    match remark {
        Some((is_doubtful, remark)) => {
            assert!(is_doubtful && !words.is_empty() && remark.contains(words), "{remark}")
        }
        None => assert_eq!(words, "", "{count}"),
    }
}

#[test]
fn where_beams_look_that_do_not_say_it() {
    check_beams(180, "", -90.0, 1.0, "");
    check_beams(181, "", -90.0, 1.0, "");
    check_beams(360, "", -90.0, 0.5, "");
    check_beams(361, "", -90.0, 0.5, "");
    check_beams(401, "", -50.0, 0.25, "100 degrees wide");
    check_beams(541, "", -135.0, 0.5, "270 degrees wide");
    check_beams(
        1081,
        "",
        -135.0,
        0.25,
        "FLASER of 1081 beams does not say where they look; taken as 0.2500 degrees a beam",
    );
    check_beams(683, "", -341.0 * 360.0 / 1024.0, 360.0 / 1024.0, "as of a Hokuyo");
    check_beams(91, "", -90.0, 2.0, "as 180 degrees in all; say it by `laser_fov_rad`");
    check_beams(
        271,
        "PARAM laser_front_laser_resolution 1.0 1234.5 robot 1234.5\n",
        -135.0,
        1.0,
        "as a PARAM line says",
    );
    check_beams(271, "PARAM laser_laser1_resolution 0.5 nohost 0\n", -67.5, 0.5, "as a PARAM line says");
    check_beams(91, "PARAM laser_front_laser_resolution fine nohost 0\n", -90.0, 2.0, "180 degrees in all");
    let text = format!("FLASER {} 0 0 0 0 0 0 10.0 h 10.0\n", beams(91));
    let log = carmen::read_as(&text, &Params { laser_fov_rad: FRAC_PI_2, ..Params::default() });
    assert!((scans(&log, 1).1 + 0.25 * PI).abs() < 1e-9);
    assert!(!log.remarks.iter().any(|remark| matches!(remark, Remark::Beams { .. })));
    let log = read(&(text + "PARAM robot_front_laser_max 30 nohost 0\n"));
    assert_eq!(scans(&log, 1).3, Some(30.0));
}

#[test]
fn poses_that_were_corrected_later_say_nothing_of_where_the_laser_sits() {
    let line =
        |x: f64, odom_x: f64, at: f64| format!("FLASER {} {x} 0 0 {odom_x} 0 0 {at} h {at}\n", beams(181));
    let param = "PARAM robot_frontlaser_offset 0.5 nohost 0\n";
    let log = read(&(param.to_owned() + &line(1.5, 1.0, 1.0) + &line(2.5, 1.9, 2.0)));
    says(&log, "was corrected later");
    assert_eq!(scans(&log, 2).0, Pose2::new(0.5, 0.0, 0.0));
    assert_eq!(truths(&log), [Pose2::new(1.0, 0.0, 0.0), Pose2::new(2.0, 0.0, 0.0)]);
    // The raw poses are the odometry, for there is no other.
    assert!(log.entries.iter().any(|entry| entry.record == Record::Odometry(Pose2::new(1.9, 0.0, 0.0))));
}

#[test]
fn a_simulators_truth_is_the_truth() {
    let truth = "TRUEPOS 7 8 0.5 1 0 0 10.2 h 10.2\n";
    let log = read(&(odom(1.0, 10.0) + truth + &flaser(1.0, 10.3)));
    assert_eq!(truths(&log), [Pose2::new(7.0, 8.0, 0.5)]);
    // It is not a scan's, and is played whichever scans are.
    let params =
        Params { format: Format::Carmen, scans: Scans::Odd, start_delay_s: 0.0, ..Params::default() };
    let mut player = LogPlayer::new(&params, log).unwrap();
    player.step(Time::from_nanos(1));
    let played = player.step(Time::from_secs_f64(100.0));
    assert!(
        played.iter().any(|due| matches!(due, Due::Truth(_)))
            && !played.iter().any(|due| matches!(due, Due::Scan(..)))
    );
}

/// When each odometry and each scan is played, of pairs with these two stamps.
fn played(pairs: &[(f64, f64)]) -> (Vec<f64>, Log) {
    let text: String =
        pairs.iter().enumerate().map(|(x, (a, b))| odom(x as f64, *a) + &flaser(x as f64, *b)).collect();
    let log = read(&text);
    let readings = log.entries.iter().filter(|entry| !matches!(entry.record, Record::Truth(_)));
    (readings.map(|entry| entry.at_s).collect(), log)
}

#[track_caller]
fn check_pace(pairs: &[(f64, f64)], length_s: f64, problems: &[&str]) {
    let (times, log) = played(pairs);
    assert_eq!(times.len(), 2 * pairs.len());
    assert!(
        (times[times.len() - 1] - length_s).abs() < 0.02,
        "{} s: {:?}",
        times[times.len() - 1],
        told(&log)
    );
    // No two lines of a kind come at once.
    let odometry: Vec<f64> = log
        .entries
        .iter()
        .filter(|entry| matches!(entry.record, Record::Odometry(_)))
        .map(|entry| entry.at_s)
        .collect();
    assert!(odometry.windows(2).all(|pair| pair[1] - pair[0] > 0.05), "{odometry:?}");
    assert_eq!(log.problem_count, problems.len(), "{:#?}", told(&log));
    problems.iter().for_each(|words| says(&log, words));
}

/// Forty pairs, a tenth of a second apart, with the clock changed by `change` from the 21st on.
fn with_jump(change: impl Fn(usize, f64) -> f64) -> Vec<(f64, f64)> {
    (0..40)
        .map(|index| {
            let at = 1000.0 + 0.1 * index as f64;
            (change(index, at), change(index, at + 0.05))
        })
        .collect()
}

#[test]
fn a_clock_that_jumps_does_not_stop_the_play() {
    let set_back = |by: f64| with_jump(move |index, at| if index < 20 { at } else { at - by });
    check_pace(&set_back(0.0), 3.95, &[]);
    check_pace(
        &set_back(100.0),
        3.95,
        &["line 41: the clock jumps by -99.9 s; the play goes on after the usual 0.1 s"],
    );
    check_pace(&set_back(5.0), 3.95, &["line 41: the clock jumps by -4.9 s"]);
    check_pace(&set_back(1e9), 3.95, &["line 41: the clock jumps by -999999999.9 s"]);
    // From 1970, when the network's time arrives.
    check_pace(&set_back(-1.7e9), 3.95, &["line 41: the clock jumps by 1700000000.1 s"]);
    let early = with_jump(|index, at| if index < 3 { at - 995.0 } else { at + 1.7e9 });
    check_pace(&early, 3.95, &["line 7: the clock jumps by"]);
    // Twice, and back again.
    let twice = with_jump(|index, at| if (10..30).contains(&index) { at - 500.0 } else { at });
    check_pace(
        &twice,
        3.95,
        &["line 21: the clock jumps by -499.9 s", "line 61: the clock jumps by 500.1 s"],
    );
    // A single garbled stamp, far ahead or far behind.
    for wrong in [5e8, 2000.0, 3.0, -1e12] {
        let mut pairs = set_back(0.0);
        pairs[20].0 = wrong;
        check_pace(&pairs, 3.95, &["line 41: the clock jumps by", "line 42: the clock jumps by"]);
    }
}

#[test]
fn a_pause_is_a_pause() {
    let paused = |by: f64| with_jump(move |index, at| if index < 20 { at } else { at + by });
    check_pace(&paused(30.0), 33.95, &[]);
    check_pace(&paused(3600.0), 3603.95, &["line 41: nothing was recorded for 3600.05 s before this line"]);
}

#[test]
fn a_little_disorder_is_none() {
    // Half a second that comes twice is lost; what was written in the wrong order is played in the right one.
    let (times, log) = played(&with_jump(|index, at| if index < 20 { at } else { at - 0.5 }));
    assert_eq!(log.problems, []);
    assert!((times[79] - 3.45).abs() < 0.02);
    let (times, log) = played(&with_jump(|_, at| at).iter().map(|(a, b)| (*a, b - 0.1)).collect::<Vec<_>>());
    assert_eq!(log.problems, []);
    says(&log, "it is played by the logger's time stamps");
    assert!((times[79] - 3.9).abs() < 0.02, "{}", times[79]);
}

#[test]
fn two_computers_may_have_two_clocks() {
    let pairs: Vec<(f64, f64)> = with_jump(|_, at| at).iter().map(|(a, b)| (*a, b + 700.0)).collect();
    let (times, log) = played(&pairs);
    assert_eq!(log.problem_count, 1, "{:?}", told(&log));
    assert!((times[79] - 3.9).abs() < 0.06, "{}", times[79]);
}

#[test]
fn which_times_are_used_is_said() {
    let line = |x: f64, message: f64, logger: f64| format!("ODOM {x} 0 0 0 0 0 {message} h {logger}\n");
    let text = |stamp: fn(f64) -> (f64, f64)| -> String {
        let mut text = String::new();
        for index in 0..30 {
            let (message, logger) = stamp(f64::from(index));
            let _ = text.write_str(&line(f64::from(index), message, logger));
        }
        text
    };
    let last = |log: &Log| log.entries[29].at_s;
    let log = read(&text(|index| (0.2 * index, 0.1 * index)));
    says(&log, "it is played by the logger's time stamps");
    assert!((last(&log) - 2.9).abs() < 1e-9);
    let log = read(&text(|index| (1e9 + 0.2 * index, 0.0)));
    says(
        &log,
        "it is played by the messages' own time stamps, as those of the logger do not tell the lines apart",
    );
    assert!((last(&log) - 5.8).abs() < 1e-6);
    let log = read(&text(|_| (1.13486e9, 1.13486e9)));
    says(
        &log,
        "the order of its lines, one each 0.1 s, as its time stamps do not tell them apart (0 of 29 steps lead forward",
    );
    assert!(log.remarks.iter().any(Remark::is_doubtful));
    assert!((last(&log) - 2.9).abs() < 1e-9);
    let asked = read_carmen(&text(|index| (index, index)), Timing::Order, 0.5);
    assert!((last(&asked) - 14.5).abs() < 1e-9);
    assert!(!asked.remarks.iter().any(Remark::is_doubtful));
}

proptest::proptest! {
    #[test]
    fn any_line_is_survived(
        lines in proptest::collection::vec(
            (0..10_usize, proptest::collection::vec(proptest::prop_oneof![proptest::num::f64::ANY, -3.0..200.0_f64, proptest::sample::select(vec![0.0, 1.0, 2.0, 3.0, 180.0])], 0..40)),
            0..30,
        ),
    ) {
        let keywords = ["ODOM", "FLASER 2", "ROBOTLASER1 0 -1.5 3 0.1 80 0.01 0 2", "RAWLASER1 0 -1.5 3 0.1 80 0.01 0 2", "TRUEPOS", "PARAM laser_front_laser_resolution", "ROBOTLASER1", "RAWLASER2", "LASER3 3", "RLASER 2"];
        let text: String = lines.iter().map(|(keyword, numbers)| {
            let words: Vec<String> = numbers.iter().map(|number| format!("{number:e}")).collect();
            format!("{} {}\n", keywords[*keyword], words.join(" "))
        }).collect();
        for laser in [Laser::Auto, Laser::Rear, Laser::Third] {
            let log = carmen::read_as(&text, &Params { laser, ..Params::default() });
            proptest::prop_assert!(log.entries.windows(2).all(|pair| pair[0].at_s <= pair[1].at_s));
            proptest::prop_assert!(log.entries.iter().all(|entry| entry.at_s.is_finite() && entry.at_s >= 0.0));
            let mut player = LogPlayer::new(&Params { format: Format::Carmen, ..Params::default() }, log).unwrap();
            player.step(Time::ZERO);
            player.step(Time::from_secs_f64(1e9));
        }
    }
}

fn odometry(log: &Log) -> Vec<f64> {
    let ways = log.entries.iter().filter_map(|entry| match entry.record {
        Record::Odometry(pose) => Some(pose.x_m),
        _ => None,
    });
    ways.collect()
}

/// Two metres driven, of which the wheels counted 0.8 m between one scan and the next, and the corrections
/// put 0.2 m beside them.
fn corrected() -> String {
    let mut text = odom(0.0, 1.0) + &odom(0.4, 2.0);
    for scan in 1..=5_u32 {
        let (at_m, at_s) = (f64::from(scan), f64::from(10 * scan));
        text += &flaser(at_m, at_s);
        text += &odom(at_m, at_s + 1.0);
        text += &odom(at_m + 0.5, at_s + 2.0);
        text += &odom(at_m + 0.8, at_s + 3.0);
    }
    text
}

#[test]
fn odometry_that_knows_the_truth_is_told_and_can_be_left_out() {
    let recorded = read(&corrected());
    says(&recorded, "after 5 of 5 scans the odometry begins anew at the scan's pose");
    assert_eq!(odometry(&recorded)[2..5], [1.0, 1.5, 1.8]);

    let params = Params { odometry: OdometryLines::BetweenScans, ..Params::default() };
    let honest = carmen::read_as(&corrected(), &params);
    says(&honest, "5 steps to a scan's pose are left out");
    let wheels = odometry(&honest);
    let expected = [0.0, 0.4, 0.4, 0.9, 1.2, 1.2, 1.7, 2.0];
    assert!(
        wheels.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-12),
        "{wheels:?}"
    );
    // Where the robot really was stays what it was.
    assert_eq!(truths(&honest), truths(&recorded));

    // Raw odometry goes on from what it was before the scan.
    let raw = odom(0.0, 1.0) + &flaser(0.1, 2.0) + &odom(0.2, 3.0) + &flaser(0.3, 4.0) + &odom(0.4, 5.0);
    assert!(!told(&read(&raw)).iter().any(|line| line.contains("begins anew")));
}
