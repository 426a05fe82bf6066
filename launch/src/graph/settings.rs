//! What the tables of a graph file mean to the launcher.

use super::faults::{Fault, read_faults};
use super::keys::{refuse_key, take};
use super::log_level;
use super::paths::{self, shown};
use super::problem::{Problem, Problems};
use super::source::{Place, Source};
use super::tree::{Content, Entry, Node, Table};
use board::switchboard::SLOTS;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// No computer of a robot takes longer for a step.
const COMPUTE_MAX_MS: f64 = 60_000.0;
/// A board has a few places more, for tools and for those who take over.
const SERVICES_MAX: usize = SLOTS - 28;
/// A service needs some memory to come up at all, and no robot has more than a terabyte.
const MEMORY_MIN_MB: f64 = 64.0;
const MEMORY_MAX_MB: f64 = 1_048_576.0;
/// Longest name of a role, so that `health/<role>` and the like stay short enough for the transport.
const ROLE_MAX: usize = 40;

/// A graph as it was written, before any binary was asked.
#[derive(Debug, Clone)]
pub(crate) struct Graph {
    /// The file.
    pub(crate) file: PathBuf,
    /// Its folder: the working directory of every service.
    pub(crate) folder: PathBuf,
    /// The board's name.
    pub(crate) name: String,
    /// From which all randomness comes.
    pub(crate) seed: u64,
    /// The topic whose `RunSummary` ends the run.
    pub(crate) finish: Option<(String, Place)>,
    /// Topics that tools publish from outside.
    pub(crate) external: Vec<(String, Place)>,
    /// Parameters for every service that has one of that name.
    pub(crate) defaults: Vec<Entry>,
    /// What the live view shows.
    pub(crate) view: ViewSettings,
    /// What is done to services at logical moments.
    pub(crate) faults: Vec<Fault>,
    /// The services, in the order of the file.
    pub(crate) services: Vec<ServiceTable>,
    /// The file with all that it includes, before the command line changed anything.
    pub(crate) written: Table,
    /// The topics of the view that somebody has chosen, with their keys.
    pub(crate) view_topics: Vec<(String, String, Place)>,
}

/// One service's table.
#[derive(Debug, Clone)]
pub(crate) struct ServiceTable {
    /// Its name in this graph.
    pub(crate) role: String,
    /// Where its table begins.
    pub(crate) place: Place,
    /// The binary, by name or path.
    pub(crate) run: String,
    /// Where the binary is named; the table's beginning when it is the role.
    pub(crate) run_place: Place,
    /// Its parameters.
    pub(crate) parameters: Vec<Entry>,
    /// What the launcher does with it.
    pub(crate) launch: LaunchSettings,
    /// Where the processors are named, if they are.
    pub(crate) cpu_place: Option<Place>,
}

/// What the launcher, not the service, reads: `[role.launch]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct LaunchSettings {
    /// When a dead service is started again; `None` for never.
    pub(crate) restart: Option<Restart>,
    /// The processors on which it may run; empty for all.
    pub(crate) cpu: Vec<usize>,
    /// How the operating system ranks it.
    pub(crate) priority: Priority,
    /// Lockstep: how long a step takes, after which its messages are seen and the next step may begin; `None`
    /// for no time at all.
    pub(crate) compute: Option<Duration>,
    /// How long its heartbeat may be silent.
    pub(crate) hang_after: Duration,
    /// How long it may take to leave when asked.
    pub(crate) stop_after: Duration,
    /// What it logs: a level, or directives such as `info,grid_planner=debug`.
    pub(crate) log: String,
    /// Whether it may end by itself, without an error: one that plays a file, say. Any other end is a death.
    pub(crate) may_end: bool,
    /// How many bytes of memory it may have of its own; `None` for two gigabytes, or half of a small machine.
    pub(crate) memory_max: Option<u64>,
}

/// When a dead service is started again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Restart {
    /// Wait before the first restart.
    pub(crate) backoff_min: Duration,
    /// Longest wait.
    pub(crate) backoff_max: Duration,
    /// Restarts in a row after which the service counts as broken.
    pub(crate) give_up_after: u32,
}

