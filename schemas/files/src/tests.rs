use crate::*;
use std::io::Write as _;
use std::os::unix::fs::{PermissionsExt as _, symlink};
use std::path::{Path, PathBuf};

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder for the test")
}

fn file(folder: &tempfile::TempDir, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join("file");
    std::fs::write(&path, bytes).expect("written");
    path
}

#[track_caller]
fn refused<T: std::fmt::Debug>(result: Result<T, FileError>, words: &str) {
    let error = result.expect_err(words).to_string();
    assert!(error.contains(words), "{error:?} does not say {words:?}");
}

/// Both ways to read.
#[track_caller]
fn unreadable(path: &Path, words: &str) {
    refused(read(path, 100), words);
    refused(read_text(path, 100), words);
    refused(read_unpacked(path, 100), words);
    refused(check(path, 100), words);
}

#[test]
fn only_plain_files_are_read_and_nobody_waits() {
    let folder = folder();
    let inside = |name: &str| folder.path().join(name);
    unreadable(folder.path(), "this is a folder, and only plain files are read");
    rustix::fs::mkfifoat(rustix::fs::CWD, inside("pipe"), rustix::fs::Mode::RWXU).expect("a pipe");
    unreadable(&inside("pipe"), "this is a pipe");
    let _socket = std::os::unix::net::UnixListener::bind(inside("socket")).expect("a socket");
    unreadable(&inside("socket"), "this is a socket");
    unreadable(Path::new("/dev/zero"), "this is a device");
    unreadable(Path::new("/dev/null"), "this is a device");
    unreadable(&inside("nothing"), "No such file");
    symlink("/dev/zero", inside("link")).expect("a link");
    unreadable(&inside("link"), "this is a device");
    symlink(file(&folder, b"good"), inside("good")).expect("a link");
    assert_eq!(read_text(&inside("good"), 4).expect("a plain file behind a link"), "good");
}

#[test]
fn sizes_are_bounded() {
    let folder = folder();
    let path = file(&folder, &[b'x'; 2048]);
    assert_eq!(read(&path, 2048).expect("just small enough").len(), 2048);
    refused(read(&path, 2047), "it has 2 KiB, more than 2.0 KiB of content, which is the limit");
    refused(read_text(&path, 1024), "more than 1 KiB of content");
    refused(read_unpacked(&path, 1024), "more than 1 KiB of content");
    // A file that says nothing of its size.
    refused(read(Path::new("/proc/self/maps"), 10), "more than 10 bytes of content");
}

#[test]
fn compressed_content_is_bounded_too() {
    let folder = folder();
    let pack = |bytes: &[u8]| {
        let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        packer.write_all(bytes).expect("memory");
        packer.finish().expect("memory")
    };
    let packed = pack(&[b'x'; 100_000]);
    let path = file(&folder, &packed);
    let unpacked = read_unpacked(&path, 100_000).expect("just small enough");
    assert_eq!((unpacked.bytes.len(), unpacked.damage), (100_000, None));
    refused(read_unpacked(&path, 99_999), "of unpacked content");
    // Pieces one after the other, as `cat` makes them.
    let path = file(&folder, &[packed.clone(), pack(b"end")].concat());
    assert!(read_unpacked(&path, 1 << 20).expect("two pieces").bytes.ends_with(b"xend"));
    let path = file(&folder, &packed[..packed.len() - 20]);
    let cut = read_unpacked(&path, 1 << 20).expect("what is before the damage");
    assert!(cut.damage.is_some() && cut.bytes.iter().all(|&byte| byte == b'x'));
}

#[test]
fn text_is_utf_8_without_a_mark() {
    let folder = folder();
    assert_eq!(read_text(&file(&folder, b"\xef\xbb\xbfa\n"), 100).expect("a mark"), "a\n");
    assert_eq!(read_text(&file(&folder, b""), 100).expect("empty"), "");
    let latin = file(&folder, b"name: x\n# caf\xe9 au lait\n");
    refused(
        read_text(&latin, 100),
        "file: line 2, byte 6: the byte 0xe9 is no UTF-8; save the file as UTF-8",
    );
    let wide = file(&folder, b"\xff\xfea\0b\0");
    refused(read_text(&wide, 100), "line 1, byte 1: the text begins as UTF-16 does");
}

