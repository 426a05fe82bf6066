//! What a world must not be.

use super::{World, WorldProblem, door::ON_WALL_M, items::Trigger, line_and_column};
use crate::{BodyKind, Pose2, Segment};
use nalgebra::Point2;
use serde::{Deserialize, de::IgnoredAny};
use std::collections::HashSet;
use toml::Spanned;

/// Farther out than this no coordinate lies, in metres.
const FARTHEST_M: f64 = 10_000.0;

/// As much as no building has that a robot drives through, and little enough that each thing can be compared
/// with every other.
const MOST_OF_A_KIND: usize = 1000;
/// Straight pieces of wall of a whole world.
const MOST_WALLS: usize = 20_000;
/// Corners of one outline or area, or points of one path.
const MOST_POINTS: usize = 1000;

/// The first thing that is wrong.
#[derive(Debug)]
pub(super) struct Found {
    list: &'static str,
    index: usize,
    pub(super) item: String,
    pub(super) problem: WorldProblem,
}

/// Where the items of a text begin.
#[derive(Deserialize, Default)]
#[serde(default)]
struct Spans {
    floor: Vec<Spanned<IgnoredAny>>,
    door: Vec<Spanned<IgnoredAny>>,
    elevator: Vec<Spanned<IgnoredAny>>,
    area: Vec<Spanned<IgnoredAny>>,
    place: Vec<Spanned<IgnoredAny>>,
    anchor: Vec<Spanned<IgnoredAny>>,
    furniture: Vec<Spanned<IgnoredAny>>,
    walker: Vec<Spanned<IgnoredAny>>,
    start: Vec<Spanned<IgnoredAny>>,
}

impl Found {
    /// The line where the item begins; 1 for what concerns the whole file.
    pub(super) fn line_in(&self, text: &str) -> usize {
        let spans: Spans = files::toml::parse(text).unwrap_or_default();
        let list = match self.list {
            "floor" => &spans.floor,
            "door" => &spans.door,
            "elevator" => &spans.elevator,
            "area" => &spans.area,
            "place" => &spans.place,
            "anchor" => &spans.anchor,
            "furniture" => &spans.furniture,
            "walker" => &spans.walker,
            "start" => &spans.start,
            _ => return 1,
        };
        list.get(self.index).map_or(1, |item| line_and_column(text, item.span().start).0)
    }
}

type Check = Result<(), WorldProblem>;

impl World {
    pub(super) fn find_problem(&self) -> Option<Found> {
        self.walk().err().map(|found| *found)
    }

    fn walk(&self) -> Result<(), Box<Found>> {
        let about = |list: &'static str, index: usize, name: String| {
            move |problem| Box::new(Found { list, index, item: format!("{list} {name}"), problem })
        };
        let at_all = |problem| Box::new(Found { list: "world", index: 0, item: "world".into(), problem });
        (if self.floors.is_empty() { Err(WorldProblem::NoFloor) } else { Ok(()) }).map_err(at_all)?;
        self.is_bounded().map_err(at_all)?;