impl Restart {
    /// The wait after so many deaths in a row; `None` when the service counts as broken. The first restart is
    /// immediate.
    pub(crate) fn pause_after(&self, deaths: u32) -> Option<Duration> {
        match deaths {
            _ if deaths > self.give_up_after => None,
            0 | 1 => Some(Duration::ZERO),
            _ => Some((self.backoff_min * 2_u32.pow((deaths - 2).min(20))).min(self.backoff_max)),
        }
    }
}

/// How the operating system ranks a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Priority {
    /// As any other.
    Normal,
    /// Real time, first in first out, 1 to 99.
    Fifo(i32),
    /// Nicer (up to 19) or less nice (down to -20) than others.
    Nice(i32),
}

impl Default for Restart {
    fn default() -> Self {
        Self {
            backoff_min: Duration::from_millis(100),
            backoff_max: Duration::from_secs(5),
            give_up_after: 10,
        }
    }
}

impl Default for LaunchSettings {
    fn default() -> Self {
        Self {
            restart: Some(Restart::default()),
            cpu: Vec::new(),
            priority: Priority::Normal,
            compute: None,
            hang_after: Duration::from_secs(1),
            stop_after: Duration::from_secs(1),
            log: "info".to_owned(),
            may_end: false,
            memory_max: None,
        }
    }
}

/// What the live view shows: `[graph.view]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct ViewSettings {
    /// The world file, relative to the graph's folder; by default the default parameter `world`.
    pub(crate) world: Option<String>,
    /// Topic of the true state of the world (`WorldTruth`).
    pub(crate) truth: String,
    /// Topic of the estimated pose (`PoseEstimate`).
    pub(crate) pose: String,
    /// Topic of the path (`Path`).
    pub(crate) path: String,
    /// Topic of the mission (`MissionStatus`).
    pub(crate) mission: String,
    /// Topic of the guard's word (`Clearance`).
    pub(crate) clearance: String,
}

impl Default for ViewSettings {
    fn default() -> Self {
        Self {
            world: None,
            truth: "world/truth".to_owned(),
            pose: "location/pose".to_owned(),
            path: "plan/path".to_owned(),
            mission: "mission/status".to_owned(),
            clearance: "safety/clearance".to_owned(),
        }
    }
}

impl ViewSettings {
    /// The topics it looks at.
    pub(crate) fn topics(&self) -> [&str; 5] {
        [&self.truth, &self.pose, &self.path, &self.mission, &self.clearance]
    }
}

/// Reads the merged tables of a graph.
pub(crate) fn read_graph(
    file: &Path,
    source: &Arc<Source>,
    table: &Table,
    problems: &mut Problems,
) -> Option<Graph> {
    let folder = match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    };
    let stem = file.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let mut graph = Graph {
        file: file.to_owned(),
        folder: folder.canonicalize().unwrap_or(folder),
        name: stem.to_owned(),
        seed: 1,
        finish: None,
        external: Vec::new(),
        defaults: Vec::new(),
        view: ViewSettings::default(),
        faults: Vec::new(),
        services: Vec::new(),
        written: Table::default(),
        view_topics: Vec::new(),
    };
    let (mut faults, mut other_faults) = (None, None);
    let mut name_place = Place::top(source);
    for entry in &table.entries {
        if entry.key == "fault" && entry.value.table().is_none() {
            faults = Some(entry);
            continue;
        }
        let Some(content) = entry.value.table() else {
            problems.push(outside_of_tables(entry));
            continue;
        };
        if entry.key == "graph" {
            other_faults = content.get("fault");
            read_graph_table(&mut graph, &mut name_place, content, problems);
        } else {
            graph.services.push(read_service(entry, content, &graph.folder, problems));
        }
    }
    // Those that an experiment or the command line sets replace those of the file.
    if let Some(entry) = other_faults.or(faults) {
        let roles: Vec<&str> = graph.services.iter().map(|service| service.role.as_str()).collect();
        graph.faults = read_faults(entry, &roles, problems);
    }
    if graph.view.world.is_none() {
        let world = graph.defaults.iter().find(|entry| entry.key == "world").cloned();
        graph.view.world = world.and_then(|mut world| {
            paths::rebase(&mut world, &graph.folder);
            world.value.text().map(str::to_owned)
        });
    }
    if board::place::Place::new(&graph.name).is_err() {
        let message = format!("`{}` cannot be a board's name", graph.name);
        let help = "give `name` below [graph]: 1 to 20 lower-case letters, digits and hyphens";
        problems.push(Problem::error(&name_place, message, help));
    }
    if graph.services.len() > SERVICES_MAX {
        let count = graph.services.len();
        let message = format!("{count} services are more than the {SERVICES_MAX} that a board has room for");
        problems.push(Problem::error(
            &graph.services[SERVICES_MAX].place,
            message,
            "leave out what is not needed",
        ));
        return None;
    }
    if graph.services.is_empty() {
        let help = "add a table for each service, such as [simulator]";
        problems.push(Problem::error(&Place::top(source), "this graph has no services", help));
        return None;
    }
    Some(graph)
}

