mod carmen;

use crate::*;
use std::f64::consts::FRAC_PI_2;
use std::io::Write;

const STEPS: &str = "\
# a comment
ODOM 0 0 0 0
LASER 0 3.141593 0.1 0 0 3 1.0 2.0 81.0
BEACON 0 1 5.0 0.16 0 1.12
BEACON 0 2 6.0 0.16 0 1.12
ODOM 1 0.5 0 1.5707963267948966
BEACON 1 1 4.5 0.16 0 1.12
ODOM 2 0.5 0 0
";

const CARMEN: &str = "\
# message formats defined: PARAM SYNC ODOM FLASER
PARAM robot_length 0.5 nohost 0
ODOM 1 2 0.5 0.1 0.2 0 10.0 host 10.0
FLASER 3 1.0 2.0 3.0 7 8 0.25 1 2 0.5 10.5 host 10.5
NEFF 3 0.5
ODOM 1.5 2 0.5 0.1 0.2 0 11.0 host 11.0
";

fn steps(text: &str) -> Log {
    read_steps(text, "0 0 0 0\n1 0.25 0 1.5\n9 0 0 0\n", 1, 1.0)
}

fn carmen_log(text: &str) -> Log {
    read_carmen(text, Timing::Auto, 0.1)
}

fn anchors() -> Params {
    let anchor = |id, x_m, y_m| AnchorPlace { id, x_m, y_m, z_m: 2.0 };
    Params {
        anchors: vec![anchor(1, 1.0, 1.0), anchor(2, 4.0, 1.0)],
        map_in_anchor_frame: Pose { x_m: 1.0, y_m: 0.0, heading_rad: FRAC_PI_2 },
        start_delay_s: 0.0,
        ..Params::default()
    }
}

fn kinds(due: &[Due]) -> String {
    let letter = |one: &Due| match one {
        Due::Odometry(_) => 'o',
        Due::Tag(_) => 't',
        Due::Scan(..) => 's',
        Due::Truth(truth) if truth.is_last == 1 => 'L',
        Due::Truth(_) => 'T',
    };
    due.iter().map(letter).collect()
}

#[test]
fn a_log_in_steps_is_read() {
    let log = steps(STEPS);
    assert_eq!(log.problems, []);
    assert_eq!(log.entries.len(), 8);
    assert_eq!(
        log.entries[2].record,
        Record::Ranges { antenna_m: [0.16, 0.0, 1.12], heard: vec![(1, 5.0), (2, 6.0)] }
    );
    let Record::Scan { ranges_m, angle_min_rad, angle_step_rad, .. } = &log.entries[1].record else {
        panic!("{log:?}")
    };
    assert_eq!(ranges_m, &[1.0, 2.0, 81.0]);
    assert!((angle_min_rad + FRAC_PI_2).abs() < 1e-4 && (angle_step_rad - FRAC_PI_2).abs() < 1e-4);
    // The second step drives along the heading that the first has turned to.
    let Record::Odometry(last) = &log.entries[6].record else { panic!("{log:?}") };
    assert!((last.x_m - 0.5).abs() < 1e-9 && (last.y_m - 0.5).abs() < 1e-9);
}

#[test]
fn the_truth_comes_after_the_moment_and_before_the_next() {
    let log = steps(STEPS);
    let truths: Vec<f64> =
        log.entries.iter().filter(|one| matches!(one.record, Record::Truth(_))).map(|one| one.at_s).collect();
    assert_eq!(truths, [1.5, 2.5]);
}

#[test]
fn a_carmen_log_is_read() {
    let log = carmen_log(CARMEN);
    assert_eq!(log.problems, []);
    let times: Vec<f64> = log.entries.iter().map(|one| one.at_s).collect();
    assert_eq!(times, [0.0, 0.5, 0.75, 1.0]);
    assert_eq!(log.entries[2].record, Record::Truth(Pose2::new(7.0, 8.0, 0.25)));
}

#[test]
fn useless_stamps_give_way_to_the_order() {
    let text = "ODOM 0 0 0 0 0 0 1.13486e+09 h 1.13486e+09\n".repeat(5);
    let times: Vec<f64> = carmen_log(&text).entries.iter().map(|one| one.at_s).collect();
    assert!(
        times.iter().zip([0.0, 0.1, 0.2, 0.3, 0.4]).all(|(time, wanted)| (time - wanted).abs() < 1e-9),
        "{times:?}"
    );
}

