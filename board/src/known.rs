//! What the launcher knows of its board besides what stands on the shared page: who may publish, and what kind
//! of time it is, only it can say.

use crate::private::Version;
use std::collections::{BTreeMap, BTreeSet};

/// A place that was prepared for a service.
#[derive(Debug, Clone)]
pub(crate) struct Prepared {
    pub(crate) role: String,
    pub(crate) generation: u32,
}

/// What was decided, whatever the page says.
#[derive(Debug)]
pub(crate) struct Known {
    /// The last generation that was given to a service.
    pub(crate) generations: u32,
    /// The last occupant of each place that a service was given.
    pub(crate) prepared: BTreeMap<u32, Prepared>,
    /// Whose messages count: the place and the generation, by role.
    pub(crate) speakers: BTreeMap<String, (u32, u32)>,
    /// The file of the table of contents, as it was last written.
    pub(crate) manifest_file: Option<Version>,
    /// What cannot be mended, and was said.
    pub(crate) said: BTreeSet<String>,
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
    pub(crate) fn place_of(&self, role: &str, generation: u32, living: &[(u32, u32)]) -> Option<u32> {
        let is_it = |place: &u32| {
            let prepared = self.prepared.get(place);
            prepared.is_some_and(|prepared| prepared.role == role && prepared.generation == generation)
        };
        living.iter().map(|&(place, _)| place).find(is_it)
    }

    /// How many living processes may come to play the role.
    pub(crate) fn players(&self, role: &str, living: &[(u32, u32)]) -> usize {
        let plays = |place: u32| self.prepared.get(&place).is_some_and(|prepared| prepared.role == role);
        living.iter().filter(|&&(place, _)| plays(place)).count()
    }
}
