//! What README.md, CONTRIBUTING.md and ARCHITECTURE.md show works: the launcher's check accepts their graphs,
//! the command lines take their commands, and whatever a command names exists.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;
use tests::build;

/// Documents, and what stands there for a name of the reader's choice.
const DOCUMENTS: [&str; 3] = ["README.md", "CONTRIBUTING.md", "ARCHITECTURE.md"];
const PLACEHOLDERS: [(&str, &str); 4] =
    [("GRAPH", "coffee"), ("RECORDING", "a.mcap"), ("CRATE", "board"), ("NAME", "beeper")];
/// What clap adds to the words about a command that it does not take.
const NOT_TAKEN: &str = "For more information, try '--help'";
/// No board can have this name, so nothing is started.
const NO_NAME: &str = "no name";
/// Options of the launcher that say something about the graph.
const ABOUT_GRAPH: [&str; 4] = ["--set", "--swap", "--without", "--seed"];

/// The blocks of code of a document: language and text; and all that stands between them.
fn blocks(text: &str) -> (Vec<(String, String)>, String) {
    let (mut blocks, mut prose) = (Vec::<(String, String)>::new(), String::new());
    let mut inside = false;
    for line in text.lines() {
        match (line.trim_start().strip_prefix("```"), inside) {
            (Some(_), true) => inside = false,
            (Some(language), false) => {
                blocks.push((language.to_owned(), String::new()));
                inside = true;
            }
            (None, true) => {
                let block = &mut blocks.last_mut().unwrap().1;
                *block += line;
                block.push('\n');
            }
            (None, false) => {
                prose += line;
                prose.push('\n');
            }
        }
    }
    (blocks, prose)
}

/// The commands in a line, each as the words that a shell makes of it: what stands between pipes, brackets
/// and comments.
fn commands(line: &str) -> Vec<Vec<String>> {
    let mut commands = vec![vec![String::new()]];
    let mut quote = None;
    for letter in line.chars() {
        let words = commands.last_mut().unwrap();
        match (quote, letter) {
            (Some(open), letter) if letter == open => quote = None,
            (None, '\'' | '"') => quote = Some(letter),
            (None, '#') if words.last().unwrap().is_empty() => break,
            (None, '|' | '>' | '(' | ')' | ';') => commands.push(vec![String::new()]),
            (None, letter) if letter.is_whitespace() => words.push(String::new()),
            (_, letter) => words.last_mut().unwrap().push(letter),
        }
    }
    for words in &mut commands {
        words.retain(|word| !word.is_empty());
        if words.len() > 1 && words[0] == "cargo" && ["launch", "board"].contains(&words[1].as_str()) {
            words.remove(0);
        }
        for (placeholder, name) in PLACEHOLDERS {
            words.iter_mut().filter(|word| *word == placeholder).for_each(|word| *word = name.to_owned());
        }
    }
    let tools = ["cargo", "launch", "board"];
    commands.retain(|words| words.len() > 1 && tools.contains(&words[0].as_str()));
    commands
}

/// The commands of a document: the lines of its shell blocks, and what its prose quotes.
fn commands_of(text: &str) -> Vec<Vec<String>> {
    let (blocks, prose) = blocks(text);
    let lines = blocks.iter().filter(|(language, _)| language == "sh").flat_map(|(_, text)| text.lines());
    let quoted: Vec<String> =
        prose.split('`').skip(1).step_by(2).map(|code| code.replace('\n', " ")).collect();
    lines.chain(quoted.iter().map(String::as_str)).flat_map(commands).collect()
}

