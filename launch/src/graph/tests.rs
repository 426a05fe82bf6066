//! Wrong graphs, one line each, against a handful of made-up binaries.

use super::check::{Binaries, NotFound, QueryError, check};
use super::checked::{Checked, Publisher};
use super::diagram::{dot, mermaid};
use super::faults::{Fault, FaultKind};
use super::file::{Overrides, load};
use super::problem::{Palette, Problems, Severity};
use board::{Direction, Interface, PortDescription};
use messages::{Description, FieldDescription, Kind, Message as _, RunSummary};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A right graph: every wrong one is made from it by one replacement.
const RIGHT: &str = r#"[graph]
name = "test"
finish = "run/summary"
external = ["mission/orders"]

[graph.defaults]
world = "../worlds/hall.toml"

[simulator]
room = "207"
[collision-avoidance]
front_radius_m = 0.2
mode = "careful"

[planner]
run = "grid-planner"
robot_radius_m = 0.3
weights = [1.0, 2.0]
[planner.launch]
restart = { backoff_ms = [100, 5000], give_up_after = 10 }
cpu = [1]
priority = { fifo = 40 }

[referee]
"#;

fn description(name: &str, fields: &[(&str, Kind)]) -> Description {
    let fields = fields.iter().map(|(name, kind)| FieldDescription {
        name: (*name).to_owned(),
        kind: kind.clone(),
        offset: 0,
        unit: String::new(),
        doc: String::new(),
    });
    Description {
        name: name.to_owned(),
        doc: String::new(),
        size: 8,
        alignment: 8,
        fields: fields.collect(),
        element: None,
    }
}

fn port(direction: Direction, topic: &str, message: Description, required: bool) -> PortDescription {
    PortDescription {
        topic: topic.to_owned(),
        direction,
        required,
        depth: 4,
        elements: 0,
        wakes: false,
        fingerprint: format!("{:016x}", message.fingerprint()),
        message,
    }
}

fn publishes(topic: &str, message: Description) -> PortDescription {
    port(Direction::Publish, topic, message, false)
}

fn reads(topic: &str, message: Description) -> PortDescription {
    port(Direction::Latest, topic, message, true)
}

fn interface(name: &str, ports: Vec<PortDescription>, properties: Value, defaults: Value) -> Interface {
    Interface {
        service: name.to_owned(),
        version: "0.1.0".to_owned(),
        description: String::new(),
        ports,
        period_ns: None,
        parameters: json!({ "type": "object", "additionalProperties": false, "properties": properties,
            "$defs": { "Bounds": { "type": "object", "additionalProperties": false,
                "properties": { "low_m": { "type": "number" } } } } }),
        defaults,
    }
}

/// What the made-up binaries say. `other` is a simulator compiled from other sources.
fn made_up(name: &str) -> Option<Interface> {
    let ranges = || description("TofRanges", &[("range_m", Kind::F32)]);
    let order = || description("Order", &[("order_id", Kind::U64)]);
    let clearance = || description("Clearance", &[("signal", Kind::U32)]);
    let path = || description("Path", &[("length_m", Kind::F64)]);
    let world = || json!({ "type": "string", "format": "path" });
    Some(match name {
        "simulator" | "other" => {
            let ranges =
                if name == "other" { description("TofRanges", &[("range_m", Kind::F64)]) } else { ranges() };
            let ports = vec![
                publishes("tof/ranges", ranges),
                port(Direction::Queue, "mission/orders", order(), true),
                reads("plan/path", path()),
                port(Direction::Latest, "safety/clearance", clearance(), false),
            ];
            let properties = json!({ "world": world(), "room": { "type": "string" } });
            interface(name, ports, properties, json!({ "world": "", "room": "" }))
        }
        "collision-avoidance" => interface(
            name,
            vec![reads("tof/ranges", ranges()), publishes("safety/clearance", clearance())],
            json!({
                "front_radius_m": { "type": "number", "minimum": 0.05, "maximum": 2.0 },
                "side_radius_m": { "type": "number", "minimum": 0.05, "maximum": 2.0 },
                "frames": { "type": "integer", "format": "uint32", "minimum": 1 },
                "enabled": { "type": "boolean" },
                "limit_m": { "type": ["number", "null"] },
                "bounds": { "anyOf": [{ "$ref": "#/$defs/Bounds" }, { "type": "null" }] },
                "mode": { "oneOf": [{ "type": "string", "const": "careful" }, { "type": "string", "const": "brisk" }] },
            }),
            json!({ "front_radius_m": 0.2, "side_radius_m": 0.05, "frames": 3, "enabled": true, "mode": "careful" }),
        ),
        "grid-planner" => interface(
            name,
            vec![publishes("plan/path", path())],
            json!({
                "world": world(),
                "robot_radius_m": { "type": "number", "exclusiveMinimum": 0.0, "maximum": 1.0 },
                "weights": { "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2 },
            }),
            json!({ "world": "", "robot_radius_m": 0.3, "weights": [1.0, 1.0] }),
        ),
        "sampling-planner" => interface(
            name,
            vec![publishes("plan/path", path())],
            json!({ "robot_radius_m": { "type": "number" } }),
            json!({ "robot_radius_m": 0.3 }),
        ),
        "second-planner" => interface(name, vec![publishes("plan/path", path())], json!({}), json!({})),
        "path-smoother" => interface(
            name,
            vec![reads("plan/paths", path()), publishes("plan/smooth", path())],
            json!({}),
            json!({}),
        ),
        "echo-orders" => interface(name, vec![publishes("mission/orders", order())], json!({}), json!({})),
        "referee" => {
            interface(name, vec![publishes("run/summary", RunSummary::description())], json!({}), json!({}))
        }
        _ => return None,
    })
}

struct MadeUp;

impl Binaries for MadeUp {
    fn locate(&self, run: &str) -> Result<PathBuf, NotFound> {
        if made_up(run).is_some() || run == "mute" {
            return Ok(PathBuf::from(run));
        }
        Err(NotFound {
            looked: vec![PathBuf::from("/opt/corkboard/bin").join(run)],
            known: vec!["simulator".to_owned(), "grid-planner".to_owned()],
            command: None,
        })
    }

    fn interface(&self, binary: &Path, parameters: Option<&Value>) -> Result<Interface, QueryError> {
        let name = binary.to_str().unwrap_or_default();
        let front = parameters.and_then(|all| {
            Some((all.get("front_radius_m")?.as_f64()?, all.get("side_radius_m")?.as_f64()?))
        });
        match front {
            Some((front, side)) if side >= front => Err(QueryError::Refused(format!(
                "side_radius_m = {side} must be smaller than front_radius_m = {front}"
            ))),
            _ => made_up(name).ok_or_else(|| QueryError::Broken("no answer within 60 s".to_owned())),
        }
    }
}

struct Case {
    folder: tempfile::TempDir,
    overrides: Overrides,
}

impl Case {
    fn new(files: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let file = folder.path().join(name);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, text).unwrap();
        }
        Self { folder, overrides: Overrides::default() }
    }

    fn run(&self) -> (Option<Checked>, Problems) {
        let mut problems = Problems::default();
        let file = self.folder.path().join("test.toml");
        let graph = load(&file, &self.overrides, &mut problems);
        let checked = graph.and_then(|graph| check(&graph, &MadeUp, 4, &mut problems));
        (checked, problems)
    }

    /// All that is refused, as a person sees it, with the folder's name taken out.
    fn errors(&self) -> Vec<String> {
        let (checked, problems) = self.run();
        let errors: Vec<_> = problems
            .sorted()
            .into_iter()
            .filter(|problem| problem.severity == Severity::Error)
            .map(|problem| {
                let text = problem.render(&Palette::PLAIN);
                assert!(!problem.help.is_empty(), "nothing to do is said about: {text}");
                text.replace(&format!("{}/", self.folder.path().display()), "")
            })
            .collect();
        assert_eq!(checked.is_none(), !errors.is_empty(), "{errors:#?}");
        errors
    }
}

