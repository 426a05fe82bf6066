//! The model of echoes: what is expected, how likely its errors are, and places that are alike.

use crate::echo::EchoModel;
use crate::field::LANES;
use crate::params::Model;
use crate::resample::{Apart, BINS, CLUSTERS, resample_apart};
use crate::{Beams, Filter, Map, Params, ParamsError, ParticleLocaliser, Particles, Weigher};
use geometry::{Point2, Polygon, Pose2, Segment, Walls, World};
use messages::RangeScan;
use proptest::prelude::*;

fn params() -> Params {
    Params {
        model: Model::Echo,
        cone_half_width_rad: 15.0_f64.to_radians(),
        range_max_m: 2.54,
        sigma_m: 0.013,
        random_share: 0.02,
        independent_beams: 62.0,
        ..Params::default()
    }
}

fn world(number: u32) -> World {
    World::load(format!("{}/../../launch/worlds/arena-{number}.toml", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

fn at(map: &Map, x_m: f64, y_m: f64, heading_rad: f64) -> [f32; 3] {
    let own = map.to_own(Pose2::new(x_m, y_m, heading_rad));
    [own.x_m as f32, own.y_m as f32, own.heading_rad as f32]
}

/// A scan with these readings, one a degree.
fn beams(readings: impl Fn(usize) -> f64) -> Beams {
    let header =
        RangeScan { angle_step_rad: 1.0_f64.to_radians(), range_max_m: 2.55, ..RangeScan::default() };
    let ranges: Vec<f32> = (0..360).map(|index| readings(index) as f32).collect();
    Beams::select(&header, &ranges, 2.54, 360)
}

/// The nearest of a fan of rays.
fn nearest_m(walls: &Walls, pose: Pose2, direction_rad: f64, half_width_rad: f64) -> f64 {
    let rays = (-300..=300).map(|ray| f64::from(ray) / 300.0 * half_width_rad);
    let cast = |aside_rad: f64| {
        let hit = walls.cast(pose.position(), pose.heading_rad + direction_rad + aside_rad, 2.54);
        hit.map_or(2.54, |hit| hit.range_m)
    };
    rays.map(cast).fold(2.54, f64::min)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, max_global_rejects: 50_000, ..ProptestConfig::default() })]
    #[test]
    fn the_nearest_thing_of_a_cone_is_that_of_a_fan_of_rays(
        number in 1_u32..4, x in 0.0..1.0_f64, y in 0.0..1.0_f64, heading_rad in -3.0..3.0_f64, half_deg in 0.0..20.0_f64,
    ) {
        let outline = world(number).floors[0].outline_polygon().unwrap();
        let (low, high) = outline.bounds();
        let place = Point2::new(low.x + x * (high.x - low.x), low.y + y * (high.y - low.y));
        prop_assume!(outline.contains(place) && outline.distance_to_boundary_m(place) > 0.05);
        let map = Map::of_outline(&outline, 0.01).unwrap();
        let half_rad = half_deg.to_radians();
        let params = Params { cone_half_width_rad: half_rad, ..params() };
        let weigher = Weigher::new(&params, &map);
        let beams = beams(|index| if index % 9 == 0 { 1.0 } else { 0.0 });
        let mut particles = Particles::default();
        particles.push(at(&map, place.x, place.y, heading_rad));
        let expected = weigher.expected_ranges(&particles, &beams);
        let walls = Walls::new(outline.edges());
        let pose = Pose2::new(place.x, place.y, heading_rad);
        for (direction_rad, expected_m) in beams.direction_rad.iter().zip(&expected) {
            let fan_m = nearest_m(&walls, pose, f64::from(*direction_rad), half_rad);
            let (expected_m, slack) = (f64::from(*expected_m), 1e-3);
            // A fan may miss the very corner, or the edge of the cone, by a little.
            let wider_m = nearest_m(&walls, pose, f64::from(*direction_rad), half_rad + 2e-3);
            let narrower_m = nearest_m(&walls, pose, f64::from(*direction_rad), (half_rad - 2e-3).max(0.0));
            prop_assert!(
                (wider_m - slack..=narrower_m + slack).contains(&expected_m),
                "{expected_m} for {fan_m} at {direction_rad}"
            );
        }
    }

    #[test]
    fn vectors_and_plain_loops_agree_bit_by_bit(number in 1_u32..4, seed in any::<u64>(), direction_rad in -3.2..3.2_f32) {
        let map = Map::of_world(&world(number), 0, 0.01).unwrap();
        let (model, _) = EchoModel::new(&params(), &map.walls);
        let mut filter = Filter::new(Params { global_particles: 64, max_particles: 64, min_particles: 10, ..params() }, map, seed);
        filter.correct(&beams(|_| 0.3));
        let particles = filter.particles();
        let count = particles.len().min(LANES);
        let poses = [&particles.x[..count], &particles.y[..count], &particles.heading[..count]];
        prop_assert!(model.agrees_with_itself(poses, direction_rad));
    }
}

