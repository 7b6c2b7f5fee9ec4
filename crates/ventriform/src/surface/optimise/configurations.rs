//! The fitness terms of all edges of a mesh, updated as edges flip, and the gain of each flip.
//!
//! In: vertices, half-edges and the reference surface. Normals and shapes are stored per
//! triangle, dihedral angles and distances per edge; the terms of a configuration are put
//! together from them. The gain of a flip is predicted without performing it: only the flipped
//! edge, the four sides of its two triangles and the up to eight other edges of their outer
//! neighbours change.

use rayon::prelude::*;

use super::fitness::{FitnessForm, FitnessFunction, FitnessSummary, FitnessTerms};
use super::legality::{Replacement, replacement};
use super::parameters::Gain;
use super::reference::Reference;
use crate::base::geometry::{Vec3, triangle};
use crate::mesh::half_edges::{HalfEdges, Quad};
use crate::mesh::{HalfEdgeId, VertexId};

/// Keeps C finite for a triangle without area.
const MIN_RADIUS_RATIO: f64 = 1e-12;

/// Root of the summed squared distances from S, relative to the length of the new edge, up to
/// which a flip does not count as moving away from S.
const TOLERATED_DISTANCE: f64 = 0.01;

/// A mesh with the terms of all its configurations.
#[derive(Debug, Clone)]
pub struct Configurations<'a> {
    vertices: &'a [Vec3],
    reference: &'a Reference,
    half_edges: HalfEdges,
    /// Area normal of every triangle.
    normals: Vec<Vec3>,
    /// R/(2r) of every triangle.
    shapes: Vec<f64>,
    /// A, the dihedral angle, by half-edge.
    angles: Vec<f64>,
    /// D, the distance of the midpoint from S, by half-edge.
    distances: Vec<f64>,
}

/// A flip that gains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlipCandidate {
    /// By how much the fitness rises; see [`Gain`].
    pub gain: f64,
    /// D of the new edge, mm.
    pub distance: f64,
}

impl<'a> Configurations<'a> {
    /// Measures the mesh of `half_edges` over `vertices` against `reference`.
    pub fn new(vertices: &'a [Vec3], half_edges: HalfEdges, reference: &'a Reference) -> Self {
        let corners = |t| half_edges.corners(t).map(|v| vertices[v.index()]);
        let normals: Vec<Vec3> = half_edges
            .faces()
            .map(|t| {
                let [p, q, r] = corners(t);
                triangle::area_normal(&p, &q, &r)
            })
            .collect();
        let shapes = half_edges.faces().map(|t| shape(&corners(t))).collect();
        let edges: Vec<HalfEdgeId> = half_edges.edges().collect();
        let measured: Vec<(f64, f64)> = edges
            .par_iter()
            .with_min_len(64)
            .map(|&h| {
                let [s, t] = half_edges.faces_of(h).map(|t| &normals[t.index()]);
                let distance = midpoint_distance(vertices, half_edges.ends(h), reference);
                (triangle::angle_between(s, t), distance)
            })
            .collect();
        let count = half_edges.half_edge_count();
        let (mut angles, mut distances) = (vec![0.0; count], vec![0.0; count]);
        for (&h, &(angle, distance)) in edges.iter().zip(&measured) {
            for side in [h, half_edges.twin(h)] {
                angles[side.index()] = angle;
                distances[side.index()] = distance;
            }
        }
        Self {
            vertices,
            reference,
            half_edges,
            normals,
            shapes,
            angles,
            distances,
        }
    }

    /// The connectivity of the mesh.
    pub fn half_edges(&self) -> &HalfEdges {
        &self.half_edges
    }

