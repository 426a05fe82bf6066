//! The truth as scenes: what simulated sensors cast their rays into, and what referees measure clearance in.

use crate::{BodyKind, BodyKindField, TrueBody, WorldTruth};
use geometry::world::DoorGeometry;
use geometry::{Body, BodyId, Pose2, Scene, Surface, World};

/// How high door leaves are, in metres.
const LEAF_HEIGHT_M: f64 = 2.1;

/// Every floor of a world, with its bodies, doors and elevators as the newest truth has them.
///
/// The elements of `WorldTruth` are the world file's furniture, then its walkers, each in the file's order.
#[derive(Debug, Clone)]
pub struct Surroundings {
    floors: Vec<(i32, Scene)>,
    bodies: Vec<PlacedBody>,
    doors: Vec<Leaf>,
    elevators: Vec<Leaf>,
}

/// Furniture or a person: a body of the scene of one floor.
#[derive(Debug, Clone)]
struct PlacedBody {
    floor: usize,
    id: BodyId,
    kind: BodyKindField,
    pose: Pose2,
}

#[derive(Debug, Clone)]
struct Leaf {
    floor: usize,
    id: BodyId,
    geometry: DoorGeometry,
    open_percent: u32,
}

impl Surroundings {
    /// The world as it is at the beginning.
    pub fn new(world: &World) -> Self {
        let floors =
            world.floors.iter().map(|floor| (floor.number, Scene::new(world.wall_segments(floor.number))));
        let mut built = Self { floors: floors.collect(), bodies: vec![], doors: vec![], elevators: vec![] };
        for (index, door) in (0_u32..).zip(&world.doors) {
            let open_percent = if door.open { 100 } else { 0 };
            let leaf = built.leaf(door.floor, world.door_geometry(door), Surface::Door(index), open_percent);
            built.doors.extend(leaf);
        }
        for (index, lift) in (0_u32..).zip(&world.elevators) {
            for &floor in &lift.floors {
                let geometry = world.elevator_geometry(lift, floor);
                let leaf = built.leaf(floor, geometry, Surface::Elevator(index), 0);
                built.elevators.extend(leaf);
            }
        }
        for (index, item) in (0_u32..).zip(&world.furniture) {
            let kind = body_kind(item.kind).into();
            built.body(item.floor, item.body(), kind, item.pose, Surface::Furniture(index));
        }
        for (index, walker) in (0_u32..).zip(&world.walkers) {
            let (body, kind) = (Body::walker(walker.radius_m), BodyKind::Walker.into());
            built.body(walker.floor, body, kind, walker.pose(0.0), Surface::Walker(index));
        }
        built
    }

    /// Moves everything to where the truth has it. Bodies that the world file does not have, and invalid
    /// poses, are left out.
    pub fn show(&mut self, truth: &WorldTruth, bodies: &[TrueBody]) {
        for (placed, now) in self.bodies.iter_mut().zip(bodies) {
            let pose = Pose2 { x_m: now.x_m, y_m: now.y_m, heading_rad: now.heading_rad };
            if placed.kind == now.kind && placed.pose != pose && pose.is_finite() {
                placed.pose = pose;
                self.floors[placed.floor].1.move_body(placed.id, pose);
            }
        }
        for (index, leaf) in self.doors.iter_mut().enumerate() {
            let is_open = truth.open_doors.get(index / 64).is_some_and(|bits| bits >> (index % 64) & 1 == 1);
            leaf.open(&mut self.floors, if is_open { 100 } else { 0 });
        }
        for leaf in &mut self.elevators {
            let here = self.floors[leaf.floor].0 == truth.floor;
            leaf.open(&mut self.floors, if here { truth.elevator_door_percent.min(100) } else { 0 });
        }
    }

    /// The scene of a floor.
    pub fn scene(&self, floor: i32) -> Option<&Scene> {
        self.floors.iter().find(|(number, _)| *number == floor).map(|(_, scene)| scene)
    }

    fn leaf(
        &mut self,
        floor: i32,
        geometry: Option<DoorGeometry>,
        surface: Surface,
        open_percent: u32,
    ) -> Option<Leaf> {
        let (floor, geometry) = (self.floors.iter().position(|(number, _)| *number == floor)?, geometry?);
        let pose = geometry.leaf_pose(f64::from(open_percent) / 100.0);
        let id = self.floors[floor].1.add_body(geometry.leaf_body(LEAF_HEIGHT_M), pose, surface);
        Some(Leaf { floor, id, geometry, open_percent })
    }

    fn body(&mut self, floor: i32, body: Body, kind: BodyKindField, pose: Pose2, surface: Surface) {
        if let Some(floor) = self.floors.iter().position(|(number, _)| *number == floor) {
            let id = self.floors[floor].1.add_body(body, pose, surface);
            self.bodies.push(PlacedBody { floor, id, kind, pose });
        }
    }
}

impl Leaf {
    fn open(&mut self, floors: &mut [(i32, Scene)], percent: u32) {
        if self.open_percent != percent {
            self.open_percent = percent;
            let pose = self.geometry.leaf_pose(f64::from(percent) / 100.0);
            floors[self.floor].1.move_body(self.id, pose);
        }
    }
}

/// What the truth calls a piece of furniture: every box is a cardboard box.
pub fn body_kind(kind: geometry::BodyKind) -> BodyKind {
    match kind {
        geometry::BodyKind::MailCart => BodyKind::MailCart,
        geometry::BodyKind::SpinningChair => BodyKind::SpinningChair,
        geometry::BodyKind::Sofa => BodyKind::Sofa,
        geometry::BodyKind::WoodenChair => BodyKind::WoodenChair,
        geometry::BodyKind::CardboardBox | geometry::BodyKind::WallBox => BodyKind::CardboardBox,
    }
}
