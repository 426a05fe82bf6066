//! Where the binaries of services are, and what they say of themselves.

use super::check::{Binaries, NotFound, QueryError};
use super::find::checkout;
use board::Interface;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags, Signal, kill_process_group, pidfd_open};
use serde_json::Value;
use std::collections::HashMap;
use std::io::Read;
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

/// How long a binary may take to say what it is.
const ANSWER_WITHIN_S: i64 = 2;
/// Longest answer, in bytes.
const ANSWER_MAX: u64 = 16 << 20;

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
        let output = run_for_a_while(&mut command)?;
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

/// Runs a command to its end, or until its time is up.
fn run_for_a_while(command: &mut Command) -> Result<Output, QueryError> {
    let broken = |what: &str, error: std::io::Error| {
        let lack = board::Lack::behind(&error).map(|lack| format!(" ({lack})")).unwrap_or_default();
        QueryError::Broken(format!("{what}: {error}{lack}"))
    };
    // A group of its own, so that whatever it started ends with it.
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).process_group(0);
    let mut child = command.spawn().map_err(|error| broken("it cannot be started", error))?;
    let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
    let in_time = std::thread::scope(|scope| {
        let stdout = scope.spawn(|| read_all(stdout));
        let stderr = scope.spawn(|| read_all(stderr));
        let in_time = wait_for_exit(&child);
        if !in_time {
            end_group(&child);
        }
        (in_time, stdout.join().unwrap_or_default(), stderr.join().unwrap_or_default())
    });
    let (in_time, stdout, stderr) = in_time;
    let status = child.wait().map_err(|error| broken("it cannot be waited for", error))?;
    if !in_time {
        return Err(QueryError::Broken(format!("no answer within {ANSWER_WITHIN_S} s")));
    }
    Ok(Output { status, stdout, stderr })
}

fn read_all(pipe: Option<impl Read>) -> Vec<u8> {
    let mut bytes = Vec::new();
    if let Some(pipe) = pipe {
        // What arrived before an error is still worth showing.
        let _ = pipe.take(ANSWER_MAX).read_to_end(&mut bytes);
    }
    bytes
}

fn pid_of(child: &Child) -> Option<Pid> {
    Pid::from_raw(i32::try_from(child.id()).ok()?)
}

fn wait_for_exit(child: &Child) -> bool {
    let Some(Ok(pidfd)) = pid_of(child).map(|pid| pidfd_open(pid, PidfdFlags::empty())) else { return false };
    let limit = Timespec { tv_sec: ANSWER_WITHIN_S, tv_nsec: 0 };
    let mut fds = [PollFd::new(&pidfd, PollFlags::IN)];
    poll(&mut fds, Some(&limit)).is_ok_and(|ready| ready > 0)
}

fn end_group(child: &Child) {
    if let Some(pid) = pid_of(child) {
        // It may have left in this very moment.
        let _ = kill_process_group(pid, Signal::KILL);
    }
}
