//! The ultrasonic robot in the three arenas: found from one to three scans without a pose. This is a sample;
//! a hundred starts in each: `cargo bench -p particle-localiser --bench accuracy`.

mod support;

use support::arenas::{arena, tally};

#[test]
fn the_first_two_arenas_are_told_by_three_scans() {
    for number in [1, 2] {
        assert_eq!(tally(&arena(number), 4, 3).right, 4, "arena {number}");
    }
}

#[test]
fn the_third_arena_is_seen_to_repeat_itself() {
    let tally = tally(&arena(3), 5, 2);
    assert!(tally.ambiguous >= 2 && tally.wrong == 0, "{tally:?}");
}
