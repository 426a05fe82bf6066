use crate::{Inputs, Params, ProximityGuard};
use messages::{
    Face, GuardReasonName, Odometry, Parameters, RangeScan, SonarAhead, SonarStatus, SonarStatusName,
    Stamped, Time, Verdict,
};
use proptest::prelude::*;

fn at(ms: u64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

fn ahead(stamp: Time, reading: &SonarAhead) -> Inputs<'_> {
    Inputs { ahead: Some(Stamped::new(stamp, reading)), ..Inputs::default() }
}

fn nothing() -> SonarAhead {
    SonarAhead { range_m: 2.55, status: SonarStatusName::Nothing.into(), reserved: 0 }
}

fn echo(range_m: f64) -> SonarAhead {
    SonarAhead { range_m, status: SonarStatusName::Echo.into(), reserved: 0 }
}

/// What the guard says after readings 20 ms apart.
#[track_caller]
fn check(readings: &[SonarAhead], expected: Verdict, reason: GuardReasonName) {
    let mut guard = ProximityGuard::new(Params::default()).expect("default");
    let mut said = guard.step(at(0), Inputs::default()).clearance;
    for (index, reading) in readings.iter().enumerate() {
        let now = at(20 * (1 + index as u64));
        said = guard.step(now, ahead(now, reading)).clearance;
    }
    assert_eq!((said.signal.get(), said.reason.get()), (Ok(expected), Ok(reason)), "{readings:?}");
    let faces = if reason == GuardReasonName::Violation { Face::Front as u32 } else { 0 };
    assert_eq!(said.violated_faces, faces);
}

#[test]
fn two_of_three_decide() {
    use GuardReasonName::{Clear, Settling, Start, Violation};
    check(&[], Verdict::Stop, Start);
    check(&[echo(0.5)], Verdict::Stop, Settling);
    check(&[echo(0.5), echo(0.5)], Verdict::Go, Clear);
    check(&[echo(0.5), echo(0.5), echo(0.05)], Verdict::Go, Clear);
    check(&[echo(0.5), echo(0.05), echo(0.5)], Verdict::Go, Clear);
    check(&[echo(0.5), echo(0.05), echo(0.05)], Verdict::Stop, Violation);
    check(&[echo(0.05), echo(0.05), echo(0.5), echo(0.5)], Verdict::Go, Clear);
    // At the threshold itself nothing is too near.
    check(&[echo(0.09), echo(0.09)], Verdict::Go, Clear);
    check(&[echo(0.0899), echo(0.0899)], Verdict::Stop, Violation);
}

#[test]
fn no_echo_is_free_and_too_near_is_not() {
    check(&[echo(1.0), nothing(), nothing()], Verdict::Go, GuardReasonName::Clear);
    check(&[echo(0.05), nothing(), nothing()], Verdict::Go, GuardReasonName::Clear);
    let near = SonarAhead { range_m: 0.03, status: SonarStatusName::TooNear.into(), reserved: 0 };
    check(&[near, near], Verdict::Stop, GuardReasonName::Violation);
}

#[test]
fn a_sensor_that_hears_nothing_may_be_deaf() {
    use GuardReasonName::{Clear, SensorFault, Start};
    // It was never heard to hear.
    check(&[nothing(); 20], Verdict::Stop, Start);
    let mut guard = ProximityGuard::new(Params::default()).expect("default");
    let mut now = at(0);
    let mut step = |travel_m: f64, range_m: Option<f32>| {
        now = now.after(std::time::Duration::from_millis(20));
        let odometry = Odometry { left_travel_m: travel_m, right_travel_m: travel_m, ..Odometry::default() };
        let header = RangeScan { range_max_m: 2.5, ..RangeScan::default() };
        let ranges = [range_m.unwrap_or(0.0)];
        let scan = range_m.map(|_| Stamped { elements: &ranges, ..Stamped::new(now, &header) });
        let reading = nothing();
        let inputs = Inputs { scan, odometry: Some(Stamped::new(now, &odometry)), ..ahead(now, &reading) };
        guard.step(now, inputs).clearance.reason.get()
    };
    // An echo of a scan is enough; a scan without one is not.
    let _ = step(0.0, Some(2.5));
    assert_eq!(step(0.0, Some(f32::NAN)), Ok(Start));
    assert_eq!(step(0.0, Some(1.2)), Ok(Clear));
    for way_dm in 1..=30 {
        assert_eq!(step(0.1 * f64::from(way_dm), None), Ok(Clear), "{way_dm} dm");
    }
    assert_eq!(step(3.1, None), Ok(SensorFault));
    // Encoders that begin anew are no way.
    assert_eq!(step(0.0, Some(1.2)), Ok(Clear));
}

#[test]
fn what_cannot_be_trusted_stops() {
    let fault = SonarAhead { range_m: 1.0, status: SonarStatusName::Fault.into(), reserved: 0 };
    check(&[echo(1.0), echo(1.0), fault], Verdict::Stop, GuardReasonName::SensorFault);
    check(&[echo(1.0), echo(1.0), echo(f64::NAN)], Verdict::Stop, GuardReasonName::SensorFault);
    check(&[echo(1.0), echo(1.0), echo(-1.0)], Verdict::Stop, GuardReasonName::SensorFault);
    // One good reading after a fault is not enough.
    check(&[echo(1.0), echo(1.0), fault, echo(1.0)], Verdict::Stop, GuardReasonName::Settling);
}

#[test]
fn silence_stops() {
    let mut guard = ProximityGuard::new(Params::default()).expect("default");
    let reading = echo(1.0);
    for ms in [0, 20] {
        guard.step(at(ms), ahead(at(ms), &reading));
    }
    let stale = ahead(at(20), &reading);
    assert_eq!(guard.step(at(120), stale).clearance.signal, Verdict::Go);
    let said = guard.step(at(121), stale).clearance;
    assert_eq!((said.signal.get(), said.reason.get()), (Ok(Verdict::Stop), Ok(GuardReasonName::Stale)));
    assert_eq!(said.changes, 2);
}

#[test]
fn refuses_nonsense_with_names_and_values() {
    let params = Params { stop_distance_m: f64::NAN, ..Params::default() };
    assert!(
        params
            .check()
            .is_err_and(|error| error.to_string().contains("`stop_distance_m` is not a finite number"))
    );
}

proptest! {
    #[test]
    fn go_only_after_two_free_readings(readings in proptest::collection::vec((any::<f64>(), any::<u32>()), 1..40)) {
        let mut guard = ProximityGuard::new(Params::default()).expect("default");
        let mut free = Vec::new();
        for (index, (range_m, status)) in readings.into_iter().enumerate() {
            let message = SonarAhead { range_m, status: SonarStatus(status % 6), reserved: 0 };
            let now = at(20 * index as u64);
            let said = guard.step(now, ahead(now, &message)).clearance;
            free.push(message.distance_m().is_some_and(|distance_m| distance_m >= 0.09));
            let last: Vec<bool> = free.iter().rev().take(3).copied().collect();
            if said.signal == Verdict::Go {
                prop_assert!(last.iter().filter(|free| **free).count() >= 2);
                prop_assert_eq!(said.violated_faces, 0);
            }
        }
    }
}
