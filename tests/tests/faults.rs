//! Kill any service while the robot drives: the wheels stand unless GO and command are fresh, the service
//! comes back, the coffee arrives.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on shall stop")]

use board::clock;
use board::tap::TapReader;
use messages::{AppliedWheels, Time};
use std::time::Duration;
use tests::{Graph, Running};

/// Services whose death must stop the wheels, with what they publish: without them there is no fresh GO, no
/// fresh command, or nobody to tell the motors.
const IN_THE_CHAIN: [(&str, &str); 3] = [
    ("collision-avoidance", "safety/clearance"),
    ("controller", "wheels/desired"),
    ("base-driver", "wheels/applied"),
];
const DEADLINE: Duration = Duration::from_millis(100);
const BASE_PERIOD: Duration = Duration::from_millis(20);

/// Waits until the robot really drives.
fn wait_until_driving(graph: &Running) {
    graph.wait_for(
        "wheels/applied",
        |applied| {
            applied["left_mps"].as_f64().unwrap_or(0.0) + applied["right_mps"].as_f64().unwrap_or(0.0) > 0.2
        },
        Duration::from_secs(60),
    );
}

#[test]
fn each_service_may_die_once_and_the_coffee_arrives() {
    let graph = Graph::load("coffee").set("referee.time_limit_s", 300.0).start();
    for role in [
        "collision-avoidance",
        "controller",
        "base-driver",
        "navigator",
        "planner",
        "localiser",
        "tof-driver",
        "tag-driver",
        "angle-correction",
        "door-locator",
        "current-state",
        // No part of the robot; it goes on all the same.
        "simulator",
        "referee",
    ] {
        wait_until_driving(&graph);
        let output = IN_THE_CHAIN.iter().find(|(known, _)| *known == role).map(|(_, topic)| *topic);
        let mut applied = graph.reader("wheels/applied");
        let mut own = graph.reader(output.unwrap_or("wheels/applied"));
        while applied.next().is_some() {}
        let mut generation = 0;
        while let Some((envelope, _)) = own.next() {
            generation = envelope.generation;
        }
        let old = graph.pid(role);
        let died = graph.kill(role);
        if output.is_some() {
            check_wheels_stand(&mut applied, &mut own, generation, role, died);
        }
        let deadline = clock::monotonic().after(Duration::from_secs(10));
        while graph.pid(role) == old {
            assert!(clock::monotonic() < deadline, "`{role}` does not come back:\n{}", graph.output());
            clock::sleep(Duration::from_millis(2));
        }
    }
    let summary =
        graph.wait_for("run/summary", |summary| summary["state"] != "Running", Duration::from_secs(300));
    assert_eq!(summary["state"], "Passed", "{summary:#}\n{}", graph.output());
}

/// From the deadline on nobody tells the wheels to turn, until the successor has spoken.
fn check_wheels_stand(applied: &mut TapReader, own: &mut TapReader, generation: u32, role: &str, died: Time) {
    let mut turning = Vec::new();
    let mut successor = None;
    let end = died.after(Duration::from_millis(400));
    while clock::monotonic() < end {
        while let Some((envelope, bytes)) = applied.next() {
            let Ok(view) = messages::View::<AppliedWheels>::parse(bytes) else { continue };
            if view.message.left_mps != 0.0 || view.message.right_mps != 0.0 {
                turning.push(Time::from_nanos(envelope.stamp_ns));
            }
        }
        while let Some((envelope, _)) = own.next() {
            if envelope.generation > generation {
                successor.get_or_insert(Time::from_nanos(envelope.stamp_ns));
            }
        }
        clock::sleep(Duration::from_millis(1));
    }
    let must_stand = died.after(DEADLINE + BASE_PERIOD);
    let wrong =
        turning.iter().find(|&&stamp| stamp > must_stand && successor.is_none_or(|spoke| stamp < spoke));
    assert!(
        wrong.is_none(),
        "`{role}` died, and the wheels were told to turn {:.1} ms later",
        wrong.map_or(0.0, |stamp| stamp.seconds_since(died) * 1e3)
    );
}

#[test]
fn a_service_that_is_stopped_counts_as_hanging_and_is_started_anew() {
    let graph = Graph::load("coffee").set("navigator.default_order", "").start();
    let old = graph.pid("planner");
    tests::signal(old, "STOP");
    let deadline = clock::monotonic().after(Duration::from_secs(10));
    while graph.pid("planner") == old {
        assert!(clock::monotonic() < deadline, "a stopped service is not noticed:\n{}", graph.output());
        clock::sleep(Duration::from_millis(5));
    }
    assert!(graph.output().contains("planner: hangs"), "{}", graph.output());
}

/// Who forges these decides that the run is over: the referee believes the truth and the mission, and the
/// launcher the referee.
const ENDS_THE_RUN: [&str; 3] = ["mission/status", "world/truth", "run/summary"];

#[test]
fn bad_messages_on_every_topic_crash_nobody() {
    let graph = Graph::load("coffee").set("referee.time_limit_s", 600.0).start();
    wait_until_driving(&graph);
    let topics = board::manifest::Manifest::read(graph.place()).unwrap().topics;
    let (last, first): (Vec<_>, Vec<_>) =
        topics.iter().partition(|topic| ENDS_THE_RUN.contains(&topic.name.as_str()));
    let before: Vec<(String, u32)> = graph.services();
    let mut random = Random(0x5eed);
    for round in 0..30 {
        for topic in &first {
            graph.publish_bytes(&topic.name, &random.message(topic.message.size, round));
        }
        clock::sleep(Duration::from_millis(20));
    }
    let mut applied = graph.reader("wheels/applied");
    clock::sleep(Duration::from_millis(200));
    if let Some(applied) = Running::newest::<AppliedWheels>(&mut applied) {
        assert!(applied.left_mps.abs() <= 0.5 && applied.right_mps.abs() <= 0.5, "{applied:?}");
    }
    assert_eq!(graph.services(), before, "a service died of bad messages:\n{}", graph.output());
    // All at once: what the referee believes may end the run, and the board with it.
    for topic in &last {
        graph.publish_bytes(&topic.name, &random.message(topic.message.size, 0));
    }
    clock::sleep(Duration::from_millis(300));
    let output = graph.output();
    assert!(!output.contains("panicked") && !output.contains("crashed"), "{output}");
}

/// SplitMix64 (Steele, Lea, Flood 2014): the test is the same every time.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// Random bytes, or numbers that nobody wants; of the right length, with elements behind, or of any
    /// length.
    fn message(&mut self, size: usize, round: u64) -> Vec<u8> {
        let length = match round % 3 {
            0 => size,
            1 => size + (self.next() % 200) as usize,
            _ => (self.next() % 300) as usize + 1,
        };
        let unwanted = [f64::NAN.to_bits(), f64::INFINITY.to_bits(), u64::MAX, 0, 1.0e300_f64.to_bits()];
        let word = |random: &mut Self| match round % 2 {
            0 => unwanted[(random.next() % 5) as usize],
            _ => random.next(),
        };
        (0..length.div_ceil(8)).flat_map(|_| word(self).to_le_bytes()).take(length).collect()
    }
}
