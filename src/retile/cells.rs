//! Centroidal cells: the surface's samples shared out among N sites.
//!
//! Lloyd's relaxation (Du, Faber and Gunzburger, SIAM Review 1999) on samples: every sample
//! belongs to one site; a round lets each sample go over to a site that one of its
//! *neighbours* belongs to, where that one is nearer, and then moves every site towards the
//! [centroid](super::clipping) of its cell. Since a sample only ever follows a neighbour, cells
//! spread along the surface and never jump through a thin wall, although distances are
//! straight: within one cell the two differ by a few percent, and the fit that follows
//! forgives far more. A round costs one look at every sample and no geodesic.
//!
//! Sites have momentum (Polyak's heavy ball). Lloyd's plain steps creep; momentum carries
//! rows of cells past the little hollows in which these get stuck: on a noisy phantom 78 %
//! instead of 74 % of 150 cells end with six neighbours (mean of eight seeds). [`Cells::tidy`] makes every cell connected. Cells are never empty.

use super::clipping::Patches;
use super::samples::Samples;
use crate::geometry::Vec3;
use crate::progress::{Cancelled, Monitor};
use rayon::prelude::*;
use std::collections::VecDeque;

/// Share of the way to the centroid that a round adds to a site's velocity, and what it keeps
/// of the velocity before. Stable for shares below 2 (1 + momentum); momentum 0.8 ends less
/// regular after 80 rounds.
const STEP: f64 = 1.5;
const MOMENTUM: f64 = 0.9;
/// Last rounds, without momentum: plain Lloyd steps calm the sites.
const COOLING_ROUNDS: usize = 10;
/// Root mean square way to the centroid, in spacings, below which relaxation has settled.
const SETTLED: f64 = 2e-4;
/// Samples that one task looks at: few enough that the last of them keeps nobody waiting.
const CHUNK: usize = 512;

/// Which site each sample belongs to, and where the sites are.
#[derive(Debug, Clone)]
pub(super) struct Cells {
    /// Site of every sample.
    pub labels: Vec<u32>,
    /// Position of every site: not on the surface, but at the heart of its cell.
    pub sites: Vec<Vec3>,
}

impl Cells {
    /// Cells grown from one sample each, ring by ring.
    pub fn grow(samples: &Samples, seeds: &[u32]) -> Self {
        let mut labels = vec![u32::MAX; samples.len()];
        let mut front: VecDeque<u32> = seeds.iter().copied().collect();
        for (site, &v) in (0u32..).zip(seeds) {
            labels[v as usize] = site;
        }
        flood(samples, &mut labels, &mut front);
        let sites = seeds.iter().map(|&v| samples.working[v as usize]).collect();
        Self { labels, sites }
    }

    /// Relaxes for at most `rounds` rounds; the rounds run.
    ///
    /// # Errors
    /// [`Cancelled`] where the monitor says so.
    pub fn relax(
        &mut self,
        samples: &Samples,
        weights: &[f64],
        rounds: usize,
        monitor: &Monitor,
    ) -> Result<usize, Cancelled> {
        let area: f64 = samples.area.iter().sum();
        let settled = SETTLED * (area / self.sites.len() as f64).sqrt();
        let patches = Patches::new(samples, weights);
        let mut following = self.labels.clone();
        let mut velocities = vec![Vec3::zeros(); self.sites.len()];
        for round in 0..rounds {
            monitor.check()?;
            self.reassign(samples, &mut following);
            let mut centroids = patches.centroids(&self.labels, &self.sites);
            if centroids.contains(&None) {
                self.fill_empty_cells(samples, weights);
                centroids = patches.centroids(&self.labels, &self.sites);
            }
            let (momentum, step) = if round + COOLING_ROUNDS < rounds {
                (MOMENTUM, STEP)
            } else {
                (0.0, 1.0)
            };
            let mut squares = 0.0;
            for (site, (centroid, velocity)) in
                (self.sites.iter_mut()).zip(centroids.iter().zip(&mut velocities))
            {
                let way = centroid.map_or(Vec3::zeros(), |centroid| centroid - *site);
                squares += way.norm_squared();
                *velocity = *velocity * momentum + way * step;
                *site += *velocity;
            }
            if (squares / self.sites.len() as f64).sqrt() < settled {
                return Ok(round + 1);
            }
        }
        Ok(rounds)
    }

    /// Lets every sample follow a neighbour to a nearer site. All look at the same state, so
    /// the outcome does not depend on their order.
    fn reassign(&mut self, samples: &Samples, following: &mut Vec<u32>) {
        let (labels, sites) = (&self.labels, &self.sites);
        following
            .par_chunks_mut(CHUNK)
            .enumerate()
            .for_each(|(chunk, out)| {
                for (offset, label) in out.iter_mut().enumerate() {
                    *label = nearest_site(samples, labels, sites, chunk * CHUNK + offset);
                }
            });
        std::mem::swap(&mut self.labels, following);
    }

