//! The refined method: centroidal cells and their dual mesh.
//!
//! In: the surface and N. Out: N points on it, joined to triangles.
//!
//! 1. [`surface_samples`](super::surface_samples): the vertices of the surface, as many as N
//!    cells need;
//! 2. N of them at random, with the density that [`sizing`] asks for;
//! 3. [`cells`](super::cells): relaxed until each site is at the centroid of its cell; where N is large, a quarter
//!    of the cells first, which are then [split];
//! 4. [`dual`]: one triangle where three cells meet;
//! 5. each vertex is placed at the point of its cell's part of S closest to the cell's centroid.
//!
//! If a cell is too large for the shape of the surface (it extends around a handle, or the two
//! sides of a thin wall would intersect), the site with the least load elsewhere is moved there
//! and the cells are relaxed again; N never changes. If that fails, as at necks only a few
//! samples wide, the points are distributed and joined by the method of [`paper`], on the
//! surface itself, unless it has too many triangles for that.

use super::cells::Cells;
use super::surface_samples::WeightedSamples;
use super::{
    RetileError, RetileFacts, RetileParameters, Tiled, dual, orientation, paper, quotas, sizing,
    split, too_few,
};
use crate::base::geometry::random::{Purpose, stream};
use crate::base::geometry::{Vec3, triangle};
use crate::base::progress::{Cancelled, Monitor, Stage};
use crate::mesh::intersections::self_intersections;
use crate::mesh::{FaceId, TriMesh, topology};
use crate::surface::Surface;
use rand::RngExt;
use rayon::prelude::*;

/// Smallest mean number of samples per cell. It suffices to determine the neighbours of a cell:
/// half or twice as many changed the final radius ratios by less than 0.001 on phantoms.
const SAMPLES_PER_CELL: usize = 20;

/// Number of points from which on relaxation begins with a quarter of them; at 150 and 300
/// points triangles became no more regular, and the greatest distance grew.
const COARSE_TO_FINE_FROM: usize = 600;

/// Share of the rounds of relaxation on seeds from relaxed cells: they are regular at the start.
const ROUNDS_SHARE_AFTER_SPLIT: f64 = 0.3;
/// The same of many points, from [`MANY_POINTS`] on: further rounds make their triangles no more regular.
const ROUNDS_SHARE_OF_MANY: f64 = 0.14;
/// Number of points from which on they are many.
const MANY_POINTS: usize = 2000;

/// Rounds of relaxation after a repair.
const SETTLING_ROUNDS: usize = 20;

/// Largest number of repairs after one random start.
const MAX_REPAIRS: usize = 24;

/// Largest number of sites that one repair moves.
const MAX_TRANSPLANTS: usize = 4;

/// Factor by which a repair raises the density around a crowded cell. The spacing changes with
/// its fourth root.
const DENSITY_FACTOR: f64 = 3.0;

/// Number of random starts.
const RANDOM_STARTS: u64 = 3;

/// Number of seeds with which the paper's method is tried afterwards.
const PAPER_SEEDS: u64 = 2;

/// Largest number of triangles for the paper's method, whose time grows with the triangles around
/// each point and with the old vertices: on a plate of 260 000 triangles it took minutes.
const PAPER_TRIANGLES: usize = 40_000;

/// Number of parallel tasks of the closest-point search; each has a result for every cell.
const MAX_TASKS: usize = 8;

/// Largest number of repairs while searching for a sufficient N.
const HURRIED_REPAIRS: usize = 6;

