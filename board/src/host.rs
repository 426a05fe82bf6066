//! The board's host, which the launcher is: it makes the board, holds every topic, cleans up after the dead, and takes the board down.
//!
//! Topics are made here, before any service lives, because a process that is killed while it makes one can leave it unusable
//! for ever. Services only open them.

use crate::janitor;
use crate::manifest::{Manifest, Topic};
use crate::place::{self, InvalidBoardName, Place, Turn};
use crate::switchboard::{self, SlotState, Switchboard};
use crate::transport::{Member, RawTopic, TopicShape, TransportError};
use rustix::fs::{FlockOperation, flock};
use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

pub(crate) const SWITCHBOARD: &str = "switchboard";
const LOCK: &str = "launcher.lock";
/// Readers of a topic beyond those of the graph: tools, recorders, newcomers of a swap, ports of the dead that were not cleaned up yet.
const SPARE_READERS: usize = 12;

/// Why a board cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// The name.
    #[error(transparent)]
    Name(#[from] InvalidBoardName),
    /// It is up.
    #[error(
        "the board `{board}` is up already (launcher {pid}); stop it with `launch stop --board {board}`, or use another name with --board"
    )]
    Taken {
        /// The board.
        board: String,
        /// Its launcher's process.
        pid: u32,
    },
    /// Too many topics.
    #[error("the graph has {topics} topics; a board holds {}", switchboard::TOPICS)]
    TooManyTopics {
        /// How many.
        topics: usize,
    },
    /// Files.
    #[error("the board's files: {0}")]
    Io(#[from] io::Error),
    /// The transport.
    #[error(transparent)]
    Transport(#[from] TransportError),
}

/// What a service's health is published on.
pub fn health_topic(role: &str) -> String {
    format!("health/{role}")
}

/// The name under which a shadow of `role` publishes: a process that is compared with the one that plays the role.
pub fn shadow_role(role: &str) -> String {
    format!("{role}-shadow")
}

/// Where a shadow publishes what it would say on `topic`.
pub fn shadow_topic(topic: &str) -> String {
    format!("shadow/{topic}")
}

/// A board that this process has made and keeps alive.
pub struct Host {
    place: Place,
    switchboard: Switchboard,
    manifest: Manifest,
    topics: Vec<RawTopic>,
    member: Option<Member>,
    lockstep: bool,
    taken_down: bool,
    /// Held as long as the board is up; the kernel lets go of it however this process ends.
    _lock: File,
}

impl std::fmt::Debug for Host {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Host").field("place", &self.place).finish_non_exhaustive()
    }
}

impl Host {
    /// Makes a board with these topics.
    ///
    /// # Errors
    /// When a board of this name is up, or shared memory fails.
    pub fn create(name: &str, manifest: Manifest, lockstep: bool) -> Result<Self, HostError> {
        let place = Place::new(name)?;
        if manifest.topics.len() > switchboard::TOPICS {
            return Err(HostError::TooManyTopics { topics: manifest.topics.len() });
        }
        let _turn = Turn::take()?;
        if let Some(pid) = living_launcher(&place) {
            return Err(HostError::Taken { board: name.to_owned(), pid });
        }
        clear_away(&place)?;
        place.create()?;
        Self::furnish(place.clone(), manifest, lockstep).inspect_err(|_| {
            let _ = place.remove();
        })
    }

    fn furnish(place: Place, manifest: Manifest, lockstep: bool) -> Result<Self, HostError> {
        let lock =
            OpenOptions::new().write(true).create(true).truncate(true).mode(0o600).open(place.file(LOCK))?;
        // It is ours but for the instant in which somebody looks whether it is held.
        flock(&lock, FlockOperation::LockExclusive).map_err(io::Error::from)?;
        use std::io::Write as _;
        writeln!(&lock, "{}", std::process::id())?;
        let switchboard = Switchboard::create(&place.file(SWITCHBOARD))?;
        switchboard.header().lockstep.store(u32::from(lockstep), Ordering::Release);
        let member = Member::join(&place)?;
        let mut topics = Vec::with_capacity(manifest.topics.len());
        for topic in &manifest.topics {
            topics.push(member.create(&topic.name, shape_of(topic))?);
        }
        let manifest = Manifest { launcher_pid: std::process::id(), ..manifest };
        manifest.write(&place)?;
        Ok(Self {
            place,
            switchboard,
            manifest,
            topics,
            member: Some(member),
            lockstep,
            taken_down: false,
            _lock: lock,
        })
    }

    /// Where it lies.
    pub fn place(&self) -> &Place {
        &self.place
    }

    /// The shared page.
    pub fn switchboard(&self) -> &Switchboard {
        &self.switchboard
    }

    /// Whether this board lives in logical time.
    pub fn is_lockstep(&self) -> bool {
        self.lockstep
    }

