//! Bodies as stacks of upright prisms, so that a sensor sees what lies at its own height, and no more.

use crate::{Polygon, Pose2, Shape};
use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A solid with upright sides: a shape, the same at every height from `z_min_m` to `z_max_m`.
#[derive(Debug, Clone, PartialEq)]
pub struct Prism {
    /// Its outline from above, in the body's frame.
    pub shape: Shape,
    /// Height of its underside above the floor, in metres.
    pub z_min_m: f64,
    /// Height of its top, in metres.
    pub z_max_m: f64,
}

impl Prism {
    /// Whether it is solid at that height.
    pub fn covers(&self, height_m: f64) -> bool {
        height_m >= self.z_min_m && height_m <= self.z_max_m
    }

    /// Whether it reaches into the heights between `low_m` and `high_m`; touching one of them does not count.
    pub fn reaches_between(&self, low_m: f64, high_m: f64) -> bool {
        self.z_min_m < high_m && self.z_max_m > low_m
    }
}

/// What stands about in hallways (COF-120).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BodyKind {
    /// Two shelves joined by thick bars at the four corners, on castors. The lower shelf ends 20 mm below
    /// sensors at a height of 0.25 m: a level beam passes between the bars (COF-122). 0.90 m along x, 0.50 m
    /// along y.
    MailCart,
    /// One pole, a five-armed base below, a seat with a piece of fabric hanging underneath (COF-123).
    SpinningChair,
    /// Solid from near the floor, with back and arms (COF-124). 0.80 m along x (it faces x), 1.60 m along y.
    Sofa,
    /// Four thin legs (COF-125), seat and back.
    WoodenChair,
    /// Solid; unless a size is given 0.40 x 0.30 x 0.30 m.
    CardboardBox,
    /// Solid, like something fixed to a wall or a cupboard; unless a size is given 0.20 x 0.60 x 0.90 m.
    WallBox,
}

/// A body in its own frame: origin in the middle of its footprint, x to its front, z up from the floor.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Body {
    prisms: Vec<Prism>,
}

impl Body {
    /// A body of the given parts.
    pub fn new(prisms: impl IntoIterator<Item = Prism>) -> Self {
        Self { prisms: prisms.into_iter().collect() }
    }

    /// An upright cylinder that stands on the floor.
    pub fn cylinder(radius_m: f64, height_m: f64) -> Self {
        Self::new([Prism { shape: Shape::disc(radius_m), z_min_m: 0.0, z_max_m: height_m }])
    }

    /// An upright solid of that footprint, from one height to another, such as a robot's chassis.
    pub fn extruded(footprint: Polygon, z_min_m: f64, z_max_m: f64) -> Self {
        Self::new([Prism { shape: Shape::Polygon(footprint), z_min_m, z_max_m }])
    }

    /// A person of that radius: two legs side by side, and a trunk as wide as the person.
    pub fn walker(radius_m: f64) -> Self {
        let leg_m = 0.35 * radius_m;
        let legs = [-1.0, 1.0].map(|side| disc(0.0, side * (radius_m - leg_m), leg_m, 0.0, 0.85));
        Self::new(legs.into_iter().chain([disc(0.0, 0.0, radius_m, 0.85, 1.75)]))
    }

    /// The usual body of that kind.
    pub fn of(kind: BodyKind) -> Self {
        match kind {
            BodyKind::MailCart => mail_cart(),
            BodyKind::SpinningChair => spinning_chair(),
            BodyKind::Sofa => sofa(),
            BodyKind::WoodenChair => wooden_chair(),
            BodyKind::CardboardBox => Self::with_size(kind, [0.40, 0.30, 0.30]),
            BodyKind::WallBox => Self::with_size(kind, [0.20, 0.60, 0.90]),
        }
    }

    /// A box of that extent along x, y and z, in metres, standing on the floor; the size of other kinds is
    /// fixed.
    pub fn with_size(kind: BodyKind, [length_m, width_m, height_m]: [f64; 3]) -> Self {
        match kind {
            BodyKind::CardboardBox | BodyKind::WallBox => {
                Self::new(block(0.0, 0.0, length_m, width_m, 0.0, height_m))
            }
            _ => Self::of(kind),
        }
    }

    /// Its parts.
    pub fn prisms(&self) -> &[Prism] {
        &self.prisms
    }

    /// What of it lies at that height: the shapes in the body's frame.
    pub fn cross_section(&self, height_m: f64) -> Vec<&Shape> {
        self.prisms.iter().filter(|prism| prism.covers(height_m)).map(|prism| &prism.shape).collect()
    }

