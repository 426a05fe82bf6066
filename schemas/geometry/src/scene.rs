//! A scene: walls from floor to ceiling, and bodies that may move. Rays and cones are cast into it, and the
//! room around a footprint is measured in it.

use crate::{Body, Polygon, Pose2, Prism, Segment, Shape, Walls};
use nalgebra::{Point2, Vector2};

/// What a ray meets. Numbers are indices into the lists of the world that the scene was made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Surface {
    /// A wall, by its index in the scene.
    Wall(u32),
    /// The floor.
    Floor,
    /// The leaf of a door.
    Door(u32),
    /// The door of an elevator.
    Elevator(u32),
    /// A piece of furniture.
    Furniture(u32),
    /// A person.
    Walker(u32),
    /// A robot, by a number of the caller's.
    Robot(u32),
}

/// Where a ray meets something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance along the ray in metres; 0 for a ray that begins inside a body.
    pub range_m: f64,
    /// Cosine of the angle between the ray and the surface's normal: 1 straight on, near 0 grazing.
    pub incidence_cos: f64,
    /// What was met.
    pub surface: Surface,
}

impl Hit {
    /// Angle between the ray and the surface's normal: 0 straight on, up to π/2 grazing.
    pub fn incidence_rad(&self) -> f64 {
        self.incidence_cos.clamp(0.0, 1.0).acos()
    }
}

/// A half-line in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it begins, seen from above.
    pub origin: Point2<f64>,
    /// Where it points, seen from above: a unit vector.
    pub direction: Vector2<f64>,
    /// Height of its origin above the floor, in metres.
    pub height_m: f64,
    /// How much it rises for each metre seen from above.
    pub slope: f64,
}

impl Ray {
    /// A level ray.
    pub fn level(origin: Point2<f64>, heading_rad: f64, height_m: f64) -> Self {
        let (sine, cosine) = heading_rad.sin_cos();
        Self { origin, direction: Vector2::new(cosine, sine), height_m, slope: 0.0 }
    }

    /// A ray that rises by `elevation_rad`, which lies between -π/2 and π/2 without the ends.
    pub fn rising(origin: Point2<f64>, heading_rad: f64, height_m: f64, elevation_rad: f64) -> Self {
        Self { slope: elevation_rad.tan(), ..Self::level(origin, heading_rad, height_m) }
    }

    /// Metres along the ray for each metre seen from above.
    pub(crate) fn stretch(&self) -> f64 {
        (1.0 + self.slope * self.slope).sqrt()
    }
}

/// A body of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct BodyId(usize);

#[derive(Debug, Clone)]
pub(crate) struct Placed {
    body: Body,
    pub(crate) surface: Surface,
    pub(crate) is_present: bool,
    pub(crate) centre: Point2<f64>,
    pub(crate) radius_m: f64,
    /// The body's parts in the scene's frame.
    pub(crate) prisms: Vec<Prism>,
}

/// Everything that sensors see and robots bump into on one floor.
#[derive(Debug, Clone)]
pub struct Scene {
    walls: Walls,
    pub(crate) bodies: Vec<Placed>,
}

impl Scene {
    /// A scene of walls only.
    pub fn new(walls: impl IntoIterator<Item = Segment>) -> Self {
        Self { walls: Walls::new(walls), bodies: Vec::new() }
    }

    /// The walls.
    pub fn walls(&self) -> &Walls {
        &self.walls
    }

    /// Adds a body. It stays until the scene goes; [`Scene::set_present`] hides it.
    pub fn add_body(&mut self, body: Body, pose: Pose2, surface: Surface) -> BodyId {
        let radius_m = body.radius_m();
        let (centre, prisms) = (pose.position(), Vec::new());
        self.bodies.push(Placed { body, surface, is_present: true, centre, radius_m, prisms });
        let id = BodyId(self.bodies.len() - 1);
        self.move_body(id, pose);
        id
    }

    /// Puts a body somewhere else. A pose that is not finite, or a body of another scene, is ignored.
    pub fn move_body(&mut self, id: BodyId, pose: Pose2) {
        let Some(placed) = self.bodies.get_mut(id.0).filter(|_| pose.is_finite()) else { return };
        placed.centre = pose.position();
        placed.prisms.clear();
        placed.prisms.extend(placed.body.prisms().iter().map(|prism| Prism {
            shape: prism.shape.transformed(pose),
            z_min_m: prism.z_min_m,
            z_max_m: prism.z_max_m,
        }));
    }