/// The first line of the only error, and a part of what is said to do about it.
#[track_caller]
fn refused_case(case: &Case, headline: &str, help: &str) {
    let errors = case.errors();
    let first = errors.first().map(String::as_str).unwrap_or("(in order)");
    assert_eq!(first.lines().next().unwrap_or_default(), headline, "{errors:#?}");
    assert!(first.contains(help), "no `{help}` in:\n{first}");
    assert_eq!(errors.len(), 1, "{errors:#?}");
}

/// The right graph with one replacement.
#[track_caller]
fn refused(old: &str, new: &str, headline: &str, help: &str) {
    assert!(RIGHT.contains(old), "the graph has no `{old}`");
    refused_case(&Case::new(&[("test.toml", &RIGHT.replacen(old, new, 1))]), headline, help);
}

/// The right graph with something behind it.
#[track_caller]
fn refused_with(more: &str, headline: &str, help: &str) {
    refused_case(&Case::new(&[("test.toml", &format!("{RIGHT}{more}"))]), headline, help);
}

/// The right graph with an override.
#[track_caller]
fn refused_override(overrides: Overrides, headline: &str, help: &str) {
    let case = Case { overrides, ..Case::new(&[("test.toml", RIGHT)]) };
    refused_case(&case, headline, help);
}

fn set(argument: &str) -> Overrides {
    Overrides { set: vec![argument.to_owned()], ..Overrides::default() }
}

#[test]
fn the_right_graph_is_in_order() {
    let (checked, problems) = Case::new(&[("test.toml", RIGHT)]).run();
    let checked = checked.unwrap_or_else(|| panic!("{:#?}", problems.sorted()));
    assert_eq!(checked.name, "test");
    let roles: Vec<_> = checked.services.iter().map(|service| service.role.as_str()).collect();
    assert_eq!(roles, ["simulator", "collision-avoidance", "planner", "referee"]);
    assert_eq!(
        checked.services[2].parameters,
        json!({ "world": "../worlds/hall.toml", "robot_radius_m": 0.3, "weights": [1.0, 2.0] })
    );
    assert_eq!(checked.services[2].launch.cpu, [1]);
    let topic = |name: &str| checked.topics.iter().find(|topic| topic.name == name).unwrap();
    assert_eq!(topic("plan/path").publisher, Publisher::Service("planner".to_owned()));
    assert_eq!(topic("mission/orders").publisher, Publisher::External);
    assert_eq!(topic("tof/ranges").readers.len(), 1);
    assert_eq!(checked.view.world.as_deref(), Some("../worlds/hall.toml"));
    assert!(problems.sorted().is_empty() && problems.more() == 0, "{:#?}", problems.sorted());
}