fn put(path: &Path, text: &str) -> Result<(), FileError> {
    Draft::write(path, |file| file.write_all(text.as_bytes()))?.put()
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .expect("the folder")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn a_file_appears_when_it_is_whole() {
    let folder = folder();
    let path = folder.path().join("map.yaml");
    put(&path, "first").expect("written");
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o640)).expect("permissions");
    let draft = Draft::write(&path, |file| file.write_all(b"second")).expect("written");
    assert_eq!(read_text(&path, 100).expect("the old one"), "first");
    draft.put().expect("renamed");
    assert_eq!(read_text(&path, 100).expect("the new one"), "second");
    assert_eq!(path.metadata().expect("there").permissions().mode() & 0o777, 0o640);
    // What fails or is given up leaves the old one, and nothing else.
    refused(Draft::write(&path, |_| Err(std::io::Error::other("the disk is full"))), "the disk is full");
    drop(Draft::write(&path, |file| file.write_all(b"third")).expect("written"));
    assert_eq!(read_text(&path, 100).expect("the old one"), "second");
    assert_eq!(names(folder.path()), ["map.yaml"]);
}

/// Neither checked nor written.
#[track_caller]
fn no_place(path: &Path, words: &str) {
    refused(check_place(path), words);
    refused(put(path, "x"), words);
}

#[test]
fn only_plain_files_are_replaced() {
    let folder = folder();
    let inside = |name: &str| folder.path().join(name);
    no_place(&inside("gone/map.yaml"), "gone does not exist");
    no_place(&file(&folder, b"").join("map.yaml"), "file is no folder");
    no_place(folder.path(), "this is a folder");
    no_place(Path::new("/dev/full"), "this is a device");
    no_place(Path::new(""), "this is the name of a folder");
    no_place(&inside("map/"), "this is the name of a folder");
    rustix::fs::mkfifoat(rustix::fs::CWD, inside("pipe"), rustix::fs::Mode::RWXU).expect("a pipe");
    no_place(&inside("pipe"), "this is a pipe");
    symlink("nowhere", inside("dangling")).expect("a link");
    no_place(&inside("dangling"), "a link that leads nowhere");
    symlink("file", inside("link")).expect("a link");
    check_place(&inside("link")).expect("a plain file behind a link");
    put(&inside("link"), "through").expect("written");
    assert_eq!(read_text(&inside("file"), 100).expect("the file"), "through");
    assert!(inside("link").is_symlink(), "the link was replaced");
    check_place(&inside("new")).expect("nothing is there yet");
    assert!(!inside("new").exists());
}

proptest::proptest! {
    #[test]
    fn any_bytes_are_text_or_not(bytes in proptest::collection::vec(proptest::num::u8::ANY, 0..64)) {
        let lossy = String::from_utf8_lossy(&bytes).into_owned();
        match text(bytes.clone()) {
            Ok(text) => proptest::prop_assert_eq!(lossy.trim_start_matches('\u{feff}'), text.trim_start_matches('\u{feff}')),
            Err(FileProblem::NotText { line, byte, .. }) => {
                proptest::prop_assert!(line >= 1 && line <= lossy.lines().count().max(1) && byte >= 1 && byte <= bytes.len());
            }
            Err(other) => proptest::prop_assert!(false, "{}", other),
        }
    }
}

#[test]
fn long_texts_are_quoted_in_brief() {
    assert_eq!(in_brief("0.65"), "0.65");
    assert_eq!(in_brief(&"x".repeat(80)), "x".repeat(80));
    assert_eq!(in_brief(&"x".repeat(2048)), format!("{} .. (2 KiB in all)", "x".repeat(80)));
    // Never in the middle of a character.
    assert_eq!(clipped("\u{e4}\u{f6}\u{fc}", 2), "\u{e4}\u{f6} .. (6 bytes in all)");
}

#[test]
fn a_path_that_a_file_has_made_up_is_quoted_in_brief() {
    let error = read_text(Path::new(&"p.".repeat(200_000)), 1 << 20).unwrap_err().to_string();
    assert!(error.len() < 5000 && error.contains("390.6 KiB in all"), "{} bytes", error.len());
}
