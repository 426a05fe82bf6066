//! The shell of the fuzzy controller: until the board runs services it only checks its rules.

use fuzzy_controller::{FuzzyController, Params};
use std::process::ExitCode;

fn main() -> ExitCode {
    match FuzzyController::new(Params::default()) {
        Ok(_) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("fuzzy-controller: {error}");
            ExitCode::FAILURE
        }
    }
}
