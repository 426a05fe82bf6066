//! The filter itself: particles are moved, weighed, drawn anew and scattered. It knows no messages.
//!
//! Monte Carlo localisation (Fox et al. 1999) with these changes: one scan is taken in by several passes,
//! each of which sharpens the belief only so far that enough particles stay effective (annealing, after
//! Deutscher et al. 2000); the number of particles follows the belief (Fox 2003) and a bound of the work; a
//! start without a pose, and the recovery of a robot that was carried away, search the whole map by the same
//! passes.

use crate::bins::Division;
use crate::clusters::{Cluster, Finder};
use crate::evidence::{self, Sampled};
use crate::motion::{MotionSigma, Travel, advance};
use crate::params::{Params, Start};
use crate::ratios::Ratios;
use crate::recovery::Averages;
use crate::resample::{BINS, CLUSTERS, comb, resample_apart};
use crate::{Beams, Map, Particles, Weigher, kld};
use geometry::Pose2;
use serde::{Deserialize, Serialize};

/// The belief of a filter, thinned, as it is handed over.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Belief {
    /// The map's own frame in that of the map's file.
    origin: [f64; 3],
    /// Places and headings in the own frame, all of the same weight.
    particles: Vec<[f32; 3]>,
    spread: [f64; 2],
    averages: Averages,
    searches: u32,
    epoch: u64,
}

/// What an update found.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Update {
    /// Places where the robot may be, the likeliest first.
    pub clusters: Vec<Cluster>,
    /// Effective sample size after the last pass.
    pub effective: f64,
    /// How well the scan fitted the belief before it was used, 0 to 1.
    pub fit: f64,
    /// Passes over the scan.
    pub passes: u32,
    /// Particles that the belief needs.
    pub wanted: usize,
    /// Whether the bound of the work lowered the number of particles or passes.
    pub limited: bool,
    /// Particles scattered anew.
    pub scattered: usize,
    /// Beams used.
    pub beams: usize,
}

/// Particles on a map.
#[derive(Debug, Clone)]
pub struct Filter {
    params: Params,
    map: Map,
    weigher: Weigher,
    division: Division,
    seed: u64,
    /// Counts what uses random numbers.
    epoch: u64,
    particles: Particles,
    /// Where the next generation grows.
    spare: Particles,
    /// How far apart particles are that have been drawn more than once.
    spread: MotionSigma,
    averages: Averages,
    /// Scans that are still to come in which the whole map is searched beside what has been found.
    searches: u32,
    finder: Finder,
    /// Of each bin, whether a particle in it would be drawn.
    is_hit: Vec<bool>,
    points: Vec<u32>,
}

/// The work that is left of a bound.
#[derive(Debug, Clone, Copy)]
struct Budget {
    left: Option<u64>,
    limited: bool,
}

impl Budget {
    /// So many particles can be weighed by so many beams once.
    fn affordable(&mut self, wanted: usize, beams: usize) -> usize {
        let Some(left) = self.left else { return wanted };
        let most = usize::try_from(left / beams.max(1) as u64).unwrap_or(usize::MAX);
        self.limited |= most < wanted;
        wanted.min(most)
    }

    fn spend(&mut self, particles: usize, beams: usize) {
        if let Some(left) = &mut self.left {
            *left = left.saturating_sub(particles as u64 * beams as u64);
        }
    }
}

/// However small the bound, this many particles are kept.
const FEWEST: usize = 10;
/// So many clusters of a search are looked at more closely, if they hold so much of the weight.
const CANDIDATE_CLUSTERS: usize = 12;
const LEAST_SHARE: f64 = 1e-4;
/// Fewest candidates for the particles that are scattered to recover.
const CANDIDATES: usize = 2000;
/// Weight of all scattered particles together, for each unit of their share: one scan may fit a mirrored
/// place better by chance, several may not.
const SCATTERED_PRIOR: f64 = 1e-6;
/// From one pass to the next the spread shrinks to this.
const SHRINK: f64 = 0.6;
/// Scattered particles that are drawn again are moved by this part of the distance between their places.
const APART: f64 = 0.4;
/// Directions at one place among scattered particles, which sets how far apart the places are.
const DIRECTIONS: f64 = 16.0;