/// Where commands are tried: a folder with the graphs of the documents, and what the coffee graph has.
struct Bench {
    folder: TempDir,
    roles: BTreeSet<String>,
    topics: BTreeSet<String>,
    packages: Value,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let names = |list: &Value, key: &str| -> BTreeSet<String> {
            list.as_array().unwrap().iter().map(|entry| entry[key].as_str().unwrap().to_owned()).collect()
        };
        let mut metadata = Command::new(std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned()));
        metadata.args(["metadata", "--no-deps", "--format-version", "1"]).current_dir(root());
        let metadata: Value = serde_json::from_slice(&metadata.output().unwrap().stdout).unwrap();
        let mut check = Command::new(build().join("launch"));
        check.args(["check", "coffee", "--no-build", "--json"]);
        let checked: Value = serde_json::from_slice(&check.output().unwrap().stdout).unwrap();
        let graph = &checked["graph"];
        let (roles, topics) = (names(&graph["services"], "role"), names(&graph["topics"], "name"));
        assert!(roles.contains("planner") && topics.contains("location/pose"), "{roles:?} {topics:?}");
        Self { folder, roles, topics, packages: metadata["packages"].clone() }
    }

    /// Runs a tool in the folder: whether it succeeded, and what it said.
    fn run(&self, tool: &str, arguments: &[String]) -> (bool, String) {
        let mut command = Command::new(build().join(tool));
        command.args(arguments).current_dir(self.folder.path()).env("XDG_STATE_HOME", self.folder.path());
        let output = command.output().unwrap();
        let words = [output.stdout, output.stderr].map(|said| String::from_utf8_lossy(&said).into_owned());
        (output.status.success(), words.concat())
    }

    /// Writes a graph under its name; one without a head changes the coffee graph.
    fn write_graph(&self, text: &str) -> String {
        let head = "[graph]\nname = \"excerpt\"\ninclude = [\"coffee\"]\n\n";
        let whole = if text.contains("[graph]") { text.to_owned() } else { format!("{head}{text}") };
        let name = whole.parse::<toml::Table>().unwrap()["graph"]["name"].as_str().unwrap().to_owned();
        std::fs::write(self.folder.path().join(format!("{name}.toml")), whole).unwrap();
        format!("./{name}.toml")
    }

    fn check_graph(&self, graph: &str, about: &[String]) -> Result<(), String> {
        let arguments = ["check", graph, "--no-build"].map(str::to_owned);
        let (succeeded, words) = self.run("launch", &[&arguments, about].concat());
        if succeeded { Ok(()) } else { Err(words) }
    }

    fn has_role(&self, role: &str) -> Result<(), String> {
        if self.roles.contains(role) { Ok(()) } else { Err(format!("there is no role {role}")) }
    }

    /// Whether a command is taken, and what it names exists.
    fn check(&self, words: &[String]) -> Result<(), String> {
        match words[0].as_str() {
            "cargo" => self.check_cargo(words),
            tool => {
                self.check_taken(tool, words)?;
                self.check_names(words)
            }
        }
    }

    /// Runs the command so that it does nothing, and says whether its own parser takes it.
    fn check_taken(&self, tool: &str, words: &[String]) -> Result<(), String> {
        let verb = words[1].as_str();
        // Only a verb: the sentence is about the command as such.
        let is_named_only = tool == "launch" && words.len() == 2 && {
            !["ps", "attach", "last", "logs", "stop"].contains(&verb)
        };
        let (added, must_succeed): (&[&str], bool) = match (tool, verb) {
            _ if is_named_only => (&["--help"], true),
            ("launch", "check" | "graph") => (&["--no-build"], true),
            ("launch", "experiment") if words.iter().any(|word| word == "--dry-run") => {
                (&["--no-build"], true)
            }
            ("launch", "experiment") => (&["--no-build", "--dry-run"], true),
            ("launch", "up" | "chaos") => (&["--no-build", "--board", NO_NAME], false),
            ("launch", "swap") => (&["--no-build", "--board", "nobody"], false),
            ("launch", "rerun") => (&["--no-build"], false),
            ("launch", "new") => (&["--corkboard", "nowhere"], false),
            ("launch", "digest" | "diff") => (&[], false),
            _ => (&["--board", "nobody"], false),
        };
        let added: Vec<String> = added.iter().map(|&word| word.to_owned()).collect();
        let (succeeded, said) = self.run(tool, &[&words[1..], &added].concat());
        let stays_down =
            !added.iter().any(|word| word == NO_NAME) || said.contains("cannot be a board's name");
        let is_taken = stays_down && !said.contains(NOT_TAKEN) && (succeeded || !must_succeed);
        if is_taken { Ok(()) } else { Err(said) }
    }

    fn check_names(&self, words: &[String]) -> Result<(), String> {
        let options: Vec<&[String]> = words.windows(2).filter(|pair| pair[0].starts_with("--")).collect();
        let about = |known: &[&str]| -> Vec<String> {
            let kept = options.iter().filter(|pair| known.contains(&pair[0].as_str()));
            kept.flat_map(|pair| [pair[0].replace("--with", "--swap"), pair[1].clone()]).collect()
        };
        let Some(first) = words.get(2) else { return Ok(()) };
        match (words[0].as_str(), words[1].as_str()) {
            ("launch", "up" | "check" | "chaos" | "graph") => self.check_graph(first, &about(&ABOUT_GRAPH)),
            ("launch", "restart") => self.has_role(first),
            ("launch", "logs") if first.starts_with('-') || first == "launch" => Ok(()),
            ("launch", "logs") => self.has_role(first),
            ("launch", "swap") if first == "--back" => self.has_role(&words[3]),
            ("launch", "swap") => self.check_graph("coffee", &["--swap".to_owned(), first.clone()]),
            ("launch", "rerun") => {
                options
                    .iter()
                    .filter(|pair| pair[0] == "--only")
                    .try_for_each(|pair| self.has_role(&pair[1]))?;
                self.check_graph("coffee", &about(&["--set", "--with"]))
            }
            ("launch", "order") => {
                let world = std::fs::read_to_string(root().join("launch/worlds/cs-building.toml")).unwrap();
                let is_there = world.contains(&format!("\"{first}\""));
                if is_there { Ok(()) } else { Err(format!("there is no room {first}")) }
            }
            ("board", "echo" | "info" | "rate" | "delay" | "publish") if !first.contains('.') => {
                let is_there = self.topics.contains(first);
                if is_there { Ok(()) } else { Err(format!("there is no topic {first}")) }
            }
            _ => Ok(()),
        }
    }

    /// Packages, benches and examples that a command of cargo names.
    fn check_cargo(&self, words: &[String]) -> Result<(), String> {
        if !["test", "nextest", "bench", "run", "doc", "fmt", "clippy", "deny"].contains(&words[1].as_str()) {
            return Err(format!("there is no cargo {}", words[1]));
        }
        let end = words.iter().position(|word| word == "--").unwrap_or(words.len());
        let value = |option: &str| {
            let at = words[..end].iter().position(|word| word == option)?;
            words.get(at + 1).map(String::as_str)
        };
        let Some(name) = value("-p") else { return Ok(()) };
        let package = self.packages.as_array().unwrap().iter().find(|package| package["name"] == name);
        let package = package.ok_or_else(|| format!("there is no package {name}"))?;
        let targets = package["targets"].as_array().unwrap();
        let has = |kind: &str, name: &str| {
            targets.iter().any(|target| target["kind"][0] == kind && target["name"] == name)
        };
        let is_bench = words[1] == "bench";
        if is_bench && !targets.iter().any(|target| target["kind"][0] == "bench") {
            return Err(format!("{name} has no bench"));
        }
        for kind in ["bench", "example", "test"] {
            if let Some(target) = value(&format!("--{kind}")).filter(|target| !has(kind, target)) {
                return Err(format!("{name} has no {kind} {target}"));
            }
        }
        Ok(())
    }
}

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

