//! `launch new`: a complete small service to begin with, in this workspace or in a repository of its own.

use crate::cli::NewArgs;
use crate::console::say;
use crate::graph::checkout;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const FILES: [(&str, &str); 4] = [
    ("src/lib.rs", include_str!("../templates/service/lib.rs.txt")),
    ("src/params.rs", include_str!("../templates/service/params.rs.txt")),
    ("src/main.rs", include_str!("../templates/service/main.rs.txt")),
    ("src/tests.rs", include_str!("../templates/service/tests.rs.txt")),
];
/// The workspace's own manifest: versions and profiles of a repository of its own are the same, so nothing is built twice.
const WORKSPACE: &str = include_str!("../../Cargo.toml");
/// The form of its sources.
const STYLE: &str = include_str!("../../rustfmt.toml");
/// What the new service depends on, beside the board and the messages.
const DEPENDENCIES: [&str; 2] = ["schemars", "serde"];
/// Longest name, so that `health/<name>` and the like stay short enough for the transport.
const NAME_MAX: usize = 40;

/// `launch new`.
pub(crate) fn command(args: &NewArgs) -> Result<(), String> {
    let name = checked_name(&args.name)?;
    let sources = args.corkboard.clone().or_else(|| checkout().map(|launch| launch.join("..")));
    let sources = sources
        .and_then(|sources| sources.canonicalize().ok())
        .filter(|sources| sources.join("board/Cargo.toml").is_file())
        .ok_or("the sources of Corkboard are not found; name their folder with --corkboard DIR")?;
    let parent = args.folder.clone().unwrap_or_else(|| sources.join("services"));
    std::fs::create_dir_all(&parent).map_err(|error| format!("{}: {error}", parent.display()))?;
    let parent = parent.canonicalize().map_err(|error| format!("{}: {error}", parent.display()))?;
    let folder = parent.join(name);
    if folder.exists() {
        return Err(format!("{} exists already; choose another name or another folder", folder.display()));
    }
    let inside = parent == sources.join("services");
    let manifest = if inside { manifest_inside(name) } else { manifest_outside(name, &sources)? };
    let mut files = vec![(PathBuf::from("Cargo.toml"), manifest)];
    files.extend(FILES.iter().map(|(path, text)| (PathBuf::from(path), filled(text, name))));
    if !inside {
        files.push((PathBuf::from(".gitignore"), "/target\n".to_owned()));
        files.push((PathBuf::from("rustfmt.toml"), STYLE.to_owned()));
        // The versions that are known to work together; cargo strikes out what is not needed.
        if let Ok(lock) = std::fs::read_to_string(sources.join("Cargo.lock")) {
            files.push((PathBuf::from("Cargo.lock"), lock));
        }
    }
    for (path, text) in files {
        write(&folder.join(path), &text)?;
    }
    // How lines break depends on the name's length. Without rustfmt they stay as they are.
    let _ = Command::new("cargo").arg("fmt").current_dir(&folder).stderr(Stdio::null()).status();
    say(&next_steps(name, &folder, inside));
    Ok(())
}

fn checked_name(name: &str) -> Result<&str, String> {
    let sound = name.len() <= NAME_MAX
        && name.starts_with(|first: char| first.is_ascii_lowercase())
        && !name.ends_with('-')
        && !name.contains("--")
        && name.chars().all(|letter| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '-');
    if sound {
        Ok(name)
    } else {
        Err(format!(
            "`{name}` cannot be a service's name: a noun of the field in lower-case letters, digits and hyphens, such as door-bell"
        ))
    }
}

fn filled(text: &str, name: &str) -> String {
    let camel: String = name
        .split('-')
        .map(|word| {
            let mut letters = word.chars();
            letters
                .next()
                .map(|first| first.to_ascii_uppercase())
                .into_iter()
                .chain(letters)
                .collect::<String>()
        })
        .collect();
    text.replace("{{name}}", name).replace("{{snake}}", &name.replace('-', "_")).replace("{{Type}}", &camel)
}

const DESCRIPTION: &str = "Smooths the speeds of the odometry";

