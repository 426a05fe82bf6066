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
    same_when("resolution: ", "resolution:\t");
    same_when("image: ", "image:\t\t");
    same_when("[-10.0, 2, 0.5]", "\t[-10.0,\t2,\t0.5]\t");
    same_when("negate: 0", "info:\n  author: me\n  tools: [gimp, {version: 2}]\nnegate: 0");
    same_when("negate: 0", "meta: {author: me, deep: [[1], {a: [b]}]}\nnegate: 0");
    same_when("negate: 0", "note: |\n  two lines\n  image: no.pgm\nnegate: 0");
    same_when("negate: 0", "? [a, b]\n: {c: d}\nnegate: 0");
    same_when("[-10.0, 2, 0.5]", "&home [-10.0, 2, 0.5]\ndock: *home");
    same_when("origin: [-10.0, 2, 0.5]", "start: &home [-10, &two 2, 0.5]\norigin: *home\nrest: [*two]");
    let whole = MapHeader::parse(GOOD).expect("it is good");
    let same = |text: &str| assert_eq!(MapHeader::parse(text).expect(text), whole);
    same(&GOOD.lines().map(|line| format!("  {line}\n")).collect::<String>());
    same(&format!("{{{}}}", GOOD.trim_end().replace('\n', ", ")));
    same(&format!("{{{}}}", GOOD.trim_end().replace('\n', ",\n").replace("map.pgm", "\"map.pgm\"")));
    same(&format!("{GOOD}---\nimage: second.pgm\n"));
    same(&format!("%YAML 1.2\n---\n{GOOD}...\n"));
    // Each line refers to the one before ten times: nothing is expanded.
    let bomb: String =
        (1..60).map(|n| format!("b{n}: &b{n} [{}]\n", vec![format!("*b{}", n - 1); 10].join(", "))).collect();
    same(&format!("b0: &b0 [x]\n{bomb}{GOOD}"));
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
    refused_when(
        "0.05",
        "0.0",
        "line 2: resolution: \"0.0\" is not a positive number of metres, from 0.001 to 10",
    );
    refused_when("0.05", "0.0009", "from 0.001 to 10");
    // Who reads a sentence wants no megabyte in it.
    refused_when("0.05", &"0.".repeat(1024), "0.0.0. .. (2 KiB in all)\" is not a positive number");
    refused_when("0.05", "10.1", "from 0.001 to 10");
    refused_when("0.05", "1e308", "from 0.001 to 10");
    refused_when("0.05", "-1", "positive");
    refused_when("0.05", ".nan", "positive");
    refused_when("0.05", "inf", "positive");
    refused_when("0.05", "5 cm", "positive");
    refused_when("[-10.0, 2, 0.5]", "[-10.0, 2]", "three finite numbers");
    refused_when("[-10.0, 2, 0.5]", "[-10.0, 2, x]", "three finite numbers");
    refused_when("[-10.0, 2, 0.5]", "7", "three finite numbers");
    refused_when("[-10.0, 2, 0.5]", "[-10.0, 2e8, 0]", "up to 1e8 m");
    refused_when(
        "[-10.0, 2, 0.5]",
        "{x: 1, y: 2}",
        "line 3: origin: \"a table or a longer list\" is not a list",
    );
    refused_when(
        "[-10.0, 2, 0.5]",
        "[[1], 2, 3]",
        "line 3: origin: \"a table or a longer list\" is not a list",
    );
    refused_when("[-10.0, 2, 0.5]", "[1, 2, 3", "line 4: no YAML: ");
    refused_when("0.65", "1.5", "occupied_thresh: \"1.5\"");
    refused_when("0.196", "0.7", "free_thresh 0.7 is above occupied_thresh 0.65");
    refused_when("negate: 0", "negate: 2", "0 or 1");
    refused_when("negate: 0", "mode: quaternary", "trinary, scale or raw");
    refused_when("negate: 0", "image: b.pgm", "line 4: image is given twice");
    refused_when("negate: 0", "negate", "line 5: no YAML: ");
    refused_when("negate: 0", "  negate: 0", "line 4: no YAML: ");
    refused_when("map.pgm", "\"map.pgm", "no YAML: ");
    refused_when("map.pgm", "", "line 1: image: \"\" is not the path of an image");
    refused("hello", "line 1: this is not `key: value`");
    refused("[image, map.pgm]", "line 1: this is not `key: value`");
    refused("# nothing", "`resolution` is missing");
    refused_when("map.pgm", "*nowhere", "line 1: no YAML: ");
}

