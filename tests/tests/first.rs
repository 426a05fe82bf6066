//! An order sets the robot off; when the driver of its wheels dies, it stands.

use serde_json::json;
use std::time::Duration;
use tests::Graph;

#[test]
fn an_order_sets_the_robot_off() {
    // `launch/graphs/coffee.toml` without an order, in logical time: every run sees the same messages.
    let graph =
        Graph::load("coffee").set("navigator.default_order", "").set("base-driver.launch.restart", false);
    let graph = graph.lockstep(7).start();
    graph.advance(Duration::from_secs(1));
    let wheels = graph.collect("wheels/applied");
    assert!(wheels.iter().all(|(_, wheels)| wheels["left_mps"] == 0.0), "it drives without an order");

    graph.publish("mission/orders", json!({"room": "205"}));
    graph.wait_for("world/truth", |robot| robot["left_mps"].as_f64() > Some(0.3), Duration::from_secs(30));

    let died = graph.kill("base-driver");
    graph.wait_for("world/truth", |robot| robot["left_mps"] == 0.0, Duration::from_secs(1));
    assert!(graph.now().since(died) < Duration::from_millis(600));
}
