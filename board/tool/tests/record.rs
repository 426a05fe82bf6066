//! `board record` and `board replay` with a board that is up.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use board::host::Host;
use board::manifest::{Manifest, Topic};
use board::tap::Tap;
use messages::{Message as _, Order, Path, WheelSpeeds};
use recording::Recording;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

fn host(name: &str) -> Host {
    let topic = |name: &str, message| Topic {
        name: name.into(),
        publisher: Some("somebody".into()),
        readers: vec![],
        depth: 64,
        elements: 64,
        message,
    };
    let topics = vec![
        topic("wheels/desired", WheelSpeeds::description()),
        topic("plan/path", Path::description()),
        topic("mission/order", Order::description()),
        topic("health/somebody", messages::Health::description()),
    ];
    Host::create(name, Manifest { graph: "test".into(), seed: 5, topics, ..Manifest::default() }, false)
        .unwrap()
}

fn tool(board: &str, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_board"))
        .args(["--board", board, "--json"])
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

#[track_caller]
fn succeeds(child: Child) -> serde_json::Value {
    let Output { status, stdout, stderr } = child.wait_with_output().unwrap();
    assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
    serde_json::from_slice(&stdout).unwrap()
}

fn wait_for(mut condition: impl FnMut() -> bool) {
    let deadline = board::clock::monotonic().after(Duration::from_secs(20));
    while !condition() {
        assert!(board::clock::monotonic() < deadline, "nothing happened for 20 s");
        board::clock::sleep(Duration::from_millis(5));
    }
}

#[test]
fn what_was_recorded_is_replayed_to_the_byte() {
    let name = format!("record-{}", std::process::id());
    let host = host(&name);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let file = file.to_str().unwrap();

    // The file is there when the recorder has begun, and ends when it is asked to.
    let recorder = tool(&name, &["record", "wheels/*", "plan/path", "-o", file]);
    wait_for(|| Recording::open(std::path::Path::new(file)).is_ok());
    let mut tap = Tap::join(host.place().clone(), "test").unwrap();
    let wheels = tap.publisher("wheels/desired").unwrap();
    let path = tap.publisher("plan/path").unwrap();
    wait_for(|| {
        wheels.publish(&[1; 16]).unwrap();
        path.publish(&[2; 40 + 32]).unwrap();
        tap.wait(tap.bell(), Duration::from_millis(20));
        let recording = Recording::open(std::path::Path::new(file)).unwrap();
        let seen = |name: &str| recording.in_order(|topic| topic.name == name).any(|message| message.is_ok());
        seen("wheels/desired") && seen("plan/path")
    });
    wheels.publish(&[3; 16]).unwrap();
    wheels.publish(&[4; 15]).unwrap();
    board::clock::sleep(Duration::from_millis(300));
    rustix::process::kill_process(
        rustix::process::Pid::from_raw(recorder.id() as i32).unwrap(),
        rustix::process::Signal::INT,
    )
    .unwrap();
    let said = succeeds(recorder);
    assert_eq!((&said["misfits"], &said["lost"]), (&1.into(), &serde_json::json!({})));

    let recording = Recording::open(std::path::Path::new(file)).unwrap();
    assert!(recording.is_complete());
    assert_eq!((recording.manifest().graph.as_str(), recording.manifest().seed), ("test", 5));
    assert_eq!(recording.topics().len(), 2);
    let recorded: Vec<(usize, Vec<u8>)> = recording
        .in_order(|_| true)
        .map(|message| message.map(|message| (message.topic, message.bytes().to_vec())).unwrap())
        .collect();
    assert_eq!(said["messages"], recorded.len());
    assert_eq!(recorded.last().unwrap(), &(0, vec![4; 15]));

    // Everything that was on the board comes again, to the byte and in its order.
    drop((wheels, path));
    let mut readers = [tap.reader("wheels/desired").unwrap(), tap.reader("plan/path").unwrap()];
    for reader in &mut readers {
        while reader.next().is_some() {}
    }
    let player = tool(&name, &["replay", file, "--speed", "20"]);
    let mut seen = vec![vec![], vec![]];
    wait_for(|| {
        for (reader, seen) in readers.iter_mut().zip(&mut seen) {
            while let Some((_, bytes)) = reader.next() {
                seen.push(bytes.to_vec());
            }
        }
        seen[0].len() + seen[1].len() >= recorded.len()
    });
    assert_eq!(succeeds(player)["published"], recorded.len());
    for (topic, seen) in seen.iter().enumerate() {
        let expected = recorded.iter().filter(|(of, _)| *of == topic).map(|(_, bytes)| bytes);
        assert!(seen.iter().eq(expected), "topic {topic}");
    }

    let refused = tool(&name, &["record", "-o", file]).wait_with_output().unwrap();
    assert!(!refused.status.success());
    assert!(String::from_utf8_lossy(&refused.stderr).contains("exists; say --force"));
    let unknown = tool(&name, &["replay", file, "--topics", "mission/order"]).wait_with_output().unwrap();
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("has no topic `mission/order`"));
    drop((readers, tap));
    host.take_down().unwrap();
}

#[test]
fn the_recorder_ends_with_the_board() {
    let name = format!("recend-{}", std::process::id());
    let host = host(&name);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let recorder = tool(&name, &["record", "-o", file.to_str().unwrap()]);
    wait_for(|| Recording::open(&file).is_ok());
    board::clock::sleep(Duration::from_millis(200));
    host.take_down().unwrap();
    assert_eq!(succeeds(recorder)["board_went_down"], true);
    let recording = Recording::open(&file).unwrap();
    assert!(
        recording.is_complete() && recording.topics().iter().all(|topic| !topic.name.starts_with("health/"))
    );
}
