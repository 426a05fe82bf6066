//! `board record` and `board replay` with a board that is up.

mod support;

use board::tap::Tap;
use recording::Recording;
use std::time::Duration;
use support::{host, succeeds, tool, wait_for};

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
    assert!(recording.is_complete() && recording.topics().iter().all(|topic| !topic.is_health()));
}
