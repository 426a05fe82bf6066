//! The services that the tests start: this very binary, with an environment variable that says which.

use board::{About, Node, SetupError, run};
use messages::{Message, Misfit, Parameters, Time};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::process::ExitCode;
use std::time::Duration;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// Says which service this process is.
pub(crate) const WHICH: &str = "CORKBOARD_TEST_SERVICE";

/// A number, published one after the other.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub(crate) struct Count {
    /// The number.
    pub(crate) number: u64,
    /// A second one, always twice the first.
    pub(crate) twice: u64,
}

/// A message of the same name and size with another field.
pub(crate) mod other {
    use super::*;

    /// As its namesake, but for the second field.
    #[derive(
        Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message,
    )]
    #[repr(C)]
    pub(crate) struct Count {
        /// The number.
        pub(crate) number: u64,
        /// Something else.
        pub(crate) thrice: u64,
    }
}

/// Many bytes, each of them `number` modulo 251 plus its place.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[message(element = u8)]
#[repr(C)]
pub(crate) struct Picture {
    /// The number.
    pub(crate) number: u64,
    /// A part that leaves a gap before the elements.
    pub(crate) width_px: u32,
    /// Makes the size no multiple of eight.
    pub(crate) height_px: u32,
    /// The same.
    pub(crate) depth_px: u32,
    /// The same.
    pub(crate) rest: u32,
}

/// What a reader has seen.
#[derive(Debug, Clone, Copy, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout, Message)]
#[repr(C)]
pub(crate) struct Seen {
    /// The last number.
    pub(crate) number: u64,
    /// Messages read.
    pub(crate) messages: u64,
    /// Messages that were not as they were written.
    pub(crate) damaged: u64,
    /// Messages that did not lie in the board's shared memory.
    pub(crate) copied: u64,
    /// Steps taken.
    pub(crate) steps: u64,
}

/// Bytes of a picture: 1.2 MB.
pub(crate) const PICTURE_BYTES: usize = 1_200_000;

