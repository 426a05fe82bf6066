//! The board's one page of shared state: who is there, who waits for what, and the bells that wake them.
//!
//! Messages travel through the transport; this page only says *that* there is one. A waiting process sleeps on its own bell, a
//! futex word: whoever publishes rings the bells of the processes that asked for the topic, and no wake-up can be lost, because the kernel compares
//! the word before it puts a process to sleep. It is a file in the board's folder, mapped by every process of the board. Everything in it is
//! atomic, and every index read from it is checked: a process that writes nonsense into it can disturb the board, but not the
//! memory safety of the others.

use crate::private;
use messages::Time;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use rustix::thread::futex;
use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

/// The page, in the board's folder.
pub(crate) const FILE: &str = "switchboard";
/// Processes on one board at the most: services and tools.
pub const SLOTS: usize = 128;
/// Topics on one board at the most.
pub const TOPICS: usize = 256;
const MAGIC: u64 = 0x6b72_6f63_0000_0007;
/// How far a moment on the page may lie ahead of the clock of who reads it, which was looked at a little
/// before.
const AHEAD: Duration = Duration::from_millis(100);
const ROLE_BYTES: usize = 48;
/// Stands for no slot.
pub const NO_SLOT: u32 = u32::MAX;

/// What a process is doing, as its slot says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u32)]
pub enum SlotState {
    /// The slot belongs to nobody.
    Free = 0,
    /// The process was started and has not joined yet.
    Starting = 1,
    /// It has joined and takes steps.
    Running = 2,
    /// It is leaving.
    Stopping = 3,
    /// It has ended.
    Gone = 4,
}

impl SlotState {
    fn of(value: u32) -> Self {
        match value {
            1 => Self::Starting,
            2 => Self::Running,
            3 => Self::Stopping,
            4 => Self::Gone,
            _ => Self::Free,
        }
    }
}

/// What all processes of a board share.
#[repr(C, align(64))]
#[derive(Debug)]
pub struct Header {
    magic: AtomicU64,
    /// Grows whenever a reader joins, so that publishers serve it the last message.
    pub topology: AtomicU32,
    /// 0: live, 1: lockstep.
    pub lockstep: AtomicU32,
    /// Logical time in lockstep, in nanoseconds.
    pub logical_ns: AtomicU64,
    /// The round within the logical instant.
    pub round: AtomicU32,
    /// Services whose turn in this round has not ended.
    pub outstanding: AtomicU32,
    /// Rung when the last turn of a round has ended.
    pub conductor_bell: AtomicU32,
    /// 1 while the conductor sleeps.
    pub conductor_sleeps: AtomicU32,
    /// The next generation number of a publisher.
    pub generations: AtomicU32,
    /// Lockstep: who may publish from outside, and when; see [`gate`](crate::gate).
    pub gate: AtomicU32,
}

/// One process.
#[repr(C, align(128))]
#[derive(Debug)]
pub struct Slot {
    state: AtomicU32,
    /// The process that has claimed the slot: a tool for itself, the launcher for a service; zero when it is free. Whoever wins this word owns
    /// the rest, and a slot whose owner is dead can be taken over, at whatever instant the owner died.
    owner: AtomicU32,
    /// Its process number.
    pub pid: AtomicU32,
    /// Given by the launcher at each start; decides whose messages count.
    pub generation: AtomicU32,
    bell: AtomicU32,
    sleeps: AtomicU32,
    /// Lockstep: counts the turns given to it.
    pub turn: AtomicU32,
    /// Lockstep: the last turn that it has ended.
    pub done: AtomicU32,
    /// 1 when this is a service of the graph, 0 for a tool.
    pub is_service: AtomicU32,
    /// The topology up to which it has served the readers that joined.
    pub served: AtomicU32,
    /// When it last looked about, in nanoseconds of the host's clock.
    pub heartbeat_ns: AtomicU64,
    /// When its present step began; zero between steps.
    pub step_since_ns: AtomicU64,
    /// Steps taken.
    pub steps: AtomicU64,
    /// Messages that it has published while nobody was to hear it: a newcomer's, before it takes over.
    pub muted: AtomicU64,
    /// 1 when it may take over the topics of its role, each with its next message: the last step of a swap.
    pub may_take_over: AtomicU32,
    /// When its next timer is due; `u64::MAX` without one.
    pub next_due_ns: AtomicU64,
    role: [AtomicU8; ROLE_BYTES],
}

