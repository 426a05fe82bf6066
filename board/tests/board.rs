//! The board within one process: names, isolation, what is left behind, and who may take what.

use board::host::{self, Host, HostError};
use board::manifest::{Manifest, Topic};
use board::place::{InvalidBoardName, NAME_MAX, Place};
use board::switchboard::{SLOTS, Switchboard};
use board::tap::{Tap, TapReader};
use board::{JoinError, clock};
use messages::{Message, WheelSpeeds};
use proptest::prelude::*;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;
use zerocopy::IntoBytes as _;

fn name() -> String {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    format!("u{}-{}", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed))
}

fn manifest() -> Manifest {
    let message = WheelSpeeds::description();
    let topic =
        Topic { name: "wheels".into(), publisher: None, readers: vec![], depth: 8, elements: 0, message };
    Manifest { graph: "test".into(), topics: vec![topic], ..Manifest::default() }
}

fn tap(host: &Host) -> Tap {
    Tap::join(host.place().clone(), "test").expect("a place on the board")
}

fn bytes_of(number: u8) -> Vec<u8> {
    vec![number; size_of::<WheelSpeeds>()]
}

fn next(tap: &Tap, reader: &mut TapReader) -> Option<Vec<u8>> {
    let deadline = clock::monotonic().after(Duration::from_millis(500));
    loop {
        let heard = tap.bell();
        if let Some((_, bytes)) = reader.next() {
            return Some(bytes.to_vec());
        }
        if clock::monotonic() > deadline {
            return None;
        }
        tap.wait(heard, Duration::from_millis(20));
    }
}

#[track_caller]
fn assert_nothing_left(place: &Place) {
    assert!(!place.root().exists(), "{} is still there", place.root().display());
    assert_eq!(place.shared_memory(), Vec::<std::path::PathBuf>::new());
}

#[track_caller]
fn check_name(name: &str, valid: bool) {
    assert_eq!(Place::new(name).is_ok(), valid, "{name:?}");
}

#[test]
fn names() {
    check_name("coffee", true);
    check_name("robot-2", true);
    check_name(&"a".repeat(NAME_MAX), true);
    check_name(&"a".repeat(NAME_MAX + 1), false);
    check_name("", false);
    check_name("Coffee", false);
    check_name("..", false);
    check_name("a/b", false);
    check_name("kaffee-für-alle", false);
}

#[test]
fn a_name_that_is_too_long_is_refused_in_words() {
    let name = "a-board-with-a-very-long-name";
    let error = Host::create(name, manifest(), false).expect_err("too long");
    assert!(matches!(&error, HostError::Name(InvalidBoardName { name: refused }) if refused == name));
    assert!(error.to_string().contains("1 to 20"), "{error}");
}

#[test]
fn boards_do_not_meet() {
    let (one, two) = (
        Host::create(&name(), manifest(), false).unwrap(),
        Host::create(&name(), manifest(), false).unwrap(),
    );
    let (mut tap_one, tap_two) = (tap(&one), tap(&two));
    let mut reader_one = tap_one.reader("wheels").unwrap();
    let mut reader_two = tap_two.reader("wheels").unwrap();
    let publisher = tap_one.publisher("wheels").unwrap();
    publisher.publish(&bytes_of(7)).unwrap();
    assert_eq!(next(&tap_one, &mut reader_one), Some(bytes_of(7)));
    assert_eq!(reader_two.next(), None);
    assert_eq!(two.switchboard().topic(0).unwrap().count.load(Ordering::Acquire), 0);
    drop((publisher, reader_one, reader_two, tap_one, tap_two));
    let places = [one.place().clone(), two.place().clone()];
    one.take_down().unwrap();
    assert!(places[1].exists(), "taking one down took the other along");
    two.take_down().unwrap();
    places.iter().for_each(assert_nothing_left);
}

#[test]
fn a_board_that_is_dropped_leaves_nothing() {
    let host = Host::create(&name(), manifest(), false).unwrap();
    let place = host.place().clone();
    assert!(!place.shared_memory().is_empty());
    drop(host);
    assert_nothing_left(&place);
}

