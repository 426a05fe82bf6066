//! How a topic is laid out in shared memory.

use crate::manifest::Topic;
use crate::transport::TopicShape;

/// Readers of a topic beyond those of the graph: tools, recorders, newcomers of a swap, ports of the dead
/// that were not cleaned up yet. Each publisher has memory for all that they may hold, so topics of large
/// messages take fewer: so many bytes, so many readers.
const SPARE_READERS: [(usize, usize); 3] =
    [(4 * 1024, 12), (64 * 1024, SPARE_READERS_OF_ELEMENTS), (usize::MAX, 3)];
/// The same for messages with elements, at the most: nobody knows how many there will be.
const SPARE_READERS_OF_ELEMENTS: usize = 6;

pub(crate) fn shape_of(topic: &Topic) -> TopicShape {
    TopicShape {
        fingerprint: topic.message.fingerprint(),
        depth: topic.depth,
        readers: topic.readers.len() + spare_readers(topic),
    }
}

fn spare_readers(topic: &Topic) -> usize {
    let bytes = topic.room_bytes();
    let readers = SPARE_READERS.iter().find(|(most, _)| bytes <= *most).map_or(0, |&(_, readers)| readers);
    if topic.message.element.is_some() { readers.min(SPARE_READERS_OF_ELEMENTS) } else { readers }
}
