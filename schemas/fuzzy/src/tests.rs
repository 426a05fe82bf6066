//! Cases of the engine and of FCL. Comparison with other programs is in `tests/reference`.

use super::fcl::{self, FclErrorKind};
use super::levels::Levels;
use super::quadrature::Quadrature;
use super::sampled::Sampled;
use super::terms::Piece;
use super::walk::Walk;
use super::*;
use proptest::prelude::*;

#[track_caller]
fn close(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance || (a.is_nan() && b.is_nan()), "{a} and {b}");
}

#[track_caller]
fn check_term(term: Term, x: f64, expected: f64) {
    assert_eq!(term.check(), Ok(()));
    close(term.membership(x), expected, 1e-12);
}

#[test]
fn memberships() {
    let inf = f64::INFINITY;
    check_term(Term::Triangle([0.0, 1.0, 3.0]), 0.5, 0.5);
    check_term(Term::Triangle([0.0, 1.0, 3.0]), 2.0, 0.5);
    check_term(Term::Triangle([0.0, 0.0, 1.0]), 0.0, 1.0);
    check_term(Term::Triangle([0.0, 0.0, 1.0]), -1e-9, 0.0);
    check_term(Term::Triangle([-inf, 0.0, 1.0]), -1e9, 1.0);
    check_term(Term::Triangle([0.0, 1.0, inf]), 1e9, 1.0);
    check_term(Term::Trapezoid([0.0, 1.0, 2.0, 4.0]), 3.0, 0.5);
    check_term(Term::Trapezoid([0.0, 1.0, 2.0, 4.0]), 1.5, 1.0);
    check_term(Term::Ramp([0.0, 2.0]), 0.5, 0.25);
    check_term(Term::Ramp([2.0, 0.0]), 0.5, 0.75);
    check_term(Term::Rectangle([0.0, 2.0]), 2.0, 1.0);
    check_term(Term::Rectangle([0.0, 2.0]), 2.1, 0.0);
    check_term(Term::Points(vec![(0.0, 0.2), (1.0, 1.0), (2.0, 0.4)]), -5.0, 0.2);
    check_term(Term::Points(vec![(0.0, 0.2), (1.0, 1.0), (2.0, 0.4)]), 0.5, 0.6);
    check_term(Term::Points(vec![(0.0, 0.2), (1.0, 1.0), (2.0, 0.4)]), 9.0, 0.4);
    check_term(Term::Gaussian([1.0, 2.0]), 3.0, (-0.5_f64).exp());
    check_term(Term::GaussianProduct([1.0, 2.0, 4.0, 1.0]), 2.0, 1.0);
    check_term(Term::GaussianProduct([1.0, 2.0, 4.0, 1.0]), 5.0, (-0.5_f64).exp());
    check_term(Term::Bell([0.0, 2.0, 3.0]), 2.0, 0.5);
    check_term(Term::Sigmoid([1.0, 20.0]), 1.0, 0.5);
    check_term(Term::SigmoidDifference([0.0, 9.0, 9.0, 8.0]), 4.0, 1.0 / (1.0 + (-36.0_f64).exp()));
    check_term(Term::SigmoidProduct([0.0, 9.0, -9.0, 8.0]), 4.0, (1.0 + (-36.0_f64).exp()).powi(-2));
    check_term(Term::SShape([0.0, 4.0]), 1.0, 0.125);
    check_term(Term::SShape([0.0, 4.0]), 3.0, 0.875);
    check_term(Term::ZShape([0.0, 4.0]), 1.0, 0.875);
    check_term(Term::PiShape([0.0, 4.0, 6.0, 10.0]), 5.0, 1.0);
    check_term(Term::Cosine([0.0, 2.0]), 0.5, 0.5);
    check_term(Term::Cosine([0.0, 2.0]), 1.1, 0.0);
    check_term(Term::Concave([0.0, 1.0]), 0.0, 0.5);
    check_term(Term::Concave([0.0, 1.0]), 2.0, 1.0);
    check_term(Term::Concave([1.0, 0.0]), 1.0, 0.5);
    check_term(Term::Spike([0.0, 10.0]), 1.0, (-1.0_f64).exp());
    check_term(Term::Binary([1.0, inf]), 2.0, 1.0);
    check_term(Term::Binary([1.0, -inf]), 2.0, 0.0);
    check_term(Term::Singleton(1.5), 1.5, 1.0);
    check_term(Term::Singleton(1.5), 1.6, 0.0);
    check_term(Term::Gaussian([1.0, 2.0]), f64::NAN, f64::NAN);
}

