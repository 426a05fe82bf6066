//! Cases of plans, what is chosen of them, the file of runs, tables and drawings.

use super::choice::{seeds, sweep, swept};
use super::crew::{Ended, record};
use super::plan::{self, Plan};
use super::plot::{box_of, file_name};
use super::store::parse;
use super::*;
use proptest::prelude::*;
use std::collections::BTreeMap;

const SMALL: &str = "graph = 'coffee'\nlimit_s = 10\nseeds = { from = 3, count = 2 }\n";

fn parsed(more: &str) -> Result<Plan, String> {
    chosen(more, &Choice::default())
}

fn chosen(more: &str, choice: &Choice) -> Result<Plan, String> {
    let text = format!("{SMALL}{more}");
    plan::parse(&text, "small", Path::new(""), choice).map_err(|error| error.to_string())
}

fn parse_runs(text: &[u8]) -> Vec<Record> {
    parse(text).1
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

fn choice(only: &[&str], seeds: Option<&[u64]>, sweeps: &[&str], set: &[&str]) -> Choice {
    let texts = |texts: &[&str]| texts.iter().map(|&text| text.to_owned()).collect::<Vec<_>>();
    let sweep = sweep(&texts(sweeps), &texts(set)).unwrap();
    Choice { only: texts(only), seeds: seeds.map(<[u64]>::to_vec), sweep }
}

#[track_caller]
fn check_chosen(choice: &Choice, runs: usize, expected: &[&str]) -> Plan {
    let plan = chosen(
        "[[variant]]\nname = 'x'\nexpect = { passes = [1, 1] }\n[[variant]]\nname = 'y'\nseeds = [1]",
        choice,
    )
    .unwrap();
    let names: Vec<&str> = plan.variants.iter().map(|variant| variant.name.as_str()).collect();
    assert_eq!((names.as_slice(), plan.runs.len()), (expected, runs));
    assert!(plan.runs.iter().all(|run| run.variant < plan.variants.len()));
    plan
}

#[test]
fn the_command_line_chooses_variants_seeds_and_sweeps() {
    check_chosen(&choice(&[], None, &[], &[]), 3, &["x", "y"]);
    check_chosen(&choice(&["y"], None, &[], &[]), 1, &["y"]);
    check_chosen(&choice(&[], Some(&[7, 8, 9]), &[], &[]), 6, &["x", "y"]);
    let plan = check_chosen(
        &choice(&["x"], Some(&[1]), &["p.gap_m=0.1,0.2"], &["p.map=/a/b.yaml"]),
        2,
        &["x, gap_m=0.1, map=b.yaml", "x, gap_m=0.2, map=b.yaml"],
    );
    assert_eq!(plan.runs[1].overrides.set, ["p.gap_m=0.2", "p.map=\"/a/b.yaml\""]);
    assert!(plan.variants.iter().all(|variant| variant.expect.is_empty()), "expected of other variants");
    let plan = check_chosen(&choice(&["x"], None, &["planner=a,b"], &[]), 4, &["x, a", "x, b"]);
    assert_eq!(plan.runs[3].overrides.swap, ["planner=b"]);
    let plan = chosen("", &choice(&[], None, &["p.a=1,2", "p.b=3,4"], &[])).unwrap();
    let names: Vec<&str> = plan.variants.iter().map(|variant| variant.name.as_str()).collect();
    assert_eq!(names, ["a=1, b=3", "a=1, b=4", "a=2, b=3", "a=2, b=4"]);
    let error = chosen("[[variant]]\nname = 'fuzzy'", &choice(&["fuzy"], None, &[], &[])).unwrap_err();
    assert_eq!(error, "there is no variant `fuzy`: did you mean `fuzzy`?");
    let error = chosen("[across]\n'p.a' = [1]", &choice(&[], None, &["p.a=2,3"], &[])).unwrap_err();
    assert!(error.contains("varies `p.a` already"), "{error}");
    let twice = sweep(&["p.a=1,2".to_owned()], &["p.a=3".to_owned()]).unwrap_err().to_string();
    assert_eq!(twice, "`p.a` is given twice on the command line");
}

#[track_caller]
fn check_seeds(text: &str, expected: &[u64]) {
    assert_eq!(seeds(text).unwrap(), expected, "{text}");
}

#[test]
fn seeds_are_ranges_and_lists() {
    check_seeds("7", &[7]);
    check_seeds("1..3", &[1, 2, 3]);
    check_seeds("1..=3", &[1, 2, 3]);
    check_seeds("5, 3,3", &[5, 3]);
    check_seeds("1..2,9,2..4", &[1, 2, 9, 3, 4]);
    for text in ["", "a", "3..1", "1...3", "1..", "-1", "1,,2", "0.5"] {
        let error = seeds(text).unwrap_err().to_string();
        assert!(error.contains("1..20"), "{text}: {error}");
    }
    let error = seeds("0..18446744073709551615").unwrap_err().to_string();
    assert!(error.contains("between 1 and 100000"), "{error}");
}

#[track_caller]
fn check_swept(text: &str, key: &str, expected: &str) {
    let (found, values) = swept(text, true).unwrap();
    assert_eq!((found.as_str(), toml::Value::Array(values).to_string().as_str()), (key, expected));
}

#[test]
fn sweeps_are_values_or_words() {
    check_swept("a.b=1,2.5,true", "a.b", "[1, 2.5, true]");
    check_swept("a.b = 'x y', \"z\"", "a.b", "[\"x y\", \"z\"]");
    check_swept("a.b=[1, 2],[3]", "a.b", "[[1, 2], [3]]");
    check_swept(
        "planner=grid-planner,sampling-planner",
        "planner",
        "[\"grid-planner\", \"sampling-planner\"]",
    );
    check_swept("a.b=207,main", "a.b", "[207, \"main\"]");
    check_swept("a.b=1], c = [2", "a.b", "[\"1]\", \"c = [2\"]");
    for text in ["a.b", "=1,2", "a.b=", "  =  "] {
        let error = swept(text, true).unwrap_err().to_string();
        assert!(error.contains("planner.clearance_m="), "{text}: {error}");
    }
    // What is set has one value, whatever stands in it.
    let set = |text: &str| toml::Value::Array(swept(text, false).unwrap().1).to_string();
    assert_eq!(set("a.b=1,2"), "[\"1,2\"]");
    assert_eq!(set("a.b=[1, 2]"), "[[1, 2]]");
    assert_eq!(set("a.b={ x = 1 }"), "[{ x = 1 }]");
}

#[test]
fn variants_without_their_files_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("b.log"), "").unwrap();
    let text = "needs = ['player.file', 'localiser.map']\n[[variant]]\nname = 'a'\nset = { 'player.file' = 'a.log' }\n\
         [[variant]]\nname = 'b'\nset = { 'player.file' = 'b.log' }\n[[variant]]\nname = 'c'\nset = { player = { file = '' } }\n\
         [[variant]]\nname = 'd'";
    let mut plan = parsed(text).unwrap();
    let gone = plan.leave_out_what_lacks_files(folder.path());
    assert_eq!(
        gone,
        [("a".to_owned(), folder.path().join("a.log")), ("c".to_owned(), folder.path().join("")),]
    );
    let left: Vec<(&str, u64)> =
        plan.runs.iter().map(|run| (plan.variants[run.variant].name.as_str(), run.seed)).collect();
    assert_eq!(left, [("b", 3), ("b", 4), ("d", 3), ("d", 4)]);
    // What the command line names is there for all.
    let choice = choice(&["a"], None, &[], &["player.file=b.log"]);
    assert!(chosen(text, &choice).unwrap().leave_out_what_lacks_files(folder.path()).is_empty());
}

