//! Who is taken for a launcher that lives, and what is done to a board that looks forsaken.

use crate::robot::{Robot, assert_nothing_left, board_name, itself, manifest};
use board::host::{self, Host, HostError};
use board::place::Place;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use std::io::{BufRead as _, BufReader};
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
use std::path::Path;
use std::process::{Child, ExitCode, Stdio};
use std::sync::atomic::Ordering;

/// A launcher with two services in a process of its own.
struct Launcher {
    place: Place,
    process: Child,
}

impl Launcher {
    fn start() -> Self {
        let name = board_name();
        let mut process = itself("host").arg(&name).stdout(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
        assert_eq!(line, "up\n");
        Self { place: Place::new(&name).unwrap(), process }
    }

    /// Every command looks first whether the launcher lives, and clears the board away when it does not.
    #[track_caller]
    fn assert_left_alone(&self) {
        let before = self.place.shared_memory();
        assert!(!before.is_empty());
        assert_eq!(host::living_launcher(&self.place).unwrap(), Some(self.process.id()));
        let swept = host::sweep().unwrap();
        assert!(swept.iter().all(|swept| swept.board != self.place.name()), "{swept:?}");
        assert!(host::clear(&self.place).unwrap().is_none());
        assert_eq!(self.place.shared_memory().len(), before.len());
    }

    /// What is left goes once it is really dead.
    fn end(mut self) {
        let place = self.place.clone();
        self.kill();
        host::sweep().unwrap();
        host::clear(&place).unwrap();
        assert_nothing_left(&place);
    }

    fn kill(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Drop for Launcher {
    fn drop(&mut self) {
        self.kill();
    }
}

pub(crate) fn a_launcher_without_its_lock_lives() {
    let launcher = Launcher::start();
    launcher.assert_left_alone();
    let lock = launcher.place.file("launcher.lock");
    std::fs::remove_file(&lock).unwrap();
    launcher.assert_left_alone();
    // Another file in its place is nobody's lock.
    std::fs::write(&lock, "1\n").unwrap();
    launcher.assert_left_alone();
    assert!(matches!(
        Host::create(launcher.place.name(), manifest(&[]), false),
        Err(HostError::Taken { pid, .. }) if pid == launcher.process.id()
    ));
    launcher.end();
}

pub(crate) fn a_launcher_without_its_folder_lives() {
    let launcher = Launcher::start();
    std::fs::remove_dir_all(launcher.place.root()).unwrap();
    launcher.assert_left_alone();
    let error = Host::create(launcher.place.name(), manifest(&[]), false).unwrap_err();
    assert!(
        matches!(error, HostError::Displaced { pid, .. } if pid == launcher.process.id()),
        "a second robot beside the first: {error}"
    );
    launcher.end();
}

pub(crate) fn a_board_whose_folder_was_deleted_knows() {
    let host = Host::create(&board_name(), manifest(&[]), false).unwrap();
    let place = host.place().clone();
    assert!(host.is_in_place());
    std::fs::remove_dir_all(place.root()).unwrap();
    assert!(!host.is_in_place());
    // A folder that somebody else has made there since is not ours to remove.
    std::fs::create_dir_all(place.root()).unwrap();
    std::fs::write(place.file("launcher.lock"), "1\n").unwrap();
    assert!(!host.is_in_place());
    host.take_down().unwrap();
    assert_eq!(place.shared_memory(), Vec::<std::path::PathBuf>::new());
    assert!(place.file("launcher.lock").exists());
    std::fs::remove_dir_all(place.root()).unwrap();
}

/// Looks whether a launcher lives, and sweeps, with few files to be opened.
pub(crate) fn blind_process() -> ExitCode {
    let name = std::env::args().nth(1).expect("a board's name");
    let place = Place::new(&name).expect("a name");
    let Rlimit { maximum, .. } = getrlimit(Resource::Nofile);
    for limit in 0..24 {
        setrlimit(Resource::Nofile, Rlimit { current: Some(limit), maximum }).expect("a lower limit");
        let living = host::living_launcher(&place);
        let swept = host::sweep();
        let cleared = host::clear(&place);
        if matches!(living, Ok(None))
            || swept.is_ok_and(|swept| swept.iter().any(|swept| swept.board == name))
            || matches!(cleared, Ok(Some(_)))
        {
            println!("with {limit} files the launcher was taken for dead");
            return ExitCode::FAILURE;
        }
        if let Err(error) = living
            && !error.to_string().contains("ulimit -n")
        {
            println!("no remedy: {error}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

pub(crate) fn who_can_open_nothing_calls_nobody_dead() {
    let launcher = Launcher::start();
    let blind = itself("blind").arg(launcher.place.name()).output().unwrap();
    assert!(blind.status.success(), "{}", String::from_utf8_lossy(&blind.stdout));
    launcher.assert_left_alone();
    launcher.end();
}

/// All that lies below must be closed to everybody but its owner.
fn assert_private(path: &Path) {
    let found = std::fs::symlink_metadata(path).unwrap();
    let mode = found.permissions().mode() & 0o777;
    assert_eq!(mode & !0o700, 0, "{} has mode {mode:o}", path.display());
    // Below a closed folder the transport's own need not be.
    let entries = if found.is_dir() { std::fs::read_dir(path).unwrap().flatten().collect() } else { vec![] };
    let inner = |entry: &std::fs::DirEntry| entry.file_type().unwrap().is_dir() && path.ends_with("nodes");
    entries.iter().filter(|entry| !inner(entry)).for_each(|entry| assert_private(&entry.path()));
}

pub(crate) fn everything_is_its_owners() {
    // SAFETY: a plain call; the tests of this binary run one after the other.
    let before = unsafe { libc::umask(0) };
    let mut robot = Robot::new(&[("count", "counter")]);
    robot.start("counter");
    let place = robot.host.place().clone();
    assert_private(place.root());
    place.shared_memory().iter().for_each(|file| assert_private(file));
    robot.take_down();
    // SAFETY: as above.
    unsafe { libc::umask(before) };
}

pub(crate) fn what_cannot_be_said_is_no_panic() {
    let run = |arguments: &[&str], stdout: Stdio, stderr: Stdio| {
        let mut command = itself("counter");
        command.args(arguments).stdin(Stdio::null()).stdout(stdout).stderr(stderr);
        command.spawn().unwrap()
    };
    let full = || Stdio::from(std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap());
    for arguments in [&["--interface"][..], &["--example"], &["--help"], &["--version"]] {
        let mut closed = run(arguments, Stdio::piped(), Stdio::piped());
        drop(closed.stdout.take());
        let output = closed.wait_with_output().unwrap();
        let words = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() != Some(101) && words.is_empty(), "{arguments:?}: {words}");
    }
    // A board that there is not, with nobody to tell.
    let code = |stderr: Stdio| run(&["--board", "t-nowhere"], full(), stderr).wait().unwrap().code();
    assert_eq!([code(full()), code(Stdio::null())], [Some(i32::from(board::EXIT_SETUP)); 2]);
    // A log that is full ends nobody who lives.
    let robot = Robot::new(&[("count", "counter")]);
    let mut service = robot.command("chatty");
    let mut service = service.stdout(full()).stderr(full()).spawn().unwrap();
    let steps = || {
        let taken = robot.host.switchboard().taken().map(|(_, slot)| slot.steps.load(Ordering::Acquire));
        taken.max().unwrap_or(0)
    };
    crate::robot::wait_for("its steps", || steps() > 20);
    assert!(service.try_wait().unwrap().is_none());
    service.kill().unwrap();
    service.wait().unwrap();
    robot.take_down();
}

/// Files of a process that lie in shared memory.
fn open_files(pid: u32) -> usize {
    let entries = std::fs::read_dir(format!("/proc/{pid}/fd")).unwrap().flatten();
    let targets = entries.filter_map(|entry| std::fs::read_link(entry.path()).ok());
    targets.filter(|target| target.starts_with("/dev/shm")).count()
}

pub(crate) fn nothing_is_inherited() {
    let mut robot = Robot::new(&[("count", "counter")]);
    let files = |robot: &mut Robot| {
        let slot = robot.start("counter");
        let pid = robot.host.switchboard().slot(slot).unwrap().pid.load(Ordering::Acquire);
        let files = open_files(pid);
        robot.end_services();
        files
    };
    let before = files(&mut robot);
    // What the launcher opens in between is its own. Topics that the service does not know, so that it opens
    // none of it itself.
    let tap = robot.tap();
    let readers = ["scan", "ranges", "seen"].map(|topic| tap.reader(topic).unwrap());
    assert_eq!(files(&mut robot), before);
    drop((readers, tap));
    robot.take_down();
}

/// Tries to make a board, as a user in whose name somebody else has made its files.
pub(crate) fn squatted_process() -> ExitCode {
    let made = Host::create("squatted", manifest(&[]), false).map(|_| ());
    println!("{}", made.err().map_or("a board was made".to_owned(), |error| error.to_string()));
    ExitCode::SUCCESS
}

pub(crate) fn a_strangers_file_is_refused_by_its_name() {
    // A user whom no machine has.
    const USER: u32 = 3_054_322;
    if !rustix::process::getuid().is_root() {
        println!("skipped: only root can be two users");
        return;
    }
    // The name begins with a hash of the user and the board.
    let hash = format!("{USER}/squatted")
        .bytes()
        .fold(0x811c_9dc5_u32, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193));
    let file = format!("/dev/shm/c{hash:08x}_stranger");
    std::fs::write(&file, "noise").unwrap();
    assert_eq!(std::fs::metadata(&file).unwrap().uid(), 0);
    let mut command = itself("squatted");
    std::os::unix::process::CommandExt::uid(&mut command, USER);
    match command.output() {
        Err(_) => println!("skipped: the test binary is not another user's to run"),
        Ok(output) => {
            let said = String::from_utf8_lossy(&output.stdout);
            assert!(said.contains(&file) && said.contains("belongs to user 0"), "{said}");
        }
    }
    std::fs::remove_file(&file).unwrap();
    let _ = std::fs::remove_dir(format!("/dev/shm/corkboard-{USER}"));
}