    /// Distance of its farthest point from its origin, seen from above, in metres.
    pub fn radius_m(&self) -> f64 {
        self.prisms.iter().map(|prism| prism.shape.radius_m()).fold(0.0, f64::max)
    }
}

fn disc(x_m: f64, y_m: f64, radius_m: f64, z_min_m: f64, z_max_m: f64) -> Prism {
    let shape = Shape::Disc { centre: Point2::new(x_m, y_m), radius_m };
    Prism { shape, z_min_m, z_max_m }
}

/// A rectangle along the axes about (x, y); nothing if a side is not positive.
fn block(x_m: f64, y_m: f64, length_m: f64, width_m: f64, z_min_m: f64, z_max_m: f64) -> Option<Prism> {
    turned_block(Pose2::new(x_m, y_m, 0.0), length_m, width_m, z_min_m, z_max_m)
}

fn turned_block(centre: Pose2, length_m: f64, width_m: f64, z_min_m: f64, z_max_m: f64) -> Option<Prism> {
    let shape = Polygon::rectangle(length_m, width_m).ok()?.transformed(centre);
    Some(Prism { shape: Shape::Polygon(shape), z_min_m, z_max_m })
}

/// The four corners of a rectangle along the axes, `inset` from its sides.
fn corners(length_m: f64, width_m: f64, inset_m: f64) -> [(f64, f64); 4] {
    let (x, y) = (0.5 * length_m - inset_m, 0.5 * width_m - inset_m);
    [(-x, -y), (x, -y), (x, y), (-x, y)]
}

fn mail_cart() -> Body {
    let (length_m, width_m, bar_m) = (0.90, 0.50, 0.040);
    let feet = corners(length_m, width_m, 0.5 * bar_m);
    let castors = feet.map(|(x, y)| disc(x, y, 0.04, 0.0, 0.12));
    let bars = feet.map(|(x, y)| block(x, y, bar_m, bar_m, 0.12, 0.85));
    let lower = block(0.0, 0.0, length_m, width_m, 0.19, 0.23);
    let upper = block(0.0, 0.0, length_m, width_m, 0.78, 0.85);
    Body::new(castors.into_iter().chain(bars.into_iter().flatten()).chain(lower).chain(upper))
}

fn spinning_chair() -> Body {
    let arms = (0..5).map(|arm| TAU * f64::from(arm) / 5.0);
    let reach_m = 0.30;
    let at = |heading_rad: f64, out_m: f64| {
        Pose2::new(out_m * heading_rad.cos(), out_m * heading_rad.sin(), heading_rad)
    };
    let spokes =
        arms.clone().filter_map(|arm| turned_block(at(arm, 0.5 * reach_m), reach_m, 0.045, 0.06, 0.12));
    let wheels = arms.map(|arm| disc(at(arm, reach_m).x_m, at(arm, reach_m).y_m, 0.03, 0.0, 0.06));
    let pole = disc(0.0, 0.0, 0.025, 0.06, 0.42);
    // Hangs down in front of the pole and to one side of it, low enough for the upper rays of a beam at 0.25
    // m.
    let fabric = block(0.10, -0.12, 0.02, 0.16, 0.27, 0.42);
    let seat = disc(0.0, 0.0, 0.24, 0.42, 0.50);
    let back = block(-0.23, 0.0, 0.05, 0.40, 0.50, 0.95);
    Body::new(spokes.chain(wheels).chain([pole, seat]).chain(fabric).chain(back))
}

fn sofa() -> Body {
    let (length_m, width_m) = (0.80, 1.60);
    let seat = block(0.0, 0.0, length_m, width_m, 0.03, 0.42);
    let back = block(-0.30, 0.0, 0.20, width_m, 0.42, 0.80);
    let arms = [-1.0, 1.0].map(|side| block(0.0, side * 0.70, length_m, 0.20, 0.42, 0.60));
    Body::new(seat.into_iter().chain(back).chain(arms.into_iter().flatten()))
}

fn wooden_chair() -> Body {
    let (side_m, leg_m) = (0.42, 0.035);
    let legs = corners(side_m, side_m, 0.5 * leg_m).map(|(x, y)| block(x, y, leg_m, leg_m, 0.0, 0.43));
    let seat = block(0.0, 0.0, side_m, side_m, 0.43, 0.46);
    let back = block(-0.19, 0.0, 0.03, side_m, 0.46, 0.90);
    Body::new(legs.into_iter().flatten().chain(seat).chain(back))
}