impl Filter {
    /// A filter that begins at the start of the parameters or, without one, everywhere. The parameters have
    /// been checked.
    pub fn new(params: Params, map: Map, seed: u64) -> Self {
        let weigher = Weigher::new(&params, &map);
        let division = Division::new(params.bin_m, params.bin_rad);
        let start = params.start;
        let mut filter = Self {
            params,
            map,
            weigher,
            division,
            seed,
            epoch: 0,
            particles: Particles::default(),
            spare: Particles::default(),
            spread: MotionSigma::default(),
            averages: Averages::default(),
            searches: 0,
            finder: Finder::default(),
            is_hit: Vec::new(),
            points: Vec::new(),
        };
        if let Some(start) = start {
            filter.begin_at(&start);
        }
        filter
    }

    /// The particles, in the map's own frame.
    pub fn particles(&self) -> &Particles {
        &self.particles
    }

    /// The map.
    pub fn map(&self) -> &Map {
        &self.map
    }

    /// The measurement model.
    pub fn weigher(&self) -> &Weigher {
        &self.weigher
    }

    /// How well scans fit in the long run, 0 to 1.
    pub fn usual_fit(&self) -> f64 {
        self.averages.usual()
    }

    /// How well the last scans fitted, 0 to 1.
    pub fn fit(&self) -> f64 {
        self.averages.fit()
    }

    /// Forgets everything: the next scan searches the whole map.
    pub fn forget(&mut self) {
        self.particles.clear();
        self.averages = Averages::default();
    }

    /// The belief in at most `most` particles, each cluster with its share; `None` when there is none.
    pub(crate) fn belief(&self, most: usize) -> Option<Belief> {
        let (all, count) = (&self.particles, self.particles.len().min(most));
        let mut particles = Vec::with_capacity(count);
        comb(&all.weight, count, self.seed, self.epoch, |index| particles.push(all.pose(index)));
        let origin = self.map.from_own(Pose2::IDENTITY);
        (count > 0).then_some(Belief {
            origin: [origin.x_m, origin.y_m, origin.heading_rad],
            particles,
            spread: [self.spread.place_m, self.spread.heading_rad],
            averages: self.averages,
            searches: self.searches,
            epoch: self.epoch,
        })
    }

    /// Takes over a belief, on a map that may have another frame, and tells its clusters. `None`, and nothing
    /// is changed, when it is invalid.
    pub(crate) fn take_over(&mut self, belief: &Belief) -> Option<Vec<Cluster>> {
        let Belief { origin: [x_m, y_m, heading_rad], ref particles, spread, averages, searches, epoch } =
            *belief;
        let numbers = particles.iter().flatten().map(|number| f64::from(*number));
        let mut numbers = numbers.chain([x_m, y_m, heading_rad]).chain(spread).chain(averages.numbers());
        // No larger map exists.
        let is_sound = numbers.all(|number| number.abs() < 1e7);
        if !is_sound || particles.is_empty() || particles.len() > self.params.max_particles as usize {
            return None;
        }
        let moved = self.map.to_own(Pose2::new(x_m, y_m, heading_rad));
        self.particles.clear();
        for &[x, y, heading] in particles {
            let pose = moved.compose(Pose2::new(f64::from(x), f64::from(y), f64::from(heading)));
            self.particles.push([pose.x_m as f32, pose.y_m as f32, pose.heading_rad as f32]);
        }
        self.particles.level();
        self.spread = MotionSigma { place_m: spread[0].abs(), heading_rad: spread[1].abs() };
        (self.averages, self.searches, self.epoch) = (averages, searches, epoch);
        Some(self.finder.find(&self.particles, self.division))
    }

    /// Begins anew around a pose in the frame of the map's file.
    pub fn begin_at(&mut self, start: &Start) {
        self.epoch += 1;
        let centre = self.map.to_own(Pose2::new(start.x_m, start.y_m, start.heading_rad));
        let count = self.params.max_particles as usize;
        self.particles.clear();
        for _ in 0..count {
            self.particles.push([centre.x_m as f32, centre.y_m as f32, centre.heading_rad as f32]);
        }
        self.particles.level();
        self.particles.jitter(self.seed, self.epoch, start.sigma_m as f32, start.sigma_rad as f32);
        self.searches = 0;
        self.spread = MotionSigma { place_m: 0.3 * start.sigma_m, heading_rad: 0.3 * start.sigma_rad };
        self.averages = Averages::default();
    }

