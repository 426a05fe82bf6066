use crate::{
    Cell, Grid, GridFrame, MapHeader, MapImage, MapMode, MapProblem, Occupancy, OccupancyGrid, Pose2,
};
use proptest::prelude::*;
use std::path::Path;

const GOOD: &str = "image: map.pgm\nresolution: 0.05\norigin: [-10.0, 2, 0.5]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";

#[track_caller]
fn refused(text: &str, because: &str) {
    let error = MapHeader::parse(text).expect_err("it must be refused").to_string();
    assert!(error.contains(because), "{error:?} does not say {because:?}");
}

#[track_caller]
fn refused_when(text: &str, replaced: &str, because: &str) {
    assert!(GOOD.contains(text));
    refused(&GOOD.replacen(text, replaced, 1), because);
}

#[track_caller]
fn same_when(text: &str, replaced: &str) {
    assert!(GOOD.contains(text));
    let header = MapHeader::parse(&GOOD.replacen(text, replaced, 1)).expect("it is good");
    assert_eq!(header, MapHeader::parse(GOOD).expect("it is good"));
}

#[test]
fn headers_are_read_in_every_usual_dress() {
    let header = MapHeader::parse(GOOD).expect("it is good");
    assert_eq!(header.origin, Pose2::new(-10.0, 2.0, 0.5));
    assert_eq!((header.mode, header.negate), (MapMode::Trinary, false));
    same_when("map.pgm", "\"map.pgm\"  # the picture");
    same_when("map.pgm", "'map.pgm'\nmode: Trinary\nmap_type: occupancy");
    same_when("image:", "---\n# saved\n\nimage:");
    same_when("[-10.0, 2, 0.5]", "\n  - -10.0\n  - 2\n  - 5e-1");
    same_when("[-10.0, 2, 0.5]", "\n- -10\n- 2.0\n- 0.5\n");
    same_when("[-10.0, 2, 0.5]", "[ -10.0,   # x\n  2,\n  0.5 ]");
    same_when("negate: 0", "negate: false");
    same_when("negate: 0\n", "");
    same_when("\n", "\r\n");
    let hash = MapHeader::parse(&GOOD.replace("map.pgm", "a#b \\c's.pgm")).expect("it is good");
    assert_eq!(hash.image, Path::new("a#b \\c's.pgm"));
    let raw = "image: m.png\nmode: raw\nresolution: 1\norigin: [0, 0, 0]";
    assert_eq!(MapHeader::parse(raw).expect("no thresholds needed").mode, MapMode::Raw);
}

#[test]
fn broken_headers_are_refused() {
    refused("", "`resolution` is missing");
    refused_when("image: map.pgm\n", "", "`image` is missing");
    refused_when("resolution: 0.05\n", "", "`resolution` is missing");
    refused_when("origin: [-10.0, 2, 0.5]\n", "", "`origin` is missing");
    refused_when("occupied_thresh: 0.65\n", "", "`occupied_thresh` is missing");
    refused_when("0.05", "0.0", "line 2: resolution: \"0.0\" is not a positive number");
    refused_when("0.05", "-1", "positive");
    refused_when("0.05", ".nan", "positive");
    refused_when("0.05", "inf", "positive");
    refused_when("0.05", "5 cm", "positive");
    refused_when("[-10.0, 2, 0.5]", "[-10.0, 2]", "three finite numbers");
    refused_when("[-10.0, 2, 0.5]", "[-10.0, 2, x]", "three finite numbers");
    refused_when("[-10.0, 2, 0.5]", "7", "three finite numbers");
    refused_when("[-10.0, 2, 0.5]", "[1, 2, 3", "without its closing bracket");
    refused_when("0.65", "1.5", "occupied_thresh: \"1.5\"");
    refused_when("0.196", "0.7", "free_thresh 0.7 is above occupied_thresh 0.65");
    refused_when("negate: 0", "negate: 2", "0 or 1");
    refused_when("negate: 0", "mode: quaternary", "trinary, scale or raw");
    refused_when("negate: 0", "image: b.pgm", "line 4: image is given twice");
    refused_when("negate: 0", "negate", "line 4: this is not `key: value`");
    refused_when("negate: 0", "  negate: 0", "indented");
    refused_when("map.pgm", "\"map.pgm", "no closing quote");
    refused_when("map.pgm", "", "image: \"[]\"");
}

