//! The command line.

use crate::graph::{Overrides, Request};
use board::arguments::{positive, seconds};
use clap::{Args, CommandFactory as _, Parser, Subcommand};
use std::path::PathBuf;
use std::time::Duration;

const EXAMPLES: &str = "\
Examples:
  launch check coffee                              is the graph in order?
  launch up coffee                                 start it, watch it, Ctrl-C stops it
  launch up coffee --swap planner=sampling-planner --seed 7
  launch up coffee --set collision-avoidance.front_radius_m=0.25 --detach
  launch experiment coffee                         many runs, with statistics and plots
  launch rerun a.mcap                              does a recorded run come out the same?
  launch order 207                                 coffee for room 207, please
  launch swap controller=window-controller         while it drives
  launch logs planner -f                           follow what the planner says
  launch stop                                      stop the robot, then its services";

/// Checks, starts, watches and stops the services of a robot.
#[derive(Debug, Parser)]
#[command(name = "launch", version, about, after_help = EXAMPLES, max_term_width = 100)]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Check a graph against its binaries, without starting anything
    #[command(
        after_help = "Exit code: 0 in order, 1 refused. Every mistake is listed with its line and what to do about it."
    )]
    Check(CheckArgs),
    /// Start a graph and watch over it until Ctrl-C, or until its run ends
    #[command(after_help = UP_HELP)]
    Up(UpArgs),
    /// List the services of a running graph
    Ps(StatusArgs),
    /// Watch a running graph: the view of `launch up`, on a robot that runs already
    #[command(visible_alias = "top", after_help = ATTACH_HELP)]
    Attach(AttachArgs),
    /// Say how the last run ended, and where its logs are
    Last(LastArgs),
    /// Show what services said
    Logs(LogsArgs),
    /// Start a service of a running graph anew
    Restart(RestartArgs),
    /// Let another service play a role while the robot runs, without a gap
    #[command(after_help = SWAP_HELP)]
    Swap(SwapArgs),
    /// Stop a running graph: the robot first, then its services
    Stop(StopArgs),
    /// Run variants of a graph many times in lockstep, and compare them
    #[command(after_help = EXPERIMENT_HELP)]
    Experiment(ExperimentArgs),
    /// Kill, stop and restart services of a live robot at random, and check that it stays safe and heals
    #[command(after_help = CHAOS_HELP)]
    Chaos(ChaosArgs),
    /// Write a small service to begin with: parameters, step, tests, shell
    #[command(after_help = NEW_HELP)]
    New(NewArgs),
    /// Draw services and topics
    #[command(
        after_help = "Examples:\n  launch graph coffee > coffee.mmd\n  launch graph coffee --dot | dot -Tsvg > coffee.svg"
    )]
    Graph(GraphArgs),
    /// Give an order to the robot, such as a coffee to a room
    #[command(
        after_help = "Exit code: 0 the robot has taken the order, 1 it has refused it or does not answer.\n\nExample:\n  launch order 211"
    )]
    Order(OrderArgs),
    /// Hash a recording: equal for equal runs
    Digest {
        /// The recording
        #[arg(value_name = "FILE.mcap", value_hint = clap::ValueHint::FilePath)]
        file: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Show where two recorded runs first differ: topic, logical time, field and both values
    #[command(after_help = "Exit code: 0 the runs are the same, 1 they differ.")]
    Diff {
        /// One recording
        #[arg(value_name = "A.mcap", value_hint = clap::ValueHint::FilePath)]
        a: PathBuf,
        /// The other
        #[arg(value_name = "B.mcap", value_hint = clap::ValueHint::FilePath)]
        b: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Run a recording again: the same graph, or single services on the recorded inputs, and compare
    #[command(after_help = RERUN_HELP)]
    Rerun(RerunArgs),
    /// Print completions for a shell
    #[command(
        after_help = "Example:\n  launch completions bash > ~/.local/share/bash-completion/completions/launch"
    )]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Clean up after services that died; the launcher calls this by itself
    #[command(hide = true)]
    CleanDead {
        /// The board
        board: String,
    },
}

