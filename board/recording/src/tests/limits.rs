//! What a file may ask of its reader.

use super::*;
use messages::{OccupancyMap, Order};

/// A recording of orders and maps as far as its first chunk, which has an order of each of these moments.
fn beginning(folder: &Path, stamps_ns: &[u64]) -> Vec<u8> {
    let path = folder.join("beginning.mcap");
    let _ = std::fs::remove_file(&path);
    let mut recorder =
        Recorder::new(&path, &manifest(vec![Order::description(), OccupancyMap::description()])).unwrap();
    for (index, stamp_ns) in stamps_ns.iter().enumerate() {
        recorder.record(0, &envelope(*stamp_ns, index as u64 + 1), &noise(1, 16)).unwrap();
    }
    recorder.flush().unwrap();
    std::fs::read(&path).unwrap()
}

fn opened(folder: &Path, bytes: &[u8]) -> Result<Recording, RecordingError> {
    let path = folder.join("test.mcap");
    std::fs::write(&path, bytes).unwrap();
    Recording::open(&path)
}

/// A chunk's record as another tool, or nobody, would write it.
fn chunk(stamp_ns: u64, unpacked: u64, compression: &str, data: &[u8]) -> Vec<u8> {
    let mut body = Vec::new();
    body.extend(stamp_ns.to_le_bytes());
    body.extend(stamp_ns.to_le_bytes());
    body.extend(unpacked.to_le_bytes());
    body.extend(0_u32.to_le_bytes());
    body.extend((compression.len() as u32).to_le_bytes());
    body.extend(compression.as_bytes());
    body.extend((data.len() as u64).to_le_bytes());
    body.extend(data);
    [&[mcap::records::op::CHUNK][..], &(body.len() as u64).to_le_bytes(), &body].concat()
}

/// A zstd frame of these bytes and of `zeros` noughts: four bytes of it are 128 KiB.
fn zstd(first: &[u8], zeros: usize) -> Vec<u8> {
    const BLOCK: usize = 128 << 10;
    let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0x00, 0x50];
    let mut block = |last: usize, kind: usize, size: usize, body: &[u8]| {
        frame.extend(&((size << 3 | kind << 1 | last) as u32).to_le_bytes()[..3]);
        frame.extend(body);
    };
    block(0, 0, first.len(), first);
    for begin in (0..zeros).step_by(BLOCK) {
        block(0, 1, BLOCK.min(zeros - begin), &[0]);
    }
    block(1, 0, 0, &[]);
    frame
}

/// A chunk of one message that is nothing but large.
fn large(stamp_ns: u64, bytes: usize) -> Vec<u8> {
    let head = format::write_misfit(2, &envelope(stamp_ns, 1), &[]);
    let record = [&[format::MISFIT][..], &((head.len() + bytes) as u64).to_le_bytes(), &head].concat();
    chunk(stamp_ns, (record.len() + bytes) as u64, "zstd", &zstd(&record, bytes))
}

/// What a whole reading of a file gives: messages, and errors.
fn read_all(messages: Messages<'_>) -> (usize, Vec<String>) {
    let mut count = 0;
    let mut errors = Vec::new();
    for message in messages {
        match message {
            Ok(_) => count += 1,
            Err(error) => errors.push(error.to_string()),
        }
    }
    (count, errors)
}

#[track_caller]
fn check_words(errors: &[String], words: &str) {
    assert!(matches!(errors, [error] if error.contains(words)), "{errors:?}");
}

#[test]
fn a_small_file_that_would_unpack_to_gibibytes_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = beginning(folder.path(), &[1]);
    for index in 0..20 {
        bytes.extend(large(index, 60 << 20));
    }
    assert!(bytes.len() < 60_000);
    let error = opened(folder.path(), &bytes).unwrap_err().to_string();
    assert!(error.contains("bytes that it would unpack to are more than the 1073741824"), "{error}");
}

#[test]
fn a_chunk_that_lies_about_its_size_is_an_error_and_the_next_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let good = beginning(folder.path(), &[1, 2]);
    let order = |stamp_ns| {
        let head = format::write_misfit(1, &envelope(stamp_ns, 9), &noise(1, 15));
        [&[format::MISFIT][..], &(head.len() as u64).to_le_bytes(), &head].concat()
    };
    let last = chunk(9, order(9).len() as u64, "", &order(9));
    let check = |lying: Vec<u8>| {
        let recording = opened(folder.path(), &[&good[..], &lying, &last].concat()).unwrap();
        for messages in [recording.as_recorded(|_| true), recording.in_order(|_| true)] {
            let (count, errors) = read_all(messages);
            assert_eq!((count, errors.len()), (3, 1), "{errors:?}");
        }
    };
    // Less than there is, more than there is, more than there can be, and no such packing.
    check(chunk(5, 16, "zstd", &zstd(&order(5), 70 << 20)));
    check(chunk(5, 1000, "zstd", &zstd(&order(5), 0)));
    check(chunk(5, 79 << 20, "zstd", &zstd(&order(5), 0)));
    check(chunk(5, 1 << 60, "zstd", &zstd(&order(5), 0)));
    check(chunk(5, u64::MAX, "zstd", &zstd(&order(5), 0)));
    check(chunk(5, 1 << 20, "lz4", &[0; 100]));
    check(chunk(5, 1, "arj", &order(5)));
}