#[track_caller]
fn check_fault(log: Log, whole: usize, line: usize, told: &str) {
    assert_eq!(log.entries.len(), whole, "{log:?}");
    assert_eq!(log.problem_count, 1);
    assert_eq!(log.problems[0].line, line);
    let text = log.problems[0].to_string();
    assert!(text.contains(told), "{text}");
}

#[test]
fn garbled_lines_are_named_and_left_out() {
    let with = |line: &str| read_steps(&STEPS.replace("BEACON 1 1 4.5 0.16 0 1.12", line), "", 1, 1.0);
    check_fault(with("BEACON 1 1 4."), 5, 7, "BEACON needs 7 words, and there are 4");
    check_fault(with("BEACON 1 1 4.5 0.16 0 1.12 7"), 5, 7, "BEACON needs 7 words, and there are 8");
    check_fault(with("BEACON 1 1 inf 0.16 0 1.12"), 5, 7, "`inf` is not a number");
    check_fault(with("ODOM 1 0 0 0 0"), 5, 7, "ODOM needs 5 words, and there are 6");
    check_fault(with("LASER 1 3.14 0 0 0 2 1.0 2.0 3.0"), 5, 7, "LASER needs 9 words, and there are 10");
    check_fault(with("LASER 1 3.14 0 0 0 2 1.0 x"), 5, 7, "`x` is not a number");
    check_fault(with("BEACON 1 1 4.5 0.16 0 abc"), 5, 7, "`abc` is not a number");
    check_fault(with("BEACON 1 1 NaN 0.16 0 1.12"), 5, 7, "`NaN` is not a number");
    check_fault(with("BEACON 1 -1 4.5 0.16 0 1.12"), 5, 7, "`-1` is not a number");
    check_fault(with("BEACON 0 1 4.5 0.16 0 1.12"), 5, 7, "BEACON of step 0 after step 1");
    check_fault(with("\u{fffd}\u{1}xx"), 5, 7, "begins no line of this format");
    check_fault(with("LASER 1 3.14 0 0 0 4 1.0 2.0"), 5, 7, "LASER needs 11 words, and there are 9");
    check_fault(with("LASER 1 3.14 0 0 0 1e9 1.0"), 5, 7, "1000000000 beams");
    let carmen_with =
        |line: &str| carmen_log(&CARMEN.replace("ODOM 1.5 2 0.5 0.1 0.2 0 11.0 host 11.0", line));
    check_fault(carmen_with("ODOM 1.5 2"), 3, 6, "ODOM needs 10 words");
    check_fault(
        carmen_with("ODOM 1.5 2 0.5 0.1 0.2 0 11.0 my host 11.0"),
        3,
        6,
        "ODOM needs 10 words, and there are 11",
    );
    check_fault(carmen_with("FLASER 180 1.0 2.0"), 3, 6, "FLASER needs 191 words");
    check_fault(carmen_with("FLASER x 1.0 2.0"), 3, 6, "`x` is not a number");
    check_fault(carmen_with("?"), 3, 6, "`?` begins no line");
}

#[test]
fn a_beam_without_an_echo_keeps_its_scan() {
    let log = steps(&STEPS.replace("3 1.0 2.0 81.0", "9 1.0 inf nan -inf 0 -2 1e9 1.#INF -1.#IND0  # beams"));
    assert_eq!(log.problems, []);
    let Record::Scan { ranges_m, .. } = &log.entries[1].record else { panic!("{log:?}") };
    let told: Vec<String> = ranges_m.iter().map(|range_m| range_m.to_string()).collect();
    assert_eq!(told, ["1", "inf", "NaN", "-inf", "0", "-2", "1000000000", "inf", "NaN"]);
}