#[test]
fn pixels_mean_what_the_map_servers_say() {
    let header = |mode, negate| MapHeader { mode, negate, ..MapHeader::parse(GOOD).expect("it is good") };
    let check = |mode, negate, pixel: u8, expected: Occupancy| {
        assert_eq!(
            header(mode, negate).occupancy(f64::from(pixel) / 255.0, 1.0),
            expected,
            "{mode:?} {pixel}"
        );
    };
    let percent = |p| Occupancy::from_percent(p).expect("up to 100");
    check(MapMode::Trinary, false, 0, Occupancy::OCCUPIED);
    check(MapMode::Trinary, false, 254, Occupancy::FREE);
    check(MapMode::Trinary, false, 205, Occupancy::UNKNOWN);
    check(MapMode::Trinary, true, 254, Occupancy::OCCUPIED);
    check(MapMode::Trinary, true, 0, Occupancy::FREE);
    check(MapMode::Scale, false, 0, Occupancy::OCCUPIED);
    check(MapMode::Scale, false, 255, Occupancy::FREE);
    // 1 - 128/255 = 0.498 lies (0.498 - 0.196) / 0.454 = 0.665 of the way.
    check(MapMode::Scale, false, 128, percent(67));
    check(MapMode::Raw, false, 0, Occupancy::FREE);
    check(MapMode::Raw, true, 100, Occupancy::OCCUPIED);
    check(MapMode::Raw, false, 42, percent(42));
    check(MapMode::Raw, false, 101, Occupancy::UNKNOWN);
    check(MapMode::Raw, false, 255, Occupancy::UNKNOWN);
    assert_eq!(header(MapMode::Scale, false).occupancy(0.0, 0.5), Occupancy::UNKNOWN);
    assert_eq!(header(MapMode::Trinary, false).occupancy(0.0, 0.0), Occupancy::UNKNOWN);
}

#[track_caller]
fn load_written(image: &[u8], name: &str) -> Result<OccupancyGrid, String> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join(name), image).expect("written");
    let yaml = folder.path().join("m.yaml");
    std::fs::write(&yaml, GOOD.replace("map.pgm", name)).expect("written");
    OccupancyGrid::load(&yaml).map_err(|error| error.to_string())
}

#[test]
fn images_of_all_kinds_are_read() {
    let expected = [100, 0, 0, -1, -1, 100].map(Occupancy::from_ros);
    let read = |image: &[u8]| load_written(image, "m.pgm").expect("it is good").into_cells();
    // The first row of the image is the last of the map.
    assert_eq!(read(b"P2\n# by hand\n3 2\n255\n205 205 0\n0 254 254\n"), expected);
    assert_eq!(read(b"P5 3 2 255\n\xcd\xcd\x00\x00\xfe\xfe"), expected);
    assert_eq!(read(b"P2 3 2 100\n80 80 0 0 100 100\n"), expected);
    assert_eq!(read(b"P5 3 2 65535\n\xcd\xcd\xcd\xcd\x00\x00\x00\x00\xfe\xfe\xfe\xfe"), expected);
}

#[test]
fn broken_images_are_refused_by_name() {
    let refused = |image: &[u8]| {
        let error = load_written(image, "m.pgm").expect_err("it must be refused");
        assert!(error.contains("m.pgm: it is no image"), "{error}");
    };
    refused(b"");
    refused(b"P5 3 2 255\n\xcd\xcd");
    refused(b"P2 3 2 255\n1 2 3 x 5 6");
    refused(b"\x89PNG\r\n\x1a\nnonsense");
    refused(b"hello");
    let size = load_written(b"P5 60000 60000 255\n", "m.pgm").expect_err("too large");
    assert!(size.contains("m.pgm"), "{size}");
    let empty = load_written(b"P5 0 0 255\n", "m.pgm").expect_err("no cells");
    assert!(empty.contains("m.pgm: a grid of 0 x 0"), "{empty}");
    let missing = OccupancyGrid::load("/nonexistent/m.yaml").expect_err("there is none").to_string();
    assert!(missing.starts_with("/nonexistent/m.yaml: "), "{missing}");
}

#[test]
fn modes_refuse_what_they_cannot_hold() {
    let folder = tempfile::tempdir().expect("a folder");
    let frame = GridFrame::new(2, 1, 0.1, Pose2::IDENTITY).expect("good");
    let mut grid = Grid::filled(frame, Occupancy::FREE);
    *grid.get_mut(Cell::new(1, 0)).expect("inside") = Occupancy::from_percent(40).expect("up to 100");
    let error =
        grid.save(folder.path().join("m.yaml"), MapMode::Trinary, MapImage::Png).expect_err("refused");
    assert!(matches!(error.problem, MapProblem::Inexpressible { column: 1, row: 0, .. }), "{error}");
    let unknown = Grid::filled(frame, Occupancy::UNKNOWN);
    assert!(unknown.save(folder.path().join("m.yaml"), MapMode::Scale, MapImage::Pgm).is_err());
}