#[track_caller]
fn refused(term: Term) {
    assert!(term.check().is_err(), "{term:?}");
}

#[test]
fn terms_that_make_no_sense() {
    refused(Term::Triangle([1.0, 0.0, 2.0]));
    refused(Term::Triangle([1.0, 1.0, 1.0]));
    refused(Term::Triangle([0.0, f64::INFINITY, f64::INFINITY]));
    refused(Term::Triangle([f64::INFINITY, 1.0, 2.0]));
    refused(Term::Trapezoid([0.0, 1.0, f64::NAN, 2.0]));
    refused(Term::Ramp([1.0, 1.0]));
    refused(Term::Gaussian([1.0, 0.0]));
    refused(Term::Gaussian([f64::NAN, 1.0]));
    refused(Term::Points(vec![]));
    refused(Term::Points(vec![(0.0, 1.5)]));
    refused(Term::Points(vec![(1.0, 0.0), (0.0, 1.0)]));
    refused(Term::Linear(vec![]));
}

proptest! {
    #[test]
    fn norms_are_norms(a in 0.0..=1.0, b in 0.0..=1.0, c in 0.0..=1.0) {
        for (name, norm) in TNorm::KEYWORDS {
            close(norm.apply(a, 1.0), a, 1e-12);
            close(norm.apply(a, 0.0), 0.0, 1e-12);
            close(norm.apply(a, b), norm.apply(b, a), 1e-12);
            prop_assert!(norm.apply(a, b) <= a.min(b) + 1e-12, "{}", name);
            if c >= b {
                prop_assert!(norm.apply(a, c) >= norm.apply(a, b) - 1e-12, "{}", name);
            }
            close(norm.dual().apply(a, b), 1.0 - norm.apply(1.0 - a, 1.0 - b), 1e-9);
        }
        for (name, norm) in SNorm::KEYWORDS {
            close(norm.apply(a, 0.0), a, 1e-12);
            close(norm.apply(a, b), norm.apply(b, a), 1e-12);
            prop_assert!(norm.apply(a, b) >= a.max(b) - 1e-12, "{}", name);
        }
        for (_, hedge) in Hedge::KEYWORDS {
            prop_assert!((0.0..=1.0).contains(&hedge.apply(a)));
        }
    }

    /// The three exact ways, and the samples, agree on any terms of straight lines.
    #[test]
    fn exact_ways_agree(
        corners in prop::collection::vec(prop::collection::vec((0.0..10.0, 0.0..=1.0), 1..6), 1..5),
        degrees in prop::collection::vec(0.0..=1.0, 5),
    ) {
        let terms: Vec<Term> = corners.into_iter().map(|mut points: Vec<(f64, f64)>| {
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            Term::Points(points)
        }).collect();
        let universe = (1.0, 9.0);
        let pieces: Vec<Vec<Piece>> = terms.iter().map(|term| term.pieces(1.0, 9.0).unwrap()).collect();
        let degrees = &degrees[..terms.len()];
        for (accumulation, overlaps) in [(SNorm::Maximum, true), (SNorm::NormalisedSum, false)] {
            let levels = Levels::new(&pieces, 1.0, 9.0, overlaps).unwrap().centroid(degrees);
            let mut walk = Walk::new(&pieces, universe, TNorm::Minimum, accumulation).unwrap();
            let walked = walk.defuzzify(degrees, Method::Centroid);
            let mut quadrature = Quadrature::new(terms.clone(), universe, TNorm::Minimum, accumulation);
            let integrated = quadrature.centroid(degrees);
            let mut sampled = Sampled::new(&terms, universe, 20_000, TNorm::Minimum, accumulation);
            let summed = sampled.defuzzify(degrees, Method::Centroid);
            if let (Some(levels), Some(walked), Some(integrated), Some(summed)) = (levels, walked, integrated, summed) {
                // Tiny areas lose digits in the sums.
                let area_counts = degrees.iter().any(|degree| *degree > 1e-3) && quadrature_area(&terms, degrees) > 1e-2;
                if area_counts {
                    close(levels, walked, 1e-9);
                    close(integrated, walked, 1e-5);
                    close(summed, walked, 5e-2);
                }
            }
        }
    }

    #[test]
    fn walks_agree_with_samples(
        centres in prop::collection::vec(0.5..9.5, 2..5), degrees in prop::collection::vec(0.01..=1.0, 5),
    ) {
        let terms: Vec<Term> = centres.iter().map(|c| Term::Triangle([c - 1.5, *c, c + 1.0])).collect();
        let universe = (0.0, 10.0);
        let pieces: Vec<Vec<Piece>> = terms.iter().map(|term| term.pieces(0.0, 10.0).unwrap()).collect();
        let degrees = &degrees[..terms.len()];
        for activation in [TNorm::Minimum, TNorm::Product] {
            for accumulation in [SNorm::Maximum, SNorm::BoundedSum, SNorm::NormalisedSum] {
                let mut walk = Walk::new(&pieces, universe, activation, accumulation).unwrap();
                let mut sampled = Sampled::new(&terms, universe, 20_000, activation, accumulation);
                for method in [Method::Centroid, Method::Bisector] {
                    let (walked, summed) = (walk.defuzzify(degrees, method), sampled.defuzzify(degrees, method));
                    close(walked.unwrap(), summed.unwrap(), 2e-3);
                }
            }
        }
    }

    /// Whatever the text, reading ends with a system or an error inside the text.
    #[test]
    fn any_text_is_read_or_refused(cut in 0_usize..1400, noise in "[ -~\n]{0,12}", keep in any::<bool>()) {
        let mut text = SYSTEM.to_string();
        let cut = cut.min(text.len());
        let tail = text.split_off(cut);
        text += &noise;
        if keep {
            text += &tail;
        }
        if let Err(error) = fcl::read(&text) {
            prop_assert!(error.line >= 1 && error.line <= text.lines().count() + 1, "{}", error);
            prop_assert!(error.column >= 1);
        }
    }
}

