//! How the launcher puts the shared page right, by what it knows besides.
//!
//! Every process of the user may write to the page, and a broken one may write anything. The processes hold
//! on to what is their own (their place, what wakes them); who may publish, and what kind of time it is, only
//! the launcher knows.

use crate::clock;
use crate::host::Host;
use crate::manifest::Manifest;
use crate::private::identity;
use crate::switchboard::{self, SLOTS, Slot};
use std::sync::atomic::{AtomicU32, Ordering};

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
            let Some(role) = topic.role() else {
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
        let page = self.place.file(switchboard::FILE);
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