#[test]
#[rustfmt::skip]
fn syntax() {
    refused("name = \"test\"", "name = \"test", "test.toml:2:13: error: no TOML: invalid basic string, expected `\"`", "name = \"test\n");
    refused("[referee]", "[referee", "test.toml:24:9: error: no TOML: unclosed table, expected `]`", "toml.io");
    refused("robot_radius_m = 0.3", "robot_radius_m =", "test.toml:17:17: error: no TOML: string values must be quoted, expected literal string", "");
    refused_with("[planner]\n", "test.toml:25:2: error: [planner] appears twice in this file", "first here: test.toml:15:2");
    refused("mode = ", "front_radius_m = 0.3\nmode = ", "test.toml:13:1: error: `front_radius_m` appears twice in this table", "keep one");
    refused("0.3", "nan", "test.toml:17:18: error: `nan` is no number that a robot can work with", "finite");
}

#[test]
#[rustfmt::skip]
fn parameters() {
    refused("front_radius_m", "fron_radius_m", "test.toml:12:1: error: `collision-avoidance` has no parameter `fron_radius_m`", "did you mean `front_radius_m`?");
    refused("front_radius_m = 0.2", "front_radius_cm = 20", "test.toml:12:1: error: `collision-avoidance` has no parameter `front_radius_cm`", "give it in m: `front_radius_m`");
    refused("front_radius_m = 0.2", "colour = 1", "test.toml:12:1: error: `collision-avoidance` has no parameter `colour`", "it has `bounds`, `enabled`");
    refused_with("x = 1\n", "test.toml:25:1: error: `referee` has no parameter `x`", "it takes none");
    refused("0.2\n", "\"0.2\"\n", "test.toml:12:18: error: `front_radius_m` of `collision-avoidance` takes a number, not a text", "write `front_radius_m = 0.2`, without quotes");
    refused("\"207\"", "207", "test.toml:10:8: error: `room` of `simulator` takes a text, not an integer", "the default is `room = \"\"`");
    refused("mode =", "enabled = 1\nmode =", "test.toml:13:11: error: `enabled` of `collision-avoidance` takes true or false, not an integer", "the default is `enabled = true`");
    refused("mode =", "frames = 2.5\nmode =", "test.toml:13:10: error: `frames` of `collision-avoidance` takes an integer, not a fraction", "such as 3");
    refused("0.2\n", "20\n", "test.toml:12:18: error: `front_radius_m` of `collision-avoidance` is 20 m, which is out of range", "it must be from 0.05 to 2 m; the default is 0.2");
    refused("0.3\n", "0.0\n", "test.toml:17:18: error: `robot_radius_m` of `planner` is 0.0 m, which is out of range", "it must be above 0 and at most 1 m");
    refused("mode =", "frames = 0\nmode =", "test.toml:13:10: error: `frames` of `collision-avoidance` is 0, which is out of range", "it must be at least 1");
    refused("\"careful\"", "\"carefull\"", "test.toml:13:8: error: `mode` of `collision-avoidance` cannot be \"carefull\"", "did you mean \"careful\"?");
    refused("\"careful\"", "3", "test.toml:13:8: error: `mode` of `collision-avoidance` takes one of \"careful\", \"brisk\", not an integer", "the default is `mode = \"careful\"`");
    refused("[1.0, 2.0]", "[1.0]", "test.toml:18:11: error: `weights` of `planner` takes 2 values, not 1", "the default is `weights = [1.0, 1.0]`");
    refused("2.0]", "\"a\"]", "test.toml:18:17: error: `weights[1]` of `planner` takes a number, not a text", "the default is");
    refused("mode =", "bounds.lo_m = 1\nmode =", "test.toml:13:8: error: `collision-avoidance.bounds` has no parameter `lo_m`", "did you mean `low_m`?");
    refused("mode =", "bounds.low_m = true\nmode =", "test.toml:13:16: error: `bounds.low_m` of `collision-avoidance` takes a number, not a boolean", "--example");
    refused("mode =", "side_radius_m = 0.5\nmode =", "test.toml:13:1: error: `collision-avoidance` refuses its parameters: side_radius_m = 0.5 must be smaller than front_radius_m = 0.2", "change what it names");
    refused("world =", "wolrd =", "test.toml:7:1: error: no service of this graph has a parameter `wolrd`", "did you mean `world`?");
}

#[test]
fn options_may_be_given_or_not() {
    let text = RIGHT.replace("mode =", "limit_m = 1\nbounds.low_m = 2\nmode =");
    assert_eq!(Case::new(&[("test.toml", &text)]).errors(), [""; 0]);
}

#[test]
#[rustfmt::skip]
fn binaries() {
    refused("grid-planner", "grid-planer", "test.toml:16:7: error: there is no binary `grid-planer`", "did you mean `grid-planner`?\n     = looked for /opt/corkboard/bin/grid-planer");
    refused("[referee]", "[umpire]", "test.toml:24:2: error: there is no binary `umpire`", "name another one: `run = \"..\"` below [umpire]");
    refused("grid-planner", "mute", "test.toml:16:7: error: `mute` does not say what it is: no answer within 60 s", "try `mute --interface`");
}

