//! From a world file to a scene to cast rays into.

use super::World;
use crate::{Body, BodyId, Scene, Surface};

/// How high doors are, in metres.
const DOOR_HEIGHT_M: f64 = 2.1;

/// A floor to cast rays into, and what of it moves.
#[derive(Debug, Clone)]
pub struct WorldScene {
    /// Walls, furniture, door leaves (as they are at the beginning) and walkers (where their paths begin).
    pub scene: Scene,
    /// The scene's moving bodies.
    pub bodies: WorldBodies,
}

/// The moving bodies of a floor: pairs of an index into the list of the [`World`], and the body in the
/// [`Scene`].
#[derive(Debug, Clone, Default)]
pub struct WorldBodies {
    /// Door leaves, by index into [`World::doors`]; move them to [`super::DoorGeometry::leaf_pose`].
    pub doors: Vec<(usize, BodyId)>,
    /// Elevator doors, by index into [`World::elevators`].
    pub elevators: Vec<(usize, BodyId)>,
    /// People, by index into [`World::walkers`]; move them to [`super::Walker::pose`].
    pub walkers: Vec<(usize, BodyId)>,
}

impl World {
    /// The scene of one floor at the beginning; empty if there is no such floor.
    pub fn scene(&self, floor: i32) -> WorldScene {
        let mut scene = Scene::new(self.wall_segments(floor));
        let mut bodies = WorldBodies::default();
        for (index, door) in self.doors.iter().enumerate().filter(|(_, door)| door.floor == floor) {
            if let Some(geometry) = self.door_geometry(door) {
                let pose = geometry.leaf_pose(door.opening_fraction(None));
                let leaf = geometry.leaf_body(DOOR_HEIGHT_M);
                bodies.doors.push((index, scene.add_body(leaf, pose, Surface::Door(index as u32))));
            }
        }
        for (index, lift) in self.elevators.iter().enumerate() {
            if let Some(geometry) = self.elevator_geometry(lift, floor) {
                let leaf = geometry.leaf_body(DOOR_HEIGHT_M);
                let body = scene.add_body(leaf, geometry.leaf_pose(0.0), Surface::Elevator(index as u32));
                bodies.elevators.push((index, body));
            }
        }
        for (index, item) in self.furniture.iter().enumerate().filter(|(_, item)| item.floor == floor) {
            scene.add_body(item.body(), item.pose, Surface::Furniture(index as u32));
        }
        for (index, walker) in self.walkers.iter().enumerate().filter(|(_, walker)| walker.floor == floor) {
            let body = Body::walker(walker.radius_m);
            let body = scene.add_body(body, walker.pose(0.0), Surface::Walker(index as u32));
            bodies.walkers.push((index, body));
        }
        WorldScene { scene, bodies }
    }
}