/// One topic. Two cache lines apart, since processors fetch them in pairs and neighbours are written by different processes.
#[repr(C, align(128))]
#[derive(Debug)]
pub struct TopicEntry {
    /// The generation whose messages count.
    pub generation: AtomicU32,
    /// The slot of the process that publishes it.
    pub publisher: AtomicU32,
    /// Messages published so far; the sequence of the last one.
    pub count: AtomicU64,
    /// When the last one was published.
    pub last_stamp_ns: AtomicU64,
    wake: [AtomicU64; SLOTS / 64],
}

#[repr(C)]
struct Page {
    header: Header,
    slots: [Slot; SLOTS],
    topics: [TopicEntry; TOPICS],
}

/// Bytes of the page.
pub(crate) const PAGE_BYTES: usize = size_of::<Page>();

/// The mapped page.
pub struct Switchboard {
    page: *const Page,
}

// SAFETY: everything in the page is atomic, and the mapping lives as long as the value.
unsafe impl Send for Switchboard {}
// SAFETY: as above.
unsafe impl Sync for Switchboard {}

impl std::fmt::Debug for Switchboard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Switchboard").finish_non_exhaustive()
    }
}

impl Switchboard {
    /// Makes the page.
    ///
    /// # Errors
    /// When the file exists or cannot be mapped.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = private::create(path)?;
        // Reserved, not only sized: with shared memory full, this fails, and not the first write into the page (SIGBUS).
        rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::empty(), 0, PAGE_BYTES as u64)
            .map_err(io::Error::from)
            .map_err(private::at(path))?;
        let board = Self::map(&file).map_err(private::at(path))?;
        for topic in 0..TOPICS {
            board.page().topics[topic].publisher.store(NO_SLOT, Ordering::Relaxed);
        }
        board.page().header.generations.store(1, Ordering::Relaxed);
        board.page().header.magic.store(MAGIC, Ordering::Release);
        Ok(board)
    }

    /// Joins the page of a board that exists.
    ///
    /// # Errors
    /// When there is none, or it was made by another version.
    pub fn open(path: &Path) -> io::Result<Self> {
        let unfit =
            |why: &str| io::Error::new(io::ErrorKind::InvalidData, format!("{}: {why}", path.display()));
        let file = private::open(path)?;
        if file.metadata().map_err(private::at(path))?.len() != PAGE_BYTES as u64 {
            return Err(unfit("the board was made by another version of Corkboard"));
        }
        let board = Self::map(&file).map_err(private::at(path))?;
        if board.page().header.magic.load(Ordering::Acquire) != MAGIC {
            return Err(unfit("the page is damaged, or the board was made by another version of Corkboard"));
        }
        Ok(board)
    }

    /// Writes the mark of a page again, in which its version stands; whether it was another.
    pub(crate) fn restore_mark(&self) -> bool {
        self.page().header.magic.swap(MAGIC, Ordering::AcqRel) != MAGIC
    }

    fn map(file: &File) -> io::Result<Self> {
        // SAFETY: a fresh shared mapping of a file that is large enough; all zeros is a valid page of atomics.
        let address = unsafe {
            mmap(
                std::ptr::null_mut(),
                size_of::<Page>(),
                ProtFlags::READ | ProtFlags::WRITE,
                MapFlags::SHARED,
                file,
                0,
            )?
        };
        Ok(Self { page: address.cast() })
    }

    fn page(&self) -> &Page {
        // SAFETY: the mapping is as large as a page, aligned to pages, alive until `drop`, and holds atomics only.
        unsafe { &*self.page }
    }

    /// What all share.
    pub fn header(&self) -> &Header {
        &self.page().header
    }

    /// The slot with this number, `None` beyond the last.
    pub fn slot(&self, index: u32) -> Option<&Slot> {
        self.page().slots.get(index as usize)
    }

    /// The topic with this number, `None` beyond the last.
    pub fn topic(&self, index: u32) -> Option<&TopicEntry> {
        self.page().topics.get(index as usize)
    }

    /// Takes a free slot for a process, or `None` when all are taken by living ones.
    pub fn claim(&self, role: &str, pid: u32, is_service: bool) -> Option<u32> {
        // Looking a process up costs a file, so the slots of the dead come last.
        let index = self.claim_where(|owner| owner == 0).or_else(|| {
            // A tool that was killed cannot give its slot back.
            self.claim_where(|owner| owner != 0 && !process_lives(owner))
        })?;
        let slot = self.slot(index)?;
        self.silence(index);
        slot.is_service.store(u32::from(is_service), Ordering::Relaxed);
        slot.set_role(role);
        slot.reset(pid);
        Some(index)
    }

    fn claim_where(&self, takeable: impl Fn(u32) -> bool) -> Option<u32> {
        let claimer = std::process::id();
        (0..SLOTS as u32).find(|&index| {
            let owner_word = &self.page().slots[index as usize].owner;
            let owner = owner_word.load(Ordering::Acquire);
            takeable(owner)
                && owner_word.compare_exchange(owner, claimer, Ordering::AcqRel, Ordering::Relaxed).is_ok()
        })
    }

    /// Gives back a slot that this process has claimed. One that another living process has claimed since,
    /// because the page said that it was free, stays as it is.
    pub fn release(&self, index: u32) {
        let is_ours = |slot: &&Slot| slot.owner() == std::process::id() || !slot.is_held();
        if let Some(slot) = self.slot(index).filter(is_ours) {
            self.silence(index);
            slot.pid.store(0, Ordering::Relaxed);
            slot.state.store(SlotState::Free as u32, Ordering::Release);
            slot.owner.store(0, Ordering::Release);
        }
    }

    /// Gives back the slot of a tool that died. Somebody else may be taking it over at this moment; one of the two wins.
    pub fn release_dead(&self, index: u32) {
        let Some(slot) = self.slot(index) else { return };
        let owner = slot.owner.load(Ordering::Acquire);
        if owner != 0
            && !process_lives(owner)
            && slot
                .owner
                .compare_exchange(owner, std::process::id(), Ordering::AcqRel, Ordering::Relaxed)
                .is_ok()
        {
            self.release(index);
        }
    }

    /// Takes the slot from the list of those to wake, on every topic.
    pub fn silence(&self, index: u32) {
        for topic in &self.page().topics {
            topic.set_wake(index, false);
        }
    }

    /// Whether any topic wakes the process in this slot.
    pub(crate) fn is_woken(&self, index: u32) -> bool {
        self.page().topics.iter().any(|topic| topic.wakes(index))
    }

    /// Rings the bell of everybody who asked to be woken by this topic.
    pub fn ring_readers(&self, topic: u32) {
        let Some(entry) = self.topic(topic) else { return };
        for (word, bits) in entry.wake.iter().enumerate() {
            let mut bits = bits.load(Ordering::Acquire);
            while bits != 0 {
                let index = word * 64 + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                self.page().slots[index].ring();
            }
        }
    }

    /// Rings every publisher, so that they serve a reader that has just joined.
    pub fn announce_reader(&self) {
        self.header().topology.fetch_add(1, Ordering::AcqRel);
        for slot in &self.page().slots {
            if slot.state() == SlotState::Running {
                slot.ring();
            }
        }
    }

    /// Slots of tools that have died without giving them back.
    pub fn dead_tools(&self) -> impl Iterator<Item = (u32, &Slot)> {
        self.taken().filter(|(_, slot)| {
            slot.is_service.load(Ordering::Relaxed) == 0 && !process_lives(slot.owner.load(Ordering::Acquire))
        })
    }

    /// Slots that are not free, with their numbers.
    pub fn taken(&self) -> impl Iterator<Item = (u32, &Slot)> {
        self.page()
            .slots
            .iter()
            .enumerate()
            .map(|(index, slot)| (index as u32, slot))
            .filter(|(_, slot)| slot.state() != SlotState::Free)
    }
}