#[test]
#[rustfmt::skip]
fn topics() {
    refused_with("[second-planner]\n", "test.toml:25:2: error: `plan/path` is published by `planner` and by `second-planner`", "= [planner]: test.toml:15:2");
    refused_with("[path-smoother]\n", "test.toml:25:2: error: nobody publishes `plan/paths`, which `path-smoother` needs", "`planner` publishes `plan/path`");
    refused("external = [\"mission/orders\"]\n", "", "test.toml:8:2: error: nobody publishes `mission/orders`, which `simulator` needs", "list it as `external` below [graph]");
    refused("[simulator]\n", "[simulator]\nrun = \"other\"\n", "test.toml:12:2: error: `collision-avoidance` reads `tof/ranges` as TofRanges (056bdb77ef146e97), `simulator` publishes it as TofRanges (d7b3ee6b7828d93c)", "field `range_m` is f32 here and f64 there");
    refused("run/summary", "run/sumary", "test.toml:3:10: error: nobody publishes `run/sumary`, which is to end the run", "a RunSummary is on `run/summary`");
    refused("run/summary", "plan/path", "test.toml:3:10: error: `plan/path` cannot end the run: it is a Path, not a RunSummary", "a referee");
    refused_with("[echo-orders]\n", "test.toml:4:13: error: `mission/orders` is external, and `echo-orders` publishes it too", "[echo-orders]: test.toml:25:2");
    refused("/orders\"", "/orders\", \"mission/hints\"", "test.toml:4:31: error: `mission/hints` is external, and no service reads it", "remove it");
}

#[test]
#[rustfmt::skip]
fn tables_of_the_launcher() {
    refused("name = \"test\"", "name = \"Test!\"", "test.toml:2:8: error: `Test!` cannot be a board's name", "1 to 20 lower-case letters");
    refused("name = ", "nmae = ", "test.toml:2:1: error: [graph] has no key `nmae`", "did you mean `name`?");
    refused("[referee]", "[Referee]\nrun = \"referee\"", "test.toml:24:2: error: `Referee` cannot be a service's name", "lower-case");
    refused("name = \"test\"", "seed = -1", "test.toml:2:8: error: `seed` takes an integer from 0, not -1", "write such a value");
    refused("cpu = [1]", "cpus = [1]", "test.toml:21:1: error: [planner.launch] has no key `cpus`", "did you mean `cpu`?");
    refused("cpu = [1]", "cpu = [9]", "test.toml:21:7: error: `planner` cannot run on processor 9: this machine has 4", "from 0 to 3");
    refused("cpu = [1]", "cpu = \"all\"", "test.toml:21:7: error: `cpu` takes numbers of processors, such as [1], not \"all\"", "remove the line");
    refused("[100, 5000]", "[5000, 100]", "test.toml:20:26: error: `backoff_ms` begins at 5s, above its end of 100ms", "the shorter wait first");
    refused("[100, 5000]", "100", "test.toml:20:26: error: `backoff_ms` takes two times, such as [100, 5000], not 100", "write such a value");
    refused("give_up_after", "giveup_after", "test.toml:20:39: error: `restart` has no key `giveup_after`", "did you mean `give_up_after`?");
    refused("fifo = 40", "fifo = 100", "test.toml:22:12: error: `priority` takes \"normal\", { fifo = 1 to 99 } or { nice = -20 to 19 }", "write such a value");
    refused("cpu = [1]", "hang_after_ms = -5", "test.toml:21:17: error: `hang_after_ms` takes milliseconds, not negative, not -5", "write such a value");
    refused("cpu = [1]", "log = \"a=b=c\"", "test.toml:21:7: error: `log` takes off, error, warn, info, debug, trace, or directives such as \"info,grid_planner=debug\", not \"a=b=c\"", "");
    refused("cpu = [1]", "compute_ms = -1", "test.toml:21:14: error: `compute_ms` takes milliseconds from 0 to 60000: how long a step takes in lockstep, not -1", "write such a value");
    refused("cpu = [1]", "compute_ms = 70e3", "test.toml:21:14: error: `compute_ms` takes milliseconds from 0 to 60000: how long a step takes in lockstep, not 70e3", "write such a value");
    refused("[graph]", "seed = 1\n[graph]", "test.toml:1:1: error: `seed` stands outside of any table", "below [graph]");
    refused("cpu = [1]", "log = \"wran\"", "test.toml:21:7: error: `log` of `planner` cannot be `wran`", "did you mean `warn`?");
    refused("cpu = [1]", "log = \"info,planner=debug\"", "test.toml:21:7: error: `log` of `planner` cannot be `planner=debug`", "grid_planner");
    refused_with("[[tof-driver]]\n", "test.toml:25:3: error: [[tof-driver]] makes a list of tables, and a service has one table", "write [tof-driver], with single brackets");
    refused("[simulator]\n", "[graph.view]\npath = \"plan/pat\"\n[simulator]\n", "test.toml:10:8: error: nobody publishes `plan/pat`, which the view is to draw", "did you mean `plan/path`?");
    refused("[simulator]\n", "[graph.view]\npath = \"tof/ranges\"\n[simulator]\n", "test.toml:10:8: error: `tof/ranges` is a TofRanges, and the view draws a Path as path", "a Path is on `plan/path`");
    refused("[simulator]\n", "[graph.view]\ntruth = \"world/trth\"\n[simulator]\n", "test.toml:10:9: error: nobody publishes `world/trth`, which the view is to draw", "remove the line");
    refused("[simulator]\n", "[graph.view]\nworld = \"none.toml\"\n[simulator]\n", "test.toml:10:9: error: there is no world file none.toml", "the name counts from");
    refused("[simulator]\n", "[graph.view]\nwrold = \"none.toml\"\n[simulator]\n", "test.toml:10:1: error: [graph.view] has no key `wrold`", "did you mean `world`?");
    refused_case(&Case::new(&[("test.toml", "[graph]\nname = \"a\"\n")]), "test.toml:1:1: error: this graph has no services", "add a table");
    refused_case(&Case::new(&[("test.toml", "")]), "test.toml:1:1: error: this graph has no services", "add a table");
}

