//! Which board is meant, and a place on it.

use crate::{Common, clean};
use board::host::boards_up;
use board::manifest::{Manifest, Topic};
use board::place::{Place, places};
use board::switchboard::{Slot, SlotState, Switchboard, process_lives};
use board::tap::Tap;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

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
        let up = if names.is_empty() {
            "none is up".to_owned()
        } else {
            format!("these are up: {}", names.join(", "))
        };
        return Err(ConnectError::Unknown { name: name.clone(), up }.into());
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

/// The board's page and table of contents, without taking a place on it.
pub(crate) struct Look {
    pub(crate) manifest: Manifest,
    pub(crate) switchboard: Switchboard,
}

pub(crate) fn look(common: &Common) -> Result<Look, Box<dyn Error>> {
    let place = choose(common)?;
    let manifest = Manifest::read(&place)?;
    let switchboard = Switchboard::open(&place.file("switchboard"))?;
    Ok(Look { manifest, switchboard })
}

/// A place on the board. Ports of tools that were killed are cleaned up first: nobody else does, and a topic takes only so many.
pub(crate) fn join(common: &Common) -> Result<Tap, Box<dyn Error>> {
    let place = choose(common)?;
    let dead = Switchboard::open(&place.file("switchboard"))?.dead_tools().count();
    if dead > 0 {
        clean::clean_dead(&place)?;
    }
    Ok(Tap::join(place, "board")?)
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

/// Becomes true on Ctrl-C and its relatives, so that the place on the board is given back.
pub(crate) fn interrupted() -> Result<Arc<AtomicBool>, std::io::Error> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        signal_hook::flag::register(signal, Arc::clone(&flag))?;
    }
    Ok(flag)
}
