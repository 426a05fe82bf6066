//! Time of one inference. The peer's figures on the same kind of machine: fuzzylite 6.0, the same 7 x 7
//! system, takes 5.7 to 8.4 us at 100 samples. Run with `cargo bench -p fuzzy-controller`.

use divan::Bencher;
use fuzzy::{Engine, Integration, Options, fcl};
use std::fmt::Write;

fn main() {
    divan::main();
}

/// `side` x `side` rules over triangles on [-1, 1]: rule (i, j) concludes i + j - side / 2, kept inside.
fn square(side: usize, values: bool) -> String {
    let place = |index: usize| -1.0 + 2.0 * index as f64 / (side - 1) as f64;
    let width = 2.0 / (side - 1) as f64;
    let terms: String = (0..side).fold(String::new(), |mut text, index| {
        let centre = place(index);
        let _ = writeln!(text, "TERM T{index} := Triangle {} {centre} {};", centre - width, centre + width);
        text
    });
    let conclusions = if values {
        (0..side).fold(String::new(), |mut text, index| {
            let _ = writeln!(text, "TERM T{index} := {};", place(index));
            text
        })
    } else {
        terms.clone()
    };
    let mut rules = String::new();
    for (i, j) in (0..side * side).map(|number| (number / side, number % side)) {
        let k = (i + j).saturating_sub(side / 2).min(side - 1);
        let _ = writeln!(rules, "RULE {} : IF A IS T{i} AND B IS T{j} THEN U IS T{k};", i * side + j + 1);
    }
    let method = if values { "COGS" } else { "COG" };
    format!(
        "FUNCTION_BLOCK square VAR_INPUT A, B : REAL; END_VAR VAR_OUTPUT U : REAL; END_VAR
         FUZZIFY A {terms} END_FUZZIFY FUZZIFY B {terms} END_FUZZIFY
         DEFUZZIFY U RANGE := (-1 .. 1); {conclusions} METHOD : {method}; END_DEFUZZIFY
         RULEBLOCK all {rules} END_RULEBLOCK END_FUNCTION_BLOCK"
    )
}

/// The time of 1600 steps over the whole of the inputs; the counter makes it a rate of inferences.
fn run(bencher: Bencher<'_, '_>, text: &str, integration: Integration) {
    let system = fcl::read(text).expect("the recipe is FCL");
    let options = Options { integration, ..Options::default() };
    let mut engine = Engine::new(&system, options).expect("the recipe compiles");
    let inputs: Vec<[f64; 2]> = (0..1600)
        .map(|number| [-1.0 + 2.0 * (number / 40) as f64 / 39.0, -1.0 + 2.0 * (number % 40) as f64 / 39.0])
        .collect();
    bencher.counter(divan::counter::ItemsCount::new(inputs.len())).bench_local(|| {
        let mut sum = 0.0;
        for input in &inputs {
            sum += engine.step(divan::black_box(input))[0];
        }
        sum
    });
}

/// Mamdani, exact centroid: 49, 100, 196 and 1024 rules.
#[divan::bench(args = [7, 10, 14, 32])]
fn exact_centroid(bencher: Bencher<'_, '_>, side: usize) {
    run(bencher, &square(side, false), Integration::Exact);
}

/// Mamdani, 49 rules, as fuzzylite computes it.
#[divan::bench(args = [100, 200, 1000])]
fn sampled_centroid(bencher: Bencher<'_, '_>, resolution: usize) {
    run(bencher, &square(7, false), Integration::Sampled { resolution });
}

/// Sugeno: 49, 100, 196 and 1024 rules.
#[divan::bench(args = [7, 10, 14, 32])]
fn weighted_average(bencher: Bencher<'_, '_>, side: usize) {
    run(bencher, &square(side, true), Integration::Exact);
}
