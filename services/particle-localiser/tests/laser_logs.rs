//! Recorded laser drives: maps of the even scans, localised on the odd ones from raw odometry.

mod support;

use particle_localiser::Params;
use support::{Log, load, run};

fn tracking_params() -> Params {
    Params { min_particles: 500, max_particles: 500, ..Params::default() }
}

fn report(name: &str, log: &Log, params: &Params, seeds: u64) {
    let mut all = (Vec::new(), Vec::new());
    let mut lost = 0;
    let mut worst: f64 = 0.0;
    for seed in 0..seeds {
        let run = run(log, params.clone(), seed, 0, f64::INFINITY, true);
        let (m, rad) = run.median();
        let end = run.errors.last().map_or(9.9, |e| e.0);
        lost += u32::from(end > 1.0);
        let far = run.errors.iter().filter(|e| e.0 > 1.0).count();
        worst = worst.max(run.quantile(1.0).0);
        println!("{name} seed {seed}: median {m:.4} m {:.3} deg, 95% {:.3} m {:.2} deg, worst {:.2} m, {far} of {} beyond 1 m", rad.to_degrees(), run.quantile(0.95).0, run.quantile(0.95).1.to_degrees(), run.quantile(1.0).0, run.errors.len());
        all.0.push(m);
        all.1.push(rad);
    }
    println!("{name}: lost {lost} of {seeds}, worst {worst:.2}");
}

#[test]
#[ignore = "figures for people, minutes"]
fn figures() {
    let seeds = std::env::var("SEEDS").ok().and_then(|s| s.parse().ok()).unwrap_or(2);
    let only = std::env::var("LOG").unwrap_or_default();
    let patch = std::env::var("PARAMS").unwrap_or("{}".into());
    let mut value = serde_json::to_value(tracking_params()).unwrap();
    let patch: serde_json::Value = serde_json::from_str(&patch).unwrap();
    for (key, v) in patch.as_object().unwrap() {
        value[key] = v.clone();
    }
    let params: Params = serde_json::from_value(value).unwrap();
    for name in ["intel", "freiburg-079", "csail", "belgioioso"] {
        if !only.is_empty() && only != name { continue; }
        let Some(log) = load(name) else { continue };
        report(name, &log, &params, seeds);
    }
}

#[test]
#[ignore = "figures for people, minutes"]
fn global_figures() {
    let starts: usize = std::env::var("STARTS").ok().and_then(|s| s.parse().ok()).unwrap_or(10);
    let only = std::env::var("LOG").unwrap_or_default();
    let patch = std::env::var("PARAMS").unwrap_or("{}".into());
    let mut value = serde_json::to_value(Params::default()).unwrap();
    let patch: serde_json::Value = serde_json::from_str(&patch).unwrap();
    for (key, v) in patch.as_object().unwrap() {
        value[key] = v.clone();
    }
    let params: Params = serde_json::from_value(value).unwrap();
    for name in ["intel", "freiburg-079"] {
        if !only.is_empty() && only != name { continue; }
        let Some(log) = load(name) else { continue };
        let scans = log.entries.iter().filter(|e| matches!(e, support::Entry::Scan { .. })).count();
        let mut right = 0;
        for start in 0..starts {
            let first = start * (scans * 9 / 10) / starts;
            let run = run(&log, params.clone(), start as u64, first, 10.0, false);
            let end = run.errors.last().unwrap();
            let ok = end.0 < 0.5 && *run.found.last().unwrap();
            right += usize::from(ok);
            let first_right = run.errors.iter().zip(&run.path_m).find(|(e, _)| e.0 < 0.3).map(|(_, p)| *p);
            println!("{name} start {first}: end {:.2} m after {:.1} m, {:?}, right first at {first_right:?}, particles {:?}", end.0, run.path_m.last().unwrap(), run.last.state, &run.particles[..run.particles.len().min(8)]);
        }
        println!("{name}: {right} of {starts} right");
    }
}