/// Re-tiles `surface` by centroidal cells.
pub(super) fn retile(
    surface: &Surface,
    parameters: &RetileParameters,
    monitor: &Monitor,
) -> Result<Tiled, RetileError> {
    if parameters.points < quotas::least_points(surface) {
        return Err(refusal(surface, parameters, monitor));
    }
    let run = RefinedRun::new(surface, parameters, monitor)?;
    let mut facts = RetileFacts::default();
    for start in 0..RANDOM_STARTS {
        if let Some((mesh, sizing)) = run.attempt(start, MAX_REPAIRS, &mut facts, monitor)? {
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

/// The error if N points are too few; it names a number that suffices.
fn refusal(surface: &Surface, parameters: &RetileParameters, monitor: &Monitor) -> RetileError {
    too_few(surface, parameters, |larger| {
        // The faster of the two methods first.
        if by_repulsion(surface, larger, 1, monitor)?.is_some() {
            return Ok(true);
        }
        let run = RefinedRun::new(surface, larger, monitor)?;
        let mut ignored = RetileFacts::default();
        let made = run.attempt(0, HURRIED_REPAIRS, &mut ignored, monitor)?;
        Ok(made.is_some())
    })
}

/// The paper's method with `seeds` seeds; `None` if it fails or the surface is too large for it.
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

/// Input that all random starts share.
struct RefinedRun<'a> {
    parameters: &'a RetileParameters,
    points: usize,
    samples: WeightedSamples,
    /// Wanted relative spacing h at every sample.
    spacing: Vec<f64>,
    /// Component of the surface to which every sample belongs.
    components: Vec<u32>,
    /// Smallest number of points for each component.
    least: Vec<usize>,
    /// Signed volume of each component of S, mm³.
    volumes: Vec<f64>,
    /// Area times density of every sample. With the density h^-4 the area of a centroidal cell is
    /// proportional to h² (Du et al. 1999).
    weights: Vec<f64>,
}

impl<'a> RefinedRun<'a> {
    fn new(
        surface: &Surface,
        parameters: &'a RetileParameters,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let points = parameters.points;
        let samples = WeightedSamples::new(
            &surface.mesh.vertices,
            &surface.working,
            &surface.mesh.triangles,
            points * SAMPLES_PER_CELL,
        );
        monitor.check()?;
        let spacing = sizing::spacing(&samples, parameters, points, monitor)?;
        monitor.check()?;
        let weights = (samples.area.iter().zip(&spacing))
            .map(|(area, h)| area * h.powi(-4))
            .collect();
        let least = quotas::least_of(&surface.mesh.triangles, &surface.components());
        monitor.check()?;
        // Points on the edges of one component belong to it.
        let components = match least.len() {
            1 => vec![0; samples.len()],
            _ => topology::components(samples.len(), &samples.triangles),
        };
        monitor.check()?;
        Ok(Self {
            parameters,
            points,
            volumes: topology::component_volumes(
                &surface.mesh.vertices,
                &surface.mesh.triangles,
                &components,
            ),
            components,
            least,
            samples,
            spacing,
            weights,
        })
    }

    /// One random start with its repairs. Returns the mesh and the relative spacing at each
    /// vertex, or `None` if the mesh would not have the surface's topology.
    fn attempt(
        &self,
        start: u64,
        repairs: usize,
        facts: &mut RetileFacts,
        monitor: &Monitor,
    ) -> Result<Option<(TriMesh, Vec<f64>)>, RetileError> {
        monitor.check()?;
        let mut cells = self.relaxed(start, facts, monitor)?;
        let exact = self.parameters.exact_rounds;
        let mut weights = self.weights.clone();
        let mut moved = Vec::new();
        for _ in 0..=repairs {
            facts.attempts += 1;
            monitor.report(Stage::Retile, 0.8)?;
            cells.tidy(&self.samples);
            monitor.check()?;
            let crowded = match dual::triangulate(&self.samples, &cells.labels, self.points) {
                Err(invalid) => invalid.sites,
                Ok(triangles) => {
                    monitor.check()?;
                    let mut mesh = TriMesh {
                        vertices: self.vertices(&cells),
                        triangles,
                    };
                    let intersecting = self_intersections(&mesh);
                    let component = self.components_of_sites(&cells);
                    if !intersecting.is_empty() {
                        sites_of(&mesh, &intersecting)
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
            self.raise_density(&cells, &crowded, &mut weights);
            monitor.check()?;
            for &site in crowded.iter().take(MAX_TRANSPLANTS) {
                let Some(light) = self.least_loaded(&cells, &weights, &crowded, site, &moved)
                else {
                    return Ok(None);
                };
                monitor.check()?;
                moved.push(light);
                cells.transplant(&self.samples, light, site);
            }
            facts.relaxation_rounds +=
                cells.relax(&self.samples, &weights, (SETTLING_ROUNDS, exact), monitor)?;
            moved.drain(..moved.len().saturating_sub(self.points / 4));
        }
        Ok(None)
    }

    /// The relaxed cells of a random start. Of many points a quarter is relaxed first, and of many of these a quarter
    /// before them; their cells give the [seeds](split) of the next.
    fn relaxed(
        &self,
        start: u64,
        facts: &mut RetileFacts,
        monitor: &Monitor,
    ) -> Result<Cells, RetileError> {
        let all = self.parameters.relaxation_iterations;
        let exact = self.parameters.exact_rounds;
        let share = if self.points < MANY_POINTS {
            ROUNDS_SHARE_AFTER_SPLIT
        } else {
            ROUNDS_SHARE_OF_MANY
        };
        let after_split = |rounds: usize| (rounds as f64 * share).ceil() as usize;
        let mut numbers = self.coarse_to_fine();
        let fewest = numbers.pop().unwrap_or(self.points);
        let mut cells = Cells::grow(&self.samples, &self.seeds(start, fewest));
        monitor.report(Stage::Retile, 0.1)?;
        let rounds = if numbers.is_empty() {
            (all, exact)
        } else {
            (all, 0)
        };
        facts.relaxation_rounds += cells.relax(&self.samples, &self.weights, rounds, monitor)?;
        while let Some(points) = numbers.pop() {
            monitor.check()?;
            let seeds = self.split_seeds(&cells, start, points);
            monitor.check()?;
            cells = Cells::grow(&self.samples, &seeds);
            let exact = if numbers.is_empty() {
                after_split(exact)
            } else {
                0
            };
            let rounds = (after_split(all), exact);
            facts.relaxation_rounds +=
                cells.relax(&self.samples, &self.weights, rounds, monitor)?;
        }
        Ok(cells)
    }

    /// The numbers of cells to relax one after the other, the last one first: N, and where that is large quarters of
    /// it.
    fn coarse_to_fine(&self) -> Vec<usize> {
        let mut numbers = vec![self.points];
        let mut points = self.points;
        while points >= COARSE_TO_FINE_FROM && points / 4 >= self.least.iter().sum::<usize>() {
            points /= 4;
            numbers.push(points);
        }
        numbers
    }

    /// The seeds of `points` cells that the relaxed ones of fewer give, and random ones where those give too few.
    fn split_seeds(&self, cells: &Cells, start: u64, points: usize) -> Vec<u32> {
        let random = self.seeds(start, points);
        let mut missing = vec![0usize; self.least.len()];
        for &v in &random {
            missing[self.components[v as usize] as usize] += 1;
        }
        let mut seeds = split::seeds(
            cells,
            &self.samples,
            &self.components,
            &self.spacing,
            &missing,
        );
        let mut taken = vec![false; self.samples.len()];
        for &v in &seeds {
            taken[v as usize] = true;
            let missing = &mut missing[self.components[v as usize] as usize];
            if *missing == 0 {
                // A component had more cells when there were fewer in all.
                return random;
            }
            *missing -= 1;
        }
        for v in random {
            let missing = &mut missing[self.components[v as usize] as usize];
            if *missing > 0 && !taken[v as usize] {
                *missing -= 1;
                seeds.push(v);
            }
        }
        seeds
    }

    /// Raises the density in the crowded cells and those around them, so that the sites that are
    /// moved there stay there.
    fn raise_density(&self, cells: &Cells, crowded: &[u32], weights: &mut [f64]) {
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
                *weight *= DENSITY_FACTOR;
            }
        }
    }

    /// As many distinct random samples as `points`; each component gets its share of them, and at least as many as its
    /// topology needs.
    fn seeds(&self, start: u64, points: usize) -> Vec<u32> {
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
        let quotas = quotas::share(&self.least, &load, points);
        let mut seeds = Vec::with_capacity(points);
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

    /// The site with the lightest cell that may be moved to the cell of `to`. It must not be
    /// crowded itself, not have been moved recently, and not be needed by its component.
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

    /// The component of the surface to which each cell belongs.
    fn components_of_sites(&self, cells: &Cells) -> Vec<u32> {
        let mut component = vec![0; self.points];
        for (&site, &c) in cells.labels.iter().zip(&self.components) {
            component[site as usize] = c;
        }
        component
    }

    /// The point of each cell's part of S that is closest to the cell's centroid on S, mm.
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
        let chunk = triangles.len().div_ceil(MAX_TASKS).max(1);
        let parts: Vec<_> = triangles.par_chunks(chunk).map(nearest).collect();
        // Of equal distances the first counts, as it would without parallel tasks.
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

    /// The mean of the wanted relative spacing over every cell.
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

/// The sites at the corners of intersecting triangles, ascending, each once.
fn sites_of(mesh: &TriMesh, intersecting: &[[FaceId; 2]]) -> Vec<u32> {
    let corners = intersecting
        .iter()
        .flatten()
        .map(|t| mesh.triangles[t.index()]);
    let mut sites: Vec<u32> = corners.flatten().collect();
    sites.sort_unstable();
    sites.dedup();
    sites
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::bvh::Bvh;
    use crate::mesh::shapes;
    use crate::surface::from_mesh;
    use crate::surface::retile::tessellate::test_surfaces::{moved, together};
    use std::collections::BTreeSet;

    #[test]
    fn the_sites_of_intersecting_triangles_are_listed_once() {
        let mesh = TriMesh {
            vertices: vec![Vec3::zeros(); 8],
            triangles: vec![[5, 1, 2], [2, 1, 3], [0, 6, 4], [7, 5, 3]],
        };
        let pairs = [[FaceId(0), FaceId(3)], [FaceId(0), FaceId(1)]];
        assert_eq!(sites_of(&mesh, &pairs), [1, 2, 3, 5, 7]);
        assert!(sites_of(&mesh, &[]).is_empty());
    }

    /// A ball, and a smaller one beside it.
    fn two_balls() -> Surface {
        let small = moved(shapes::icosphere(6.0, 2), Vec3::x() * 40.0);
        from_mesh(together(&[shapes::icosphere(20.0, 2), small]), 1.0).expect("closed")
    }

    fn even(points: usize) -> RetileParameters {
        RetileParameters {
            points,
            adaptive: 0.0,
            ..RetileParameters::default()
        }
    }

    /// On the small ball the points are wanted half as far apart.
    #[test]
    fn every_component_gets_seeds_by_its_area_and_spacing() {
        let (surface, parameters) = (two_balls(), even(90));
        let mut run = RefinedRun::new(&surface, &parameters, &Monitor::silent()).unwrap();
        let mut load = [0.0; 2];
        for v in 0..run.samples.len() {
            let c = run.components[v] as usize;
            run.spacing[v] = if c == 1 { 0.5 } else { 1.0 };
            load[c] += run.samples.area[v] * if c == 1 { 4.0 } else { 1.0 };
        }
        let fair = 90.0 * load[1] / (load[0] + load[1]);
        for start in 0..3 {
            let seeds = run.seeds(start, parameters.points);
            assert_eq!(seeds.iter().collect::<BTreeSet<_>>().len(), 90);
            let small = seeds
                .iter()
                .filter(|v| run.components[**v as usize] == 1)
                .count();
            assert!((small as f64 - fair).abs() < 1.0, "{small} {fair}");
            assert_eq!(seeds, run.seeds(start, parameters.points));
            assert_ne!(seeds, run.seeds(start + 1, parameters.points));
        }
    }

    /// As many distinct seeds as were asked for, each component's share of them, however few cells they come from.
    #[test]
    fn split_seeds_are_shared_out_as_random_ones() {
        let (surface, parameters) = (two_balls(), even(640));
        let run = RefinedRun::new(&surface, &parameters, &Monitor::silent()).unwrap();
        assert_eq!(run.coarse_to_fine(), [640, 160]);
        let small = |seeds: &[u32]| {
            let of_small = seeds.iter().filter(|v| run.components[**v as usize] == 1);
            of_small.count()
        };
        for from in [20, 160, 620, 640] {
            let mut cells = Cells::grow(&run.samples, &run.seeds(0, from));
            let weights = &run.weights;
            let silent = Monitor::silent();
            cells
                .relax(&run.samples, weights, (30, 0), &silent)
                .unwrap();
            let seeds = run.split_seeds(&cells, 0, 640);
            assert_eq!(seeds.iter().collect::<BTreeSet<_>>().len(), 640);
            assert_eq!(small(&seeds), small(&run.seeds(0, 640)), "{from}");
        }
        // Small numbers are relaxed at once.
        let parameters = even(COARSE_TO_FINE_FROM - 1);
        let run = RefinedRun::new(&surface, &parameters, &Monitor::silent()).unwrap();
        assert_eq!(run.coarse_to_fine(), [COARSE_TO_FINE_FROM - 1]);
    }

    /// Half the spacing is four times the density.
    #[test]
    fn seeds_are_as_dense_as_the_spacing_asks_for() {
        let surface = from_mesh(shapes::icosphere(10.0, 3), 1.0).unwrap();
        let parameters = even(400);
        let mut run = RefinedRun::new(&surface, &parameters, &Monitor::silent()).unwrap();
        let is_upper = |run: &RefinedRun, v: usize| run.samples.working[v].z > 0.0;
        for v in 0..run.samples.len() {
            run.spacing[v] = if is_upper(&run, v) { 1.0 } else { 2.0 };
        }
        let drawn: Vec<u32> = (0..5)
            .flat_map(|start| run.seeds(start, parameters.points))
            .collect();
        let upper = drawn
            .iter()
            .filter(|v| is_upper(&run, **v as usize))
            .count();
        // Binomial: 1600 of 2000 expected, standard deviation 18.
        assert!(upper.abs_diff(1600) < 80, "{upper}");
    }

    #[test]
    fn the_density_rises_in_crowded_cells_and_those_beside_them() {
        let (surface, parameters) = (two_balls(), even(60));
        let run = RefinedRun::new(&surface, &parameters, &Monitor::silent()).unwrap();
        let cells = Cells::grow(&run.samples, &run.seeds(0, parameters.points));
        let crowded = [3, 17];
        let mut weights = run.weights.clone();
        run.raise_density(&cells, &crowded, &mut weights);
        let mut raised = BTreeSet::from(crowded);
        for t in &run.samples.triangles {
            let labels = t.map(|v| cells.labels[v as usize]);
            if labels.iter().any(|label| crowded.contains(label)) {
                raised.extend(labels);
            }
        }
        assert!(raised.len() > 6 && raised.len() < 30, "{}", raised.len());
        for v in 0..weights.len() {
            let factor = if raised.contains(&cells.labels[v]) {
                DENSITY_FACTOR
            } else {
                1.0
            };
            assert_eq!(weights[v], run.weights[v] * factor);
        }
    }

    /// The lightest cell is moved, unless it is crowded, was moved, or its component would keep too few.
    #[test]
    fn the_lightest_cell_that_can_be_spared_is_moved() {
        let surface = two_balls();
        let mut from_small = [0; 2];
        for points in [12, 60] {
            let parameters = even(points);
            let run = RefinedRun::new(&surface, &parameters, &Monitor::silent()).unwrap();
            let cells = Cells::grow(&run.samples, &run.seeds(0, parameters.points));
            // Cells of the small ball are the lightest.
            let weight = |v: usize| {
                let share = if run.components[v] == 1 { 1e-3 } else { 1.0 };
                share * (1.5 + (v as f64).sin())
            };
            let weights: Vec<f64> = (0..run.samples.len()).map(weight).collect();
            let ball = |site: u32| {
                let v = cells.labels.iter().position(|label| *label == site);
                run.components[v.unwrap()]
            };
            let load = |site: u32| -> f64 {
                let of_site = (0..weights.len()).filter(|v| cells.labels[*v] == site);
                of_site.map(|v| weights[v]).sum()
            };
            let mut order: Vec<u32> = (0..points as u32).collect();
            order.sort_by(|a, b| load(*a).total_cmp(&load(*b)));
            let on_small = order.iter().filter(|site| ball(**site) == 1).count();
            let on_big = *order.iter().find(|site| ball(**site) == 0).unwrap();
            for to in [order[0], on_big] {
                let mut moved = Vec::new();
                for crowded in [vec![to], vec![to, order[1], order[5]]] {
                    for _ in 0..4 {
                        let spared = |site: u32| {
                            let least = 4; // A ball needs a tetrahedron.
                            ball(site) == ball(to) || ball(site) == 0 || on_small > least
                        };
                        let expected = order.iter().copied().find(|site| {
                            !crowded.contains(site) && !moved.contains(site) && spared(*site)
                        });
                        let found = run.least_loaded(&cells, &weights, &crowded, to, &moved);
                        assert_eq!(found, expected);
                        let Some(found) = found else { break };
                        from_small[ball(found) as usize] += 1;
                        moved.push(found);
                    }
                }
            }
            let all: Vec<u32> = order.clone();
            assert_eq!(run.least_loaded(&cells, &weights, &all, 0, &[]), None);
        }
        assert!(from_small.iter().all(|n| *n > 2), "{from_small:?}");
    }

    /// Against a search tree over the triangles that each cell touches.
    #[test]
    fn vertices_lie_in_their_cells_as_near_to_the_centroids_as_possible() {
        let surface = from_mesh(shapes::torus(20.0, 8.0, 24, 12), 1.0).unwrap();
        let parameters = even(40);
        let run = RefinedRun::new(&surface, &parameters, &Monitor::silent()).unwrap();
        let cells = Cells::grow(&run.samples, &run.seeds(1, parameters.points));
        let positions = &run.samples.surface;
        let centroids = cells.centroids(positions, &run.weights);
        for (site, vertex) in (0u32..).zip(run.vertices(&cells)) {
            let mut own = run.samples.triangles.clone();
            own.retain(|t| t.iter().any(|v| cells.labels[*v as usize] == site));
            let tree = Bvh::new(positions, &own);
            let centroid = &centroids[site as usize];
            let least = tree.closest(centroid).unwrap().squared_distance.sqrt();
            assert!(((vertex - centroid).norm() - least).abs() < 1e-9);
            assert!(tree.closest(&vertex).unwrap().squared_distance < 1e-18);
        }
    }

    #[test]
    fn the_sizing_of_a_vertex_is_the_mean_over_its_cell() {
        let (surface, parameters) = (two_balls(), even(50));
        let mut run = RefinedRun::new(&surface, &parameters, &Monitor::silent()).unwrap();
        for (v, h) in run.spacing.iter_mut().enumerate() {
            *h = 1.0 + 0.5 * (v as f64).sin();
        }
        let cells = Cells::grow(&run.samples, &run.seeds(0, parameters.points));
        for (site, h) in (0u32..).zip(run.sizing(&cells)) {
            let members = (0..run.spacing.len()).filter(|v| cells.labels[*v] == site);
            let values: Vec<f64> = members.map(|v| run.spacing[v]).collect();
            assert!((h * values.len() as f64 - values.iter().sum::<f64>()).abs() < 1e-9);
        }
    }

    /// With the density h^-4 the area of a centroidal cell is proportional to h².
    #[test]
    fn samples_weigh_as_much_as_their_area_over_the_fourth_power_of_the_spacing() {
        let surface = from_mesh(shapes::torus(20.0, 8.0, 24, 12), 1.0).unwrap();
        let parameters = RetileParameters {
            adaptive: 1.0,
            adaptive_from: 0.0,
            ..even(30)
        };
        let run = RefinedRun::new(&surface, &parameters, &Monitor::silent()).unwrap();
        assert!(run.samples.len() >= 30 * SAMPLES_PER_CELL);
        assert!(run.spacing.iter().any(|h| *h > 1.01));
        for (v, weight) in run.weights.iter().enumerate() {
            let (h, area) = (run.spacing[v], run.samples.area[v]);
            assert!((weight * h * h * h * h - area).abs() < 1e-12 * area.max(1.0));
        }
        assert_eq!(run.least, [7]);
        assert!((run.volumes[0] - surface.mesh.volume()).abs() < 1e-6);
    }

    #[test]
    fn a_ball_is_tiled_at_the_first_attempt() {
        let surface = from_mesh(shapes::icosphere(20.0, 3), 1.0).unwrap();
        let tiled = retile(&surface, &even(60), &Monitor::silent()).unwrap();
        assert_eq!((tiled.mesh.vertices.len(), tiled.facts.attempts), (60, 1));
        assert!(tiled.facts.relaxation_rounds > 10 && tiled.facts.relaxation_rounds <= 50);
        assert!(tiled.sizing.iter().all(|h| *h == 1.0));
        assert!(tiled.facts.warnings.is_empty());
        assert_eq!(
            topology::check(&tiled.mesh).unwrap().euler_characteristic,
            2
        );
        // The mesh follows the ball: it loses little of its volume, and is about as large as an even one.
        let share = tiled.mesh.volume() / surface.mesh.volume();
        assert!(share > 0.85 && share < 1.0, "{share}");
    }

    /// Four balls have no mesh of twelve points; the number named in the refusal suffices.
    #[test]
    fn a_refusal_names_a_number_that_suffices() {
        let balls =
            [0.0, 20.0, 40.0, 60.0].map(|x| moved(shapes::icosphere(5.0, 1), Vec3::x() * x));
        let surface = from_mesh(together(&balls), 1.0).unwrap();
        match retile(&surface, &even(12), &Monitor::silent()) {
            Err(RetileError::TooFewPoints { points, needed }) => {
                assert!(points == 12 && needed >= 16, "{needed}");
                let tiled = retile(&surface, &even(needed), &Monitor::silent()).unwrap();
                assert_eq!(tiled.mesh.vertices.len(), needed);
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn large_surfaces_are_left_to_the_cells() {
        let parameters = RetileParameters {
            repulsion_iterations: 5,
            repeats: 0,
            ..even(40)
        };
        let mut surface = from_mesh(shapes::icosphere(20.0, 2), 1.0).unwrap();
        let attempt = |surface: &Surface| by_repulsion(surface, &parameters, 1, &Monitor::silent());
        assert!(attempt(&surface).unwrap().is_some());
        // That these triangles are no surface is noticed only if they are looked at.
        surface.mesh.triangles = vec![[0, 1, 2]; PAPER_TRIANGLES];
        assert!(attempt(&surface).is_err());
        surface.mesh.triangles.push([0, 1, 2]);
        assert!(attempt(&surface).unwrap().is_none());
    }

    /// Thin walls need repairs: sites are moved to where cells are too large, and the number of points stays.
    #[test]
    fn thin_walls_are_tiled_after_repairs() {
        let mut repaired = 0;
        for (wall, points) in [(3.0, 50), (2.0, 70)] {
            let surface = from_mesh(shapes::cup(60.0, 30.0, wall, 36), 1.0).unwrap();
            let tiled = retile(&surface, &even(points), &Monitor::silent()).unwrap();
            let facts = &tiled.facts;
            assert_eq!(tiled.mesh.vertices.len(), points);
            assert_eq!(topology::check(&tiled.mesh).unwrap().genus(), 0);
            assert!(self_intersections(&tiled.mesh).is_empty());
            if facts.attempts > 1 && facts.attempts < MAX_REPAIRS {
                // At most 50 rounds, and 20 after each repair.
                let most = 50 + SETTLING_ROUNDS * (facts.attempts - 1);
                let rounds = facts.relaxation_rounds;
                assert!(rounds > 50 && rounds <= most, "{facts:?}");
                repaired += 1;
            }
        }
        assert!(repaired > 0);
    }

    /// A tetrahedron beside a ball with enough samples for all points is not subdivided: its four vertices are its
    /// four seeds.
    #[test]
    fn a_component_of_as_many_samples_as_points_gives_them_all() {
        let ball = shapes::icosphere(20.0, 3);
        let first = ball.vertices.len() as u32;
        let small = moved(shapes::tetrahedron(1.0), Vec3::repeat(30.0));
        let surface = from_mesh(together(&[ball, small]), 1.0).unwrap();
        let parameters = even(20);
        let seeds = RefinedRun::new(&surface, &parameters, &Monitor::silent())
            .unwrap()
            .seeds(0, parameters.points);
        let on_small: BTreeSet<u32> = seeds.into_iter().filter(|v| *v >= first).collect();
        assert_eq!(on_small, (first..first + 4).collect());
    }

    /// Two balls joined by a narrow tube of three sides.
    fn dumbbell() -> Surface {
        let ball = shapes::icosphere(10.0, 1);
        let mut mesh = ball.clone();
        let first = mesh.vertices.len() as u32;
        let [a, b, c] = ball.triangles[0];
        let normal = ball.area_normal(0).normalize();
        let plane = normal.dot(&ball.vertices[a as usize]);
        // The other ball is the mirror image beyond the first triangle.
        let mirrored = |p: &Vec3| p + normal * (2.0 * (plane + 2.0 - normal.dot(p)));
        mesh.vertices.extend(ball.vertices.iter().map(mirrored));
        mesh.triangles.extend(
            ball.triangles
                .iter()
                .map(|[p, q, r]| [p + first, r + first, q + first]),
        );
        mesh.triangles.swap_remove(ball.triangles.len());
        mesh.triangles.swap_remove(0);
        for [p, q] in [[a, b], [b, c], [c, a]] {
            mesh.triangles
                .extend([[p, q, q + first], [p, q + first, p + first]]);
        }
        // The tube is narrow in the middle of both triangles.
        for v in [a, b, c] {
            let middle = [a, b, c]
                .map(|v| ball.vertices[v as usize])
                .iter()
                .sum::<Vec3>()
                / 3.0;
            for w in [v, v + first] {
                let p = &mut mesh.vertices[w as usize];
                let along = normal * normal.dot(&(*p - middle));
                *p = middle + along + (*p - middle - along) * 0.1;
            }
        }
        from_mesh(mesh, 1.0).expect("closed")
    }

    /// Around the tube three cells must fit: sites are moved there until they do.
    #[test]
    fn narrow_tubes_are_tiled_after_repairs() {
        let surface = dumbbell();
        for points in [12, 20, 30] {
            let tiled = retile(&surface, &even(points), &Monitor::silent()).unwrap();
            let facts = &tiled.facts;
            assert_eq!(
                (tiled.mesh.vertices.len(), tiled.sizing.len()),
                (points, points)
            );
            assert_eq!(topology::check(&tiled.mesh).unwrap().genus(), 0);
            assert!(self_intersections(&tiled.mesh).is_empty());
            assert!((3..=MAX_REPAIRS).contains(&facts.attempts) && facts.warnings.is_empty());
            // At most 50 rounds, and 20 after each repair.
            let most = 50 + SETTLING_ROUNDS * (facts.attempts - 1);
            assert!(
                facts.relaxation_rounds > 50 && facts.relaxation_rounds <= most,
                "{facts:?}"
            );
        }
    }

    /// With this seed no start leads to cells that fit around the tube.
    #[test]
    fn what_is_too_narrow_for_cells_is_left_to_repulsion() {
        let parameters = RetileParameters {
            seed: 18,
            relaxation_iterations: 400,
            exact_rounds: 200,
            ..even(12)
        };
        let tiled = retile(&dumbbell(), &parameters, &Monitor::silent()).unwrap();
        let facts = &tiled.facts;
        assert_eq!((tiled.mesh.vertices.len(), facts.warnings.len()), (12, 1));
        assert_eq!(topology::check(&tiled.mesh).unwrap().genus(), 0);
        assert_eq!(facts.repulsion_rounds, parameters.repulsion_iterations);
        assert!(facts.relaxation_rounds > 400, "{facts:?}");
        // All attempts of all starts, and those of the paper's method.
        let of_cells = RANDOM_STARTS as usize * (MAX_REPAIRS + 1);
        assert!(facts.attempts > of_cells && facts.attempts <= of_cells + PAPER_SEEDS as usize);
    }
}
