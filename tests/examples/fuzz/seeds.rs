//! Valid files of each kind, and the words of their languages.

use crate::kinds::{Kind, SERVICES};
use crate::mutate::Mutator;
use crate::worker::binaries;
use messages::{Description, Kind as Number, catalogue, elements_offset};
use recording::{Envelope, Manifest, Recorder, Topic};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Pictures of the tests of `geometry`, in every form that is read.
pub(crate) const IMAGES: &[&str] = &[
    "bits.png",
    "clear-grey.png",
    "clear.png",
    "colour.bmp",
    "colour.png",
    "colour.ppm",
    "grey.bmp",
    "grey.pgm",
    "grey.png",
    "grey16.png",
    "indexed-clear.png",
    "indexed.png",
    "letters.pgm",
    "letters.pbm",
];

/// The valid files of a kind; what belongs to them lies in `scratch`.
pub(crate) fn of(kind: Kind, scratch: &Path) -> Mutator {
    let text = |files: &[String]| files.iter().map(|file| file.clone().into_bytes()).collect();
    let (seeds, words, is_binary): (Vec<Vec<u8>>, &'static [&'static str], bool) = match kind {
        Kind::MapYaml => (maps(scratch), MAP_WORDS, false),
        Kind::MapImage => (
            images(),
            &["P1", "P2", "P4", "P5", "P6", "P7", "IHDR", "PLTE", "tRNS", "IDAT", "IEND", "BM"],
            true,
        ),
        Kind::World => (text(&worlds()), WORLD_WORDS, false),
        Kind::Carmen => {
            (text(&[DRIVE.replace("SCAN", &"2.5 ".repeat(181)), DRIVE_OF_FEW.to_owned()]), LOG_WORDS, false)
        }
        Kind::StepLog => (text(&[STEPS.to_owned()]), LOG_WORDS, false),
        Kind::Fcl => (text(&rules()), FCL_WORDS, false),
        Kind::Mcap => (recordings(scratch), &[], true),
        Kind::Params => (SERVICES.iter().map(|service| defaults(service)).collect(), PARAM_WORDS, false),
        Kind::Graph => (text(&graphs()), GRAPH_WORDS, false),
        Kind::Experiment => (text(&experiments(scratch)), EXPERIMENT_WORDS, false),
    };
    Mutator { seeds, words, is_binary }
}