fn quadrature_area(terms: &[Term], degrees: &[f64]) -> f64 {
    let height = |x: f64| {
        terms.iter().zip(degrees).map(|(term, degree)| term.membership(x).min(*degree)).fold(0.0, f64::max)
    };
    (0..800).map(|index| 0.01 * height(1.0 + 0.01 * f64::from(index))).sum()
}

const SYSTEM: &str = "FUNCTION_BLOCK heat (* every form *)
VAR_INPUT t, h : REAL; END_VAR
VAR_OUTPUT fan : REAL; END_VAR
FUZZIFY t
  RANGE := (-10..40); LOCK : RANGE;
  TERM cold := (0, 1) (20, 0); // shoulder
  TERM warm := trian 10 20 30;
  TERM hot := Ramp 20 30;
END_FUZZIFY
FUZZIFY h
  TERM dry := Gaussian 0.2 0.1;
  TERM wet := Sigmoid 0.6 2e1;
END_FUZZIFY
DEFUZZIFY fan
  RANGE := (0 .. 100);
  TERM off := Triangle -50 0 50;
  TERM half := Triangle 0 50 100;
  TERM full := Triangle 50 100 150;
  METHOD : COG; ACCU : MAX; DEFAULT := 7 | NC; LOCK : RANGE;
END_DEFUZZIFY
RULEBLOCK one
  AND : MIN; OR : MAX; ACT : MIN;
  RULE 1 : IF t IS cold OR t IS warm AND h IS dry THEN fan IS off;
  RULE 2 : if not (t is very cold or h is not somewhat wet) then fan is half with 0.5
  RULE third : IF t IS hot THEN fan IS full;
END_RULEBLOCK
END_FUNCTION_BLOCK";