/// `golden.txt` was worked out by `golden.py` beside it, which drew the images too.
#[test]
fn pixels_mean_what_the_map_servers_say() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/maps"));
    let written = tempfile::tempdir().expect("a folder");
    let yaml = written.path().join("m.yaml");
    for line in include_str!("../../tests/maps/golden.txt").lines() {
        let (head, cells) = line.split_once(':').expect("a colon");
        let [image, mode, negate, occupied, free] = head.split(' ').collect::<Vec<_>>()[..] else {
            panic!("{line}")
        };
        let image = folder.join(image);
        let text = format!(
            "image: {}\nresolution: 1\norigin: [0, 0, 0]\nmode: {mode}\nnegate: {negate}\noccupied_thresh: {occupied}\nfree_thresh: {free}\n",
            image.display()
        );
        std::fs::write(&yaml, text).expect("written");
        let expected: Vec<i8> = cells.split_whitespace().map(|cell| cell.parse().expect("a cell")).collect();
        let grid = OccupancyGrid::load(&yaml).unwrap_or_else(|error| panic!("{head}: {error}"));
        let found: Vec<i8> = grid.as_slice().iter().map(|cell| cell.to_ros()).collect();
        assert_eq!(found, expected, "{head}");
        assert_eq!(OccupancyGrid::look(&yaml).expect("it was read"), *grid.frame());
    }
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
    for head in ["P5 67108865 1 255\n", "P5 16777215 1 255\n"] {
        let long = load_written(head.as_bytes(), "m.pgm").expect_err("too long a side");
        assert!(long.contains("16777214 along a side"), "{long}");
    }
    let missing = OccupancyGrid::load("/nonexistent/m.yaml").expect_err("there is none").to_string();
    assert!(missing.starts_with("/nonexistent/m.yaml: "), "{missing}");
}

#[test]
fn a_file_with_more_than_its_pixels_is_refused() {
    let told = |image: &[u8], words: &str| match load_written(image, "m.pgm") {
        Ok(_) => panic!("{words}"),
        Err(error) => assert!(error.contains(words), "{error}"),
    };
    let good = |image: &[u8]| load_written(image, "m.pgm").expect("it is good").into_cells();
    told(b"P5\r\n4 1\r\n255\r\n\x00\xfe\xfe\xfe", "m.pgm: 1 byte more than 4 x 1 pixels; is the head");
    told(b"P5 4 1 255\n0123456789012345678", "15 bytes more than 4 x 1 pixels");
    told(b"P5 1 1 65535\n123", "1 byte more than 1 x 1 pixels");
    told(b"P6 1 1 255\n1234", "1 byte more than 1 x 1 pixels");
    told(b"P4 9 2\n12345", "1 byte more than 9 x 2 pixels");
    told(
        b"P7\nWIDTH 1\nHEIGHT 1\nDEPTH 2\nMAXVAL 255\nTUPLTYPE GRAYSCALE_ALPHA\nENDHDR\n123",
        "1 byte more than 1 x 1",
    );
    told(b"P2 2 1 255\n1 2 # two\n3", "1 numbers more than 2 x 1 pixels");
    told(b"P1 2 1\n0 110", "2 numbers more than 2 x 1 pixels");
    // What ends with a line's end says nothing else by it.
    for end in ["", "\n", "\r\n"] {
        assert_eq!(
            good(&[b"P5 2 1 255\n\x00\xfe", end.as_bytes()].concat()),
            [100, 0].map(Occupancy::from_ros)
        );
    }
    assert_eq!(good(b"P2 2 1 255\n0 254 # the end\n"), [100, 0].map(Occupancy::from_ros));
    // The first pixels may look like blanks and comments.
    assert_eq!(good(b"P5 4 1 255\n\n #\t").len(), 4);
}

