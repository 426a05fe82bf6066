//! The pieces of the filter, each alone.

use crate::expected::Caster;
use crate::field::{ByteField, LANES};
use crate::params::{Model, Recovery};
use crate::random::{Purpose, Stream};
use crate::ratios::Ratios;
use crate::resample::comb;
use crate::trigonometry::{sin_cos, wrap};
use crate::{Averages, Beams, Filter, Map, Params, ParamsError, Start, kld};
use geometry::{Grid, GridFrame, Occupancy, OccupancyGrid, Polygon, Pose2};
use messages::{Parameters, RangeScan};

#[test]
fn sines_are_sines() {
    for step in -20_000..20_000 {
        let angle = step as f32 * 1e-3;
        let (sine, cosine) = sin_cos(angle);
        assert!((f64::from(sine) - f64::from(angle).sin()).abs() < 2e-6, "{angle}");
        assert!((f64::from(cosine) - f64::from(angle).cos()).abs() < 2e-6, "{angle}");
        let apart = geometry::angle::difference(f64::from(wrap(angle)), f64::from(angle));
        assert!(apart.abs() < 1e-5 && wrap(angle).abs() < std::f32::consts::PI + 1e-5, "{angle}");
    }
}

#[test]
fn normal_numbers_are_normal() {
    let stream = Stream::new(3, 5, Purpose::Motion);
    let count = 100_000;
    let moment = |power| {
        (0..count).map(|index| f64::from(stream.normal(index, 2)).powi(power)).sum::<f64>() / count as f64
    };
    assert!(moment(1).abs() < 0.01 && (moment(2) - 1.0).abs() < 0.01, "{} {}", moment(1), moment(2));
    assert!((moment(4) - 2.85).abs() < 0.1, "eight uniform numbers: {}", moment(4));
}

#[track_caller]
fn check_comb(weights: &[f64], count: usize, least: &[usize]) {
    let mut drawn = vec![0; weights.len()];
    comb(weights, count, 1, 1, |index| drawn[index] += 1);
    assert_eq!(drawn.iter().sum::<usize>(), count);
    for (drawn, least) in drawn.iter().zip(least) {
        assert!((*least..=least + 1).contains(drawn), "{drawn} for {least}");
    }
}

#[test]
fn a_comb_draws_by_weight() {
    check_comb(&[0.5, 0.25, 0.25], 8, &[4, 2, 2]);
    check_comb(&[1.0, 0.0, 0.0], 5, &[5, 0, 0]);
    check_comb(&[0.0, 0.0, 1.0], 5, &[0, 0, 5]);
    check_comb(&[3.0, 1.0], 6, &[4, 1]);
    check_comb(&[], 0, &[]);
}

#[test]
fn kld_follows_fox() {
    // From equation 7 by hand: 10 (1 - 2/9 + 2.33 sqrt(2/9))³ = 66.04.
    assert_eq!(kld::enough(1, 0.05, 2.33), 1);
    assert_eq!(kld::enough(2, 0.05, 2.33), 67);
    assert!(kld::enough(100, 0.05, 2.33) > 1000 && kld::enough(100, 0.05, 2.33) < 1500);
}

#[test]
fn a_drop_of_the_fit_scatters_particles() {
    let recovery = Recovery::default();
    let mut averages = Averages::default();
    (0..50).for_each(|_| averages.add(0.9, &recovery));
    assert_eq!(averages.scatter_share(&recovery), 0.0);
    (0..5).for_each(|_| averages.add(0.3, &recovery));
    assert!(averages.scatter_share(&recovery) > 0.1);
    averages.add(f64::NAN, &recovery);
    assert!(averages.fit().is_finite());
}

#[track_caller]
fn check_beams(ranges: &[f32], most: usize, expected: &[f32]) {
    let header = RangeScan { angle_step_rad: 0.1, range_max_m: 10.0, ..RangeScan::default() };
    assert_eq!(Beams::select(&header, ranges, 8.0, most).range_m, expected);
}

#[test]
fn invalid_beams_are_dropped_before_thinning() {
    check_beams(&[1.0, f32::NAN, 0.0, 2.0, -1.0, 10.0, 9.0, f32::INFINITY, 3.0], 9, &[1.0, 2.0, 3.0]);
    check_beams(&[10.0, 10.0, 10.0, 1.0, 2.0, 3.0], 3, &[1.0, 2.0, 3.0]);
    check_beams(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 3, &[2.0, 4.0, 6.0]);
    check_beams(&[], 3, &[]);
    let nonsense = RangeScan { angle_step_rad: f64::NAN, range_max_m: 10.0, ..RangeScan::default() };
    assert!(Beams::select(&nonsense, &[1.0], 8.0, 3).is_empty());
}

