//! Poses, angles, polygons, grids, worlds, ray and cone casting: pure mathematics on nalgebra and parry.
//!
//! Frames: x forward, y left, z up; angles counter-clockwise; maps are right-handed. Units: metres and
//! radians.
//!
//! ```
//! use geometry::{Point2, Pose2, Segment, Walls};
//! use std::f64::consts::FRAC_PI_2;
//!
//! // A robot at (2, 1) that faces along y, and a wall 3 m ahead of it.
//! let robot = Pose2::new(2.0, 1.0, FRAC_PI_2);
//! let walls = Walls::new([Segment::between([0.0, 4.0], [5.0, 4.0])]);
//!
//! let hit = walls.cast(robot.position(), robot.heading_rad, 10.0).expect("there is a wall");
//! assert!((hit.range_m - 3.0).abs() < 1e-9);
//! // One metre ahead of the robot, in the frame of the map.
//! assert!((robot.transform(Point2::new(1.0, 0.0)) - Point2::new(2.0, 2.0)).norm() < 1e-9);
//! ```
//!
//! [`World`] reads the floor plans of `launch/worlds`, [`OccupancyGrid`] the maps of ROS. A [`Scene`] is what
//! simulated sensors look at: walls and bodies, by [`Ray`] and by [`Cone`].

pub mod angle;
mod body;
mod cone;
mod grid;
mod hull;
mod map_file;
mod polygon;
mod pose;
mod scene;
mod segment;
mod sweep;
mod walls;
pub mod world;

pub use body::{Body, BodyKind, Prism};
pub use cone::Cone;
pub use grid::{
    Cell, CellsAlong, CellsBetween, Grid, GridError, GridFrame, LONGEST_SIDE, MOST_CELLS, Occupancy,
    OccupancyGrid, log_odds, probability,
};
pub use hull::Hull;
pub use map_file::{MapError, MapHeader, MapImage, MapMode, MapProblem, Pixel};
pub use nalgebra::{Point2, Vector2};
pub use polygon::{Polygon, PolygonError, Shape, is_simple};
pub use pose::{Frame, Pose2};
pub use scene::{BodyId, Clearance, Hit, Ray, Scene, Surface};
pub use segment::Segment;
pub use walls::{WallHit, Walls};
pub use world::{World, WorldError, WorldProblem, WorldScene};

#[cfg(test)]
mod tests;
