//! Which board is meant, a place on it, and how long one stays there.

use crate::{Common, clean, show};
use board::clock;
use board::host::{boards_up, living_launcher};
use board::manifest::{Manifest, Topic};
use board::place::{Place, places};
use board::switchboard::{Slot, SlotState, Switchboard, process_lives};
use board::tap::Tap;
use messages::Time;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::error::Error;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Why no board can be looked at.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ConnectError {
    #[error("no board is up; start one with `launch up GRAPH`{hint}")]
    None { hint: &'static str },
    #[error("{} boards are up: {}; say which with --board NAME", names.len(), names.join(", "))]
    Several { names: Vec<String> },
    #[error("there is no board `{name}`; {up}")]
    Unknown { name: String, up: String },
    #[error("the board has no topic `{topic}`; {hint}")]
    NoTopic { topic: String, hint: String },
}

/// The board that is meant.
pub(crate) fn choose(common: &Common) -> Result<Place, Box<dyn Error>> {
    let up = boards_up()?;
    let names: Vec<String> = up.iter().map(|place| place.name().to_owned()).collect();
    if let Some(name) = &common.board {
        let place = Place::new(name)?;
        if up.contains(&place) {
            return Ok(place);
        }
        return Err(unknown(name, &up).into());
    }
    match <[Place; 1]>::try_from(up) {
        Ok([place]) => Ok(place),
        Err(up) if up.is_empty() => {
            let stale = !places().is_empty();
            let hint = if stale { " (`board clean` clears away what is left of an earlier one)" } else { "" };
            Err(ConnectError::None { hint }.into())
        }
        Err(_) => Err(ConnectError::Several { names }.into()),
    }
}

/// That there is no board of this name, with those that there are.
pub(crate) fn unknown(name: &str, up: &[Place]) -> ConnectError {
    let names: Vec<&str> = up.iter().map(Place::name).collect();
    let up =
        if names.is_empty() { "none is up".to_owned() } else { format!("there is {}", names.join(", ")) };
    ConnectError::Unknown { name: name.to_owned(), up }
}

/// The board's page and table of contents, without taking a place on it.
pub(crate) struct Look {
    pub(crate) manifest: Manifest,
    pub(crate) switchboard: Switchboard,
}

pub(crate) fn look(place: &Place) -> Result<Look, Box<dyn Error>> {
    let manifest = Manifest::read(place)?;
    let switchboard = Switchboard::open(&place.file("switchboard"))?;
    Ok(Look { manifest, switchboard })
}

/// A place on the board. Ports of tools that were killed are cleaned up first: nobody else does, and a topic
/// takes only so many.
pub(crate) fn join(place: &Place) -> Result<Tap, Box<dyn Error>> {
    let dead = Switchboard::open(&place.file("switchboard"))?.dead_tools().count();
    if dead > 0 {
        clean::clean_dead(place)?;
    }
    Ok(Tap::join(place.clone(), "board")?)
}

/// The number and the entry of a topic.
pub(crate) fn topic<'a>(manifest: &'a Manifest, name: &str) -> Result<(u32, &'a Topic), ConnectError> {
    manifest.topic(name).ok_or_else(|| {
        let part = name.rsplit('/').next().unwrap_or(name);
        let near: Vec<String> = manifest
            .topics
            .iter()
            .filter(|topic| {
                topic.name.contains(part) || topic.name.split('/').any(|word| name.contains(word))
            })
            .map(|topic| format!("`{}`", topic.name))
            .collect();
        let hint = if near.is_empty() {
            "`board list` shows those there are".to_owned()
        } else {
            format!("did you mean {}?", near.join(" or "))
        };
        ConnectError::NoTopic { topic: name.to_owned(), hint }
    })
}

/// How the publisher of a topic is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Life {
    /// It takes steps.
    Lives,
    /// Its process is there and takes no steps yet, or no more.
    Idle,
    /// It has a place, and its process is gone.
    Dead,
    /// Nobody has a place as the publisher.
    Absent,
}

pub(crate) fn life(slot: &Slot) -> Life {
    match slot.state() {
        SlotState::Free | SlotState::Gone => Life::Absent,
        _ if !process_lives(slot.pid.load(Ordering::Relaxed)) => Life::Dead,
        SlotState::Running => Life::Lives,
        _ => Life::Idle,
    }
}

pub(crate) fn publisher_life(switchboard: &Switchboard, topic: u32) -> Life {
    let publisher = switchboard.topic(topic).map(|entry| entry.publisher.load(Ordering::Acquire));
    publisher.and_then(|slot| switchboard.slot(slot)).map_or(Life::Absent, life)
}

