//! The map: walls and doors, the robot and whoever is in its way.

use super::plan::{DoorMark, FloorPlan, Line as Wall, Plan, bounds_of};
use super::snapshot::{BodyMark, Scene};
use geometry::{Body, BodyKind as SolidKind, Point2, Pose2, Shape};
use messages::BodyKind;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::Span;
use ratatui::widgets::Block;
use ratatui::widgets::canvas::{Canvas, Circle, Context, Line, Points};

/// The coffee robot from above (COF-003): half its length and half its width.
const HALF_LENGTH_M: f64 = 0.305;
const HALF_WIDTH_M: f64 = 0.255;
/// Half the width of a person.
const WALKER_RADIUS_M: f64 = 0.25;
/// Free space around the map.
const MARGIN_M: f64 = 0.3;

/// The map of the robot's floor, the whole of it, both axes to one scale.
pub(crate) fn draw_map(frame: &mut Frame<'_>, area: Rect, plan: Option<&Plan>, scene: &Scene, robot: Color) {
    let floor = plan.and_then(|plan| plan.floor(scene.floor));
    let title = floor.map_or("map", |floor| floor.name.as_str());
    let block = Block::bordered().title(format!(" {title} ")).border_style(Style::new().dark_gray());
    let inner = block.inner(area);
    if inner.width < 4 || inner.height < 2 {
        return;
    }
    let window = fit(floor.map_or_else(|| surroundings(scene), |floor| floor.bounds), inner);
    let [x0, x1, y0, y1] = window;
    let cell_m = (x1 - x0) / f64::from(inner.width);
    let canvas =
        Canvas::default().block(block).marker(Marker::Braille).x_bounds([x0, x1]).y_bounds([y0, y1]).paint(
            |context| {
                if let Some(floor) = floor {
                    draw_floor(context, floor, scene.open_doors);
                }
                draw_moving(context, scene, cell_m, robot);
                context.layer();
                if let Some(floor) = floor {
                    draw_labels(context, &floor.doors, cell_m);
                }
                if let Some(pose) = scene.robot {
                    context.print(
                        pose.x_m,
                        pose.y_m,
                        Span::styled(arrow(pose.heading_rad), Style::new().fg(robot).bold()),
                    );
                }
            },
        );
    frame.render_widget(canvas, area);
}

/// Whether there is anything to draw.
pub(crate) fn is_worthwhile(plan: Option<&Plan>, scene: &Scene) -> bool {
    plan.is_some() || scene.robot.is_some()
}

/// Bounds that show all of `bounds` in the area with one scale for both axes: a braille cell is two dots wide and four high, and dots are
/// about square.
fn fit([x0, x1, y0, y1]: [f64; 4], area: Rect) -> [f64; 4] {
    let (width, height) = (f64::from(area.width) * 2.0, f64::from(area.height) * 4.0);
    let (x_m, y_m) = (x1 - x0 + 2.0 * MARGIN_M, y1 - y0 + 2.0 * MARGIN_M);
    let dot_m = (x_m / width).max(y_m / height);
    let (half_x, half_y) = (0.5 * dot_m * width, 0.5 * dot_m * height);
    let (x, y) = (0.5 * (x0 + x1), 0.5 * (y0 + y1));
    [x - half_x, x + half_x, y - half_y, y + half_y]
}

/// Without walls: where the robot was and is.
fn surroundings(scene: &Scene) -> [f64; 4] {
    let places = scene.trail.iter().copied().chain(scene.robot.map(|pose| [pose.x_m, pose.y_m]));
    let lines: Vec<Wall> = places.map(|[x, y]| [x - 1.0, y - 1.0, x + 1.0, y + 1.0]).collect();
    bounds_of(lines.iter())
}

fn draw_floor(context: &mut Context<'_>, floor: &FloorPlan, open_doors: u128) {
    lines(context, &floor.rooms, Color::DarkGray);
    context.layer();
    lines(context, &floor.walls, Color::Gray);
    for door in &floor.doors {
        let is_open = door.index.is_some_and(|index| index < 128 && open_doors >> index & 1 == 1);
        let (leaf, colour) =
            if is_open { (door.open, Color::LightYellow) } else { (door.closed, Color::Yellow) };
        lines(context, &[leaf], colour);
    }
}