impl Drop for Switchboard {
    fn drop(&mut self) {
        // SAFETY: mapped by `map` with this size, and nobody can hold a borrow any more.
        let _ = unsafe { munmap(self.page.cast_mut().cast(), size_of::<Page>()) };
    }
}

impl Slot {
    /// What the process is doing.
    pub fn state(&self) -> SlotState {
        SlotState::of(self.state.load(Ordering::Acquire))
    }

    /// Says what the process is doing.
    pub fn set_state(&self, state: SlotState) {
        self.state.store(state as u32, Ordering::Release);
    }

    /// Its name in the graph.
    pub fn role(&self) -> String {
        let bytes: Vec<u8> =
            self.role.iter().map(|byte| byte.load(Ordering::Relaxed)).take_while(|&byte| byte != 0).collect();
        String::from_utf8_lossy(&bytes).into_owned()
    }

    fn owner(&self) -> u32 {
        self.owner.load(Ordering::Acquire)
    }

    /// Whether a living process has claimed it.
    pub(crate) fn is_held(&self) -> bool {
        let owner = self.owner();
        owner != 0 && process_lives(owner)
    }

    /// Writes again that this process has claimed the slot for a service of this role; whether anything else
    /// stood there.
    pub(crate) fn restore_claim(&self, role: &str) -> bool {
        let mut differs = self.owner.swap(std::process::id(), Ordering::AcqRel) != std::process::id();
        differs |= self.is_service.swap(1, Ordering::AcqRel) != 1;
        if self.role() != kept_of(role) {
            self.set_role(role);
            differs = true;
        }
        differs
    }

