//! The engine against tables that two other programs computed, fuzzylite 6 and jFuzzyLogic.
//!
//! Which case matches how closely, and why not more closely, is said beside it. fuzzylite integrates over a
//! stated number of samples and compares with a tolerance of 1e-6: so does the engine here. Its tables give
//! nine decimals, inputs too.

#![expect(
    clippy::panic,
    reason = "this is test code throughout; a reference file that is not understood ends the test"
)]

mod fll;

use fuzzy::{Engine, Integration, Options, System, fcl};
use std::path::PathBuf;

/// A file beside the project, or `None` with a line that says so.
fn shared(path: &str) -> Option<String> {
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared").join(path);
    let text = std::fs::read_to_string(&file).ok();
    if text.is_none() {
        println!("skipped: {} is missing", file.display());
    }
    text
}

/// Rows of numbers; a first line of names is passed over.
fn table(text: &str, separator: fn(char) -> bool) -> Vec<Vec<f64>> {
    let rows =
        text.lines().map(|line| line.split(separator).filter(|word| !word.is_empty()).collect::<Vec<_>>());
    let rows = rows.filter(|words| words.first().is_some_and(|word| word.parse::<f64>().is_ok()));
    rows.map(|words| words.iter().map(|word| word.parse().expect("a number")).collect()).collect()
}

/// The largest difference between a table's outputs and the engine's.
#[track_caller]
fn worst(system: &System, options: Options, rows: &[Vec<f64>]) -> f64 {
    let mut engine = Engine::new(system, options).expect("the reference system compiles");
    let inputs = system.inputs.len();
    assert!(rows.len() > 90, "only {} rows", rows.len());
    let mut worst = 0.0_f64;
    for row in rows {
        assert_eq!(row.len(), inputs + system.outputs.len());
        for (ours, theirs) in engine.step(&row[..inputs]).iter().zip(&row[inputs..]) {
            let difference = if theirs.is_nan() && ours.is_nan() { 0.0 } else { (ours - theirs).abs() };
            worst = if difference > worst || difference.is_nan() { difference } else { worst };
        }
    }
    worst
}

#[track_caller]
fn check_fll(name: &str, tolerance: f64) {
    let (Some(text), Some(rows)) = (
        shared(&format!("data/fuzzy/fuzzylite/{name}.fll")),
        shared(&format!("data/fuzzy/fuzzylite/{name}.fld")),
    ) else {
        return;
    };
    let (system, options) = fll::read(&text);
    let worst = worst(&system, options, &table(&rows, char::is_whitespace));
    println!("{name}.fll: {worst:.3e}");
    assert!(worst <= tolerance, "{name}: {worst}");
}

/// The same through FCL, where the number of samples is not said and so is given here.
#[track_caller]
fn check_fcl(name: &str, resolution: usize, tolerance: f64) {
    let (Some(text), Some(rows)) = (
        shared(&format!("data/fuzzy/fuzzylite/{name}.fcl")),
        shared(&format!("data/fuzzy/fuzzylite/{name}.fld")),
    ) else {
        return;
    };
    let system = fcl::read(&text).expect("the file is FCL");
    assert_eq!(fcl::read(&fcl::write(&system)).as_ref(), Ok(&system), "it is written as it was read");
    let options = Options {
        integration: Integration::Sampled { resolution },
        comparison_tolerance: fll::FUZZYLITE_TOLERANCE,
    };
    let worst = worst(&system, options, &table(&rows, char::is_whitespace));
    println!("{name}.fcl: {worst:.3e}");
    assert!(worst <= tolerance, "{name}: {worst}");
}

#[test]
fn fuzzylite_tables() {
    check_fll("mamdani/AllTerms", 1e-6);
    check_fll("mamdani/ObstacleAvoidance", 1e-6);
    check_fll("mamdani/matlab/tank", 1e-6);
    check_fll("mamdani/matlab/mam22", 1e-6);
    check_fll("takagi-sugeno/ObstacleAvoidance", 1e-6);
    check_fll("takagi-sugeno/matlab/tanksg", 1e-6);
}

#[test]
fn fuzzylite_tables_through_fcl() {
    check_fcl("mamdani/AllTerms", 200, 1e-6);
    check_fcl("mamdani/ObstacleAvoidance", 100, 1e-6);
    check_fcl("mamdani/matlab/tank", 200, 1e-6);
    check_fcl("mamdani/matlab/mam22", 200, 1e-6);
    check_fcl("takagi-sugeno/ObstacleAvoidance", 100, 1e-6);
    check_fcl("takagi-sugeno/matlab/tanksg", 100, 1e-6);
}