        let mut numbers = HashSet::new();
        for (index, floor) in self.floors.iter().enumerate() {
            let fail = about("floor", index, floor.number.to_string());
            fresh(numbers.insert(floor.number), || format!("floor {}", floor.number)).map_err(&fail)?;
            if let Some(corners) = &floor.outline {
                coordinates("outline", corners).map_err(&fail)?;
                at_most("corners of an outline", corners.len(), MOST_POINTS).map_err(&fail)?;
            }
            if floor.outline.is_some() && floor.outline_polygon().is_none() {
                let cause = crate::Polygon::from_coordinates(floor.outline.as_deref().unwrap_or_default());
                let cause = cause.err().unwrap_or(crate::PolygonError::NoArea);
                return Err(fail(WorldProblem::BadPolygon { field: "outline", cause }));
            }
            for wall in &floor.walls {
                polyline("walls", wall, 2).map_err(&fail)?;
            }
        }
        let mut rooms = HashSet::new();
        let mut gaps: Vec<(i32, Segment, String)> = Vec::new();
        for (index, door) in self.doors.iter().enumerate() {
            let fail = about("door", index, format!("{:?}", door.room));
            named(&door.room).map_err(&fail)?;
            rooms.insert(door.room.as_str());
            coordinates("at", &[door.at]).map_err(&fail)?;
            direction("into_room", door.into_room).map_err(&fail)?;
            positive("width_m", door.width_m).map_err(&fail)?;
            not_negative("recess_m", door.recess_m).map_err(&fail)?;
            positive("room_depth_m", door.room_depth_m).map_err(&fail)?;
            positive("swing_s", door.swing_s).map_err(&fail)?;
            door.returns_after_s.map_or(Ok(()), |s| not_negative("returns_after_s", s)).map_err(&fail)?;
            door.moves.map_or(Ok(()), trigger).map_err(&fail)?;
            self.opening(door.floor, door.at, door.width_m, || self.door_geometry(door))
                .map_err(&fail)
                .and_then(|gap| {
                    claim(&mut gaps, door.floor, gap, format!("door {:?}", door.room)).map_err(&fail)
                })?;
        }
        let mut names = HashSet::new();
        for (index, lift) in self.elevators.iter().enumerate() {
            let fail = about("elevator", index, format!("{:?}", lift.name));
            named(&lift.name).map_err(&fail)?;
            fresh(names.insert(lift.name.as_str()), || lift.name.clone()).map_err(&fail)?;
            coordinates("at", &[lift.at]).map_err(&fail)?;
            direction("into_car", lift.into_car).map_err(&fail)?;
            positive("width_m", lift.width_m).map_err(&fail)?;
            not_negative("recess_m", lift.recess_m).map_err(&fail)?;
            positive("car_depth_m", lift.car_depth_m).map_err(&fail)?;
            positive("travel_s", lift.travel_s).map_err(&fail)?;
            positive("door_s", lift.door_s).map_err(&fail)?;
            not_negative("open_s", lift.open_s).map_err(&fail)?;
            at_most("floors of an elevator", lift.floors.len(), MOST_OF_A_KIND).map_err(&fail)?;
            if lift.floors.is_empty() {
                return Err(fail(WorldProblem::TooFewPoints { field: "floors", points: 0, wanted: 1 }));
            }
            let mut served = HashSet::new();
            for &floor in &lift.floors {
                fresh(served.insert(floor), || format!("floor {floor}")).map_err(&fail)?;
                let gap = self.opening(floor, lift.at, lift.width_m, || self.elevator_geometry(lift, floor));
                let gap = gap.map_err(&fail)?;
                claim(&mut gaps, floor, gap, format!("elevator {:?}", lift.name)).map_err(&fail)?;
            }
        }
        let mut names = HashSet::new();
        for (index, area) in self.areas.iter().enumerate() {
            let fail = about("area", index, format!("{:?}", area.name));
            named(&area.name).map_err(&fail)?;
            fresh(names.insert(area.name.as_str()), || area.name.clone()).map_err(&fail)?;
            self.known(area.floor).map_err(&fail)?;
            if area.rectangle.is_some() == area.polygon.is_some() {
                let problem = "an area has either a rectangle or a polygon";
                return Err(fail(WorldProblem::Contradiction { problem }));
            }
            let corners = area.polygon.as_ref().map_or(0, Vec::len);
            at_most("corners of an area", corners, MOST_POINTS).map_err(&fail)?;
            let shape = area.shape().map_err(|cause| WorldProblem::BadPolygon { field: "its shape", cause });
            let corners: Vec<_> = shape.map_err(&fail)?.corners().iter().map(|p| [p.x, p.y]).collect();
            coordinates("its shape", &corners).map_err(&fail)?;
        }
        let mut names = HashSet::new();
        for (index, place) in self.places.iter().enumerate() {
            let fail = about("place", index, format!("{:?}", place.name));
            named(&place.name).map_err(&fail)?;
            let new = !rooms.contains(place.name.as_str()) && names.insert(place.name.as_str());
            fresh(new, || place.name.clone()).map_err(&fail)?;
            self.known(place.floor).and_then(|()| pose(place.pose)).map_err(&fail)?;
            self.inside(place.floor, place.pose).map_err(&fail)?;
        }
        let mut ids = HashSet::new();
        for (index, anchor) in self.anchors.iter().enumerate() {
            let fail = about("anchor", index, format!("{:#06x}", anchor.id));
            fresh(ids.insert(anchor.id), || format!("id {:#06x}", anchor.id)).map_err(&fail)?;
            self.known(anchor.floor).map_err(&fail)?;
            coordinates("x_m, y_m", &[[anchor.x_m, anchor.y_m]]).map_err(&fail)?;
            coordinates("z_m", &[[anchor.z_m, 0.0]]).map_err(&fail)?;
        }
        for (index, item) in self.furniture.iter().enumerate() {
            let fail = about("furniture", index, format!("{:?} {:?}", item.kind, item.name));
            self.known(item.floor).and_then(|()| pose(item.pose)).map_err(&fail)?;
            let Some(size_m) = item.size_m else { continue };
            if !matches!(item.kind, BodyKind::CardboardBox | BodyKind::WallBox) {
                let problem = "only boxes come in other sizes";
                return Err(fail(WorldProblem::Contradiction { problem }));
            }
            size_m.into_iter().try_for_each(|side| positive("size_m", side)).map_err(&fail)?;
        }
        let mut names = HashSet::new();
        for (index, walker) in self.walkers.iter().enumerate() {
            let fail = about("walker", index, format!("{:?}", walker.name));
            named(&walker.name).map_err(&fail)?;
            fresh(names.insert(walker.name.as_str()), || walker.name.clone()).map_err(&fail)?;
            self.known(walker.floor).map_err(&fail)?;
            at_most("points of a path", walker.path.len(), MOST_POINTS).map_err(&fail)?;
            polyline("path", &walker.path, 1).map_err(&fail)?;
            positive("radius_m", walker.radius_m).map_err(&fail)?;
            positive("speed_m_s", walker.speed_m_s).map_err(&fail)?;
            trigger(walker.starts).map_err(&fail)?;
        }
        let mut names = HashSet::new();
        for (index, start) in self.starts.iter().enumerate() {
            let who = start.robot.as_deref().unwrap_or("of any robot");
            let fail = about("start", index, format!("{who:?}"));
            fresh(names.insert(start.robot.as_deref()), || who.to_owned()).map_err(&fail)?;
            self.known(start.floor).and_then(|()| pose(start.pose)).map_err(&fail)?;
            self.inside(start.floor, start.pose).map_err(&fail)?;
        }
        Ok(())
    }

    fn is_bounded(&self) -> Check {
        let counts = [
            ("floors", self.floors.len()),
            ("doors", self.doors.len()),
            ("elevators", self.elevators.len()),
            ("areas", self.areas.len()),
            ("places", self.places.len()),
            ("anchors", self.anchors.len()),
            ("pieces of furniture", self.furniture.len()),
            ("walkers", self.walkers.len()),
            ("starts", self.starts.len()),
        ];
        counts.into_iter().try_for_each(|(what, count)| at_most(what, count, MOST_OF_A_KIND))?;
        let outlines = self.floors.iter().filter_map(|floor| floor.outline.as_ref());
        let walls = self.floors.iter().flat_map(|floor| &floor.walls);
        let points: usize = outlines.chain(walls).map(Vec::len).sum();
        at_most("points of walls", points, MOST_WALLS)
    }

    /// Where a floor has an outline, what a robot is to reach lies inside.
    fn inside(&self, floor: i32, pose: Pose2) -> Check {
        let outline = self.floor(floor).and_then(super::Floor::outline_polygon);
        let is_inside = outline.is_none_or(|outline| outline.contains(pose.position()));
        let outside = WorldProblem::OutsideOutline { floor, x_m: pose.x_m, y_m: pose.y_m };
        if is_inside { Ok(()) } else { Err(outside) }
    }

    fn known(&self, floor: i32) -> Check {
        if self.floor(floor).is_some() { Ok(()) } else { Err(WorldProblem::UnknownFloor { floor }) }
    }

    fn opening(
        &self,
        floor: i32,
        at: [f64; 2],
        width_m: f64,
        geometry: impl Fn() -> Option<super::DoorGeometry>,
    ) -> Result<Segment, WorldProblem> {
        let plan = self.floor(floor).ok_or(WorldProblem::UnknownFloor { floor })?;
        geometry().map(|geometry| geometry.gap).ok_or_else(|| {
            let distances = plan.segments().map(|wall| wall.distance_m(Point2::from(at)));
            let distance_m = distances.fold(f64::INFINITY, f64::min);
            WorldProblem::NotOnWall { floor, x_m: at[0], y_m: at[1], width_m, distance_m }
        })
    }
}

