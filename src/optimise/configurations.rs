//! The terms of every edge configuration of a mesh, kept up to date while edges flip, and what
//! a flip would gain.

use rayon::prelude::*;

use super::connectivity::{Connectivity, Quad};
use super::fitness::{Fitness, Terms};
use super::legality::{Replacement, replacement};
use super::{FitnessForm, FitnessSummary, Gain, Reference};
use crate::geometry::{Vec3, triangle};
use crate::mesh::adjacency::{next, previous};

/// Keeps C finite where a triangle has no area.
const LEAST_RADIUS_RATIO: f64 = 1e-12;

/// A new pair within this share of the new edge's length from S does not stray.
const MOST_STRAYING: f64 = 0.01;

/// A mesh with the terms of all its configurations.
#[derive(Debug, Clone)]
pub struct Configurations<'a> {
    vertices: &'a [Vec3],
    reference: &'a Reference,
    connectivity: Connectivity,
    /// Area normal of every triangle.
    normals: Vec<Vec3>,
    /// R/(2r) of every triangle.
    shapes: Vec<f64>,
    /// A of every half-edge's edge.
    angles: Vec<f64>,
    /// D of every half-edge's edge.
    distances: Vec<f64>,
}

/// A flip that would gain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// What it gains: see [`Gain`].
    pub gain: f64,
    /// D of the new edge, mm.
    pub distance: f64,
}

impl<'a> Configurations<'a> {
    /// Measures `connectivity` over `vertices` against `reference`.
    pub fn new(vertices: &'a [Vec3], connectivity: Connectivity, reference: &'a Reference) -> Self {
        let corners = |t: &[u32; 3]| t.map(|v| vertices[v as usize]);
        let normals: Vec<Vec3> = connectivity
            .triangles()
            .iter()
            .map(|t| {
                let [p, q, r] = corners(t);
                triangle::area_normal(&p, &q, &r)
            })
            .collect();
        let shapes = connectivity
            .triangles()
            .iter()
            .map(|t| shape(&corners(t)))
            .collect();
        let edges: Vec<u32> = connectivity.edges().collect();
        let measured: Vec<(f64, f64)> = edges
            .par_iter()
            .with_min_len(64)
            .map(|&h| {
                let g = connectivity.twin(h);
                let angle =
                    triangle::angle_between(&normals[h as usize / 3], &normals[g as usize / 3]);
                let ends = [connectivity.origin(h), connectivity.target(h)];
                (angle, midpoint_distance(vertices, ends, reference))
            })
            .collect();
        let halfedges = connectivity.halfedges() as usize;
        let (mut angles, mut distances) = (vec![0.0; halfedges], vec![0.0; halfedges]);
        for (&h, &(angle, distance)) in edges.iter().zip(&measured) {
            for side in [h, connectivity.twin(h)] {
                angles[side as usize] = angle;
                distances[side as usize] = distance;
            }
        }
        Self {
            vertices,
            reference,
            connectivity,
            normals,
            shapes,
            angles,
            distances,
        }
    }

    /// The triangles and their neighbours.
    pub fn connectivity(&self) -> &Connectivity {
        &self.connectivity
    }

