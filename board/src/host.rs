//! The board's host, which the launcher is: it makes the board, holds every topic, cleans up after the dead, and takes the board down.
//!
//! Topics are made here, before any service lives, because a process that is killed while it makes one can leave it unusable
//! for ever. Services only open them.

use crate::known::Known;
use crate::lock::{self, Lock};
use crate::manifest::{Manifest, Topic};
use crate::names::SHARED_MEMORY;
use crate::place::{Place, Turn};
use crate::private::{self, Identity, identity};
use crate::shape::shape_of;
use crate::sweep::clear_away;
use crate::switchboard::{self, SlotState, Switchboard};
use crate::transport::{Member, RawTopic};
use rustix::io::{FdFlags, fcntl_setfd};
use std::io;
use std::os::fd::BorrowedFd;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::{Mutex, MutexGuard, PoisonError};

pub use crate::host_error::HostError;
pub use crate::need::needed_bytes;
pub use crate::sweep::{
    Swept, boards_up, clean_dead, clear, half_made, living_launcher, orphans, sweep, sweep_named,
};

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
    pub(crate) place: Place,
    pub(crate) switchboard: Switchboard,
    pub(crate) manifest: Manifest,
    /// The page's file, as it was made.
    pub(crate) page_file: Option<Identity>,
    /// What the transport has made for the topics.
    pub(crate) files: Vec<PathBuf>,
    pub(crate) lockstep: bool,
    pub(crate) known: Mutex<Known>,
    topics: Vec<RawTopic>,
    member: Option<Member>,
    /// Held as long as the board is up; the kernel lets go of it however this process ends.
    lock: Option<Lock>,
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
    /// When a board of this name is up, or there is not enough shared memory for what its services will need.
    pub fn create(name: &str, manifest: Manifest, lockstep: bool) -> Result<Self, HostError> {
        let place = Place::new(name)?;
        if manifest.topics.len() > switchboard::TOPICS {
            return Err(HostError::TooManyTopics { topics: manifest.topics.len() });
        }
        let _turn = Turn::take()?;
        if let Some(pid) = living_launcher(&place)? {
            let board = name.to_owned();
            return Err(if place.exists() {
                HostError::Taken { board, pid }
            } else {
                HostError::Displaced { board, pid }
            });
        }
        clear_away(&place)?;
        if let Some(lack) = crate::need::lack_for(&manifest) {
            return Err(HostError::Lack { board: name.to_owned(), topics: manifest.topics.len(), lack });
        }
        place.create()?;
        Self::furnish(place.clone(), manifest, lockstep).inspect_err(|_| {
            let _ = place.remove();
        })
    }

    fn furnish(place: Place, manifest: Manifest, lockstep: bool) -> Result<Self, HostError> {
        let lock = Lock::take(&place)?;
        let switchboard = Switchboard::create(&place.file(switchboard::FILE))?;
        switchboard.header().lockstep.store(u32::from(lockstep), Ordering::Release);
        let member = Member::join(&place)?;
        let mut topics = Vec::with_capacity(manifest.topics.len());
        for topic in &manifest.topics {
            topics.push(member.create(&topic.name, shape_of(topic))?);
        }
        // The transport's folders, which it makes readable for the user's group.
        for entry in std::fs::read_dir(place.root()).into_iter().flatten().flatten() {
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                private::close_folder(&entry.path())?;
            }
        }
        let manifest = Manifest { launcher_pid: std::process::id(), ..manifest };
        manifest.write(&place)?;
        let known = Known::with_manifest(Manifest::version(&place));
        Ok(Self {
            page_file: identity(&place.file(switchboard::FILE)),
            files: place.shared_memory(),
            place,
            switchboard,
            manifest,
            lockstep,
            known: Mutex::new(known),
            topics,
            member: Some(member),
            lock: Some(lock),
        })
    }

    pub(crate) fn write_manifest(&self) -> io::Result<()> {
        self.manifest.write(&self.place)?;
        self.known().manifest_file = Manifest::version(&self.place);
        Ok(())
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

    /// Whether the board still lies where it was made: somebody, or a service manager at a logout, may have
    /// deleted its folder. Then nobody reaches it any more, and the robot should stop. Costs one look at a
    /// file.
    pub fn is_in_place(&self) -> bool {
        self.lock.as_ref().is_some_and(Lock::is_in_place)
    }

    /// Adds topics to the board, for newcomers; who has joined already does not know them. Those that are there stay as they are.
    ///
    /// # Errors
    /// When the board holds no more, or shared memory fails.
    pub fn add_topics(&mut self, topics: Vec<Topic>) -> Result<(), HostError> {
        let before = self.manifest.topics.len();
        let added = topics.into_iter().try_for_each(|topic| self.add_topic(topic));
        // Also those before one that could not be made.
        if self.manifest.topics.len() > before {
            self.write_manifest()?;
        }
        added
    }

    fn add_topic(&mut self, topic: Topic) -> Result<(), HostError> {
        let Some(member) = self.member.as_ref().filter(|_| self.manifest.topic(&topic.name).is_none()) else {
            return Ok(());
        };
        if self.manifest.topics.len() == switchboard::TOPICS {
            return Err(HostError::TooManyTopics { topics: switchboard::TOPICS + 1 });
        }
        self.topics.push(member.create(&topic.name, shape_of(&topic))?);
        self.manifest.topics.push(topic);
        Ok(())
    }

    /// Prepares a slot for a service that is about to be started, with a generation of its own, and gives it the right to publish
    /// the topics of `role` when it is the one that `speaks`. Returns the slot, `None` when all are taken.
    pub fn prepare(&self, role: &str, speaks: bool) -> Option<u32> {
        close_on_exec();
        let slot = self.switchboard.claim(role, 0, true)?;
        let generation = self.known().prepare(slot, role);
        // What stands on the page may be nonsense, which must not decide whose messages count.
        self.switchboard.header().generations.store(generation, Ordering::Release);
        self.switchboard.slot(slot)?.generation.store(generation, Ordering::Release);
        if speaks {
            self.hand_over(role, slot);
        }
        Some(slot)
    }

    /// From now on the messages of the process in `slot` count on the topics of `role`, and nobody else's.
    pub fn hand_over(&self, role: &str, slot: u32) {
        let Some(generation) = self.known().hand_over(role, slot) else { return };
        for (index, topic) in self.manifest.topics.iter().enumerate() {
            if topic.role() == Some(role)
                && let Some(entry) = self.switchboard.topic(index as u32)
            {
                entry.publisher.store(slot, Ordering::Release);
                entry.generation.store(generation, Ordering::Release);
            }
        }
    }

    pub(crate) fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the board down and leaves nothing behind. The services must be gone.
    ///
    /// # Errors
    /// When a file cannot be removed.
    pub fn take_down(mut self) -> io::Result<()> {
        self.remove()
    }

    fn remove(&mut self) -> io::Result<()> {
        let Some(lock) = self.lock.take() else { return Ok(()) };
        self.topics.clear();
        self.member = None;
        let _turn = Turn::take()?;
        if lock.is_in_place() {
            return self.place.remove();
        }
        // The folder was deleted. If another stands there now, it is not ours to remove, nor is anything of a
        // board that somebody holds.
        let others = lock::holders()?;
        let is_anothers =
            others.iter().any(|(place, pid)| *place == self.place && *pid != std::process::id());
        if is_anothers { Ok(()) } else { self.place.remove_shared_memory() }
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        if let Err(error) = self.remove() {
            tracing::warn!(board = self.place.name(), %error, "something of the board is left behind");
        }
    }
}

/// The transport opens files that the children of this process would inherit.
fn close_on_exec() {
    for entry in std::fs::read_dir("/proc/self/fd").into_iter().flatten().flatten() {
        let is_boards =
            std::fs::read_link(entry.path()).is_ok_and(|target| target.starts_with(SHARED_MEMORY));
        if is_boards && let Some(number) = entry.file_name().to_str().and_then(|name| name.parse().ok()) {
            // SAFETY: another thread may have closed it since it was listed, and then the call fails, or does
            // the same for whatever was opened instead, which no child is meant to inherit either.
            let _ = fcntl_setfd(unsafe { BorrowedFd::borrow_raw(number) }, FdFlags::CLOEXEC);
        }
    }
}

/// Every service of the page, for those who look.
pub fn services(switchboard: &Switchboard) -> Vec<(u32, String, SlotState)> {
    switchboard
        .taken()
        .filter(|(_, slot)| slot.is_service.load(Ordering::Relaxed) != 0)
        .map(|(index, slot)| (index, slot.role(), slot.state()))
        .collect()
}