const MAP_WORDS: &[&str] = &[
    "image",
    "resolution",
    "origin",
    "negate",
    "occupied_thresh",
    "free_thresh",
    "mode",
    "trinary",
    "scale",
    "raw",
    "true",
    "false",
    "yes",
    "~",
    "null",
    "!!str",
    "!!float",
    "&a",
    "*a",
    "<<: *a",
    "? ",
    "- ",
    "---",
    "...",
    "%YAML 1.2",
    "|",
    ">-",
    "map.pgm",
    "/dev/zero",
    "/",
    "..",
    "map.yaml",
    "image: map.pgm\n",
    "resolution: 0.05\n",
    "origin: [0, 0, 0]\n",
];
const WORLD_WORDS: &[&str] = &[
    "[[floor]]",
    "[[door]]",
    "[[elevator]]",
    "[[start]]",
    "[[person]]",
    "[[obstacle]]",
    "[[area]]",
    "[[anchor]]",
    "[world]",
    "floor",
    "number",
    "walls",
    "outline",
    "room",
    "width_m",
    "x_m",
    "y_m",
    "height_m",
    "heading_rad",
    "hinge",
    "left",
    "right",
    "polygon",
    "true",
    "[",
    "]",
    "[]",
    "{}",
    "=",
];
const LOG_WORDS: &[&str] = &[
    "PARAM",
    "SYNC",
    "ODOM",
    "FLASER",
    "RLASER",
    "LASER",
    "LASER3",
    "ROBOTLASER1",
    "ROBOTLASER2",
    "RAWLASER1",
    "RAWLASER3",
    "TRUEPOS",
    "GPS",
    "NMEAGGA",
    "IMU",
    "BEACON",
    "#",
    "robot_frontlaser_offset",
    "laser_front_laser_fov",
    "nohost",
    "181",
    "360",
    "10000",
    "10001",
];
const FCL_WORDS: &[&str] = &[
    "FUNCTION_BLOCK",
    "END_FUNCTION_BLOCK",
    "VAR_INPUT",
    "VAR_OUTPUT",
    "END_VAR",
    "FUZZIFY",
    "END_FUZZIFY",
    "DEFUZZIFY",
    "END_DEFUZZIFY",
    "RULEBLOCK",
    "END_RULEBLOCK",
    "TERM",
    "RULE",
    "IF",
    "THEN",
    "AND",
    "OR",
    "NOT",
    "IS",
    "ANY",
    "VERY",
    "SOMEWHAT",
    "WITH",
    "METHOD",
    "COG",
    "COGS",
    "LM",
    "RM",
    "MOM",
    "ACCU",
    "MAX",
    "NSUM",
    "BSUM",
    "PROBOR",
    "ACT",
    "MIN",
    "PROD",
    "DEFAULT",
    "RANGE",
    ":=",
    ":",
    ";",
    "(",
    ")",
    "(*",
    "*)",
    "//",
    "/*",
    "GAUSS",
    "GAUSS2",
    "GBELL",
    "SIGM",
    "TRIAN",
    "TRAPE",
    "COSINE",
    "DSIGM",
    "FUNCTION",
    "Linear",
    "REAL",
    "NC",
    "..",
];
const PARAM_WORDS: &[&str] = &[
    "null",
    "true",
    "false",
    "{}",
    "[]",
    "\"\"",
    ":",
    ",",
    "\"world\":\"/dev/zero\"",
    "\"map\":\"/\"",
    "\"x\":1,",
    "\"\\u0000\"",
    "\"\\ud800\"",
];
const GRAPH_WORDS: &[&str] = &[
    "[graph]",
    "[graph.defaults]",
    "[graph.view]",
    "[[fault]]",
    "include",
    "name",
    "seed",
    "finish",
    "run",
    "cpu",
    "may_end",
    "[planner.launch]",
    "memory_mb",
    "restart",
    "priority",
    "log",
    "compute_ms",
    "hang_after_ms",
    "true",
    "{}",
    "[]",
    "=",
    "\"coffee\"",
    "\"/dev/zero\"",
    "\"..\"",
    "\"graph.toml\"",
    "[a.b.c]",
    "[[a]]",
    "info,grid_planner=debug",
];
const EXPERIMENT_WORDS: &[&str] = &[
    "graph",
    "limit_s",
    "seeds",
    "worlds",
    "[[variant]]",
    "[variant.set]",
    "[set]",
    "[set.referee]",
    "swap",
    "without",
    "expect",
    "name",
    "count",
    "from",
    "columns",
    "true",
    "{}",
    "[]",
    "=",
    "\"graph.toml\"",
];

const DRIVE: &str = "\
# message formats defined: PARAM SYNC ODOM FLASER
PARAM robot_frontlaser_offset 0.3 nohost 0
PARAM laser_front_laser_fov 3.14159 nohost 0
SYNC start 9.9 host 9.9
ODOM 1 2 0.5 0.1 0.2 0 10.0 host 10.0
FLASER 181 SCAN 7 8 0.25 1 2 0.5 10.1 host 10.1
ROBOTLASER1 0 -1.57 3.14 0.0174 40 0.01 0 181 SCAN 0 1.2 2 0 1 2 0 0 0 0.5 0.3 0.2 10.2 host 10.2
RAWLASER1 0 -1.57 3.14 0.0174 40 0.01 0 181 SCAN 0 10.3 host 10.3
TRUEPOS 1 2 0 1 2 0 10.4 host 10.4
ODOM 1.5 2 0.5 0.1 0.2 0 11.0 host 11.0
";
const DRIVE_OF_FEW: &str = "\
PARAM robot_rearlaser_offset -0.2 nohost 0
ODOM 1 2 0.5 0.1 0.2 0 10.0 host 10.0
FLASER 3 1.0 inf nan 7 8 0.25 1 2 0.5 10.1 host 10.1
RLASER 3 1.0 2.0 -inf 7 8 0.25 1 2 0.5 10.1 host 10.1
LASER3 3 1.0 2.0 3.0 10.15 host 10.15
ROBOTLASER2 0 -1.57 3.14 1.57 80 0.01 0 3 2 2 2 3 0.5 0.6 0.7 0 1 2 0 1 2 0 0 0 0.5 0.3 0.2 10.2 h 10.2
RAWLASER2 0 -1.57 3.14 1.57 80 0.01 0 3 2 2 2 0 10.3 h 10.3
NMEAGGA 1 2 3 4 10.3 h 10.3
ODOM 1.5 2 0.5 0.1 0.2 0 9.0 host 9.0
ODOM 1.6 2 0.5 0.1 0.2 0 90.0 host 90.0
";
const STEPS: &str = "\
ODOM 0 0 0 0
LASER 0 3.141593 0.1 0 0 3 1.0 2.0 81.0
BEACON 0 1 5.0 0.16 0 1.12
BEACON 0 2 6.0 0.16 0 1.12
ODOM 1 0.5 0 1.5707963267948966
BEACON 1 1 4.5 0.16 0 1.12
ODOM 2 0.5 0 0
";

