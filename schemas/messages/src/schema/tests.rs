use super::*;
use crate::Parameters;
use proptest::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
struct Params {
    #[schemars(range(min = 0.1, max = 4.0))]
    reach_m: f64,
    #[schemars(range(min = 1))]
    frames: u32,
    #[schemars(length(max = 2))]
    gains: Vec<f64>,
    start: Option<Start>,
    noise: Noise,
    mode: Mode,
    names: Vec<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Start {
    #[schemars(range(min = -10.0, max = 10.0))]
    x_m: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
struct Noise {
    #[schemars(range(min = 0.0, max = 1.0))]
    share: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum Mode {
    /// This.
    Fast,
    /// That.
    Slow,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            reach_m: 1.5,
            frames: 1,
            gains: vec![],
            start: None,
            noise: Noise { share: 0.5 },
            mode: Mode::Fast,
            names: vec![],
        }
    }
}

impl Parameters for Params {
    type Error = Misfit;
}

#[track_caller]
fn refused(change: impl FnOnce(&mut Params), words: &str) {
    let mut params = Params::default();
    change(&mut params);
    assert_eq!(params.check().unwrap_err().to_string(), words);
}

#[test]
fn a_service_checks_its_ranges_by_its_schema() {
    assert_eq!(Params::default().check(), Ok(()));
    refused(
        |params| params.reach_m = 7.0,
        "`reach_m` is 7.0 m, which is out of range: it must be from 0.1 to 4 m; the default is 1.5",
    );
    refused(
        |params| params.reach_m = f64::NAN,
        "`reach_m` is not a finite number: it must be from 0.1 to 4 m; the default is 1.5",
    );
    refused(
        |params| params.frames = 0,
        "`frames` is 0, which is out of range: it must be at least 1; the default is 1",
    );
    refused(|params| params.gains = vec![0.0; 3], "`gains` takes 0 to 2 values, not 3: the default is []");
    refused(
        |params| params.gains = vec![0.0, f64::INFINITY],
        "`gains[1]` is not a finite number: it must be a number",
    );
    refused(
        |params| params.start = Some(Start { x_m: -11.0 }),
        "`start.x_m` is -11.0 m, which is out of range: it must be from -10 to 10 m",
    );
    refused(
        |params| params.noise.share = 1.5,
        "`noise.share` is 1.5, which is out of range: it must be from 0 to 1",
    );
}

#[track_caller]
fn misfit(key: &str, value: Value, words: &[&str]) {
    let (schema, defaults) =
        (schemars::schema_for!(Params), serde_json::to_value(Params::default()).unwrap());
    let schema = Schema { root: schema.as_value(), defaults: &defaults };
    let found: Vec<_> = schema.misfits(key, &value).iter().map(|misfit| misfit.what(" of `guard`")).collect();
    assert_eq!(found, words);
}

#[test]
fn types_choices_names_and_lengths_are_checked_wherever_they_stand() {
    misfit("reach_m", json!(2), &[]);
    misfit("reach_m", json!("2"), &["`reach_m` of `guard` takes a number, not a text"]);
    misfit("frames", json!(1.5), &["`frames` of `guard` takes an integer, not a fraction"]);
    misfit("mode", json!("slow"), &[]);
    misfit("mode", json!("slwo"), &["`mode` of `guard` cannot be \"slwo\""]);
    misfit("mode", json!(3), &["`mode` of `guard` takes one of \"fast\", \"slow\", not an integer"]);
    misfit("start", json!({ "x_m": 3.0 }), &[]);
    misfit("start", json!({}), &["`start` of `guard` lacks `x_m`"]);
    misfit("start", json!({ "x_m": 3.0, "y_m": 3.0 }), &["there is no parameter `start.y_m` of `guard`"]);
    misfit("names", json!(["a", 1]), &["`names[1]` of `guard` takes a text, not an integer"]);
    misfit("gains", json!(["a", 1]), &["`gains[0]` of `guard` takes a number, not a text"]);
    misfit("gain", json!(1), &["there is no parameter `gain` of `guard`"]);
}

#[test]
fn a_schema_that_points_in_circles_is_left() {
    let root = json!({ "properties": { "a": { "$ref": "#/properties/a" } } });
    assert_eq!(Schema { root: &root, defaults: &Value::Null }.misfits("a", &json!(1)), []);
}

proptest! {
    /// A value that was read by serde, and keeps the range, has no misfit; one that does not has one.
    #[test]
    fn a_range_is_kept_or_not(reach_m in prop_oneof![0.0..5.0, Just(0.1), Just(4.0), any::<f64>()], frames in any::<u32>()) {
        let params = Params { reach_m, frames, ..Params::default() };
        prop_assert_eq!(params.check().is_ok(), (0.1..=4.0).contains(&reach_m) && frames >= 1);
    }
}