#[test]
fn every_form_is_read_and_written() {
    let system = fcl::read(SYSTEM).unwrap();
    assert_eq!(fcl::read(&fcl::write(&system)), Ok(system.clone()));
    let rules = &system.blocks[0].rules;
    let is = |input, term| Box::new(Condition::Is { input, hedges: vec![], term });
    // AND binds closer than OR.
    assert_eq!(rules[0].condition, Condition::Or(is(0, 0), Box::new(Condition::And(is(0, 1), is(1, 0)))));
    assert_eq!(rules[1].weight, 0.5);
    let very = Condition::Is { input: 0, hedges: vec![Hedge::Very], term: 0 };
    let hedged = Condition::Is { input: 1, hedges: vec![Hedge::Not, Hedge::Somewhat], term: 1 };
    assert_eq!(rules[1].condition, Condition::Not(Box::new(Condition::Or(Box::new(very), Box::new(hedged)))));
    assert_eq!(rules[2].label, "third");
    assert_eq!(system.outputs[0].default, Fallback::PreviousOr(7.0));
    assert_eq!(system.inputs[0].range, Some((-10.0, 40.0)));
}

#[track_caller]
fn refuses(from: &str, to: &str, line: usize, column: usize) -> FclErrorKind {
    assert!(SYSTEM.contains(from), "{from}");
    let error = fcl::read(&SYSTEM.replacen(from, to, 1)).expect_err("the text is wrong");
    assert_eq!((error.line, error.column), (line, column), "{error}");
    error.kind
}

#[test]
fn errors_carry_their_place() {
    refuses("FUNCTION_BLOCK heat", "FUNKTION heat", 1, 1);
    refuses("(* every form *)", "(* every form", 1, 21);
    refuses("h : REAL", "t : REAL", 2, 14);
    refuses("FUZZIFY t", "FUZZIFY u", 4, 9);
    refuses("(-10..40)", "(40..-10)", 5, 12);
    refuses("(0, 1) (20, 0)", "(0, 1) (20, 2)", 6, 16);
    refuses("trian 10 20 30", "trian 10 20", 7, 16);
    refuses("trian 10 20 30", "trian 10 30 20", 7, 16);
    refuses("trian 10 20 30", "shape 10 20 30", 7, 16);
    refuses("TERM hot", "TERM warm", 8, 8);
    refuses("2e1;", "2e1", 13, 1);
    refuses("METHOD : COG", "METHOD : COF", 19, 12);
    refuses("AND : MIN", "AND : MAX", 22, 9);
    refuses("t IS cold OR", "t IS frosty OR", 23, 20);
    refuses("t IS cold OR", "t cold OR", 23, 17);
    refuses("h IS dry THEN", "k IS dry THEN", 23, 42);
    refuses("fan IS off", "fan IS dry", 23, 63);
    refuses("with 0.5", "with 1.5", 24, 83);
    refuses("fan IS full;", "fan IS full full;", 25, 45);
    refuses("END_RULEBLOCK", "?", 26, 1);
    refuses("END_FUNCTION_BLOCK", "END_FUNCTION_BLOCK x", 27, 20);
    let many = format!("IF {}t IS cold", "NOT ".repeat(300));
    assert_eq!(refuses("IF t IS cold", &many, 23, 15 + 256 * 4), FclErrorKind::TooLong(256));
}

#[track_caller]
fn refuses_with(from: &str, to: &str, line: usize, column: usize, words: &str) {
    let kind = refuses(from, to, line, column).to_string();
    assert!(kind.contains(words), "{kind}");
}

