//! Centroidal clusters of vertices: most of the relaxation at little cost.
//!
//! Lloyd's algorithm on the surface's vertices (compare ACVD: Valette, Chassery & Prost, IEEE
//! TVCG 2008): a site is the weighted mean of its cluster, a vertex changes to a neighbouring
//! cluster whose site is nearer in space. Since labels travel only from vertex to neighbour,
//! sites of an opposite wall are never considered. Sites are moved beyond their means at first
//! (over-relaxation), which lets misplaced rows of cells slide into order.
//!
//! In space, not along the surface: across sharp bends the two differ, which
//! [`super::relaxation`] makes good. Clusters may fall apart here; what follows starts from
//! the sites alone.

use rayon::prelude::*;

use super::domain::Domain;
use super::sizing::Sizing;
use super::trace::inset;
use super::SurfacePoint;
use crate::geometry::{Vec3, triangle};
use crate::progress::Cancelled;

/// How far beyond the mean a site is moved in the first rounds.
const OVER_RELAXATION: f64 = 1.7;

/// Share of the rounds that over-relax.
const OVER_RELAXED: f64 = 0.6;

/// Vertices in one parallel task. Below two of these the rounds run on one thread.
const CHUNK: usize = 16_384;

/// Clusters of the domain's vertices.
pub(crate) struct Clusters<'a> {
    domain: &'a Domain,
    weights: Vec<f64>,
    /// Neighbours of vertex v are `neighbours[offsets[v]..offsets[v + 1]]`.
    offsets: Vec<u32>,
    neighbours: Vec<u32>,
    label: Vec<u32>,
    sites: Vec<Vec3>,
}

impl<'a> Clusters<'a> {
    /// Clusters given by a label for each vertex.
    pub fn new(domain: &'a Domain, sizing: &Sizing, label: Vec<u32>, sites: Vec<Vec3>) -> Self {
        let mut offsets = vec![0u32];
        let mut neighbours = Vec::with_capacity(domain.lengths.len());
        for &h in &domain.outgoing {
            neighbours.extend(domain.adjacency.around(h).map(|h| domain.ends(h)[1]));
            offsets.push(neighbours.len() as u32);
        }
        let weights = (0..domain.vertices.len())
            .map(|v| sizing.weight(domain, v))
            .collect();
        Self {
            domain,
            weights,
            offsets,
            neighbours,
            label,
            sites,
        }
    }

    /// Runs at most `rounds` rounds, fewer once the sites rest; returns how many.
    pub fn relax(
        &mut self,
        rounds: usize,
        tick: impl Fn(f64) -> Result<(), Cancelled>,
    ) -> Result<usize, Cancelled> {
        let spacing = (self.domain.area / self.sites.len() as f64).sqrt();
        let over_relaxed = (rounds as f64 * OVER_RELAXED) as usize;
        for round in 0..rounds {
            tick(round as f64 / rounds as f64)?;
            let factor = if round < over_relaxed {
                OVER_RELAXATION
            } else {
                1.0
            };
            let moved = self.recentre(factor);
            let changed = self.relabel();
            if round > over_relaxed && (changed == 0 || moved < 1e-4 * spacing) {
                return Ok(round + 1);
            }
        }
        Ok(rounds)
    }

    /// Moves the sites by `factor` times the way to their means; the rms way.
    fn recentre(&mut self, factor: f64) -> f64 {
        let mut sums = vec![(Vec3::zeros(), 0.0); self.sites.len()];
        for ((&label, &weight), x) in self
            .label
            .iter()
            .zip(&self.weights)
            .zip(&self.domain.vertices)
        {
            let sum = &mut sums[label as usize];
            sum.0 += x * weight;
            sum.1 += weight;
        }
        let mut squares = 0.0;
        for (site, (sum, weight)) in self.sites.iter_mut().zip(sums) {
            if weight > 0.0 {
                let step = sum / weight - *site;
                squares += step.norm_squared();
                *site += step * factor;
            }
        }
        (squares / self.sites.len() as f64).sqrt()
    }

    /// Lets every vertex join the nearest of the clusters around it; how many changed.
    fn relabel(&mut self) -> usize {
        let nearest = |v: usize| {
            let own = self.label[v];
            let x = &self.domain.vertices[v];
            let mut best = (own, f64::INFINITY);
            let mut last = own;
            for &n in &self.neighbours[self.offsets[v] as usize..self.offsets[v + 1] as usize] {
                let label = self.label[n as usize];
                if label == own || label == last {
                    continue;
                }
                last = label;
                if best.1 == f64::INFINITY {
                    best.1 = (self.sites[own as usize] - x).norm_squared();
                }
                let distance = (self.sites[label as usize] - x).norm_squared();
                if distance < best.1 {
                    best = (label, distance);
                }
            }
            best.0
        };
        let count = self.label.len();
        let label: Vec<u32> = if count < 2 * CHUNK {
            (0..count).map(nearest).collect()
        } else {
            (0..count)
                .into_par_iter()
                .with_min_len(CHUNK)
                .map(nearest)
                .collect()
        };
        let changed = label.iter().zip(&self.label).filter(|(a, b)| a != b).count();
        self.label = label;
        changed
    }

    /// Puts every site down on the surface: on the triangles round the nearest vertex of its
    /// own cluster. A site whose cluster is lost stays where `before` had it.
    pub fn settle(&self, before: &[SurfacePoint]) -> Vec<SurfacePoint> {
        let mut nearest = vec![(f64::INFINITY, 0u32); self.sites.len()];
        for (v, &label) in self.label.iter().enumerate() {
            let best = &mut nearest[label as usize];
            let distance = (self.sites[label as usize] - self.domain.vertices[v]).norm_squared();
            if distance < best.0 {
                *best = (distance, v as u32);
            }
        }
        nearest
            .iter()
            .zip(&self.sites)
            .zip(before)
            .map(|(((distance, vertex), site), before)| {
                if distance.is_finite() {
                    closest_around(self.domain, *vertex, site)
                } else {
                    *before
                }
            })
            .collect()
    }
}

/// The point closest to `x` on the triangles round `vertex`.
fn closest_around(domain: &Domain, vertex: u32, x: &Vec3) -> SurfacePoint {
    let mut best = (f64::INFINITY, domain.outgoing[vertex as usize] / 3, [0.0; 3]);
    for h in domain.adjacency.around(domain.outgoing[vertex as usize]) {
        let t = h / 3;
        let [a, b, c] = domain.triangles[t as usize].map(|v| domain.vertices[v as usize]);
        let [u, v, w] = triangle::closest_barycentric(x, &a, &b, &c);
        let distance = (a * u + b * v + c * w - x).norm_squared();
        if distance < best.0 {
            best = (distance, t, [u, v, w]);
        }
    }
    SurfacePoint {
        triangle: best.1,
        barycentric: inset(best.2),
    }
}
