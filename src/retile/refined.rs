//! The refined route: centroidal Voronoi points and the dual of their diagram.
//!
//! Where the dual does not carry the surface's topology, or pierces itself, points are taken
//! from where cells are smallest and put where the diagram fails: on the far side of a handle
//! that one cell swallows, else at the far end of an offending cell. N never changes. After
//! [`RELOCATIONS`] tries another seed is taken, after [`SEEDS`] the surface is refused.

use super::clusters::Clusters;
use super::domain::{Domain, ancestor};
use super::dual::{self, Flaw};
use super::sizing::Sizing;
use super::voronoi::Voronoi;
use super::{Job, RetileError, RetileFacts, SurfacePoint, Tiled, placement, relaxation};
use crate::mesh::TriMesh;
use crate::mesh::intersections::self_intersections;
use crate::progress::{Cancelled, Stage};

/// Seeds tried before the surface is refused.
const SEEDS: u64 = 3;

/// Tries to mend one diagram by relocating points.
const RELOCATIONS: usize = 40;

/// Rounds of relaxation along the surface after those in space.
const GEODESIC_ROUNDS: usize = 3;

/// Relocations after which points are left where they were put: further relaxation would pull
/// them off a handle that is smaller than the spacing.
const RELAXED_RELOCATIONS: usize = 6;

/// Vertices that a cell shall have, and many cells at least: the finer the sampling, the
/// better the centroids; a model of many points needs less of it.
const VERTICES_PER_CELL: usize = 40;
const VERTICES_PER_SMALL_CELL: usize = 14;
const MANY_POINTS: usize = 600;

pub(super) fn tile(job: &Job) -> Result<Tiled, RetileError> {
    let count = job.parameters.points;
    let mut pierced = None;
    for attempt in 0..SEEDS {
        let mut diagram = Diagram::new(job, count, attempt)?;
        match diagram.mend()? {
            Outcome::Carried(mesh) => {
                let points = diagram.points_on_surface();
                let facts = RetileFacts {
                    relaxation_rounds: diagram.rounds,
                    attempts: attempt as usize * (RELOCATIONS + 1) + diagram.tries,
                    ..RetileFacts::default()
                };
                return Ok(job.finish(&points, mesh, facts));
            }
            Outcome::Pierced(place) => pierced = Some(place),
            Outcome::Uncarried => pierced = None,
        }
    }
    Err(match pierced {
        Some(place) => RetileError::SelfIntersecting {
            points: count,
            place,
        },
        None => RetileError::TooFewPoints {
            points: count,
            needed: enough(job)?,
        },
    })
}

/// A number of points that carries the surface, found by trying.
fn enough(job: &Job) -> Result<usize, RetileError> {
    let mut count = job.parameters.points;
    while count < super::MOST_POINTS {
        count = (count * 3 / 2).min(super::MOST_POINTS);
        if let Outcome::Carried(_) = Diagram::new(job, count, 0)?.mend()? {
            break;
        }
    }
    Ok(count)
}

enum Outcome {
    /// The mesh is what it shall be.
    Carried(TriMesh),
    /// The topology is right, but the mesh pierces itself, here (LPS mm).
    Pierced([f64; 3]),
    /// The topology is not right.
    Uncarried,
}

/// Points and their Voronoi diagram on W, cut finely enough.
struct Diagram<'a> {
    job: &'a Job<'a>,
    domain: Domain,
    sizing: Sizing,
    /// How often W's triangles were cut in four.
    levels: u32,
    points: Vec<SurfacePoint>,
    voronoi: Voronoi,
    rounds: usize,
    tries: usize,
}