#[test]
fn what_is_given_twice_is_refused() {
    refuses_with("AND : MIN;", "AND : MIN; AND : PROD;", 22, 14, "AND is given twice here");
    refuses_with("OR : MAX;", "OR : MAX; OR : MAX;", 22, 24, "OR is given twice here");
    refuses_with("ACT : MIN;", "ACT : MIN; ACT : PROD;", 22, 35, "ACT is given twice here");
    refuses_with("ACT : MIN;", "ACCU : MAX; ACCU : MAX;", 22, 36, "ACCU is given twice here");
    refuses_with("METHOD : COG;", "METHOD : COG; METHOD : COA;", 19, 17, "METHOD is given twice here");
    refuses_with("ACCU : MAX;", "ACCU : MAX; ACCU : MAX;", 19, 29, "ACCU is given twice here");
    refuses_with("DEFAULT := 7 | NC;", "DEFAULT := 7; DEFAULT := NC;", 19, 43, "DEFAULT is given twice here");
    refuses_with(
        "LOCK : RANGE;\nEND_D",
        "LOCK : RANGE; LOCK : RANGE;\nEND_D",
        19,
        62,
        "LOCK is given twice here",
    );
    refuses_with(
        "RANGE := (0 .. 100);",
        "RANGE := (0 .. 100); RANGE := (0 .. 9);",
        15,
        24,
        "RANGE is given twice here",
    );
    refuses_with(
        "RANGE := (-10..40);",
        "RANGE := (-10..40); RANGE := (0 .. 9);",
        5,
        23,
        "RANGE is given twice here",
    );
    refuses_with(
        "FUZZIFY h",
        "FUZZIFY t END_FUZZIFY FUZZIFY h",
        10,
        9,
        "FUZZIFY of this variable is given twice",
    );
    refuses_with(
        "RULEBLOCK one",
        "DEFUZZIFY fan END_DEFUZZIFY RULEBLOCK one",
        21,
        11,
        "DEFUZZIFY of this variable is given twice",
    );
}

#[test]
fn comments_do_not_nest() {
    let told = "comments do not nest: the one that begins in line 1, column 21, ended in line 1, column 32";
    refuses_with("(* every form *)", "(* a (* b *) *)", 1, 34, told);
    refuses_with("(* every form *)", "/* a /* b */ */", 1, 34, told);
    refuses_with(
        "FUNCTION_BLOCK heat (* every form *)",
        "FUNCTION_BLOCK heat *)",
        1,
        21,
        "a comment ends here that has not begun",
    );
    // One kind within the other is text.
    let text = SYSTEM.replace("(* every form *)", "(* // /* a *) /* (* */ // (* /*");
    assert_eq!(fcl::read(&text), fcl::read(SYSTEM));
}

#[track_caller]
fn same_condition(a: &str, b: &str) {
    let condition = |condition: &str| {
        let system = fcl::read(&SYSTEM.replace("t IS hot", condition)).expect(condition);
        assert_eq!(fcl::read(&fcl::write(&system)), Ok(system.clone()), "{condition}");
        let mut engine = Engine::new(&system, Options::default()).expect(condition);
        [(15.0, 0.2), (25.0, 0.7), (5.0, 0.5)].map(|(t, h)| {
            engine.step(&[t, h]);
            engine.activations()[2].to_bits()
        })
    };
    assert_eq!(condition(a), condition(b), "{a} is not {b}");
}

#[test]
fn hedges_are_those_of_fuzzylite() {
    same_condition("t IS any", "t IS any hot");
    same_condition("t IS any", "t IS any cold");
    same_condition("t IS very any", "t IS any");
    same_condition("t IS not any", "t IS not any cold");
    same_condition("NOT t IS any", "t IS not any");
    same_condition("t IS any AND h IS dry", "h IS dry");
    same_condition("t IS any OR h IS dry", "t IS any");
    same_condition("(t IS any) AND (h IS ANY) AND h IS wet", "h IS wet");
    same_condition("t IS very very hot", "t IS very very hot");
    same_condition("t IS not very hot", "NOT t IS very hot");
    // A term of that name goes before the hedge.
    let named = SYSTEM.replace("TERM hot", "TERM any").replace("t IS hot", "t IS any");
    assert_eq!(
        fcl::read(&named).map(|system| system.blocks[0].rules[2].condition.clone()),
        Ok(Condition::Is { input: 0, hedges: vec![], term: 2 })
    );
    let bare = "FUNCTION_BLOCK b VAR_INPUT x : REAL; END_VAR VAR_OUTPUT y : REAL; END_VAR DEFUZZIFY y TERM a := 1; END_DEFUZZIFY
         RULEBLOCK RULE 1 : IF x IS any THEN y IS a; END_RULEBLOCK END_FUNCTION_BLOCK";
    assert!(matches!(fcl::read(bare).unwrap_err().kind, FclErrorKind::AnyOfNothing(_)));
    refuses_with("t IS hot", "t IS very", 25, 29, "variable t has no term THEN");
}

