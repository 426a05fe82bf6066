use crate::*;
use messages::{Description, FieldDescription, Kind, Message as _, Time, catalogue, elements_offset};
use proptest::prelude::*;
use std::time::Duration;

mod limits;

fn manifest(descriptions: Vec<Description>) -> Manifest {
    let topic = |(index, message): (usize, Description)| Topic {
        name: format!("{}/{index}", message.name.to_lowercase()),
        publisher: Some("somebody".into()),
        depth: 8,
        readers: vec![],
        elements: messages::ELEMENTS,
        message,
    };
    let topics = descriptions.into_iter().enumerate().map(topic).collect();
    Manifest { graph: "test".into(), seed: 7, topics, notes: [("a".into(), "b".into())].into() }
}

fn envelope(stamp_ns: u64, sequence: u64) -> Envelope {
    Envelope { stamp_ns, origin_ns: stamp_ns / 2, sequence, generation: 1, round: 0 }
}

type Plain = (usize, Envelope, Vec<u8>);

fn read(messages: Messages<'_>) -> Vec<Plain> {
    messages
        .map(|message| {
            message.map(|message| (message.topic, message.envelope, message.bytes().to_vec())).unwrap()
        })
        .collect()
}

/// Writes these messages, a chunk after each whose sequence is in `chunks_after`, and opens the file.
fn recorded(folder: &Path, manifest: &Manifest, messages: &[Plain], chunk_every: usize) -> Recording {
    let path = folder.join("test.mcap");
    let _ = std::fs::remove_file(&path);
    let mut recorder = Recorder::new(&path, manifest).unwrap();
    for (index, (topic, envelope, bytes)) in messages.iter().enumerate() {
        recorder.record(*topic, envelope, bytes).unwrap();
        if (index + 1).is_multiple_of(chunk_every) {
            recorder.flush().unwrap();
        }
    }
    recorder.finish().unwrap();
    Recording::open(&path).unwrap()
}

/// Bytes from a cheap generator: every bit pattern is a valid message.
fn noise(mut seed: u64, bytes: usize) -> Vec<u8> {
    let next = move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 56) as u8
    };
    std::iter::repeat_with(next).take(bytes).collect()
}

fn random_message(description: &Description, seed: u64, elements: usize) -> Vec<u8> {
    let bytes = match &description.element {
        Some(element) if element.size() > 0 => elements_offset(description.size) + elements * element.size(),
        _ => description.size,
    };
    noise(seed, bytes)
}

#[test]
fn every_message_type_comes_back_to_the_byte() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = manifest(catalogue());
    let mut messages = Vec::new();
    for (topic, entry) in manifest.topics.iter().enumerate() {
        for count in [0, 1, 2, 17] {
            let stamp_ns = messages.len() as u64 * 1_000_000;
            let bytes = random_message(&entry.message, stamp_ns + 1, count);
            messages.push((topic, envelope(stamp_ns, messages.len() as u64 + 1), bytes));
        }
    }
    let recording = recorded(folder.path(), &manifest, &messages, 10);
    assert!(recording.is_complete());
    assert_eq!(recording.manifest(), &manifest);
    assert_eq!(read(recording.as_recorded(|_| true)), messages);
    assert_eq!(read(recording.in_order(|_| true)), messages);
    for message in recording.as_recorded(|_| true).map(Result::unwrap) {
        assert_eq!(message.bytes().as_ptr().align_offset(8), 0);
    }
}

#[test]
fn the_whole_envelope_survives() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = manifest(vec![messages::WheelSpeeds::description(), messages::Order::description()]);
    let mut messages: Vec<Plain> = Vec::new();
    for index in 0..40_u64 {
        let envelope = Envelope {
            stamp_ns: u64::MAX - 100 + index,
            origin_ns: index,
            sequence: u64::from(u32::MAX) - 10 + index,
            generation: (index / 7) as u32,
            round: if index % 5 == 0 { u32::MAX } else { 2 },
        };
        messages.push(((index % 2) as usize, envelope, noise(index, 16)));
    }
    for chunk_every in [1, 3, 1000] {
        let recording = recorded(folder.path(), &manifest, &messages, chunk_every);
        assert_eq!(read(recording.as_recorded(|_| true)), messages);
    }
}

