//! Where the hull goes until it stands.

use crate::Params;
use geometry::{Frame, Hull, Point2, Pose2};
use messages::WheelSpeeds;

/// The motion is followed in steps of this length while a command holds, and of that length while the wheels
/// come to rest.
const HELD_STEP_S: f64 = 0.025;
const BRAKING_STEP_S: f64 = 0.05;
/// However slowly the motors brake: the rest of the way is not looked at.
const STEPS_MAX: usize = 60;
/// A robot that stands nearer to something than it should may drive on beside it, no nearer but for this, for
/// noise, until it is so much nearer; and what is nearer still may not come nearer at all.
const NOISE_M: f64 = 0.001;
const NEARER_SHARE: f64 = 0.75;
const NEAREST_SHARE: f64 = 0.5;

/// Where the robot is, seen from where it is now, until it stands: the wheels turn as `now`, are told `told`
/// until the motors' watchdog knows that nobody tells them anything any more, and brake.
pub(crate) fn way(params: &Params, now: WheelSpeeds, told: WheelSpeeds) -> Vec<Pose2> {
    let held_s = f64::from(params.motor_watchdog_ms) * 1e-3;
    let (mut rims, mut pose, mut time_s) = (now, Pose2::IDENTITY, 0.0);
    let mut poses = Vec::with_capacity(24);
    while poses.len() < STEPS_MAX {
        let is_held = time_s < held_s - 1e-9;
        if !is_held && rims == WheelSpeeds::ZERO {
            break;
        }
        let step_s = if is_held { HELD_STEP_S.min(held_s - time_s) } else { BRAKING_STEP_S };
        let aim = if is_held { told } else { WheelSpeeds::ZERO };
        let change_mps = params.deceleration_m_per_s2 * step_s;
        let next = WheelSpeeds {
            left_mps: towards(rims.left_mps, aim.left_mps, change_mps),
            right_mps: towards(rims.right_mps, aim.right_mps, change_mps),
        };
        // Midway, as they change evenly.
        let left_m = 0.5 * (rims.left_mps + next.left_mps) * step_s;
        let right_m = 0.5 * (rims.right_mps + next.right_mps) * step_s;
        pose = pose.after_arc(0.5 * (left_m + right_m), (right_m - left_m) / params.wheel_track_m);
        poses.push(pose);
        (rims, time_s) = (next, time_s + step_s);
    }
    poses
}

fn towards(present: f64, wanted: f64, change: f64) -> f64 {
    present + (wanted - present).clamp(-change, change)
}

/// Whether the hull keeps `margin_m` from all these points, which are given in the robot's present frame.
pub(crate) fn keeps_off(hull: &Hull, poses: &[Pose2], points: &[Point2<f64>], margin_m: f64) -> bool {
    let present = points.iter().map(|point| hull.distance_to_m(*point));
    // Where something is inside the hull, the guard errs.
    let nearest_m = present.filter(|distance_m| *distance_m > 0.0).fold(f64::INFINITY, f64::min);
    let less_noise_m = |now_m: f64| if now_m > NEARER_SHARE * margin_m { now_m - NOISE_M } else { now_m };
    let kept_m = less_noise_m(nearest_m).clamp(NEAREST_SHARE * margin_m, margin_m);
    let frames: Vec<Frame> = poses.iter().map(|pose| pose.frame()).collect();
    // No corner comes farther than this from where it is now.
    let reach = |pose: &Pose2| pose.position().coords.norm() + hull.radius_m() * pose.heading_rad.abs();
    let reach_m = poses.iter().map(reach).fold(0.0, f64::max);
    points.iter().all(|point| {
        let now_m = hull.distance_to_m(*point);
        let least_m = kept_m.min(less_noise_m(now_m));
        now_m - reach_m >= least_m
            || frames
                .iter()
                .all(|frame| hull.distance_to_m(frame.inverse_transform(*point)) >= least_m - 1e-9)
    })
}