#[track_caller]
fn same_system(a: &str, b: &str) {
    assert!(SYSTEM.contains(a), "{a}");
    assert_eq!(fcl::read(&SYSTEM.replacen(a, b, 1)), fcl::read(SYSTEM), "{b}");
}

#[test]
fn other_ways_to_write_the_same() {
    for number in ["+10", "1e1", "1.E1", "10.", "1_0", "10.0_0", "0.1e+2", "+ 10"] {
        same_system("trian 10", &format!("trian {number}"));
    }
    for range in ["(- 10 .. 40)", "(-1_0..4_0)", "(-10.0..40.)", "(-.1e2..40)"] {
        same_system("(-10..40)", range);
    }
    same_system("trian 10 20 30", "TRIANGLE 10 20 30");
    same_system("Triangle -50 0 50", "Triangle - 50 0 50");
    same_system("VAR_INPUT t, h : REAL; END_VAR", "VAR_INPUT t : REAL; h : REAL; END_VAR");
    same_system("RULE 1 :", "rule 1.0:");
    let declared =
        SYSTEM.replace("RANGE := (0 .. 100);", "").replace("fan : REAL;", "fan : REAL; RANGE := (0 .. 100);");
    assert_eq!(fcl::read(&declared), fcl::read(SYSTEM));
    let range = SYSTEM
        .replace("h : REAL", "range : REAL")
        .replace("FUZZIFY h", "FUZZIFY range")
        .replace("h IS", "range IS")
        .replace("h is", "range is");
    assert_eq!(fcl::read(&range).unwrap().inputs[1].name, "range");
    refuses("trian 10 20", "trian 1__0 20", 7, 16);
    refuses("trian 10 20", "trian - -10 20", 7, 16);
    refuses("(-10..40)", "(- -10..40)", 5, 13);
}

#[test]
fn the_norms_of_jfuzzylogic_are_read() {
    for (name, norm) in [
        ("DMIN", TNorm::DrasticProduct),
        ("HAMACHER", TNorm::HamacherProduct),
        ("NIPMIN", TNorm::NilpotentMinimum),
    ] {
        assert_eq!(
            fcl::read(&SYSTEM.replace("AND : MIN", &format!("AND : {name}"))).unwrap().blocks[0].and,
            Some(norm)
        );
    }
    for (name, norm) in
        [("DMAX", SNorm::DrasticSum), ("EINSTEIN", SNorm::EinsteinSum), ("NIPMAX", SNorm::NilpotentMaximum)]
    {
        assert_eq!(
            fcl::read(&SYSTEM.replace("OR : MAX", &format!("OR : {name}"))).unwrap().blocks[0].or,
            Some(norm)
        );
    }
    let term = |text: &str| {
        fcl::read(&SYSTEM.replace("trian 10 20 30", text)).unwrap().inputs[0].terms[1].term.clone()
    };
    assert_eq!(term("GAUSS2 1 2 4 1"), Term::GaussianProduct([1.0, 2.0, 4.0, 1.0]));
    // The difference of two steps up, at 1 and at 4.
    let steps = term("DSIGM 3 1 5 4");
    let step = |x: f64, slope: f64, at: f64| 1.0 / (1.0 + (-slope * (x - at)).exp());
    close(steps.membership(2.0), step(2.0, 3.0, 1.0) - step(2.0, 5.0, 4.0), 1e-12);
}

#[test]
fn systems_are_bounded() {
    let many = |count: usize, item: fn(usize) -> String| (0..count).map(item).collect::<String>();
    let too_many = |from: &str, to: &str, words: &str| {
        assert!(SYSTEM.contains(from), "{from}");
        let error = fcl::read(&SYSTEM.replacen(from, to, 1)).expect_err(words).to_string();
        assert!(error.contains(words), "{error}");
    };
    too_many(
        "VAR_INPUT",
        &format!("VAR_INPUT {}", many(100, |n| format!("v{n} : REAL; "))),
        "more than 100 variables",
    );
    too_many(
        "TERM dry",
        &format!("{}TERM dry", many(200, |n| format!("TERM x{n} := {n}; "))),
        "more than 200 terms",
    );
    too_many("(0, 1) (20, 0)", &many(1001, |n| format!("({n}, 0) ")), "more than 1000 points");
    too_many(
        "END_RULEBLOCK",
        &format!("{}END_RULEBLOCK", many(10_000, |_| "RULE 9 : IF t IS hot THEN fan IS off; ".to_owned())),
        "more than 10000 rules",
    );
    too_many(
        "END_FUNCTION_BLOCK",
        &many(4, |_| {
            format!("RULEBLOCK {} END_RULEBLOCK ", "RULE 9 : IF t IS hot THEN fan IS off; ".repeat(3000))
        }),
        "more than 10000 rules",
    );
    too_many("FUNCTION_BLOCK heat", &"a ".repeat(400_000), "more than 300000 words");
    too_many("FUNCTION_BLOCK heat", &"a".repeat(201), "more than 200 characters in a name");
}

