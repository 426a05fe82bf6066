use crate::world::{Door, DoorGeometry, World};
use crate::{Point2, Pose2, Segment};
use proptest::prelude::*;

const EXAMPLE: &str = include_str!("../../tests/example-world.toml");

fn example() -> World {
    World::parse(EXAMPLE).expect("the example is right")
}

fn door(room: &str) -> (Door, DoorGeometry) {
    let world = example();
    let door = world.door(room).expect("the example has it").clone();
    let geometry = world.door_geometry(&door).expect("it is on a wall");
    (door, geometry)
}

#[track_caller]
fn refused(text: &str, because: &str) {
    let error = World::parse(text).expect_err("it must be refused").to_string();
    assert!(error.contains(because), "{error:?} does not say {because:?}");
}

#[track_caller]
fn refused_with(entry: &str, because: &str) {
    refused(&format!("{EXAMPLE}\n{entry}"), because);
}

/// The example with one piece of text replaced.
#[track_caller]
fn refused_when(text: &str, replaced: &str, because: &str) {
    assert!(EXAMPLE.contains(text), "{text:?} is not in the example");
    refused(&EXAMPLE.replacen(text, replaced, 1), because);
}

#[track_caller]
fn near(a: Point2<f64>, b: [f64; 2]) {
    assert!((a - Point2::from(b)).norm() < 1e-9, "{a} is not {b:?}");
}

