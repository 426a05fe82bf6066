//! Poses, angles, polygons, grids, worlds, ray and cone casting: pure mathematics on nalgebra and parry.
//!
//! Frames: x forward, y left, z up; angles counter-clockwise; maps are right-handed. Units: metres and radians.

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