    /// The vertices' positions.
    pub fn vertices(&self) -> &'a [Vec3] {
        self.vertices
    }

    /// The four terms of `h`'s configuration.
    pub fn terms(&self, h: u32) -> Terms {
        let g = self.connectivity.twin(h);
        let sides = self.connectivity.sides(h);
        Terms {
            a: self.angles[h as usize],
            b: mean4(sides.map(|s| self.angles[s as usize])),
            c: f64::midpoint(self.shapes[h as usize / 3], self.shapes[g as usize / 3]),
            d: self.distances[h as usize],
        }
    }

    /// Mean fitness over all edges.
    pub fn mean(&self, fitness: &Fitness) -> f64 {
        let sum: f64 = self
            .connectivity
            .edges()
            .map(|h| fitness.of(&self.terms(h)))
            .sum();
        sum / self.edge_count()
    }

    /// Means of fitness, in all forms, and of its terms.
    pub fn summary(&self, weights: [f64; 4]) -> FitnessSummary {
        let form = |form, weights| Fitness::new(form, weights, self.reference.spacing);
        let term = |pick: fn(&Terms) -> f64| {
            let sum: f64 = self
                .connectivity
                .edges()
                .map(|h| pick(&self.terms(h)))
                .sum();
            sum / self.edge_count()
        };
        FitnessSummary {
            raw: self.mean(&form(FitnessForm::Raw, weights)),
            normalised: self.mean(&form(FitnessForm::Normalised, weights)),
            robust: self.mean(&form(FitnessForm::Robust, [1.0; 4])),
            a_mean: term(|t| t.a),
            b_mean: term(|t| t.b),
            c_mean: term(|t| t.c),
            d_mean: term(|t| t.d),
        }
    }

    /// What flipping `h` would gain, if geometry allows it and the gain exceeds `least`.
    /// Whether the flip is topologically possible and pierces nothing is not looked at.
    pub fn candidate(
        &self,
        h: u32,
        fitness: &Fitness,
        gain: Gain,
        guard: f64,
        least: f64,
    ) -> Option<Candidate> {
        let quad = self.connectivity.quad(h);
        if quad.c == quad.d {
            return None;
        }
        let new = replacement(self.vertices, &quad, guard)?;
        let flipped = Flipped::new(self, h, &new);
        let before = match gain {
            Gain::Local => fitness.of(&self.terms(h)),
            Gain::Total => flipped.around_before(fitness),
        };
        let sides = match gain {
            Gain::Local => 0.0,
            Gain::Total => flipped.around_after(fitness),
        };
        let gained = |d: f64| fitness.of(&flipped.terms(d)) + sides - before;
        // The closest-point query is the costly part: spare it where even a new edge on S
        // would not gain.
        if !(gained(0.0) > least) {
            return None;
        }
        let distance = midpoint_distance(self.vertices, [quad.c, quad.d], self.reference);
        let candidate = Candidate {
            gain: gained(distance),
            distance,
        };
        let lawful = candidate.gain > least && (guard == 0.0 || !self.strays(&quad, distance));
        lawful.then_some(candidate)
    }

    /// Whether the flip of `quad`'s edge would move its pair away from S. F looks at edge
    /// midpoints alone and would let a ridge become a valley whose bottom happens to touch S.
    fn strays(&self, quad: &Quad, new_distance: f64) -> bool {
        let at = |v: u32| self.vertices[v as usize];
        let off = |points: &[u32]| {
            let middle = points.iter().map(|&v| at(v)).sum::<Vec3>() / points.len() as f64;
            distance(&middle, self.reference)
        };
        let Quad { a, b, c, d } = *quad;
        let squares = |x: [f64; 3]| x.iter().map(|d| d * d).sum::<f64>();
        let old = squares([off(&[a, b, c]), off(&[b, a, d]), off(&[a, b])]);
        let new = squares([off(&[c, a, d]), off(&[d, b, c]), new_distance]);
        new > old.max((MOST_STRAYING * (at(c) - at(d)).norm()).powi(2))
    }

    /// Flips `h`, whose new edge's midpoint is `distance` from S.
    pub fn flip(&mut self, h: u32, distance: f64) {
        let pair = [h / 3, self.connectivity.twin(h) / 3];
        self.connectivity.flip(h);
        for t in pair {
            let [p, q, r] =
                self.connectivity.triangles()[t as usize].map(|v| self.vertices[v as usize]);
            self.normals[t as usize] = triangle::area_normal(&p, &q, &r);
            self.shapes[t as usize] = shape(&[p, q, r]);
        }
        for t in pair {
            for k in 0..3 {
                let h = 3 * t + k;
                let g = self.connectivity.twin(h);
                let angle = triangle::angle_between(
                    &self.normals[t as usize],
                    &self.normals[g as usize / 3],
                );
                self.angles[h as usize] = angle;
                self.angles[g as usize] = angle;
                // The new edge is the last of both triangles; a side's distance is still
                // known to its outer half-edge.
                self.distances[h as usize] = if k == 2 {
                    distance
                } else {
                    self.distances[g as usize]
                };
            }
        }
    }

    fn edge_count(&self) -> f64 {
        f64::from(self.connectivity.halfedges()) / 2.0
    }
}

/// The configurations that a flip changes, as they would be after it.
struct Flipped<'a, 'b> {
    now: &'b Configurations<'a>,
    h: u32,
    /// The sides b→c, c→a, a→d, d→b and their angles after the flip.
    sides: [u32; 4],
    angles: [f64; 4],
    /// Angle across the new edge.
    angle: f64,
    /// R/(2r) of the new triangle at each side.
    shapes: [f64; 4],
}

