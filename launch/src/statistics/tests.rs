//! Against SciPy 1.17 (`stats.t.ppf`, `stats.ttest_rel`, `stats.binomtest`) and NumPy (`quantile`).

use super::*;
use proptest::prelude::*;

#[track_caller]
fn check_close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} is not {expected}");
}

#[track_caller]
fn check_student(freedom: usize, expected: f64) {
    check_close(student_quantile(freedom), expected, 1e-9);
}

#[test]
fn quantiles_of_student() {
    check_student(1, 12.706_204_736_174_694);
    check_student(2, 4.302_652_729_749_462);
    check_student(3, 3.182_446_305_283_708);
    check_student(5, 2.570_581_835_636_315);
    check_student(8, 2.306_004_135_204_166);
    check_student(15, 2.131_449_545_559_776);
    check_student(29, 2.045_229_642_132_703);
    check_student(69, 1.994_945_415_107_237);
    check_student(239, 1.969_939_405_916_958);
    check_close(student_quantile(100_000), 1.959_987_7, 1e-6);
    assert!(student_quantile(0).is_nan());
}

#[test]
fn means_have_intervals() {
    let found = summary(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]).unwrap();
    check_close(found.mean, 5.0, 1e-12);
    check_close(found.deviation, (32.0_f64 / 7.0).sqrt(), 1e-12);
    check_close(found.margin, 2.364_624_251_592_784 * (32.0_f64 / 7.0 / 8.0).sqrt(), 1e-9);
    let alone = summary(&[3.0]).unwrap();
    assert!(alone.mean == 3.0 && alone.margin.is_nan() && alone.deviation.is_nan());
    assert_eq!((alone.interval(), alone.is_apart_from_zero()), (None, false));
    assert_eq!(summary(&[]), None);
}

#[track_caller]
fn check_difference(pairs: &[[f64; 2]], low: f64, high: f64, is_apart: bool) {
    let differences: Vec<f64> = pairs.iter().map(|[before, after]| after - before).collect();
    let found = summary(&differences).unwrap();
    let [found_low, found_high] = found.interval().unwrap();
    check_close(found_low, low, 1e-9);
    check_close(found_high, high, 1e-9);
    assert_eq!(found.is_apart_from_zero(), is_apart);
}

#[test]
fn paired_differences_have_intervals() {
    let before = [70.25, 74.5, 68.0, 90.75, 71.5, 66.0, 103.25, 80.5];
    let after = [69.0, 70.25, 68.5, 84.0, 70.0, 65.25, 95.5, 81.0];
    let pairs: Vec<[f64; 2]> = before.into_iter().zip(after).map(|(before, after)| [before, after]).collect();
    check_difference(&pairs, -5.339_662_982_308_957, 0.027_162_982_308_956, false);
    // The same without the last pair: `stats.t.interval(0.95, 6, ..)`.
    check_difference(&pairs[..7], -6.049_551_459_860_67, -0.164_734_254_425_044, true);
    check_difference(&[[1.0, 1.5], [1.0, 2.0]], -2.426_551_184_043_674, 3.926_551_184_043_674, false);
    // No spread at all: the difference is what it is.
    check_difference(&[[1.0, 1.5], [2.0, 2.5]], 0.5, 0.5, true);
}

#[track_caller]
fn check_mcnemar(only_one: usize, only_other: usize, expected: f64) {
    check_close(mcnemar(only_one, only_other), expected, 1e-9);
    check_close(mcnemar(only_other, only_one), expected, 1e-9);
}

#[test]
fn uneven_passes_are_judged() {
    check_mcnemar(0, 0, 1.0);
    check_mcnemar(0, 5, 0.0625);
    check_mcnemar(1, 5, 0.218_75);
    check_mcnemar(3, 12, 0.035_156_25);
    check_mcnemar(10, 10, 1.0);
    check_mcnemar(40, 70, 0.005_447_429_511_444_5);
    check_mcnemar(600, 700, 0.006_015_793_861_045_0);
}

#[track_caller]
fn check_wilson(successes: usize, count: usize, low: f64, high: f64) {
    let (found_low, found_high) = wilson(successes, count).unwrap();
    check_close(found_low, low, 1e-12);
    check_close(found_high, high, 1e-12);
}

#[test]
fn rates_have_intervals() {
    // The first five are Newcombe 1998, table I, method 3, too.
    check_wilson(81, 263, 0.255_288_519_878_274, 0.366_209_576_982_800);
    check_wilson(15, 148, 0.062_386_399_530_736, 0.160_487_241_723_308);
    check_wilson(0, 20, 0.0, 0.161_125_158_052_819);
    check_wilson(1, 29, 0.006_113_214_292_763, 0.171_755_218_793_203);
    check_wilson(20, 20, 0.838_874_841_947_181, 1.0);
    check_wilson(13, 14, 0.685_312_955_758_489, 0.987_277_784_752_109);
    assert_eq!(wilson(0, 0), None);
}

#[track_caller]
fn check_quantile(share: f64, expected: f64) {
    let values = sorted(&[5.0, 1.0, 2.0, 3.0, 4.0, 100.0, -3.5, 0.25]);
    check_close(quantile(&values, share).unwrap(), expected, 1e-12);
}

#[test]
fn quantiles_lie_between_neighbours() {
    check_quantile(0.0, -3.5);
    check_quantile(0.01, -3.2375);
    check_quantile(0.25, 0.8125);
    check_quantile(0.5, 2.5);
    check_quantile(0.75, 4.25);
    check_quantile(0.95, 66.75);
    check_quantile(0.99, 93.35);
    check_quantile(1.0, 100.0);
    assert_eq!((quantile(&[], 0.5), quantile(&[7.0], 0.99)), (None, Some(7.0)));
}

proptest! {
    #[test]
    fn intervals_hold_the_rate(count in 1_usize..500, part in 0.0_f64..=1.0) {
        let successes = (part * count as f64).round() as usize;
        let (low, high) = wilson(successes, count).unwrap();
        let rate = successes as f64 / count as f64;
        prop_assert!(0.0 <= low && low <= rate && rate <= high && high <= 1.0);
    }

    #[test]
    fn a_share_of_coins_is_a_probability(one in 0_usize..2000, other in 0_usize..2000) {
        let p = mcnemar(one, other);
        prop_assert!(p > 0.0 || one.abs_diff(other) > 500);
        prop_assert!((0.0..=1.0).contains(&p));
    }
}