#[test]
fn bytes_that_are_no_such_message_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = manifest(vec![messages::Order::description(), messages::Path::description()]);
    let messages: Vec<Plain> = vec![
        (0, envelope(1, 1), noise(1, 15)),
        (0, envelope(2, 2), noise(2, 16)),
        (0, envelope(3, 3), vec![]),
        (1, envelope(4, 1), noise(4, 39)),
        (1, envelope(5, 2), noise(5, 40)),
        (1, envelope(6, 3), noise(6, 41)),
    ];
    let recording = recorded(folder.path(), &manifest, &messages, 100);
    assert_eq!(read(recording.as_recorded(|_| true)), messages);
    assert_eq!(read(recording.in_order(|_| true)), messages);
}

#[test]
fn topics_that_were_drained_one_by_one_come_in_the_order_of_time() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = manifest(vec![messages::Order::description(), messages::WheelSpeeds::description()]);
    let mut messages: Vec<Plain> = Vec::new();
    for block in 0..10_u64 {
        for topic in [1, 0] {
            for index in 0..10_u64 {
                let number = block * 10 + index;
                messages.push((topic, envelope(number * 5 + topic as u64, number + 1), noise(number, 16)));
            }
        }
    }
    let mut sorted = messages.clone();
    sorted.sort_by_key(|(_, envelope, _)| envelope.stamp_ns);
    for chunk_every in [1, 7, 13, 1000] {
        let recording = recorded(folder.path(), &manifest, &messages, chunk_every);
        assert_eq!(read(recording.as_recorded(|_| true)), messages);
        assert_eq!(read(recording.in_order(|_| true)), sorted);
        let one = read(recording.in_order(|topic| topic.name.starts_with("order")));
        assert!(one.len() == 100 && one.iter().all(|(topic, ..)| *topic == 0));
    }
}

#[test]
fn rounds_order_the_messages_of_an_instant() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = manifest(vec![messages::Order::description(), messages::WheelSpeeds::description()]);
    let at = |round, sequence| Envelope { round, ..envelope(5, sequence) };
    let messages = vec![
        (0, at(3, 1), noise(1, 16)),
        (1, at(0, 1), noise(2, 16)),
        (1, at(3, 2), noise(3, 16)),
        (0, at(1, 2), noise(4, 16)),
    ];
    let recording = recorded(folder.path(), &manifest, &messages, 2);
    let order: Vec<(u32, usize)> = read(recording.in_order(|_| true))
        .iter()
        .map(|(topic, envelope, _)| (envelope.round, *topic))
        .collect();
    assert_eq!(order, [(0, 1), (1, 0), (3, 0), (3, 1)]);
}

fn small_recording(folder: &Path) -> (Vec<u8>, Vec<Plain>) {
    let manifest = manifest(vec![messages::Waypoint::description(), messages::Path::description()]);
    let message = |index: u64| {
        let topic = (index % 2) as usize;
        (topic, envelope(index, index), random_message(&manifest.topics[topic].message, index, 2))
    };
    let messages: Vec<Plain> = (0..12).map(message).collect();
    let recording = recorded(folder, &manifest, &messages, 3);
    (std::fs::read(recording.path()).unwrap(), messages)
}

#[test]
fn a_recording_cut_anywhere_is_a_prefix() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, messages) = small_recording(folder.path());
    let cut = folder.path().join("cut.mcap");
    let mut most = 0;
    let mut opened = false;
    for length in 0..=whole.len() {
        std::fs::write(&cut, &whole[..length]).unwrap();
        match Recording::open(&cut) {
            Err(error) => {
                assert!(!opened, "{length}: {error}");
                assert!(matches!(error, RecordingError::NotARecording { .. }), "{error:?}");
            }
            Ok(recording) => {
                opened = true;
                let found = read(recording.as_recorded(|_| true));
                assert_eq!(found, messages[..found.len()]);
                assert!(found.len() >= most && found.len().is_multiple_of(3));
                most = found.len();
            }
        }
    }
    assert_eq!(most, messages.len());
    assert!(Recording::open(&cut).unwrap().is_complete());
}

