//! How much shared memory a board and its graph take, known before anything of it is made.
//!
//! What the transport makes for a topic follows from its shape. The sizes of its own book-keeping are those
//! of iceoryx2 0.10; a test holds them against what is really there.

use crate::lack::{Lack, free_bytes};
use crate::manifest::{Manifest, Topic};
use crate::names::SHARED_MEMORY;
use crate::shape::shape_of;
use crate::switchboard::PAGE_BYTES;
use crate::transport::{BORROWED, HISTORY, LOANED, message_bytes};

/// What logs, kept states and tools find room in besides, in bytes.
const BESIDES: u64 = 512 * 1024;
/// A topic: its list of ports, and its file in the board's folder.
const TOPIC_BYTES: [usize; 2] = [7367, 1000];
/// Of the list of ports: each reader's part.
const READER_BYTES: usize = 72;
/// A process: its name, and that it lives.
const PROCESS_BYTES: [usize; 2] = [2100, 16];
/// A publisher's memory besides its messages: at all, and for each message.
const SEGMENT_BYTES: (usize, usize) = (206, 4);
/// A connection of a publisher and a reader, besides its queues.
const CONNECTION_BYTES: usize = 280;
/// A publisher whose memory may grow can have so many segments, and each connection a list for each of them:
/// at all, and for each message.
const SEGMENTS: usize = 255;
const SEGMENT_LIST_BYTES: (usize, usize) = (39, 1);

/// What is lacking for this board, if anything is.
pub(crate) fn lack_for(manifest: &Manifest) -> Option<Lack> {
    let found = rustix::fs::statvfs(SHARED_MEMORY).ok()?;
    let (needed, free) = (needed_bytes(manifest) + BESIDES, free_bytes(&found));
    (free < needed).then(|| Lack::Memory { needed, free, size: found.f_blocks * found.f_frsize })
}

/// How much shared memory a board takes when all services of its graph are there, in bytes.
pub fn needed_bytes(manifest: &Manifest) -> u64 {
    // A table of contents in JSON is mostly descriptions of messages.
    let contents = serde_json::to_vec(manifest).map_or(0, |json| json.len());
    let board = in_pages(PAGE_BYTES) + in_pages(contents) + in_pages(1) + in_pages(16);
    // The launcher is a process of the board, too.
    let processes = (manifest.services.len() as u64 + 1) * PROCESS_BYTES.map(in_pages).iter().sum::<u64>();
    board + processes + manifest.topics.iter().map(topic_bytes).sum::<u64>()
}

fn topic_bytes(topic: &Topic) -> u64 {
    let shape = shape_of(topic);
    let lists = in_pages(TOPIC_BYTES[0] + READER_BYTES * shape.readers) + in_pages(TOPIC_BYTES[1]);
    if topic.publisher.is_none() {
        return lists;
    }
    let depth = shape.depth.max(2);
    let messages = shape.readers * (depth + BORROWED) + HISTORY + LOANED;
    let segment = SEGMENT_BYTES.0 + messages * (message_bytes(topic.room_bytes()) + SEGMENT_BYTES.1);
    let queues = 8 * (2 * depth + BORROWED + 2);
    let grows = topic.message.element.is_some();
    let (index, segments) = if grows { (in_pages(1), SEGMENTS) } else { (0, 1) };
    let per_segment = if grows { SEGMENT_LIST_BYTES.0 } else { 0 } + messages * SEGMENT_LIST_BYTES.1;
    let connection = in_pages(CONNECTION_BYTES + queues + segments * per_segment);
    lists + in_pages(segment) + index + topic.readers.len() as u64 * connection
}

/// Bytes that a file of this size takes.
fn in_pages(bytes: usize) -> u64 {
    // SAFETY: a plain call without pointers.
    let page = usize::try_from(unsafe { libc::sysconf(libc::_SC_PAGESIZE) }).unwrap_or(4096).max(1);
    bytes.next_multiple_of(page) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::Host;
    use crate::node::Joined;
    use crate::place::Place;
    use messages::{Health, Message, Path, RangeScan, TofRanges, WheelSpeeds};
    use std::os::unix::fs::MetadataExt as _;

    fn topic<T: Message>(name: &str, readers: usize, depth: usize, elements: usize) -> Topic {
        Topic {
            name: name.into(),
            publisher: Some("talker".into()),
            readers: (0..readers).map(|index| format!("listener-{index}")).collect(),
            depth,
            elements,
            message: T::description(),
        }
    }

    /// Bytes of all files below.
    fn taken(folder: &std::path::Path) -> u64 {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries
            .map(|entry| match entry.metadata() {
                Ok(found) if found.is_dir() => taken(&entry.path()),
                Ok(found) => found.blocks() * 512,
                Err(_) => 0,
            })
            .sum()
    }

    fn taken_by(place: &Place) -> u64 {
        let segments = place.shared_memory();
        let segments =
            segments.iter().map(|file| std::fs::metadata(file).map_or(0, |found| found.blocks() * 512));
        segments.sum::<u64>() + taken(place.root())
    }

    #[track_caller]
    fn check(name: &str, topics: Vec<Topic>) {
        let readers = topics.iter().map(|topic| topic.readers.len()).max().unwrap_or(0);
        let mut services = vec!["talker".to_owned()];
        services.extend((0..readers).map(|index| format!("listener-{index}")));
        let manifest = Manifest { topics, services, ..Manifest::default() };
        let predicted = needed_bytes(&manifest);
        let name = format!("t-n-{}-{name}", std::process::id());
        let host = Host::create(&name, manifest.clone(), false).unwrap();
        let join = |role: &str| Joined::join(host.place().clone(), role, None).unwrap();
        let mut talker = join("talker");
        for topic in &manifest.topics {
            let grows = topic.message.element.is_some();
            talker.open_publisher(&topic.name, topic.message.fingerprint(), grows).unwrap();
        }
        let mut links = Vec::new();
        let mut listeners = Vec::new();
        for index in 0..readers {
            let listener = join(&format!("listener-{index}"));
            for topic in manifest.topics.iter().filter(|topic| index < topic.readers.len()) {
                links.push(
                    listener.open_reader(&topic.name, topic.message.fingerprint(), topic.depth).unwrap(),
                );
            }
            listeners.push(listener);
        }
        let really = taken_by(host.place());
        drop((links, listeners, talker));
        host.take_down().unwrap();
        let ratio = predicted as f64 / really as f64;
        assert!((0.9..=1.1).contains(&ratio), "{predicted} bytes were predicted, {really} are taken");
    }

    #[test]
    fn the_prediction_is_right_to_a_tenth() {
        check("none", vec![]);
        check("small", vec![topic::<WheelSpeeds>("wheels/desired", 1, 4, 0)]);
        check("deep", vec![topic::<TofRanges>("tof/ranges", 3, 64, 0)]);
        check("path", vec![topic::<Path>("plan/path", 2, 4, 64)]);
        check("large", vec![topic::<RangeScan>("laser/scan", 2, 8, 20_000)]);
        let mut many: Vec<Topic> =
            (0..20).map(|index| topic::<Health>(&format!("health/{index}"), index % 4, 4, 0)).collect();
        many.push(topic::<RangeScan>("laser/scan", 3, 64, 361));
        check("many", many);
    }
}