const UP_HELP: &str = "\
On a terminal a live view shows services, map and mission; elsewhere, and with --plain, each event is a line.
Exit code: 0 the run passed or was stopped, 1 refused or failed.

Examples:
  launch up coffee
  launch up coffee --without current-state --set planner.launch.log=debug
  launch up coffee --stay --set navigator.default_order=\"\"      waits for orders
  launch up ./my-robot.toml --detach --board lab-2";

const ATTACH_HELP: &str = "\
The robot goes on when the view is left with q. `?` shows the keys: select a service, its log, start it anew, give an order, filter, sort; in logical time
also pause, step and pace. Elsewhere than on a terminal it is a table a second.

Examples:
  launch attach
  launch top --json | jq .services[].rate_hz";

const EXPERIMENT_HELP: &str = "\
Every finished run is in runs.csv at once: after an interruption the same command does the rest. Runs whose binaries, worlds or
parameters have changed since are done again; runs of other seeds and variants stay in it. Variants are compared with the
first one run by run: the same situation, the same seed. A variant that needs files which are not there is left out, with a word.
Exit code: 0 all runs were done and every expectation of the file holds, 1 otherwise.

Examples:
  launch experiment coffee
  launch experiment coffee --dry-run --seeds 1..3
  launch experiment coffee --only \"fuzzy rules\" --only \"dynamic window\" --by default_order
  launch experiment coffee --only \"fuzzy rules\" --sweep planner.clearance_m=0.2,0.3,0.4 --out /tmp/clearance
  launch experiment ./radii.toml --jobs 1 --out /tmp/radii";

const CHAOS_HELP: &str = "\
Everybody is hit but the simulator and the referee, which are no part of the robot. After each deed it is checked that the wheels stood in time when
the victim was in their chain, and that the victim came back; at the end that nothing was touched and nothing is left behind. The robot is kept busy
with orders where the graph takes them.
Exit code: 0 everything held, 1 otherwise.

Examples:
  launch chaos coffee --kills 100
  launch chaos coffee --kills 1000 --seed 7 --spare planner --json";

const NEW_HELP: &str = "\
It builds, passes its tests and runs in a graph as it is. In a source checkout it becomes a member of the workspace; in another folder it is a repository of its
own, and a graph names it by its path.

Examples:
  launch new door-bell
  launch new door-bell --in ~/my-robot";

const SWAP_HELP: &str = "\
The newcomer starts beside the old service, mute. When it takes steps and has something to say, its messages count, and the old one is asked to
leave. If it dies or refuses its parameters before, the old one goes on as it was.
A shadow stays mute: what it would say is shown against what the service says, field by field, until Ctrl-C.

Examples:
  launch swap controller=window-controller
  launch swap planner=sampling-planner --set robot_radius_m=0.32
  launch swap controller=window-controller --shadow --for 30
  launch swap --back controller";

const RERUN_HELP: &str = "\
Without a change the whole graph runs again, with the recorded seed and whatever came from outside: every message must be the same.
With --with or --set only the services named there run, and --only adds more; everything that they read comes from the recording, in the very
instants in which it was said (open loop). What they answer is compared with what was answered then, but does not act upon the world.
With --closed the whole graph runs anew with the change, so that the change acts upon everything that follows.

Exit code: 0 the same, 1 different, 2 not run.

Examples:
  launch up coffee --lockstep --seed 7 --record a.mcap
  launch rerun a.mcap                                      is it the same again?
  launch rerun a.mcap --only planner                       the planner alone, on the recorded inputs
  launch rerun a.mcap --with controller=window-controller  what would this one have done?
  launch rerun a.mcap --set controller.track_m=0.42 --closed --record b.mcap";