#[test]
fn a_recorder_that_is_never_finished_has_written_its_closed_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("killed.mcap");
    let mut recorder = Recorder::new(&path, &manifest(vec![messages::Order::description()])).unwrap();
    let add = |recorder: &mut Recorder, sequence| {
        recorder.record(0, &envelope(sequence, sequence), &[1; 16]).unwrap()
    };
    let count = || read(Recording::open(&path).unwrap().as_recorded(|_| true)).len();
    assert_eq!(count(), 0);
    let begin = Time::from_nanos(1_000);
    add(&mut recorder, 1);
    recorder.tick(begin).unwrap();
    recorder.tick(begin.after(Duration::from_millis(500))).unwrap();
    assert_eq!(count(), 0);
    recorder.tick(begin.after(Duration::from_millis(1000))).unwrap();
    assert_eq!(count(), 1);
    add(&mut recorder, 2);
    recorder.tick(begin.after(Duration::from_millis(1100))).unwrap();
    assert_eq!(count(), 1);
    assert!(!Recording::open(&path).unwrap().is_complete());
    // What a kill leaves: no destructor runs.
    std::mem::forget(recorder);
    assert_eq!(count(), 1);
}

#[test]
fn a_topic_that_is_added_is_recorded_from_then_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.mcap");
    let all = manifest(catalogue().into_iter().take(3).collect());
    let first = Manifest { topics: all.topics[..1].to_vec(), ..all.clone() };
    let mut recorder = Recorder::new(&path, &first).unwrap();
    let message = |topic: usize, sequence| {
        let bytes = random_message(&all.topics[topic].message, sequence, 2);
        (topic, envelope(sequence * 10, sequence), bytes)
    };
    let messages = [message(0, 1), message(1, 2), message(0, 3), message(2, 4), message(1, 5)];
    let (mut known, mut lengths) = (1, Vec::new());
    for (topic, envelope, bytes) in &messages {
        while known <= *topic {
            assert_eq!(recorder.add_topic(&all.topics[known]).unwrap(), known);
            known += 1;
        }
        recorder.record(*topic, envelope, bytes).unwrap();
        recorder.flush().unwrap();
        lengths.push(recorder.file_bytes());
    }
    recorder.finish().unwrap();
    let recording = Recording::open(&path).unwrap();
    assert!(recording.is_complete());
    assert_eq!(recording.manifest(), &all);
    assert_eq!(read(recording.in_order(|_| true)), messages);
    // Cut anywhere it holds what was whole until then.
    let bytes = std::fs::read(&path).unwrap();
    for (index, &length) in lengths.iter().enumerate() {
        std::fs::write(&path, &bytes[..length as usize]).unwrap();
        let recording = Recording::open(&path).unwrap();
        assert_eq!(read(recording.as_recorded(|_| true)), messages[..=index]);
        assert_eq!(recording.cut_at().unwrap(), Some(Time::from_nanos((index as u64 + 1) * 10)));
    }
}

#[test]
fn a_recording_is_its_owners() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().unwrap();
    let recording = recorded(folder.path(), &manifest(vec![]), &[], 1);
    assert_eq!(std::fs::metadata(recording.path()).unwrap().permissions().mode() & 0o777, 0o600);
    assert_eq!(recording.cut_at().unwrap(), None);
}

#[test]
fn many_bytes_close_a_chunk() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.mcap");
    let mut recorder = Recorder::new(&path, &manifest(vec![messages::Path::description()])).unwrap();
    for sequence in 0..3 {
        recorder.record(0, &envelope(sequence, sequence), &noise(sequence, 40 + 16 * 50_000)).unwrap();
    }
    assert_eq!(read(Recording::open(&path).unwrap().as_recorded(|_| true)).len(), 2);
    assert_eq!(recorder.counts(), Counts { messages: 3, misfits: 0, bytes: 3 * (40 + 16 * 50_000) });
    assert!(recorder.file_bytes() > 1_000_000);
}