#[test]
fn an_image_that_is_not_there_is_told_with_who_names_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let yaml = folder.path().join("m.yaml");
    let told = |image: &str, words: &str| {
        std::fs::write(&yaml, GOOD.replace("map.pgm", image)).expect("written");
        for error in [OccupancyGrid::load(&yaml).err(), OccupancyGrid::look(&yaml).err()] {
            let error = error.expect("refused").to_string();
            assert!(
                error.contains(words) && error.contains("m.yaml names it, and the path counts from"),
                "{error}"
            );
        }
    };
    told("maps/map.pgm", "maps/map.pgm: No such file");
    told("~/map.pgm", "`~` is no home there");
    told("package://maps/map.pgm", "only paths are understood");
    told("/dev/zero", "/dev/zero: this is a device");
    told(".", "this is a folder");
}

#[test]
fn what_is_no_text_is_told_where() {
    let folder = tempfile::tempdir().expect("a folder");
    let yaml = folder.path().join("m.yaml");
    std::fs::write(&yaml, b"image: map.pgm\n# caf\xe9\n").expect("written");
    let error = OccupancyGrid::load(&yaml).expect_err("Latin-1").to_string();
    assert!(error.contains("m.yaml: line 2, byte 6: the byte 0xe9 is no UTF-8"), "{error}");
}

#[test]
fn maps_are_saved_under_the_name_of_their_yaml() {
    let folder = tempfile::tempdir().expect("a folder");
    let grid = Grid::filled(GridFrame::new(2, 1, 0.1, Pose2::IDENTITY).expect("good"), Occupancy::FREE);
    let inside = |name: &str| folder.path().join(name);
    let save = |name: &str| {
        let checked =
            OccupancyGrid::check_save(inside(name), MapImage::Pgm).map_err(|error| error.to_string());
        let saved =
            grid.save(inside(name), MapMode::Trinary, MapImage::Pgm).map_err(|error| error.to_string());
        assert_eq!(checked, saved, "{name}");
        saved
    };
    for (name, image) in [
        ("house.yaml", "house.pgm"),
        ("a.b.yml", "a.b.pgm"),
        ("plan", "plan.pgm"),
        ("plan.v2", "plan.v2.pgm"),
        ("\u{fc}ber uns.YAML", "\u{fc}ber uns.pgm"),
    ] {
        save(name).expect(name);
        assert!(inside(image).is_file(), "{image}");
        assert_eq!(OccupancyGrid::load(inside(name)).expect("just written"), grid);
    }
    let refused = |name: &str, words: &str| {
        let error = save(name).expect_err(name);
        assert!(error.contains(words), "{error}");
    };
    refused("house.pgm", "under the name of its YAML, such as ");
    refused("house.PNG", "house.yaml; the image is written beside it");
    refused("gone/house.yaml", "gone does not exist");
    refused("house.yaml/", "the name of a folder");
    std::fs::create_dir(inside("dir.pgm")).expect("a folder");
    refused("dir.yaml", "dir.pgm: this is a folder");
    assert!(!inside("dir.yaml").exists(), "half a map");
    // A failed save leaves what was there.
    let other = Grid::filled(*grid.frame(), Occupancy::from_percent(40).expect("up to 100"));
    assert!(other.save(inside("house.yaml"), MapMode::Trinary, MapImage::Pgm).is_err());
    assert_eq!(OccupancyGrid::load(inside("house.yaml")).expect("the old one"), grid);
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
    fn a_damaged_map_is_read_or_refused(
        at: prop::sample::Index, length in 0..12_usize, with in "[0-9\\-\\[\\]{}&*:#|>?!, \nae.]{0,12}", byte: u8, of_image: prop::sample::Index,
    ) {
        let folder = tempfile::tempdir().expect("a folder");
        let yaml = folder.path().join("map.yaml");
        let mut text = GOOD.to_owned();
        let begin = at.index(text.len());
        text.replace_range(begin..(begin + length).min(text.len()), &with);
        let mut image = b"P5\n3 2\n255\n\x00\x40\x80\xc0\xfe\xff".to_vec();
        let place = of_image.index(image.len());
        image[place] = byte;
        std::fs::write(folder.path().join("map.pgm"), image).expect("written");
        for text in [text.as_str(), GOOD] {
            std::fs::write(&yaml, text).expect("written");
            // What its head promises is what it is.
            if let Ok(grid) = OccupancyGrid::load(&yaml) {
                prop_assert_eq!(*grid.frame(), OccupancyGrid::look(&yaml).expect("it loads"));
            }
        }
    }

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