fn room() -> OccupancyGrid {
    let frame = GridFrame::new(100, 80, 0.05, Pose2::new(-3.0, 2.0, 0.4)).unwrap();
    let mut grid = Grid::filled(frame, Occupancy::FREE);
    for cell in frame.cells() {
        let (c, r) = (cell.column, cell.row);
        if c == 0 || r == 0 || c == 99 || r == 79 || (c > 60 && r > 50) || (c == 20 && r < 15) {
            *grid.get_mut(cell).unwrap() = Occupancy::OCCUPIED;
        }
    }
    grid
}

/// Particles inside and outside of the room.
fn spread() -> [Vec<f32>; 3] {
    let stream = Stream::new(9, 9, Purpose::Start);
    let numbers = |lane| (0..100).map(|index| 9.0 * stream.uniform(index, lane) - 2.0).collect();
    [numbers(0), numbers(1), numbers(2)]
}

#[test]
fn vectors_and_plain_loops_agree_bit_by_bit() {
    let map = Map::of_grid(&room(), 65);
    let field = ByteField::new(&map.distances_m, 2, 7, |d| (255.0 * (-d).exp()) as u8);
    let [x, y, heading] = spread();
    let (u, v): (Vec<f32>, Vec<f32>) =
        (0..37).map(|i| (i as f32 * 1.7 - 20.0, i as f32 * -0.9 + 11.0)).unzip();
    let (mut fast, mut plain) = (vec![0; x.len()], vec![0; x.len()]);
    field.sums([&x, &y, &heading], &u, &v, &mut fast);
    for at in (0..x.len()).step_by(LANES) {
        let to = (at + LANES).min(x.len());
        field.block_sums([&x[at..to], &y[at..to], &heading[at..to]], &u, &v, &mut plain[at..to]);
    }
    assert_eq!(fast, plain);
    assert!(fast.iter().any(|sum| *sum != fast[0]));
    let outline = Polygon::rectangle(5.0, 4.0).unwrap();
    let lines = Map::of_outline(&outline, 0.05).unwrap();
    let directions: Vec<[f32; 2]> = (0..30).map(|i| (i as f32 * 0.21).sin_cos().into()).collect();
    for map in [&map, &lines] {
        let caster = Caster::new(&map.walls, &map.distances_m);
        let block = caster.block([&x[..LANES], &y[..LANES], &heading[..LANES]], [0.1, -0.2]);
        let mut fast = Vec::new();
        caster.cast(&block, &directions, 12.0, &mut fast);
        let mut plain = vec![[12.0; LANES]; directions.len()];
        caster.cast_plain(&block, &directions, 12.0, &mut plain);
        assert_eq!(fast, plain);
        assert!(fast.iter().flatten().any(|range| *range < 5.0));
    }
}

#[track_caller]
fn check_model(model: Model, budget: u64, limited: bool) {
    let grid = room();
    let truth = grid.frame().origin().compose(Pose2::new(1.6, 1.9, 0.7));
    let header =
        RangeScan { angle_min_rad: -2.0, angle_step_rad: 0.05, range_max_m: 20.0, ..RangeScan::default() };
    let range = |index: i32| {
        let direction = truth.heading_rad - 2.0 + f64::from(index) * 0.05;
        grid.cast_m(truth.position(), direction, 20.0, 65).map_or(20.0, |range| range as f32 + 0.02)
    };
    let ranges: Vec<f32> = (0..81).map(range).collect();
    let beams = Beams::select(&header, &ranges, 20.0, 81);
    let Pose2 { x_m, y_m, heading_rad } = truth;
    let start = Start { x_m, y_m, heading_rad, sigma_m: 0.15, sigma_rad: 0.1 };
    let params =
        Params { model, start: Some(start), budget_particle_beams: budget, beams: 81, ..Params::default() };
    let map = Map::of_grid(&grid, 65);
    let mut filter = Filter::new(params, map, 11);
    let update = filter.correct(&beams).unwrap();
    assert_eq!(update.limited, limited);
    let best = filter.map().from_own(update.clusters[0].pose);
    assert!(best.distance_m(truth) < 0.04, "{model:?}: {best:?} for {truth:?}");
    assert!(geometry::angle::difference(best.heading_rad, truth.heading_rad).abs() < 0.02, "{model:?}");
    assert!((filter.particles().weight.iter().sum::<f64>() - 1.0).abs() < 1e-9);
}