#[track_caller]
fn check_heat(inputs: [f64; 2], expected_activations: [f64; 3]) {
    let mut engine = Engine::new(&fcl::read(SYSTEM).unwrap(), Options::default()).unwrap();
    engine.step(&inputs);
    for (ours, expected) in engine.activations().iter().zip(expected_activations) {
        close(*ours, expected, 1e-9);
    }
}

#[test]
fn activations_follow_the_operators() {
    let dry = |h: f64| (-(h - 0.2_f64).powi(2) / 0.02).exp();
    let wet = |h: f64| 1.0 / (1.0 + (-20.0 * (h - 0.6)).exp());
    let second = |cold: f64, h: f64| 0.5 * (1.0 - (cold * cold).max(1.0 - wet(h).sqrt()));
    check_heat([15.0, 0.2], [0.5, second(0.25, 0.2), 0.0]);
    check_heat([20.0, 0.3], [dry(0.3), second(0.0, 0.3), 0.0]);
    check_heat([25.0, 0.7], [dry(0.7).min(0.5), second(0.0, 0.7), 0.5]);
    check_heat([99.0, 0.7], [0.0, second(0.0, 0.7), 1.0]);
    check_heat([f64::NEG_INFINITY, 0.7], [1.0, 0.0, 0.0]);
    check_heat([f64::NAN, 0.7], [0.0, 0.0, 0.0]);
}

#[test]
fn silence_holds_or_falls_back() {
    let mut engine = Engine::new(&fcl::read(SYSTEM).unwrap(), Options::default()).unwrap();
    close(engine.step(&[f64::NAN, 0.5])[0], 7.0, 0.0);
    let spoken = engine.step(&[35.0, 0.0])[0];
    assert!(spoken > 60.0, "{spoken}");
    close(engine.step(&[20.0, f64::NAN])[0], spoken, 0.0);
    close(engine.step(&[20.0])[0], spoken, 0.0);
    engine.reset();
    close(engine.step(&[])[0], 7.0, 0.0);
}

/// One input on [0, 10] that is its own degree times ten, one output with the given section and rules.
#[track_caller]
fn check_output(section: &str, block: &str, x: f64, expected: f64) {
    let text = format!(
        "FUNCTION_BLOCK b VAR_INPUT x : REAL; END_VAR VAR_OUTPUT y : REAL; END_VAR
         FUZZIFY x TERM up := Ramp 0 10; TERM down := Ramp 10 0; END_FUZZIFY
         DEFUZZIFY y {section} END_DEFUZZIFY
         RULEBLOCK {block} RULE 1 : IF x IS up THEN y IS a; RULE 2 : IF x IS down THEN y IS b; END_RULEBLOCK END_FUNCTION_BLOCK"
    );
    let mut engine = Engine::new(&fcl::read(&text).unwrap(), Options::default()).unwrap();
    close(engine.step(&[x])[0], expected, 1e-9);
}