#[test]
fn graphs_and_commands_work() {
    let bench = Bench::new();
    let (mut graphs, mut tried) = (0, 0);
    for document in DOCUMENTS {
        let text = std::fs::read_to_string(root().join(document)).unwrap();
        for (_, graph) in blocks(&text).0.iter().filter(|(language, _)| language == "toml") {
            let file = bench.write_graph(graph);
            bench.check_graph(&file, &[]).unwrap_or_else(|words| panic!("{document}, {file}: {words}"));
            graphs += 1;
        }
        for words in commands_of(&text) {
            bench.check(&words).unwrap_or_else(|said| panic!("{document}: `{}`: {said}", words.join(" ")));
            tried += 1;
        }
    }
    assert!(graphs >= 2 && tried >= 60, "{graphs} graphs and {tried} commands were found");
}

#[test]
fn what_does_not_work_is_found() {
    let bench = Bench::new();
    let graph = bench.write_graph("[collision-avoidance]\nside_radius_m = 0.05\n");
    assert!(bench.check_graph(&graph, &[]).unwrap_err().contains("side_radius_m"));
    for wrong in [
        "launch fly coffee",
        "launch up coffee --wings",
        "launch up coffee --without elevator",
        "launch up coffee --speed 2",
        "launch up tea",
        "launch restart elevator",
        "launch logs elevator -f",
        "launch swap controller=no-controller",
        "launch order 999",
        "launch rerun a.mcap --only elevator",
        "launch rerun a.mcap --set planner.clearance=0.4",
        "launch experiment coffee --only \"no rules\"",
        "board echo pose",
        "board echo location/pose --loud",
        "cargo bench -p board --bench square_trip",
        "cargo bench -p navigator",
        "cargo run --release -p tests --example no-fuzz -- --kind map-yaml",
        "cargo nextest run -p elevator",
    ] {
        let words = commands(wrong).remove(0);
        assert!(bench.check(&words).is_err(), "`{wrong}` is taken");
    }
}

#[test]
fn commands_are_found() {
    let text = "`launch up` and `cargo nextest run -p CRATE`, but `[launch]` and `launch` are none.\n\n```sh\n\
                cargo launch ps   # all\ngdb -p $(cargo board info x --json | jq 'a | b')\n\
                launch experiment coffee --only \"fuzzy rules\"\n```\n\n```toml\nlaunch = 1\n```\n";
    let found: Vec<String> = commands_of(text).iter().map(|words| words.join("|")).collect();
    assert_eq!(
        found,
        [
            "launch|ps",
            "board|info|x|--json",
            "launch|experiment|coffee|--only|fuzzy rules",
            "launch|up",
            "cargo|nextest|run|-p|board"
        ]
    );
}
