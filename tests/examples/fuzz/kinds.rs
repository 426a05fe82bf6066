//! What is done with a damaged file of each kind.

use crate::worker::{MEMORY_MAX, PASSED_MAX, USED_MAX_S, binaries};
use board::clock;
use clap::ValueEnum;
use fuzzy::{Engine, Options, fcl};
use geometry::{OccupancyGrid, World};
use grid_planner::GridPlanner;
use log_player::LogPlayer;
use messages::Time;
use rand::RngExt as _;
use rand_pcg::Pcg64Mcg;
use recording::Recording;
use rustix::process::{Pid, Resource, Rlimit, prlimit};
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// What a damaged file is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Kind {
    /// A map's description
    MapYaml,
    /// A map's picture
    MapImage,
    /// A world
    World,
    /// A drive with a laser
    Carmen,
    /// A drive with radio beacons
    StepLog,
    /// Rules of the fuzzy controller
    Fcl,
    /// A recording
    Mcap,
    /// Parameters of a service
    Params,
    /// A graph
    Graph,
    /// An experiment
    Experiment,
}

/// Services that are asked with damaged parameters: all that have other than numbers, and some that have
/// many.
pub(crate) const SERVICES: &[&str] = &[
    "grid-planner",
    "sampling-planner",
    "particle-localiser",
    "mapper",
    "log-player",
    "fuzzy-controller",
    "simulator",
    "tag-localiser",
    "window-controller",
    "referee",
    "executive",
    "base-driver",
];

/// A damaged file, and where it is to be read.
#[derive(Debug)]
pub(crate) struct Trial<'a> {
    /// With whatever belongs to it.
    pub(crate) folder: &'a Path,
    pub(crate) bytes: &'a [u8],
    /// Of which valid file it was made.
    pub(crate) of: usize,
}

/// Whether a file was read, or refused in order; or what is wrong with how it was.
pub(crate) type Verdict = Result<bool, String>;

impl Kind {
    /// As on the command line.
    pub(crate) fn name(self) -> String {
        self.to_possible_value().unwrap().get_name().to_owned()
    }

    /// Whether the reader is a part of this process; otherwise a binary is asked.
    pub(crate) fn is_read_here(self) -> bool {
        !matches!(self, Self::Params | Self::Graph | Self::Experiment)
    }

    /// Lets the product read a file.
    pub(crate) fn read(self, trial: &Trial<'_>, chance: &mut Pcg64Mcg) -> Verdict {
        match self {
            Self::MapYaml => map(&trial.write("map.yaml")),
            Self::MapImage => map_image(trial, chance),
            Self::World => world(trial),
            Self::Carmen => log(trial, log_player::Format::Carmen, chance),
            Self::StepLog => log(trial, log_player::Format::Steps, chance),
            Self::Fcl => rules(trial.bytes),
            Self::Mcap => recording(&trial.write("damaged.mcap")),
            Self::Params => params(trial),
            Self::Graph => {
                ask(trial, "launch", &["check", "--no-build", &trial.write("graph.toml").to_string_lossy()])
            }
            Self::Experiment => {
                let file = trial.write("experiment.toml");
                let out = trial.folder.join("out");
                let words = [
                    "experiment",
                    "--dry-run",
                    "--no-build",
                    "--out",
                    &out.to_string_lossy(),
                    &file.to_string_lossy(),
                ];
                ask(trial, "launch", &words)
            }
        }
    }
}

impl Trial<'_> {
    fn write(&self, name: &str) -> PathBuf {
        let path = self.folder.join(name);
        std::fs::write(&path, self.bytes).unwrap();
        path
    }
}

/// A map is looked at before it is loaded, and must then be the same.
fn map(yaml: &Path) -> Verdict {
    let seen = OccupancyGrid::look(yaml);
    match (seen, OccupancyGrid::load(yaml)) {
        (Ok(frame), Ok(grid)) if frame == *grid.frame() => Ok(true),
        (Ok(frame), Ok(grid)) => Err(format!("its head says {frame:?}, and it is {:?}", grid.frame())),
        (Err(error), Ok(_)) => Err(format!("it loads, and its head is refused: {error}")),
        (_, Err(error)) => refused(&error.to_string()),
    }
}

