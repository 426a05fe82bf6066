//! Cases of plans, statistics, the file of runs, and tables.

use super::crew::{Ended, record};
use super::plan::{self, Plan};
use super::plot::{box_of, file_name};
use super::statistics::{quantile, student_quantile, summary, wilson};
use super::store::parse as parse_runs;
use super::*;
use proptest::prelude::*;
use std::collections::BTreeMap;

const SMALL: &str = "graph = 'coffee'\nlimit_s = 10\nseeds = { from = 3, count = 2 }\n";

fn parsed(more: &str) -> Result<Plan, String> {
    plan::parse(&format!("{SMALL}{more}"), "small", Path::new("")).map_err(|error| error.to_string())
}

#[track_caller]
fn check_names(more: &str, runs: usize, expected: &[&str]) {
    let plan = parsed(more).unwrap();
    let names: Vec<&str> = plan.variants.iter().map(|variant| variant.name.as_str()).collect();
    assert_eq!(names, expected);
    assert_eq!(plan.runs.len(), runs);
}

#[track_caller]
fn check_refused(more: &str, expected: &str) {
    let error = parsed(more).unwrap_err();
    assert!(error.contains(expected), "no `{expected}` in: {error}");
}

#[test]
fn variants_are_spelt_out() {
    check_names("", 2, &["as the graph is"]);
    check_names("[vary]\ncontroller = ['a', 'b']", 4, &["a", "b"]);
    check_names("[vary]\n'guard.front_m' = [0.1, 0.2]", 4, &["front_m=0.1", "front_m=0.2"]);
    check_names("[across]\n'navigator.default_order' = ['203', '207', '211']", 6, &["as the graph is"]);
    check_names("worlds = ['a.toml', 'b.toml']", 4, &["as the graph is"]);
    check_names("[[variant]]\nname = 'x'\n[[variant]]\nname = 'y'\nseeds = [1]", 3, &["x", "y"]);
    check_names(
        "[across]\n'a.b' = [1, 2]\n[[variant]]\nname = 'x'\n[[variant]]\nname = 'y'\nacross = { 'a.b' = [3] }",
        6,
        &["x", "y"],
    );
    check_names("[vary]\nc = ['a', 'b']\n[[variant]]\nname = 'x'", 4, &["x, a", "x, b"]);
}

#[test]
fn wrong_plans_are_refused() {
    check_refused("[vary]\ncontroller = 'a'", "takes a list of values");
    check_refused("[vary]\ncontroller = []", "empty list");
    check_refused("[vary]\ncontroller = [1]", "a binary's name in quotes, not 1");
    check_refused("[[variant]]\nname = 'x'\n[[variant]]\nname = 'x'", "two variants are called `x`");
    check_refused("[[variant]]\nname = 'x'\nlimit_s = 0", "limit_s = 0 is not above zero");
    check_refused("[[variant]]\nname = 'x'\nlimit_s = nan", "limit_s = NaN is not above zero");
    check_refused("[[variant]]\nname = 'x'\nseeds = []", "this makes 0 runs");
    // Refused before they are spelt out.
    let axes: String = (0..40).map(|n| format!("'guard.p{n}' = [1, 2, 3, 4, 5, 6, 7, 8, 9]\n")).collect();
    check_refused(&format!("[vary]\n{axes}"), "this makes 531441 runs; between 1 and 100000 are possible");
    let long = "x".repeat(20_000);
    let many = (0..20_000).map(|n| n.to_string()).collect::<Vec<_>>().join(", ");
    check_refused(
        &format!("[set]\n'guard.text' = '{long}'\n[vary]\n'guard.p' = [{many}]"),
        "more than can be kept in mind",
    );
    check_refused(
        "[[variant]]\nname = 'x'\nseeds = { from = 0, count = 99999999999 }",
        "between 1 and 100000",
    );
    check_refused("[[variant]]\nname = 'x'\nseeds = 'all'", "{ from = 1, count = 20 }");
    check_refused("[[variant]]\nname = 'x'\nacross = { 'a.b' = [1] }", "`a.b` is varied across in a variant");
    check_refused("speed = 3", "unknown field `speed`");
    check_refused("[ratio]\na = ['b', 'a']", "the ratio `a` is made of itself");
    check_refused("[ratio]\na = ['b']", "expected an array of length 2");
}

