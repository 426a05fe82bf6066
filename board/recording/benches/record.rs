//! What recording costs: time a message and bytes a message. `cargo bench -p recording`.
//!
//! 500-byte messages of a drive (slow walks with a sensor's noise), and an hour of a graph like the coffee
//! robot's.
#![expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

use messages::{
    AppliedWheels, Clearance, CurrentState, Description, DriveCommand, Kind, Message as _, MissionStatus,
    Odometry, PoseEstimate, RangeScan, RunSummary, TagRanges, TofRanges, WheelSpeeds, WorldTruth,
    elements_offset,
};
use recording::{Envelope, Manifest, Recorder, Recording, Topic};
use std::hint::black_box;
use std::time::Instant;

/// A message whose numbers walk: every f32 and f64 moves a little or, one in four, stays.
struct Walk {
    description: Description,
    bytes: Vec<u8>,
    seed: u64,
}

impl Walk {
    fn new(description: Description, elements: usize) -> Self {
        let length = match &description.element {
            Some(element) => elements_offset(description.size) + elements * element.size(),
            None => description.size,
        };
        Self { bytes: vec![0; length], seed: description.fingerprint(), description }
    }

    fn random(&mut self) -> u64 {
        self.seed = self.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.seed >> 33
    }

    fn step(&mut self) {
        let fields: Vec<(Kind, usize)> =
            self.description.fields.iter().map(|field| (field.kind.clone(), field.offset)).collect();
        for (index, (kind, offset)) in fields.into_iter().enumerate() {
            if index % 4 != 3 {
                self.walk(&kind, offset);
            }
        }
        if let Some(element) = self.description.element.clone() {
            // Of the bodies in a world few move; of the beams of a scan all do.
            let movers = if element.size() > 8 { 2 } else { usize::MAX };
            let offset = elements_offset(self.description.size);
            let count = (self.bytes.len() - offset) / element.size();
            for index in 0..count.min(movers) {
                self.walk(&element, offset + index * element.size());
            }
        }
    }

    fn walk(&mut self, kind: &Kind, offset: usize) {
        let change = self.random() as f64 / f64::from(u32::MAX) - 0.25;
        match kind {
            Kind::F64 => {
                let place = &mut self.bytes[offset..offset + 8];
                let value = f64::from_le_bytes(place.try_into().unwrap_or_default()) + change * 0.01;
                place.copy_from_slice(&value.to_le_bytes());
            }
            Kind::F32 => {
                let place = &mut self.bytes[offset..offset + 4];
                let value = f32::from_le_bytes(place.try_into().unwrap_or_default()) + change as f32 * 0.01;
                place.copy_from_slice(&value.to_le_bytes());
            }
            Kind::Array { of, count } => {
                (0..*count).for_each(|index| self.walk(of, offset + index * of.size()));
            }
            Kind::Record(record) => {
                record.fields.iter().for_each(|field| self.walk(&field.kind, offset + field.offset));
            }
            _ => {}
        }
    }
}

fn run(title: &str, topics: Vec<(Walk, u64)>, seconds: u64) {
    let topic = |(index, (walk, _)): (usize, &(Walk, u64))| Topic {
        name: format!("t/{index}"),
        publisher: None,
        depth: 16,
        readers: vec![],
        elements: messages::ELEMENTS,
        message: walk.description.clone(),
    };
    let manifest = Manifest { topics: topics.iter().enumerate().map(topic).collect(), ..Manifest::default() };
    // One second of messages after another, prepared before the clock runs.
    let mut topics = topics;
    let path = std::env::temp_dir().join(format!("corkboard-bench-{}.mcap", std::process::id()));
    let _ = std::fs::remove_file(&path);
    let mut recorder = match Recorder::new(&path, &manifest) {
        Ok(recorder) => recorder,
        Err(error) => return println!("{error}"),
    };
    let (mut spent, mut messages, mut bytes) = (0.0, 0_u64, 0_u64);
    for second in 0..seconds {
        let mut prepared = Vec::new();
        for (index, (walk, hz)) in topics.iter_mut().enumerate() {
            for tick in 0..*hz {
                walk.step();
                let stamp_ns = second * 1_000_000_000 + tick * 1_000_000_000 / *hz;
                let sequence = second * *hz + tick + 1;
                let envelope = Envelope {
                    stamp_ns,
                    origin_ns: stamp_ns - stamp_ns % 1000,
                    sequence,
                    generation: 1,
                    round: 1,
                };
                bytes += walk.bytes.len() as u64;
                prepared.push((index, envelope, walk.bytes.clone()));
            }
        }
        prepared.sort_by_key(|(_, envelope, _)| envelope.stamp_ns);
        let begin = Instant::now();
        for (index, envelope, bytes) in &prepared {
            let _ = black_box(recorder.record(*index, envelope, bytes));
        }
        let _ = recorder.flush();
        spent += begin.elapsed().as_secs_f64();
        messages += prepared.len() as u64;
    }
    let _ = recorder.finish();
    let file = std::fs::metadata(&path).map_or(0, |metadata| metadata.len());
    let begin = Instant::now();
    let read = Recording::open(&path)
        .map_or(0, |recording| recording.in_order(|_| true).filter_map(Result::ok).count());
    let reading = begin.elapsed().as_secs_f64();
    let _ = std::fs::remove_file(&path);
    println!(
        "{title}: {messages} messages of {:.0} bytes: {:.2} us and {:.0} bytes each in the file ({:.0} % of memory); an hour {:.0} MB; read back {:.2} us each ({read})",
        bytes as f64 / messages as f64,
        spent / messages as f64 * 1e6,
        file as f64 / messages as f64,
        file as f64 / bytes as f64 * 100.0,
        file as f64 / seconds as f64 * 3600.0 / 1e6,
        reading / messages as f64 * 1e6,
    );
}

fn main() {
    // 384 + 40 + ... bytes: eight anchors make a message of this size.
    let mut near_500 = TagRanges::description();
    near_500.name = "FiveHundred".into();
    let size = near_500.size;
    near_500.fields.push(messages::FieldDescription {
        name: "more".into(),
        kind: Kind::Array { of: Box::new(Kind::F32), count: (504 - size.min(500)) / 4 },
        offset: size,
        unit: String::new(),
        doc: String::new(),
    });
    near_500.size = size + near_500.fields.last().map_or(0, |field| field.kind.size());
    run("500 bytes", vec![(Walk::new(near_500, 0), 5000)], 20);
    let coffee = vec![
        (Walk::new(WorldTruth::description(), 20), 50),
        (Walk::new(Odometry::description(), 0), 50),
        (Walk::new(WheelSpeeds::description(), 0), 50),
        (Walk::new(AppliedWheels::description(), 0), 50),
        (Walk::new(WheelSpeeds::description(), 0), 50),
        (Walk::new(TofRanges::description(), 0), 50),
        (Walk::new(Clearance::description(), 0), 50),
        (Walk::new(DriveCommand::description(), 0), 50),
        (Walk::new(PoseEstimate::description(), 0), 20),
        (Walk::new(CurrentState::description(), 0), 20),
        (Walk::new(TagRanges::description(), 0), 10),
        (Walk::new(RangeScan::description(), 180), 10),
        (Walk::new(MissionStatus::description(), 0), 10),
        (Walk::new(RunSummary::description(), 0), 10),
    ];
    run("coffee-like graph", coffee, 120);
}