#[test]
fn errors_name_the_file_and_the_cause() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.mcap");
    let check = |error: RecordingError, word: &str| {
        let text = error.to_string();
        assert!(text.contains("mine.mcap") && text.contains(word), "{text}");
    };
    let empty = manifest(vec![]);
    check(Recording::open(&path).unwrap_err(), "No such file");
    let mut recorder = Recorder::new(&path, &empty).unwrap();
    check(recorder.record(0, &Envelope::default(), &[]).unwrap_err(), "no topic 0");
    recorder.note("lost", "3");
    recorder.finish().unwrap();
    check(Recorder::new(&path, &empty).unwrap_err(), "exists");
    let recording = Recording::open(&path).unwrap();
    assert_eq!(recording.manifest().notes["lost"], "3");
    assert_eq!(recording.as_recorded(|_| true).count(), 0);
    std::fs::write(&path, "Once upon a time there was a robot.").unwrap();
    check(Recording::open(&path).unwrap_err(), "does not begin as MCAP does");
    let mut other =
        mcap::Writer::new(std::io::BufWriter::new(std::fs::File::create(&path).unwrap())).unwrap();
    other.finish().unwrap();
    drop(other);
    check(Recording::open(&path).unwrap_err(), "another tool");
    let mut broken = messages::Order::description();
    broken.fields[1].offset = 9;
    let path = folder.path().join("broken-mine.mcap");
    check(
        Recorder::new(&path, &manifest(vec![broken])).unwrap_err(),
        "field `room` of `Order` ends at byte 17",
    );
}

/// Two runs of two topics, of which the second is changed.
fn changed(change: impl FnOnce(&mut Vec<Plain>)) -> Option<Difference> {
    changed_runs(change).0
}

/// The same with the tallies of the topic `tagranges/0`.
fn changed_runs(change: impl FnOnce(&mut Vec<Plain>)) -> (Option<Difference>, TopicComparison) {
    let manifest = manifest(vec![messages::TagRanges::description(), messages::Path::description()]);
    let mut messages: Vec<Plain> = Vec::new();
    for index in 0..20_u64 {
        for topic in 0..2_usize {
            let bytes = random_message(&manifest.topics[topic].message, index, 3);
            messages.push((
                topic,
                Envelope { round: topic as u32, ..envelope(index * 1000, index + 1) },
                bytes,
            ));
        }
    }
    let (first, second) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let a = recorded(first.path(), &manifest, &messages, 7);
    change(&mut messages);
    let b = recorded(second.path(), &manifest, &messages, 9);
    let difference = first_difference(&a, &b).unwrap();
    assert_eq!(difference.is_none(), a.digest().unwrap() == b.digest().unwrap());
    let mut topics = compare_topics(&a, &b, &["tagranges/0".to_owned()]).unwrap();
    (difference, topics.remove(0))
}

/// Same, changed, missing, added, the moment of the first difference, and the first field.
#[track_caller]
fn check_tally(
    change: impl FnOnce(&mut Vec<Plain>),
    counts: [u64; 4],
    first_ns: Option<u64>,
    field: Option<(&str, u64)>,
) {
    let tally = changed_runs(change).1;
    assert_eq!([tally.same, tally.changed, tally.missing, tally.added], counts, "{tally:#?}");
    assert_eq!(tally.recorded, tally.same + tally.changed + tally.missing);
    assert_eq!(tally.rerun, tally.same + tally.changed + tally.added);
    assert_eq!(tally.first.as_ref().map(|first| first.stamp_ns), first_ns, "{tally:#?}");
    let found = tally.fields.first().map(|field| (field.field.as_str(), field.messages));
    assert_eq!(found, field, "{tally:#?}");
}