#[test]
#[rustfmt::skip]
fn includes() {
    let include = |name: &str| RIGHT.replace("[graph]\n", &format!("[graph]\ninclude = [\"{name}\"]\n"));
    let case = |part: &str, text: &str| Case::new(&[("test.toml", &include("parts/a.toml")), ("parts/a.toml", part), ("parts/b.toml", text)]);
    refused_case(
        &Case::new(&[("test.toml", &include("parts/none.toml"))]),
        "test.toml:2:12: error: cannot read the included file parts/none.toml: No such file or directory (os error 2)",
        "from the folder of this file",
    );
    refused_case(
        &case("[graph]\ninclude = [\"b.toml\"]\n", "[graph]\ninclude = [\"../test.toml\"]\n"),
        "parts/b.toml:2:12: error: the files include each other: test.toml -> parts/a.toml -> parts/b.toml -> test.toml",
        "remove one of these includes",
    );
    refused_case(&case("[graph\n", ""), "parts/a.toml:1:7: error: no TOML: unclosed table, expected `]`", "toml.io");
    refused_case(&case("[planner]\ncolour = 1\n", ""), "parts/a.toml:2:1: error: `planner` has no parameter `colour`", "it has `robot_radius_m`");
    let siblings = RIGHT.replace("[graph]\n", "[graph]\ninclude = [\"parts/a.toml\", \"parts/b.toml\"]\n");
    refused_case(
        &Case::new(&[("test.toml", &siblings), ("parts/a.toml", "[extra]\n"), ("parts/b.toml", "[extra]\n")]),
        "parts/b.toml:1:2: error: [extra] is in two included files",
        "first here: parts/a.toml:1:2",
    );
    refused("name = ", "include = [3]\nname = ", "test.toml:2:12: error: `include` takes graphs by name and files, not an integer", "write include");
}

#[test]
fn paths_count_from_the_file_in_which_they_are_written() {
    let part = RIGHT.replace("[simulator]", "[graph.view]\nworld = \"../worlds/hall.toml\"\n[simulator]");
    let main = "[graph]\nname = \"mine\"\ninclude = [\"elsewhere/graphs/part.toml\"]\n[planner]\nworld = \"own.toml\"\n";
    let files = [
        ("test.toml", main),
        ("elsewhere/graphs/part.toml", part.as_str()),
        ("elsewhere/worlds/hall.toml", ""),
    ];
    let case = Case::new(&files);
    let (checked, problems) = case.run();
    let checked = checked.unwrap_or_else(|| panic!("{:#?}", problems.sorted()));
    let world = |checked: &Checked, role: &str| {
        let service = checked.services.iter().find(|service| service.role == role).unwrap();
        service.parameters["world"].as_str().unwrap().to_owned()
    };
    assert_eq!(world(&checked, "simulator"), "elsewhere/graphs/../worlds/hall.toml");
    assert_eq!(world(&checked, "planner"), "own.toml");
    assert_eq!(checked.view.world.as_deref(), Some("elsewhere/graphs/../worlds/hall.toml"));
    // As a text of one file it means the same.
    let again = Case::new(&[
        ("test.toml", &checked.text),
        ("elsewhere/graphs/x", ""),
        ("elsewhere/worlds/hall.toml", ""),
    ]);
    let (again, problems) = again.run();
    let again = again.unwrap_or_else(|| panic!("{:#?}", problems.sorted()));
    assert_eq!(
        [world(&again, "simulator"), world(&again, "planner")],
        [world(&checked, "simulator"), world(&checked, "planner")]
    );
    // Those of the command line count from the graph's folder.
    let overrides = set("graph.defaults.world=w.toml");
    let (checked, _) = Case { overrides, ..Case::new(&files) }.run();
    assert_eq!(world(&checked.unwrap(), "simulator"), "w.toml");
    // Texts that are no paths stay what they are.
    let (checked, _) = Case::new(&files).run();
    assert_eq!(checked.unwrap().services[0].parameters["room"], "207");
}

#[test]
fn graphs_are_included_by_name() {
    let main = "[graph]\nname = \"mine\"\ninclude = [\"part\"]\n";
    let (checked, problems) = Case::new(&[("test.toml", main), ("part.toml", RIGHT)]).run();
    assert!(checked.is_some(), "{:#?}", problems.sorted());
    let case = Case::new(&[("test.toml", &main.replace("part", "no-such-part"))]);
    refused_case(&case, "test.toml:3:12: error: there is no graph `no-such-part`", "give the path of a file");
}

#[test]
fn only_plain_text_of_some_size_is_a_graph() {
    let case = Case::new(&[("test.toml", "")]);
    let file = case.folder.path().join("test.toml");
    std::fs::write(&file, vec![b'#'; 2 << 20]).unwrap();
    refused_case(
        &case,
        "error: cannot read the graph file test.toml: it has 2 MiB, more than 1 MiB of content, which is the limit",
        "name a graph file",
    );
    std::fs::write(&file, b"name = \"caf\xe9\"").unwrap();
    refused_case(
        &case,
        "error: cannot read the graph file test.toml: line 1, byte 12: the byte 0xe9 is no UTF-8; save the file as UTF-8",
        "correct that byte",
    );
    std::fs::remove_file(&file).unwrap();
    std::fs::create_dir(&file).unwrap();
    refused_case(
        &case,
        "error: cannot read the graph file test.toml: this is a folder, and only plain files are read and written",
        "name a graph file",
    );
    let include = |name: &str| RIGHT.replace("[graph]\n", &format!("[graph]\ninclude = [\"{name}\"]\n"));
    let case = Case::new(&[("test.toml", &include("/dev/zero.toml/../zero"))]);
    assert_eq!(case.errors().len(), 1);
    let case = Case::new(&[("test.toml", &include("./pipe"))]);
    rustix::fs::mkfifoat(rustix::fs::CWD, case.folder.path().join("pipe"), rustix::fs::Mode::RWXU).unwrap();
    refused_case(
        &case,
        "test.toml:2:12: error: cannot read the included file ./pipe: this is a pipe, and only plain files are read and written",
        "from the folder of this file",
    );
}

