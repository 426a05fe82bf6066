//! A page that a broken process has written over: nobody crashes, and with the launcher's help everything
//! heals.

use crate::robot::{Robot, await_message, wait_for};
use crate::services::Count;
use board::clock;
use board::place::Place;
use board::switchboard::process_lives;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use std::os::unix::fs::FileExt as _;
use std::sync::atomic::Ordering;
use std::time::Duration;
use zerocopy::IntoBytes as _;

/// What is written over the page.
#[derive(Debug, Clone)]
enum Scribble {
    /// The same byte everywhere.
    Fill(u8),
    /// Other bytes everywhere.
    Random(u64),
    /// So many words in some places.
    Words(u64, usize),
}

impl Scribble {
    fn over(&self, place: &Place) {
        let page = std::fs::OpenOptions::new().write(true).open(place.file("switchboard")).unwrap();
        let size = page.metadata().unwrap().len() as usize;
        let mut state = 1;
        let mut random = move |seed: u64| {
            state = (state ^ seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (state >> 29);
            state
        };
        match *self {
            Self::Fill(byte) => page.write_all_at(&vec![byte; size], 0).unwrap(),
            Self::Random(seed) => {
                let bytes: Vec<u8> = (0..size).map(|_| (random(seed) >> 32) as u8).collect();
                page.write_all_at(&bytes, 0).unwrap();
            }
            Self::Words(seed, count) => (0..count).for_each(|_| {
                let place = random(seed) as usize % (size / 4) * 4;
                page.write_all_at(&(random(seed) as u32).to_le_bytes(), place as u64).unwrap();
            }),
        }
    }
}

pub(crate) fn a_page_that_was_written_over_heals() {
    let mut robot = Robot::new(&[("count", "counter"), ("relayed", "relay")]);
    let living: Vec<(u32, u32)> = ["relay", "counter"]
        .map(|role| {
            let slot = robot.start(role);
            (slot, robot.host.switchboard().slot(slot).unwrap().pid.load(Ordering::Acquire))
        })
        .into();
    let mut tap = robot.tap();
    let relayed = std::cell::RefCell::new(tap.reader("relayed").unwrap());
    let forger = tap.publisher("count").unwrap();
    let last = std::cell::Cell::new(0);
    let strategy = prop_oneof![
        Just(Scribble::Fill(0)),
        Just(Scribble::Fill(0xff)),
        any::<u64>().prop_map(Scribble::Random),
        (any::<u64>(), 1..3000_usize).prop_map(|(seed, count)| Scribble::Words(seed, count)),
    ];
    let config = Config { cases: 25, failure_persistence: None, ..Config::default() };
    assert_eq!(robot.host.repair(&living), Vec::<String>::new(), "damage on a sound page");
    TestRunner::new(config)
        .run(&strategy, |scribble| {
            scribble.over(robot.host.place());
            // In the name of whoever the page says publishes, a generation that nobody was given.
            let _ = forger.publish(Count { number: 0, twice: 0 }.as_bytes());
            clock::sleep(Duration::from_millis(20));
            robot.host.repair(&living);
            for &(_, pid) in &living {
                prop_assert!(process_lives(pid));
            }
            let mut relayed = relayed.borrow_mut();
            // What the counter says from now on passes through the relay again.
            let heard = await_message::<Count>(&tap, &mut relayed, |_, count| count.number > last.get());
            last.set(heard.number);
            let next =
                await_message::<Count>(&tap, &mut relayed, |_, count| count.number > heard.number + 10);
            last.set(next.number);
            wait_for("a page without damage", || robot.host.repair(&living).is_empty());
            Ok(())
        })
        .unwrap();
    drop((forger, relayed, tap));
    robot.take_down();
}

pub(crate) fn damage_is_said() {
    let mut robot = Robot::new(&[("count", "counter")]);
    let slot = robot.start("counter");
    let living = [(slot, robot.host.switchboard().slot(slot).unwrap().pid.load(Ordering::Acquire))];
    let check = |scribble: &dyn Fn(), expected: &str| {
        assert_eq!(robot.host.repair(&living), Vec::<String>::new());
        scribble();
        let said = robot.host.repair(&living);
        assert!(said.len() == 1 && said[0].contains(expected), "{said:?} should speak of `{expected}`");
        assert_eq!(robot.host.repair(&living), Vec::<String>::new(), "not mended, or said twice");
    };
    let board = robot.host.switchboard();
    check(&|| board.header().lockstep.store(1, Ordering::Release), "kind of time");
    check(&|| board.header().generations.store(u32::MAX, Ordering::Release), "count of starts");
    check(&|| board.topic(0).unwrap().generation.store(99, Ordering::Release), "`count`");
    check(&|| board.topic(0).unwrap().publisher.store(77, Ordering::Release), "`count`");
    check(&|| board.slot(slot).unwrap().is_service.store(0, Ordering::Release), "place of `counter`");
    check(&|| board.slot(slot).unwrap().generation.store(0, Ordering::Release), "place of `counter`");
    let file = |name: &str| robot.host.place().file(name);
    check(&|| std::fs::write(file("board.json"), "{}").unwrap(), "table of contents");
    check(&|| std::fs::remove_file(file("board.json")).unwrap(), "table of contents");
    assert!(board::manifest::Manifest::read(robot.host.place()).unwrap().topic("count").is_some());
    let segment = robot
        .host
        .place()
        .shared_memory()
        .into_iter()
        .find(|file| file.extension().is_some_and(|extension| extension == "dynamic"));
    let hidden = segment.unwrap();
    check(
        &|| std::fs::rename(&hidden, hidden.with_extension("hidden")).unwrap(),
        "files in shared memory were deleted",
    );
    robot.take_down();
}

/// A moment that the page cannot mean is no silence of half an hour.
pub(crate) fn nonsense_is_no_silence() {
    let mut robot = Robot::new(&[("count", "counter")]);
    let index = robot.start("counter");
    let slot = robot.host.switchboard().slot(index).unwrap();
    let now = clock::monotonic();
    for nonsense in [0, u64::MAX, now.as_nanos() + 3_600_000_000_000] {
        // A living process writes over it within a tenth of a second, so it may be gone already.
        slot.heartbeat_ns.store(nonsense, Ordering::Relaxed);
        slot.step_since_ns.store(nonsense, Ordering::Relaxed);
        let seen = (slot.silence(now), slot.in_step(now));
        assert!(seen.0.is_none_or(|silence| silence < Duration::from_secs(60)), "{seen:?}");
        assert!(seen.1.is_none_or(|silence| silence < Duration::from_secs(60)), "{seen:?}");
    }
    wait_for("its heartbeat", || slot.silence(clock::monotonic()).is_some());
    robot.take_down();
}