    /// Hides a body, or shows it again.
    pub fn set_present(&mut self, id: BodyId, is_present: bool) {
        if let Some(placed) = self.bodies.get_mut(id.0) {
            placed.is_present = is_present;
        }
    }

    /// The solid parts of what the scene shows, in its frame, with what they belong to: for drawing.
    pub fn parts(&self) -> impl Iterator<Item = (Surface, &Prism)> {
        let present = self.bodies.iter().filter(|placed| placed.is_present);
        present.flat_map(|placed| placed.prisms.iter().map(|prism| (placed.surface, prism)))
    }

    /// What a ray meets first within `max_range_m`: walls, bodies, or the floor if the ray falls.
    pub fn cast_ray(&self, ray: &Ray, max_range_m: f64) -> Option<Hit> {
        let reach = self.reach(ray, max_range_m);
        self.cast_among(ray, reach, self.bodies.iter().filter(|placed| placed.is_present))
    }

    /// [`Scene::cast_ray`] for a ray that no body `without` hinders, such as one that leaves a sensor on that
    /// very body.
    pub fn cast_ray_without(&self, ray: &Ray, max_range_m: f64, without: BodyId) -> Option<Hit> {
        let reach = self.reach(ray, max_range_m);
        self.cast_among(ray, reach, self.present_without(Some(without)))
    }

    /// The bodies that are shown, but for one.
    pub(crate) fn present_without(&self, own: Option<BodyId>) -> impl Iterator<Item = &Placed> {
        let own = own.map_or(usize::MAX, |id| id.0);
        let others = self.bodies.iter().enumerate().filter(move |(index, _)| *index != own);
        others.map(|(_, placed)| placed).filter(|placed| placed.is_present)
    }

    /// The limit of a ray, and what of the walls it meets before: the part that rays of one azimuth share.
    pub(crate) fn reach(&self, ray: &Ray, max_range_m: f64) -> Reach {
        let limit_m = max_range_m / ray.stretch();
        let wall = self.walls.cast_along(ray.origin, ray.direction, limit_m);
        let met = wall.map(|hit| Met {
            along_m: hit.range_m,
            level_cos: hit.incidence_cos,
            is_side: true,
            surface: Surface::Wall(hit.wall as u32),
        });
        Reach { limit_m, met }
    }

    pub(crate) fn cast_among<'a>(
        &self,
        ray: &Ray,
        reach: Reach,
        bodies: impl Iterator<Item = &'a Placed>,
    ) -> Option<Hit> {
        let mut nearest = reach;
        if ray.slope < 0.0 {
            nearest.meet(-ray.height_m / ray.slope, 1.0, false, Surface::Floor);
        }
        for placed in bodies {
            let to_centre = placed.centre - ray.origin;
            let ahead_m = to_centre.dot(&ray.direction);
            let square = placed.radius_m * placed.radius_m;
            let aside = to_centre.norm_squared() - ahead_m * ahead_m;
            if aside > square
                || ahead_m - placed.radius_m > nearest.limit_m
                || ahead_m + placed.radius_m < 0.0
            {
                continue;
            }
            for prism in &placed.prisms {
                nearest.meet_prism(ray, prism, placed.surface);
            }
        }
        let met = nearest.met?;
        let stretch = ray.stretch();
        let incidence_cos =
            if met.is_side { met.level_cos / stretch } else { ray.slope.abs() / stretch * met.level_cos };
        Some(Hit { range_m: met.along_m * stretch, incidence_cos, surface: met.surface })
    }
}

/// What has been met first so far, seen from above.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reach {
    pub(crate) limit_m: f64,
    pub(crate) met: Option<Met>,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Met {
    pub(crate) along_m: f64,
    /// Cosine of the incidence seen from above, for an upright face; 1 for a level one.
    level_cos: f64,
    is_side: bool,
    surface: Surface,
}

impl Reach {
    /// What a ray that ends at `limit_m` reaches, seen from above.
    pub(crate) fn shortened(self, limit_m: f64) -> Self {
        Self { limit_m, met: self.met.filter(|met| met.along_m < limit_m) }
    }

    fn meet(&mut self, along_m: f64, level_cos: f64, is_side: bool, surface: Surface) {
        // Equal distances keep what was met first: walls before bodies, bodies in their order.
        let limit_m = self.met.map_or(self.limit_m, |met| met.along_m);
        if along_m >= 0.0 && along_m < limit_m {
            self.limit_m = along_m;
            self.met = Some(Met { along_m, level_cos, is_side, surface });
        }
    }

