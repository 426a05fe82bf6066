//! What the launcher knows of its board besides what stands on the shared page, and how it puts the page
//! right.
//!
//! Every process of the user may write to the page, and a broken one may write anything. The processes hold
//! on to what is their own (their place, what wakes them); who may publish, and what kind of time it is, only
//! the launcher knows.

use crate::clock;
use crate::host::{Host, SWITCHBOARD, role_of};
use crate::manifest::Manifest;
use crate::private::{Version, identity};
use crate::switchboard::{SLOTS, Slot};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU32, Ordering};

/// A place that was prepared for a service.
#[derive(Debug, Clone)]
struct Prepared {
    role: String,
    generation: u32,
}

/// What was decided, whatever the page says.
#[derive(Debug)]
pub(crate) struct Known {
    /// The last generation that was given to a service.
    generations: u32,
    /// The last occupant of each place that a service was given.
    prepared: BTreeMap<u32, Prepared>,
    /// Whose messages count: the place and the generation, by role.
    speakers: BTreeMap<String, (u32, u32)>,
    /// The file of the table of contents, as it was last written.
    pub(crate) manifest_file: Option<Version>,
    /// What cannot be mended, and was said.
    said: BTreeSet<String>,
}

impl Known {
    /// Nobody was started yet, and the table of contents was just written.
    pub(crate) fn with_manifest(manifest_file: Option<Version>) -> Self {
        Self {
            generations: 1,
            prepared: BTreeMap::new(),
            speakers: BTreeMap::new(),
            manifest_file,
            said: BTreeSet::new(),
        }
    }

    /// The generation of the service that is to be started in this place.
    pub(crate) fn prepare(&mut self, slot: u32, role: &str) -> u32 {
        self.generations += 1;
        let prepared = Prepared { role: role.to_owned(), generation: self.generations };
        self.prepared.insert(slot, prepared);
        self.generations
    }

    /// The process in this place plays the role; its generation, `None` for a place that was never prepared.
    pub(crate) fn hand_over(&mut self, role: &str, slot: u32) -> Option<u32> {
        let generation = self.prepared.get(&slot)?.generation;
        self.speakers.insert(role.to_owned(), (slot, generation));
        Some(generation)
    }

    /// The place of the living process of this role that has this generation: in a swap the newcomer takes
    /// its topics by itself.
    fn place_of(&self, role: &str, generation: u32, living: &[(u32, u32)]) -> Option<u32> {
        let is_it = |place: &u32| {
            let prepared = self.prepared.get(place);
            prepared.is_some_and(|prepared| prepared.role == role && prepared.generation == generation)
        };
        living.iter().map(|&(place, _)| place).find(is_it)
    }

    /// How many living processes may come to play the role.
    fn players(&self, role: &str, living: &[(u32, u32)]) -> usize {
        let plays = |place: u32| self.prepared.get(&place).is_some_and(|prepared| prepared.role == role);
        living.iter().filter(|&&(place, _)| plays(place)).count()
    }
}

impl Host {
    /// Looks for damage of the board, mends what can be mended, and says what it was: a sentence each, none
    /// when all is well. What cannot be mended is said once. `living` are the launcher's services, newcomers
    /// included: place and process. To be called about once a second.
    pub fn repair(&self, living: &[(u32, u32)]) -> Vec<String> {
        let mut found = Vec::new();
        self.repair_header(&mut found);
        self.repair_topics(living, &mut found);
        self.repair_places(living, &mut found);
        self.look_at_files(&mut found);
        found
    }

    fn repair_header(&self, found: &mut Vec<String>) {
        if self.switchboard.restore_mark() {
            found.push("the mark of the board's page was overwritten, and is restored".to_owned());
        }
        let header = self.switchboard.header();
        let lockstep = u32::from(self.lockstep);
        if restore(&header.lockstep, lockstep) {
            found.push("the board's kind of time was overwritten, and is restored".to_owned());
        }
        let generations = self.known().generations;
        if restore(&header.generations, generations) {
            found.push(format!("the count of starts was overwritten, and is restored to {generations}"));
        }
    }