    /// The positions of the vertices, mm.
    pub fn vertices(&self) -> &'a [Vec3] {
        self.vertices
    }

    /// The four terms of the edge of `h`.
    pub fn terms(&self, h: HalfEdgeId) -> FitnessTerms {
        let sides = self.half_edges.sides(h);
        let [s, t] = self.half_edges.faces_of(h).map(|t| self.shapes[t.index()]);
        FitnessTerms {
            a: self.angles[h.index()],
            b: mean4(sides.map(|s| self.angles[s.index()])),
            c: f64::midpoint(s, t),
            d: self.distances[h.index()],
        }
    }

    /// Mean fitness over all edges.
    pub fn mean(&self, fitness: &FitnessFunction) -> f64 {
        let edges = self.half_edges.edges();
        let sum: f64 = edges.map(|h| fitness.value(&self.terms(h))).sum();
        sum / self.edge_count()
    }

    /// Means of the fitness, in all forms, and of its terms over all edges.
    pub fn summary(&self, weights: [f64; 4]) -> FitnessSummary {
        let lengths = self.reference.lengths(self.half_edges.face_count());
        let form = |form, weights| FitnessFunction::new(form, weights, lengths);
        let term = |pick: fn(&FitnessTerms) -> f64| {
            let edges = self.half_edges.edges();
            let sum: f64 = edges.map(|h| pick(&self.terms(h))).sum();
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

    /// The flip of `h`, if geometry allows it and its gain exceeds `least`. Whether it is
    /// topologically possible and adds no intersection is not tested here.
    pub fn candidate(
        &self,
        h: HalfEdgeId,
        fitness: &FitnessFunction,
        gain: Gain,
        guard: f64,
        least: f64,
    ) -> Option<FlipCandidate> {
        let quad = self.half_edges.quad(h);
        if quad.c == quad.d {
            return None;
        }
        let new = replacement(self.vertices, &quad, guard)?;
        let flipped = FlippedTerms::new(self, h, &new);
        let before = match gain {
            Gain::Local => fitness.value(&self.terms(h)),
            Gain::Total => flipped.around_before(fitness),
        };
        let sides = match gain {
            Gain::Local => 0.0,
            Gain::Total => flipped.around_after(fitness),
        };
        let gained = |d: f64| fitness.value(&flipped.terms(d)) + sides - before;
        // The closest-point query is the costly part. It is skipped if the flip would not gain
        // even with the new edge's midpoint on S.
        if !(gained(0.0) > least) {
            return None;
        }
        let distance = midpoint_distance(self.vertices, [quad.c, quad.d], self.reference);
        let candidate = FlipCandidate {
            gain: gained(distance),
            distance,
        };
        let allowed = candidate.gain > least && (guard == 0.0 || !self.moves_away(&quad, distance));
        allowed.then_some(candidate)
    }

    /// Whether flipping the edge of `quad` would move its two triangles away from S. F considers
    /// only midpoints of edges and would let a ridge become a valley whose bottom touches S.
    fn moves_away(&self, quad: &Quad, new_distance: f64) -> bool {
        let at = |v: VertexId| self.vertices[v.index()];
        let off = |points: &[VertexId]| {
            let middle = points.iter().map(|&v| at(v)).sum::<Vec3>() / points.len() as f64;
            self.reference.distance(&middle)
        };
        let Quad { a, b, c, d } = *quad;
        let squares = |x: [f64; 3]| x.iter().map(|d| d * d).sum::<f64>();
        let old = squares([off(&[a, b, c]), off(&[b, a, d]), off(&[a, b])]);
        let new = squares([off(&[c, a, d]), off(&[d, b, c]), new_distance]);
        new > old.max((TOLERATED_DISTANCE * (at(c) - at(d)).norm()).powi(2))
    }

    /// Flips `h`; `distance` is that of the new edge's midpoint from S, mm.
    pub fn flip(&mut self, h: HalfEdgeId, distance: f64) {
        let pair = self.half_edges.faces_of(h);
        self.half_edges.flip(h);
        for t in pair {
            let [p, q, r] = self.half_edges.corners(t).map(|v| self.vertices[v.index()]);
            self.normals[t.index()] = triangle::area_normal(&p, &q, &r);
            self.shapes[t.index()] = shape(&[p, q, r]);
        }
        for h in pair.into_iter().flat_map(|t| t.half_edges()) {
            let g = self.half_edges.twin(h);
            let [s, t] = [h, g].map(|h| &self.normals[h.face().index()]);
            let angle = triangle::angle_between(s, t);
            self.angles[h.index()] = angle;
            self.angles[g.index()] = angle;
            // The new edge is the last of both triangles. The distances of the other sides are
            // still stored at their outer half-edges.
            let is_new = h.corner() == 2;
            self.distances[h.index()] = if is_new {
                distance
            } else {
                self.distances[g.index()]
            };
        }
    }

    fn edge_count(&self) -> f64 {
        self.half_edges.half_edge_count() as f64 / 2.0
    }
}

/// The terms of the configurations that a flip changes, as they would be after it.
struct FlippedTerms<'a, 'b> {
    now: &'b Configurations<'a>,
    h: HalfEdgeId,
    /// The sides b→c, c→a, a→d, d→b.
    sides: [HalfEdgeId; 4],
    /// Dihedral angle at each side after the flip.
    angles: [f64; 4],
    /// Dihedral angle at the new edge.
    angle: f64,
    /// R/(2r) of the new triangle at each side.
    shapes: [f64; 4],
}

impl<'a, 'b> FlippedTerms<'a, 'b> {
    fn new(now: &'b Configurations<'a>, h: HalfEdgeId, new: &Replacement) -> Self {
        let sides = now.half_edges.sides(h);
        // The first new triangle has the sides c→a and a→d, the second d→b and b→c.
        let owner = [1, 0, 0, 1];
        let angles = [0, 1, 2, 3].map(|k| {
            let outer = now.half_edges.twin(sides[k]).face().index();
            triangle::angle_between(&new.normals[owner[k]], &now.normals[outer])
        });
        let shapes = owner.map(|k| 1.0 / new.radius_ratios[k].max(MIN_RADIUS_RATIO));
        Self {
            now,
            h,
            sides,
            angles,
            angle: new.angle,
            shapes,
        }
    }

    /// Terms of the new edge, whose midpoint has distance `d` from S.
    fn terms(&self, d: f64) -> FitnessTerms {
        FitnessTerms {
            a: self.angle,
            b: mean4(self.angles),
            c: f64::midpoint(self.shapes[0], self.shapes[1]),
            d,
        }
    }

    /// Terms of side `k` after the flip.
    fn side(&self, k: usize) -> FitnessTerms {
        // The other side that belongs to the same new triangle.
        let mate = [3, 2, 1, 0][k];
        let outer = self.now.half_edges.twin(self.sides[k]);
        let beyond = [outer.next(), outer.previous()].map(|o| self.angle_after(o));
        FitnessTerms {
            a: self.angles[k],
            b: mean4([self.angle, self.angles[mate], beyond[0], beyond[1]]),
            c: f64::midpoint(self.shapes[k], self.now.shapes[outer.face().index()]),
            d: self.now.distances[outer.index()],
        }
    }

    /// Terms of `o`, an edge of an outer neighbour that is not one of the sides, after the flip.
    fn outer(&self, o: HalfEdgeId) -> FitnessTerms {
        let sides = self.now.half_edges.sides(o);
        FitnessTerms {
            b: mean4(sides.map(|s| self.angle_after(s))),
            ..self.now.terms(o)
        }
    }

    fn angle_after(&self, h: HalfEdgeId) -> f64 {
        self.side_of(h)
            .map_or(self.now.angles[h.index()], |k| self.angles[k])
    }

    fn side_of(&self, h: HalfEdgeId) -> Option<usize> {
        let twin = self.now.half_edges.twin(h);
        self.sides.iter().position(|&s| s == h || s == twin)
    }

    /// The up to eight edges of the outer neighbours that are not sides, each once.
    fn outer_edges(&self) -> impl Iterator<Item = HalfEdgeId> {
        let mut seen = [None; 8];
        for (k, side) in self.sides.iter().enumerate() {
            let outer = self.now.half_edges.twin(*side);
            for (i, o) in [outer.next(), outer.previous()].into_iter().enumerate() {
                let edge = Some(self.now.half_edges.edge(o));
                if self.side_of(o).is_none() && !seen.contains(&edge) {
                    seen[2 * k + i] = edge;
                }
            }
        }
        seen.into_iter().flatten()
    }

    /// Sum of F over the flipped edge, its sides and the outer edges before the flip.
    fn around_before(&self, fitness: &FitnessFunction) -> f64 {
        let rate = |h: HalfEdgeId| fitness.value(&self.now.terms(h));
        let sides: f64 = self.sides.iter().map(|&s| rate(s)).sum();
        rate(self.h) + sides + self.outer_edges().map(rate).sum::<f64>()
    }

    /// Sum of F over the sides and the outer edges after the flip.
    fn around_after(&self, fitness: &FitnessFunction) -> f64 {
        let sides: f64 = (0..4).map(|k| fitness.value(&self.side(k))).sum();
        let outer = self.outer_edges().map(|o| fitness.value(&self.outer(o)));
        sides + outer.sum::<f64>()
    }
}

fn mean4(x: [f64; 4]) -> f64 {
    (x[0] + x[1] + x[2] + x[3]) / 4.0
}

fn shape([p, q, r]: &[Vec3; 3]) -> f64 {
    1.0 / triangle::radius_ratio(p, q, r).max(MIN_RADIUS_RATIO)
}

fn midpoint_distance(vertices: &[Vec3], [a, b]: [VertexId; 2], reference: &Reference) -> f64 {
    reference.distance(&((vertices[a.index()] + vertices[b.index()]) / 2.0))
}