#[test]
fn the_example_says_what_it_says() {
    let world = example();
    assert_eq!(world.floors.len(), 2);
    assert_eq!(world.anchors[0].id, 0x0B1C);
    assert_eq!(world.start("coffee").map(|start| start.pose), Some(Pose2::new(1.0, 0.55, 0.0)));
    assert!(world.start("another").is_none());
    assert_eq!(world.destination("tea counter", 0.5).map(|(floor, _)| floor), Some(2));
    let (floor, pose) = world.destination("313", 0.5).expect("a door");
    assert_eq!(floor, 3);
    near(pose.position(), [4.0, 1.2]);
    assert!((pose.heading_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    assert!(world.destination("nowhere", 0.5).is_none());
    assert_eq!(world.areas_of(2, Some(crate::world::AreaKind::Measure)).count(), 1);
}

#[test]
fn a_world_survives_its_own_text() {
    let text = toml::to_string(&example()).expect("plain data");
    assert_eq!(World::parse(&text).expect("its own text"), example());
}

#[test]
fn files_are_plain_and_bounded() {
    let folder = tempfile::tempdir().expect("a folder");
    let told = |path: &std::path::Path, words: &str| {
        let error = World::load(path).expect_err(words).to_string();
        assert!(error.starts_with("cannot read the world file ") && error.contains(words), "{error}");
    };
    told(std::path::Path::new("/dev/zero"), "this is a device");
    told(folder.path(), "this is a folder");
    let file = folder.path().join("w.toml");
    std::fs::write(&file, vec![b'#'; 3 << 20]).expect("written");
    told(&file, "it has 3 MiB, more than 2 MiB");
    std::fs::write(&file, b"name = \"caf\xe9\"").expect("written");
    told(&file, "line 1, byte 12: the byte 0xe9 is no UTF-8");
    std::fs::write(&file, format!("\u{feff}{EXAMPLE}")).expect("written");
    assert_eq!(World::load(&file).expect("the example"), example());
}

#[test]
fn more_than_any_building_has_is_refused() {
    let floor = "name = \"w\"\n[[floor]]\nnumber = 1\n";
    let many = |count: usize, item: fn(usize) -> String| (0..count).map(item).collect::<String>();
    let walls = |count| format!("{floor}walls = [{}]", many(count, |n| format!("[[0, {n}], [1, {n}]],")));
    assert!(World::parse(&walls(10_000)).is_ok());
    refused(&walls(10_001), "world: 20002 points of walls are more than the 20000 that a world may hold");
    let places = |count| {
        format!(
            "{floor}{}",
            many(count, |n| format!(
                "[[place]]\nname = \"p{n}\"\nfloor = 1\npose = {{ x_m = 0, y_m = 0, heading_rad = 0 }}\n"
            ))
        )
    };
    assert!(World::parse(&places(1000)).is_ok());
    refused(&places(1001), "1001 places are more than the 1000");
    refused(
        &many(1001, |n| format!("[[floor]]\nnumber = {n}\n")).replacen("[[", "name = \"w\"\n[[", 1),
        "1001 floors",
    );
    let corners = many(1001, |n| format!("[{n}, {}],", n % 2));
    refused(
        &format!("{floor}outline = [{corners}]"),
        "floor 1: 1001 corners of an outline are more than the 1000",
    );
    refused_with(
        &format!("[[area]]\nname = \"a\"\nfloor = 2\nkind = \"measure\"\npolygon = [{corners}]"),
        "1001 corners of an area",
    );
    refused_with(
        &format!("[[walker]]\nname = \"w2\"\nfloor = 2\npath = [{corners}]"),
        "1001 points of a path",
    );
}

#[test]
fn what_a_robot_is_to_reach_lies_within_the_outline() {
    let arena = "name = \"a\"\n[[floor]]\nnumber = 0\noutline = [[0, 0], [2, 0], [2, 1], [0, 1]]\n";
    let pose = |x: f64| format!("floor = 0\npose = {{ x_m = {x}, y_m = 0.5, heading_rad = 0 }}\n");
    assert!(World::parse(&format!("{arena}[[start]]\n{}", pose(1.9))).is_ok());
    refused(
        &format!("{arena}[[start]]\n{}", pose(2.1)),
        "line 5: start \"of any robot\": (2.1, 0.5) lies outside of the outline of floor 0",
    );
    refused(
        &format!("{arena}[[place]]\nname = \"p\"\n{}", pose(-0.1)),
        "place \"p\": (-0.1, 0.5) lies outside",
    );
}

#[test]
fn a_door_is_straight_into_the_wall() {
    let (_, left) = door("213");
    near(left.gap.a, [4.0 - 0.455, 1.7]);
    near(left.gap.b, [4.0 + 0.455, 1.7]);
    near(left.leaf.a, [4.0 - 0.455, 1.8]);
    near(left.jambs[1].b, [4.0 + 0.455, 1.8]);
    let (_, right) = door("212");
    near(right.gap.a, [6.0 + 0.455, 0.0]);
    near(right.leaf.b, [6.0 - 0.455, -0.1]);
}

#[test]
fn a_leaf_swings_into_the_room() {
    for room in ["213", "212"] {
        let (_, geometry) = door(room);
        let body = geometry.leaf_body(2.0);
        for fraction in [0.0, 0.3, 1.0] {
            for prism in body.prisms() {
                let shape = prism.shape.transformed(geometry.leaf_pose(fraction));
                let crate::Shape::Polygon(plate) = shape else { panic!("a plate") };
                for corner in plate.corners() {
                    let depth = geometry.into.dot(&(corner - geometry.gap.a));
                    assert!(depth > 0.1 - 1e-9, "{room} at {fraction}: {corner} is {depth} deep");
                }
            }
        }
    }
}

#[test]
fn walls_have_gaps_where_doors_are() {
    let world = example();
    let segments = world.wall_segments(2);
    for opening in world.openings_of(2) {
        let middle = opening.gap.midpoint();
        assert!(segments.iter().all(|wall| wall.distance_m(middle) > 0.1 - 1e-9), "{middle} is walled");
        let beside = opening.gap.at(-0.1);
        assert!(segments.iter().any(|wall| wall.distance_m(beside) < 1e-9), "{beside} is open");
    }
    let gaps: f64 = world.openings_of(2).map(|opening| opening.gap.length_m()).sum();
    let total = |pieces: &[Segment]| pieces.iter().map(Segment::length_m).sum::<f64>();
    let extra: f64 = world.openings_of(2).map(|door| total(&door.jambs) + total(&door.room)).sum();
    let plain: f64 = world.floors[0].segments().map(|wall| wall.length_m()).sum();
    assert!((total(&segments) - (plain - gaps + extra)).abs() < 1e-9);
}

#[test]
fn doors_move_in_time() {
    let (door, _) = door("211");
    let check = |since, fraction: f64| assert!((door.opening_fraction(since) - fraction).abs() < 1e-12);
    check(None, 0.0);
    check(Some(0.75), 0.5);
    check(Some(10.0), 1.0);
    check(Some(10.75), 0.5);
    check(Some(60.0), 0.0);
    let trigger = door.moves.expect("it moves");
    assert!(!trigger.goes_off(4.9, 1.0) && !trigger.goes_off(5.0, 2.0) && trigger.goes_off(5.0, 1.9));
}

#[test]
fn walkers_walk() {
    let walker = example().walkers[0].clone();
    near(walker.pose(-1.0).position(), [18.0, 0.9]);
    near(walker.pose(10.0).position(), [6.0, 0.9]);
    near(walker.pose(15.0).position(), [6.0, 0.9]);
    assert!(walker.pose(10.0).heading_rad.cos() < 0.0 && walker.pose(15.0).heading_rad.cos() > 0.0);
    near(walker.pose(25.0 + 10.0).position(), [6.0, 0.9]);
    let once = crate::world::Walker { course: crate::world::WalkerCourse::Once, ..walker };
    near(once.pose(1000.0).position(), [3.0, 0.9]);
}

#[test]
fn nonsense_is_refused() {
    refused("name = \"x\"", "at least one [[floor]]");
    refused("name = 3", "line 1, column 8");
    refused("name = \"x\"\n[[floor]]\nnumber = 1\ncolour = 3", "line 4, column 1");
    refused("name = \"x\"\n[[floor]]\nnumber = 1\n[[floor]]\nnumber = 1", "line 4: floor 1");
    refused("name = \"x\"\n[[floor]]\nnumber = 1\noutline = [[0,0],[1,1],[1,0],[0,1]]", "edges 0 and 2");
    refused("name = \"x\"\n[[floor]]\nnumber = 1\nwalls = [[[0,0]]]", "at least 2 points");
    refused("name = \"x\"\n[[floor]]\nnumber = 1\nwalls = [[[0,0],[0,0]]]", "no length at point 1");
    refused("name = \"x\"\n[[floor]]\nnumber = 1\nwalls = [[[0,0],[0,nan]]]", "walls = NaN");
    refused_when("at = [4.0, 1.7]", "at = [4.0, 1.5]", "the nearest wall is 0.200 m away");
    refused_when("at = [4.0, 1.7]", "at = [0.2, 1.7]", "door \"213\": no straight wall");
    refused_when("at = [4.0, 1.7]", "at = [2.5, 1.7]", "overlaps that of door \"213\"");
    refused_when("into_room = [0, 1]", "into_room = [0, 0]", "no length");
    refused_when("kind = \"tea-room\"", "kind = \"tearoom\"", "tea-room");
    refused_when("width_m = 0.91\nrecess", "width_m = 0.0\nrecess", "width_m = 0 is not a positive number");
    refused_when("speed_m_s = 1.2", "speed_m_s = inf", "speed_m_s = inf");
    refused_when("floors = [2, 3]", "floors = [2, 4]", "there is no floor 4");
    refused_when("floors = [2, 3]", "floors = []", "floors needs at least 1");
    refused_when("size_m = [0.5, 0.4, 0.6]", "size_m = [0.5, 0.0, 0.6]", "size_m = 0");
    refused_when("kind = \"cardboard-box\"", "kind = \"sofa\"", "only boxes");
    refused_with("[[anchor]]\nid = 0xB1C\nfloor = 2\nx_m = 0.0\ny_m = 0.0\nz_m = 0.0", "already taken");
    refused_with("[[place]]\nname = \"213\"\nfloor = 2\npose = { x_m = 1.0, y_m = 1.0 }", "already taken");
    refused_with("[[area]]\nname = \"a\"\nfloor = 2\nkind = \"goal\"", "either a rectangle or a polygon");
    refused_with("[[start]]\nfloor = 9\npose = { x_m = 1.0, y_m = 1.0 }", "there is no floor 9");
}

#[test]
fn an_unreadable_file_is_named() {
    let error = World::load("/nonexistent/world.toml").expect_err("there is none").to_string();
    assert!(error.contains("/nonexistent/world.toml"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn a_damaged_world_is_read_or_refused(
        at: prop::sample::Index, length in 0..30_usize, with in "[0-9\\-\\[\\]{}=\"#, \na-e.]{0,12}", number: prop::sample::Index,
        value in prop::sample::select(vec!["0.0", "-1.0", "1e9", "1e300", "nan", "inf", "-0.0", "1e-300", "16777216"]),
    ) {
        let mut pieces = vec![EXAMPLE.to_owned(); 2];
        let begin = at.index(EXAMPLE.len());
        if EXAMPLE.is_char_boundary(begin) && EXAMPLE.is_char_boundary((begin + length).min(EXAMPLE.len())) {
            pieces[0].replace_range(begin..(begin + length).min(EXAMPLE.len()), &with);
        }
        let numbers: Vec<_> = EXAMPLE.match_indices(|letter: char| letter.is_ascii_digit()).map(|(at, _)| at).collect();
        let digit = *number.get(&numbers);
        pieces[1].replace_range(digit..digit + 1, value);
        for text in pieces {
            let Ok(world) = World::parse(&text) else { continue };
            for floor in &world.floors {
                let _ = world.wall_segments(floor.number).len() + world.openings_of(floor.number).count();
                let _ = world.scene(floor.number);
            }
        }
    }
}
