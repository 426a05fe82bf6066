//! A test runner of a few lines: the test binary is also the services that its tests start, so it needs a
//! `main` of its own.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

/// A test and its name.
pub(crate) type Case = (&'static str, fn());

/// Runs the tests whose names contain the arguments, one after the other; answers `--list` for runners that
/// ask.
pub(crate) fn run(cases: &[Case]) -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |flag: &str| arguments.iter().any(|argument| argument == flag);
    if has("--list") {
        let shown: &[Case] = if has("--ignored") { &[] } else { cases };
        shown.iter().for_each(|(name, _)| println!("{name}: test"));
        return ExitCode::SUCCESS;
    }
    let filters: Vec<&String> = arguments.iter().filter(|argument| !argument.starts_with('-')).collect();
    let chosen = |name: &str| {
        filters.is_empty()
            || filters
                .iter()
                .any(|filter| if has("--exact") { name == **filter } else { name.contains(*filter) })
    };
    let mut failed = Vec::new();
    for (name, test) in cases.iter().filter(|(name, _)| chosen(name)) {
        print!("test {name} ... ");
        let _ = std::io::Write::flush(&mut std::io::stdout());
        if catch_unwind(AssertUnwindSafe(test)).is_ok() {
            println!("ok");
        } else {
            println!("FAILED");
            failed.push(*name);
        }
    }
    if failed.is_empty() {
        return ExitCode::SUCCESS;
    }
    println!("failed: {}", failed.join(", "));
    ExitCode::FAILURE
}
