//! Where the binaries of services are, and what they say of themselves.

use super::ask::{self, PATIENCE, Spent};
use super::check::{Binaries, NotFound, QueryError};
use super::find::checkout;
use board::Interface;
use serde_json::Value;
use std::collections::HashMap;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The binaries on this machine.
#[derive(Debug, Clone)]
pub(crate) struct Installed {
    /// The graph's folder: from where paths count, and the working directory of every service.
    pub(crate) folder: PathBuf,
    /// Binaries that were just built, by name.
    pub(crate) built: HashMap<String, PathBuf>,
}

impl Binaries for Installed {
    fn locate(&self, run: &str) -> Result<PathBuf, NotFound> {
        let candidates = self.candidates(run);
        if let Some(found) = candidates.iter().find(|path| is_executable(path)) {
            return Ok(found.canonicalize().unwrap_or_else(|_| found.clone()));
        }
        let is_path = run.contains('/');
        let source = checkout().filter(|folder| !is_path && folder.join("../services").join(run).is_dir());
        // The whole search path would fill the screen.
        let shown = if is_path { candidates.len() } else { self.own_candidates(run).len() };
        let mut looked: Vec<PathBuf> = candidates.into_iter().take(shown).collect();
        if !is_path {
            looked.push(PathBuf::from("the search path"));
        }
        Err(NotFound {
            looked,
            known: if is_path { Vec::new() } else { known_binaries() },
            command: source.map(|_| format!("cargo build --release --package {run}")),
        })
    }

    fn interface(&self, binary: &Path, parameters: Option<&Value>) -> Result<Interface, QueryError> {
        let mut command = Command::new(binary);
        command.arg("--interface").current_dir(&self.folder);
        if let Some(parameters) = parameters {
            command.arg("--params").arg(parameters.to_string());
        }
        let output = ask::run(&mut command, PATIENCE, |spent| {
            tell_slow(binary, largest_file(&self.folder, parameters), spent);
        })?;
        let complaint = String::from_utf8_lossy(&output.stderr);
        let complaint = complaint.lines().find(|line| !line.trim().is_empty()).unwrap_or("it says nothing");
        let complaint = complaint.strip_prefix("error: ").unwrap_or(complaint).to_owned();
        match output.status.code() {
            Some(0) => serde_json::from_slice(&output.stdout)
                .map_err(|error| QueryError::Broken(format!("its answer is no interface ({error})"))),
            Some(2) if parameters.is_some() => Err(QueryError::Refused(complaint)),
            _ => Err(QueryError::Broken(format!("{} ({complaint})", output.status))),
        }
    }
}

impl Installed {
    fn candidates(&self, run: &str) -> Vec<PathBuf> {
        if run.contains('/') {
            // A path in the file counts from the file; one on the command line may count from here.
            return vec![self.folder.join(run), PathBuf::from(run)];
        }
        let mut candidates = self.own_candidates(run);
        let path = std::env::var_os("PATH").unwrap_or_default();
        candidates.extend(std::env::split_paths(&path).map(|folder| folder.join(run)));
        candidates
    }

    fn own_candidates(&self, run: &str) -> Vec<PathBuf> {
        let built = self.built.get(run).cloned();
        built.into_iter().chain(own_folder().map(|folder| folder.join(run))).collect()
    }
}

/// The services of the source checkout, which a build would make.
pub(crate) fn services_in_checkout() -> Vec<String> {
    let Some(folder) = checkout() else { return Vec::new() };
    let Ok(entries) = std::fs::read_dir(folder.join("../services")) else { return Vec::new() };
    let crates = entries.flatten().filter(|entry| entry.path().join("Cargo.toml").is_file());
    let mut names: Vec<_> = crates.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort();
    names
}

/// How many processors this machine has, whether or not this process may use them all.
pub(crate) fn processors() -> usize {
    // Such as `0-3` or `0-1,3`.
    let online = std::fs::read_to_string("/sys/devices/system/cpu/online").unwrap_or_default();
    let last = online.trim().rsplit([',', '-']).next().and_then(|number| number.parse::<usize>().ok());
    let usable = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    last.map_or(usable, |last| last + 1)
}

fn own_folder() -> Option<PathBuf> {
    std::env::current_exe().ok()?.parent().map(Path::to_owned)
}

fn known_binaries() -> Vec<String> {
    let mut names = services_in_checkout();
    let beside = own_folder().and_then(|folder| std::fs::read_dir(folder).ok());
    let beside = beside.into_iter().flatten().flatten().filter(|entry| is_executable(&entry.path()));
    names.extend(beside.filter_map(|entry| entry.file_name().into_string().ok()));
    names.sort();
    names.dedup();
    names
}

fn is_executable(path: &Path) -> bool {
    path.metadata().is_ok_and(|found| found.is_file() && found.permissions().mode() & 0o111 != 0)
}

/// The largest of the files that parameters name: what a service that takes long is most likely busy with.
fn largest_file<'a>(folder: &Path, parameters: Option<&'a Value>) -> Option<&'a str> {
    let texts = parameters.and_then(Value::as_object)?.values().filter_map(Value::as_str);
    let size = |text: &str| {
        folder.join(text).metadata().ok().filter(|found| found.is_file()).map(|found| found.len())
    };
    let files = texts.filter(|text| !text.is_empty()).filter_map(|text| Some((size(text)?, text)));
    files.max().map(|(_, text)| text)
}

/// Says that a binary is slow, and why it may be.
fn tell_slow(binary: &Path, file: Option<&str>, spent: Spent) {
    let name = binary.file_name().unwrap_or_default().to_string_lossy();
    let (wall, used) = (spent.wall.as_secs_f64(), spent.processor.as_secs_f64());
    // Who works uses the processor at least half of the time.
    let words = match file {
        _ if used < 0.5 * wall => {
            format!(
                "`{name}` has not answered for {wall:.0} s ({used:.1} s of processor time): the machine is busy, or it waits"
            )
        }
        Some(file) => format!("`{name}` is still reading {file} ({used:.1} s of processor time)"),
        None => format!("`{name}` is still working at its answer ({used:.1} s of processor time)"),
    };
    crate::console::warn(&words);
}