fn read_graph_table(graph: &mut Graph, name_place: &mut Place, table: &Table, problems: &mut Problems) {
    const KEYS: [&str; 8] = ["name", "include", "seed", "finish", "external", "defaults", "view", "fault"];
    for entry in &table.entries {
        let value = &entry.value;
        match entry.key.as_str() {
            "name" => {
                if let Some(name) = take(value.text(), entry, "a text", problems) {
                    graph.name = name.to_owned();
                    *name_place = value.place.clone();
                }
            }
            "seed" => {
                let seed = match &value.content {
                    Content::Number(number) => number.as_u64(),
                    _ => None,
                };
                if let Some(seed) = take(seed, entry, "an integer from 0", problems) {
                    graph.seed = seed;
                }
            }
            "finish" => {
                if let Some(topic) = take(value.text(), entry, "the name of a topic", problems) {
                    graph.finish = Some((topic.to_owned(), value.place.clone()));
                }
            }
            "external" => {
                for item in take(value.array(), entry, "an array of topics", problems).unwrap_or_default() {
                    match item.text() {
                        Some(topic) => graph.external.push((topic.to_owned(), item.place.clone())),
                        None => problems.push(Problem::error(
                            &item.place,
                            format!("`external` takes names of topics, not {}", item.kind()),
                            "write external = [\"mission/orders\"]",
                        )),
                    }
                }
            }
            "defaults" => {
                if let Some(defaults) = take(value.table(), entry, "a table", problems) {
                    graph.defaults.clone_from(&defaults.entries);
                }
            }
            "view" => {
                if let Some(view) = take(value.table(), entry, "a table", problems) {
                    read_view(graph, view, problems);
                }
            }
            "include" | "fault" => {}
            _ => refuse_key(entry, "[graph]", &KEYS, problems),
        }
    }
}

fn read_view(graph: &mut Graph, table: &Table, problems: &mut Problems) {
    const KEYS: [&str; 6] = ["world", "truth", "pose", "path", "mission", "clearance"];
    for entry in &table.entries {
        let ViewSettings { truth, pose, path, mission, clearance, .. } = &mut graph.view;
        let slot = match entry.key.as_str() {
            "world" => {
                read_view_world(graph, entry, problems);
                continue;
            }
            "truth" => truth,
            "pose" => pose,
            "path" => path,
            "mission" => mission,
            "clearance" => clearance,
            _ => {
                refuse_key(entry, "[graph.view]", &KEYS, problems);
                continue;
            }
        };
        if let Some(topic) = take(entry.value.text(), entry, "the name of a topic", problems) {
            topic.clone_into(slot);
            graph.view_topics.push((entry.key.clone(), topic.to_owned(), entry.value.place.clone()));
        }
    }
}

fn read_view_world(graph: &mut Graph, entry: &Entry, problems: &mut Problems) {
    let Some(text) = take(entry.value.text(), entry, "a text", problems) else { return };
    let place = &entry.value.place;
    let world = paths::rebased(text, place, &graph.folder).unwrap_or_else(|| text.to_owned());
    if !graph.folder.join(&world).is_file() {
        let message = format!("there is no world file {text}");
        let folder = place.source().folder.as_deref().unwrap_or(&graph.folder);
        problems.push(Problem::error(place, message, format!("the name counts from {}", shown(folder))));
    }
    graph.view.world = Some(world);
}

