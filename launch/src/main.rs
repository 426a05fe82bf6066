//! The launcher: checks, starts, watches, swaps and stops the services of a robot.

#![warn(clippy::print_stdout, clippy::print_stderr)] // What is printed goes through `console`, which nobody can hold up.

mod chaos;
mod cli;
mod commands;
mod compare;
mod conductor;
mod console;
mod control;
mod desk;
mod detach;
mod event;
mod experiment;
mod faults;
mod graph;
mod journal;
mod lockstep;
mod monitor;
mod new;
mod notes;
mod numbers;
mod observer;
mod order;
mod plain;
mod play;
mod prompter;
mod record;
mod rerun;
mod run;
mod runs;
mod shadow;
mod signals;
mod standstill;
mod statistics;
mod steering;
mod summary;
mod supervise;
mod swap;
mod up;
mod view;

use clap::Parser as _;
use cli::{Cli, Command, UpArgs};
use desk::Face;
use std::process::ExitCode;

fn main() -> ExitCode {
    match Cli::parse().command {
        Command::Check(args) => graph::check_command(&args.which.request(None), args.json),
        Command::Up(args) => up_command(&args),
        Command::Ps(args) => commands::finish(commands::ps(&args)),
        Command::Attach(args) => commands::finish(commands::attach(&args)),
        Command::Last(args) => commands::finish(commands::last(&args)),
        Command::Logs(args) => commands::finish(commands::logs(&args)),
        Command::Restart(args) => commands::finish(commands::restart(&args)),
        Command::Swap(args) => commands::finish(swap::command(&args)),
        Command::Stop(args) => commands::finish(commands::stop(&args)),
        Command::Chaos(args) => chaos::command(&args),
        Command::New(args) => commands::finish(new::command(&args)),
        Command::Experiment(args) => experiment::command(&args),
        Command::Graph(args) => graph::graph_command(&args.which.request(None), args.dot),
        Command::Order(args) => commands::finish(commands::order(&args)),
        Command::Digest { file, json } => commands::finish(compare::digest(&file, json)),
        Command::Diff { a, b, json } => match compare::diff(&a, &b, json) {
            Ok(code) => code,
            Err(error) => commands::finish(Err(error)),
        },
        Command::Rerun(args) => rerun::command(&args),
        Command::Completions { shell } => {
            cli::print_completions(shell);
            ExitCode::SUCCESS
        }
        Command::CleanDead { board } => {
            // What cannot be cleaned now is cleaned when the board is taken down; only a board that cannot be is an error.
            match board::place::Place::new(&board) {
                Ok(_) => {
                    let _ = board::host::clean_dead(&board);
                    ExitCode::SUCCESS
                }
                Err(error) => commands::finish(Err(error.to_string())),
            }
        }
    }
}

fn up_command(args: &UpArgs) -> ExitCode {
    let Some(graph) = graph::prepare(&args.which.request(args.board.as_deref())) else {
        return ExitCode::FAILURE;
    };
    if args.detach {
        return commands::finish(detach::detach(args.board.as_deref().unwrap_or(&graph.name)));
    }
    let options = up::Options {
        board: args.board.clone(),
        logs: args.log_dir.clone(),
        record: args.record.clone(),
        json: args.json,
        stay: args.stay,
    };
    let face = match (args.no_view, args.plain) {
        (true, _) => Face::Trouble,
        (false, true) => Face::Lines,
        (false, false) => face(),
    };
    if args.lockstep {
        let pace = run::Pace {
            speed: args.speed,
            until: args.until.map(messages::Time::from_secs_f64),
            cpu: args.cpu,
            record: args.record.clone(),
            steered: args.steered,
            ..run::Pace::default()
        };
        return lockstep::up(&graph, &options, &pace, face);
    }
    up::say_what_is_unwise(&graph);
    up::up(&graph, &options, face)
}

/// The whole terminal where it can show a picture, lines elsewhere.
fn face() -> Face {
    if let Some(why) = view::why_not() {
        console::warn(why);
    }
    if view::can_show() { Face::View } else { Face::Lines }
}