    /// Keeps a place that is this process's own: what a broken process has written into it could make others
    /// take it for dead, or give the place away.
    pub(crate) fn hold(&self) {
        let pid = std::process::id();
        if self.pid.load(Ordering::Relaxed) != pid {
            self.pid.store(pid, Ordering::Release);
        }
        if self.state() != SlotState::Running {
            self.set_state(SlotState::Running);
        }
    }

    /// Keeps a place that this process has claimed for itself.
    pub(crate) fn hold_claim(&self) {
        if self.owner() != std::process::id() && !self.is_held() {
            self.owner.store(std::process::id(), Ordering::Release);
        }
        self.hold();
    }

    fn set_role(&self, role: &str) {
        for (index, byte) in self.role.iter().enumerate() {
            byte.store(role.as_bytes().get(index).copied().unwrap_or(0), Ordering::Relaxed);
        }
    }

    /// Prepares the slot for a new process.
    pub fn reset(&self, pid: u32) {
        self.pid.store(pid, Ordering::Relaxed);
        for counter in [&self.heartbeat_ns, &self.step_since_ns, &self.steps, &self.muted] {
            counter.store(0, Ordering::Relaxed);
        }
        self.may_take_over.store(0, Ordering::Relaxed);
        self.next_due_ns.store(u64::MAX, Ordering::Relaxed);
        self.sleeps.store(0, Ordering::Relaxed);
        self.served.store(0, Ordering::Relaxed);
        self.done.store(self.turn.load(Ordering::Relaxed), Ordering::Relaxed);
        self.state.store(SlotState::Starting as u32, Ordering::Release);
    }

    /// The bell's count; pass it to `wait` after having looked for work.
    pub fn bell(&self) -> u32 {
        self.bell.load(Ordering::SeqCst)
    }

    /// Wakes the process if it sleeps, or keeps it from falling asleep. Safe in a signal handler.
    pub fn ring(&self) {
        ring(&self.bell, &self.sleeps);
    }

