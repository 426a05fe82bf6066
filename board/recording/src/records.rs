//! Records as the library parses them, once their lengths are known to be true: it takes memory for a text
//! before it reads it, up to 4 GB.

use crate::format::take;
use mcap::records::{Record, op};

/// A record, if what it says of its own lengths is true and it is one of those that are of use here.
pub(crate) fn parse(opcode: u8, body: &[u8]) -> Option<Record<'_>> {
    has_true_lengths(opcode, body)?;
    mcap::parse_record(opcode, body).ok()
}

/// Walks over the texts of a record.
fn has_true_lengths(opcode: u8, body: &[u8]) -> Option<()> {
    let mut rest = body;
    match opcode {
        op::CHANNEL => {
            take::<4>(&mut rest)?;
            skip_texts(&mut rest, 2)?;
            skip_map(&mut rest)
        }
        op::METADATA => {
            skip_texts(&mut rest, 1)?;
            skip_map(&mut rest)
        }
        _ => None,
    }
}

/// Whether the name of a chunk's compression, which follows `head` bytes, ends within its record.
pub(crate) fn chunk_has_true_lengths(record: &[u8], head: usize) -> bool {
    record.get(head..).is_some_and(|mut rest| skip_texts(&mut rest, 1).is_some())
}

fn skip_texts(rest: &mut &[u8], count: usize) -> Option<()> {
    (0..count).try_for_each(|_| piece(rest).map(drop))
}

/// Keys and values, after the bytes that they take together.
fn skip_map(rest: &mut &[u8]) -> Option<()> {
    let mut map = piece(rest)?;
    while !map.is_empty() {
        skip_texts(&mut map, 2)?;
    }
    Some(())
}

/// What follows its own length.
fn piece<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let length = usize::try_from(u32::from_le_bytes(take(rest)?)).ok()?;
    let (piece, after) = rest.split_at_checked(length)?;
    *rest = after;
    Some(piece)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(words: &str) -> Vec<u8> {
        [&(words.len() as u32).to_le_bytes(), words.as_bytes()].concat()
    }

    fn metadata() -> Vec<u8> {
        let map = [text("key"), text("value")].concat();
        [text("name"), (map.len() as u32).to_le_bytes().to_vec(), map].concat()
    }

    #[test]
    fn what_is_sound_is_parsed() {
        let body = metadata();
        let Some(Record::Metadata(metadata)) = parse(op::METADATA, &body) else { panic!("it is sound") };
        assert_eq!((metadata.name.as_str(), metadata.metadata["key"].as_str()), ("name", "value"));
        let body = [vec![7, 0, 9, 0], text("a/b"), text("cdr"), vec![0; 4]].concat();
        let Some(Record::Channel(channel)) = parse(op::CHANNEL, &body) else { panic!("it is sound") };
        assert_eq!((channel.id, channel.topic.as_str()), (7, "a/b"));
        assert!(parse(op::STATISTICS, &[0; 64]).is_none());
    }

    #[test]
    fn no_length_is_believed() {
        // The name's, the map's, the key's, the value's.
        for at in [0, 8, 12, 19] {
            let mut body = metadata();
            body[at..at + 4].copy_from_slice(&0x7fff_fff0_u32.to_le_bytes());
            assert!(parse(op::METADATA, &body).is_none(), "at {at}");
        }
        let all = metadata();
        for end in 0..all.len() {
            assert!(parse(op::METADATA, &all[..end]).is_none(), "cut at {end}");
        }
        assert!(chunk_has_true_lengths(&[&[0; 28][..], &text("zstd")].concat(), 28));
        assert!(!chunk_has_true_lengths(&[&[0; 28][..], &[0xff; 8]].concat(), 28));
        assert!(!chunk_has_true_lengths(&[0; 20], 28));
    }
}