/// Which graph, and what is different about it this time.
#[derive(Debug, Clone, Args)]
pub(crate) struct Which {
    /// A graph's name (`coffee`), or the path of its file
    #[arg(value_name = "GRAPH", value_hint = clap::ValueHint::FilePath)]
    pub(crate) graph: String,
    /// Give a parameter another value; any number of times
    #[arg(long, value_name = "ROLE.KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Let another binary play a role; any number of times
    #[arg(long, value_name = "ROLE=BINARY")]
    pub(crate) swap: Vec<String>,
    /// Leave a service out; any number of times
    #[arg(long, value_name = "ROLE")]
    pub(crate) without: Vec<String>,
    /// The seed from which all randomness comes
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// In a source checkout: use what is built already
    #[arg(long)]
    pub(crate) no_build: bool,
}

impl Which {
    /// The same for the checker.
    pub(crate) fn request(&self, board: Option<&str>) -> Request {
        Request {
            graph: self.graph.clone(),
            overrides: Overrides {
                set: self.set.clone(),
                swap: self.swap.clone(),
                without: self.without.clone(),
                seed: self.seed,
                board: board.map(str::to_owned),
            },
            build: !self.no_build,
        }
    }
}

/// Which running board.
#[derive(Debug, Clone, Args)]
pub(crate) struct Running {
    /// The board; not needed while only one is up
    #[arg(long, value_name = "NAME")]
    pub(crate) board: Option<String>,
}