#[test]
fn defuzzifications() {
    let squares = "TERM a := Rectangle 0 2; TERM b := Rectangle 4 6;";
    let with = |method: &str| format!("{squares} METHOD : {method};");
    check_output(&with("COG"), "", 5.0, 3.0);
    check_output(&with("COG"), "", 7.5, (0.75 * 1.0 + 0.25 * 5.0) / 1.0);
    check_output(&with("COG; RANGE := (0 .. 5)"), "", 5.0, (2.0 * 1.0 + 1.0 * 4.5) / 3.0);
    check_output(&with("COA"), "", 7.5, 2.0 * (1.0 / 1.5));
    check_output(&with("COA"), "", 2.5, 4.0 + 2.0 * (0.5 / 1.5));
    check_output(&with("MM"), "", 7.5, 1.0);
    check_output(&with("MM"), "", 5.0, 3.0);
    check_output(&with("LM"), "", 2.5, 4.0);
    check_output(&with("RM"), "", 7.5, 2.0);
    check_output("TERM a := Triangle 0 1 2; TERM b := Triangle 4 5 6; METHOD : MM;", "ACT : PROD;", 7.5, 1.0);
    check_output("TERM a := 3; TERM b := 7; METHOD : COGS;", "", 7.5, 4.0);
    check_output("TERM a := 3; TERM b := 7; METHOD : COGSS;", "", 7.5, 4.0);
    check_output("TERM a := Linear 2 1; TERM b := Constant 0; METHOD : COGS;", "", 7.5, 0.75 * 16.0);
    // Triangles under the sum: areas clipped at 3/4 and 1/4 are 15/16 and 7/16.
    let triangles = "TERM a := Triangle 0 1 2; TERM b := Triangle 4 5 6; METHOD : COG; ACCU : NSUM;";
    check_output(triangles, "", 7.5, (15.0 * 1.0 + 7.0 * 5.0) / 22.0);
    check_output(
        "TERM a := Gaussian 2 0.1; TERM b := Gaussian 8 0.1; METHOD : COG; RANGE := (0 .. 10);",
        "",
        5.0,
        5.0,
    );
    check_output("TERM a := 3; TERM b := 7; METHOD : COGS; RANGE := (5 .. 9); LOCK : RANGE;", "", 7.5, 5.0);
}

#[track_caller]
fn check_kernel(section: &str, block: &str, expected: &str) {
    let text = format!(
        "FUNCTION_BLOCK b VAR_INPUT x : REAL; END_VAR VAR_OUTPUT y : REAL; END_VAR FUZZIFY x TERM up := Ramp 0 10; END_FUZZIFY
         DEFUZZIFY y RANGE := (0 .. 9); {section} END_DEFUZZIFY RULEBLOCK {block} RULE 1 : IF x IS up THEN y IS a; END_RULEBLOCK
         END_FUNCTION_BLOCK"
    );
    let engine = Engine::new(&fcl::read(&text).unwrap(), Options::default()).unwrap();
    assert_eq!(engine.kernel(0), Some(expected));
}

#[test]
fn kernels() {
    check_kernel("TERM a := Triangle 1 2 3;", "", "levels");
    check_kernel("TERM a := Triangle 1 2 3;", "ACT : PROD;", "walk");
    check_kernel("TERM a := Triangle 1 2 3; ACCU : BSUM;", "", "walk");
    check_kernel("TERM a := Triangle 1 2 3; METHOD : COA;", "", "walk");
    check_kernel("TERM a := Triangle 1 2 3; ACCU : ASUM;", "", "quadrature");
    check_kernel("TERM a := Gaussian 3 1;", "", "quadrature");
    check_kernel("TERM a := Gaussian 3 1; METHOD : MM;", "", "sampled");
    check_kernel("TERM a := 3; METHOD : COGS;", "", "weighted");
}

#[track_caller]
fn check_engine_refuses(text: &str, words: &str) {
    let text = SYSTEM.replacen("METHOD : COG", text, 1);
    let system = fcl::read(&text).unwrap();
    let error = Engine::new(&system, Options::default()).expect_err("the system is wrong").to_string();
    assert!(error.contains(words), "{error}");
}

#[test]
fn systems_that_make_no_sense() {
    check_engine_refuses("METHOD : COGS", "term off of fan is an area, but COGS");
    check_engine_refuses("TERM x := 3; METHOD : COG", "term x of fan is a single value, but COG");
    check_engine_refuses("TERM x := Linear 1 2; METHOD : COG", "a linear function of the 2 inputs");
    let sampled = Options { integration: Integration::Sampled { resolution: 0 }, ..Options::default() };
    assert_eq!(Engine::new(&fcl::read(SYSTEM).unwrap(), sampled).map(|_| ()), Err(EngineError::NoSamples));
}
