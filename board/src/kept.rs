//! State that outlives a process, kept beside the board and gone with it.
//!
//! A mapped file with two halves: the state is written into the one that is not in use, then the halves change places. A process that dies in
//! between leaves the state before. Nothing is asked of the kernel, so a service can save in every step.

use crate::private;
use crate::shared::Shared;
use messages::Time;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use serde::{Serialize, de::DeserializeOwned};
use std::fs::File;
use std::io;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// A state that changes all the time is saved so often: what is lost is younger than that.
const PERIOD: Duration = Duration::from_millis(50);
/// Room for a state at first; it grows.
const ROOM: usize = 4096;
const HEADER: usize = 64;

/// A state of a service that its successor takes over: after a crash, or in a swap.
pub struct Kept<S> {
    home: Option<Home>,
    page: Option<Page>,
    /// What was saved last.
    last: Vec<u8>,
    next: Vec<u8>,
    due: Option<Time>,
    /// Whether it was said that the state cannot be kept.
    complained: bool,
    marker: PhantomData<S>,
}

/// Where the state lies, and the topic whose generation says who plays the role.
pub(crate) struct Home {
    pub(crate) file: PathBuf,
    pub(crate) shared: Rc<Shared>,
    pub(crate) health: u32,
}

impl<S> std::fmt::Debug for Kept<S> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Kept")
            .field("file", &self.home.as_ref().map(|home| &home.file))
            .finish_non_exhaustive()
    }
}

impl Home {
    /// Whether it is this process that plays the role: a newcomer must not overwrite what its predecessor saves.
    fn is_ours(&self) -> bool {
        let entry = self.shared.switchboard.topic(self.health);
        entry.is_some_and(|entry| entry.generation.load(Ordering::Acquire) == self.shared.generation)
    }
}

impl<S: Serialize + DeserializeOwned> Kept<S> {
    pub(crate) fn new(home: Option<Home>) -> Self {
        Self {
            home,
            page: None,
            last: Vec::new(),
            next: Vec::new(),
            due: None,
            complained: false,
            marker: PhantomData,
        }
    }

    /// What the predecessor saved; `None` on the first start, and when it was of another version.
    pub fn restore(&self) -> Option<S> {
        let bytes = Page::open(&self.home.as_ref()?.file).ok()?.read()?;
        serde_json::from_slice(&bytes)
            .inspect_err(|error| tracing::warn!(%error, "the predecessor's state is of another version and is left out"))
            .ok()
    }

    /// Saves the state, whole or not at all. Nothing is written while it stays the same.
    pub fn save(&mut self, state: &S) {
        let Some(home) = self.home.as_ref().filter(|home| home.is_ours()) else { return };
        self.next.clear();
        if serde_json::to_writer(&mut self.next, state).is_err() || self.next == self.last {
            return;
        }
        let wanted = self.next.len();
        if self.page.as_ref().is_none_or(|page| page.room < wanted) {
            match Page::create(&home.file, (2 * wanted).max(ROOM)) {
                Ok(page) => self.page = Some(page),
                Err(error) => return self.complain(&error),
            }
        }
        if let Some(page) = &mut self.page {
            page.write(&self.next);
            std::mem::swap(&mut self.last, &mut self.next);
            self.complained = false;
        }
    }

    /// What was kept last stays, and the next state is tried again; it is said once, until a state can be
    /// kept again.
    #[cold]
    fn complain(&mut self, error: &io::Error) {
        if !std::mem::replace(&mut self.complained, true) {
            tracing::warn!(%error, "the state cannot be kept, and a successor would begin with an older one");
        }
    }

    /// As `save`, for a state that changes with every step: twenty times a second at the most.
    pub fn save_now_and_then(&mut self, now: Time, state: impl FnOnce() -> S) {
        if self.home.is_some() && self.due.is_none_or(|due| now >= due) {
            self.due = Some(now.after(PERIOD));
            self.save(&state());
        }
    }
}

/// The mapped file: a header of three words (which half counts, and the length of each) and two halves.
#[derive(Debug)]
struct Page {
    address: *mut u8,
    size: usize,
    /// Bytes of a half.
    room: usize,
}

