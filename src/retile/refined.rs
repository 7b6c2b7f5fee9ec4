//! The refined route: centroidal cells and their dual.
//!
//! 1. [`samples`](super::samples): the working surface, fine enough for N cells;
//! 2. N samples at random, as dense as [`sizing`] wants them;
//! 3. [`cells`](super::cells): relaxed until each site is the centroid of its cell;
//! 4. [`dual`]: one triangle where three cells meet;
//! 5. each vertex goes to the point of its own cell's part of S closest to the cell's centroid.
//!
//! Where a cell is too large for the shape of the surface (it runs round a handle, or the
//! two sides of a thin wall would touch), the least loaded site elsewhere is transplanted
//! there and the cells settle again; N never changes. Where that does not end well (necks no
//! wider than a few samples), the points are spread and joined as the route of [`paper`]
//! does, on the surface itself, if that is not too large.

use super::cells::Cells;
use super::samples::Samples;
use super::{
    RetileError, RetileFacts, RetileParameters, Tiled, dual, orientation, paper, quotas, sizing,
    too_few,
};
use crate::geometry::random::{Purpose, stream};
use crate::geometry::{Vec3, triangle};
use crate::mesh::intersections::self_intersections;
use crate::mesh::{TriMesh, topology};
use crate::progress::{Monitor, Stage};
use crate::surface::Surface;
use rand::RngExt;
use rayon::prelude::*;

/// Samples that a cell has at least: enough to tell its neighbours. Twice or
/// half as many changed the final radius ratios by less than 0.001 on phantoms.
const SAMPLES_PER_CELL: usize = 20;
/// Rounds that let the cells settle after a transplantation.
const SETTLING_ROUNDS: usize = 20;
/// Transplantations before giving up on a start.
const REPAIRS: usize = 24;
/// Sites that one repair moves at most.
const TRANSPLANTS: usize = 4;
/// Factor by which a repair raises the density round a crowded cell; spacing goes with its
/// fourth root.
const THICKENING: f64 = 3.0;
/// Random starts before giving up on N.
const STARTS: u64 = 3;
/// Seeds of the paper's route before giving up on N.
const PAPER_SEEDS: u64 = 2;
/// Triangles of a surface on which that route is tried. Each point's repulsion looks at all
/// triangles about it, and each old vertex is removed: a plate of 260 000 took minutes.
const PAPER_TRIANGLES: usize = 40_000;
/// Parts in which all triangles are looked through; each keeps a place for every cell.
const MOST_TASKS: usize = 8;
/// Repairs of each number that is tried to tell which N would do.
const HURRIED_REPAIRS: usize = 6;

/// Re-tiles `surface` by centroidal cells.
pub(super) fn retile(
    surface: &Surface,
    parameters: &RetileParameters,
    monitor: &Monitor,
) -> Result<Tiled, RetileError> {
    if parameters.points < quotas::least_points(&surface.mesh) {
        return Err(refusal(surface, parameters, monitor));
    }
    let job = Job::new(surface, parameters);
    let mut facts = RetileFacts::default();
    for start in 0..STARTS {
        if let Some((mesh, sizing)) = job.attempt(start, REPAIRS, &mut facts, monitor)? {
            return Ok(Tiled {
                mesh,
                sizing,
                facts,
            });
        }
    }
    if let Some(mut tiled) = by_repulsion(surface, parameters, PAPER_SEEDS, monitor)? {
        tiled.facts.relaxation_rounds = facts.relaxation_rounds;
        tiled.facts.attempts += facts.attempts;
        let warning = "the surface is too narrow somewhere for centroidal cells: the points \
                       were spread by repulsion and joined by mutual tessellation instead";
        tiled.facts.warnings.push(warning.to_owned());
        return Ok(tiled);
    }
    Err(refusal(surface, parameters, monitor))
}

/// The error to give up with, which names a number of points that does.
fn refusal(surface: &Surface, parameters: &RetileParameters, monitor: &Monitor) -> RetileError {
    too_few(surface, parameters, |larger| {
        // The quicker of the two first.
        if by_repulsion(surface, larger, 1, monitor)?.is_some() {
            return Ok(true);
        }
        let job = Job::new(surface, larger);
        let mut ignored = RetileFacts::default();
        let made = job.attempt(0, HURRIED_REPAIRS, &mut ignored, monitor)?;
        Ok(made.is_some())
    })
}

/// The paper's way with so many seeds, where the surface is not too large for it.
fn by_repulsion(
    surface: &Surface,
    parameters: &RetileParameters,
    seeds: u64,
    monitor: &Monitor,
) -> Result<Option<Tiled>, RetileError> {
    if surface.mesh.triangles.len() > PAPER_TRIANGLES {
        return Ok(None);
    }
    paper::attempt(surface, parameters, seeds, monitor)
}