/// What stands where only tables stand.
fn outside_of_tables(entry: &Entry) -> Problem {
    let key = &entry.key;
    let is_list = |items: &[Node]| !items.is_empty() && items.iter().all(|item| item.table().is_some());
    let (message, help) = if entry.value.array().is_some_and(is_list) {
        let message = format!("[[{key}]] makes a list of tables, and a service has one table");
        (message, format!("write [{key}], with single brackets"))
    } else {
        let message = format!("`{key}` stands outside of any table");
        (message, "put it below [graph], or below the table of a service".to_owned())
    };
    Problem::error(&entry.key_place, message, help)
}

fn read_service(entry: &Entry, table: &Table, folder: &Path, problems: &mut Problems) -> ServiceTable {
    let role = entry.key.clone();
    let plain = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
    let begins = role.bytes().next().is_some_and(|byte| byte.is_ascii_lowercase());
    if !begins || !role.bytes().all(plain) || role.len() > ROLE_MAX {
        let message = format!("`{role}` cannot be a service's name");
        let help = format!("use up to {ROLE_MAX} lower-case letters, digits and hyphens, a letter first");
        problems.push(Problem::error(&entry.key_place, message, help));
    }
    let mut service = ServiceTable {
        run: role.clone(),
        role,
        place: entry.key_place.clone(),
        run_place: entry.key_place.clone(),
        parameters: Vec::new(),
        launch: LaunchSettings::default(),
        cpu_place: None,
    };
    for entry in &table.entries {
        match entry.key.as_str() {
            "run" => {
                let text = entry.value.text().filter(|text| !text.is_empty());
                if let Some(run) = take(text, entry, "the name or the path of a binary", problems) {
                    let place = &entry.value.place;
                    let is_path = run.contains('/');
                    let located = is_path.then(|| paths::rebased(run, place, folder)).flatten();
                    service.run = located.unwrap_or_else(|| run.to_owned());
                    service.run_place = place.clone();
                }
            }
            "launch" => {
                if let Some(table) = take(entry.value.table(), entry, "a table", problems) {
                    read_launch(&mut service.launch, &service.role, table, problems);
                    service.cpu_place = table.get("cpu").map(|entry| entry.value.place.clone());
                }
            }
            _ => service.parameters.push(entry.clone()),
        }
    }
    if let Some(entry) = table.get("launch").and_then(|entry| entry.value.table()?.get("log"))
        && entry.value.text() == Some(&service.launch.log)
        && let Some((word, help)) = log_level::mistake(&service.launch.log, &service.run)
    {
        let message = format!("`log` of `{}` cannot be `{word}`", service.role);
        problems.push(Problem::error(&entry.value.place, message, help));
    }
    service
}

fn read_launch(launch: &mut LaunchSettings, role: &str, table: &Table, problems: &mut Problems) {
    const KEYS: [&str; 9] = [
        "restart",
        "cpu",
        "priority",
        "compute_ms",
        "hang_after_ms",
        "stop_after_ms",
        "log",
        "may_end",
        "memory_mb",
    ];
    for entry in &table.entries {
        let value = &entry.value;
        match entry.key.as_str() {
            "restart" => {
                if let Some(restart) = read_restart(entry, problems) {
                    launch.restart = restart;
                }
            }
            "cpu" => {
                let items = value.array().unwrap_or(std::slice::from_ref(value));
                let numbers: Option<Vec<usize>> = items
                    .iter()
                    .map(|item| item.integer().and_then(|number| number.try_into().ok()))
                    .collect();
                let numbers = numbers.filter(|numbers| !numbers.is_empty());
                if let Some(numbers) = take(numbers, entry, "numbers of processors, such as [1]", problems) {
                    launch.cpu = numbers;
                }
            }
            "priority" => {
                if let Some(priority) = read_priority(entry, problems) {
                    launch.priority = priority;
                }
            }
            "compute_ms" => {
                let number = value.number().filter(|number| (0.0..=COMPUTE_MAX_MS).contains(number));
                let wanted = "milliseconds from 0 to 60000: how long a step takes in lockstep";
                if let Some(number) = take(number, entry, wanted, problems) {
                    let nanos = (number * 1e6).round() as u64;
                    launch.compute = (nanos > 0).then(|| Duration::from_nanos(nanos));
                }
            }
            "hang_after_ms" => {
                launch.hang_after = milliseconds(entry, value, problems).unwrap_or(launch.hang_after);
            }
            "stop_after_ms" => {
                launch.stop_after = milliseconds(entry, value, problems).unwrap_or(launch.stop_after);
            }
            "log" => {
                let text = value.text().filter(|text| tracing_subscriber::EnvFilter::try_new(text).is_ok());
                let wanted =
                    "off, error, warn, info, debug, trace, or directives such as \"info,grid_planner=debug\"";
                if let Some(log) = take(text, entry, wanted, problems) {
                    launch.log = log.to_owned();
                }
            }
            "may_end" => {
                let wanted = "true or false: whether the service may end by itself";
                if let Some(may_end) = take(value.boolean(), entry, wanted, problems) {
                    launch.may_end = may_end;
                }
            }
            "memory_mb" => {
                let number = value.number().filter(|number| (MEMORY_MIN_MB..=MEMORY_MAX_MB).contains(number));
                let wanted = "megabytes from 64 to 1048576: the memory that the service may have";
                if let Some(number) = take(number, entry, wanted, problems) {
                    launch.memory_max = Some((number * 1024.0 * 1024.0) as u64);
                }
            }
            _ => refuse_key(entry, &format!("[{role}.launch]"), &KEYS, problems),
        }
    }
}