fn grids() -> impl Strategy<Value = OccupancyGrid> {
    (1_u32..9, 1_u32..9, 1e-3..10.0, -1e3..1e3, -4.0..4.0_f64).prop_flat_map(
        |(width, height, resolution_m, x, turn)| {
            let cells =
                prop::collection::vec((-1..=100_i8).prop_map(Occupancy::from_ros), (width * height) as usize);
            cells.prop_map(move |cells| {
                let frame =
                    GridFrame::new(width, height, resolution_m, Pose2::new(x, -x / 3.0, turn)).expect("good");
                Grid::new(frame, cells).expect("as many")
            })
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn maps_survive_their_files(grid in grids(), name in "[a-z #'\"\\\\]{1,9}") {
        let folder = tempfile::tempdir().expect("a folder");
        let yaml = folder.path().join(format!("{name}x.yaml"));
        let only = |keep: fn(Occupancy) -> bool| grid.map(|&cell| if keep(cell) { cell } else { Occupancy::FREE });
        let known = only(|cell| !cell.is_unknown());
        let sure = only(|cell| matches!(cell.to_ros(), -1 | 0 | 100));
        for (grid, mode, image) in [
            (&grid, MapMode::Raw, MapImage::Pgm), (&grid, MapMode::Raw, MapImage::Png),
            (&grid, MapMode::Scale, MapImage::Png), (&known, MapMode::Scale, MapImage::Pgm),
            (&sure, MapMode::Trinary, MapImage::Pgm), (&sure, MapMode::Trinary, MapImage::Png),
        ] {
            grid.save(&yaml, mode, image).expect("it can be held");
            prop_assert_eq!(&OccupancyGrid::load(&yaml).expect("just written"), grid, "{:?} {:?}", mode, image);
        }
    }

    #[test]
    fn no_text_makes_the_reader_panic(text in "(image|origin|resolution|: |\\[|\\]|,|-|\n| |\"|'|#|\\\\|[a-z0-9.]){0,40}") {
        let _ = MapHeader::parse(&text);
    }
}

#[test]
fn maps_of_others_are_read() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/maps_ros"));
    if !folder.is_dir() {
        println!("skipped: {} is missing", folder.display());
        return;
    }
    let load = |name: &str| OccupancyGrid::load(folder.join(name)).expect("a good map");
    for (name, width, height) in [
        ("depot.yaml", 604, 307),
        ("depot_keepout.yaml", 604, 307),
        ("depot_speed.yaml", 604, 307),
        ("map_circular.yaml", 384, 384),
        ("tb3_sandbox.yaml", 384, 384),
        ("willow-2010-02-18-0.10.yaml", 566, 608),
    ] {
        let grid = load(name);
        assert_eq!((grid.frame().width(), grid.frame().height()), (width, height), "{name}");
        let count =
            |wanted: fn(Occupancy) -> bool| grid.as_slice().iter().filter(|&&cell| wanted(cell)).count();
        let (free, full) = (count(|cell| cell == Occupancy::FREE), count(|cell| cell.is_occupied(65)));
        println!("{name}: {free} free, {full} occupied of {}", grid.frame().len());
        assert!(free > 0 && full > 0 && free + full <= grid.frame().len(), "{name}");
    }
    let test = load("testmap.yaml");
    assert_eq!(test.frame().origin(), Pose2::new(2.0, 3.0, 1.0));
    let upper_row: Vec<_> =
        (0..10).map(|column| test.get(Cell::new(column, 9)).map(|cell| cell.to_ros())).collect();
    assert_eq!(upper_row, [100, 0, 0, 0, 0, 0, 0, 0, 0, 0].map(Some));
    let lower_row: Vec<_> =
        (0..10).map(|column| test.get(Cell::new(column, 1)).map(|cell| cell.to_ros())).collect();
    assert_eq!(lower_row, [100, 100, 100, 100, 0, 0, 100, 100, 100, 0].map(Some));
    let error = OccupancyGrid::load(folder.join("invalid_image.yaml")).expect_err("broken on purpose");
    assert!(error.path.ends_with("invalid.png"), "{error}");
}