/// What every attempt shares.
struct Job<'a> {
    surface: &'a Surface,
    parameters: &'a RetileParameters,
    points: usize,
    samples: Samples,
    /// Relative spacing wanted at every sample.
    spacing: Vec<f64>,
    /// Component of the surface of every sample.
    components: Vec<u32>,
    /// The fewest points that each component takes.
    least: Vec<usize>,
    /// Signed volume of each component of S, mm³.
    volumes: Vec<f64>,
    /// Area times density: h^-4 makes centroidal cells as large as h² (Du et al. 1999).
    weights: Vec<f64>,
}

impl<'a> Job<'a> {
    fn new(surface: &'a Surface, parameters: &'a RetileParameters) -> Self {
        let points = parameters.points;
        let samples = Samples::new(
            &surface.mesh.vertices,
            &surface.working,
            &surface.mesh.triangles,
            points * SAMPLES_PER_CELL,
        );
        let spacing = sizing::spacing(&samples, parameters, points);
        let weights = (samples.area.iter().zip(&spacing))
            .map(|(area, h)| area * h.powi(-4))
            .collect();
        let components = topology::components(samples.len(), &samples.triangles);
        Self {
            surface,
            parameters,
            points,
            volumes: topology::component_volumes(
                &surface.mesh.vertices,
                &surface.mesh.triangles,
                &components,
            ),
            components,
            least: quotas::least_of_components(&surface.mesh),
            samples,
            spacing,
            weights,
        }
    }

    /// One random start with its repairs: mesh and sizing, or `None` where the topology did
    /// not come out.
    fn attempt(
        &self,
        start: u64,
        repairs: usize,
        facts: &mut RetileFacts,
        monitor: &Monitor,
    ) -> Result<Option<(TriMesh, Vec<f64>)>, RetileError> {
        monitor.check()?;
        let seeds = self.seeds(start);
        monitor.check()?;
        let mut cells = Cells::grow(&self.samples, &seeds);
        let rounds = self.parameters.relaxation_iterations;
        monitor.report(Stage::Retile, 0.1)?;
        facts.relaxation_rounds += cells.relax(&self.samples, &self.weights, rounds, monitor)?;
        let mut weights = self.weights.clone();
        let mut moved = Vec::new();
        for _ in 0..=repairs {
            facts.attempts += 1;
            monitor.report(Stage::Retile, 0.8)?;
            cells.tidy(&self.samples);
            let crowded = match dual::triangulate(&self.samples, &cells.labels, self.points) {
                Err(offence) => offence.sites,
                Ok(triangles) => {
                    let mut mesh = TriMesh {
                        vertices: self.vertices(&cells),
                        triangles,
                    };
                    let crossing = self_intersections(&mesh);
                    let component = self.components_of_sites(&cells);
                    if !crossing.is_empty() {
                        sites_of(&mesh, &crossing)
                    } else if let Err(inside_out) =
                        orientation::face_alike(&mut mesh, &component, &self.volumes)
                    {
                        inside_out
                    } else {
                        return Ok(Some((mesh, self.sizing(&cells))));
                    }
                }
            };
            if crowded.is_empty() {
                return Ok(None);
            }
            self.thicken(&cells, &crowded, &mut weights);
            for &site in crowded.iter().take(TRANSPLANTS) {
                let Some(light) = self.least_loaded(&cells, &weights, &crowded, site, &moved)
                else {
                    return Ok(None);
                };
                moved.push(light);
                cells.transplant(&self.samples, light, site);
            }
            facts.relaxation_rounds +=
                cells.relax(&self.samples, &weights, SETTLING_ROUNDS, monitor)?;
            moved.drain(..moved.len().saturating_sub(self.points / 4));
        }
        Ok(None)
    }

    /// Makes the density higher in the crowded cells and those around them, so that the sites
    /// which move there stay there.
    fn thicken(&self, cells: &Cells, crowded: &[u32], weights: &mut [f64]) {
        let mut is_crowded = vec![false; self.points];
        for &site in crowded {
            is_crowded[site as usize] = true;
        }
        let mut near = is_crowded.clone();
        for v in 0..self.samples.len() {
            let mut around = self.samples.around(v).iter();
            if around.any(|&n| is_crowded[cells.labels[n as usize] as usize]) {
                near[cells.labels[v] as usize] = true;
            }
        }
        for (weight, &site) in weights.iter_mut().zip(&cells.labels) {
            if near[site as usize] {
                *weight *= THICKENING;
            }
        }
    }