/// `Some(None)` for "never".
fn read_restart(entry: &Entry, problems: &mut Problems) -> Option<Option<Restart>> {
    const FORM: &str = "false or { backoff_ms = [100, 5000], give_up_after = 10 }";
    let defaults = LaunchSettings::default().restart;
    let table = match &entry.value.content {
        Content::Boolean(false) => return Some(None),
        Content::Boolean(true) => return Some(defaults),
        Content::Table(table) => table,
        _ => return take(None, entry, FORM, problems),
    };
    let mut restart = defaults?;
    for entry in &table.entries {
        match entry.key.as_str() {
            "backoff_ms" => {
                let bounds = entry.value.array().filter(|items| items.len() == 2);
                let [min, max] = take(bounds, entry, "two times, such as [100, 5000]", problems)? else {
                    return None;
                };
                let (Some(shortest), Some(longest)) =
                    (milliseconds(entry, min, problems), milliseconds(entry, max, problems))
                else {
                    return None;
                };
                if shortest > longest {
                    let message =
                        format!("`backoff_ms` begins at {shortest:?}, above its end of {longest:?}");
                    problems.push(Problem::error(
                        &entry.value.place,
                        message,
                        "write the shorter wait first",
                    ));
                    return None;
                }
                (restart.backoff_min, restart.backoff_max) = (shortest, longest);
            }
            "give_up_after" => {
                let count = entry.value.integer().and_then(|count| count.try_into().ok());
                restart.give_up_after = take(count, entry, "a count of restarts", problems)?;
            }
            _ => refuse_key(entry, "`restart`", &["backoff_ms", "give_up_after"], problems),
        }
    }
    Some(Some(restart))
}

fn read_priority(entry: &Entry, problems: &mut Problems) -> Option<Priority> {
    const FORM: &str = "\"normal\", { fifo = 1 to 99 } or { nice = -20 to 19 }";
    let priority = match &entry.value.content {
        Content::Text(text) if text == "normal" => Some(Priority::Normal),
        Content::Table(Table { entries }) => match entries.as_slice() {
            [Entry { key, value, .. }] => {
                let number = value.integer().and_then(|number| i32::try_from(number).ok());
                match (key.as_str(), number) {
                    ("fifo", Some(rank @ 1..=99)) => Some(Priority::Fifo(rank)),
                    ("nice", Some(rank @ -20..=19)) => Some(Priority::Nice(rank)),
                    _ => None,
                }
            }
            _ => None,
        },
        _ => None,
    };
    take(priority, entry, FORM, problems)
}

fn milliseconds(entry: &Entry, value: &Node, problems: &mut Problems) -> Option<Duration> {
    // A day is longer than any wait that is meant.
    let number = value.number().filter(|number| (0.0..=86_400_000.0).contains(number));
    take(number, entry, "milliseconds, not negative", problems)
        .map(|number| Duration::from_secs_f64(number * 1e-3))
}
