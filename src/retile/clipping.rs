//! Centroids of cells, to more than the samples' precision.
//!
//! Counting whole samples makes centroids jump as samples change sides, and relaxation gets
//! stuck while cells are still uneven. Here a triangle whose corners belong to different cells
//! is cut along the bisecting planes of their sites, as in a restricted Voronoi diagram (Yan
//! et al., "Isotropic remeshing with fast and exact computation of restricted Voronoi
//! diagram", SGP 2009), and each cell gets its piece. Samples need then only be dense enough
//! to tell the cells' neighbours.

use rayon::prelude::*;

use super::samples::Samples;
use crate::geometry::Vec3;
use crate::geometry::triangle::area_normal;

/// Triangles in one parallel task, and most tasks: each task sums up all cells. They depend on
/// the surface alone, and so does the order of all sums.
const LEAST_CHUNK: usize = 1024;
const MOST_CHUNKS: usize = 16;

/// Three divisions by 3 cost more than all else at a triangle that is cut.
const THIRD: f64 = 1.0 / 3.0;

/// Moment (mass times place) and mass.
#[derive(Debug, Clone, Copy)]
struct Moment {
    first: Vec3,
    mass: f64,
}

impl Moment {
    fn zero() -> Self {
        Self {
            first: Vec3::zeros(),
            mass: 0.0,
        }
    }

    fn of(centroid: Vec3, mass: f64) -> Self {
        Self {
            first: centroid * mass,
            mass,
        }
    }

    fn add(&mut self, other: &Self) {
        self.first += other.first;
        self.mass += other.mass;
    }
}

/// The triangles of W with their mass.
pub(super) struct Patches<'a> {
    samples: &'a Samples,
    moments: Vec<Moment>,
}

impl<'a> Patches<'a> {
    /// `weights` are the samples' areas times their density.
    pub fn new(samples: &'a Samples, weights: &[f64]) -> Self {
        let density = |v: u32| weights[v as usize] / samples.area[v as usize];
        let moments = samples
            .triangles
            .par_iter()
            .with_min_len(LEAST_CHUNK)
            .map(|t| {
                let [a, b, c] = t.map(|v| samples.working[v as usize]);
                let mass =
                    area_normal(&a, &b, &c).norm() * (t.iter().map(|v| density(*v)).sum::<f64>());
                Moment::of((a + b + c) / 3.0, mass)
            })
            .collect();
        Self { samples, moments }
    }

    /// The centroid of every cell; `None` where the cell has no mass.
    pub fn centroids(&self, labels: &[u32], sites: &[Vec3]) -> Vec<Option<Vec3>> {
        let count = self.moments.len();
        let chunk = LEAST_CHUNK.max(count.div_ceil(MOST_CHUNKS));
        let partial: Vec<Vec<Moment>> = (0..count.div_ceil(chunk))
            .into_par_iter()
            .map(|k| {
                let mut sums = vec![Moment::zero(); sites.len()];
                for t in k * chunk..count.min((k + 1) * chunk) {
                    self.share(t, labels, sites, &mut sums);
                }
                sums
            })
            .collect();
        (0..sites.len())
            .map(|site| {
                let mut sum = Moment::zero();
                for part in &partial {
                    sum.add(&part[site]);
                }
                (sum.mass > 0.0).then(|| sum.first / sum.mass)
            })
            .collect()
    }

    /// Adds triangle `t` to the cells that hold its corners.
    fn share(&self, t: usize, labels: &[u32], sites: &[Vec3], sums: &mut [Moment]) {
        let corners = self.samples.triangles[t];
        let [a, b, c] = corners.map(|v| labels[v as usize]);
        let whole = &self.moments[t];
        if a == b && b == c {
            sums[a as usize].add(whole);
            return;
        }
        let positions = corners.map(|v| self.samples.working[v as usize]);
        if a != b && b != c && c != a {
            self.share_among_three(whole, &positions, [a, b, c], sites, sums);
            return;
        }
        // The corner that stands alone comes first.
        let k = if b == c {
            0
        } else if c == a {
            1
        } else {
            2
        };
        let [p, q, r] = [0, 1, 2].map(|s| positions[(k + s) % 3]);
        let (lone, rest) = ([a, b, c][k], [a, b, c][(k + 1) % 3]);
        let plane = Bisector::new(&sites[lone as usize], &sites[rest as usize]);
        let (s, u) = (plane.crossing(&p, &q), plane.crossing(&p, &r));
        let way = (q - p) * (s * THIRD) + (r - p) * (u * THIRD);
        let piece = Moment::of(p + way, whole.mass * s * u);
        sums[lone as usize].add(&piece);
        sums[rest as usize].add(&Moment {
            first: whole.first - piece.first,
            mass: whole.mass - piece.mass,
        });
    }

