use crate::*;
use zerocopy::IntoBytes;

#[track_caller]
fn check_reading(range_m: f32, status: u32, expected: Reading) {
    let mut ranges = TofRanges::default();
    ranges.range_m[3] = range_m;
    ranges.status[3] = RangeStatus(status);
    assert_eq!(ranges.reading(3), expected);
}

#[test]
fn readings_are_judged_by_their_status() {
    check_reading(0.5, 0, Reading::Distance(0.5));
    check_reading(0.5, 6, Reading::Distance(0.5));
    check_reading(0.5, 3, Reading::Distance(0.040));
    check_reading(0.5, 13, Reading::Distance(0.040));
    check_reading(0.010, 0, Reading::Distance(0.040));
    check_reading(0.5, 1, Reading::NoTarget);
    check_reading(0.5, 2, Reading::NoTarget);
    check_reading(0.5, 4, Reading::NoTarget);
    check_reading(0.5, 7, Reading::Ignore);
    check_reading(0.5, 255, Reading::Ignore);
    check_reading(0.5, 5, Reading::Fault);
    check_reading(0.5, 9, Reading::Fault);
    check_reading(0.5, 77, Reading::Fault);
    check_reading(f32::NAN, 0, Reading::Fault);
    check_reading(-1.0, 0, Reading::Fault);
    check_reading(f32::INFINITY, 0, Reading::Fault);
    assert_eq!(TofRanges::default().reading(8), Reading::Fault);
}

#[test]
fn a_message_describes_itself() {
    let description = Odometry::description();
    assert_eq!(description.name, "Odometry");
    assert_eq!(description.size, size_of::<Odometry>());
    let turn = &description.fields[4];
    assert_eq!((turn.name.as_str(), turn.offset, turn.unit.as_str()), ("turn_rad_per_s", 32, "rad/s"));
    assert_eq!(turn.doc, "Turning speed, counter-clockwise.");
}

#[track_caller]
fn check_unit(description: &Description, path: &str, expected: &str) {
    assert_eq!(description.unit_at(path), expected, "{path}");
}

#[test]
fn the_unit_of_a_field_is_found_by_its_path() {
    check_unit(&Odometry::description(), "turn_rad_per_s", "rad/s");
    check_unit(&TagRanges::description(), "anchors[3].range_m", "m");
    check_unit(&TagRanges::description(), "anchors[].range_m", "m");
    check_unit(&WorldTruth::description(), "elements[2].x_m", "m");
    check_unit(&WorldTruth::description(), "elements[].x_m", "m");
    check_unit(&TagRanges::description(), "anchors[3]", "");
    for path in ["", ".", "nothing", "anchors[3].nothing", "turn_rad_per_s.x_m", "elements"] {
        check_unit(&Odometry::description(), path, "");
    }
}

#[test]
fn fields_cover_every_byte() {
    fn covered(description: &Description) -> usize {
        description.fields.iter().map(|field| field.kind.size()).sum()
    }
    for description in [
        Path::description(),
        TagRanges::description(),
        MissionStatus::description(),
        CurrentState::description(),
    ] {
        assert_eq!(covered(&description), description.size, "{}", description.name);
    }
}

#[test]
fn swapped_fields_change_the_fingerprint_and_are_named() {
    let ours = WheelSpeeds::description();
    let mut theirs = ours.clone();
    theirs.fields.swap(0, 1);
    assert_ne!(ours.fingerprint(), theirs.fingerprint());
    assert_eq!(ours.first_difference(&theirs).unwrap(), "field `left_mps` here is `right_mps` there");
    assert_eq!(ours.first_difference(&ours.clone()), None);
    let mut documented = ours.clone();
    documented.doc.push('!');
    assert_eq!(ours.fingerprint(), documented.fingerprint());
}