#[test]
fn every_model_finds_the_pose() {
    check_model(Model::LogProduct, 0, false);
    check_model(Model::LikelihoodField, 0, false);
    check_model(Model::Beam, 0, false);
    check_model(Model::Gaussian, 0, false);
}

#[test]
fn a_bound_lowers_the_count_and_says_so() {
    check_model(Model::LogProduct, 81 * 1000, true);
    check_model(Model::LogProduct, 81 * 1_000_000, false);
}

#[test]
fn wrong_parameters_are_refused() {
    let check = |params: Params| params.check().unwrap_err();
    assert!(matches!(
        check(Params { min_particles: 900, max_particles: 800, ..Params::default() }),
        ParamsError::FewestAboveMost { min_particles: 900, max_particles: 800 }
    ));
    assert!(matches!(
        check(Params { sigma_m: f64::NAN, ..Params::default() }),
        ParamsError::Misfit(misfit) if misfit.name() == "sigma_m"
    ));
    let recovery = Recovery { slow_rate: 0.4, ..Recovery::default() };
    assert!(matches!(check(Params { recovery, ..Params::default() }), ParamsError::SlowNotSlower { .. }));
    assert!(Params::default().check().is_ok());
}

#[test]
fn without_a_map_nothing_is_found() {
    let mut filter = Filter::new(Params::default(), Map::empty(), 1);
    let header = RangeScan { angle_step_rad: 0.1, range_max_m: 10.0, ..RangeScan::default() };
    assert_eq!(filter.correct(&Beams::select(&header, &[1.0, 2.0], 8.0, 9)), None);
}

#[track_caller]
fn check_ratios(ratios: &Ratios, likelihood: impl Fn(f64) -> f64) {
    for points in (0..=40_000).step_by(37) {
        let expected = likelihood(f64::from(points)) / likelihood(40_000.0);
        let ratio = ratios.of(points);
        assert!((ratio - expected).abs() <= 1e-12 * expected.max(1e-280), "{points}: {ratio} for {expected}");
    }
    assert_eq!(ratios.of(40_000), 1.0);
}

#[test]
fn ratios_are_likelihoods() {
    check_ratios(&Ratios::of_logs(40_000, 3e-4), |points| (3e-4 * points).exp());
    check_ratios(&Ratios::of_logs(40_000, 0.01), |points| (0.01 * (points - 40_000.0)).exp());
    check_ratios(&Ratios::of_sums(40_000, 255.0, 1.0), |points| 255.0 + points);
    check_ratios(&Ratios::of_sums(40_000, 255.0, 0.3), |points| (255.0 + points).powf(0.3));
}

#[test]
fn a_map_is_checked_by_its_head() {
    let folder = tempfile::tempdir().unwrap();
    let check = |head: &str, model| {
        std::fs::write(folder.path().join("m.pgm"), head).unwrap();
        let yaml = folder.path().join("m.yaml");
        let text =
            "image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.2\n";
        std::fs::write(&yaml, text).unwrap();
        let map = yaml.to_string_lossy().into_owned();
        Map::check(&Params { map, model, ..Params::default() }).map_err(|error| error.to_string())
    };
    // The pixels are not there, and nobody asks for them.
    assert_eq!(check("P5 8000 8000 255\n", Model::LogProduct), Ok(()));
    assert!(check("P5 8200 8200 255\n", Model::LogProduct).unwrap_err().contains("8200 x 8200 cells"));
    assert!(check("P5 80 80 255\n", Model::Echo).unwrap_err().contains("needs walls that are lines"));
    let world = |resolution_m| {
        let file = folder.path().join("w.toml");
        std::fs::write(&file, "name = \"w\"\n[[floor]]\nnumber = 0\nwalls = [[[0, 0], [90, 90]]]\n").unwrap();
        let world = file.to_string_lossy().into_owned();
        let params = Params { world, world_resolution_m: resolution_m, ..Params::default() };
        Map::check(&params).map_err(|error| error.to_string())
    };
    assert_eq!(world(0.02), Ok(()));
    assert!(world(0.002).unwrap_err().contains("world_resolution_m = 0.002"), "{:?}", world(0.002));
}