    /// Moves the particles by what was travelled since the last move.
    pub fn advance(&mut self, travel: &Travel) {
        self.epoch += 1;
        let sigma = travel.sigma(&self.params.motion);
        advance(&mut self.particles, travel, sigma, self.seed, self.epoch);
        self.spread.place_m = self.spread.place_m.max(0.5 * sigma.place_m);
        self.spread.heading_rad = self.spread.heading_rad.max(0.5 * sigma.heading_rad);
    }

    /// Takes in a scan. `None` when there is nothing to weigh, or nowhere to be.
    pub fn correct(&mut self, beams: &Beams) -> Option<Update> {
        if beams.is_empty() || self.map.is_empty() {
            return None;
        }
        let bound = self.params.budget_particle_beams;
        let mut budget = Budget { left: (bound > 0).then_some(bound), limited: false };
        let from_nowhere = self.particles.is_empty();
        if from_nowhere {
            let wanted = self.params.global_particles as usize;
            let count = budget.affordable(wanted, beams.len()).max(FEWEST);
            let (particles, spread) = self.scatter(count, true);
            (self.particles, self.spread) = (particles, spread);
        }
        let affordable = budget.affordable(self.particles.len(), beams.len()).max(FEWEST);
        if affordable < self.particles.len() {
            self.finder.find(&self.particles, self.division);
            self.draw(affordable);
        }
        let mut particles = std::mem::take(&mut self.particles);
        let mut spread = self.spread;
        let done = self.anneal(&mut particles, beams, &mut spread, from_nowhere, &mut budget);
        (self.particles, self.spread) = (particles, spread);
        if from_nowhere {
            self.level_clusters(beams, &mut budget);
            self.searches = self.params.recovery.early_scans;
        } else {
            self.searches = self.searches.saturating_sub(1);
        }
        self.averages.add(done.fit, &self.params.recovery);
        let clusters = self.finder.find(&self.particles, self.division);
        let effective = self.particles.effective();
        let wanted = self.wanted();
        let scattered = self.renew(beams, effective, wanted, &mut budget);
        Some(Update {
            clusters,
            effective,
            fit: done.fit,
            passes: done.passes,
            wanted,
            limited: budget.limited,
            scattered,
            beams: beams.len(),
        })
    }

    /// After a search of the whole map: draws each cluster anew, and gives it the weight of its evidence.
    fn level_clusters(&mut self, beams: &Beams, budget: &mut Budget) {
        let clusters = self.finder.find(&self.particles, self.division);
        let candidates =
            clusters.iter().take(CANDIDATE_CLUSTERS).filter(|cluster| cluster.share > LEAST_SHARE);
        let count = (self.params.max_particles as usize / 8).clamp(100, 1000);
        let least = [self.params.jitter_m, self.params.jitter_rad];
        let mut sampled = Vec::new();
        for cluster in candidates {
            if budget.affordable(2 * count, beams.len()) < 2 * count {
                return;
            }
            budget.spend(2 * count, beams.len());
            self.epoch += 1;
            let numbers = (self.seed, self.epoch);
            sampled.extend(evidence::sample(&self.weigher, beams, cluster, count, least, numbers));
        }
        let highest = sampled.iter().map(Sampled::highest).fold(f64::NEG_INFINITY, f64::max);
        if !highest.is_finite() {
            return;
        }
        let particles = &mut self.particles;
        particles.clear();
        for Sampled { particles: drawn, log_weights } in &sampled {
            for (index, log_weight) in log_weights.iter().enumerate() {
                particles.push(drawn.pose(index));
                if let Some(weight) = particles.weight.last_mut() {
                    *weight = (log_weight - highest).exp();
                }
            }
        }
        let total: f64 = particles.weight.iter().sum();
        particles.weight.iter_mut().for_each(|weight| *weight /= total);
    }

