//! The mapper on recorded drives: a map of every other scan is the place in which the others were taken.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test that cannot go on shall stop, and says why"
)]

use geometry::{MapImage, MapMode, OccupancyGrid, Point2, Pose2};
use log_player::{Due, Format, LogPlayer, Timing};
use mapper::{Inputs, Mapper, Params};
use messages::{LocationState, LocationStateName, PoseEstimate, RangeScan, Stamped, Time};
use std::path::Path;

/// What the scans that are not in the map say of it.
#[derive(Debug)]
struct Agreement {
    /// Scans in the map.
    scans: u64,
    /// Part of the beams' ends that lie in an occupied cell, or beside one.
    ends: f64,
    /// Part of the beams' middles that lie in a cell that is likelier free.
    middles: f64,
    /// Part of the robot's places that do.
    places: f64,
}

/// A drive as scans, each with the true pose: nothing when the log is not there.
fn drive(name: &str) -> Option<Vec<(Pose2, RangeScan, Vec<f32>)>> {
    let file =
        format!("{}/../../shared/data/laser_carmen/{name}-corrected.log.gz", env!("CARGO_MANIFEST_DIR"));
    if !Path::new(&file).exists() {
        println!("skipped: {file} is not there");
        return None;
    }
    let params = log_player::Params {
        file,
        format: Format::Carmen,
        timing: Timing::Order,
        ..log_player::Params::default()
    };
    let log = log_player::load(&params).unwrap();
    let mut player = LogPlayer::new(&params, log).unwrap();
    player.step(Time::ZERO);
    let (mut scans, mut truth, mut waiting) = (Vec::new(), None, None);
    for due in player.step(Time::from_secs_f64(1e9)) {
        match due {
            Due::Truth(pose) => truth = Some(Pose2::new(pose.x_m, pose.y_m, pose.heading_rad)),
            Due::Scan(header, ranges) => waiting = Some((*header, ranges.clone())),
            _ => continue,
        }
        if let (Some(pose), Some((header, ranges))) = (truth, &waiting) {
            scans.push((pose, *header, ranges.clone()));
            (truth, waiting) = (None, None);
        }
    }
    Some(scans)
}

fn agreement(name: &str) -> Option<Agreement> {
    let scans = drive(name)?;
    let middle = |axis: fn(&Pose2) -> f64| {
        let places = || scans.iter().map(|(pose, ..)| axis(pose));
        0.5 * (places().fold(f64::INFINITY, f64::min) + places().fold(f64::NEG_INFINITY, f64::max))
    };
    let (x_m, y_m) = (middle(|pose| pose.x_m), middle(|pose| pose.y_m));
    let params = Params {
        min_x_m: x_m - 40.0,
        min_y_m: y_m - 40.0,
        width_m: 80.0,
        height_m: 80.0,
        range_max_m: 20.0,
        clear_max_m: 0.0,
        ..Params::default()
    };
    let mut mapper = Mapper::new(params).unwrap();
    for (index, (pose, header, ranges)) in scans.iter().enumerate().step_by(2) {
        let now = Time::from_secs_f64(0.5 * index as f64);
        let state = LocationState::from(LocationStateName::Tracking);
        let Pose2 { x_m, y_m, heading_rad } = *pose;
        let pose = PoseEstimate { x_m, y_m, heading_rad, state, ..PoseEstimate::default() };
        let scan = Stamped::with_elements(now, header, ranges.as_slice());
        mapper.step(now, Inputs { pose: Some(Stamped::new(now, &pose)), scan: Some(scan) });
    }
    if let Ok(folder) = std::env::var("CORKBOARD_MAPS") {
        let file = Path::new(&folder).join(format!("{name}.yaml"));
        mapper.map().to_trinary_grid().save(file, MapMode::Trinary, MapImage::Png).unwrap();
    }
    let grid = mapper.map().to_grid();
    let (mut ends, mut middles, mut places) = (Vec::new(), Vec::new(), Vec::new());
    for (pose, header, ranges) in scans.iter().skip(1).step_by(2) {
        let free = |place| grid.at(place).and_then(|cell| cell.percent()).is_some_and(|percent| percent < 50);
        places.push(free(pose.position()));
        for beam in 0..ranges.len() {
            let Some((direction_rad, range_m)) =
                header.beam(ranges, beam).filter(|(_, range_m)| *range_m < 20.0)
            else {
                continue;
            };
            let (sine, cosine) = direction_rad.sin_cos();
            let at = |range_m: f64| {
                pose.transform(Point2::new(
                    header.sensor_x_m + cosine * range_m,
                    header.sensor_y_m + sine * range_m,
                ))
            };
            ends.push(is_near_occupied(&grid, at(range_m)));
            middles.push(free(at(0.5 * range_m)));
        }
    }
    let part = |values: &[bool]| values.iter().filter(|value| **value).count() as f64 / values.len() as f64;
    let scans = mapper.header().scans;
    Some(Agreement { scans, ends: part(&ends), middles: part(&middles), places: part(&places) })
}

/// Whether one of the nine cells around a place is likelier occupied.
fn is_near_occupied(grid: &OccupancyGrid, place: Point2<f64>) -> bool {
    let side_m = grid.frame().resolution_m();
    (-1..=1).flat_map(|row| (-1..=1).map(move |column| (column, row))).any(|(column, row)| {
        let place = Point2::new(place.x + f64::from(column) * side_m, place.y + f64::from(row) * side_m);
        grid.at(place).and_then(|cell| cell.percent()).is_some_and(|percent| percent > 50)
    })
}

#[track_caller]
fn check_drive(name: &str, least: Agreement) {
    let Some(found) = agreement(name) else { return };
    println!("{name}: {found:?}");
    assert!(found.scans >= least.scans, "{name}: {found:?}");
    assert!(found.ends >= least.ends, "{name}: {found:?}");
    assert!(found.middles >= least.middles && found.places >= least.places, "{name}: {found:?}");
}

#[test]
fn half_of_a_drive_maps_the_other_half() {
    check_drive("freiburg-079", Agreement { scans: 2000, ends: 0.75, middles: 0.98, places: 0.99 });
    check_drive("intel", Agreement { scans: 450, ends: 0.75, middles: 0.98, places: 0.99 });
}