/// The byte at a place of a picture.
pub(crate) fn pixel(number: u64, place: usize) -> u8 {
    ((number as usize + place) % 251) as u8
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct Params {
    /// Between two messages.
    period_us: u64,
}

impl Default for Params {
    fn default() -> Self {
        Self { period_us: 1000 }
    }
}

impl Parameters for Params {
    type Error = Misfit;
}

/// Runs the service of this name.
pub(crate) fn serve(which: &str) -> ExitCode {
    let service = |name| About { name, version: "1.0.0", description: "A service of the tests" };
    match which {
        "counter" => run(service("counter"), counter),
        "relay" => run(service("relay"), relay),
        "collector" => run(service("collector"), collector),
        "slow-collector" => run(service("slow-collector"), slow_collector),
        "painter" => run(service("painter"), painter),
        "viewer" => run(service("viewer"), viewer),
        "other-layout" => run(service("relay"), |node, _: Params| {
            let mut count = node.latest::<other::Count>("count")?;
            Ok(move |_| {
                let _ = count.read();
            })
        }),
        "chatty" => run(service("chatty"), |node, params: Params| {
            node.every(Duration::from_micros(params.period_us));
            Ok(|_| tracing::error!("\u{1b}[2Jmuch to say"))
        }),
        "usurper" => run(service("usurper"), counter),
        "stuck" => run(service("stuck"), |node, _: Params| {
            node.every(Duration::from_millis(1));
            Ok(|_| {
                loop {
                    board::clock::sleep(Duration::from_secs(1));
                }
            })
        }),
        "gullible" => run(service("gullible"), gullible),
        "many-ports" => run(service("many-ports"), many_ports),
        "laden" => run(service("laden"), |node, params: Params| {
            let mut count = node.publisher::<Count>("count")?;
            if params.period_us == 0 {
                return Err("period_us = 0 is no period".into());
            }
            node.every(Duration::from_micros(params.period_us));
            node.declared()?;
            // Stands for a map that takes its time.
            let number = params.period_us.checked_sub(100).ok_or("the map is broken")?;
            Ok(move |_| count.publish(&Count { number, twice: 2 * number }))
        }),
        _ => ExitCode::FAILURE,
    }
}

type Step = Box<dyn FnMut(Time)>;

fn counter(node: &mut Node, params: Params) -> Result<Step, SetupError> {
    let mut count = node.publisher::<Count>("count")?;
    node.every(Duration::from_micros(params.period_us));
    let mut number = 0;
    Ok(Box::new(move |_| {
        number += 1;
        count.publish(&Count { number, twice: 2 * number });
    }))
}

fn relay(node: &mut Node, _: Params) -> Result<Step, SetupError> {
    let mut count = node.latest::<Count>("count")?;
    let mut relayed = node.publisher::<Count>("relayed")?;
    node.wake_on(&count);
    Ok(Box::new(move |_| {
        if let Some(message) = count.read() {
            relayed.publish(message.message);
        }
    }))
}

fn collector(node: &mut Node, _: Params) -> Result<Step, SetupError> {
    let mut count = node.queue::<Count>("count")?;
    let mut seen = node.publisher::<Seen>("seen")?;
    node.wake_on(&count);
    let mut so_far = Seen::default();
    Ok(Box::new(move |_| {
        while let Some(message) = count.next() {
            so_far.messages += 1;
            so_far.damaged += u64::from(message.twice != 2 * message.number);
            so_far.number = message.number;
        }
        so_far.steps += 1;
        seen.publish(&so_far);
    }))
}

fn slow_collector(node: &mut Node, params: Params) -> Result<Step, SetupError> {
    let mut count = node.queue::<Count>("count")?;
    node.every(Duration::from_micros(params.period_us));
    Ok(Box::new(move |_| while count.next().is_some() {}))
}

fn painter(node: &mut Node, _: Params) -> Result<Step, SetupError> {
    let mut count = node.latest::<Count>("count")?;
    let mut picture = node.publisher::<Picture>("picture")?;
    node.wake_on(&count);
    Ok(Box::new(move |_| {
        let Some(number) = count.read().map(|count| count.number) else { return };
        let Some(mut loan) = picture.loan(PICTURE_BYTES) else { return };
        let (header, bytes) = loan.parts();
        *header = Picture { number, width_px: 1000, height_px: 400, depth_px: 3, rest: 0 };
        bytes.iter_mut().enumerate().for_each(|(place, byte)| *byte = pixel(number, place));
        loan.send();
    }))
}

fn viewer(node: &mut Node, _: Params) -> Result<Step, SetupError> {
    let mut picture = node.latest::<Picture>("picture")?;
    let mut seen = node.publisher::<Seen>("seen")?;
    node.wake_on(&picture);
    let mut so_far = Seen::default();
    Ok(Box::new(move |_| {
        let Some(picture) = picture.read() else { return };
        let intact = picture.elements.len() == PICTURE_BYTES
            && picture.elements.iter().enumerate().all(|(place, &byte)| byte == pixel(picture.number, place));
        so_far.number = picture.number;
        so_far.messages += 1;
        so_far.damaged += u64::from(!intact);
        so_far.copied += u64::from(!in_shared_memory(picture.elements));
        seen.publish(&so_far);
    }))
}

/// Whether these bytes lie in a mapped file of a board.
fn in_shared_memory(bytes: &[u8]) -> bool {
    let (first, last) = (bytes.as_ptr() as usize, bytes.as_ptr() as usize + bytes.len());
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap_or_default();
    maps.lines().filter(|line| line.contains("/dev/shm/c")).any(|line| {
        let mut ends = line.split([' ', '-']).map_while(|text| usize::from_str_radix(text, 16).ok());
        matches!((ends.next(), ends.next()), (Some(from), Some(to)) if from <= first && last <= to)
    })
}

/// Reads whatever there is, as every type there is.
fn gullible(node: &mut Node, _: Params) -> Result<Step, SetupError> {
    let mut count = node.latest::<Count>("count")?;
    let mut picture = node.latest::<Picture>("picture")?;
    let mut pictures = node.queue::<Picture>("picture")?;
    let mut scan = node.latest::<messages::RangeScan>("scan")?;
    let mut ranges = node.queue::<messages::TofRanges>("ranges")?;
    let mut seen = node.publisher::<Seen>("seen")?;
    node.wake_on(&count);
    node.wake_on(&picture);
    node.wake_on(&scan);
    node.wake_on(&ranges);
    let mut so_far = Seen::default();
    Ok(Box::new(move |_| {
        so_far.number = count.read().map_or(0, |count| count.number);
        let mut sum =
            picture.read().map_or(0, |picture| picture.elements.iter().map(|&byte| u64::from(byte)).sum());
        while let Some(picture) = pictures.next() {
            sum += picture.elements.len() as u64;
        }
        if let Some(scan) = scan.read() {
            let hits = (0..scan.elements.len()).filter_map(|index| scan.beam(scan.elements, index)).count();
            sum += hits as u64 + u64::from(scan.check().is_ok());
        }
        while let Some(ranges) = ranges.next() {
            sum += format!("{:?}", ranges.message).len() as u64;
        }
        so_far.damaged = so_far.damaged.wrapping_add(sum);
        so_far.steps += 1;
        seen.publish(&so_far);
    }))
}

/// A service with as many ports as a busy one has, to be killed while it makes them.
fn many_ports(node: &mut Node, params: Params) -> Result<Step, SetupError> {
    let mut count = node.publisher::<Count>("count")?;
    let mut relayed = node.publisher::<Count>("relayed")?;
    let mut seen = node.publisher::<Seen>("seen")?;
    let mut readers = [node.latest::<Count>("count")?, node.latest::<Count>("relayed")?];
    let mut pictures = node.queue::<Picture>("picture")?;
    node.wake_on(&readers[0]);
    node.every(Duration::from_micros(params.period_us));
    let mut number = 0;
    Ok(Box::new(move |_| {
        number += 1;
        count.publish(&Count { number, twice: 2 * number });
        relayed.publish(&Count { number, twice: 2 * number });
        for reader in &mut readers {
            let _ = reader.read();
        }
        while pictures.next().is_some() {}
        seen.publish(&Seen { number, ..Seen::default() });
    }))
}
