//! Centroids of cells with higher precision than that of the samples.
//!
//! In: the cell of every sample and the positions of the sites. Out: the centroid of every cell.
//! If whole samples are counted, centroids jump when samples change their cell, and relaxation
//! ends while cells are still uneven. Here a triangle whose corners belong to different cells is
//! cut along the bisecting planes of their sites, as in a restricted Voronoi diagram (Yan et
//! al., "Isotropic remeshing with fast and exact computation of restricted Voronoi diagram",
//! SGP 2009), and each cell gets its piece. The samples then only need to be dense enough to
//! determine which cells are neighbours.

use rayon::prelude::*;

use super::surface_samples::WeightedSamples;
use crate::base::geometry::Vec3;
use crate::base::geometry::triangle::area_normal;

/// Smallest number of triangles in a parallel task. The division into tasks, and with it the
/// order of all sums, depends on the surface alone.
const MIN_CHUNK: usize = 1024;

/// Largest number of parallel tasks; each has sums for all cells.
const MAX_CHUNKS: usize = 16;

/// Multiplying by it is faster than dividing by 3, which would take most of the time.
const ONE_THIRD: f64 = 1.0 / 3.0;

/// First moment (mass times position) and mass.
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

    fn new(centroid: Vec3, mass: f64) -> Self {
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

/// The triangles of W with their masses.
pub(super) struct Patches<'a> {
    samples: &'a WeightedSamples,
    moments: Vec<Moment>,
}

impl<'a> Patches<'a> {
    /// `weights` are the samples' areas times their density.
    pub fn new(samples: &'a WeightedSamples, weights: &[f64]) -> Self {
        let density = |v: u32| weights[v as usize] / samples.area[v as usize];
        let moments = samples
            .triangles
            .par_iter()
            .with_min_len(MIN_CHUNK)
            .map(|t| {
                let [a, b, c] = t.map(|v| samples.working[v as usize]);
                let mass =
                    area_normal(&a, &b, &c).norm() * (t.iter().map(|v| density(*v)).sum::<f64>());
                Moment::new((a + b + c) / 3.0, mass)
            })
            .collect();
        Self { samples, moments }
    }

    /// The centroid of every cell, mm; `None` for a cell without mass.
    pub fn centroids(&self, labels: &[u32], sites: &[Vec3]) -> Vec<Option<Vec3>> {
        let count = self.moments.len();
        let chunk = MIN_CHUNK.max(count.div_ceil(MAX_CHUNKS));
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

    /// Divides triangle `t` among the cells of its corners.
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
        // The corner whose cell differs from the other two comes first.
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
        let way = (q - p) * (s * ONE_THIRD) + (r - p) * (u * ONE_THIRD);
        let piece = Moment::new(p + way, whole.mass * s * u);
        sums[lone as usize].add(&piece);
        sums[rest as usize].add(&Moment {
            first: whole.first - piece.first,
            mass: whole.mass - piece.mass,
        });
    }

    /// Divides a triangle whose corners belong to three cells.
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

/// The bisecting plane of two sites; its positive side is that of the first one.
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

    /// The fraction, 0..=1, of the way from `p`, on the positive side, to `q` at which the plane is
    /// crossed.
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

    /// The part on the positive side of the plane (Sutherland and Hodgman 1974).
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

