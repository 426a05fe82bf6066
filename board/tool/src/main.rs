//! `board`: the tool that a person uses beside a running robot.

mod clean;
mod connect;
mod doctor;
mod echo;
mod examples;
mod info;
mod list;
mod output;
mod publish;
mod rate;
mod record;
mod recorded;
mod replay;
mod show;

use clap::{Args, CommandFactory as _, Parser, Subcommand};
use std::io;
use std::process::ExitCode;

type Outcome = Result<ExitCode, Box<dyn std::error::Error>>;

/// The exit code of a command that has waited as long as `--timeout` says.
pub(crate) const EXIT_TIMEOUT: u8 = 3;

#[derive(Debug, Parser)]
#[command(
    name = "board",
    version,
    about = "Look at the message board of a running robot",
    after_help = examples::help(
        examples::BOARD,
        "Without --board, the only board that is up is meant.\n\
         Exit codes: 0 it is done; 1 it is not, and the error says why; 2 the command line is wrong; 3 --timeout is over."
    )
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
    #[command(after_help = examples::help(examples::LIST, ""))]
    List(list::Options),
    /// What a topic's messages look like (fields, types, units, meanings), or what a recording holds.
    #[command(after_help = examples::help(examples::INFO, ""))]
    Info(info::Options),
    /// Print messages as they come, beginning with the last one.
    #[command(after_help = examples::help(
        examples::ECHO,
        "Numbers are shown with six digits; --json gives all of them."
    ))]
    Echo(echo::Options),
    /// Messages per second, periods and jitter.
    #[command(after_help = examples::help(examples::RATE, ""))]
    Rate(rate::RateOptions),
    /// How old messages are when they arrive: since they were published, and since the sensor reading behind
    /// them.
    #[command(after_help = examples::help(examples::DELAY, ""))]
    Delay(rate::DelayOptions),
    /// Publish messages by hand.
    #[command(after_help = examples::help(
        examples::PUBLISH,
        "Fields that are not given are zero. `--raw` publishes bytes as they are, whatever they mean.\n\
         Where a service publishes, and for wheels/ and safety/ where a service listens, only with --force."
    ))]
    Publish(publish::Options),
    /// Record messages into a file that also the tools of ROS 2 and Foxglove read; until Ctrl-C, or until the
    /// board goes down.
    #[command(after_help = examples::help(examples::RECORD, ""))]
    Record(record::Options),
    /// Publish the messages of a recording, in the name of those who published them.
    #[command(after_help = examples::help(examples::REPLAY, ""))]
    Replay(replay::Options),
    /// Clear away boards whose launcher is gone, and what the dead have left on boards that are up; with
    /// --board, that one alone.
    #[command(after_help = examples::help(examples::CLEAN, ""))]
    Clean,
    /// Check this machine and its boards; ends with 1 when there is a problem.
    #[command(after_help = examples::help(examples::DOCTOR, ""))]
    Doctor,
    /// Print a script that lets a shell complete commands.
    #[command(after_help = examples::help(examples::COMPLETIONS, ""))]
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
        Verb::Completions { shell } => completions(*shell),
        Verb::CleanDead { name } => {
            board::host::clean_dead(name).map(|_| ExitCode::SUCCESS).map_err(Into::into)
        }
    };
    outcome.unwrap_or_else(|error| {
        // `board echo .. | head -1`: the reader has seen enough.
        if error.downcast_ref::<io::Error>().is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe) {
            return ExitCode::SUCCESS;
        }
        show::error(&*error);
        ExitCode::FAILURE
    })
}

fn completions(shell: clap_complete::Shell) -> Outcome {
    // Not at once to the output, where a closed pipe would be a panic.
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "board", &mut script);
    show::raw(&script)?;
    Ok(ExitCode::SUCCESS)
}