/// Why somebody would obey messages of ours on a topic that is not ours, in words; `None` when nobody would.
pub(crate) fn who_obeys(manifest: &Manifest, switchboard: &Switchboard, index: u32) -> Option<String> {
    let topic = manifest.topics.get(index as usize)?;
    let publisher = topic.publisher.as_deref()?;
    if matches!(publisher_life(switchboard, index), Life::Lives | Life::Idle) {
        return Some(format!("`{publisher}` publishes `{}`, and lives", topic.name));
    }
    // While its publisher is away, a command by hand is the only one that they hear.
    let moves = ["wheels/", "safety/"].iter().any(|subject| topic.name.starts_with(subject));
    let lives = |role: &&String| {
        switchboard.taken().any(|(_, slot)| {
            slot.is_service.load(Ordering::Relaxed) != 0 && slot.role() == **role && life(slot) == Life::Lives
        })
    };
    let reader = topic.readers.iter().filter(|_| moves).find(lives)?;
    Some(format!("`{reader}` obeys `{}`, and lives", topic.name))
}

/// Readers find a publisher when they next look, and get nothing from one that has left before.
const LINGER: Duration = Duration::from_millis(300);

/// Stays a little, so that readers find the publishers of this tap: when they begin, or before they leave.
pub(crate) fn linger(tap: &Tap, watch: &mut Watch) -> io::Result<()> {
    let until = clock::monotonic().after(LINGER);
    while clock::monotonic() < until && watch.end()?.is_none() {
        tap.wait(tap.bell(), until.since(clock::monotonic()));
    }
    Ok(())
}

/// How often it is looked whether the board is still up.
const LOOK: Duration = Duration::from_millis(500);
/// After this long without a message it is said that one is waited for.
const SILENCE: Duration = Duration::from_secs(1);

/// Why a command ends that would go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    /// Ctrl-C, or one of its relatives.
    Asked,
    /// The board went down.
    BoardWent,
}

/// Looks whether a command is to go on.
pub(crate) struct Watch {
    place: Place,
    interrupted: Arc<AtomicBool>,
    looked: Time,
    waiting_since: Time,
    said: bool,
}

impl Watch {
    /// Begins; from now on Ctrl-C does not end the process, so that its place on the board is given back.
    pub(crate) fn begin(place: Place) -> io::Result<Self> {
        let interrupted = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM, SIGHUP] {
            signal_hook::flag::register(signal, Arc::clone(&interrupted))?;
        }
        let now = clock::monotonic();
        Ok(Self { place, interrupted, looked: now, waiting_since: now, said: false })
    }

    /// Whether to end, and why.
    pub(crate) fn end(&mut self) -> io::Result<Option<End>> {
        let now = clock::monotonic();
        if self.interrupted.load(Ordering::Relaxed) {
            return Ok(Some(End::Asked));
        }
        if now.since(self.looked) >= LOOK {
            self.looked = now;
            if living_launcher(&self.place)?.is_none() {
                return Ok(Some(End::BoardWent));
            }
        }
        Ok(None)
    }

    /// As [`Watch::end`], and says so when the board went down.
    pub(crate) fn end_said(&mut self) -> io::Result<Option<End>> {
        let end = self.end()?;
        if end == Some(End::BoardWent) {
            show::note(&format!("the board `{}` went down", self.place.name()));
        }
        Ok(end)
    }

    /// Something came that was waited for.
    pub(crate) fn heard(&mut self) {
        self.waiting_since = clock::monotonic();
        self.said = true;
    }

    /// Says once, after a second, what is waited for; how long that has been.
    pub(crate) fn wait(&mut self, what: impl FnOnce() -> String) -> Duration {
        let waited = clock::monotonic().since(self.waiting_since);
        if !self.said && waited >= SILENCE {
            self.said = true;
            show::note(&format!("waiting for {}", what()));
        }
        waited
    }
}

/// What is waited for on a topic, with what can be said of its publisher.
pub(crate) fn awaited(tap: &Tap, index: u32) -> String {
    let Some(topic) = tap.manifest().topics.get(index as usize) else { return "a message".to_owned() };
    let why = match (&topic.publisher, publisher_life(tap.switchboard(), index)) {
        (None, _) => "it comes from outside".to_owned(),
        (Some(publisher), Life::Lives) => format!("`{publisher}` lives, and has said nothing"),
        (Some(publisher), Life::Idle) => format!("`{publisher}` takes no steps"),
        (Some(publisher), Life::Dead | Life::Absent) => format!("`{publisher}` is not there"),
    };
    format!("a message on `{}` ({why})", topic.name)
}