/// The project's folder.
fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap()
}

fn text_of(file: &str) -> String {
    std::fs::read_to_string(project().join(file)).unwrap()
}

fn maps(scratch: &Path) -> Vec<Vec<u8>> {
    std::fs::copy(project().join("schemas/geometry/tests/maps/grey.pgm"), scratch.join("map.pgm")).unwrap();
    let plain = "image: map.pgm\nresolution: 0.050000\norigin: [-10.5, -2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
    let rich = "%YAML 1.2\n---\n# a map\nmode: scale\nimage: \"map.pgm\"\nextra: {a: [1, 2, {b: c}], d: &x {e: f}}\nmore:\n  image: other.png\n  list:\n  - 1\n  - *x\ntext: |\n  resolution: 7\nresolution: 5e-2\norigin:\n- 0\n- 0.5\n- 0\nnegate: true\noccupied_thresh: .65\nfree_thresh: 0.25\n...\n";
    let flow = "{image: map.pgm, resolution: 0.05, origin: [0, 0, 0], negate: 0, occupied_thresh: 0.65, free_thresh: 0.196, mode: raw}";
    [plain, rich, flow].map(|text| text.as_bytes().to_vec()).to_vec()
}

fn images() -> Vec<Vec<u8>> {
    let of_name = |name: &&str| match *name {
        "letters.pgm" => b"P2\n# a map\n4 3\n255\n0 10 20 30\n254 205 100 7\n1 2 3 4\n".to_vec(),
        "letters.pbm" => b"P1\n4 3\n0 1 0 1\n1 1 0 0\n0 0 0 1\n".to_vec(),
        name => std::fs::read(project().join("schemas/geometry/tests/maps").join(name)).unwrap(),
    };
    IMAGES.iter().map(of_name).collect()
}

fn worlds() -> Vec<String> {
    let names = ["arena-1", "arena-2", "blocked-hallway", "cs-building"];
    let shipped = names.map(|name| text_of(&format!("launch/worlds/{name}.toml")));
    shipped.into_iter().chain([text_of("schemas/geometry/tests/example-world.toml")]).collect()
}

fn rules() -> Vec<String> {
    let mut all: Vec<String> = ["rotation", "avoidance", "motion"]
        .map(|name| text_of(&format!("services/fuzzy-controller/fcl/{name}.fcl")))
        .to_vec();
    all.push(RULES_OF_ALL_SORTS.to_owned());
    all
}

const RULES_OF_ALL_SORTS: &str = "\
FUNCTION_BLOCK all_sorts
VAR_INPUT
  a : REAL; (* one *)
  b : REAL;
END_VAR
VAR_OUTPUT
  c : REAL;
  d : REAL;
END_VAR
FUZZIFY a
  RANGE := (0 .. 10);
  TERM low := (0, 1) (3, 0);
  TERM mid := trian 2 5 8;
  TERM high := gauss 10 2;
  TERM bell := gbell 2 4 6;