    /// Draws the next generation when the particles have become too unequal or too many, with scattered ones
    /// among them when the scans have ceased to fit. Returns how many were scattered.
    fn renew(&mut self, beams: &Beams, effective: f64, wanted: usize, budget: &mut Budget) -> usize {
        let (fewest, most) = (self.params.min_particles as usize, self.params.max_particles as usize);
        let count = wanted.clamp(fewest, most);
        let recovery = &self.params.recovery;
        let early = if self.searches > 0 { 0.5 * recovery.most_scattered } else { 0.0 };
        let share = self.averages.scatter_share(recovery).max(early);
        let scattered = (share * count as f64) as usize;
        let present = self.particles.len();
        let too_unequal = effective < self.params.resample_share * present as f64;
        // A little more than needed is no reason.
        let too_many = present > most || count * 4 < present * 3;
        if !(too_unequal || too_many || scattered > 0 || present < fewest) {
            return 0;
        }
        if scattered == 0 {
            self.draw(count);
            return 0;
        }
        // A robot that is surely lost searches as thoroughly as at a start without a pose; one that may be
        // lost, less so.
        let thoroughness = share / recovery.most_scattered.max(f64::MIN_POSITIVE);
        let thorough = (thoroughness * f64::from(self.params.global_particles)) as usize;
        let candidates = budget.affordable(thorough.max(CANDIDATES).max(scattered), beams.len());
        if candidates < scattered {
            self.draw(count);
            return 0;
        }
        self.draw(count - scattered);
        let (mut others, mut spread) = self.scatter(candidates, false);
        self.anneal(&mut others, beams, &mut spread, true, budget);
        self.epoch += 1;
        let particles = &mut self.particles;
        let kept = particles.len();
        comb(&others.weight, scattered, self.seed, self.epoch, |index| particles.push(others.pose(index)));
        // The scattered ones begin with little weight: they must fit much better to take over, not just as
        // well.
        let prior = SCATTERED_PRIOR * share;
        let all = particles.len();
        for (index, weight) in particles.weight.iter_mut().enumerate() {
            *weight = if index < kept { *weight * (1.0 - prior) } else { prior / (all - kept) as f64 };
        }
        scattered
    }

    /// Draws the next generation from the clusters that were found last.
    fn draw(&mut self, count: usize) {
        self.epoch += 1;
        let (ranks, numbers) = (&self.finder.ranks, (self.seed, self.epoch));
        resample_apart(&self.particles, &mut self.spare, ranks, CLUSTERS, count, numbers);
        std::mem::swap(&mut self.particles, &mut self.spare);
        self.shake();
    }

    /// Keeps particles apart that are copies of one.
    fn shake(&mut self) {
        self.epoch += 1;
        let sigma_m = self.params.jitter_m as f32;
        let sigma_rad = self.params.jitter_rad as f32;
        self.particles.jitter(self.seed, self.epoch, sigma_m, sigma_rad);
    }

    /// Particles all over the map, and how far apart they are.
    fn scatter(&mut self, count: usize, is_start: bool) -> (Particles, MotionSigma) {
        self.epoch += 1;
        let stream = Map::scatter_stream(self.seed, self.epoch, is_start);
        let mut particles = Particles::default();
        for index in 0..count {
            particles.push(self.map.scattered(stream, index, count));
        }
        particles.level();
        let places = (count as f64 / DIRECTIONS).max(1.0);
        let apart_m = (self.map.free_area_m2() / places).sqrt();
        let spread =
            MotionSigma { place_m: APART * apart_m, heading_rad: APART * std::f64::consts::TAU / DIRECTIONS };
        (particles, spread)
    }

    /// How many particles the belief needs: as many as its spread over bins asks for, when as many are drawn
    /// as there are now. The bins are those in which clusters were found last.
    fn wanted(&mut self) -> usize {
        let Self { finder, particles, is_hit, .. } = self;
        is_hit.clear();
        is_hit.resize(particles.len(), false);
        let mut hit = 0;
        comb(&particles.weight, particles.len(), self.seed, self.epoch, |index| {
            let bin = &mut is_hit[finder.of_particle[index] as usize];
            hit += usize::from(!std::mem::replace(bin, true));
        });
        kld::enough(hit, self.params.kld_error, self.params.kld_quantile)
    }