fn draw_moving(context: &mut Context<'_>, scene: &Scene, cell_m: f64, robot: Color) {
    context.layer();
    let dots = |places: &[[f64; 2]]| places.iter().map(|&[x, y]| (x, y)).collect::<Vec<_>>();
    context.draw(&Points { coords: &dots(&scene.trail), color: Color::DarkGray });
    let path: Vec<Wall> =
        scene.path.windows(2).map(|ends| [ends[0][0], ends[0][1], ends[1][0], ends[1][1]]).collect();
    lines(context, &path, Color::Cyan);
    for body in &scene.bodies {
        draw_body(context, body);
    }
    if let Some(pose) = scene.estimate {
        context.draw(&Circle {
            x: pose.x_m,
            y: pose.y_m,
            radius: (1.5 * cell_m).max(0.2),
            color: Color::Magenta,
        });
    }
    if let Some(pose) = scene.robot {
        let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
        let corners = corners.map(|(x, y)| Point2::new(x * HALF_LENGTH_M, y * HALF_WIDTH_M));
        outline(context, &corners, pose, robot);
    }
}

fn draw_body(context: &mut Context<'_>, body: &BodyMark) {
    let solid = match body.kind {
        BodyKind::None => return,
        BodyKind::Walker => {
            let Pose2 { x_m, y_m, .. } = body.pose;
            context.draw(&Circle { x: x_m, y: y_m, radius: WALKER_RADIUS_M, color: Color::LightRed });
            return;
        }
        BodyKind::MailCart => SolidKind::MailCart,
        BodyKind::SpinningChair => SolidKind::SpinningChair,
        BodyKind::Sofa => SolidKind::Sofa,
        BodyKind::WoodenChair => SolidKind::WoodenChair,
        BodyKind::CardboardBox => SolidKind::CardboardBox,
    };
    for prism in Body::of(solid).prisms() {
        match &prism.shape {
            Shape::Polygon(polygon) => outline(context, polygon.corners(), body.pose, Color::LightBlue),
            Shape::Disc { centre, radius_m } => {
                let centre = body.pose.transform(*centre);
                context.draw(&Circle {
                    x: centre.x,
                    y: centre.y,
                    radius: *radius_m,
                    color: Color::LightBlue,
                });
            }
        }
    }
}

fn draw_labels(context: &mut Context<'_>, doors: &[DoorMark], cell_m: f64) {
    // Names that would run into each other are worse than none.
    let mut taken: Vec<[f64; 3]> = Vec::new();
    for door in doors {
        let half_m = 0.5 * cell_m * door.label.chars().count() as f64;
        // In the room, clear of the wall: a cell is twice as high as wide.
        let depth_m = (3.0 * cell_m).max(1.0);
        let [x, y] = [door.at[0] + door.into[0] * depth_m, door.at[1] + door.into[1] * depth_m];
        let clash = taken.iter().any(|&[other_x, other_y, other_half_m]| {
            (x - other_x).abs() < half_m + other_half_m + cell_m && (y - other_y).abs() < 2.0 * cell_m
        });
        if !clash {
            taken.push([x, y, half_m]);
            context.print(x - half_m, y, Span::styled(door.label.clone(), Style::new().yellow()));
        }
    }
}

fn outline(context: &mut Context<'_>, corners: &[Point2<f64>], pose: Pose2, colour: Color) {
    let placed: Vec<_> = corners.iter().map(|corner| pose.transform(*corner)).collect();
    let next = placed.iter().cycle().skip(1);
    let edges: Vec<Wall> = placed.iter().zip(next).map(|(a, b)| [a.x, a.y, b.x, b.y]).collect();
    lines(context, &edges, colour);
}

fn lines(context: &mut Context<'_>, lines: &[Wall], colour: Color) {
    for &[x1, y1, x2, y2] in lines {
        context.draw(&Line::new(x1, y1, x2, y2, colour));
    }
}

/// The arrow that points most nearly that way.
fn arrow(heading_rad: f64) -> &'static str {
    const ARROWS: [&str; 8] = ["→", "↗", "↑", "↖", "←", "↙", "↓", "↘"];
    let eighths = (heading_rad / std::f64::consts::FRAC_PI_4).round();
    // A heading that is no number points ahead.
    ARROWS[(eighths as i64).rem_euclid(8) as usize]
}