    /// The table of contents.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Adds topics to the board, for newcomers; who has joined already does not know them. Those that are there stay as they are.
    ///
    /// # Errors
    /// When the board holds no more, or shared memory fails.
    pub fn add_topics(&mut self, topics: Vec<Topic>) -> Result<(), HostError> {
        let Some(member) = &self.member else { return Ok(()) };
        let mut manifest = self.manifest.clone();
        for topic in topics {
            if manifest.topic(&topic.name).is_some() {
                continue;
            }
            if manifest.topics.len() == switchboard::TOPICS {
                return Err(HostError::TooManyTopics { topics: switchboard::TOPICS + 1 });
            }
            self.topics.push(member.create(&topic.name, shape_of(&topic))?);
            manifest.topics.push(topic);
        }
        if manifest.topics.len() > self.manifest.topics.len() {
            manifest.write(&self.place)?;
            self.manifest = manifest;
        }
        Ok(())
    }

    /// Prepares a slot for a service that is about to be started, with a generation of its own, and gives it the right to publish
    /// the topics of `role` when it is the one that `speaks`. Returns the slot, `None` when all are taken.
    pub fn prepare(&self, role: &str, speaks: bool) -> Option<u32> {
        let slot = self.switchboard.claim(role, 0, true)?;
        let generation = self.switchboard.header().generations.fetch_add(1, Ordering::AcqRel) + 1;
        self.switchboard.slot(slot)?.generation.store(generation, Ordering::Release);
        if speaks {
            self.hand_over(role, slot);
        }
        Some(slot)
    }

    /// From now on the messages of the process in `slot` count on the topics of `role`, and nobody else's.
    pub fn hand_over(&self, role: &str, slot: u32) {
        let Some(generation) =
            self.switchboard.slot(slot).map(|slot| slot.generation.load(Ordering::Acquire))
        else {
            return;
        };
        let health = health_topic(role);
        for (index, topic) in self.manifest.topics.iter().enumerate() {
            if (topic.publisher.as_deref() == Some(role) || topic.name == health)
                && let Some(entry) = self.switchboard.topic(index as u32)
            {
                entry.publisher.store(slot, Ordering::Release);
                entry.generation.store(generation, Ordering::Release);
            }
        }
    }

    /// Whether the board's folder is still the one that was made.
    pub fn is_in_place(&self) -> bool {
        self.place.exists()
    }

    /// Takes the board down and leaves nothing behind. The services must be gone.
    ///
    /// # Errors
    /// When a file cannot be removed.
    pub fn take_down(mut self) -> io::Result<()> {
        self.remove()
    }

    fn remove(&mut self) -> io::Result<()> {
        self.taken_down = true;
        self.topics.clear();
        self.member = None;
        let _turn = Turn::take()?;
        self.place.remove()
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        if !self.taken_down
            && let Err(error) = self.remove()
        {
            tracing::warn!(board = self.place.name(), %error, "something of the board is left behind");
        }
    }
}

fn shape_of(topic: &Topic) -> TopicShape {
    TopicShape {
        fingerprint: topic.message.fingerprint(),
        depth: topic.depth,
        readers: topic.readers.len() + SPARE_READERS,
    }
}

/// The process of the launcher that holds this board, if it lives.
pub fn living_launcher(place: &Place) -> Option<u32> {
    if !place.exists() {
        return None;
    }
    let lock = OpenOptions::new().read(true).write(true).open(place.file(LOCK)).ok()?;
    // Shared, so that two who look at the same time do not take each other for the launcher.
    match flock(&lock, FlockOperation::NonBlockingLockShared) {
        Ok(()) => None,
        Err(_) => Some(std::fs::read_to_string(place.file(LOCK)).ok()?.trim().parse().unwrap_or(0)),
    }
}

/// What was found of a board whose launcher is gone.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Swept {
    /// The board; empty for shared memory whose board is not known any more.
    pub board: String,
    /// Services that were still there and were ended: name and process.
    pub ended: Vec<(String, u32)>,
    /// Files and shared memory removed.
    pub files: usize,
}

/// Clears away every board of this user whose launcher is gone, and says what it was.
///
/// # Errors
/// When something cannot be removed.
pub fn sweep() -> io::Result<Vec<Swept>> {
    let _turn = Turn::take()?;
    let mut swept = Vec::new();
    for place in place::places() {
        if living_launcher(&place).is_none() {
            swept.extend(clear_away(&place)?);
        }
    }
    let orphans = place::orphans();
    if !orphans.is_empty() {
        for file in &orphans {
            std::fs::remove_file(file)?;
        }
        swept.push(Swept { board: String::new(), ended: Vec::new(), files: orphans.len() });
    }
    Ok(swept)
}