#[test]
fn graphs_are_bounded() {
    let many = |count: usize, item: fn(usize) -> String| (0..count).map(item).collect::<String>();
    let services = format!("[graph]\nname = \"a\"\n{}", many(101, |n| format!("[s{n}]\n")));
    refused_case(
        &Case::new(&[("test.toml", &services)]),
        "test.toml:103:2: error: 101 services are more than the 100 that a board has room for",
        "leave out",
    );
    let tables = many(3000, |n| format!("[s{n}]\n"));
    refused_case(
        &Case::new(&[("test.toml", &tables)]),
        "test.toml:1:2: error: 3000 keys in one table are more than 1000",
        "leave out",
    );
    let parts: Vec<(String, String)> = (0..20)
        .map(|n| (format!("p{n}.toml"), format!("[graph]\ninclude = [\"p{}.toml\"]\n", n + 1)))
        .collect();
    let files: Vec<(&str, &str)> = parts.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
    let case =
        Case::new(&[&files[..], &[("test.toml", "[graph]\ninclude = \"p0.toml\"\n[referee]\n")]].concat());
    refused_case(
        &case,
        "p14.toml:2:12: error: more than 16 files include each other in a row, or 100 are included in all",
        "put some of them together",
    );
    // However many mistakes there are, a page of them is shown.
    let wrong = many(1000, |n| format!("x{n} = 1\n"));
    let (_, problems) = Case::new(&[("test.toml", &format!("{RIGHT}{wrong}"))]).run();
    assert_eq!((problems.sorted().len(), problems.more()), (200, 800));
}

#[test]
#[rustfmt::skip]
fn faults() {
    refused_with("[[fault]]\nkill = \"planner\"\n", "test.toml:25:1: error: a fault lacks `at_s`, its logical moment", "{ at_s = 12.0, kill = \"planner\" }");
    refused_with("[[fault]]\nat_s = 1\n", "test.toml:25:1: error: a fault has either `kill` or `stop`", "{ at_s = 12.0, kill");
    refused_with("[[fault]]\nat_s = 1\nkill = \"planner\"\nstop = \"planner\"\n", "test.toml:25:1: error: a fault has either `kill` or `stop`", "{ at_s = 12.0, kill");
    refused_with("[[fault]]\nat_s = -1\nkill = \"planner\"\n", "test.toml:26:8: error: `at_s` takes seconds of logical time, not negative, not -1", "write such a value");
    refused_with("[[fault]]\nat_s = 1\nkill = \"planer\"\n", "test.toml:27:8: error: the graph has no service `planer`", "did you mean `planner`?");
    refused_with("[[fault]]\nat_s = 1\nkill = 3\n", "test.toml:27:8: error: `kill` takes the name of a service, not 3", "write such a value");
    refused_with("[[fault]]\nat_s = 1\nkill = \"planner\"\nfor_s = 2\n", "test.toml:28:1: error: `for_s` means nothing to `kill`", "how long a stopped service hangs");
    refused_with("[[fault]]\nat_s = 1\nstop = \"planner\"\ndown_s = 2\n", "test.toml:28:1: error: `down_s` means nothing to `stop`", "first step");
    refused_with("[[fault]]\nat_s = 1\nstop = \"planner\"\nfro_s = 2\n", "test.toml:28:1: error: a fault has no key `fro_s`", "did you mean `for_s`?");
    refused_override(set("graph.fault=[3]"), "command line: error: `fault` takes tables, not an integer", "write tables");
    // Each mark stands under what is meant.
    refused_override(set("graph.fault=[{ at_s = 1, kill = \"planer\" }]"), "command line: error: the graph has no service `planer`",
        "     | --set graph.fault=[{ at_s = 1, kill = \"planer\" }]\n     |                                       ^^^^^^^^ did you mean");
}

#[test]
fn all_that_is_wrong_with_a_fault_is_told() {
    let text = format!(
        "{RIGHT}[[fault]]\nat_s = -1\nkill = \"planer\"\nfro_s = 2\ndown_s = \"x\"\n[[fault]]\nstop = 3\n"
    );
    let errors = Case::new(&[("test.toml", &text)]).errors();
    for words in [
        "`at_s` takes seconds",
        "no service `planer`",
        "no key `fro_s`",
        "`down_s` takes",
        "a fault lacks `at_s`",
        "`stop` takes the name",
    ] {
        assert!(errors.iter().any(|error| error.contains(words)), "{words} is not told: {errors:#?}");
    }
    assert_eq!(errors.len(), 6, "{errors:#?}");
}

fn checked(text: &str, overrides: Overrides) -> Checked {
    let (checked, problems) = Case { overrides, ..Case::new(&[("test.toml", text)]) }.run();
    checked.unwrap_or_else(|| panic!("{:#?}", problems.sorted()))
}