    /// Gives a site that lost its last sample the worst placed sample of all.
    fn fill_empty_cells(&mut self, samples: &Samples, weights: &[f64]) {
        let mut count = vec![0u32; self.sites.len()];
        for &site in &self.labels {
            count[site as usize] += 1;
        }
        for empty in 0..count.len() {
            if count[empty] > 0 {
                continue;
            }
            let strain = |v: usize| {
                let site = self.labels[v] as usize;
                if count[site] < 2 {
                    return -1.0;
                }
                weights[v] * (samples.working[v] - self.sites[site]).norm_squared()
            };
            let worst = (0..self.labels.len())
                .max_by(|&a, &b| strain(a).total_cmp(&strain(b)).then(b.cmp(&a)))
                .expect("there are samples");
            count[self.labels[worst] as usize] -= 1;
            count[empty] = 1;
            self.labels[worst] = empty as u32;
            self.sites[empty] = samples.working[worst];
        }
    }

    /// Weighted mean of the `positions` of every cell's samples.
    pub fn centroids(&self, positions: &[Vec3], weights: &[f64]) -> Vec<Vec3> {
        let mut sums = vec![(Vec3::zeros(), 0.0); self.sites.len()];
        for ((&site, position), &weight) in self.labels.iter().zip(positions).zip(weights) {
            let sum = &mut sums[site as usize];
            sum.0 += position * weight;
            sum.1 += weight;
        }
        sums.into_iter()
            .map(|(moment, weight)| moment / weight)
            .collect()
    }

    /// Leaves each cell its largest connected part; the rest goes to the cells around it.
    pub fn tidy(&mut self, samples: &Samples) {
        let parts = connected_parts(samples, &self.labels);
        let mut size = vec![0u32; parts.iter().map(|p| *p as usize + 1).max().unwrap_or(0)];
        for &part in &parts {
            size[part as usize] += 1;
        }
        let mut largest = vec![u32::MAX; self.sites.len()];
        for (&part, &site) in parts.iter().zip(&self.labels) {
            let best = &mut largest[site as usize];
            if *best == u32::MAX || size[part as usize] > size[*best as usize] {
                *best = part;
            }
        }
        let mut front = VecDeque::new();
        for v in 0..self.labels.len() {
            if largest[self.labels[v] as usize] != parts[v] {
                self.labels[v] = u32::MAX;
            }
        }
        for v in 0..self.labels.len() {
            let beside_lost = |n: &u32| self.labels[*n as usize] == u32::MAX;
            if self.labels[v] != u32::MAX && samples.around(v).iter().any(beside_lost) {
                front.push_back(v as u32);
            }
        }
        flood(samples, &mut self.labels, &mut front);
    }

    /// Takes `site` from where it is and plants it at the sample of `crowded` farthest from
    /// that cell's heart.
    pub fn transplant(&mut self, samples: &Samples, site: u32, crowded: u32) {
        let heart = self.sites[crowded as usize];
        let far = |v: usize| (samples.working[v] - heart).norm_squared();
        let target = (0..self.labels.len())
            .filter(|&v| self.labels[v] == crowded)
            .max_by(|&a, &b| far(a).total_cmp(&far(b)).then(b.cmp(&a)));
        let Some(target) = target else { return };
        let mut front = VecDeque::new();
        for label in &mut self.labels {
            if *label == site {
                *label = u32::MAX;
            }
        }
        self.labels[target] = site;
        self.sites[site as usize] = samples.working[target];
        for v in 0..self.labels.len() {
            if ![u32::MAX, site].contains(&self.labels[v]) {
                front.push_back(v as u32);
            }
        }
        flood(samples, &mut self.labels, &mut front);
    }
}

/// The nearest of the sites that sample `v` and its neighbours belong to; the lower number
/// where two are as near.
fn nearest_site(samples: &Samples, labels: &[u32], sites: &[Vec3], v: usize) -> u32 {
    let own = labels[v];
    let position = samples.working[v];
    let mut best = own;
    let mut least = f64::NAN;
    for &n in samples.around(v) {
        let site = labels[n as usize];
        if site == own || site == best {
            continue;
        }
        if least.is_nan() {
            least = (position - sites[own as usize]).norm_squared();
        }
        let distance = (position - sites[site as usize]).norm_squared();
        if distance < least || (distance == least && site < best) {
            (best, least) = (site, distance);
        }
    }
    best
}

/// Spreads labels from `front` over the samples that have none.
fn flood(samples: &Samples, labels: &mut [u32], front: &mut VecDeque<u32>) {
    while let Some(v) = front.pop_front() {
        for &n in samples.around(v as usize) {
            if labels[n as usize] == u32::MAX {
                labels[n as usize] = labels[v as usize];
                front.push_back(n);
            }
        }
    }
}

/// Numbers the connected sets of equally labelled samples.
fn connected_parts(samples: &Samples, labels: &[u32]) -> Vec<u32> {
    let mut parts = vec![u32::MAX; labels.len()];
    let mut count = 0;
    let mut stack = Vec::new();
    for start in 0..labels.len() {
        if parts[start] != u32::MAX {
            continue;
        }
        parts[start] = count;
        stack.push(start as u32);
        while let Some(v) = stack.pop() {
            for &n in samples.around(v as usize) {
                let n = n as usize;
                if parts[n] == u32::MAX && labels[n] == labels[v as usize] {
                    parts[n] = count;
                    stack.push(n as u32);
                }
            }
        }
        count += 1;
    }
    parts
}