impl<'a> Diagram<'a> {
    fn new(job: &'a Job, count: usize, attempt: u64) -> Result<Self, RetileError> {
        let (domain, sizing, levels) = cut(job, count);
        job.monitor.check()?;
        let seed = job.parameters.seed.wrapping_add(attempt << 32);
        let points = placement::place(&domain, &sizing, count, seed)?;
        let voronoi = Voronoi::new(domain.vertices.len());
        let mut diagram = Self {
            job,
            domain,
            sizing,
            levels,
            points,
            voronoi,
            rounds: 0,
            tries: 0,
        };
        diagram.relax(attempt == 0)?;
        Ok(diagram)
    }

    fn relax(&mut self, report: bool) -> Result<(), Cancelled> {
        let (monitor, most) = (self.job.monitor, self.job.parameters.relaxation_iterations);
        let geodesic = GEODESIC_ROUNDS.min(most);
        self.voronoi.spread(&self.domain, &self.points);
        let sites = self
            .points
            .iter()
            .map(|p| p.position(&self.domain.vertices, &self.domain.triangles))
            .collect();
        let label = self.voronoi.label.clone();
        let mut clusters = Clusters::new(&self.domain, &self.sizing, label, sites);
        self.rounds = clusters.relax(most - geodesic, |share| {
            if report {
                monitor.report(Stage::Retile, 0.7 * share)
            } else {
                monitor.check()
            }
        })?;
        self.points = clusters.settle(&self.points);
        self.relax_along_surface(geodesic)
    }

    fn relax_along_surface(&mut self, rounds: usize) -> Result<(), Cancelled> {
        let monitor = self.job.monitor;
        self.rounds += rounds;
        relaxation::relax(
            &self.domain,
            &self.sizing,
            &mut self.points,
            &mut self.voronoi,
            (rounds, 1.0),
            |_| monitor.check(),
        )
    }

    /// Relocates points until the dual is right.
    fn mend(&mut self) -> Result<Outcome, Cancelled> {
        let mut outcome = Outcome::Uncarried;
        for relocation in 0..=RELOCATIONS {
            self.job.monitor.check()?;
            self.tries += 1;
            let triangles = dual::dual(&self.domain.triangles, &self.voronoi.label);
            let wrong = match dual::check(self.points.len(), &triangles, &self.job.census) {
                Ok(()) => {
                    let mesh = TriMesh {
                        vertices: self.job.positions(&self.points_on_surface()),
                        triangles,
                    };
                    let pairs = self_intersections(&mesh);
                    let Some(&[t, _]) = pairs.first() else {
                        return Ok(Outcome::Carried(mesh));
                    };
                    let [a, b, c] = mesh.corners(t as usize);
                    outcome = Outcome::Pierced(((a + b + c) / 3.0).into());
                    cells_of(&mesh, &pairs)
                }
                Err(flaw) => {
                    outcome = Outcome::Uncarried;
                    match flaw {
                        Flaw::Cells(cells) => cells,
                        Flaw::Characteristic => Vec::new(),
                    }
                }
            };
            if relocation < RELOCATIONS {
                self.relocate(&wrong);
                let rounds = usize::from(relocation < RELAXED_RELOCATIONS);
                self.relax_along_surface(rounds)?;
            }
        }
        Ok(outcome)
    }

    /// Moves some of the smallest cells' points to where the diagram fails.
    fn relocate(&mut self, wrong: &[u32]) {
        let count = self.points.len();
        let mut targets = self.swallowed_handles();
        targets.extend(self.far_ends(wrong));
        targets.truncate((count / 20).max(1));
        let mut small: Vec<(f64, u32)> = self
            .weights()
            .into_iter()
            .zip(0..)
            .filter(|(_, cell)| wrong.binary_search(cell).is_err())
            .collect();
        small.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (vertex, (_, donor)) in targets.into_iter().zip(small) {
            self.points[donor as usize] = self.beside(vertex);
        }
    }

    /// A point next to a vertex, in the middle of one of its triangles.
    fn beside(&self, vertex: u32) -> SurfacePoint {
        SurfacePoint {
            triangle: self.domain.outgoing[vertex as usize] / 3,
            barycentric: [1.0 / 3.0; 3],
        }
    }