#[test]
fn faults_and_computing_times_are_read() {
    let text = RIGHT.replace("cpu = [1]", "compute_ms = 2.5")
        + "[[fault]]\nat_s = 12.5\nkill = \"planner\"\n[[fault]]\nat_s = 3\nstop = \"referee\"\nfor_s = 0.5\n";
    let graph = checked(&text, Overrides::default());
    assert_eq!(graph.services[2].launch.compute, Some(Duration::from_micros(2500)));
    let (kill, stop) =
        (FaultKind::Kill { down: None }, FaultKind::Stop { lasting: Some(Duration::from_millis(500)) });
    let fault =
        |at_ms, role: &str, kind| Fault { at: Duration::from_millis(at_ms), role: role.to_owned(), kind };
    assert_eq!(graph.faults, [fault(12_500, "planner", kill), fault(3000, "referee", stop)]);
    let other = checked(&text, set("graph.fault=[{ at_s = 1, kill = \"planner\", down_s = 2 }]"));
    let kill = FaultKind::Kill { down: Some(Duration::from_secs(2)) };
    assert_eq!(other.faults, [fault(1000, "planner", kill)]);
    assert_eq!(checked(&text, set("graph.fault=[]")).faults, []);
}

#[test]
fn the_text_of_a_graph_reads_back_as_the_same_graph() {
    let text = RIGHT.replace("room = \"207\"", "room = \"a \\\"quoted\\\" \\\\ name\\n\"")
        + "[[fault]]\nat_s = 12.5\nkill = \"planner\"\n";
    let first = checked(&text, Overrides::default());
    let second = checked(&first.text, Overrides::default());
    assert_eq!(first.text, second.text);
    let json = |graph: &Checked| {
        let mut json = serde_json::to_value(graph).unwrap();
        // Each case has a folder of its own.
        let _ = ["file", "folder"].map(|key| json[key].take());
        json
    };
    assert_eq!(json(&first), json(&second));
}

#[test]
fn the_including_file_overrides_key_by_key() {
    let main =
        "[graph]\ninclude = \"part.toml\"\n[planner]\nrobot_radius_m = 0.4\n[planner.launch]\ncpu = [2]\n";
    let case = Case::new(&[("test.toml", main), ("part.toml", RIGHT)]);
    let (checked, problems) = case.run();
    let checked = checked.unwrap_or_else(|| panic!("{:#?}", problems.sorted()));
    let planner = checked.services.iter().find(|service| service.role == "planner").unwrap();
    assert_eq!(planner.parameters["robot_radius_m"], 0.4);
    assert_eq!(planner.parameters["weights"], json!([1.0, 2.0]));
    assert_eq!(planner.run, "grid-planner");
    assert_eq!(planner.launch.cpu, [2]);
    assert_eq!(planner.launch.restart.unwrap().give_up_after, 10);
}

#[test]
#[rustfmt::skip]
fn overrides() {
    refused_override(set("planer.x=1"), "command line: error: the graph has no service `planer`", "did you mean `planner`?");
    refused_override(set("planner.radius=1"), "command line: error: `planner` has no parameter `radius`", "it has");
    refused_override(set("planner.robot_radius_m=7"), "command line: error: `robot_radius_m` of `planner` is 7 m, which is out of range", "     | --set planner.robot_radius_m=7\n     |                              ^ it must be above 0");
    refused_override(set("planer.launch.log=debug"), "command line: error: the graph has no service `planer`", "     | --set planer.launch.log=debug\n     |       ^^^^^^ did you mean");
    refused_override(set("planner.radius=1"), "command line: error: `planner` has no parameter `radius`", "     | --set planner.radius=1\n     |               ^^^^^^ it has");
    refused_override(set("collision-avoidance.front_radius_m=nan"), "command line: error: `nan` is no number that a robot can work with", "write a finite number");
    refused_override(set("collision-avoidance.bounds={ low_m = inf }"), "command line: error: `inf` is no number that a robot can work with", "     |                                            ^^^ write a finite");
    refused_override(set("planner.launch.hang_after_ms=nan"), "command line: error: `nan` is no number that a robot can work with", "finite");
    refused_override(set("planner.robot_radius_m=.5.5"), "command line: error: `robot_radius_m` of `planner` takes a number, not a text", "the default is");
    refused_override(set("planner.robot_radius_m=\".5\""), "command line: error: `robot_radius_m` of `planner` takes a number, not a text", "write `robot_radius_m = 0.5`, without quotes");
    refused_override(set("planner"), "command line: error: `planner` has no `=`", "write --set role.parameter=value");
    refused_override(set("planner=1"), "command line: error: `planner` names no parameter", "write --set planner.parameter=value");
    // Tables within tables are walked through one within the other.
    let begin = format!("planner{}", ".x".repeat(36)) + ".";
    let words = format!("command line: error: `{begin} .. (117.2 KiB in all)` has 60001 parts");
    let deep = format!("planner{}=1", ".x".repeat(60_000));
    refused_override(set(&deep), &words, "a parameter lies no deeper than 32 tables");
    refused_override(
        Overrides { swap: vec!["planner=x".to_owned()], ..Overrides::default() },
        "command line: error: there is no binary `x`",
        "looked for",
    );
    refused_override(
        Overrides { without: vec!["sim".to_owned()], ..Overrides::default() },
        "command line: error: the graph has no service `sim`",
        "services: `simulator`",
    );
    refused_override(
        Overrides { without: vec!["planner".to_owned()], ..Overrides::default() },
        "test.toml:9:2: error: nobody publishes `plan/path`, which `simulator` needs",
        "add a service that publishes it (a Path)",
    );
}