#[test]
fn changes_reach_the_command_line_in_order() {
    let plan = parsed(
        "[set.guard]\nfront_m = 0.2\n[swap]\nplanner = 'p'\n[vary]\ncontroller = ['c']\n[across]\n'navigator.default_order' = ['203']\n\
         [[variant]]\nname = 'x'\nset = { 'guard.side_m' = 0.1, 'localiser.start' = { x_m = 1.0 } }\nwithout = ['referee']",
    )
    .unwrap();
    let overrides = &plan.runs[0].overrides;
    let expected_set = [
        "guard.front_m=0.2",
        "guard.side_m=0.1",
        "localiser.start={ x_m = 1.0 }",
        "navigator.default_order=\"203\"",
    ];
    assert_eq!(overrides.set, expected_set);
    assert_eq!(overrides.swap, ["planner=p", "controller=c"]);
    assert_eq!(overrides.without, ["referee"]);
    assert_eq!((overrides.seed, plan.runs[1].seed), (Some(3), 4));
    assert_eq!(
        (plan.axes, plan.runs[0].situation.clone()),
        (vec!["navigator.default_order".to_owned()], vec!["203".to_owned()])
    );
}

#[test]
fn faults_are_varied_as_parameters_are() {
    let plan = parsed("[across]\n'graph.fault' = [[], [{ at_s = 30.0, kill = 'planner' }]]").unwrap();
    assert_eq!(plan.runs[0].overrides.set, ["graph.fault=[]"]);
    assert_eq!(plan.runs[2].overrides.set, ["graph.fault=[{ at_s = 30.0, kill = \"planner\" }]"]);
}

#[track_caller]
fn check_close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} is not {expected}");
}

#[test]
fn quantiles_of_student_are_those_of_the_tables() {
    check_close(student_quantile(1), 12.706_204_736, 1e-8);
    check_close(student_quantile(2), 4.302_652_730, 1e-8);
    check_close(student_quantile(3), 3.182_446_305, 1e-8);
    check_close(student_quantile(4), 2.776_445_105, 1e-8);
    check_close(student_quantile(9), 2.262_157_163, 1e-8);
    check_close(student_quantile(10), 2.228_138_852, 1e-8);
    check_close(student_quantile(30), 2.042_272_456, 1e-8);
    check_close(student_quantile(99), 1.984_216_952, 1e-8);
    check_close(student_quantile(100_000), 1.959_987_7, 1e-6);
    assert!(student_quantile(0).is_nan());
}

#[test]
fn means_have_intervals() {
    let found = summary(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]).unwrap();
    check_close(found.mean, 5.0, 1e-12);
    check_close(found.deviation, (32.0_f64 / 7.0).sqrt(), 1e-12);
    check_close(found.margin, 2.364_624_252 * (32.0_f64 / 7.0 / 8.0).sqrt(), 1e-8);
    let alone = summary(&[3.0]).unwrap();
    assert!(alone.mean == 3.0 && alone.margin.is_nan() && alone.deviation.is_nan());
    assert_eq!(summary(&[]), None);
}

#[track_caller]
fn check_wilson(successes: usize, count: usize, low: f64, high: f64) {
    let (found_low, found_high) = wilson(successes, count).unwrap();
    check_close(found_low, low, 5e-5);
    check_close(found_high, high, 5e-5);
}

#[test]
fn rates_have_intervals() {
    // Newcombe 1998, table I, method 3.
    check_wilson(81, 263, 0.2553, 0.3662);
    check_wilson(15, 148, 0.0624, 0.1605);
    check_wilson(0, 20, 0.0, 0.1611);
    check_wilson(1, 29, 0.0061, 0.1718);
    check_wilson(20, 20, 0.8389, 1.0);
    assert_eq!(wilson(0, 0), None);
}

#[test]
fn boxes_end_at_values() {
    let five = box_of(&[5.0, 1.0, 2.0, 3.0, 4.0, 100.0]).unwrap();
    assert_eq!((five.low, five.first, five.median, five.third, five.high), (1.0, 2.25, 3.5, 4.75, 5.0));
    assert_eq!(box_of(&[]), None);
    assert_eq!(quantile(&[1.0, 2.0, 3.0], 0.5), Some(2.0));
    assert_eq!(file_name("localisation error, 95 % [m]"), "localisation-error-95-m.svg");
}