    fn meet_prism(&mut self, ray: &Ray, prism: &Prism, surface: Surface) {
        if prism.covers(ray.height_m) && prism.shape.contains(ray.origin) {
            // Solid: nothing is seen from inside but the body itself, straight on.
            self.limit_m = 0.0;
            let level_cos = ray.stretch();
            self.met = Some(Met { along_m: 0.0, level_cos, is_side: true, surface });
            return;
        }
        let height_at = |along_m: f64| ray.height_m + ray.slope * along_m;
        match &prism.shape {
            Shape::Disc { centre, radius_m } => {
                let to_centre = centre - ray.origin;
                let ahead_m = to_centre.dot(&ray.direction);
                let half_square = radius_m * radius_m - (to_centre.norm_squared() - ahead_m * ahead_m);
                if half_square >= 0.0 {
                    let half_m = half_square.sqrt();
                    let along_m = ahead_m - half_m;
                    if prism.covers(height_at(along_m)) {
                        self.meet(along_m, half_m / radius_m, true, surface);
                    }
                }
            }
            Shape::Polygon(polygon) => {
                for edge in polygon.edges() {
                    // The inside lies to the left: an outer face is one that the ray crosses from right to
                    // left.
                    let along = edge.vector();
                    let turn = along.x * ray.direction.y - along.y * ray.direction.x;
                    if turn <= 0.0 {
                        continue;
                    }
                    let (x, y) = (edge.a.x - ray.origin.x, edge.a.y - ray.origin.y);
                    let beside = y * ray.direction.x - x * ray.direction.y;
                    let slack = 1e-7 * turn;
                    if beside < -slack || beside > turn + slack {
                        continue;
                    }
                    let along_m = (y * along.x - x * along.y) / turn;
                    if prism.covers(height_at(along_m)) {
                        self.meet(along_m, turn / along.norm(), true, surface);
                    }
                }
            }
        }
        if ray.slope != 0.0 {
            let face_m = if ray.slope < 0.0 { prism.z_max_m } else { prism.z_min_m };
            let along_m = (face_m - ray.height_m) / ray.slope;
            if along_m >= 0.0 && along_m < self.limit_m {
                let place = ray.origin + ray.direction * along_m;
                if prism.shape.contains(place) {
                    self.meet(along_m, 1.0, false, surface);
                }
            }
        }
    }
}

/// What lies nearest to a footprint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clearance {
    /// Distance in metres; 0 when they touch or overlap.
    pub distance_m: f64,
    /// What it is.
    pub surface: Surface,
}

impl Scene {
    /// Distance from a robot's footprint to the nearest wall, or part of a body that reaches into the heights
    /// between `low_m` and `high_m`, in metres: 0 when they touch or overlap, infinite in an empty scene.
    /// `without` is the robot's own body, if it is in the scene.
    pub fn clearance_m(
        &self,
        footprint: &Polygon,
        pose: Pose2,
        [low_m, high_m]: [f64; 2],
        without: Option<BodyId>,
    ) -> f64 {
        self.clearance(footprint, pose, [low_m, high_m], without)
            .map_or(f64::INFINITY, |nearest| nearest.distance_m)
    }

    /// [`Scene::clearance_m`], and what it is that lies nearest.
    pub fn clearance(
        &self,
        footprint: &Polygon,
        pose: Pose2,
        [low_m, high_m]: [f64; 2],
        without: Option<BodyId>,
    ) -> Option<Clearance> {
        let placed_footprint = footprint.transformed(pose);
        let (centre, radius_m) = (pose.position(), footprint.radius_m());
        let mut nearest: Option<Clearance> = None;
        let mut best_m = f64::INFINITY;
        let mut keep = |distance_m: f64, surface: Surface| {
            if distance_m < best_m {
                best_m = distance_m;
                nearest = Some(Clearance { distance_m, surface });
            }
            best_m
        };
        let mut limit_m = f64::INFINITY;
        for (index, wall) in (0_u32..).zip(self.walls.segments()) {
            // At least so far, as the footprint lies within its circle.
            if wall.distance_m(centre) - radius_m < limit_m {
                limit_m = keep(placed_footprint.distance_to_segment_m(wall), Surface::Wall(index));
            }
        }
        let own_shape = Shape::Polygon(placed_footprint);
        for other in self.present_without(without) {
            let apart_m = nalgebra::distance(&other.centre, &centre) - other.radius_m - radius_m;
            if apart_m >= limit_m {
                continue;
            }
            for prism in other.prisms.iter().filter(|prism| prism.reaches_between(low_m, high_m)) {
                limit_m = keep(own_shape.distance_to_shape_m(&prism.shape), other.surface);
            }
        }
        nearest
    }
}