#[test]
fn a_mark_before_the_first_line_is_no_word() {
    let log = read_steps(&format!("\u{feff}{STEPS}"), "\u{feff}0 0 0 0\n", 1, 1.0);
    assert_eq!((log.problems.len(), log.entries.len()), (0, 7));
    let log = carmen_log(&format!(
        "\u{feff}{}",
        CARMEN.trim_start_matches(
            "# message formats defined: PARAM SYNC ODOM FLASER\nPARAM robot_length 0.5 nohost 0\n"
        )
    ));
    assert_eq!((log.problems.len(), log.entries.len()), (0, 4));
}

#[test]
fn the_schedule_follows_the_speed() {
    let mut player =
        LogPlayer::new(&Params { speed: 10.0, start_delay_s: 0.2, ..anchors() }, steps(STEPS)).unwrap();
    let begun = Time::from_secs_f64(100.0);
    let mut at = |second: f64| kinds(player.step(begun.after(Duration::from_secs_f64(second))));
    assert_eq!(at(0.0), "");
    assert_eq!(at(0.19), "");
    assert_eq!(at(0.2), "ost");
    assert_eq!(at(0.29), "");
    assert_eq!(at(0.301), "ot");
    assert_eq!(at(0.41), "To");
    assert_eq!(at(0.46), "L");
    assert!(player.is_finished());
    assert_eq!(kinds(player.step(begun.after(Duration::from_secs(9)))), "");
}

#[test]
fn a_late_step_plays_everything_in_order() {
    let mut player = LogPlayer::new(&anchors(), steps(STEPS)).unwrap();
    player.step(Time::ZERO);
    assert_eq!(kinds(player.step(Time::from_secs_f64(1e6))), "otToL");
}

#[test]
fn messages_are_in_the_map() {
    let mut player = LogPlayer::new(&anchors(), steps(STEPS)).unwrap();
    let due = player.step(Time::ZERO).to_vec();
    let Due::Tag(tag) = &due[2] else { panic!("{due:?}") };
    assert_eq!((tag.anchor_count, tag.antenna_x_m, tag.antenna_z_m), (2, 0.16, 1.12));
    // The map lies at (1, 0) in the anchors' frame and is turned by a quarter.
    assert!((tag.anchors[0].x_m - 1.0).abs() < 1e-9 && tag.anchors[0].y_m.abs() < 1e-9);
    assert!((tag.anchors[1].x_m - 1.0).abs() < 1e-9 && (tag.anchors[1].y_m + 3.0).abs() < 1e-9);
    let later = player.step(Time::from_secs_f64(1.06)).to_vec();
    let Due::Odometry(odometry) = &later[0] else { panic!("{later:?}") };
    assert!((odometry.forward_mps - 0.5).abs() < 1e-9);
    assert!((odometry.right_travel_m - odometry.left_travel_m - 0.4 * FRAC_PI_2).abs() < 1e-9);
}

#[test]
fn an_anchor_without_a_place_is_named() {
    let mut params = anchors();
    params.anchors.pop();
    let mut player = LogPlayer::new(&params, steps(STEPS)).unwrap();
    assert_eq!(player.problem_count(), 1);
    assert!(player.problems()[0].to_string().contains("anchor 2 is not among"));
    let due = player.step(Time::ZERO);
    assert!(matches!(&due[2], Due::Tag(tag) if tag.anchor_count == 1));
}

#[track_caller]
fn check_refused(change: impl Fn(&mut Params), told: &str) {
    let mut params = anchors();
    change(&mut params);
    let error = LogPlayer::new(&params, Log::default()).unwrap_err().to_string();
    assert!(error.contains(told), "{error}");
}

#[test]
fn nonsense_parameters_are_refused() {
    check_refused(
        |params| params.speed = 0.0,
        "`speed` is 0.0, which is out of range: it must be from 0.001",
    );
    check_refused(|params| params.speed = f64::NAN, "`speed` is not a finite number");
    check_refused(|params| params.period_s = -1.0, "`period_s` is -1");
    check_refused(|params| params.anchors[1].id = 1, "number 1 occurs twice");
    check_refused(|params| params.anchors[1].z_m = f64::INFINITY, "`anchors[1].z_m` is not a finite number");
    check_refused(|params| params.anchors = vec![params.anchors[0]; 9], "9 are more than the 8");
    check_refused(|params| params.truth = "truth.txt".to_owned(), "without a file");
}