#[test]
fn runs_are_tallied_topic_by_topic() {
    let set_x = |messages: &mut Vec<Plain>, index: usize, x_m: f64| {
        let fields = messages::TagRanges::description().fields;
        let offset = fields.iter().find(|field| field.name == "x_m").unwrap().offset;
        messages[index].2[offset..offset + 8].copy_from_slice(&x_m.to_le_bytes());
    };
    check_tally(|_| {}, [20, 0, 0, 0], None, None);
    // Another topic is another matter.
    check_tally(|messages| messages[21].2[40 + 16 + 8] ^= 1, [20, 0, 0, 0], None, None);
    check_tally(|messages| messages[8].1.origin_ns += 1, [19, 1, 0, 0], Some(4_000), None);
    // A message that is left out shifts the sequence of the others, which are the same all the same.
    let left_out = |messages: &mut Vec<Plain>| {
        messages.remove(8);
        messages.iter_mut().skip(8).for_each(|(_, envelope, _)| envelope.sequence -= 1);
    };
    check_tally(left_out, [19, 0, 1, 0], Some(4_000), None);
    check_tally(|messages| messages[8].1.stamp_ns += 1, [19, 0, 1, 1], Some(4_000), None);
    check_tally(|messages| messages.truncate(30), [15, 0, 5, 0], Some(15_000), None);
    check_tally(|messages| messages[8].1.round = 7, [19, 0, 1, 1], Some(4_000), None);
    let (mut one, mut other) = (Vec::new(), Vec::new());
    let moved = |by_m: f64, kept: &mut Vec<Plain>| {
        let _ = changed_runs(|messages| {
            set_x(messages, 8, 1.0 + by_m);
            set_x(messages, 12, 2.0 + 2.0 * by_m);
            kept.clone_from(messages);
        });
    };
    moved(0.0, &mut one);
    moved(0.5, &mut other);
    let folder = tempfile::tempdir().unwrap();
    let manifest = manifest(vec![messages::TagRanges::description(), messages::Path::description()]);
    std::fs::create_dir(folder.path().join("b")).unwrap();
    let a = recorded(folder.path(), &manifest, &one, 7);
    let b = recorded(&folder.path().join("b"), &manifest, &other, 7);
    let tally = compare_topics(&a, &b, &["tagranges/0".to_owned()]).unwrap().remove(0);
    let [field] = tally.fields.as_slice() else { panic!("{tally:#?}") };
    assert_eq!((field.field.as_str(), field.unit.as_str(), field.messages), ("x_m", "m", 2));
    assert_eq!((field.mean, field.largest), (0.75, 1.0));
}

#[track_caller]
fn check_difference(
    change: impl FnOnce(&mut Vec<Plain>),
    topic: &str,
    stamp_ns: u64,
    field: &str,
) -> Difference {
    let found = changed(change).unwrap();
    assert_eq!((found.topic.as_str(), found.stamp_ns, found.field.as_str()), (topic, stamp_ns, field));
    found
}

#[test]
fn the_first_difference_is_named() {
    assert_eq!(changed(|_| {}), None);
    // Which start of a service spoke is no difference.
    assert_eq!(
        changed(|messages| messages.iter_mut().for_each(|(_, envelope, _)| envelope.generation = 9)),
        None
    );
    let ranges = messages::TagRanges::description();
    let anchor = ranges.fields.iter().find(|field| field.name == "anchors").unwrap().offset;
    check_difference(
        |messages| messages[20].2[anchor + 2 * 40 + 24] ^= 1,
        "tagranges/0",
        10_000,
        "anchors[2].range_m",
    );
    check_difference(|messages| messages[21].2[40 + 16 + 8] ^= 1, "path/1", 10_000, "elements[1].y_m");
    let shorter = check_difference(|messages| messages[21].2.truncate(40 + 32), "path/1", 10_000, "elements");
    assert_eq!((shorter.a, shorter.b), (3.into(), 2.into()));
    check_difference(|messages| messages[8].1.origin_ns += 1, "tagranges/0", 4_000, "origin_ns");
    check_difference(|messages| messages[8].1.stamp_ns += 1, "tagranges/0", 4_000, "message");
    check_difference(|messages| messages[39].1.stamp_ns += 1, "path/1", 19_000, "stamp_ns");
    check_difference(|messages| messages[39].1.sequence += 1, "path/1", 19_000, "sequence");
    check_difference(|messages| _ = messages.remove(8), "tagranges/0", 4_000, "message");
    check_difference(|messages| _ = messages.pop(), "path/1", 19_000, "message");
    check_difference(|messages| messages.push(messages[0].clone()), "tagranges/0", 0, "message");
    let text = check_difference(|messages| messages[8].1.origin_ns += 1, "tagranges/0", 4_000, "origin_ns")
        .to_string();
    assert_eq!(
        text,
        "`tagranges/0` at 0.000004000 s (round 0, message 5): `origin_ns` is 2000 in the first and 2001 in the second"
    );
}

