//! What a recording holds beyond plain MCAP. Tools that do not know it skip it, as the MCAP specification
//! asks of them.
//!
//! - Metadata `corkboard`, at the beginning of the file: `manifest` (JSON of [`crate::Manifest`]) and
//!   `version`. It comes again, longer, when
//!   topics are added; the last one counts.
//! - Metadata `corkboard/end`, at the end: notes that were not known at the beginning.
//! - A message's `log_time` is its stamp, `publish_time` its origin, `sequence` the low 32 bits of its
//!   sequence. A private record [`CONTEXT`] in the chunk says the rest for the messages of one channel that
//!   follow it in that chunk: it is written when it changes, which is seldom, so it costs next to nothing.
//! - A message whose bytes do not fit its type (a broken process can publish any) is kept, bytes and all, in
//!   a private record [`MISFIT`].
//!
//! All numbers are little-endian.

use crate::Envelope;

/// The metadata record at the beginning.
pub const METADATA: &str = "corkboard";
/// The metadata record at the end.
pub const METADATA_END: &str = "corkboard/end";
/// The version of what is described here.
pub const VERSION: &str = "1";
/// Private record: channel (u16), high half of the sequence (u32), generation (u32), round (u32).
pub const CONTEXT: u8 = 0x80;
/// Private record: channel (u16), stamp (u64), origin (u64), sequence (u64), generation (u32), round (u32),
/// the bytes.
pub const MISFIT: u8 = 0x81;

/// The part of the envelope that an MCAP message has no place for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Context {
    pub(crate) sequence_high: u32,
    pub(crate) generation: u32,
    pub(crate) round: u32,
}

impl Context {
    pub(crate) fn of(envelope: &Envelope) -> Self {
        Self {
            sequence_high: (envelope.sequence >> 32) as u32,
            generation: envelope.generation,
            round: envelope.round,
        }
    }

    pub(crate) fn write(self, channel: u16) -> [u8; 14] {
        let mut record = [0; 14];
        record[..2].copy_from_slice(&channel.to_le_bytes());
        record[2..6].copy_from_slice(&self.sequence_high.to_le_bytes());
        record[6..10].copy_from_slice(&self.generation.to_le_bytes());
        record[10..].copy_from_slice(&self.round.to_le_bytes());
        record
    }

    pub(crate) fn read(mut record: &[u8]) -> Option<(u16, Self)> {
        let channel = u16::from_le_bytes(take(&mut record)?);
        let sequence_high = u32::from_le_bytes(take(&mut record)?);
        let generation = u32::from_le_bytes(take(&mut record)?);
        let round = u32::from_le_bytes(take(&mut record)?);
        Some((channel, Self { sequence_high, generation, round }))
    }

    pub(crate) fn envelope(self, log_time: u64, publish_time: u64, sequence: u32) -> Envelope {
        Envelope {
            stamp_ns: log_time,
            origin_ns: publish_time,
            sequence: u64::from(self.sequence_high) << 32 | u64::from(sequence),
            generation: self.generation,
            round: self.round,
        }
    }
}

pub(crate) fn write_misfit(channel: u16, envelope: &Envelope, bytes: &[u8]) -> Vec<u8> {
    let mut record = Vec::with_capacity(34 + bytes.len());
    record.extend_from_slice(&channel.to_le_bytes());
    record.extend_from_slice(&envelope.stamp_ns.to_le_bytes());
    record.extend_from_slice(&envelope.origin_ns.to_le_bytes());
    record.extend_from_slice(&envelope.sequence.to_le_bytes());
    record.extend_from_slice(&envelope.generation.to_le_bytes());
    record.extend_from_slice(&envelope.round.to_le_bytes());
    record.extend_from_slice(bytes);
    record
}

pub(crate) fn read_misfit(mut record: &[u8]) -> Option<(u16, Envelope, &[u8])> {
    let channel = u16::from_le_bytes(take(&mut record)?);
    let envelope = Envelope {
        stamp_ns: u64::from_le_bytes(take(&mut record)?),
        origin_ns: u64::from_le_bytes(take(&mut record)?),
        sequence: u64::from_le_bytes(take(&mut record)?),
        generation: u32::from_le_bytes(take(&mut record)?),
        round: u32::from_le_bytes(take(&mut record)?),
    };
    Some((channel, envelope, record))
}

/// The first bytes of a record, which is shorter afterwards.
pub(crate) fn take<const N: usize>(record: &mut &[u8]) -> Option<[u8; N]> {
    let (head, rest) = record.split_first_chunk::<N>()?;
    *record = rest;
    Some(*head)
}