#[test]
fn densities_are_densities() {
    // Over all differences, for every kind of meeting, the density sums to what lies within the table.
    let (model, nats) = EchoModel::new(&params(), &[Segment::between([0.0, 0.0], [1.0, 0.0])]);
    assert!((5.0..12.0).contains(&nats), "{nats}");
    // The worst that the table holds is a reading from nowhere.
    let worst = params().random_share / params().range_max_m;
    for facing in [1.0, 0.9, 0.7, 0.5, 0.2] {
        let mass = model.mass(facing, nats, worst);
        // Rounding to 255 steps, and what comes back later than the table knows.
        assert!((0.75..1.1).contains(&mass), "{mass} at {facing}");
    }
    // Straight on a short reading is as bad as a long one; askew a long one is no wonder.
    let [short, right, long] = [-0.08, 0.0, 0.08].map(|difference_m| model.points_of(1.0, difference_m));
    assert!(short < right && long < right, "{short} {right} {long}");
    let [short, long] = [-0.08, 0.08].map(|difference_m| model.points_of(0.6, difference_m));
    assert!(long > short + 40, "{short} {long}");
}

#[test]
fn places_that_are_alike_come_out_alike() {
    // In the third arena's corridor, 0.9 m apart, a cone of 15 degrees sees the same.
    let world = world(3);
    let map = Map::of_world(&world, 0, 0.01).unwrap();
    let walls = Walls::new(world.wall_segments(0));
    let truth = Pose2::new(1.473, 0.173, -1.556);
    let half_rad = 15.0_f64.to_radians();
    let kept = |index: usize| (index + 15) % 90 <= 30;
    let scan = beams(|index| {
        if kept(index) { nearest_m(&walls, truth, (index as f64).to_radians(), half_rad) } else { 0.0 }
    });
    let params = Params {
        global_particles: 60_000,
        min_particles: 1000,
        max_particles: 3000,
        max_passes: 12,
        pass_effective_share: 0.4,
        bin_m: 0.05,
        bin_rad: 0.2,
        jitter_m: 0.002,
        jitter_rad: 0.004,
        ..params()
    };
    for seed in 1..4 {
        let mut filter = Filter::new(params.clone(), map.clone(), seed);
        let update = filter.correct(&scan).unwrap();
        let share = |x_m: f64| {
            let there = |cluster: &&crate::Cluster| {
                filter.map().from_own(cluster.pose).distance_m(Pose2::new(x_m, 0.173, 0.0)) < 0.05
            };
            update.clusters.iter().filter(there).map(|cluster| cluster.share).sum::<f64>()
        };
        let (here, there) = (share(1.473), share(0.573));
        assert!(
            here + there > 0.9 && (0.33..3.0).contains(&(here / there)),
            "seed {seed}: {here} and {there}"
        );
    }
}

#[track_caller]
fn check_apart(groups: Apart, weights: [f64; 3], least: [usize; 3]) {
    let mut from = Particles::default();
    let mut ranks = Vec::new();
    for (rank, weight) in (0_u32..).zip(weights) {
        for index in 0..100 {
            from.push([rank as f32, index as f32, 0.0]);
            from.weight[rank as usize * 100 + index] = weight / 100.0;
            ranks.push(rank);
        }
    }
    let mut into = Particles::default();
    resample_apart(&from, &mut into, &ranks, groups, 300, (1, 2));
    assert!((297..=453).contains(&into.len()), "{} of 300", into.len());
    let total: f64 = weights.iter().sum();
    for (rank, (weight, least)) in weights.into_iter().zip(least).enumerate() {
        let members = (0..into.len()).filter(|index| into.x[*index] == rank as f32);
        let (count, mass) =
            members.fold((0, 0.0), |(count, mass), index| (count + 1, mass + into.weight[index]));
        assert!(count >= least, "{count} of group {rank}");
        assert!(least == 0 || (mass - weight / total).abs() < 0.02, "{mass} of group {rank}");
    }
    assert!((into.weight.iter().sum::<f64>() - 1.0).abs() < 1e-9);
}

#[test]
fn light_groups_are_kept_by_enough_particles_without_more_weight() {
    check_apart(CLUSTERS, [0.9, 0.08, 0.02], [200, 45, 45]);
    // Too light to be kept apart.
    check_apart(CLUSTERS, [0.9, 0.099, 0.001], [200, 70, 0]);
    // In a search everything is.
    check_apart(BINS, [0.9, 0.0999, 0.0001], [200, 45, 45]);
    check_apart(CLUSTERS, [1.0, 0.0, 0.0], [300, 0, 0]);
}

#[test]
fn a_grid_map_has_no_lines_for_echoes() {
    let outline = Polygon::rectangle(2.0, 1.0).unwrap();
    let lines = Map::of_outline(&outline, 0.05).unwrap();
    assert!(ParticleLocaliser::new(params(), lines.clone(), 1).is_ok());
    let grid = lines.distances_m.map(|distance_m| {
        if *distance_m < 0.01 { geometry::Occupancy::OCCUPIED } else { geometry::Occupancy::FREE }
    });
    let refused = ParticleLocaliser::new(params(), Map::of_grid(&grid, 65), 1);
    assert!(matches!(refused, Err(ParamsError::NoLines)));
}