impl Page {
    /// A new file in the place of the old one, which whoever has it mapped keeps.
    fn create(path: &Path, room: usize) -> io::Result<Self> {
        let room = room.next_multiple_of(64);
        let temporary = path.with_extension("new");
        // What a process has left that died in here.
        private::remove(&temporary)?;
        let file = private::create(&temporary)?;
        // Reserved, not only sized: with shared memory full, this fails, and not the first write into the page (SIGBUS).
        let size = HEADER + 2 * room;
        let reserved = rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::empty(), 0, size as u64);
        let page = reserved.map_err(io::Error::from).and_then(|()| Self::map(&file, size));
        let page = page.map_err(private::at(&temporary)).inspect_err(|_| _ = private::remove(&temporary))?;
        if let Ok(old) = Self::open(path)
            && let Some(bytes) = old.read().filter(|bytes| bytes.len() <= room)
        {
            page.write(&bytes);
        }
        std::fs::rename(&temporary, path)?;
        Ok(page)
    }

    fn open(path: &Path) -> io::Result<Self> {
        let file = private::open(path)?;
        let size = usize::try_from(file.metadata()?.len()).unwrap_or(0);
        if size < HEADER {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "too short for a state"));
        }
        Self::map(&file, size)
    }

    fn map(file: &File, size: usize) -> io::Result<Self> {
        // SAFETY: a fresh shared mapping of a file that is as large.
        let address = unsafe {
            mmap(std::ptr::null_mut(), size, ProtFlags::READ | ProtFlags::WRITE, MapFlags::SHARED, file, 0)?
        };
        Ok(Self { address: address.cast(), size, room: (size - HEADER) / 2 })
    }

    fn word(&self, index: usize) -> &AtomicU32 {
        debug_assert!(index < HEADER / 4);
        // SAFETY: within the header, aligned since the mapping is, and read and written as an atomic only.
        unsafe { &*self.address.cast::<AtomicU32>().add(index) }
    }

    fn half(&self, half: usize) -> *mut u8 {
        // SAFETY: `half` is 0 or 1, and both halves lie within the mapping.
        unsafe { self.address.add(HEADER + (half & 1) * self.room) }
    }

    /// Writes into the half that is not in use, then changes over.
    fn write(&self, bytes: &[u8]) {
        let next = (self.word(0).load(Ordering::Acquire) as usize + 1) & 1;
        let length = bytes.len().min(self.room);
        // SAFETY: at most `room` bytes into a half of that many; one process at a time plays a role and writes.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), self.half(next), length) };
        self.word(1 + next).store(u32::try_from(length).unwrap_or(0), Ordering::Relaxed);
        self.word(0).store(next as u32, Ordering::Release);
    }

    /// The state that counts; `None` before the first.
    fn read(&self) -> Option<Vec<u8>> {
        let half = self.word(0).load(Ordering::Acquire) as usize & 1;
        let length = self.word(1 + half).load(Ordering::Relaxed) as usize;
        if length == 0 || length > self.room {
            return None;
        }
        let mut bytes = vec![0; length];
        // SAFETY: at most `room` bytes out of a half of that many. Whoever still writes into it makes nonsense of the bytes, which their reader refuses.
        unsafe { std::ptr::copy_nonoverlapping(self.half(half), bytes.as_mut_ptr(), length) };
        Some(bytes)
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        // SAFETY: mapped by `map` with this size, and nobody can hold a borrow any more.
        let _ = unsafe { munmap(self.address.cast(), self.size) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_whole_state_is_read() {
        let folder = std::env::temp_dir().join(format!("corkboard-kept-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("state");
        let page = Page::create(&path, 10).unwrap();
        assert_eq!(Page::open(&path).unwrap().read(), None);
        page.write(b"one");
        page.write(b"two");
        assert_eq!(Page::open(&path).unwrap().read().as_deref(), Some(&b"two"[..]));
        // A process that died while it wrote: bytes in the other half, no change of halves.
        let other = page.word(0).load(Ordering::Relaxed) as usize + 1;
        // SAFETY: within a half.
        unsafe { std::ptr::copy_nonoverlapping(b"XXX".as_ptr(), page.half(other), 3) };
        let before = Page::open(&path).unwrap().read();
        assert_eq!(before.as_deref(), Some(&b"two"[..]));
        // A larger one takes the old one's state with it.
        let larger = Page::create(&path, 1000).unwrap();
        assert_eq!(Page::open(&path).unwrap().read().as_deref(), Some(&b"two"[..]));
        larger.write(&[7; 900]);
        assert_eq!(Page::open(&path).unwrap().read(), Some(vec![7; 900]));
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn nonsense_is_no_state() {
        let folder = std::env::temp_dir().join(format!("corkboard-kept-nonsense-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("state");
        std::fs::write(&path, b"short").unwrap();
        assert!(Page::open(&path).is_err());
        std::fs::write(&path, [0xff; 200]).unwrap();
        assert_eq!(Page::open(&path).unwrap().read(), None);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
