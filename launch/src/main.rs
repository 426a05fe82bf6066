//! The launcher: checks, starts, watches and stops the services of a robot.

mod cli;
mod graph;

use clap::Parser as _;
use cli::{Cli, Command};
use std::process::ExitCode;

fn main() -> ExitCode {
    match Cli::parse().command {
        Command::Check(args) => graph::check_command(&args.which.request(None), args.json),
        Command::Graph(args) => graph::graph_command(&args.which.request(None), args.dot),
        Command::Completions { shell } => {
            cli::print_completions(shell);
            ExitCode::SUCCESS
        }
        Command::Up(_)
        | Command::Ps(_)
        | Command::Top(_)
        | Command::Logs(_)
        | Command::Restart(_)
        | Command::Stop(_)
        | Command::Order(_) => {
            eprintln!("error: this command does not exist yet");
            ExitCode::FAILURE
        }
    }
}
