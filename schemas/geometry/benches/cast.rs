//! How fast rays, cones, clearances and distance transforms are: `cargo bench -p geometry`.

use divan::{Bencher, black_box, counter::ItemsCount};
use geometry::{
    Body, BodyKind, Cone, Grid, GridFrame, Occupancy, Point2, Polygon, Pose2, Scene, Segment, Surface, Walls,
};
use parry2d_f64::query::{Ray, RayCast};
use parry2d_f64::{math::Vector, shape::Polyline};

fn main() {
    divan::main();
}

/// Both sides of a hallway 40 m long with a recess every two metres: ten walls a recess pair.
fn hallway(recesses: usize) -> Vec<Segment> {
    let mut walls = Vec::new();
    for (y, depth) in [(0.0, -0.1), (1.7, 1.8)] {
        let mut at = [0.0, y];
        for i in 0..recesses {
            let x = 40.0 * (i as f64 + 0.5) / recesses as f64;
            let width = 20.0 / recesses as f64;
            for next in [[x, y], [x, depth], [x + width, depth], [x + width, y]] {
                walls.push(Segment::between(at, next));
                at = next;
            }
        }
        walls.push(Segment::between(at, [40.0, y]));
    }
    walls
}

/// Headings and places spread evenly, the same in every run.
fn rays(count: usize) -> Vec<(Point2<f64>, f64)> {
    let turn = |i: usize, by: f64| (i as f64 * by).fract();
    (0..count)
        .map(|i| {
            let place = Point2::new(1.0 + 38.0 * turn(i, 0.618_033_99), 0.2 + 1.3 * turn(i, 0.414_213_56));
            (place, std::f64::consts::TAU * turn(i, 0.732_050_81))
        })
        .collect()
}

#[divan::bench(args = [1, 5, 25, 60])]
fn walls_cast(bencher: Bencher<'_, '_>, recesses: usize) {
    let walls = Walls::new(hallway(recesses));
    let rays = rays(1000);
    bencher.counter(ItemsCount::new(rays.len())).bench(|| {
        rays.iter().filter_map(|&(place, heading)| walls.cast(black_box(place), heading, 50.0)).count()
    });
}

#[divan::bench(args = [1, 5, 25, 60])]
fn parry_cast(bencher: Bencher<'_, '_>, recesses: usize) {
    let walls = hallway(recesses);
    let vertices = walls.iter().flat_map(|wall| [wall.a, wall.b]).map(|p| Vector::new(p.x, p.y)).collect();
    let indices = (0..walls.len() as u32).map(|i| [2 * i, 2 * i + 1]).collect();
    let polyline = Polyline::new(vertices, Some(indices));
    let rays = rays(1000);
    bencher.counter(ItemsCount::new(rays.len())).bench(|| {
        let ray = |place: Point2<f64>, heading: f64| {
            Ray::new(Vector::new(place.x, place.y), Vector::new(heading.cos(), heading.sin()))
        };
        rays.iter()
            .filter_map(|&(place, heading)| {
                polyline.cast_local_ray_and_get_normal(&ray(black_box(place), heading), 50.0, false)
            })
            .count()
    });
}

fn furnished() -> Scene {
    let mut scene = Scene::new(hallway(25));
    let kinds = [BodyKind::MailCart, BodyKind::SpinningChair, BodyKind::Sofa, BodyKind::WoodenChair];
    for i in 0..16_u32 {
        let pose = Pose2::new(2.0 + 2.3 * f64::from(i), 0.3 + 1.1 * f64::from(i % 2), f64::from(i));
        scene.add_body(Body::of(kinds[i as usize % 4]), pose, Surface::Furniture(i));
    }
    scene
}

#[divan::bench(args = [1, 7])]
fn cone_cast(bencher: Bencher<'_, '_>, rows: usize) {
    let scene = furnished();
    let cone = Cone { half_width_rad: 0.236, half_height_rad: 0.236, columns: 9, rows, max_range_m: 4.0 };
    let sensors = rays(100);
    let mut hits = Vec::new();
    bencher.counter(ItemsCount::new(sensors.len() * cone.rays())).bench_local(|| {
        for &(place, heading) in &sensors {
            scene.cast_cone(Pose2::new(place.x, place.y, heading), 0.25, &cone, &mut hits);
            black_box(&hits);
        }
    });
}

#[divan::bench]
fn clearance(bencher: Bencher<'_, '_>) {
    let scene = furnished();
    let footprint = Polygon::rectangle(0.61, 0.51).expect("a rectangle");
    let places = rays(100);
    bencher.counter(ItemsCount::new(places.len())).bench(|| {
        let poses = places.iter().map(|&(place, heading)| Pose2::new(place.x, place.y, heading));
        poses.map(|pose| scene.clearance_m(&footprint, pose, [0.0, 1.2], None)).sum::<f64>()
    });
}

#[divan::bench]
fn distances_of_600_by_600(bencher: Bencher<'_, '_>) {
    let frame = GridFrame::new(600, 600, 0.05, Pose2::IDENTITY).expect("a good frame");
    let mut grid = Grid::filled(frame, Occupancy::FREE);
    for (i, cell) in grid.as_mut_slice().iter_mut().enumerate() {
        if (i * 2_654_435_761) % 101 < 5 {
            *cell = Occupancy::OCCUPIED;
        }
    }
    bencher.bench(|| black_box(&grid).distances_m(65));
}

#[divan::bench]
fn grid_cast(bencher: Bencher<'_, '_>) {
    let frame = GridFrame::new(600, 600, 0.05, Pose2::IDENTITY).expect("a good frame");
    let mut grid = Grid::filled(frame, Occupancy::FREE);
    for i in 0..600 * 600_usize {
        let (column, row) = (i % 600, i / 600);
        if column % 97 == 0 && row % 20 != 0 || row % 89 == 0 && column % 17 != 0 {
            grid.as_mut_slice()[i] = Occupancy::OCCUPIED;
        }
    }
    let rays = rays(1000);
    bencher.counter(ItemsCount::new(rays.len())).bench(|| {
        let cast = |&(place, heading): &(Point2<f64>, f64)| {
            grid.cast_m(Point2::new(0.75 * place.x, 18.0 * place.y), heading, 30.0, 65)
        };
        rays.iter().filter_map(cast).count()
    });
}
