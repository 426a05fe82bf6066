//! The arrows of the house, held: who may know whom. ARCHITECTURE.md says why.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests lie in the workspace").to_owned()
}

fn folders(path: &Path) -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> =
        fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_dir()).collect();
    folders.sort();
    folders
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = files(folder);
    found.retain(|path| path.extension().is_some_and(|extension| extension == "rs"));
    found
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() && path.file_name().is_some_and(|name| name != "target") {
            found.extend(files(&path));
        } else if path.is_file() {
            found.push(path);
        }
    }
    found.sort();
    found
}

fn manifest(folder: &Path) -> toml::Table {
    fs::read_to_string(folder.join("Cargo.toml")).unwrap().parse().unwrap()
}

fn dependencies(folder: &Path) -> Vec<String> {
    let manifest = manifest(folder);
    let names = |section: &str| {
        manifest
            .get(section)
            .and_then(|value| value.as_table())
            .into_iter()
            .flat_map(|table| table.keys().cloned())
    };
    names("dependencies").chain(names("dev-dependencies")).chain(names("build-dependencies")).collect()
}

fn name(folder: &Path) -> String {
    folder.file_name().unwrap().to_string_lossy().into_owned()
}

/// Lines of code, without comments, that contain the word as a whole.
fn mentions(file: &Path, word: &str) -> Vec<usize> {
    let text = fs::read_to_string(file).unwrap();
    let is_word = |byte: Option<u8>| byte.is_some_and(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    text.lines()
        .enumerate()
        .filter(|(_, line)| {
            let code = line.split("//").next().unwrap_or_default();
            code.match_indices(word).any(|(at, _)| {
                let before = at.checked_sub(1).map(|index| code.as_bytes()[index]);
                !is_word(before) && !is_word(code.as_bytes().get(at + word.len()).copied())
            })
        })
        .map(|(index, _)| index + 1)
        .collect()
}

#[test]
fn the_core_of_a_service_never_names_the_board() {
    for service in folders(&root().join("services")) {
        for file in sources(&service.join("src")) {
            if file.file_name().is_some_and(|name| name == "main.rs") {
                continue;
            }
            let lines = mentions(&file, "board");
            let paths: Vec<usize> = lines
                .into_iter()
                .filter(|line| {
                    let text = fs::read_to_string(&file).unwrap();
                    let code = text.lines().nth(line - 1).unwrap_or_default().to_owned();
                    code.contains("board::") || code.contains("use board")
                })
                .collect();
            assert!(paths.is_empty(), "{} names the board in lines {paths:?}", file.display());
        }
    }
}

#[test]
fn no_service_depends_on_another() {
    let services: Vec<PathBuf> = folders(&root().join("services"));
    let names: Vec<String> = services.iter().map(|service| name(service)).collect();
    assert!(names.len() >= 10, "the house has services: {names:?}");
    for service in &services {
        for dependency in dependencies(service) {
            assert!(!names.contains(&dependency), "{} depends on the service {dependency}", name(service));
        }
    }
}

#[test]
fn no_service_draws() {
    for service in folders(&root().join("services")) {
        let manifest = manifest(&service);
        let known = manifest.get("dependencies").and_then(|value| value.as_table());
        assert!(!known.is_some_and(|known| known.contains_key("pictures")), "{} draws", name(&service));
    }
}

#[test]
fn the_launcher_depends_on_no_service() {
    let names: Vec<String> = folders(&root().join("services")).iter().map(|service| name(service)).collect();
    for dependency in dependencies(&root().join("launch")) {
        assert!(!names.contains(&dependency), "launch depends on the service {dependency}");
    }
}

/// The crates of this house that others may know.
const KNOWN: [&str; 8] =
    ["board", "files", "fuzzy", "geometry", "messages", "pictures", "recording", "launch"];

#[test]
fn every_room_knows_what_the_table_of_rooms_says() {
    let architecture = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let rows: Vec<(&str, &str)> = architecture
        .lines()
        .filter_map(|line| {
            let mut cells = line.strip_prefix("| `")?.trim_end_matches('|').split('|');
            let room = cells.next()?.trim().trim_end_matches('`');
            Some((room, cells.next_back()?))
        })
        .take_while(|(room, _)| *room != "tests")
        .collect();
    let folders = rows.iter().flat_map(|(room, may_know)| match room.strip_suffix("/*") {
        Some(parent) => folders(&root().join(parent)).into_iter().map(|folder| (folder, *may_know)).collect(),
        None => vec![(root().join(room), *may_know)],
    });
    let mut looked = 0;
    for (folder, may_know) in folders {
        let allowed: Vec<&str> = may_know.split(|letter: char| !letter.is_alphanumeric()).collect();
        for dependency in dependencies(&folder).iter().filter(|name| KNOWN.contains(&name.as_str())) {
            // Pictures of examples and tests are drawn anywhere.
            let is_drawing = dependency == "pictures" && folder.starts_with(root().join("services"));
            assert!(
                is_drawing || allowed.contains(&dependency.as_str()),
                "{} depends on {dependency}",
                folder.display()
            );
            looked += 1;
        }
    }
    assert!(rows.len() > 8 && looked > 60, "the table is read: {} rows, {looked} arrows", rows.len());
}

#[test]
fn only_the_board_knows_the_transport() {
    let root = root();
    for folder in ["services", "schemas", "launch", "tests"] {
        for file in sources(&root.join(folder)) {
            if file.ends_with("tidy.rs") {
                continue;
            }
            assert_eq!(mentions(&file, "iceoryx2"), Vec::<usize>::new(), "{}", file.display());
        }
    }
    for file in sources(&root.join("board/src")) {
        if !file.ends_with("transport.rs") {
            assert_eq!(mentions(&file, "iceoryx2"), Vec::<usize>::new(), "{}", file.display());
        }
    }
}

#[test]
fn glam_appears_in_geometry_only() {
    let root = root();
    for folder in ["services", "board", "schemas/messages", "launch", "tests"] {
        for file in sources(&root.join(folder)) {
            if file.ends_with("tidy.rs") {
                continue;
            }
            for word in ["glam", "glamx", "parry2d", "parry2d_f64"] {
                assert_eq!(mentions(&file, word), Vec::<usize>::new(), "{}", file.display());
            }
        }
    }
}

#[test]
fn every_crate_obeys_the_one_lint_table() {
    let root = root();
    let mut crates = folders(&root.join("services"));
    crates.extend(
        [
            "board",
            "board/recording",
            "board/tool",
            "launch",
            "tests",
            "schemas/files",
            "schemas/fuzzy",
            "schemas/geometry",
            "schemas/messages",
            "schemas/messages/derive",
            "schemas/pictures",
        ]
        .map(|name| root.join(name)),
    );
    for folder in crates {
        let workspace = manifest(&folder)
            .get("lints")
            .and_then(|lints| lints.get("workspace"))
            .and_then(|value| value.as_bool());
        assert_eq!(workspace, Some(true), "{} has lints of its own", folder.display());
    }
}

#[test]
fn a_service_is_named_after_its_folder() {
    for service in folders(&root().join("services")) {
        let manifest = manifest(&service);
        assert_eq!(manifest["package"]["name"].as_str(), Some(name(&service).as_str()));
        for file in ["src/lib.rs", "src/params.rs", "src/main.rs"] {
            assert!(service.join(file).exists(), "{} has no {file}", name(&service));
        }
    }
}

#[test]
fn the_top_level_is_the_agreed_one() {
    let allowed = [
        "Cargo.toml",
        "Cargo.lock",
        "README.md",
        "REQUIREMENTS.md",
        "ARCHITECTURE.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "SECURITY.md",
        "LICENSE-APACHE",
        "LICENSE-MIT",
        "board",
        "clippy.toml",
        "deny.toml",
        "launch",
        "rustfmt.toml",
        "schemas",
        "services",
        "tests",
        "typos.toml",
        "target",
        // Of experiments and pictures; git leaves it out.
        "results",
    ];
    for entry in fs::read_dir(root()).unwrap() {
        let name = entry.unwrap().file_name().to_string_lossy().into_owned();
        assert!(name.starts_with('.') || allowed.contains(&name.as_str()), "{name} at the top level");
    }
}

#[test]
fn the_test_in_the_readme_is_one_that_runs() {
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    let test = include_str!("first.rs");
    assert!(readme.contains(&format!("```rust\n{test}```")), "the README shows another test than first.rs");
    assert!(test.lines().count() <= 25, "a first test is short");
}

/// Tags such as `COF-047`, and notes such as `note 2.6`, in a text.
fn tags(text: &str) -> BTreeSet<String> {
    let mut tags = BTreeSet::new();
    for (kind, separator) in [("COF", '-'), ("NXT", '-'), ("ASN", '-'), ("X", '-'), ("note", ' ')] {
        for (start, _) in text.match_indices(kind) {
            let is_word = text[..start]
                .chars()
                .next_back()
                .is_some_and(|before| before.is_alphanumeric() || before == '-');
            let Some(rest) = text[start + kind.len()..].strip_prefix(separator).filter(|_| !is_word) else {
                continue;
            };
            let digits = |text: &str| text.chars().take_while(char::is_ascii_digit).collect::<String>();
            let (number, is_note) = (digits(rest), separator == ' ');
            let part = rest[number.len()..].strip_prefix('.').map(digits).unwrap_or_default();
            if is_note && !number.is_empty() && !part.is_empty() {
                tags.insert(format!("{kind} {number}.{part}"));
            } else if !is_note && number.len() > 1 {
                tags.insert(format!("{kind}-{number}"));
            }
        }
    }
    tags
}

#[test]
fn every_tag_is_defined_and_cited() {
    let book = fs::read_to_string(root().join("REQUIREMENTS.md")).unwrap();
    let heads = book.lines().filter_map(|line| line.strip_prefix("- **")?.split("**").next());
    let defined: BTreeSet<String> = heads.map(str::to_owned).collect();
    let mut cited = BTreeSet::new();
    for room in ["board", "launch", "schemas", "services", "tests"] {
        for file in files(&root().join(room)) {
            cited.extend(tags(&fs::read_to_string(&file).unwrap_or_default()));
        }
    }
    for file in ["README.md", "ARCHITECTURE.md"] {
        cited.extend(tags(&fs::read_to_string(root().join(file)).unwrap()));
    }
    let undefined: Vec<_> = cited.difference(&defined).collect();
    let idle: Vec<_> = defined.difference(&cited).collect();
    assert!(undefined.is_empty() && idle.is_empty(), "not defined: {undefined:?}; cited nowhere: {idle:?}");
}

#[test]
fn tags_are_found() {
    let found = tags("(COF-047..049, X-26); see note 2.6. XX-12, X-1 and COF-, note that 3 are none");
    assert_eq!(found.into_iter().collect::<Vec<_>>(), ["COF-047", "X-26", "note 2.6"]);
}

/// Columns of prose and of comments.
const COLUMNS: usize = 110;

/// The lines of a text that are longer than they should be.
fn long_lines(text: &str) -> Vec<usize> {
    let lines = text.lines().zip(1..);
    lines.filter(|(line, _)| line.chars().count() > COLUMNS).map(|(_, number)| number).collect()
}

#[test]
fn documents_have_short_lines() {
    let mut looked = 0;
    for file in fs::read_dir(root()).unwrap().map(|entry| entry.unwrap().path()) {
        if file.extension().is_some_and(|end| end == "md") {
            let long = long_lines(&fs::read_to_string(&file).unwrap());
            assert!(long.is_empty(), "{}: lines {long:?} have over {COLUMNS} columns", file.display());
            looked += 1;
        }
    }
    assert!(looked >= 6, "{looked} documents were found");
}

#[test]
fn long_lines_are_found() {
    let (fits, too_long) = ("ä".repeat(COLUMNS), "ä".repeat(COLUMNS + 1));
    assert_eq!(long_lines(&format!("{fits}\n{too_long}\n\n{fits}")), [2]);
}

/// The lines of a program that are comments, and longer than they should be.
fn long_comments(text: &str) -> Vec<usize> {
    let comments: BTreeSet<usize> = text
        .lines()
        .zip(1..)
        .filter(|(line, _)| line.trim_start().starts_with("//"))
        .map(|(_, number)| number)
        .collect();
    long_lines(text).into_iter().filter(|number| comments.contains(number)).collect()
}

#[test]
fn comments_have_short_lines() {
    let root = root();
    let mut looked = 0;
    for room in ["board", "launch", "schemas", "services", "tests"] {
        for file in sources(&root.join(room)) {
            // Not yet.
            if file.starts_with(root.join("board/src")) || file.starts_with(root.join("launch/src")) {
                continue;
            }
            let long = long_comments(&fs::read_to_string(&file).unwrap());
            let file = file.strip_prefix(&root).unwrap().display();
            assert!(long.is_empty(), "{file}: comments in lines {long:?} have over {COLUMNS} columns");
            looked += 1;
        }
    }
    assert!(looked > 200, "{looked} files were found");
}

#[test]
fn long_comments_are_found() {
    let long = "/".repeat(COLUMNS + 1);
    assert_eq!(
        long_comments(&format!("fn main() {{}}\n    {long}\nlet slashes = \"{long}\";\n// short")),
        [2]
    );
}