#[test]
fn a_board_that_cannot_be_made_leaves_nothing() {
    let name = name();
    let mut manifest = manifest();
    manifest.topics.push(Topic { name: "x".repeat(500), ..manifest.topics[0].clone() });
    let error = Host::create(&name, manifest, false).expect_err("no such topic");
    assert!(matches!(error, HostError::Transport(_)), "{error}");
    assert_nothing_left(&Place::new(&name).unwrap());
}

#[test]
fn a_board_that_is_up_is_not_made_again() {
    let host = Host::create(&name(), manifest(), false).unwrap();
    let error = Host::create(host.place().name(), manifest(), false).expect_err("it is up");
    assert!(matches!(error, HostError::Taken { pid, .. } if pid == std::process::id()), "{error}");
    assert!(host::clear(host.place()).unwrap().is_none(), "a board that is up was cleared away");
    assert!(host::sweep().unwrap().iter().all(|swept| swept.board != host.place().name()));
    host.take_down().unwrap();
}

#[test]
fn boards_are_made_and_swept_at_the_same_time() {
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                for _ in 0..15 {
                    let host = Host::create(&name(), manifest(), false).expect("a board");
                    let place = host.place().clone();
                    host.take_down().expect("a clean end");
                    assert_nothing_left(&place);
                }
            });
        }
        scope.spawn(|| {
            for _ in 0..60 {
                host::sweep().expect("a sweep");
            }
        });
    });
}

#[test]
fn there_is_no_board_to_join_and_no_topic_to_read() {
    let place = Place::new(&name()).unwrap();
    assert!(matches!(Tap::join(place, "test"), Err(JoinError::NoBoard { .. })));
    let host = Host::create(&name(), manifest(), false).unwrap();
    let tap = tap(&host);
    let error = tap.reader("wheel").expect_err("no such topic");
    assert!(error.to_string().contains("`wheel` is not on the board"), "{error}");
}

#[test]
fn a_tap_serves_the_last_message_to_who_comes_late() {
    let host = Host::create(&name(), manifest(), false).unwrap();
    let mut early = tap(&host);
    let publisher = early.publisher("wheels").unwrap();
    publisher.publish(&bytes_of(1)).unwrap();
    publisher.publish(&bytes_of(2)).unwrap();
    let late = tap(&host);
    let mut reader = late.reader("wheels").unwrap();
    // The one that publishes looks about as it waits.
    early.wait(early.bell(), Duration::from_millis(1));
    assert_eq!(next(&late, &mut reader), Some(bytes_of(2)));
    assert_eq!(reader.next(), None);
}

#[test]
fn a_tap_counts_what_it_missed() {
    let host = Host::create(&name(), manifest(), false).unwrap();
    let mut tap = tap(&host);
    let mut reader = tap.reader("wheels").unwrap();
    let publisher = tap.publisher("wheels").unwrap();
    publisher.publish(&bytes_of(0)).unwrap();
    assert!(reader.next().is_some());
    (0..100).for_each(|number| publisher.publish(&bytes_of(number)).unwrap());
    let mut read = 0;
    while reader.next().is_some() {
        read += 1;
    }
    // Depth 8: the last eight are there.
    assert_eq!((read, reader.lost()), (8, 92));
}

#[test]
fn forged_sequences_do_not_overflow_the_count() {
    let host = Host::create(&name(), manifest(), false).unwrap();
    let mut tap = tap(&host);
    let mut reader = tap.reader("wheels").unwrap();
    let publisher = tap.publisher("wheels").unwrap();
    for count in [0, u64::MAX - 1, u64::MAX, 5, u64::MAX - 1, 1] {
        host.switchboard().topic(0).unwrap().count.store(count, Ordering::Release);
        publisher.publish(&bytes_of(1)).unwrap();
        assert!(reader.next().is_some());
    }
    assert_eq!(reader.lost(), u64::MAX);
}

#[test]
fn a_message_is_as_long_as_its_publisher_says() {
    let host = Host::create(&name(), manifest(), false).unwrap();
    let mut tap = tap(&host);
    let mut reader = tap.reader("wheels").unwrap();
    let publisher = tap.publisher("wheels").unwrap();
    for length in [1, 63, 64, 65, 4096, 100_000, 1_200_000, 8] {
        publisher.publish(&vec![3; length]).unwrap();
        let (_, bytes) = reader.next().expect("a message");
        assert_eq!((bytes.len(), bytes.as_ptr() as usize % 64), (length, 0));
    }
    publisher.publish(WheelSpeeds::default().as_bytes()).unwrap();
}