#[test]
fn a_record_that_is_longer_than_the_file_ends_it() {
    let folder = tempfile::tempdir().unwrap();
    let good = beginning(folder.path(), &[1, 2]);
    for length in [1, 100, u64::MAX / 2, u64::MAX - 8, u64::MAX] {
        for opcode in [mcap::records::op::CHUNK, mcap::records::op::METADATA, 0x90] {
            let lying = [&good[..], &[opcode], &length.to_le_bytes()].concat();
            let recording = opened(folder.path(), &lying).unwrap();
            assert!(!recording.is_complete());
            assert_eq!(read_all(recording.in_order(|_| true)), (2, vec![]));
        }
    }
}

#[test]
fn chunks_that_all_claim_one_moment_are_not_all_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = beginning(folder.path(), &[1]);
    for _ in 0..8 {
        bytes.extend(large(5, 70 << 20));
    }
    let recording = opened(folder.path(), &bytes).unwrap();
    let (count, errors) = read_all(recording.in_order(|_| true));
    assert!(count < 6, "{count}");
    check_words(&errors, "bytes of chunks that overlap in time");
    // Those that come one after the other are.
    assert_eq!(read_all(recording.as_recorded(|_| true)), (9, vec![]));
}

#[test]
fn a_chunk_of_more_messages_than_ours_can_have_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = beginning(folder.path(), &[1]);
    let head = format::write_misfit(1, &envelope(5, 1), &[]);
    let record = [&[format::MISFIT][..], &(head.len() as u64).to_le_bytes(), &head].concat();
    let records = record.repeat(250_001);
    bytes.extend(chunk(5, records.len() as u64, "", &records));
    let recording = opened(folder.path(), &bytes).unwrap();
    let (count, errors) = read_all(recording.in_order(|_| true));
    assert_eq!(count, 1);
    check_words(&errors, "250000 messages of a chunk are more than");
}

#[test]
fn only_plain_files_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let fifo = folder.path().join("fifo.mcap");
    std::process::Command::new("mkfifo").arg(&fifo).status().unwrap();
    for path in [folder.path(), &fifo, Path::new("/dev/zero"), Path::new("/dev/null")] {
        let error = Recording::open(path).unwrap_err();
        assert!(matches!(error, RecordingError::File(_)), "{error}");
    }
}

#[test]
fn the_time_that_a_recording_spans_is_known_without_reading_it() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = beginning(folder.path(), &[5_000, 3_000, 9_000]);
    let recording = opened(folder.path(), &bytes).unwrap();
    assert_eq!(recording.span_ns(), Some((3_000, 9_000)));
    assert!(!recording.is_complete());
    let longer = [&bytes[..], &large(12_000, 10)].concat();
    assert_eq!(opened(folder.path(), &longer).unwrap().span_ns(), Some((3_000, 12_000)));
    let cut = opened(folder.path(), &longer[..longer.len() - 1]).unwrap();
    assert_eq!(cut.span_ns(), Some((3_000, 9_000)));
    let at_once = opened(folder.path(), &beginning(folder.path(), &[])).unwrap();
    assert_eq!(at_once.span_ns(), Some((0, 0)));
}

#[track_caller]
fn check_description(change: impl FnOnce(&mut Description), words: &str) {
    let mut description = lay_out("Any", vec![Kind::F64, Kind::U8], None);
    change(&mut description);
    let error = Codec::new(&description).unwrap_err().to_string();
    assert!(error.contains(words), "{error}");
}

#[test]
fn descriptions_have_bounds() {
    let record =
        |size, fields| Kind::Record(Box::new(Description { size, fields, ..lay_out("Inner", vec![], None) }));
    let many = |kind, count| Kind::Array { of: Box::new(kind), count };
    check_description(|it| it.size = (64 << 20) + 1, "is the limit");
    check_description(|it| it.size = 64 << 20, "of which its fields fill 9");
    check_description(|it| it.element = Some(record(1 << 20, vec![])), "of which its fields fill 0");
    // Records of nothing within records of nothing are looked at once.
    let mut nothing = record(1, vec![]);
    for _ in 0..100 {
        let field =
            FieldDescription { offset: 0, ..lay_out("F", vec![many(nothing, 1)], None).fields.remove(0) };
        nothing = record(1, vec![field]);
    }
    let nothing = many(nothing, 60 << 20);
    check_description(
        |it| {
            it.size = 60 << 20;
            it.fields[0].kind = nothing;
        },
        "of which its fields fill 1",
    );
    let pair = lay_out("Pair", vec![Kind::F64, Kind::F64], None);
    check_description(
        |it| {
            it.element = Some(many(
                Kind::Record(Box::new(lay_out("Many", vec![many(Kind::Record(Box::new(pair)), 3000)], None))),
                1,
            ))
        },
        "`Any` has more than 4000 separate numbers",
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.mcap");
    let error = Recorder::new(&path, &manifest(vec![Order::description(); 1025])).unwrap_err().to_string();
    assert!(error.contains("1025 topics are more than the 1024"), "{error}");
}

#[test]
fn a_message_that_is_larger_in_memory_than_any_is_none() {
    let description = lay_out(
        "Any",
        vec![Kind::U8],
        Some(Kind::Record(Box::new(lay_out("E", vec![Kind::U8, Kind::U64], None)))),
    );
    let codec = Codec::new(&description).unwrap();
    let claims = |count: u32| [&[0, 1, 0, 0, 0, 0, 0, 0][..], &count.to_le_bytes(), &[0; 64]].concat();
    let mut raw = Vec::new();
    assert!(codec.decode(&claims(2), &mut raw).is_ok());
    let mut raw = Vec::new();
    assert!(codec.decode(&claims(u32::MAX), &mut raw).is_err());
    assert!(raw.capacity() < 1000, "{}", raw.capacity());
}
