//! What typed ports promise.

use crate::robot::{Robot, await_message, wait_for};
use crate::services::{Count, PICTURE_BYTES, Seen};
use board::tap::TapPublisher;
use messages::health_topic;
use messages::{Health, elements_offset};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use std::sync::atomic::Ordering;
use zerocopy::IntoBytes as _;

fn publish(publisher: &TapPublisher, number: u64) {
    publisher.publish(Count { number, twice: 2 * number }.as_bytes()).expect("memory for a message");
}

pub(crate) fn a_late_reader_gets_the_last_message() {
    let mut robot = Robot::new(&[("count", "counter"), ("relayed", "relay")]);
    // One message at the start, and no other for an hour.
    robot.start_with("counter", r#"{"period_us": 3600000000}"#);
    let (_, entry) = (0, robot.host.switchboard().topic(0).unwrap());
    wait_for("the first message", || entry.count.load(Ordering::Acquire) == 1);
    let tap = robot.tap();
    let mut late = tap.reader("count").unwrap();
    assert_eq!(await_message::<Count>(&tap, &mut late, |_, _| true).number, 1);
    // A typed one as well: the relay has not seen the message when it was published.
    let mut relayed = tap.reader("relayed").unwrap();
    robot.start("relay");
    assert_eq!(await_message::<Count>(&tap, &mut relayed, |_, _| true).number, 1);
    drop(tap);
    robot.take_down();
}

pub(crate) fn every_message_wakes_the_reader() {
    let mut robot = Robot::new(&[("relayed", "relay")]);
    robot.start("relay");
    let mut tap = robot.tap();
    let count = tap.publisher("count").unwrap();
    let mut relayed = tap.reader("relayed").unwrap();
    // One at a time: a wake-up that is lost leaves the relay asleep, and the answer comes a heartbeat late at
    // best.
    for number in 1..=20_000 {
        publish(&count, number);
        await_message::<Count>(&tap, &mut relayed, |_, message| message.number == number);
    }
    drop((count, relayed, tap));
    robot.take_down();
}

pub(crate) fn a_queue_keeps_every_message() {
    let mut robot = Robot::new(&[("seen", "collector")]);
    robot.start("collector");
    let mut tap = robot.tap();
    let count = tap.publisher("count").unwrap();
    let mut seen = tap.reader("seen").unwrap();
    // In bursts that the queue has room for.
    for burst in 1..=200_u64 {
        (1..=50).for_each(|number| publish(&count, (burst - 1) * 50 + number));
        let so_far = await_message::<Seen>(&tap, &mut seen, |_, seen| seen.number == burst * 50);
        assert_eq!((so_far.messages, so_far.damaged), (burst * 50, 0));
    }
    drop((count, seen, tap));
    robot.take_down();
}

pub(crate) fn a_queue_counts_what_overflow_swallows() {
    let mut robot = Robot::new(&[]);
    // It looks at its queue of 64 after the first step only an hour later, or when it is asked to leave.
    let mut tap = robot.tap();
    let mut health = tap.reader(&health_topic("slow-collector")).unwrap();
    let count = tap.publisher("count").unwrap();
    let slot = robot.start_with("slow-collector", r#"{"period_us": 1500000}"#);
    let steps = || robot.host.switchboard().slot(slot).unwrap().steps.load(Ordering::Relaxed);
    wait_for("the first step", || steps() >= 1);
    let before = steps();
    (1..=500).for_each(|number| publish(&count, number));
    // The gap shows between two messages, so the collector has to have seen one before.
    wait_for("a step after them", || steps() > before);
    (501..=1000).for_each(|number| publish(&count, number));
    let lost = await_message::<Health>(&tap, &mut health, |_, health| health.lost_messages > 0).lost_messages;
    assert!((400..=1000).contains(&lost), "{lost} lost of 1000 through a queue of 64");
    drop((count, health, tap));
    robot.take_down();
}

pub(crate) fn another_layout_is_refused_by_the_field() {
    let robot = Robot::new(&[]);
    let error = robot.refused("other-layout");
    assert!(error.contains("topic `count`: field `thrice` here is `twice` there"), "{error}");
    robot.take_down();
}

pub(crate) fn a_second_publisher_is_refused() {
    let robot = Robot::new(&[("count", "counter")]);
    let error = robot.refused("usurper");
    assert!(
        error.contains("`count` is published by `counter`") && error.contains("`usurper` is refused"),
        "{error}"
    );
    robot.take_down();
}

pub(crate) fn a_large_message_is_read_where_it_was_written() {
    let mut robot = Robot::new(&[("picture", "painter"), ("seen", "viewer")]);
    robot.start("viewer");
    robot.start("painter");
    let mut tap = robot.tap();
    let count = tap.publisher("count").unwrap();
    let mut seen = tap.reader("seen").unwrap();
    let mut pictures = tap.reader("picture").unwrap();
    for number in 1..=20 {
        publish(&count, number);
        let so_far = await_message::<Seen>(&tap, &mut seen, |_, seen| seen.number == number);
        assert_eq!((so_far.damaged, so_far.copied), (0, 0));
        let mut bytes = 0;
        while let Some((_, picture)) = pictures.next() {
            bytes = picture.len();
        }
        assert_eq!(bytes, elements_offset(24) + PICTURE_BYTES);
    }
    drop((count, seen, pictures, tap));
    robot.take_down();
}

pub(crate) fn a_stamp_from_the_future_does_not_count() {
    // A lockstep clock is whatever its page says: a tap on it can publish with any stamp, and a live service
    // is told that the time is now.
    let mut robot = Robot::new(&[("relayed", "relay")]);
    robot.start("relay");
    let mut tap = robot.tap();
    let count = tap.publisher("count").unwrap();
    let mut relayed = tap.reader("relayed").unwrap();
    let header = robot.host.switchboard().header();
    publish(&count, 1);
    await_message::<Count>(&tap, &mut relayed, |_, message| message.number == 1);
    header.logical_ns.store(u64::MAX / 2, Ordering::Release);
    header.lockstep.store(1, Ordering::Release);
    publish(&count, 2);
    header.lockstep.store(0, Ordering::Release);
    publish(&count, 3);
    let next = await_message::<Count>(&tap, &mut relayed, |_, message| message.number != 1);
    assert_eq!(next.number, 3);
    drop((count, relayed, tap));
    robot.take_down();
}

pub(crate) fn random_bytes_are_survived() {
    let mut robot = Robot::new(&[("seen", "gullible")]);
    robot.start("gullible");
    let mut tap = robot.tap();
    let publishers = ["count", "picture", "scan", "ranges"].map(|topic| tap.publisher(topic).unwrap());
    let mut seen = tap.reader("seen").unwrap();
    let mut runner = TestRunner::new(Config { cases: 2000, failure_persistence: None, ..Config::default() });
    // The right length more often than not, or hardly anything would get past the first check.
    let right = [16, 24, 48, size_of::<messages::TofRanges>()];
    let lengths = prop_oneof![Just(None), Just(None), (1..400_usize).prop_map(Some)];
    let strategy = (0..4_usize, lengths, 0..64_usize, any::<u64>());
    runner
        .run(&strategy, |(which, length, elements, seed)| {
            let more = [0, elements, 4 * elements, 0][which];
            let length = length.unwrap_or(right[which] + more);
            let mut state = seed | 1;
            let bytes: Vec<u8> = (0..length)
                .map(|_| {
                    state ^= state << 13;
                    state ^= state >> 7;
                    state ^= state << 17;
                    // Zeros, ones and NaNs among them.
                    if seed % 3 == 0 { 0xff } else { (state >> 32) as u8 }
                })
                .collect();
            publishers[which].publish(&bytes).expect("memory for a message");
            Ok(())
        })
        .unwrap();
    // It is still there, and still reads what is right.
    publish(&publishers[0], 424_242);
    await_message::<Seen>(&tap, &mut seen, |_, seen| seen.number == 424_242);
    let mut health = tap.reader(&health_topic("gullible")).unwrap();
    let health = await_message::<Health>(&tap, &mut health, |_, health| health.invalid_messages > 0);
    assert!(health.steps > 0);
    drop((publishers, seen, tap));
    robot.take_down();
}

pub(crate) fn every_service_publishes_its_health() {
    let mut robot = Robot::new(&[]);
    let tap = robot.tap();
    let mut reader = tap.reader(&health_topic("slow-collector")).unwrap();
    robot.start("slow-collector");
    let health = await_message::<Health>(&tap, &mut reader, |_, health| health.steps > 10);
    assert!(health.pid != 0 && health.pid != std::process::id());
    assert!(health.step_p50_ns <= health.step_max_ns);
    drop((reader, tap));
    robot.take_down();
}

pub(crate) fn what_a_service_is_needs_no_data() {
    let ask = |parameters: &str| {
        let mut command = std::process::Command::new(std::env::current_exe().unwrap());
        command.env(crate::services::WHICH, "laden").args(["--interface", "--params", parameters]);
        command.output().unwrap()
    };
    // Its map would break the start, and is not looked at.
    let answer = ask(r#"{"period_us": 60}"#);
    assert!(answer.status.success(), "{}", String::from_utf8_lossy(&answer.stderr));
    let interface: board::Interface = serde_json::from_slice(&answer.stdout).unwrap();
    assert_eq!((interface.ports.len(), interface.period_ns), (1, Some(60_000)));
    // What is wrong before the ports are declared is still refused.
    let answer = ask(r#"{"period_us": 0}"#);
    assert_eq!(answer.status.code(), Some(i32::from(board::EXIT_SETUP)));
    assert!(String::from_utf8_lossy(&answer.stderr).contains("period_us = 0"));
    // On a board the map is read.
    let mut robot = Robot::new(&[("count", "laden")]);
    robot.start_with("laden", r#"{"period_us": 1100}"#);
    let tap = robot.tap();
    let mut count = tap.reader("count").unwrap();
    assert_eq!(await_message::<Count>(&tap, &mut count, |_, _| true).number, 1000);
    drop((count, tap));
    robot.take_down();
}