fn map_image(trial: &Trial<'_>, chance: &mut Pcg64Mcg) -> Verdict {
    let name = crate::seeds::IMAGES[trial.of % crate::seeds::IMAGES.len()];
    trial.write(name);
    let mode = ["trinary", "scale", "raw"][chance.random_range(0..3)];
    let yaml = trial.folder.join("map.yaml");
    let text = format!(
        "image: {name}\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\nmode: {mode}\n"
    );
    std::fs::write(&yaml, text).unwrap();
    map(&yaml)
}

/// A world is read, and the grids are made of it that services make.
fn world(trial: &Trial<'_>) -> Verdict {
    let file = trial.write("world.toml");
    let world = match World::load(&file) {
        Ok(world) => world,
        Err(error) => return refused(&error.to_string()),
    };
    for floor in world.floors.iter().map(|floor| floor.number).take(3) {
        let _ = world.wall_segments(floor).len() + world.openings_of(floor).count();
        let _ = world.scene(floor);
    }
    let name = file.to_string_lossy().into_owned();
    let params = grid_planner::Params { world: name.clone(), ..Default::default() };
    let planner = GridPlanner::check(&params).and_then(|()| GridPlanner::new(params)).map(drop);
    let params = particle_localiser::Params { world: name, ..Default::default() };
    let localiser = particle_localiser::Map::load(&params).map(drop);
    match (planner, localiser) {
        (Ok(()), Ok(())) => Ok(true),
        (Err(error), _) => refused(&error.to_string()),
        (_, Err(error)) => refused(&error.to_string()),
    }
}

/// A log is played from its first to its last message.
fn log(trial: &Trial<'_>, format: log_player::Format, chance: &mut Pcg64Mcg) -> Verdict {
    let name = if chance.random_bool(0.1) { "drive.log.gz" } else { "drive.log" };
    let file = trial.folder.join(name);
    if name.ends_with(".gz") {
        let mut packed =
            flate2::write::GzEncoder::new(File::create(&file).unwrap(), flate2::Compression::fast());
        packed.write_all(trial.bytes).unwrap();
        packed.finish().unwrap();
        if chance.random_bool(0.3) {
            let mut bytes = std::fs::read(&file).unwrap();
            let at = chance.random_range(0..bytes.len());
            bytes[at] = chance.random();
            std::fs::write(&file, bytes).unwrap();
        }
    } else {
        std::fs::write(&file, trial.bytes).unwrap();
    }
    let params = log_player::Params {
        file: file.to_string_lossy().into_owned(),
        format,
        truth: if chance.random_bool(0.1) { file.to_string_lossy().into_owned() } else { String::new() },
        ..Default::default()
    };
    let log = match log_player::check_files(&params).and_then(|()| log_player::load(&params)) {
        Ok(log) => log,
        Err(error) => return refused(&error.to_string()),
    };
    let is_sound = log.problem_count == 0;
    let mut player = match LogPlayer::new(&params, log) {
        Ok(player) => player,
        Err(error) => return refused(&error.to_string()),
    };
    let step = (player.length() / 1000).max(Duration::from_millis(100));
    let mut now = Time::ZERO;
    // The wait before the first message, and whatever comes together.
    for _ in 0..2000 {
        if player.is_finished() {
            return Ok(is_sound);
        }
        let _ = player.step(now).len();
        now = now.after(step);
    }
    Err(format!("after {now:?} the log of {:?} is not at its end", player.length()))
}