#[test]
fn overrides_take_effect() {
    let overrides = Overrides {
        set: vec!["simulator.room=213".to_owned(), "planner.launch.log=debug".to_owned()],
        swap: vec!["planner=sampling-planner".to_owned()],
        seed: Some(7),
        board: Some("lab-2".to_owned()),
        ..Overrides::default()
    };
    let case = Case { overrides, ..Case::new(&[("test.toml", RIGHT)]) };
    let (checked, problems) = case.run();
    let checked = checked.unwrap_or_else(|| panic!("{:#?}", problems.sorted()));
    assert_eq!((checked.seed, checked.name.as_str()), (7, "lab-2"));
    assert_eq!(checked.services[0].parameters["room"], "213");
    assert_eq!(checked.services[2].binary, Path::new("sampling-planner"));
    assert_eq!(checked.services[2].launch.log, "debug");
    let notes: Vec<_> = problems.sorted().into_iter().map(|problem| problem.message.clone()).collect();
    assert_eq!(notes, ["`sampling-planner` has no parameter `weights`, and does without"]);
}

#[test]
fn numbers_of_the_command_line_need_no_digit_before_the_point() {
    for (text, number) in [(".5", 0.5), ("+.2", 0.2), ("1.", 1.0), ("0.25", 0.25)] {
        let overrides = set(&format!("planner.robot_radius_m={text}"));
        let (checked, problems) = Case { overrides, ..Case::new(&[("test.toml", RIGHT)]) }.run();
        let checked = checked.unwrap_or_else(|| panic!("{text}: {:#?}", problems.sorted()));
        assert_eq!(checked.services[2].parameters["robot_radius_m"], number, "{text}");
    }
}

#[test]
fn what_answers_a_topic_is_no_advice_for_it() {
    let text = RIGHT.replace("external = [\"mission/orders\"]\n", "");
    let errors = Case::new(&[("test.toml", &text)]).errors();
    assert!(
        errors[0].contains("nobody publishes `mission/orders`") && !errors[0].contains("` publishes `"),
        "{}",
        errors[0]
    );
}

#[test]
fn every_mistake_is_listed() {
    let text = RIGHT
        .replace("0.2\n", "20\n")
        .replace("careful", "fast")
        .replace("cpu =", "cpus =")
        .replace("grid-planner", "gird-planner");
    assert_eq!(Case::new(&[("test.toml", &text)]).errors().len(), 4);
}

#[test]
fn what_nobody_reads_is_a_note() {
    let lonely = "[graph]\nname = \"a\"\n[referee]\n";
    let (checked, problems) = Case::new(&[("test.toml", lonely)]).run();
    assert!(checked.is_some());
    let notes: Vec<_> = problems.sorted().into_iter().map(|problem| problem.message.clone()).collect();
    assert_eq!(notes, ["nobody reads `run/summary` of `referee`"]);
}

#[test]
fn drawings() {
    let (checked, _) = Case::new(&[("test.toml", RIGHT)]).run();
    let mut checked = checked.unwrap();
    insta::assert_snapshot!("mermaid", mermaid(&checked));
    insta::assert_snapshot!("dot", dot(&checked));
    // Topics that are not connected look otherwise, and the legend says how.
    let words = ["nobody publishes it", "nobody reads it"];
    let has = |drawing: &str| words.map(|words| drawing.contains(words));
    assert_eq!([has(&mermaid(&checked)), has(&dot(&checked))], [[false; 2]; 2]);
    let topic = |name: &str| checked.topics.iter().position(|topic| topic.name == name).unwrap();
    let (ranges, clearance) = (topic("tof/ranges"), topic("safety/clearance"));
    checked.topics[ranges].publisher = Publisher::Nobody;
    checked.topics[clearance].readers.clear();
    assert_eq!([has(&mermaid(&checked)), has(&dot(&checked))], [[true; 2]; 2]);
    let line = |text: &str, id: usize| {
        text.lines().find(|line| line.trim().starts_with(&format!("t{id}"))).unwrap().to_owned()
    };
    assert!(line(&mermaid(&checked), ranges).ends_with(":::unpublished"));
    assert!(line(&mermaid(&checked), clearance).ends_with(":::unread"));
    assert!(line(&dot(&checked), ranges).contains("rounded,dashed"));
    assert!(line(&dot(&checked), clearance).contains("rounded,dotted"));
}

#[test]
fn a_problem_as_a_person_sees_it() {
    let text = RIGHT.replace("front_radius_m", "fron_radius_m");
    let errors = Case::new(&[("test.toml", &text)]).errors();
    assert_eq!(
        errors[0],
        "test.toml:12:1: error: `collision-avoidance` has no parameter `fron_radius_m`\n  \
         12 | fron_radius_m = 0.2\n     | ^^^^^^^^^^^^^ did you mean `front_radius_m`?\n"
    );
}

proptest::proptest! {
    #[test]
    fn no_file_makes_the_checker_panic(text in "[\\[\\]a-z =.\"\\n{}0-9,#-]{0,200}") {
        let case = Case::new(&[("test.toml", &format!("[graph]\n[simulator]\n{text}"))]);
        let (_, problems) = case.run();
        for problem in problems.sorted() {
            let _ = problem.render(&Palette::PLAIN);
        }
    }
}