    /// Weighs particles by a scan in passes. Each pass uses up as much of the scan's likelihood, as an
    /// exponent, as leaves enough particles effective; what is then left is for the next pass, after these
    /// have been drawn anew and moved a little.
    fn anneal(
        &mut self,
        particles: &mut Particles,
        beams: &Beams,
        spread: &mut MotionSigma,
        is_search: bool,
        budget: &mut Budget,
    ) -> Annealed {
        let passes = self.params.max_passes;
        let mut done = Annealed { fit: 0.0, passes: 0 };
        let mut points = std::mem::take(&mut self.points);
        let (mut remaining, mut coarse) = (1.0, 0);
        // The first passes of a search use little of what a scan tells: a part of the beams tells it as well.
        let step = beams.len() / (self.params.search_beams as usize).max(1);
        let few = (is_search && step > 1).then(|| beams.thinned(step));
        loop {
            let is_coarse = particles.len() > 2 * self.params.max_particles as usize;
            let beams = few.as_ref().filter(|_| is_coarse).unwrap_or(beams);
            self.weigher.weigh(particles, beams, &mut points);
            budget.spend(particles.len(), beams.len());
            done.passes += 1;
            if done.passes == 1 {
                let mean: f64 = points.iter().zip(&particles.weight).map(|(&p, w)| f64::from(p) * w).sum();
                done.fit = Weigher::fit(mean, beams.len());
            }
            let effective_share = self.params.pass_effective_share;
            let best = points.iter().copied().max().unwrap_or(0);
            let ratios = |exponent: f64| self.weigher.ratios(best, beams.len(), exponent);
            let exponent = if passes == 1 {
                remaining
            } else {
                exponent(&particles.weight, &points, ratios, remaining, effective_share)
            };
            sharpen(&mut particles.weight, &points, &ratios(exponent));
            // What a part of the beams has told is told again by all of them: it is little.
            remaining -= if is_coarse { 0.0 } else { exponent };
            coarse += u32::from(is_coarse);
            if remaining < 1e-6 || done.passes - coarse >= passes {
                break;
            }
            let most = (self.params.max_particles as usize).max(particles.len() / 2).min(particles.len());
            let count = budget.affordable(most, beams.len());
            if count < most {
                break;
            }
            self.finder.find(particles, self.division);
            self.epoch += 1;
            let numbers = (self.seed, self.epoch);
            if is_search {
                let ranks = self.finder.bin_ranks();
                resample_apart(particles, &mut self.spare, &ranks, BINS, count, numbers);
            } else {
                resample_apart(particles, &mut self.spare, &self.finder.ranks, CLUSTERS, count, numbers);
            }
            std::mem::swap(particles, &mut self.spare);
            self.epoch += 1;
            particles.jitter(self.seed, self.epoch, spread.place_m as f32, spread.heading_rad as f32);
            spread.place_m = (spread.place_m * SHRINK).max(self.params.jitter_m);
            spread.heading_rad = (spread.heading_rad * SHRINK).max(self.params.jitter_rad);
        }
        self.points = points;
        done
    }
}

#[derive(Debug, Clone, Copy)]
struct Annealed {
    fit: f64,
    passes: u32,
}

/// The largest exponent up to `most` with which at least such a share of the particles stays effective.
fn exponent(
    weights: &[f64],
    points: &[u32],
    ratios: impl Fn(f64) -> Ratios,
    most: f64,
    effective_share: f64,
) -> f64 {
    // All, or an even selection: an estimate is enough.
    let stride = weights.len().div_ceil(2048).max(1);
    let is_enough = |exponent: f64| {
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0);
        let ratios = ratios(exponent);
        for (weight, points) in weights.iter().zip(points).step_by(stride) {
            let weight = weight * ratios.of(*points);
            sum += weight;
            squares += weight * weight;
            count += 1;
        }
        squares > 0.0 && sum * sum / squares >= effective_share * f64::from(count)
    };
    if is_enough(most) {
        return most;
    }
    let (mut low, mut high) = (0.0, most);
    for _ in 0..10 {
        let middle = 0.5 * (low + high);
        if is_enough(middle) { low = middle } else { high = middle }
    }
    // Never nothing, or the passes would lead nowhere.
    low.max(1e-3 * most)
}

/// Multiplies weights by likelihoods, and makes them sum to 1.
fn sharpen(weights: &mut [f64], points: &[u32], ratios: &Ratios) {
    let mut total = 0.0;
    for (weight, points) in weights.iter_mut().zip(points) {
        *weight *= ratios.of(*points);
        total += *weight;
    }
    if total > 0.0 && total.is_finite() {
        let scale = 1.0 / total;
        weights.iter_mut().for_each(|weight| *weight *= scale);
    } else {
        let share = 1.0 / weights.len().max(1) as f64;
        weights.fill(share);
    }
}