#[test]
fn places_are_taken_by_one_each() {
    let folder = tempfile::tempdir().unwrap();
    let page = Switchboard::create(&folder.path().join("page")).unwrap();
    let mut taken: Vec<u32> = std::thread::scope(|scope| {
        let claim = || -> Vec<u32> {
            (0..SLOTS / 4 + 1).filter_map(|_| page.claim("one", std::process::id(), false)).collect()
        };
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(claim)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    });
    taken.sort_unstable();
    assert_eq!(taken, (0..SLOTS as u32).collect::<Vec<_>>());
    assert_eq!(page.claim("one too many", 0, true), None);
    page.release(17);
    assert_eq!(page.claim("another", 1, true), Some(17));
}

#[test]
fn a_bell_that_many_ring_wakes_every_time() {
    const RINGERS: u64 = 4;
    const EACH: u64 = 25_000;
    let folder = tempfile::tempdir().unwrap();
    let page = Switchboard::create(&folder.path().join("page")).unwrap();
    let index = page.claim("sleeper", std::process::id(), false).unwrap();
    page.topic(0).unwrap().set_wake(index, true);
    let (rung, slept_through) = (AtomicU64::new(0), AtomicU32::new(0));
    let patience = Duration::from_secs(20);
    std::thread::scope(|scope| {
        for _ in 0..RINGERS {
            scope.spawn(|| {
                for number in 0..EACH {
                    rung.fetch_add(1, Ordering::SeqCst);
                    page.ring_readers(0);
                    // Now and then the sleeper gets to sleep.
                    if number % 64 == 0 {
                        std::thread::yield_now();
                    }
                }
            });
        }
        let slot = page.slot(index).unwrap();
        loop {
            let heard = slot.bell();
            if rung.load(Ordering::SeqCst) == RINGERS * EACH {
                break;
            }
            let before = clock::monotonic();
            slot.wait(heard, Some(patience));
            if clock::monotonic().since(before) >= patience {
                slept_through.fetch_add(1, Ordering::Relaxed);
                break;
            }
        }
    });
    assert_eq!(slept_through.load(Ordering::Relaxed), 0, "a ring was lost");
}

#[test]
fn a_page_of_another_version_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("page");
    std::fs::write(&path, b"too short").unwrap();
    assert!(Switchboard::open(&path).unwrap_err().to_string().contains("another version"));
    drop(Switchboard::create(&folder.path().join("good")).unwrap());
    let mut bytes = std::fs::read(folder.path().join("good")).unwrap();
    bytes[0] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    assert!(Switchboard::open(&path).unwrap_err().to_string().contains("another version"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever a broken process writes into the page, nobody who reads it panics.
    #[test]
    fn a_page_full_of_nonsense_is_survived(seed in any::<u64>(), topic in any::<u32>(), slot in any::<u32>()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page");
        drop(Switchboard::create(&path).unwrap());
        let mut bytes = std::fs::read(&path).unwrap();
        let mut state = seed | 1;
        for byte in &mut bytes[64..] {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            *byte = state as u8;
        }
        std::fs::write(&path, bytes).unwrap();
        let page = Switchboard::open(&path).unwrap();
        page.ring_readers(topic % 300);
        page.ring_readers(topic);
        page.announce_reader();
        prop_assert!(page.slot(slot).is_none_or(|slot| slot.role().len() <= 3 * 48));
        let taken: Vec<u32> = page.taken().map(|(index, _)| index).collect();
        prop_assert!(taken.iter().all(|&index| (index as usize) < SLOTS));
        prop_assert!(host::services(&page).len() <= SLOTS);
        page.release(slot);
        page.release_dead(slot % 128);
        let _ = page.dead_tools().count();
    }

    #[test]
    fn names_that_are_accepted_fit(name in "\\PC{0,30}") {
        if let Ok(place) = Place::new(&name) {
            prop_assert!(place.root().to_string_lossy().len() + place.prefix().len() <= 60);
            prop_assert!(place.root().starts_with("/dev/shm"));
            prop_assert_eq!(place.root().components().count(), 5);
        }
    }
}