fn claim(gaps: &mut Vec<(i32, Segment, String)>, floor: i32, gap: Segment, who: String) -> Check {
    let overlaps = |other: &Segment| {
        let Some(along) = gap.direction() else { return false };
        let reach = |point: Point2<f64>| along.dot(&(point - gap.a));
        let (from, to) = (reach(other.a).min(reach(other.b)), reach(other.a).max(reach(other.b)));
        let aside = |point: Point2<f64>| (point - gap.a - along * reach(point)).norm();
        let on_line = aside(other.a) <= ON_WALL_M && aside(other.b) <= ON_WALL_M;
        on_line && to > 1e-6 && from < gap.length_m() - 1e-6
    };
    if let Some((.., other)) = gaps.iter().find(|(level, other, _)| *level == floor && overlaps(other)) {
        return Err(WorldProblem::OpeningsOverlap { other: other.clone() });
    }
    gaps.push((floor, gap, who));
    Ok(())
}

fn at_most(what: &'static str, count: usize, most: usize) -> Check {
    if count <= most { Ok(()) } else { Err(WorldProblem::TooMany { what, count, most }) }
}

fn fresh(new: bool, what: impl Fn() -> String) -> Check {
    if new { Ok(()) } else { Err(WorldProblem::Duplicate { what: what() }) }
}