END_FUZZIFY
FUZZIFY b
  TERM low := sigm -4 3;
  TERM high := trape 2 4 6 8;
END_FUZZIFY
DEFUZZIFY c
  TERM slow := (0, 0) (1, 1) (2, 0);
  TERM fast := (1, 0) (2, 1) (3, 0);
  METHOD : COG;
  ACCU : MAX;
  DEFAULT := NC;
  RANGE := (0 .. 3);
END_DEFUZZIFY
DEFUZZIFY d
  TERM less := -1;
  TERM more := 1;
  METHOD : COGS;
  DEFAULT := 0;
END_DEFUZZIFY
RULEBLOCK first
  AND : MIN;
  OR : MAX;
  ACT : MIN;
  RULE 1 : IF a IS low AND (b IS NOT high OR NOT b IS low) THEN c IS slow WITH 0.5;
  RULE 2 : IF a IS very high OR b IS any THEN c IS fast, d IS more;
  RULE 3 : IF a IS somewhat mid THEN d IS less;
END_RULEBLOCK
END_FUNCTION_BLOCK
";

/// A message of any type: noughts, which are valid for all.
fn blank(description: &Description, elements: usize) -> Vec<u8> {
    let bytes = match &description.element {
        Some(element) if element.size() > 0 => elements_offset(description.size) + elements * element.size(),
        _ => description.size,
    };
    vec![0; bytes]
}

/// Recordings whole, cut, and with chunks that lie open, which a fault does not spoil altogether.
fn recordings(scratch: &Path) -> Vec<Vec<u8>> {
    let topic = |message: Description| Topic {
        name: message.name.to_lowercase(),
        publisher: Some("somebody".into()),
        depth: 8,
        readers: vec![],
        elements: messages::ELEMENTS,
        message,
    };
    let small = Description {
        name: "Small".into(),
        doc: String::new(),
        size: 16,
        alignment: 8,
        fields: Vec::new(),
        element: Some(Number::U16),
    };
    let mut descriptions = catalogue();
    descriptions.truncate(6);
    descriptions.push(Description { size: 0, ..small });
    let topics: Vec<Topic> = descriptions.into_iter().map(topic).collect();
    let manifest =
        Manifest { graph: "fuzz".into(), seed: 1, topics, notes: [("begin_ns".into(), "0".into())].into() };
    let path = scratch.join("valid.mcap");
    let _ = std::fs::remove_file(&path);
    let mut recorder = Recorder::new(&path, &manifest).unwrap();
    for number in 0..60_u64 {
        let topic = number as usize % manifest.topics.len();
        let (stamp_ns, sequence) = (number / 3 * 1_000_000, number + 1);
        let envelope =
            Envelope { stamp_ns, origin_ns: stamp_ns, sequence, generation: 1, round: number as u32 % 3 };
        let bytes = blank(&manifest.topics[topic].message, number as usize % 5);
        let misfit = if number % 11 == 0 { 1 } else { bytes.len() };
        recorder.record(topic, &envelope, &bytes[..misfit.min(bytes.len())]).unwrap();
        if number % 20 == 19 {
            recorder.flush().unwrap();
        }
    }
    recorder.note("lost", "{}");
    recorder.finish().unwrap();
    let whole = std::fs::read(&path).unwrap();
    let cut = whole[..whole.len() * 2 / 3].to_vec();
    let open = with_open_chunks(&whole);
    vec![whole, cut, open.clone(), open.clone(), open]
}