/// `launch check`.
#[derive(Debug, Clone, Args)]
pub(crate) struct CheckArgs {
    /// The graph.
    #[command(flatten)]
    pub(crate) which: Which,
    /// Print verdict, mistakes, services and topics as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// `launch up`.
#[derive(Debug, Clone, Args)]
pub(crate) struct UpArgs {
    /// The graph.
    #[command(flatten)]
    pub(crate) which: Which,
    /// Come back when all is ready, and leave the graph running
    #[arg(long, conflicts_with_all = ["lockstep", "plain", "no_view"])]
    pub(crate) detach: bool,
    /// Go on when the judge has spoken: a robot that just serves, until it is stopped
    #[arg(long, conflicts_with = "lockstep")]
    pub(crate) stay: bool,
    /// Name the board otherwise than the graph does, to run it twice
    #[arg(long, value_name = "NAME")]
    pub(crate) board: Option<String>,
    /// Print a line an event, also on a terminal
    #[arg(long)]
    pub(crate) plain: bool,
    /// Neither a live view nor lines; only what goes wrong
    #[arg(long, conflicts_with = "plain")]
    pub(crate) no_view: bool,
    /// Run in logical time: as fast as possible, identical in every run with one seed
    #[arg(long)]
    pub(crate) lockstep: bool,
    /// In lockstep: logical seconds a second, instead of as fast as possible
    #[arg(long, value_name = "X", requires = "lockstep", value_parser = positive)]
    pub(crate) speed: Option<f64>,
    /// In lockstep: end after so many logical seconds
    #[arg(long, value_name = "SECONDS", requires = "lockstep", value_parser = positive)]
    pub(crate) until: Option<f64>,
    /// In lockstep: the processor for the whole graph
    #[arg(long, value_name = "N", requires = "lockstep")]
    pub(crate) cpu: Option<usize>,
    /// Record every message into this file (MCAP)
    #[arg(long, value_name = "FILE.mcap", value_hint = clap::ValueHint::FilePath)]
    pub(crate) record: Option<PathBuf>,
    /// In lockstep: go on only when told to, by lines on the standard input (`advance SECONDS`, `look`, `kill ROLE`, `end`); for tests
    #[arg(long, requires = "lockstep", hide = true)]
    pub(crate) steered: bool,
    /// Print the referee's figures as JSON at the end
    #[arg(long)]
    pub(crate) json: bool,
    /// Where the logs of the services go
    #[arg(long, value_name = "DIR", value_hint = clap::ValueHint::DirPath)]
    pub(crate) log_dir: Option<PathBuf>,
}

/// `launch rerun`.
#[derive(Debug, Clone, Args)]
pub(crate) struct RerunArgs {
    /// The recording, made with `launch up --lockstep --record`
    #[arg(value_name = "FILE.mcap", value_hint = clap::ValueHint::FilePath)]
    pub(crate) file: PathBuf,
    /// Let another binary play a role; any number of times
    #[arg(long, value_name = "ROLE=BINARY")]
    pub(crate) with: Vec<String>,
    /// Give a parameter another value; any number of times
    #[arg(long, value_name = "ROLE.KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Run this service on the recorded inputs, also if nothing about it has changed; any number of times
    #[arg(long, value_name = "ROLE", conflicts_with = "closed")]
    pub(crate) only: Vec<String>,
    /// Run the whole graph, so that a change acts upon everything that follows
    #[arg(long)]
    pub(crate) closed: bool,
    /// Take this graph instead of the recorded one
    #[arg(long, value_name = "GRAPH")]
    pub(crate) graph: Option<String>,
    /// Record the rerun
    #[arg(long, value_name = "OUT.mcap", value_hint = clap::ValueHint::FilePath)]
    pub(crate) record: Option<PathBuf>,
    /// Name the board otherwise than `rerun-PROCESS`
    #[arg(long, value_name = "NAME")]
    pub(crate) board: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// In a source checkout: use what is built already
    #[arg(long)]
    pub(crate) no_build: bool,
}

/// `launch attach`.
#[derive(Debug, Clone, Args)]
pub(crate) struct AttachArgs {
    /// The board.
    #[command(flatten)]
    pub(crate) running: Running,
    /// Print a table a second, also on a terminal
    #[arg(long)]
    pub(crate) plain: bool,
    /// Print JSON, a line a second
    #[arg(long, conflicts_with = "plain")]
    pub(crate) json: bool,
}

/// `launch last`.
#[derive(Debug, Clone, Args)]
pub(crate) struct LastArgs {
    /// The board.
    #[command(flatten)]
    pub(crate) running: Running,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// `launch ps`.
#[derive(Debug, Clone, Args)]
pub(crate) struct StatusArgs {
    /// The board.
    #[command(flatten)]
    pub(crate) running: Running,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// `launch logs`.
#[derive(Debug, Clone, Args)]
pub(crate) struct LogsArgs {
    /// The service, or `launch` for what happened to all of them; everybody without
    #[arg(value_name = "SERVICE")]
    pub(crate) service: Option<String>,
    /// Of the last run, although a robot is up
    #[arg(long, conflicts_with = "follow")]
    pub(crate) last: bool,
    /// Go on as they speak
    #[arg(short, long)]
    pub(crate) follow: bool,
    /// How many lines from before
    #[arg(short = 'n', long, value_name = "N", default_value_t = 50)]
    pub(crate) lines: usize,
    /// The board.
    #[command(flatten)]
    pub(crate) running: Running,
}

/// `launch restart`.
#[derive(Debug, Clone, Args)]
pub(crate) struct RestartArgs {
    /// The service
    #[arg(value_name = "SERVICE")]
    pub(crate) service: String,
    /// The board.
    #[command(flatten)]
    pub(crate) running: Running,
}

/// `launch swap`.
#[derive(Debug, Clone, Args)]
pub(crate) struct SwapArgs {
    /// The role, and the binary that is to play it (a name, or a path)
    #[arg(value_name = "ROLE=BINARY", required_unless_present = "back")]
    pub(crate) swap: Option<String>,
    /// A parameter of the newcomer; any number of times
    #[arg(long, value_name = "KEY=VALUE", conflicts_with = "back")]
    pub(crate) set: Vec<String>,
    /// Keep it mute, and show how its messages differ
    #[arg(long, conflicts_with = "back")]
    pub(crate) shadow: bool,
    /// With --shadow: end after so many seconds, instead of on Ctrl-C
    #[arg(long = "for", value_name = "SECONDS", requires = "shadow", value_parser = seconds)]
    pub(crate) length: Option<Duration>,
    /// Let it run beside the old one for so many seconds at least
    #[arg(long, value_name = "SECONDS", conflicts_with_all = ["back", "shadow"], value_parser = seconds)]
    pub(crate) warm_up: Option<Duration>,
    /// Bring back what played this role before, or send its newcomer away
    #[arg(long, value_name = "ROLE", conflicts_with = "swap")]
    pub(crate) back: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// In a source checkout: use what is built already
    #[arg(long)]
    pub(crate) no_build: bool,
    /// The board.
    #[command(flatten)]
    pub(crate) running: Running,
}

/// `launch stop`.
#[derive(Debug, Clone, Args)]
pub(crate) struct StopArgs {
    /// Do not wait for services that take their time
    #[arg(long)]
    pub(crate) fast: bool,
    /// The board.
    #[command(flatten)]
    pub(crate) running: Running,
}

/// `launch experiment`.
#[derive(Debug, Clone, Args)]
pub(crate) struct ExperimentArgs {
    /// An experiment's name (`coffee`), or the path of its file
    #[arg(value_name = "EXPERIMENT", value_hint = clap::ValueHint::FilePath)]
    pub(crate) file: PathBuf,
    /// How many runs at once; as many as there are processors without
    #[arg(long, value_name = "N")]
    pub(crate) jobs: Option<usize>,
    /// Where runs.csv, table.md and the plots go; `results/NAME` without
    #[arg(long, value_name = "DIR", value_hint = clap::ValueHint::DirPath)]
    pub(crate) out: Option<PathBuf>,
    /// Go on where an interrupted experiment was; that is always done, unless --fresh is given
    #[arg(long, hide = true)]
    pub(crate) resume: bool,
    /// Do all runs again
    #[arg(long, conflicts_with = "resume")]
    pub(crate) fresh: bool,
    /// Only this variant of the file; any number of times. The first of those that are left is what the
    /// others are compared with
    #[arg(long, value_name = "VARIANT")]
    pub(crate) only: Vec<String>,
    /// Other seeds than the file's, for every variant: from the first to the last (1..20), or single ones
    /// (3,5,8)
    #[arg(long, value_name = "SEEDS")]
    pub(crate) seeds: Option<String>,
    /// Make several of each variant, one for each value of a parameter (or binary of a role); any number of
    /// times
    #[arg(long, value_name = "ROLE.KEY=A,B,..")]
    pub(crate) sweep: Vec<String>,
    /// Give a parameter another value in all variants; any number of times
    #[arg(long, value_name = "ROLE.KEY=VALUE")]
    pub(crate) set: Vec<String>,
    /// Show passes and figures for each value of this axis of the situations, such as `default_order`
    #[arg(long, value_name = "AXIS")]
    pub(crate) by: Option<String>,
    /// Show all tables, and not only what differs most clearly
    #[arg(long)]
    pub(crate) all: bool,
    /// Check every variant, list them, and say how long they will take; without a run
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// In a source checkout: use what is built already
    #[arg(long)]
    pub(crate) no_build: bool,
}

/// `launch chaos`.
#[derive(Debug, Clone, Args)]
pub(crate) struct ChaosArgs {
    /// The graph.
    #[command(flatten)]
    pub(crate) which: Which,
    /// How many deeds
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) kills: u64,
    /// Who is not hit; any number of times
    #[arg(long, value_name = "ROLE")]
    pub(crate) spare: Vec<String>,
    /// Name the board otherwise than the graph does
    #[arg(long, value_name = "NAME")]
    pub(crate) board: Option<String>,
    /// Record every message into this file (MCAP)
    #[arg(long, value_name = "FILE.mcap", value_hint = clap::ValueHint::FilePath)]
    pub(crate) record: Option<PathBuf>,
    /// Print what happens, a line an event
    #[arg(long)]
    pub(crate) events: bool,
    /// Print the report as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Where the logs of the services go
    #[arg(long, value_name = "DIR", value_hint = clap::ValueHint::DirPath)]
    pub(crate) log_dir: Option<PathBuf>,
}

/// `launch new`.
#[derive(Debug, Clone, Args)]
pub(crate) struct NewArgs {
    /// The service's name: a noun in lower-case letters, digits and hyphens
    #[arg(value_name = "NAME")]
    pub(crate) name: String,
    /// The folder in which its folder is made; `services` of the checkout without
    #[arg(long = "in", value_name = "DIR", value_hint = clap::ValueHint::DirPath)]
    pub(crate) folder: Option<PathBuf>,
    /// The sources of Corkboard, when the launcher was not built from a checkout
    #[arg(long, value_name = "DIR", value_hint = clap::ValueHint::DirPath)]
    pub(crate) corkboard: Option<PathBuf>,
}

/// `launch graph`.
#[derive(Debug, Clone, Args)]
pub(crate) struct GraphArgs {
    /// The graph.
    #[command(flatten)]
    pub(crate) which: Which,
    /// As Mermaid, for Markdown pages (the default)
    #[arg(long)]
    pub(crate) mermaid: bool,
    /// For Graphviz
    #[arg(long, conflicts_with = "mermaid")]
    pub(crate) dot: bool,
}

/// `launch order`.
#[derive(Debug, Clone, Args)]
pub(crate) struct OrderArgs {
    /// The room, such as 207
    #[arg(value_name = "ROOM")]
    pub(crate) room: String,
    /// The board.
    #[command(flatten)]
    pub(crate) running: Running,
}

/// Prints the completions of the command line.
pub(crate) fn print_completions(shell: clap_complete::Shell) {
    clap_complete::generate(shell, &mut Cli::command(), "launch", &mut std::io::stdout());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_sound() {
        Cli::command().debug_assert();
    }

    /// Every line of a help text that begins with the command's name, without what it is for.
    fn examples(command: &clap::Command) -> Vec<String> {
        let mut texts: Vec<String> = [command.get_after_help(), command.get_after_long_help()]
            .into_iter()
            .flatten()
            .map(ToString::to_string)
            .collect();
        let below: Vec<String> = command.get_subcommands().flat_map(examples).collect();
        let own = texts.iter_mut().flat_map(|text| {
            let lines = text.lines().map(str::trim).filter(|line| line.starts_with("launch "));
            lines.map(|line| line.split("  ").next().unwrap_or(line).to_owned()).collect::<Vec<_>>()
        });
        own.collect::<Vec<_>>().into_iter().chain(below).collect()
    }

    /// The words of a line as a shell takes them, up to a pipe or a redirection.
    fn words(line: &str) -> Vec<String> {
        let mut words = vec![String::new()];
        let mut quote = None;
        for letter in line.chars() {
            match (quote, letter) {
                (Some(open), letter) if letter == open => quote = None,
                (None, '\'' | '"') => quote = Some(letter),
                (None, '|' | '>') => break,
                (None, ' ') => words.push(String::new()),
                (_, letter) => words.last_mut().unwrap().push(letter),
            }
        }
        words.retain(|word| !word.is_empty());
        words
    }

    #[test]
    fn every_example_of_the_help_is_a_command() {
        let examples = examples(&Cli::command());
        assert!(examples.len() > 25, "{examples:?}");
        for example in examples {
            if let Err(error) = Cli::try_parse_from(words(&example)) {
                panic!("`{example}`: {error}");
            }
        }
    }

    #[test]
    fn overrides_reach_the_checker() {
        let cli = Cli::parse_from([
            "launch", "up", "coffee", "--set", "a.b=1", "--swap", "c=d", "--seed", "7", "--board", "x",
        ]);
        let Command::Up(args) = cli.command else { panic!("not `up`") };
        let request = args.which.request(args.board.as_deref());
        assert_eq!(request.graph, "coffee");
        assert!(request.build);
        assert_eq!(
            request.overrides,
            Overrides {
                set: vec!["a.b=1".to_owned()],
                swap: vec!["c=d".to_owned()],
                without: vec![],
                seed: Some(7),
                board: Some("x".to_owned()),
            }
        );
    }
}
