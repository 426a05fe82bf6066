//! Poses, angles, polygons, grids, worlds, ray and cone casting: pure mathematics on nalgebra and parry.
//!
//! Frames: x forward, y left, z up; angles counter-clockwise; maps are right-handed. Units: metres and radians.

pub mod angle;
mod pose;

pub use nalgebra::{Point2, Vector2};
pub use pose::Pose2;