    fn weights(&self) -> Vec<f64> {
        let mut weights = vec![0.0; self.points.len()];
        for (v, &label) in self.voronoi.label.iter().enumerate() {
            if let Some(w) = weights.get_mut(label as usize) {
                *w += self.sizing.weight(&self.domain, v);
            }
        }
        weights
    }

    /// In every cell that is no disc, the vertex where the wave from its point meets itself.
    fn swallowed_handles(&self) -> Vec<u32> {
        let label = &self.voronoi.label;
        let mut characteristic = vec![0i64; self.points.len()];
        let mut meeting = vec![(0.0, u32::MAX); self.points.len()];
        for &l in label {
            if let Some(c) = characteristic.get_mut(l as usize) {
                *c += 1;
            }
        }
        for h in 0..self.domain.lengths.len() as u32 {
            let [a, b] = self.domain.ends(h);
            let l = label[a as usize];
            if a > b || l != label[b as usize] || l as usize >= self.points.len() {
                continue;
            }
            characteristic[l as usize] -= 1;
            let [u, v] = [a, b].map(|v| self.voronoi.reach[v as usize].vector);
            let gap = (u - v).norm() - self.domain.lengths[h as usize];
            if gap > meeting[l as usize].0 {
                meeting[l as usize] = (gap, a);
            }
        }
        for t in &self.domain.triangles {
            let [a, b, c] = t.map(|v| label[v as usize]);
            if a == b && b == c && (a as usize) < self.points.len() {
                characteristic[a as usize] += 1;
            }
        }
        characteristic
            .iter()
            .zip(meeting)
            .filter(|(c, (_, vertex))| **c < 1 && *vertex != u32::MAX)
            .map(|(_, (_, vertex))| vertex)
            .collect()
    }

    /// The vertex of each of the cells that lies farthest from its point, the farthest first.
    fn far_ends(&self, cells: &[u32]) -> Vec<u32> {
        let mut far = vec![(0.0, u32::MAX); self.points.len()];
        for (v, (&label, reach)) in self
            .voronoi
            .label
            .iter()
            .zip(&self.voronoi.reach)
            .enumerate()
        {
            if let Some(best) = far.get_mut(label as usize)
                && reach.distance > best.0
            {
                *best = (reach.distance, v as u32);
            }
        }
        let mut ends: Vec<(f64, u32)> = cells
            .iter()
            .map(|c| far[*c as usize])
            .filter(|(_, vertex)| *vertex != u32::MAX)
            .collect();
        ends.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        ends.into_iter().map(|(_, vertex)| vertex).collect()
    }

    fn points_on_surface(&self) -> Vec<SurfacePoint> {
        self.points
            .iter()
            .map(|p| {
                let (triangle, barycentric) = ancestor(p.triangle, p.barycentric, self.levels);
                SurfacePoint {
                    triangle,
                    barycentric,
                }
            })
            .collect()
    }
}

/// W, its sizing and how often it was cut, so that `count` cells have vertices enough.
fn cut(job: &Job, count: usize) -> (Domain, Sizing, u32) {
    let per_cell = if count < MANY_POINTS {
        VERTICES_PER_CELL
    } else {
        VERTICES_PER_SMALL_CELL
    };
    let (mut domain, mut sizing) = (job.domain.clone(), job.sizing.clone());
    let mut levels = 0;
    while domain.vertices.len() < per_cell * count {
        let fine = domain.subdivided();
        sizing = sizing.subdivided(&domain, &fine);
        domain = fine;
        levels += 1;
    }
    (domain, sizing, levels)
}

/// The vertices of some pairs of triangles, ascending.
fn cells_of(mesh: &TriMesh, pairs: &[[u32; 2]]) -> Vec<u32> {
    let mut cells: Vec<u32> = pairs
        .iter()
        .flatten()
        .flat_map(|t| mesh.triangles[*t as usize])
        .collect();
    cells.sort_unstable();
    cells.dedup();
    cells
}
