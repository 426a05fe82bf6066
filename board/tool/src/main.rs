//! `board`: the tool that a person uses beside a running robot.

mod clean;
mod connect;
mod doctor;
mod echo;
mod info;
mod list;
mod publish;
mod rate;
mod record;
mod replay;
mod show;

use clap::{Args, CommandFactory as _, Parser, Subcommand};
use std::io;
use std::process::ExitCode;

type Outcome = Result<ExitCode, Box<dyn std::error::Error>>;

#[derive(Debug, Parser)]
#[command(
    name = "board",
    version,
    about = "Look at the message board of a running robot",
    after_help = "Examples:\n  board list                                 what is on the board, who publishes it, how often\n  board echo safety/clearance                every message, with names and units\n  board echo wheels/odometry --field left_mps --json -n 10\n  board rate tof/ranges laser/scan           messages per second and how regular they are\n  board doctor                               what is wrong with this machine, and what to do\n\nWithout --board, the only board that is up is meant."
)]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Verb,
}

#[derive(Debug, Args)]
struct Common {
    /// The board; without it, the only one that is up.
    #[arg(long, global = true, value_name = "NAME")]
    board: Option<String>,
    /// Print JSON, for programs.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Topics: type, publisher, readers, how many messages, how often, how long ago.
    #[command(
        after_help = "Examples:\n  board list\n  board list --services\n  board list --json | jq '.[].topic'"
    )]
    List(list::Options),
    /// What a topic's messages look like: fields, types, units, meanings.
    #[command(after_help = "Example:\n  board info safety/clearance")]
    Info(info::Options),
    /// Print messages as they come, beginning with the last one.
    #[command(
        after_help = "Examples:\n  board echo safety/clearance\n  board echo pose --field pose.x_m\n  board echo laser/scan --json -n 1 | jq '.message.elements | length'"
    )]
    Echo(echo::Options),
    /// Messages per second, periods and jitter.
    #[command(after_help = "Examples:\n  board rate\n  board rate tof/ranges --interval 5 -n 1 --json")]
    Rate(rate::RateOptions),
    /// How old messages are when they arrive: since they were published, and since the sensor reading behind them.
    #[command(after_help = "Example:\n  board delay wheels/applied -n 1000")]
    Delay(rate::DelayOptions),
    /// Publish messages by hand.
    #[command(
        after_help = "Examples:\n  board publish mission/order '{\"office\": 7}'\n  board publish wheels/desired '{}' --rate 20 -n 100 --force\n  board publish safety/clearance --raw random --seed 7 -n 1000 --rate 500\n  board publish laser/scan --raw @scan.bin\n\nFields that are not given are zero. `--raw` publishes bytes as they are, whatever they mean, and so needs no --force."
    )]
    Publish(publish::Options),
    /// Record messages into a file that also the tools of ROS 2 and Foxglove read; until Ctrl-C, or until the board goes down.
    #[command(
        after_help = "Examples:\n  board record -o drive.mcap\n  board record 'tof/*' wheels/applied -o short.mcap --duration 10"
    )]
    Record(record::Options),
    /// Publish the messages of a recording, in the name of those who published them.
    #[command(
        after_help = "Examples:\n  board replay drive.mcap --topics 'tof/*',tag/ranges\n  board replay drive.mcap --speed 10 --loop"
    )]
    Replay(replay::Options),
    /// Clear away boards whose launcher is gone, and what the dead have left on boards that are up.
    #[command(after_help = "Example:\n  board clean")]
    Clean,
    /// Check this machine and its boards; ends with 1 when there is a problem.
    #[command(after_help = "Example:\n  board doctor || echo 'not fit to drive'")]
    Doctor,
    /// Print a script that lets a shell complete commands.
    #[command(
        after_help = "Example:\n  board completions bash > ~/.local/share/bash-completion/completions/board"
    )]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// What `clean` runs in a process of its own, because it can hang.
    #[command(hide = true)]
    CleanDead {
        /// The board.
        name: String,
    },
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let common = &cli.common;
    let outcome = match &cli.command {
        Verb::List(options) => list::run(common, options),
        Verb::Info(options) => info::run(common, options),
        Verb::Echo(options) => echo::run(common, options),
        Verb::Rate(options) => rate::run(common, options),
        Verb::Delay(options) => rate::run_delay(common, options),
        Verb::Publish(options) => publish::run(common, options),
        Verb::Record(options) => record::run(common, options),
        Verb::Replay(options) => replay::run(common, options),
        Verb::Clean => clean::run(common),
        Verb::Doctor => doctor::run(common),
        Verb::Completions { shell } => {
            clap_complete::generate(*shell, &mut Cli::command(), "board", &mut io::stdout());
            Ok(ExitCode::SUCCESS)
        }
        Verb::CleanDead { name } => {
            board::host::clean_dead(name).map(|_| ExitCode::SUCCESS).map_err(Into::into)
        }
    };
    outcome.unwrap_or_else(|error| {
        // `board echo .. | head -1`: the reader has seen enough.
        if error.downcast_ref::<io::Error>().is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe) {
            return ExitCode::SUCCESS;
        }
        eprintln!("{}: {error}", show::bad(io::IsTerminal::is_terminal(&io::stderr()), "error"));
        ExitCode::FAILURE
    })
}