fn example(key: &str) -> Record {
    Record {
        key: key.to_owned(),
        variant: "radii, \"all\" 0.1".to_owned(),
        situation: vec!["203".to_owned()],
        seed: 7,
        outcome: Outcome::Failed,
        remark: "touched\nsomething, twice".to_owned(),
        logical_s: 0.1 + 0.2,
        wall_s: 1.5,
        figures: BTreeMap::from([("time [s]".to_owned(), 12.25), ("path, all [m]".to_owned(), 1e-7)]),
        digest: "ab".repeat(16),
    }
}

fn store_in(folder: &Path) -> Store {
    Store::open(&folder.join("runs.csv"), &["navigator.default_order".to_owned()], |_| true).unwrap().0
}

#[test]
fn runs_survive_the_disk() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = store_in(folder.path());
    store.append(example("one")).unwrap();
    // A figure that was not known at first, and a run without any.
    let mut second = example("two");
    second.figures.insert("contacts".to_owned(), 3.0);
    store.append(second.clone()).unwrap();
    let mut third = example("three");
    third.figures.clear();
    store.append(third.clone()).unwrap();
    assert_eq!(store_in(folder.path()).records, [example("one"), second, third]);
}

#[test]
fn a_line_cut_short_is_no_run() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = store_in(folder.path());
    for key in ["one", "two", "three"] {
        store.append(example(key)).unwrap();
    }
    let text = fs::read(folder.path().join("runs.csv")).unwrap();
    let all = parse_runs(&text);
    assert_eq!(all.len(), 3);
    for end in 0..text.len() {
        let found = parse_runs(&text[..end]);
        assert_eq!(found, all[..found.len()], "cut at {end}");
    }
}

#[test]
fn outdated_runs_are_set_aside() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = store_in(folder.path());
    store.append(example("one")).unwrap();
    store.append(example("two")).unwrap();
    let file = folder.path().join("runs.csv");
    let (store, outdated) = Store::open(&file, &[], |record| record.key == "two").unwrap();
    assert_eq!((store.records.len(), outdated), (1, 1));
    assert_eq!(parse_runs(&fs::read(folder.path().join("runs-outdated.csv")).unwrap()).len(), 2);
}

proptest! {
    #[test]
    fn any_text_is_no_crash(text in prop::collection::vec(any::<u8>(), 0..400)) {
        let header = b"key,variant,seed,outcome,remark,logical_s,wall_s,digest\n";
        let found = parse_runs(&[header.as_slice(), &text].concat());
        prop_assert!(found.iter().all(|record| record.figures.is_empty()));
        parse_runs(&text);
    }

    #[test]
    fn any_remark_is_kept(remark in "\\PC{0,40}[\",\n\r]{0,3}", variant in ".{0,20}", value in any::<f64>()) {
        let folder = tempfile::tempdir().unwrap();
        let mut record = Record { remark, variant, ..example("one") };
        if value.is_finite() { record.figures.insert("x".to_owned(), value); }
        store_in(folder.path()).append(record.clone()).unwrap();
        prop_assert_eq!(store_in(folder.path()).records, [record]);
    }

    #[test]
    fn intervals_hold_the_rate(count in 1_usize..500, part in 0.0_f64..=1.0) {
        let successes = (part * count as f64).round() as usize;
        let (low, high) = wilson(successes, count).unwrap();
        let rate = successes as f64 / count as f64;
        prop_assert!(0.0 <= low && low <= rate && rate <= high && high <= 1.0);
    }
}

#[track_caller]
fn check_word(code: i32, stdout: &str, expected: Outcome, remark: &str) -> Record {
    use std::os::unix::process::ExitStatusExt as _;
    let job = Job { key: "k".to_owned(), variant: "v".to_owned(), run: parsed("").unwrap().runs[0].clone() };
    let status = Some(std::process::ExitStatus::from_raw(code << 8));
    let ended = Ended { status, stdout: stdout.to_owned(), stderr: "error: no such thing\n\n".to_owned() };
    let found = record(job, 1.0, ended);
    assert_eq!((found.outcome, found.remark.as_str()), (expected, remark));
    found
}