#[track_caller]
fn check_bench(resolution: usize) {
    let name = format!("bench/algorithms/fuzzy/bench_{resolution}.fll");
    let (Some(text), Some(rows)) = (shared(&name), shared(&format!("{name}.oracle.csv"))) else { return };
    let (system, options) = fll::read(&text);
    let rows = table(&rows, |character| character == ',');
    let same = worst(&system, options, &rows);
    // Not the same to 1e-6, and it need not be: their sum has a step of 2 / resolution.
    let exact = worst(&system, Options::default(), &rows);
    println!("{name}: {same:.3e}, the exact centroid differs from their sum by {exact:.3e}");
    assert!(same <= 1e-12, "{name}: {same}");
    assert!(exact <= 10.0 / (resolution * resolution) as f64, "{name}: {exact}");
}

#[test]
fn seven_by_seven_rules_of_fuzzylite_in_full_precision() {
    check_bench(100);
    check_bench(200);
    check_bench(1000);
}

/// jFuzzyLogic's tables of memberships: places and degrees times 100, rounded to whole numbers; so a half is
/// the closest.
#[track_caller]
fn check_memberships(name: &str) {
    let (Some(text), Some(rows)) = (
        shared(&format!("data/fuzzy/jfuzzylogic/{name}.fcl")),
        shared(&format!("data/fuzzy/jfuzzylogic/{name}.txt")),
    ) else {
        return;
    };
    let system = fcl::read(&text).expect("the file is FCL");
    let mut engine = Engine::new(&system, Options::default()).expect("the system compiles");
    let rows = table(&rows, char::is_whitespace);
    assert!(rows.len() > 90);
    let mut worst = 0.0_f64;
    for row in rows {
        engine.step(&[row[0] / 100.0]);
        for (term, theirs) in row[1..].iter().enumerate() {
            let ours = engine.membership(0, term).expect("the term exists");
            worst = worst.max((100.0 * ours - theirs).abs());
        }
    }
    println!("{name}: {worst:.3} hundredths");
    assert!(worst <= 0.5 + 1e-9, "{name}: {worst}");
}

#[test]
fn jfuzzylogic_tables() {
    check_memberships("junit_triang");
    check_memberships("junit_trape");
    check_memberships("junit_gauss");
}

/// jFuzzyLogic's tip: inputs and output times 100; it samples the universe in 1000 steps of 0.03 from the
/// lower end.
#[test]
fn jfuzzylogic_tip() {
    let (Some(text), Some(rows)) = (
        shared("data/fuzzy/jfuzzylogic/junit_tipper.fcl"),
        shared("data/fuzzy/jfuzzylogic/junit_tipper.txt"),
    ) else {
        return;
    };
    let system = fcl::read(&text).expect("the file is FCL");
    let rows = table(&rows, char::is_whitespace);
    let rows: Vec<Vec<f64>> =
        rows.iter().map(|row| row.iter().map(|value| value / 100.0).collect()).collect();
    let exact = worst(&system, Options::default(), &rows);
    println!("junit_tipper: {exact:.6}");
    assert!(exact <= 0.005, "{exact}");
}

#[test]
fn jfuzzylogic_robot_is_read_and_runs() {
    let Some(text) = shared("data/fuzzy/jfuzzylogic/robot.fcl") else { return };
    let system = fcl::read(&text).expect("the file is FCL");
    assert_eq!(fcl::read(&fcl::write(&system)).as_ref(), Ok(&system));
    let mut engine = Engine::new(&system, Options::default()).expect("the system compiles");
    assert_eq!(engine.rule_labels().len(), 41);
    // Rule 29 alone: rd IS H, dq IS H, o IS Z, v IS L, all fully, weight 0.4529; la IS HA, symmetrical about
    // 0.75.
    let outputs = engine.step(&[2.0, 2.0, 0.0, 0.0]).to_vec();
    assert!((outputs[0] - 0.75).abs() < 1e-12, "{outputs:?}");
    let fired: Vec<f64> =
        engine.activations().iter().copied().filter(|activation| *activation > 0.0).collect();
    assert_eq!(fired, [0.4529]);
}
