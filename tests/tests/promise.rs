//! The README's promise, in logical time: what the wheels are told, and what the rims do, when somebody dies
//! or hangs.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on shall stop")]

use std::path::Path;
use std::time::Duration;
use tests::{Graph, Running};

/// Somebody is hurt for so long: a little less than after which one that hangs is replaced.
const HURT_S: f64 = 0.9;
/// Between a command and what the encoders show of it.
const SEEN_S: f64 = 0.06;

/// The motors of both robots brake at least so hard.
const BRAKES_M_PER_S2: f64 = 0.6;

/// The graph, driving, in which `role` is hurt at a moment at which the wheels surely turn.
fn hurt(graph: &str, deed: &str, role: &str, at_s: f64, folder: &Path) -> Running {
    let length = if deed == "kill" { "down_s" } else { "for_s" };
    let text = format!(
        "[graph]\nname = \"hurt\"\ninclude = [{graph:?}]\n\n[[fault]]\nat_s = {at_s}\n{deed} = {role:?}\n{length} = {HURT_S}\n"
    );
    let file = folder.join("hurt.toml");
    std::fs::write(&file, text).unwrap();
    let graph = Graph::load(&file.to_string_lossy()).lockstep(1).start();
    graph.advance(Duration::from_secs_f64(at_s + HURT_S));
    graph
}

/// Speed of the faster wheel at each moment.
fn speeds(graph: &Running, topic: &str) -> Vec<(f64, f64)> {
    let speed = |message: &serde_json::Value| {
        let of = |wheel: &str| message[wheel].as_f64().unwrap().abs();
        of("left_mps").max(of("right_mps"))
    };
    graph
        .collect(topic)
        .iter()
        .map(|(stamp, message)| (stamp.as_nanos() as f64 * 1e-9, speed(message)))
        .collect()
}

/// A moment in whose middle the wheels turn for a while: the same in every run with this seed, up to the
/// wound.
fn drives_at(graph: &str) -> f64 {
    let running = Graph::load(graph).lockstep(1).start();
    running.advance(Duration::from_secs(14));
    let told = speeds(&running, "wheels/applied");
    let fastest = told.iter().map(|(_, speed)| *speed).fold(0.0, f64::max);
    let mut since_s = None;
    for (stamp_s, speed) in told {
        if speed < 0.5 * fastest {
            since_s = None;
        }
        let begun_s = *since_s.get_or_insert(stamp_s);
        if stamp_s - begun_s > 0.8 {
            return begun_s + 0.4;
        }
    }
    f64::NAN
}

/// `told_s` after the wound, and not much sooner than the wound, nobody tells the wheels to turn.
#[track_caller]
fn check_told(graph: &str, roles: &[&str], told_s: f64) {
    let at_s = drives_at(graph);
    for (role, deed) in roles.iter().flat_map(|role| ["stop", "kill"].map(|deed| (*role, deed))) {
        let folder = tempfile::tempdir().unwrap();
        let running = hurt(graph, deed, role, at_s, folder.path());
        let told = speeds(&running, "wheels/applied");
        let just_before = told.iter().rfind(|(stamp_s, _)| *stamp_s < at_s).unwrap();
        assert!(just_before.1 > 0.01, "{deed} {role}: the robot stands at {at_s} s");
        let late = told.iter().find(|(stamp_s, speed)| {
            // An instant after: the clock of logical time goes in steps.
            (at_s + told_s + 1e-6..at_s + HURT_S).contains(stamp_s) && *speed > 0.0
        });
        assert_eq!(late, None, "{deed} {role}");
        let rims = speeds(&running, "world/truth");
        let stands_s = at_s + told_s + SEEN_S + just_before.1 / BRAKES_M_PER_S2;
        let turning =
            rims.iter().find(|(stamp_s, speed)| (stands_s..at_s + HURT_S).contains(stamp_s) && *speed > 0.0);
        assert_eq!(turning, None, "{deed} {role}: the rims");
    }
}

#[test]
fn guard_and_controller_are_missed_within_their_deadlines() {
    check_told("coffee", &["collision-avoidance", "controller"], 0.120);
    check_told("nxt", &["proximity-guard", "controller"], 0.120);
}

#[test]
fn range_drivers_are_missed_within_200_ms() {
    check_told("coffee", &["tof-driver"], 0.200);
    check_told("nxt", &["ultrasonic-driver"], 0.200);
}

#[test]
fn the_motors_stop_by_themselves_when_their_driver_is_gone() {
    for graph in ["coffee", "nxt"] {
        let at_s = drives_at(graph);
        for deed in ["stop", "kill"] {
            let folder = tempfile::tempdir().unwrap();
            let running = hurt(graph, deed, "base-driver", at_s, folder.path());
            let rims = speeds(&running, "world/truth");
            let just_before = rims.iter().rfind(|(stamp_s, _)| *stamp_s < at_s).unwrap().1;
            assert!(just_before > 0.01, "{deed}: the robot stands at {at_s} s");
            let stands_s = at_s + 0.1 + SEEN_S + just_before / BRAKES_M_PER_S2;
            let turning = rims
                .iter()
                .find(|(stamp_s, speed)| (stands_s..at_s + HURT_S).contains(stamp_s) && *speed > 0.0);
            assert_eq!(turning, None, "{graph} {deed}");
        }
    }
}