    /// Distinct random samples, each component getting its share but at least as many as its
    /// topology needs.
    fn seeds(&self, start: u64) -> Vec<u32> {
        let mut random = stream(
            self.parameters.seed ^ start.rotate_left(32),
            Purpose::Placement,
        );
        let mut load = Vec::new();
        for (v, &c) in self.components.iter().enumerate() {
            let c = c as usize;
            load.resize(load.len().max(c + 1), 0.0);
            load[c] += self.samples.area[v] / self.spacing[v].powi(2);
        }
        let quotas = quotas::share(&self.surface.mesh, &load, self.points);
        let mut seeds = Vec::with_capacity(self.points);
        for (component, quota) in (0u32..).zip(quotas) {
            let mut members: Vec<u32> = (0..self.samples.len() as u32)
                .filter(|&v| self.components[v as usize] == component)
                .collect();
            // Weighted sampling without replacement (Efraimidis and Spirakis 2006).
            let mut keyed: Vec<(f64, u32)> = members
                .drain(..)
                .map(|v| {
                    let (area, h) = (self.samples.area[v as usize], self.spacing[v as usize]);
                    let uniform: f64 = 1.0 - random.random::<f64>();
                    (uniform.ln() / (area / (h * h)).max(f64::MIN_POSITIVE), v)
                })
                .collect();
            let order = |a: &(f64, u32), b: &(f64, u32)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
            if quota < keyed.len() {
                keyed.select_nth_unstable_by(quota, order);
                keyed.truncate(quota);
            }
            keyed.sort_unstable_by(order);
            seeds.extend(keyed.iter().map(|(_, v)| *v));
        }
        seeds
    }

    /// The site with the lightest cell that may go to the cell of `to`: not crowded
    /// itself, not moved lately, and none that its component cannot do without.
    fn least_loaded(
        &self,
        cells: &Cells,
        weights: &[f64],
        crowded: &[u32],
        to: u32,
        moved: &[u32],
    ) -> Option<u32> {
        let mut load = vec![0.0; self.points];
        for (&site, weight) in cells.labels.iter().zip(weights) {
            load[site as usize] += weight;
        }
        let component = self.components_of_sites(cells);
        let mut sites = vec![0; self.least.len()];
        for &c in &component {
            sites[c as usize] += 1;
        }
        let spared = |site: u32| {
            let c = component[site as usize] as usize;
            c == component[to as usize] as usize || sites[c] > self.least[c]
        };
        (0..self.points as u32)
            .filter(|site| !crowded.contains(site) && !moved.contains(site) && spared(*site))
            .min_by(|a, b| load[*a as usize].total_cmp(&load[*b as usize]))
    }

    /// The component of the surface that each site's cell lies on.
    fn components_of_sites(&self, cells: &Cells) -> Vec<u32> {
        let mut component = vec![0; self.points];
        for (&site, &c) in cells.labels.iter().zip(&self.components) {
            component[site as usize] = c;
        }
        component
    }

    /// For every site the point of its cell's part of S closest to the cell's centroid on S.
    fn vertices(&self, cells: &Cells) -> Vec<Vec3> {
        let positions = &self.samples.surface;
        let centroids = cells.centroids(positions, &self.weights);
        let nearest = |triangles: &[[u32; 3]]| {
            let mut best = vec![(f64::INFINITY, Vec3::zeros()); self.points];
            for t in triangles {
                let [a, b, c] = t.map(|v| positions[v as usize]);
                let labels = t.map(|v| cells.labels[v as usize]);
                for k in 0..3 {
                    if labels[..k].contains(&labels[k]) {
                        continue;
                    }
                    let centroid = &centroids[labels[k] as usize];
                    let [u, v, w] = triangle::closest_barycentric(centroid, &a, &b, &c);
                    let point = a * u + b * v + c * w;
                    let distance = (point - centroid).norm_squared();
                    let slot = &mut best[labels[k] as usize];
                    if distance < slot.0 {
                        *slot = (distance, point);
                    }
                }
            }
            best
        };
        let triangles = &self.samples.triangles;
        let chunk = triangles.len().div_ceil(MOST_TASKS).max(1);
        let parts: Vec<_> = triangles.par_chunks(chunk).map(nearest).collect();
        // Of equals the first, as if there were one part.
        (0..self.points)
            .map(|site| {
                let found = parts.iter().map(|part| part[site]);
                let first = (f64::INFINITY, Vec3::zeros());
                found
                    .fold(
                        first,
                        |best, next| if next.0 < best.0 { next } else { best },
                    )
                    .1
            })
            .collect()
    }

    /// Mean wanted spacing of every cell.
    fn sizing(&self, cells: &Cells) -> Vec<f64> {
        let mut sums = vec![(0.0, 0u32); self.points];
        for (&site, h) in cells.labels.iter().zip(&self.spacing) {
            sums[site as usize].0 += h;
            sums[site as usize].1 += 1;
        }
        sums.into_iter()
            .map(|(sum, count)| sum / f64::from(count.max(1)))
            .collect()
    }
}

/// The sites whose triangles cross, each once, in order of their number.
fn sites_of(mesh: &TriMesh, crossing: &[[u32; 2]]) -> Vec<u32> {
    let corners = crossing
        .iter()
        .flatten()
        .map(|&t| mesh.triangles[t as usize]);
    let mut sites: Vec<u32> = corners.flatten().collect();
    sites.sort_unstable();
    sites.dedup();
    sites
}