    fn share_among_three(
        &self,
        whole: &Moment,
        positions: &[Vec3; 3],
        labels: [u32; 3],
        sites: &[Vec3],
        sums: &mut [Moment],
    ) {
        let [a, b, c] = positions;
        let area = area_normal(a, b, c).norm();
        if !(area > 0.0) {
            return;
        }
        for k in 0..3 {
            let own = &sites[labels[k] as usize];
            let mut polygon = Polygon::triangle(positions);
            for other in [1, 2].map(|s| &sites[labels[(k + s) % 3] as usize]) {
                polygon = polygon.cut(&Bisector::new(own, other));
            }
            polygon.add_to(&mut sums[labels[k] as usize], whole.mass / area);
        }
    }
}

/// The plane in the middle between two sites; positive on the first one's side.
struct Bisector {
    normal: Vec3,
    middle: Vec3,
}

impl Bisector {
    fn new(own: &Vec3, other: &Vec3) -> Self {
        Self {
            normal: own - other,
            middle: (own + other) / 2.0,
        }
    }

    fn side(&self, p: &Vec3) -> f64 {
        self.normal.dot(&(p - self.middle))
    }

    /// How far from `p`, which is on the own side, to `q` the plane is met, 0..=1.
    fn crossing(&self, p: &Vec3, q: &Vec3) -> f64 {
        let (here, there) = (self.side(p).max(0.0), self.side(q).min(0.0));
        if here > there {
            here / (here - there)
        } else {
            0.5
        }
    }
}

/// A triangle cut at most twice: up to five corners.
struct Polygon {
    corners: [Vec3; 5],
    count: usize,
}

impl Polygon {
    fn triangle(&[a, b, c]: &[Vec3; 3]) -> Self {
        Self {
            corners: [a, b, c, a, a],
            count: 3,
        }
    }

    /// The part on the positive side (Sutherland & Hodgman 1974).
    fn cut(&self, plane: &Bisector) -> Self {
        let mut kept = Self {
            corners: self.corners,
            count: 0,
        };
        let mut push = |p: Vec3| {
            if kept.count < kept.corners.len() {
                kept.corners[kept.count] = p;
                kept.count += 1;
            }
        };
        for k in 0..self.count {
            let (p, q) = (self.corners[k], self.corners[(k + 1) % self.count]);
            let (here, there) = (plane.side(&p), plane.side(&q));
            if here >= 0.0 {
                push(p);
            }
            if (here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0) {
                push(p + (q - p) * (here / (here - there)));
            }
        }
        kept
    }

    /// Adds the polygon as a fan, `density` per doubled area.
    fn add_to(&self, sum: &mut Moment, density: f64) {
        for k in 1..self.count.max(1) - 1 {
            let [a, b, c] = [self.corners[0], self.corners[k], self.corners[k + 1]];
            let mass = area_normal(&a, &b, &c).norm() * density;
            sum.add(&Moment::of((a + b + c) / 3.0, mass));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    /// Sites on a sphere, every sample with its nearest.
    fn nearest(samples: &Samples, sites: &[Vec3]) -> Vec<u32> {
        let near = |x: &Vec3| {
            let distance = |s: &usize| (sites[*s] - x).norm_squared();
            (0..sites.len())
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))
                .map_or(0, |s| s as u32)
        };
        samples.working.iter().map(near).collect()
    }

    #[test]
    fn clipped_centroids_of_few_samples_are_those_of_many() {
        let coarse = shapes::icosphere(10.0, 3);
        let sites = shapes::icosphere(10.0, 0).vertices;
        // Turned, so that no sample lies on a bisector by symmetry.
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, 0.5, 0.7);
        let sites: Vec<Vec3> = sites.iter().map(|s| turn * s).collect();
        let of = |wanted: usize| {
            let samples = Samples::new(
                &coarse.vertices,
                &coarse.vertices,
                &coarse.triangles,
                wanted,
            );
            let labels = nearest(&samples, &sites);
            let patches = Patches::new(&samples, &samples.area);
            let centroids = patches.centroids(&labels, &sites).into_iter();
            centroids.map(Option::unwrap).collect::<Vec<Vec3>>()
        };
        // The same flat triangles, cut in 64: counting samples would be off by 0.06.
        for (a, b) in of(0).iter().zip(of(40_000)) {
            assert!((a - b).norm() < 0.01, "{}", (a - b).norm());
        }
    }

    #[test]
    fn pieces_of_a_triangle_add_up_to_it() {
        let corners = [
            Vec3::new(0.0, 0.0, 0.0),
            Vec3::new(4.0, 0.0, 0.0),
            Vec3::new(0.0, 3.0, 0.0),
        ];
        let sites = [
            Vec3::new(0.5, 0.5, 1.0),
            Vec3::new(3.0, 0.2, -0.5),
            Vec3::new(0.3, 2.5, 0.0),
        ];
        let mut total = Moment::zero();
        for k in 0..3 {
            let mut polygon = Polygon::triangle(&corners);
            for s in [1, 2] {
                polygon = polygon.cut(&Bisector::new(&sites[k], &sites[(k + s) % 3]));
            }
            polygon.add_to(&mut total, 0.5);
        }
        assert!((total.mass - 6.0).abs() < 1e-12);
        assert!((total.first / 6.0 - Vec3::new(4.0 / 3.0, 1.0, 0.0)).norm() < 1e-12);
    }
}