    /// Sleeps until the bell is rung, unless it was rung since `heard`; at most for `timeout`.
    pub fn wait(&self, heard: u32, timeout: Option<Duration>) {
        wait(&self.bell, &self.sleeps, heard, timeout);
    }

    /// How long ago the process last looked about. `None` when nothing can be said: it has not yet, or the
    /// page says nonsense, which a living process writes over at its next look.
    pub fn silence(&self, now: Time) -> Option<Duration> {
        since(&self.heartbeat_ns, now)
    }

    /// How long its present step has lasted; `None` between steps, and when the page says nonsense.
    pub fn in_step(&self, now: Time) -> Option<Duration> {
        since(&self.step_since_ns, now)
    }

    /// Lets the silence of a running process count from now where nothing can be said of it; whether the page
    /// said nonsense.
    pub(crate) fn restore_heartbeat(&self, now: Time, lockstep: bool) -> bool {
        // In lockstep nobody looks about between its turns.
        if lockstep || self.state() != SlotState::Running || self.silence(now).is_some() {
            return false;
        }
        self.heartbeat_ns.swap(now.as_nanos(), Ordering::Relaxed) != 0
    }
}

impl TopicEntry {
    /// Whether the process in this slot is woken by the topic.
    pub fn set_wake(&self, slot: u32, wanted: bool) {
        if let Some(word) = self.wake.get(slot as usize / 64) {
            let bit = 1_u64 << (slot % 64);
            if wanted {
                word.fetch_or(bit, Ordering::AcqRel);
            } else {
                word.fetch_and(!bit, Ordering::AcqRel);
            }
        }
    }

    /// Whether the process in this slot is woken by the topic.
    pub fn wakes(&self, slot: u32) -> bool {
        self.wake
            .get(slot as usize / 64)
            .is_some_and(|word| word.load(Ordering::Acquire) & (1 << (slot % 64)) != 0)
    }
}

/// The time since a moment on the page; `None` when it is none.
fn since(moment_ns: &AtomicU64, now: Time) -> Option<Duration> {
    let moment = Time::from_nanos(moment_ns.load(Ordering::Relaxed));
    (moment != Time::ZERO && moment <= now.after(AHEAD)).then(|| now.since(moment))
}

/// As much of a role's name as a slot keeps.
fn kept_of(role: &str) -> String {
    String::from_utf8_lossy(&role.as_bytes()[..role.len().min(ROLE_BYTES)]).into_owned()
}

/// Counts up `bell` and wakes one sleeper. Sequentially consistent on both sides: either the ringer sees the sleeper, or the kernel sees the
/// count changed and does not put it to sleep.
pub fn ring(bell: &AtomicU32, sleeps: &AtomicU32) {
    bell.fetch_add(1, Ordering::SeqCst);
    if sleeps.load(Ordering::SeqCst) != 0 {
        let _ = futex::wake(bell, futex::Flags::empty(), 1);
    }
}

/// Sleeps on `bell` unless it has moved on from `heard`.
pub fn wait(bell: &AtomicU32, sleeps: &AtomicU32, heard: u32, timeout: Option<Duration>) {
    if bell.load(Ordering::SeqCst) != heard {
        return;
    }
    sleeps.store(1, Ordering::SeqCst);
    let timeout = timeout.map(|timeout| rustix::time::Timespec {
        tv_sec: timeout.as_secs() as i64,
        tv_nsec: i64::from(timeout.subsec_nanos()),
    });
    let _ = futex::wait(bell, futex::Flags::empty(), heard, timeout.as_ref());
    sleeps.store(0, Ordering::SeqCst);
}

/// Whether a process with this number exists and is no zombie.
pub fn process_lives(pid: u32) -> bool {
    let Ok(stat) = std::fs::read_to_string(format!("/proc/{pid}/stat")) else { return false };
    let state = stat.rsplit(')').next().and_then(|rest| rest.trim_start().chars().next());
    pid != 0 && !matches!(state, None | Some('Z' | 'X'))
}