#[test]
fn a_changed_layout_is_a_difference() {
    let (first, second) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut description = messages::Order::description();
    let a = recorded(first.path(), &manifest(vec![description.clone()]), &[], 1);
    description.fields[1].name = "chamber".into();
    let b = recorded(second.path(), &manifest(vec![description]), &[], 1);
    let difference = first_difference(&a, &b).unwrap().unwrap();
    assert_eq!(difference.field, "layout: field `room` here is `chamber` there");
}

#[test]
fn topics_are_compared_by_name_and_health_is_left_out() {
    let (first, second) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let order = |name: &str| Topic {
        name: name.into(),
        publisher: None,
        depth: 2,
        readers: vec![],
        elements: messages::ELEMENTS,
        message: messages::Order::description(),
    };
    let manifest = |names: &[&str]| Manifest {
        topics: names.iter().map(|name| order(name)).collect(),
        ..Manifest::default()
    };
    let message = |topic, stamp_ns, sequence| (topic, envelope(stamp_ns, sequence), noise(stamp_ns, 16));
    let a = recorded(
        first.path(),
        &manifest(&["x", "y", "health/z"]),
        &[message(0, 5, 1), message(1, 5, 1), message(2, 1, 1)],
        9,
    );
    let b = recorded(
        second.path(),
        &manifest(&["health/z", "y", "w", "x"]),
        &[message(2, 1, 1), message(1, 5, 1), message(3, 5, 1), message(0, 2, 1)],
        9,
    );
    assert_eq!(first_difference(&a, &b).unwrap(), None);
    assert_eq!(first_difference(&b, &a).unwrap(), None);
    let digest = a.digest().unwrap();
    assert_eq!(digest.messages, 2);
    assert_eq!(digest.topics["x"], b.digest().unwrap().topics["x"]);
    assert!(!digest.topics.contains_key("health/z"));
}

/// A description laid out as `#[repr(C)]` would, with padding where its fields demand it.
fn lay_out(name: &str, kinds: Vec<Kind>, element: Option<Kind>) -> Description {
    let mut fields = Vec::new();
    let (mut end, mut alignment) = (0_usize, 1);
    for (index, kind) in kinds.into_iter().enumerate() {
        let align = alignment_of(&kind);
        let offset = end.next_multiple_of(align);
        end = offset + kind.size();
        alignment = alignment.max(align);
        fields.push(FieldDescription {
            name: format!("f{index}"),
            kind,
            offset,
            unit: String::new(),
            doc: String::new(),
        });
    }
    let size = end.next_multiple_of(alignment);
    Description { name: name.into(), doc: String::new(), size, alignment, fields, element }
}

fn alignment_of(kind: &Kind) -> usize {
    match kind {
        Kind::Text { .. } => 1,
        Kind::Array { of, .. } => alignment_of(of),
        Kind::Record(description) => description.alignment,
        number => number.size(),
    }
}

/// Zeroes what belongs to no field.
fn without_padding(description: &Description, raw: &[u8]) -> Vec<u8> {
    fn copy(kind: &Kind, from: &[u8], to: &mut [u8]) {
        match kind {
            Kind::Array { of, .. } if of.size() > 0 => {
                let size = of.size();
                from.chunks(size).zip(to.chunks_mut(size)).for_each(|(from, to)| copy(of, from, to));
            }
            Kind::Record(description) => {
                for field in &description.fields {
                    let range = field.offset..field.offset + field.kind.size();
                    copy(&field.kind, &from[range.clone()], &mut to[range]);
                }
            }
            _ => to.copy_from_slice(from),
        }
    }
    let mut clean = vec![0; raw.len()];
    let size = description.size;
    copy(&Kind::Record(Box::new(description.clone())), &raw[..size], &mut clean[..size]);
    if let Some(element) = &description.element
        && element.size() > 0
    {
        let offset = elements_offset(size);
        let pairs = raw[offset..].chunks(element.size()).zip(clean[offset..].chunks_mut(element.size()));
        pairs.for_each(|(from, to)| copy(element, from, to));
    }
    clean
}

