//! A step allocates nothing, whatever the kernel.

use fuzzy::{Engine, Options, fcl};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is passed on unchanged to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`, and the memory came from the system's
        // allocator.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[track_caller]
fn check(output: &str, block: &str, kernel: &str) {
    let text = format!(
        "FUNCTION_BLOCK b VAR_INPUT x : REAL; END_VAR VAR_OUTPUT y : REAL; END_VAR
         FUZZIFY x TERM low := Ramp 10 0; TERM high := Ramp 0 10; TERM round := Gaussian 5 2; END_FUZZIFY
         DEFUZZIFY y RANGE := (0 .. 9); {output} END_DEFUZZIFY
         RULEBLOCK {block} RULE 1 : IF x IS low THEN y IS a; RULE 2 : IF x IS very high THEN y IS b;
         RULE 3 : IF NOT (x IS low OR x IS round AND x IS high) THEN y IS b WITH 0.5; END_RULEBLOCK END_FUNCTION_BLOCK"
    );
    let mut engine = Engine::new(&fcl::read(&text).expect("FCL"), Options::default()).expect("a system");
    assert_eq!(engine.kernel(0), Some(kernel));
    let before = COUNT.get();
    let mut sum = 0.0;
    for step in 0..100 {
        sum += engine.step(&[f64::from(step) * 0.1])[0];
    }
    assert_eq!(COUNT.get() - before, 0, "{kernel}");
    assert!(sum.is_finite());
}

#[test]
fn no_kernel_allocates_in_a_step() {
    let triangles = "TERM a := Triangle 0 2 5; TERM b := Triangle 3 6 8;";
    check(triangles, "", "levels");
    check(triangles, "ACT : PROD;", "walk");
    check(&format!("{triangles} METHOD : COA;"), "", "walk");
    check("TERM a := Gaussian 2 1; TERM b := Gaussian 6 1;", "", "quadrature");
    check("TERM a := Gaussian 2 1; TERM b := Gaussian 6 1; METHOD : MM;", "", "sampled");
    check("TERM a := 1; TERM b := Linear 2 3; METHOD : COGS;", "", "weighted");
}