    /// Gives the right to publish back to whom it belongs.
    fn repair_topics(&self, living: &[(u32, u32)], found: &mut Vec<String>) {
        let known = self.known();
        let mut names = Vec::new();
        for (index, topic) in (0_u32..).zip(&self.manifest.topics) {
            let Some(entry) = self.switchboard.topic(index) else { continue };
            let (slot, generation) =
                (entry.publisher.load(Ordering::Acquire), entry.generation.load(Ordering::Acquire));
            let Some(role) = role_of(topic) else {
                if restore(&entry.generation, 0) {
                    names.push(format!("`{}`", topic.name));
                }
                continue;
            };
            let given = known.speakers.get(role).copied();
            let truth = match known.place_of(role, generation, living) {
                Some(place) => (place, generation),
                // A role that the launcher has started nobody for may be played by a process that was started
                // by hand.
                None => given.unwrap_or((slot, 0)),
            };
            if (slot, generation) == truth {
                continue;
            }
            entry.publisher.store(truth.0, Ordering::Release);
            entry.generation.store(truth.1, Ordering::Release);
            // A newcomer that takes over is just between the two words.
            if generation != truth.1 || known.players(role, living) < 2 {
                names.push(format!("`{}`", topic.name));
            }
        }
        if !names.is_empty() {
            found.push(format!(
                "whose messages count was overwritten for {}, and is restored",
                some_of(&names)
            ));
        }
    }

    fn repair_places(&self, living: &[(u32, u32)], found: &mut Vec<String>) {
        let known = self.known();
        let now = clock::monotonic();
        let mut names = Vec::new();
        for &(place, pid) in living {
            let (Some(prepared), Some(slot)) = (known.prepared.get(&place), self.switchboard.slot(place))
            else {
                continue;
            };
            let mut damaged = slot.restore_claim(&prepared.role);
            // Until the process has said its number, or the launcher for it, there is none.
            damaged |= slot.pid.load(Ordering::Acquire) != 0 && restore(&slot.pid, pid);
            damaged |= restore(&slot.generation, prepared.generation);
            damaged |= slot.restore_heartbeat(now, self.lockstep);
            if damaged {
                names.push(format!("`{}`", prepared.role));
            }
        }
        if !names.is_empty() {
            found.push(format!("the place of {} was overwritten, and is restored", some_of(&names)));
        }
        let is_services = |index: u32| living.iter().any(|&(place, _)| place == index);
        let is_held = |index: u32| self.switchboard.slot(index).is_some_and(Slot::is_held);
        // Each bell that nobody hears costs every publisher a call of the kernel.
        (0..SLOTS as u32)
            .filter(|&index| !is_services(index) && self.switchboard.is_woken(index) && !is_held(index))
            .for_each(|index| self.switchboard.silence(index));
    }

    /// Files of the board that were deleted or replaced by somebody else.
    fn look_at_files(&self, found: &mut Vec<String>) {
        let page = self.place.file(SWITCHBOARD);
        let mut lost = Vec::new();
        if identity(&page) != self.page_file {
            lost.push(format!("the board's page {} was deleted or replaced", page.display()));
        }
        let missing = self.files.iter().filter(|file| std::fs::symlink_metadata(file).is_err()).count();
        if missing > 0 {
            let all = self.files.len();
            lost.push(format!("{missing} of the board's {all} files in shared memory were deleted"));
        }
        for text in lost {
            let text = format!(
                "{text}: what runs goes on, and what is started now cannot join; `launch stop` and `launch up` mend it"
            );
            if self.known().said.insert(text.clone()) {
                found.push(text);
            }
        }
        let was_replaced = Manifest::version(&self.place) != self.known().manifest_file;
        if was_replaced && self.is_in_place() {
            let outcome = match self.write_manifest() {
                Ok(()) => "is written again".to_owned(),
                Err(error) => format!("cannot be written again: {error}"),
            };
            found.push(format!("the board's table of contents was deleted or replaced, and {outcome}"));
        }
    }
}

/// Whether a word was something else.
fn restore(word: &AtomicU32, truth: u32) -> bool {
    word.swap(truth, Ordering::AcqRel) != truth
}

/// The first few names, and how many more there are.
fn some_of(names: &[String]) -> String {
    const SHOWN: usize = 3;
    let first = names[..names.len().min(SHOWN)].join(", ");
    match names.len().saturating_sub(SHOWN) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}