fn packed(text: &str) -> Vec<u8> {
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    packer.write_all(text.as_bytes()).unwrap();
    packer.finish().unwrap()
}

#[test]
fn a_compressed_file_that_ends_early_is_played_up_to_there() {
    let text: String =
        (0..5000).map(|step| format!("ODOM {step} 0.0{} 0.1 0.{}\n", step * 7919 % 997, step % 89)).collect();
    let mut bytes = packed(&text);
    bytes.truncate(bytes.len() / 2);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.txt.gz");
    std::fs::write(&file, bytes).unwrap();
    let log = load(&Params { file: file.to_string_lossy().into_owned(), ..Params::default() }).unwrap();
    assert!((1000..4900).contains(&log.entries.len()), "{}", log.entries.len());
    assert_eq!(log.problem_count, 1);
    let (line, told) = (log.problems[0].line, log.problems[0].to_string());
    assert_eq!(line, log.entries.len() + 1);
    assert!(told.contains("damaged from here on"), "{told}");
}

#[test]
fn a_log_that_unpacks_without_end_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.txt.gz");
    let mut packer =
        flate2::write::GzEncoder::new(std::fs::File::create(&file).unwrap(), flate2::Compression::best());
    let block = vec![b'\n'; 1 << 20];
    (0..129).for_each(|_| packer.write_all(&block).unwrap());
    packer.finish().unwrap();
    let error = load(&Params { file: file.to_string_lossy().into_owned(), ..Params::default() }).unwrap_err();
    assert!(error.to_string().contains("more than 128 MiB of unpacked content"), "{error}");
}

#[test]
fn files_that_hold_nothing_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("empty.txt");
    let params = Params { file: file.to_string_lossy().into_owned(), ..Params::default() };
    for error in [load(&params).unwrap_err(), check_files(&params).unwrap_err()] {
        assert!(error.to_string().contains("empty.txt: No such file"), "{error}");
    }
    for (file, told) in [("/dev/zero", "this is a device"), ("/", "this is a folder")] {
        for params in [
            Params { file: file.to_owned(), ..Params::default() },
            Params { file: "/etc/hostname".to_owned(), truth: file.to_owned(), ..Params::default() },
        ] {
            let error = check_files(&params).unwrap_err().to_string();
            assert!(error.starts_with("cannot read ") && error.contains(told), "{error}");
        }
    }
    std::fs::write(&file, "hello\n").unwrap();
    let error = load(&params).unwrap_err().to_string();
    assert!(
        error.contains("holds nothing that can be played") && error.contains("line 1: `hello`"),
        "{error}"
    );
    assert_eq!(load(&Params::default()).unwrap(), Log::default());
}

#[test]
fn the_committed_drive_is_whole() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../launch/graphs/data/malaga/");
    let params = Params {
        file: format!("{folder}log.txt.gz"),
        truth: format!("{folder}truth.txt"),
        anchors: [1, 2, 3].map(|id| AnchorPlace { id, x_m: 0.0, y_m: 0.0, z_m: 0.0 }).to_vec(),
        speed: 18.0,
        ..Params::default()
    };
    let mut player = LogPlayer::new(&params, load(&params).unwrap()).unwrap();
    assert_eq!(player.problems(), []);
    assert!((18.0..24.0).contains(&player.length().as_secs_f64()), "{:?}", player.length());
    player.step(Time::ZERO);
    let played = kinds(player.step(Time::from_secs_f64(60.0)));
    let count = |letter| played.matches(letter).count();
    // The messages of step 0 came with the first step if there was no delay; here all but none are left.
    assert_eq!((count('o'), count('s'), count('T'), count('L')), (343, 343, 341, 1));
    assert!(count('t') >= 339, "{}", count('t'));
}