#[test]
fn json_there_and_back() {
    let order = Order { order_id: 7, room: FixedText::new("207").unwrap() };
    let json = Order::description().to_json(order.as_bytes());
    assert_eq!(json, serde_json::json!({"order_id": 7, "room": "207"}));
    assert_eq!(Order::description().from_json(&json).unwrap(), order.as_bytes());

    let go = serde_json::json!({"signal": "Go", "front_m": "inf"});
    let bytes = Clearance::description().from_json(&go).unwrap();
    let view = View::<Clearance>::parse(&bytes).map(|view| *view.message);
    // A vector of bytes may lie unaligned; then the view says so instead of reading.
    if let Ok(clearance) = view {
        assert_eq!(clearance.signal, Verdict::Go);
        assert_eq!(clearance.front_m, f32::INFINITY);
    }
}

#[test]
fn json_errors_say_what_is_wrong() {
    let description = Order::description();
    let unknown = description.from_json(&serde_json::json!({"rom": "207"})).unwrap_err().to_string();
    assert_eq!(unknown, "`Order` has no field `rom`; it has `order_id`, `room`");
    let long =
        description.from_json(&serde_json::json!({"room": "a room far away"})).unwrap_err().to_string();
    assert!(long.contains("Order.room") && long.contains("at most 8 bytes"), "{long}");
    let state = Clearance::description().from_json(&serde_json::json!({"signal": "Maybe"})).unwrap_err();
    assert!(state.to_string().contains("Stop | Go"), "{state}");
}

#[test]
fn elements_are_read_in_place() {
    let mut words = [0_u64; 8];
    let bytes = words.as_mut_bytes();
    let offset = elements_offset(size_of::<Path>());
    assert_eq!(offset, 40);
    bytes[offset..offset + 8].copy_from_slice(&1.5_f64.to_le_bytes());
    let view = View::<Path>::parse(&bytes[..offset + 16]).unwrap();
    assert_eq!(view.elements, [Waypoint { x_m: 1.5, y_m: 0.0 }]);
    assert!(matches!(View::<Path>::parse(&bytes[..offset + 15]), Err(InvalidMessage::WrongSize { .. })));
    assert!(matches!(View::<Path>::parse(&bytes[..8]), Err(InvalidMessage::WrongSize { .. })));
    assert!(matches!(View::<Order>::parse(&bytes[..17]), Err(InvalidMessage::WrongSize { .. })));
    assert!(matches!(View::<Order>::parse(&bytes[1..17]), Err(InvalidMessage::Misaligned)));
}

proptest::proptest! {
    #[test]
    fn any_bytes_become_json_and_back(bytes in proptest::collection::vec(proptest::num::u8::ANY, 0..400)) {
        for description in [CurrentState::description(), Path::description(), RunSummary::description()] {
            let json = description.to_json(&bytes);
            let _ = description.from_json(&json);
        }
    }

    #[test]
    fn any_text_is_cut_between_characters(text in ".*") {
        let cut = FixedText::<5>::truncated(&text);
        let upto_zero = text.split('\0').next().unwrap();
        proptest::prop_assert!(upto_zero.starts_with(cut.as_str()));
        proptest::prop_assert!(cut.get().is_some());
    }
}

#[test]
fn a_message_is_let_through_once() {
    let zero = AppliedWheels::default();
    let message = |ns, sequence| Stamped { sequence, ..Stamped::new(Time::from_nanos(ns), &zero) };
    let mut once = Once::default();
    assert_eq!(once.last(), None);
    assert!(once.take(message(5, 1)).is_some());
    assert!(once.take(message(5, 1)).is_none());
    // Two within one tick of the clock, and a successor that counts anew, are others.
    assert!(once.is_new(&message(5, 2)));
    assert!(once.take(message(5, 2)).is_some());
    assert!(once.take(message(6, 2)).is_some());
    assert!(once.take(message(5, 1)).is_some(), "only the last one is known");
    assert_eq!(once.last(), Some(message(5, 1).id()));
}