fn manifest_inside(name: &str) -> String {
    let mut text = format!("[package]\nname = \"{name}\"\ndescription = \"{DESCRIPTION}\"\n");
    for key in ["version", "edition", "rust-version", "license", "publish"] {
        let _ = writeln!(text, "{key}.workspace = true");
    }
    text += "\n[lints]\nworkspace = true\n\n[dependencies]\n";
    for dependency in ["board", "messages"].iter().chain(&DEPENDENCIES) {
        let _ = writeln!(text, "{dependency}.workspace = true");
    }
    text
}

fn manifest_outside(name: &str, sources: &Path) -> Result<String, String> {
    let workspace: toml::Table = files::toml::parse(WORKSPACE).map_err(|error| error.to_string())?;
    let table = |key: &str| workspace.get(key).and_then(toml::Value::as_table);
    let dependencies =
        table("workspace").and_then(|table| table.get("dependencies")).and_then(toml::Value::as_table);
    let package = table("workspace").and_then(|table| table.get("package")).and_then(toml::Value::as_table);
    let edition =
        package.and_then(|package| package.get("edition")).and_then(toml::Value::as_str).unwrap_or("2024");
    let mut text = format!(
        "[package]\nname = \"{name}\"\ndescription = \"{DESCRIPTION}\"\nversion = \"0.1.0\"\nedition = \"{edition}\"\npublish = false\n\n# A workspace of its own, wherever it lies.\n[workspace]\n\n[dependencies]\n"
    );
    for (dependency, path) in [("board", "board"), ("messages", "schemas/messages")] {
        let path = sources.join(path).display().to_string();
        let _ = writeln!(text, "{dependency} = {{ path = {} }}", toml::Value::String(path));
    }
    for dependency in DEPENDENCIES {
        let version = dependencies
            .and_then(|all| all.get(dependency))
            .map_or("\"*\"".to_owned(), toml::Value::to_string);
        let _ = writeln!(text, "{dependency} = {version}");
    }
    if let Some(profiles) = table("profile") {
        let profiles = toml::Table::from_iter([("profile".to_owned(), toml::Value::Table(profiles.clone()))]);
        let _ = write!(text, "\n{}", toml::to_string(&profiles).map_err(|error| error.to_string())?);
    }
    Ok(text)
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    let failed = |error: std::io::Error| format!("{}: {error}", path.display());
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    std::fs::write(path, text).map_err(failed)
}

fn next_steps(name: &str, folder: &Path, inside: bool) -> String {
    let folder = folder.display();
    let test = if inside { format!("cargo test -p {name}") } else { format!("cd {folder} && cargo test") };
    let run = if inside {
        String::new()
    } else {
        format!(
            "\n       run = \"{folder}/target/release/{name}\"      # after `cargo build --release` there"
        )
    };
    format!(
        "written: {folder}\n\n  1. its tests pass:        {test}\n  2. give it a table in a graph, such as launch/graphs/coffee.toml:\n       [{name}]{run}\n       time_constant_s = 0.2\n  3. is all in order:       cargo launch check coffee\n  4. run it, and listen:    cargo launch up coffee      cargo board echo {name}/odometry\n\nThen put your own algorithm into src/lib.rs.\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(name: &str, good: bool) {
        assert_eq!(checked_name(name).is_ok(), good, "{name}");
    }

    #[test]
    fn names_are_kebab_case_nouns() {
        check("door-bell", true);
        check("imu2", true);
        check("", false);
        check("DoorBell", false);
        check("door_bell", false);
        check("-bell", false);
        check("bell-", false);
        check("door--bell", false);
        check("2bells", false);
        check("../bell", false);
        check(&"b".repeat(NAME_MAX + 1), false);
    }

    #[test]
    fn the_templates_are_filled() {
        for (path, text) in FILES {
            let text = filled(text, "door-bell");
            assert!(!text.contains("{{"), "{path}");
        }
        assert!(filled(FILES[0].1, "door-bell").contains("pub struct DoorBell {"));
    }

    #[test]
    fn a_repository_of_its_own_has_the_versions_and_profiles_of_the_workspace() {
        let text = manifest_outside("door-bell", Path::new("/opt/cork\"board")).unwrap();
        let manifest: toml::Table =
            files::toml::parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
        assert_eq!(manifest["dependencies"]["board"]["path"].as_str(), Some("/opt/cork\"board/board"));
        assert!(manifest["dependencies"]["serde"]["version"].is_str());
        assert!(manifest["profile"]["dev"].is_table() && manifest["workspace"].is_table());
    }
}