fn any_kind() -> impl Strategy<Value = Kind> {
    let number = prop::sample::select(vec![
        Kind::U8,
        Kind::U16,
        Kind::U32,
        Kind::U64,
        Kind::I8,
        Kind::I16,
        Kind::I32,
        Kind::I64,
        Kind::F32,
        Kind::F64,
        Kind::State { names: vec![(0, "Off".into()), (7, "VeryOn".into())] },
    ]);
    let leaf = prop_oneof![4 => number, 1 => (0..9_usize).prop_map(|capacity| Kind::Text { capacity })];
    leaf.prop_recursive(3, 24, 4, |inner| {
        prop_oneof![
            (inner.clone(), 0..4_usize).prop_map(|(of, count)| Kind::Array { of: Box::new(of), count }),
            prop::collection::vec(inner, 0..4)
                .prop_map(|kinds| Kind::Record(Box::new(lay_out("Inner", kinds, None)))),
        ]
    })
}

fn any_description() -> impl Strategy<Value = Description> {
    (prop::collection::vec(any_kind(), 0..6), prop::option::of(any_kind()))
        .prop_map(|(kinds, element)| lay_out("Any", kinds, element))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn any_message_of_any_type_comes_back(description in any_description(), seed: u64, count in 0..9_usize) {
        let codec = Codec::new(&description).unwrap();
        let raw = without_padding(&description, &random_message(&description, seed, count));
        let (mut cdr, mut back) = (Vec::new(), Vec::new());
        codec.encode(&raw, &mut cdr).unwrap();
        codec.decode(&cdr, &mut back).unwrap();
        prop_assert_eq!(back, raw);
        // Any cut of it is refused.
        for length in 0..cdr.len() {
            prop_assert!(codec.decode(&cdr[..length], &mut Vec::new()).is_err());
        }
        let text = description.ros2msg();
        prop_assert!(text.lines().all(|line| !line.is_empty()));
    }

    #[test]
    fn any_bytes_can_be_recorded_and_any_be_decoded(description in any_description(), bytes in prop::collection::vec(any::<u8>(), 0..100)) {
        let codec = Codec::new(&description).unwrap();
        let mut cdr = Vec::new();
        if codec.encode(&bytes, &mut cdr).is_ok() {
            let mut back = Vec::new();
            codec.decode(&cdr, &mut back).unwrap();
            prop_assert_eq!(without_padding(&description, &bytes), back);
        }
        let _ = codec.decode(&bytes, &mut Vec::new());
        let _ = codec.decode(&[&[0, 1, 0, 0], bytes.as_slice()].concat(), &mut Vec::new());
    }

    #[test]
    fn a_damaged_recording_is_read_as_far_as_it_goes(places in prop::collection::vec((any::<prop::sample::Index>(), 1..=255_u8), 1..4)) {
        let folder = tempfile::tempdir().unwrap();
        let (mut whole, messages) = small_recording(folder.path());
        for (place, bits) in places {
            let place = place.index(whole.len());
            whole[place] ^= bits;
        }
        let path = folder.path().join("damaged.mcap");
        std::fs::write(&path, whole).unwrap();
        if let Ok(recording) = Recording::open(&path) {
            let found = recording.as_recorded(|_| true).filter_map(Result::ok).count();
            prop_assert!(found <= messages.len());
            let _ = recording.in_order(|_| true).count();
            let _ = recording.digest();
        }
    }

    #[test]
    fn any_json_is_no_panic(element_size in 0..3_usize, size: usize, offset: usize, count: usize) {
        let mut description = lay_out("Any", vec![Kind::F64, Kind::Array { of: Box::new(Kind::U16), count: 1 }], None);
        description.fields[1].kind = Kind::Array { of: Box::new(Kind::U16), count };
        description.size = size;
        description.fields[0].offset = offset;
        let inner = Description { size: element_size, fields: vec![], ..description.clone() };
        description.element = Some(Kind::Array { of: Box::new(Kind::Record(Box::new(inner))), count });
        if let Ok(codec) = Codec::new(&description) {
            let _ = codec.encode(&[0; 64], &mut Vec::new());
            let _ = codec.decode(&[&[0, 1, 0, 0][..], &[255; 64]].concat(), &mut Vec::new());
        }
    }
}