    /// Adds the polygon's triangles, with mass `density` per doubled area.
    fn add_to(&self, sum: &mut Moment, density: f64) {
        for k in 1..self.count.max(1) - 1 {
            let [a, b, c] = [self.corners[0], self.corners[k], self.corners[k + 1]];
            let mass = area_normal(&a, &b, &c).norm() * density;
            sum.add(&Moment::new((a + b + c) / 3.0, mass));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{TriMesh, shapes};

    /// The nearest site of every sample on a sphere.
    fn nearest(samples: &WeightedSamples, sites: &[Vec3]) -> Vec<u32> {
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
        // Rotated, so that no sample lies on a bisector by symmetry.
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, 0.5, 0.7);
        let sites: Vec<Vec3> = sites.iter().map(|s| turn * s).collect();
        let of = |wanted: usize| {
            let samples = WeightedSamples::new(
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
        // The same flat triangles split in 64. Counting whole samples would be off by 0.06.
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

    #[test]
    fn a_cell_without_samples_has_no_centroid() {
        let mesh = shapes::icosphere(10.0, 2);
        let samples = WeightedSamples::new(&mesh.vertices, &mesh.vertices, &mesh.triangles, 0);
        let sites = [Vec3::z() * 10.0, -Vec3::z() * 10.0, Vec3::x() * 99.0];
        let labels = nearest(&samples, &sites);
        let centroids = Patches::new(&samples, &samples.area).centroids(&labels, &sites);
        assert!(centroids[0].is_some() && centroids[1].is_some() && centroids[2].is_none());
    }

    /// A plane across a triangle, in any order of its corners: each site gets the area nearer to it.
    #[test]
    fn a_triangle_is_shared_out_along_the_bisecting_planes() {
        let places =
            [[0.0, 0.0], [6.0, 0.0], [1.0, 5.0]].map(|[x, y]: [f64; 2]| Vec3::new(x, y, 0.3 * x));
        let mesh = TriMesh {
            vertices: places.to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 1]],
        };
        let samples = WeightedSamples::new(&mesh.vertices, &mesh.vertices, &mesh.triangles, 0);
        let density = [1.0, 2.0, 4.5];
        let weights: Vec<f64> = (0..3).map(|v| samples.area[v] * density[v]).collect();
        let patches = Patches::new(&samples, &weights);
        let sites = [
            Vec3::new(1.0, 0.5, -1.0),
            Vec3::new(5.0, 0.7, 2.0),
            Vec3::new(1.5, 4.0, 1.0),
        ];
        for labels in [
            [0, 1, 2],
            [2, 0, 1],
            [0, 0, 1],
            [0, 1, 0],
            [1, 0, 0],
            [2, 2, 2],
            [1, 2, 2],
        ] {
            // Only where every corner lies nearest to its own of the sites in question.
            let own: Vec<Vec3> = labels.iter().map(|l: &u32| sites[*l as usize]).collect();
            let mut moved = sites;
            for v in 0..3 {
                // Each site is drawn towards its corners.
                let corners: Vec<usize> = (0..3).filter(|w| labels[*w] == labels[v]).collect();
                let mean = corners.iter().map(|w| places[*w]).sum::<Vec3>() / corners.len() as f64;
                moved[labels[v] as usize] = mean * 0.8 + own[v] * 0.2;
            }
            let mut sums = vec![Moment::zero(); 3];
            patches.share(0, &labels, &moved, &mut sums);
            // By many small parts of the triangle.
            let whole = area_normal(&places[0], &places[1], &places[2]).norm();
            let (mut masses, mut firsts) = ([0.0; 3], [Vec3::zeros(); 3]);
            let n = 300;
            let mut parts = 0.0;
            for i in 0..n {
                for j in 0..n - i {
                    let third = 1.0 / 3.0;
                    let (u, v) = (
                        (f64::from(i) + third) / f64::from(n),
                        (f64::from(j) + third) / f64::from(n),
                    );
                    let p = places[0] * (1.0 - u - v) + places[1] * u + places[2] * v;
                    let nearest = labels.iter().min_by(|a, b| {
                        let distance = |l: &u32| (moved[*l as usize] - p).norm();
                        distance(a).total_cmp(&distance(b))
                    });
                    let site = *nearest.unwrap() as usize;
                    masses[site] += 1.0;
                    firsts[site] += p;
                    parts += 1.0;
                }
            }
            let mass: f64 = whole * density.iter().sum::<f64>();
            for site in 0..3 {
                assert!(
                    (sums[site].mass / mass - masses[site] / parts).abs() < 0.01,
                    "{labels:?}"
                );
                let moment = firsts[site] * (mass / parts);
                assert!(
                    (sums[site].first - moment).norm() < 0.03 * mass,
                    "{labels:?}"
                );
            }
            let total: f64 = sums.iter().map(|s| s.mass).sum();
            assert!((total / mass - 1.0).abs() < 1e-12);
        }
    }

    /// On the way between two points: at the plane both sites are equally far; off it, in the share of the sides.
    #[test]
    fn a_plane_is_crossed_where_both_sites_are_equally_far() {
        let (own, other) = (Vec3::new(1.0, 2.0, 0.5), Vec3::new(4.0, -1.0, 1.5));
        let plane = Bisector::new(&own, &other);
        let (p, q) = (Vec3::new(0.0, 3.0, 0.0), Vec3::new(6.0, -2.0, 2.0));
        let share = plane.crossing(&p, &q);
        let at = p + (q - p) * share;
        assert!(((at - own).norm() - (at - other).norm()).abs() < 1e-12);
        // Points on the wrong side count as on the plane.
        assert_eq!(plane.crossing(&q, &q), 0.0);
        assert_eq!(plane.crossing(&p, &p), 1.0);
        let middle = (own + other) / 2.0;
        assert_eq!(plane.crossing(&middle, &middle), 0.5);
        assert!(plane.side(&own) > 0.0 && plane.side(&other) < 0.0);
    }

    /// Three corners on a line, each in a cell of its own.
    #[test]
    fn a_triangle_without_area_has_no_mass() {
        let line = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [3.0, 0.0, 0.0],
            [1.0, 4.0, 2.0],
        ]
        .map(Vec3::from);
        let triangles = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];
        let samples = WeightedSamples::new(&line, &line, &triangles, 0);
        let patches = Patches::new(&samples, &samples.area);
        let mut sums = vec![Moment::zero(); 3];
        patches.share(0, &[0, 1, 2, 2], &line[..3], &mut sums);
        for sum in sums {
            assert_eq!((sum.first, sum.mass), (Vec3::zeros(), 0.0));
        }
    }
}