#[test]
fn what_is_left_is_forecast_from_what_was_done() {
    let plan = parsed("[[variant]]\nname = 'x'\n[[variant]]\nname = 'y'").unwrap();
    let left: Vec<&Run> = plan.runs.iter().collect();
    let took = |variant: &str, wall_s| Record { variant: variant.to_owned(), wall_s, ..example("k") };
    let known = [took("x", 100.0), took("x", 140.0), took("z", 30.0)];
    let words = |left: &[&Run], known: &[Record]| forecast(&plan, left, known, 2);
    assert!(words(&left, &[]).contains("when the first are done"));
    // Two of 120 s, and two of which only the mean of all is known: 90 s; two at once.
    assert_eq!(
        words(&left, &known),
        "0 of 4 runs are done; the others take about 4 min, as the 3 on record did"
    );
    assert_eq!(
        words(&left[..1], &known),
        "3 of 4 runs are done; the others take about 2 min, as the 3 on record did"
    );
    assert!(words(&[], &known).contains("all 4 runs are done"));
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

#[test]
fn boxes_end_at_values() {
    let five = box_of(&[5.0, 1.0, 2.0, 3.0, 4.0, 100.0]).unwrap();
    assert_eq!((five.low, five.first, five.median, five.third, five.high), (1.0, 2.25, 3.5, 4.75, 5.0));
    assert_eq!(box_of(&[]), None);
    assert_eq!(file_name("localisation error, 95 % [m]"), "localisation-error-95-m.svg");
}

const AXIS: &str = "navigator.default_order";

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
    Store::open(&folder.join("runs.csv"), &[AXIS.to_owned()], |_| Use::Wanted).unwrap().0
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

#[track_caller]
fn check_opened(axes: &[&str], wanted: &[&str], aside: &[&str], outdated: usize) {
    let folder = tempfile::tempdir().unwrap();
    let mut store = store_in(folder.path());
    for key in ["one", "two", "three"] {
        store.append(example(key)).unwrap();
    }
    let file = folder.path().join("runs.csv");
    let axes: Vec<String> = axes.iter().map(|&axis| axis.to_owned()).collect();
    let use_of = |record: &Record| match record.key.as_str() {
        "two" => Use::Wanted,
        "three" => Use::Aside,
        _ => Use::Outdated,
    };
    let (mut store, count) = Store::open(&file, &axes, use_of).unwrap();
    let keys = |records: &[Record]| records.iter().map(|record| record.key.clone()).collect::<Vec<_>>();
    assert_eq!(
        (keys(&store.records), keys(&store.aside), count),
        (
            wanted.iter().map(|&key| key.to_owned()).collect(),
            aside.iter().map(|&key| key.to_owned()).collect(),
            outdated,
        )
    );
    assert_eq!(parse_runs(&fs::read(folder.path().join("runs-outdated.csv")).unwrap()).len(), 3);
    let situation = vec!["203".to_owned(); axes.len()];
    store.append(Record { situation, ..example("four") }).unwrap();
    store.sort_by_key(|record| record.key.len()).unwrap();
    // What is kept aside is still in the file.
    assert_eq!(parse_runs(&fs::read(&file).unwrap()).len(), wanted.len() + aside.len() + 1);
}

#[test]
fn outdated_runs_are_moved_and_others_stay() {
    check_opened(&[AXIS], &["two"], &["three"], 1);
    check_opened(&[], &[], &[], 3);
    check_opened(&["another"], &[], &[], 3);
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

/// Three rooms and two seeds; the second variant is slower in each, and fails twice.
fn paired() -> (Plan, Vec<Record>) {
    let plan = parsed(
        "[across]\n'n.order' = ['203', '207', '211']\n[[variant]]\nname = 'old'\nexpect = { passes = [1, 1] }\n\
         [[variant]]\nname = 'new'\nexpect = { contacts = [1, inf] }",
    )
    .unwrap();
    let run = |index: usize, run: &Run| {
        let (is_new, room) = (run.variant == 1, run.situation[0].as_str());
        let length_s = match room {
            "203" => 40.0,
            "207" => 80.0,
            _ => 120.0,
        };
        let slower_s = if is_new { 3.0 + 0.25 * (index % 3) as f64 } else { 0.0 };
        let fails = is_new && room == "211";
        let figures = [
            ("time [s]", length_s + run.seed as f64 + slower_s),
            ("contacts", f64::from(u8::from(fails))),
            ("clearance [m]", if run.seed == 3 { 0.3 } else { 0.31 }),
            ("rooms", 1.0),
        ];
        Record {
            variant: plan.variants[run.variant].name.clone(),
            situation: run.situation.clone(),
            seed: run.seed,
            outcome: if fails { Outcome::Failed } else { Outcome::Passed },
            remark: if fails { format!("touched a chair after {index} s") } else { String::new() },
            figures: figures.into_iter().map(|(name, value)| (name.to_owned(), value)).collect(),
            ..example("k")
        }
    };
    let records = plan.runs.iter().enumerate().map(|(index, record)| run(index, record)).collect();
    (plan, records)
}

#[test]
fn tables_say_what_a_change_has_changed() {
    let (plan, records) = paired();
    insta::assert_snapshot!("table_file", report::tables(&plan, &records, Show::File));
    let short = Show::Terminal { all: false, by: Some(0) };
    insta::assert_snapshot!("table_terminal", report::tables(&plan, &records, short));
    let holds: Vec<bool> = compare::verdicts(&plan, &compare::groups(&plan, &records))
        .iter()
        .map(compare::Verdict::holds)
        .collect();
    assert_eq!(holds, [true, false]);
}

#[test]
fn an_axis_that_was_asked_for_is_shown_when_nothing_differs() {
    let (plan, mut records) = paired();
    for record in &mut records {
        record.figures.retain(|name, _| name != "time [s]");
    }
    let short = |by| report::tables(&plan, &records, Show::Terminal { all: false, by });
    let text = short(Some(0));
    assert!(text.contains("No figure differs from `old` beyond chance (95 %); the 2 that vary"), "{text}");
    let table = text.split_once("By n.order").unwrap().1;
    assert!(table.contains("clearance [m]") && table.contains("0 of 2"), "{text}");
    assert!(!short(None).contains("By n.order"));
}

#[test]
fn only_runs_of_the_same_situation_and_seed_are_pairs() {
    let (plan, mut records) = paired();
    // The new one has not met one situation, and the old one another.
    records.retain(|record| record.variant != "new" || record.situation != ["203"] || record.seed != 4);
    records.retain(|record| record.variant != "old" || record.situation != ["207"] || record.seed != 3);
    let groups = compare::groups(&plan, &records);
    let pairs = compare::pairs(&groups);
    assert_eq!(pairs.iter().map(compare::Pairs::count).collect::<Vec<_>>(), [0, 4]);
    let found = pairs[1].difference("time [s]", false).unwrap();
    assert!(found.count == 4 && found.mean > 2.9 && found.is_apart_from_zero(), "{found:?}");
    // Of the runs that failed nothing is said where only those that passed are compared.
    assert_eq!(pairs[1].difference("time [s]", true).unwrap().count, 2);
    let passes = pairs[1].passes().unwrap();
    assert_eq!((passes.only_first, passes.only_other, passes.p), (2, 0, 0.5));
    assert_eq!(pairs[1].difference("unheard of", false), None);
    let differing = compare::differing_figures(&compare::telling_figures(&records), &pairs);
    assert_eq!(differing, ["time [s]"]);
}

#[track_caller]
fn check_drawn(figure: &str, marks: &[&str], counts: [usize; 2]) {
    let (plan, records) = paired();
    let groups = compare::groups(&plan, &records);
    let svg = plot::draw("small", figure, &groups).unwrap().unwrap();
    let legend = ["a run that passed", "a run that did not pass", "quartiles"];
    let words = ["old", "new", "n = 6", "12 of 12 runs"].into_iter().chain(legend);
    let words: Vec<&str> = words.chain(marks.iter().copied()).collect();
    assert_eq!(pictures::lacks(&svg, &words), Vec::<String>::new(), "{svg}");
    // A dot a run that passed and one in the legend; each cross is two lines of the colour of what
    // went wrong.
    let crosses = svg.matches("#D55E00").count() / 2;
    assert_eq!([svg.matches("<circle").count(), crosses], counts, "{svg}");
}

#[test]
fn drawings_have_axes_units_legends_and_counts() {
    check_drawn("time [s]", &["small: time [s]", "60", "80", "100"], [11, 3]);
    check_drawn("contacts", &["contacts [number]", "0", "1"], [11, 3]);
    let (plan, records) = paired();
    let svg = plot::draw("small", "contacts", &compare::groups(&plan, &records)).unwrap().unwrap();
    assert!(!svg.contains("0.5\n</text>"), "half a contact: {svg}");
    assert!(plot::draw("small", "unheard of", &compare::groups(&plan, &records)).unwrap().is_none());
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
    let verdicts = compare::verdicts(&plan, &compare::groups(&plan, &records));
    assert_eq!(verdicts.iter().map(|verdict| verdict.found).collect::<Vec<_>>(), [Some(1.2), None]);
    let tables = report::tables(&plan, &records, Show::Terminal { all: true, by: None });
    assert!(tables.contains("path / shortest") && tables.contains("1.200"), "{tables}");
}

#[test]
fn only_plain_text_of_some_size_is_an_experiment() {
    let told = |path: &Path, words: &str| {
        let error = plan::read(path, &Choice::default()).unwrap_err().to_string();
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