#[test]
fn recordings_of_carmen_are_whole() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/laser_carmen/");
    // Some lines of the first two are stamped with what memory held: mostly a jump away and one back for
    // each.
    for (name, scans, jumps) in
        [("intel", 910, 94), ("freiburg-079", 4791, 29), ("csail", 406, 0), ("belgioioso", 395, 0)]
    {
        let file = format!("{folder}{name}-corrected.log.gz");
        if !std::path::Path::new(&file).exists() {
            println!("skipped: {file} is not there");
            continue;
        }
        let log = load(&Params { file, format: Format::Carmen, period_s: 0.1, ..Params::default() }).unwrap();
        let seen = log.entries.iter().filter(|one| matches!(one.record, Record::Scan { .. })).count();
        println!("{name}: {} entries, {seen} scans, {:?}", log.entries.len(), log.problems.first());
        assert_eq!((seen, log.problem_count), (scans, jumps), "{name}: {:?}", log.problems);
        assert!(log.entries.windows(2).all(|pair| pair[0].at_s <= pair[1].at_s));
    }
}

proptest::proptest! {
    #[test]
    fn any_text_is_survived(text in "(\\PC{0,30}\n){0,8}") {
        let _ = steps(&text);
        let _ = carmen_log(&text);
    }

    #[test]
    fn any_numbers_are_survived(
        lines in proptest::collection::vec((0..5_usize, proptest::collection::vec(proptest::num::f64::ANY, 0..14)), 0..20),
        truth in proptest::collection::vec(proptest::num::f64::ANY, 4),
    ) {
        let text: String = lines.iter().map(|(keyword, numbers)| {
            let words: Vec<String> = numbers.iter().map(|number| format!("{number:e}")).collect();
            format!("{} {}\n", ["ODOM", "LASER 0", "BEACON 0", "FLASER 2", "ODOM 0"][*keyword], words.join(" "))
        }).collect();
        let row = format!("0 {} {} {}\n", truth[1], truth[2], truth[3]);
        for log in [read_steps(&text, &row, 1, 1.0), carmen_log(&text)] {
            proptest::prop_assert!(log.entries.windows(2).all(|pair| pair[0].at_s <= pair[1].at_s));
            let mut player = LogPlayer::new(&anchors(), log).unwrap();
            player.step(Time::ZERO);
            player.step(Time::from_secs_f64(1e9));
        }
    }

    #[test]
    fn a_text_cut_anywhere_keeps_its_whole_lines(cut in 0..STEPS.len()) {
        let whole = STEPS[..cut].matches('\n').count();
        let log = read_steps(&STEPS[..cut], "", 1, 1.0);
        let full = read_steps(&STEPS[..STEPS[..cut].rfind('\n').map_or(0, |end| end + 1)], "", 1, 1.0);
        proptest::prop_assert!(log.problem_count <= 1);
        proptest::prop_assert!(log.entries.len() >= full.entries.len());
        proptest::prop_assert!(log.problems.iter().all(|problem| problem.line == whole + 1));
    }

    #[test]
    fn damaged_compression_is_survived(place in 10..200_usize, value in proptest::num::u8::ANY) {
        let mut bytes = packed(&STEPS.repeat(20));
        let place = place.min(bytes.len() - 1);
        bytes[place] = value;
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("log.txt.gz");
        std::fs::write(&file, bytes).unwrap();
        let params = Params { file: file.to_string_lossy().into_owned(), ..Params::default() };
        if let Err(error) = load(&params) {
            proptest::prop_assert!(error.to_string().contains("holds nothing that can be played"), "{}", error);
        }
    }
}

/// Two scans, each with its truth, and what is played of them.
#[track_caller]
fn check_scans(scans: Scans, expected: &str) {
    let params = Params { format: Format::Carmen, scans, start_delay_s: 0.0, ..Params::default() };
    let mut player = LogPlayer::new(&params, read_carmen(&CARMEN.repeat(2), Timing::Order, 1.0)).unwrap();
    player.step(Time::from_nanos(1));
    assert_eq!(kinds(player.step(Time::from_secs_f64(100.0))), expected);
}

#[test]
fn scans_are_played_with_their_truth() {
    check_scans(Scans::All, "sToosLo");
    check_scans(Scans::Even, "sLooo");
    check_scans(Scans::Odd, "oosLo");
}

#[test]
fn the_truth_can_stand_in_for_a_localiser() {
    let truth = TruePose { x_m: 1.0, y_m: 2.0, heading_rad: 0.5, floor: 3, is_last: 0 };
    let pose = located(&truth);
    assert_eq!((pose.pose().unwrap(), pose.floor), (Pose2::new(1.0, 2.0, 0.5), 3));
}