/// The same records, of which those of chunks are neither packed nor summed.
fn with_open_chunks(whole: &[u8]) -> Vec<u8> {
    use mcap::records::op;
    let mut bytes = mcap::MAGIC.to_vec();
    let record = |opcode: u8, body: &[u8]| [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat();
    let mut reader = mcap::sans_io::LinearReader::new();
    let mut rest = whole;
    let mut chunk = Vec::new();
    while let Some(event) = reader.next_event() {
        match event.unwrap() {
            mcap::sans_io::LinearReadEvent::ReadRequest(wanted) => {
                let (part, after) = rest.split_at(wanted.min(rest.len()));
                reader.insert(part.len()).copy_from_slice(part);
                reader.notify_read(part.len());
                rest = after;
            }
            mcap::sans_io::LinearReadEvent::Record { data, opcode } => match opcode {
                op::SCHEMA | op::CHANNEL | op::MESSAGE | 0x80.. => chunk.extend(record(opcode, data)),
                op::HEADER => bytes.extend(record(opcode, data)),
                op::METADATA => bytes.extend(record(opcode, data)),
                // Those after the data repeat what stood in the chunks.
                op::DATA_END => break,
                _ => {}
            },
        }
    }
    let mut body = Vec::new();
    body.extend(0_u64.to_le_bytes());
    body.extend(20_000_000_u64.to_le_bytes());
    body.extend((chunk.len() as u64).to_le_bytes());
    // No sum, and no packing.
    body.extend([0; 8]);
    body.extend((chunk.len() as u64).to_le_bytes());
    body.extend(&chunk);
    bytes.extend(record(op::CHUNK, &body));
    bytes.extend(record(op::DATA_END, &[0; 4]));
    bytes
}

/// All parameters of a service with their defaults.
fn defaults(service: &str) -> Vec<u8> {
    let output = Command::new(binaries().join(service)).arg("--interface").output();
    let output = output.unwrap_or_else(|error| panic!("{service}: {error}; build the services in release"));
    let interface: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    interface["defaults"].to_string().into_bytes()
}

const GRAPH: &str = "\
[graph]
name = \"small\"
seed = 3

[graph.defaults]
top_speed_mps = 0.5

[graph.view]
pose = \"location/pose\"

[[fault]]
at_s = 3.0
kill = \"log-player\"

[log-player]
format = \"carmen\"
period_s = 0.02
anchors = [{ id = 1, x_m = 0.0, y_m = 2.0, z_m = 1.0 }]

[log-player.launch]
log = \"info,log_player=debug\"
restart = false
cpu = [0]

[mapper]
min_x_m = -70.0
width_m = 140.0
";

fn graphs() -> Vec<String> {
    let shipped = |name: &str| {
        let text = text_of(&format!("launch/graphs/{name}.toml"));
        let worlds = format!("{}/launch/worlds/", project().display());
        text.replace("../worlds/", &worlds)
    };
    let localiser = "[graph]\nname = \"two\"\n\n[localiser]\nrun = \"particle-localiser\"\nparticles = 500\nstart = { x_m = 0.6, y_m = 0.0, heading_rad = 0.1, sigma_m = 0.1, sigma_rad = 0.05 }\n";
    let mut all = vec![GRAPH.to_owned(); 4];
    all.extend([
        localiser.to_owned(),
        "[referee]\nmode = \"localisation\"\n".to_owned(),
        shipped("laser-map"),
    ]);
    all.extend([shipped("coffee"), shipped("malaga")]);
    all
}

/// A graph that is in order, so that an experiment's own mistakes count.
const RIGHT_GRAPH: &str = "[graph]
name = \"small\"
seed = 3
external = [\"location/pose\", \"laser/scan\"]

[mapper]
width_m = 140.0
";

fn experiments(scratch: &Path) -> Vec<String> {
    let graph = scratch.join("right.toml");
    std::fs::write(&graph, RIGHT_GRAPH).unwrap();
    let first = format!(
        "graph = {graph:?}\nlimit_s = 20.0\nseeds = {{ from = 1, count = 3 }}\n\n[set.mapper]\nwidth_m = 100.0\n\n[across]\n\"mapper.height_m\" = [50.0, 60.0]\n\n[[variant]]\nname = \"one\"\nexpect = {{ passes = [1, 1] }}\n\n[[variant]]\nname = \"two\"\n[variant.set]\nmapper = {{ resolution_m = 0.1 }}\n"
    );
    let second = format!(
        "graph = {graph:?}\nseeds = [1, 5, 9]\nlimit_s = 5\n\n[[variant]]\nname = \"only\"\n[variant.set]\n\"mapper.height_m\" = 20.0\n"
    );
    vec![first, second]
}
