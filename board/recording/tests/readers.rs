//! What we record, readers that know nothing of us read the same: Python's `mcap-ros2-support` and `rosbags`,
//! for every message type.

use messages::{Description, FieldDescription, Kind, catalogue, elements_offset};
use recording::{Envelope, Manifest, Recorder, Topic};
use std::path::{Path, PathBuf};
use std::process::Command;

const PACKAGES: [&str; 2] = ["mcap-ros2-support", "rosbags"];

/// A Python that has both readers; `None`, with the reason printed, where that cannot be had.
fn python() -> Option<PathBuf> {
    let venv = Path::new(env!("CARGO_TARGET_TMPDIR")).join("readers-venv");
    let python = venv.join("bin/python");
    let run = |command: &mut Command, doing: &str| match command.output() {
        Ok(output) if output.status.success() => true,
        Ok(output) => {
            println!("skipped: {doing} failed: {}", String::from_utf8_lossy(&output.stderr).trim());
            false
        }
        Err(error) => {
            println!("skipped: {doing} failed: {error}");
            false
        }
    };
    let has_readers = || {
        let imports =
            Command::new(&python).args(["-c", "import mcap_ros2.decoder, rosbags.highlevel"]).output();
        imports.is_ok_and(|output| output.status.success())
    };
    if !has_readers() {
        if !run(Command::new("python3").args(["-m", "venv"]).arg(&venv), "python3 -m venv") {
            return None;
        }
        if !run(Command::new(&python).args(["-m", "pip", "install", "--quiet"]).args(PACKAGES), "pip install")
        {
            return None;
        }
    }
    Some(python)
}

fn record(name: &str, kinds: Vec<Kind>, element: Option<Kind>) -> Description {
    let (mut fields, mut offset) = (Vec::new(), 0);
    for (index, kind) in kinds.into_iter().enumerate() {
        let size = kind.size();
        fields.push(FieldDescription {
            name: format!("f{index}"),
            kind,
            offset,
            unit: "m".into(),
            doc: "It # is [so].".into(),
        });
        offset += size;
    }
    Description {
        name: name.into(),
        doc: "Awkward\nto lay out.".into(),
        size: offset,
        alignment: 8,
        fields,
        element,
    }
}

/// Types that no service has today, and that a service of tomorrow may have.
fn awkward() -> Vec<Description> {
    let array = |of: Kind, count| Kind::Array { of: Box::new(of), count };
    let text = |capacity| Kind::Text { capacity };
    let state = Kind::State { names: vec![(0, "Off".into()), (3, "VeryOn".into()), (9, "I2C".into())] };
    // Its first number needs less alignment than its last: elements do not lie in CDR as they do in memory.
    let pair = |name: &str| Kind::Record(Box::new(record(name, vec![Kind::U32, Kind::U32, Kind::F64], None)));
    vec![
        record("FourThenElements", vec![Kind::U32], Some(Kind::F64)),
        record("ElementsAlone", vec![], Some(pair("PairA"))),
        record("Pairs", vec![Kind::F64, Kind::U64], Some(pair("PairB"))),
        record("PairsAfterFour", vec![Kind::F64, Kind::U32], Some(pair("PairC"))),
        record("Image", vec![Kind::U32, Kind::U32, Kind::U32], Some(Kind::U8)),
        record("Shorts", vec![Kind::U16, Kind::I16, Kind::U8, Kind::I8], Some(Kind::I16)),
        record("Texts", vec![array(text(5), 3), text(1)], Some(text(7))),
        record(
            "Matrix",
            vec![array(array(Kind::F32, 3), 2), array(state.clone(), 2)],
            Some(array(Kind::F64, 2)),
        ),
        record("Nested", vec![array(pair("PairD"), 2), pair("PairD"), array(Kind::U8, 8)], Some(state)),
        record("Nothing", vec![], None),
        record("NothingMuch", vec![array(Kind::U8, 0), Kind::U8], Some(Kind::Text { capacity: 0 })),
    ]
}

fn bytes(description: &Description, elements: usize, mut seed: u64) -> Vec<u8> {
    let length = match &description.element {
        Some(element) if element.size() > 0 => elements_offset(description.size) + elements * element.size(),
        _ => description.size,
    };
    let next = move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 56) as u8
    };
    std::iter::repeat_with(next).take(length).collect()
}

#[test]
fn python_reads_every_message_type() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let descriptions: Vec<Description> = catalogue().into_iter().chain(awkward()).collect();
    let topic = |message: &Description| Topic {
        name: format!("test/{}", message.name.to_lowercase()),
        publisher: None,
        depth: 4,
        readers: vec![],
        elements: messages::ELEMENTS,
        message: message.clone(),
    };
    let manifest = Manifest {
        graph: "test".into(),
        topics: descriptions.iter().map(topic).collect(),
        ..Manifest::default()
    };
    let path = folder.path().join("all.mcap");
    let mut recorder = Recorder::new(&path, &manifest).unwrap();
    let mut expected = serde_json::Map::new();
    for (index, topic) in manifest.topics.iter().enumerate() {
        let mut messages = Vec::new();
        for (sequence, elements) in (1_u64..).zip([0, 1, 2, 5, 30]) {
            let stamp_ns = 1_000_000 * (sequence * 100 + index as u64);
            let envelope = Envelope { stamp_ns, origin_ns: stamp_ns - 77, sequence, generation: 3, round: 1 };
            let bytes = bytes(&topic.message, elements, stamp_ns);
            recorder.record(index, &envelope, &bytes).unwrap();
            messages.push(serde_json::json!({
                "stamp_ns": stamp_ns, "origin_ns": stamp_ns - 77, "sequence": sequence, "bytes": bytes,
            }));
        }
        if index % 4 == 0 {
            recorder.flush().unwrap();
        }
        let entry = serde_json::json!({"description": topic.message, "messages": messages});
        expected.insert(format!("/{}", topic.name), entry);
    }
    assert_eq!(recorder.counts().misfits, 0);
    recorder.finish().unwrap();
    let sidecar = folder.path().join("expected.json");
    std::fs::write(&sidecar, serde_json::to_vec(&expected).unwrap()).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/readers.py");
    let output = Command::new(python).arg(script).arg(&path).arg(&sidecar).output().unwrap();
    println!("{}", String::from_utf8_lossy(&output.stdout).trim());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
