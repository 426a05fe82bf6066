//! Building the services that a graph names, in a source checkout.

use super::find::checkout;
use crate::console::warn;
use indicatif::{ProgressBar, ProgressStyle};
use std::collections::HashMap;
use std::io::{BufRead, BufReader, IsTerminal as _};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Why services could not be built.
#[derive(Debug, thiserror::Error)]
pub(crate) enum BuildError {
    /// There is no cargo.
    #[error("cannot start `{cargo}`: {cause}; install Rust, or use what is built already with --no-build")]
    NoCargo {
        /// The command.
        cargo: String,
        /// What the operating system said.
        cause: std::io::Error,
    },
    /// The compiler refused; it has said why.
    #[error("the build of {packages} failed")]
    Failed {
        /// What was to be built.
        packages: String,
    },
}

/// Builds these crates in release, and says where each binary lies. Whether there is anything to do is cargo's business.
pub(crate) fn build(packages: &[String]) -> Result<HashMap<String, PathBuf>, BuildError> {
    let mut built = HashMap::new();
    let Some(folder) = checkout().filter(|_| !packages.is_empty()) else { return Ok(built) };
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let mut command = Command::new(&cargo);
    command.args(["build", "--release", "--message-format", "json-render-diagnostics"]);
    command.args(packages.iter().flat_map(|package| ["--package", package]));
    command.current_dir(folder.join("..")).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let no_cargo = |cause| BuildError::NoCargo { cargo: cargo.clone(), cause };
    let mut child = command.spawn().map_err(no_cargo)?;
    let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
    let progress = Progress::new(packages);
    let complaints = std::thread::scope(|scope| {
        let read = || {
            let lines =
                stderr.into_iter().flat_map(|pipe| BufReader::new(pipe).lines()).map_while(Result::ok);
            lines.filter(|line| !progress.takes(line)).collect::<Vec<_>>()
        };
        // Without it cargo's words would hold up cargo.
        let complaints = std::thread::Builder::new().spawn_scoped(scope, read).inspect_err(|_| {
            let _ = child.kill();
        })?;
        for line in stdout.into_iter().flat_map(|pipe| BufReader::new(pipe).lines()).map_while(Result::ok) {
            built.extend(binary_in(&line));
        }
        Ok(complaints.join().unwrap_or_default())
    });
    progress.end();
    let complaints = complaints.map_err(no_cargo)?;
    if child.wait().is_ok_and(|status| status.success()) {
        return Ok(built);
    }
    for line in complaints {
        warn(&line);
    }
    Err(BuildError::Failed { packages: packages.join(", ") })
}

/// The binary of which cargo speaks, by name.
fn binary_in(line: &str) -> Option<(String, PathBuf)> {
    let message: serde_json::Value = serde_json::from_str(line).ok()?;
    let executable = message.get("executable")?.as_str()?;
    let target = message.get("target")?;
    let is_binary = target.get("kind")?.as_array()?.iter().any(|kind| kind == "bin");
    is_binary.then(|| Some((target.get("name")?.as_str()?.to_owned(), PathBuf::from(executable))))?
}

/// A line that moves on a terminal; elsewhere one line, if anything has to be built at all.
struct Progress {
    bar: Option<ProgressBar>,
    announced: std::sync::OnceLock<()>,
    packages: String,
}

impl Progress {
    fn new(packages: &[String]) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new_spinner();
            if let Ok(style) = ProgressStyle::with_template("{spinner:.cyan} {msg}  {elapsed:.dim}") {
                bar.set_style(style);
            }
            bar.set_message(format!("building {} services", packages.len()));
            bar.enable_steady_tick(Duration::from_millis(120));
            bar
        });
        Self { bar, announced: std::sync::OnceLock::new(), packages: packages.join(", ") }
    }

    /// Shows what cargo is about; false for a line that is no progress.
    fn takes(&self, line: &str) -> bool {
        const WORDS: [&str; 9] = [
            "Compiling",
            "Finished",
            "Blocking",
            "Updating",
            "Downloading",
            "Downloaded",
            "Fresh",
            "Locking",
            "Adding",
        ];
        let mut words = line.split_whitespace();
        let Some(word) = words.next().filter(|word| WORDS.contains(word)) else { return false };
        if let Some(bar) = &self.bar {
            bar.set_message(format!(
                "{} {}",
                word.to_lowercase(),
                words.take(4).collect::<Vec<_>>().join(" ")
            ));
        } else if word == "Compiling" {
            self.announced.get_or_init(|| warn(&format!("building {} (release) ..", self.packages)));
        }
        true
    }

    fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