#[test]
fn a_childs_last_words_are_understood() {
    let word = |passed| {
        format!(
            "noise\n{{\"digest\":{{\"digest\":\"d\"}},\"logical_s\":2.5,\"run\":{{\"passed\":{passed},\"remark\":\"r\",\"figures\":{{\"a\":1.5,\"b\":null}}}}}}\n"
        )
    };
    let passed = check_word(0, &word(true), Outcome::Passed, "r");
    assert_eq!((passed.figures, passed.logical_s), (BTreeMap::from([("a".to_owned(), 1.5)]), 2.5));
    check_word(1, &word(false), Outcome::Failed, "r");
    check_word(0, &word(false), Outcome::Unfinished, "r");
    check_word(1, "", Outcome::Error, "error: no such thing");
    check_word(0, "{\"digest\":{\"digest\":\"d\"},\"run\":null}", Outcome::Unfinished, "");
}

#[test]
fn tables_and_expectations() {
    let plan = parsed("[across]\n'n.order' = ['203']\n[[variant]]\nname = 'good'\nexpect = { passes = [1, 1] }\n[[variant]]\nname = 'bad'\nexpect = { contacts = [1, inf] }").unwrap();
    let run = |variant: &str, seed: u64, outcome, time_s: f64| Record {
        variant: variant.to_owned(),
        seed,
        outcome,
        remark: format!("after {seed} tries"),
        figures: BTreeMap::from([("time [s]".to_owned(), time_s), ("contacts".to_owned(), 0.0)]),
        ..example("k")
    };
    let records = [
        run("good", 3, Outcome::Passed, 70.0),
        run("good", 4, Outcome::Passed, 74.0),
        run("bad", 3, Outcome::Failed, 10.0),
        run("bad", 4, Outcome::Unfinished, 12.5),
    ];
    insta::assert_snapshot!(report::tables(&plan, &records, true));
    let groups = report::groups(&plan, &records);
    let holds: Vec<bool> = report::verdicts(&plan, &groups).iter().map(report::Verdict::holds).collect();
    assert_eq!(holds, [true, false]);
    let folder = tempfile::tempdir().unwrap();
    plot::draw(&folder.path().join("time.svg"), "time [s]", &groups).unwrap();
    let drawn = fs::read_to_string(folder.path().join("time.svg")).unwrap();
    assert_eq!(drawn.matches("<circle").count(), 4, "a dot a run");
    assert!(drawn.contains("good") && drawn.contains("bad"));
}

#[test]
fn ratios_are_of_sums_over_the_runs_that_have_both() {
    let plan = parsed(
        "[ratio]\nof = ['path', 'shortest']\n[[variant]]\nname = 'a'\nexpect = { of = [1.0, 1.25] }\n\
         [[variant]]\nname = 'b'\nexpect = { of = [1.0, 1.25] }",
    )
    .unwrap();
    let run = |variant: &str, figures: &[(&str, f64)]| Record {
        variant: variant.to_owned(),
        outcome: Outcome::Passed,
        figures: figures.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
        ..example("k")
    };
    let records = [
        run("a", &[("path", 9.0), ("shortest", 8.0)]),
        run("a", &[("path", 3.0), ("shortest", 2.0)]),
        run("a", &[("path", 100.0)]),
        run("a", &[("path", 100.0), ("shortest", f64::INFINITY)]),
        run("b", &[("path", 3.0), ("shortest", 0.0)]),
    ];
    let verdicts = report::verdicts(&plan, &report::groups(&plan, &records));
    assert_eq!(verdicts.iter().map(|verdict| verdict.found).collect::<Vec<_>>(), [Some(1.2), None]);
    let tables = report::tables(&plan, &records, false);
    assert!(tables.contains("path / shortest") && tables.contains("1.200"), "{tables}");
}

#[test]
fn only_plain_text_of_some_size_is_an_experiment() {
    let told = |path: &Path, words: &str| {
        let error = plan::read(path).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    let folder = tempfile::tempdir().unwrap();
    told(Path::new("/dev/zero"), "this is a device");
    told(folder.path(), "this is a folder");
    let file = folder.path().join("x.toml");
    fs::write(&file, vec![b'#'; 2 << 20]).unwrap();
    told(&file, "it has 2 MiB, more than 1 MiB");
    fs::write(&file, b"name = 'caf\xe9'").unwrap();
    told(&file, "line 1, byte 12: the byte 0xe9 is no UTF-8");
}