fn named(name: &str) -> Check {
    if name.trim().is_empty() { Err(WorldProblem::NoName) } else { Ok(()) }
}

fn number(field: &'static str, value: f64, good: bool, wanted: &'static str) -> Check {
    if good { Ok(()) } else { Err(WorldProblem::BadNumber { field, value, wanted }) }
}

fn positive(field: &'static str, value: f64) -> Check {
    number(field, value, value > 0.0 && value <= FARTHEST_M, "a positive number up to 10 000")
}

fn not_negative(field: &'static str, value: f64) -> Check {
    number(field, value, (0.0..=FARTHEST_M).contains(&value), "a number from 0 to 10 000")
}

fn coordinates(field: &'static str, points: &[[f64; 2]]) -> Check {
    points.iter().flatten().try_for_each(|&value| {
        number(field, value, value.abs() <= FARTHEST_M, "a coordinate within 10 km of the origin")
    })
}

fn direction(field: &'static str, vector: [f64; 2]) -> Check {
    coordinates(field, &[vector])?;
    let length = vector[0].hypot(vector[1]);
    number(field, length, length > 0.0, "the length of a direction: it is a vector of no length")
}

fn pose(pose: Pose2) -> Check {
    coordinates("pose", &[[pose.x_m, pose.y_m]])?;
    number("heading_rad", pose.heading_rad, pose.heading_rad.is_finite(), "finite")
}

fn polyline(field: &'static str, points: &[[f64; 2]], wanted: usize) -> Check {
    if points.len() < wanted {
        return Err(WorldProblem::TooFewPoints { field, points: points.len(), wanted });
    }
    coordinates(field, points)?;
    let same = points.windows(2).position(|pair| Point2::from(pair[0]) == Point2::from(pair[1]));
    same.map_or(Ok(()), |before| Err(WorldProblem::NoLength { field, point: before + 1 }))
}

fn trigger(trigger: Trigger) -> Check {
    trigger.at_s.map_or(Ok(()), |at_s| not_negative("at_s", at_s))?;
    trigger.near_m.map_or(Ok(()), |near_m| positive("near_m", near_m))
}