/// Clears away as [`sweep`] does, but the board of this name alone where one is named: who says which board is meant does not touch others.
///
/// # Errors
/// When something cannot be removed, or the name is none.
pub fn sweep_named(board: Option<&str>) -> io::Result<Vec<Swept>> {
    match board {
        None => sweep(),
        Some(name) => {
            let place =
                Place::new(name).map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error))?;
            Ok(clear(&place)?.into_iter().collect())
        }
    }
}

/// Clears away what is left of a board whose launcher is gone; a board that is up stays as it is.
///
/// # Errors
/// When something cannot be removed.
pub fn clear(place: &Place) -> io::Result<Option<Swept>> {
    let _turn = Turn::take()?;
    if living_launcher(place).is_some() {
        return Ok(None);
    }
    clear_away(place)
}

fn clear_away(place: &Place) -> io::Result<Option<Swept>> {
    let shared_memory = place.shared_memory().len();
    if !place.exists() && shared_memory == 0 {
        return Ok(None);
    }
    let ended = if place.exists() { end_services(place) } else { Vec::new() };
    let files = shared_memory + count_files(place.root());
    place.remove()?;
    Ok(Some(Swept { board: place.name().to_owned(), ended, files }))
}

/// Ends the services of a board whose launcher is gone: politely first, since the base driver stops the wheels on its way out.
fn end_services(place: &Place) -> Vec<(String, u32)> {
    let Ok(switchboard) = Switchboard::open(&place.file(SWITCHBOARD)) else { return Vec::new() };
    let living = || -> Vec<(String, u32)> {
        switchboard
            .taken()
            .filter(|(_, slot)| slot.is_service.load(Ordering::Relaxed) != 0)
            .map(|(_, slot)| (slot.role(), slot.pid.load(Ordering::Relaxed)))
            .filter(|&(_, pid)| is_of_board(pid, place))
            .collect()
    };
    let ended = living();
    let send = |signal| {
        for (_, pid) in living() {
            if let Some(pid) = i32::try_from(pid).ok().and_then(rustix::process::Pid::from_raw) {
                let _ = rustix::process::kill_process(pid, signal);
            }
        }
    };
    send(rustix::process::Signal::TERM);
    let deadline = crate::clock::monotonic().after(Duration::from_millis(500));
    while !living().is_empty() && crate::clock::monotonic() < deadline {
        crate::clock::sleep(Duration::from_millis(5));
    }
    send(rustix::process::Signal::KILL);
    let deadline = crate::clock::monotonic().after(Duration::from_millis(500));
    while !living().is_empty() && crate::clock::monotonic() < deadline {
        crate::clock::sleep(Duration::from_millis(2));
    }
    ended
}

/// Whether this process lives and has the board's page mapped: process numbers are used again, and a page that was written by a broken process
/// must not make us end a stranger.
fn is_of_board(pid: u32, place: &Place) -> bool {
    let page = place.file(SWITCHBOARD);
    pid != 0
        && pid != std::process::id()
        && switchboard::process_lives(pid)
        && std::fs::read_to_string(format!("/proc/{pid}/maps"))
            .is_ok_and(|maps| maps.lines().any(|line| line.ends_with(&*page.to_string_lossy())))
}

fn count_files(folder: &Path) -> usize {
    let Ok(entries) = std::fs::read_dir(folder) else { return 0 };
    entries
        .flatten()
        .map(|entry| if entry.path().is_dir() { 1 + count_files(&entry.path()) } else { 1 })
        .sum()
}

/// Cleans up after processes of this board that died: their ports, their memory, and what they had half made. It can hang when a
/// process died at a bad moment, so the launcher runs it in a helper process with a time limit.
///
/// # Errors
/// When the board cannot be joined.
pub fn clean_dead(name: &str) -> Result<usize, HostError> {
    let place = Place::new(name)?;
    // Those who died while they made a file leave it half made, and the transport, here and in the services, waits for its end.
    let failed = janitor::beside(&place, || Member::join(&place).map(|member| member.clean()))?;
    if let Ok(switchboard) = Switchboard::open(&place.file(SWITCHBOARD)) {
        let dead: Vec<u32> = switchboard.dead_tools().map(|(index, _)| index).collect();
        dead.into_iter().for_each(|index| switchboard.release_dead(index));
    }
    Ok(failed)
}

/// Shared memory of a board that was begun by a process which is dead; [`clean_dead`] removes it.
pub fn half_made(place: &Place) -> Vec<PathBuf> {
    janitor::half_made(place)
}

/// Every service of the page, for those who look.
pub fn services(switchboard: &Switchboard) -> Vec<(u32, String, SlotState)> {
    switchboard
        .taken()
        .filter(|(_, slot)| slot.is_service.load(Ordering::Relaxed) != 0)
        .map(|(index, slot)| (index, slot.role(), slot.state()))
        .collect()
}