/// Rules are compiled, asked at some places, written and read again.
fn rules(bytes: &[u8]) -> Verdict {
    let Ok(text) = std::str::from_utf8(bytes) else { return Ok(false) };
    let system = match fcl::read(text) {
        Ok(system) => system,
        Err(error) => return refused(&error.to_string()),
    };
    let mut engine = match Engine::new(&system, Options::default()) {
        Ok(engine) => engine,
        Err(error) => return refused(&error.to_string()),
    };
    for value in [0.0, -1.0, 0.3, 50.0, 1e9, f64::NAN, f64::INFINITY] {
        let _ = engine.step(&vec![value; system.inputs.len()]).len();
    }
    let written = fcl::write(&system);
    match fcl::read(&written) {
        Ok(again) if again == system => Ok(true),
        Ok(_) => Err("what was written of it is another system".to_owned()),
        Err(error) => Err(format!("what was written of it is refused: {error}")),
    }
}

/// A recording is read in both orders, and compared with itself.
fn recording(file: &Path) -> Verdict {
    let recording = match Recording::open(file) {
        Ok(recording) => recording,
        Err(error) => return refused(&error.to_string()),
    };
    let _ = recording.span_ns();
    let mut errors = 0;
    for messages in [recording.as_recorded(|_| true), recording.in_order(|_| true)] {
        for message in messages {
            match message {
                Ok(message) => drop(message.bytes().len()),
                Err(error) => {
                    refused(&error.to_string())?;
                    errors += 1;
                }
            }
        }
    }
    let _ = recording.digest();
    let _ = recording::first_difference(&recording, &recording);
    Ok(errors == 0)
}

/// A service is asked what it is.
fn params(trial: &Trial<'_>) -> Verdict {
    // The operating system takes no zeros, and no more than so much.
    let mut bytes: Vec<u8> = trial.bytes.iter().copied().filter(|byte| *byte != 0).collect();
    bytes.truncate(100_000);
    use std::os::unix::ffi::OsStringExt as _;
    let json = std::ffi::OsString::from_vec(bytes);
    let service = SERVICES[trial.of % SERVICES.len()];
    ask(trial, service, &["--interface".as_ref(), "--params".as_ref(), json.as_os_str()])
}

/// Starts a binary of the release build and waits until it ends.
fn ask(trial: &Trial<'_>, name: &str, words: &[impl AsRef<std::ffi::OsStr>]) -> Verdict {
    let outputs = ["stdout", "stderr"].map(|name| trial.folder.join(name));
    let [out, error] = outputs.each_ref().map(|path| Stdio::from(File::create(path).unwrap()));
    let mut command = Command::new(binaries().join(name));
    command.args(words).current_dir(trial.folder).stdin(Stdio::null()).stdout(out).stderr(error);
    let mut child = command.spawn().map_err(|error| format!("{name} cannot be started: {error}"))?;
    let pid = Pid::from_child(&child);
    for (resource, limit) in [(Resource::Cpu, USED_MAX_S), (Resource::Data, MEMORY_MAX)] {
        let _ = prlimit(Some(pid), resource, Rlimit { current: Some(limit), maximum: Some(limit) });
    }
    let begun = clock::monotonic();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if clock::monotonic().since(begun) > PASSED_MAX {
            let _ = child.kill();
            let _ = child.wait();
            return Err("does not end".to_owned());
        }
        clock::sleep(Duration::from_millis(1));
    };
    let [out, error] =
        outputs.map(|path| String::from_utf8_lossy(&std::fs::read(path).unwrap()).into_owned());
    // (A guard's signal is no evil.)
    let evil = ["panicked", "overflowed its stack", "memory allocation of", "(signal: "];
    if let Some(line) =
        error.lines().chain(out.lines()).find(|line| evil.iter().any(|word| line.contains(word)))
    {
        return Err(line.to_owned());
    }
    match status.code() {
        Some(0) => Ok(true),
        Some(1 | 2) => refused(&error),
        _ => Err(format!("ends with {status}: {}", error.lines().last().unwrap_or_default())),
    }
}

/// A refusal says something, and not a whole file.
fn refused(words: &str) -> Verdict {
    match words.len() {
        0 => Err("it is refused without a word".to_owned()),
        1..200_000 => Ok(false),
        bytes => Err(format!("its refusal is {bytes} bytes long")),
    }
}