impl<'a, 'b> Flipped<'a, 'b> {
    fn new(now: &'b Configurations<'a>, h: u32, new: &Replacement) -> Self {
        let sides = now.connectivity.sides(h);
        // The first new triangle keeps the sides c→a and a→d, the second d→b and b→c.
        let owner = [1, 0, 0, 1];
        let angles = [0, 1, 2, 3].map(|k| {
            let outer = now.connectivity.twin(sides[k]) as usize / 3;
            triangle::angle_between(&new.normals[owner[k]], &now.normals[outer])
        });
        let shapes = owner.map(|k| 1.0 / new.radius_ratios[k].max(LEAST_RADIUS_RATIO));
        Self {
            now,
            h,
            sides,
            angles,
            angle: new.angle,
            shapes,
        }
    }

    /// Terms of the new edge, at distance `d`.
    fn terms(&self, d: f64) -> Terms {
        Terms {
            a: self.angle,
            b: mean4(self.angles),
            c: f64::midpoint(self.shapes[0], self.shapes[1]),
            d,
        }
    }

    /// Terms of side `k` after the flip.
    fn side(&self, k: usize) -> Terms {
        // The other side that the same new triangle owns.
        let mate = [3, 2, 1, 0][k];
        let outer = self.now.connectivity.twin(self.sides[k]);
        let beyond = [next(outer), previous(outer)].map(|o| self.angle_after(o));
        Terms {
            a: self.angles[k],
            b: mean4([self.angle, self.angles[mate], beyond[0], beyond[1]]),
            c: f64::midpoint(self.shapes[k], self.now.shapes[outer as usize / 3]),
            d: self.now.distances[outer as usize],
        }
    }

    /// Terms of `o`, an edge of an outer neighbour but no side, after the flip.
    fn outer(&self, o: u32) -> Terms {
        let sides = self.now.connectivity.sides(o);
        Terms {
            b: mean4(sides.map(|s| self.angle_after(s))),
            ..self.now.terms(o)
        }
    }

    fn angle_after(&self, h: u32) -> f64 {
        self.side_of(h)
            .map_or(self.now.angles[h as usize], |k| self.angles[k])
    }

    fn side_of(&self, h: u32) -> Option<usize> {
        let twin = self.now.connectivity.twin(h);
        self.sides.iter().position(|&s| s == h || s == twin)
    }

    /// The up to eight edges of the outer neighbours that are no sides, each once.
    fn outer_edges(&self) -> impl Iterator<Item = u32> {
        let mut seen = [u32::MAX; 8];
        for (k, side) in self.sides.iter().enumerate() {
            let outer = self.now.connectivity.twin(*side);
            for (i, o) in [next(outer), previous(outer)].into_iter().enumerate() {
                let edge = self.now.connectivity.edge(o);
                if self.side_of(o).is_none() && !seen.contains(&edge) {
                    seen[2 * k + i] = edge;
                }
            }
        }
        seen.into_iter().filter(|&edge| edge != u32::MAX)
    }

    /// Sum of F over the flipped edge, its sides and the outer edges, as they are.
    fn around_before(&self, fitness: &Fitness) -> f64 {
        let rate = |h: u32| fitness.of(&self.now.terms(h));
        let sides: f64 = self.sides.iter().map(|&s| rate(s)).sum();
        rate(self.h) + sides + self.outer_edges().map(rate).sum::<f64>()
    }

    /// Sum of F over the sides and the outer edges after the flip.
    fn around_after(&self, fitness: &Fitness) -> f64 {
        let sides: f64 = (0..4).map(|k| fitness.of(&self.side(k))).sum();
        let outer = self.outer_edges().map(|o| fitness.of(&self.outer(o)));
        sides + outer.sum::<f64>()
    }
}

fn mean4(x: [f64; 4]) -> f64 {
    (x[0] + x[1] + x[2] + x[3]) / 4.0
}

fn shape([p, q, r]: &[Vec3; 3]) -> f64 {
    1.0 / triangle::radius_ratio(p, q, r).max(LEAST_RADIUS_RATIO)
}

fn midpoint_distance(vertices: &[Vec3], [a, b]: [u32; 2], reference: &Reference) -> f64 {
    distance(
        &((vertices[a as usize] + vertices[b as usize]) / 2.0),
        reference,
    )
}

fn distance(point: &Vec3, reference: &Reference) -> f64 {
    reference
        .bvh
        .closest(point)
        .map_or(f64::INFINITY, |found| found.squared_distance.sqrt())
}
