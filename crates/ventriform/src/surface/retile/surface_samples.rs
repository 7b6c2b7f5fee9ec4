//! The vertices of the surface as weighted samples, as many as N cells need.
//!
//! In: the surface S and its smoothed twin W, which share their triangles. Out: their vertices and the
//! midpoints of as many of the longest edges as are needed, with neighbours and the area around each.
//! Subdivision changes neither surface: every new vertex is the midpoint of an edge.

use crate::base::geometry::Vec3;
use crate::base::geometry::triangle::area_normal;
use rayon::prelude::*;

/// Number of wanted samples from which on only the longest edges are split. Fewer samples take little time, and models
/// of few points are better the more samples a cell has.
const PARTLY_SPLIT_FROM_SAMPLES: usize = 8000;

/// The vertices of S and W with neighbours and areas.
#[derive(Debug, Clone)]
pub(super) struct WeightedSamples {
    /// Positions on W, mm.
    pub working: Vec<Vec3>,
    /// Positions on S, mm.
    pub surface: Vec<Vec3>,
    /// Triangles over the vertices.
    pub triangles: Vec<[u32; 3]>,
    /// A third of the area of the triangles around each vertex on W, mm².
    pub area: Vec<f64>,
    /// The neighbours of v are `neighbours[first[v]..first[v + 1]]`.
    first: Vec<u32>,
    neighbours: Vec<u32>,
}

impl WeightedSamples {
    /// Samples of the surface with at least `wanted` vertices: from [`PARTLY_SPLIT_FROM_SAMPLES`] on no more than that
    /// but for edges of one length, below as many as splitting every edge makes.
    pub fn new(surface: &[Vec3], working: &[Vec3], triangles: &[[u32; 3]], wanted: usize) -> Self {
        let mut samples =
            Self::from_surface(surface.to_vec(), working.to_vec(), triangles.to_vec());
        while samples.len() < wanted {
            let missing = wanted - samples.len();
            let all = wanted < PARTLY_SPLIT_FROM_SAMPLES;
            samples = samples.subdivided(if all { usize::MAX } else { missing });
        }
        samples
    }

    fn from_surface(surface: Vec<Vec3>, working: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        let (first, neighbours) = neighbours(working.len(), &triangles);
        let mut area = vec![0.0; working.len()];
        for t in &triangles {
            let [a, b, c] = t.map(|v| &working[v as usize]);
            let third = area_normal(a, b, c).norm() / 6.0;
            for v in t {
                area[*v as usize] += third;
            }
        }
        Self {
            working,
            surface,
            triangles,
            area,
            first,
            neighbours,
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.working.len()
    }

    /// The neighbours of `v`, each once.
    pub fn around(&self, v: usize) -> &[u32] {
        &self.neighbours[self.first[v] as usize..self.first[v + 1] as usize]
    }

    /// The samples and the midpoints of their `count` longest edges on W, of all edges if there are no more.
    fn subdivided(&self, count: usize) -> Self {
        let old = self.len() as u32;
        let length_squared =
            |a: u32, b: u32| (self.working[a as usize] - self.working[b as usize]).norm_squared();
        let shortest = {
            let ends = (0..old).flat_map(|a| self.around(a as usize).iter().map(move |b| (a, *b)));
            let edges = ends.filter(|(a, b)| a < b);
            let mut lengths: Vec<f64> = edges.map(|(a, b)| length_squared(a, b)).collect();
            let last = count.min(lengths.len()).saturating_sub(1);
            *lengths
                .select_nth_unstable_by(last, |a, b| b.total_cmp(a))
                .1
        };
        // Edges are numbered by the half-edge that leaves their lower vertex; their midpoints get
        // the next free vertex numbers in that order.
        let mut middle = vec![NOT_SPLIT; self.neighbours.len()];
        let (mut surface, mut working) = (self.surface.clone(), self.working.clone());
        for a in 0..old {
            for h in self.first[a as usize]..self.first[a as usize + 1] {
                let b = self.neighbours[h as usize];
                if a < b && length_squared(a, b) >= shortest {
                    middle[h as usize] = working.len() as u32;
                    working.push((self.working[a as usize] + self.working[b as usize]) / 2.0);
                    surface.push((self.surface[a as usize] + self.surface[b as usize]) / 2.0);
                }
            }
        }
        let between = |a: u32, b: u32| {
            let (low, high) = (a.min(b), a.max(b));
            let start = self.first[low as usize] as usize;
            let place = self.around(low as usize).iter().position(|&v| v == high);
            middle[start + place.expect("a triangle's edge joins neighbours")]
        };
        let is_shorter = |[a, b]: [u32; 2], [c, d]: [u32; 2]| {
            let length =
                |p: u32, q: u32| (working[p as usize] - working[q as usize]).norm_squared();
            length(a, b) <= length(c, d)
        };
        let triangles = self
            .triangles
            .par_iter()
            .with_min_len(4096)
            .flat_map_iter(|&[a, b, c]| {
                let middles = [between(a, b), between(b, c), between(c, a)];
                let (parts, count) = split([a, b, c], middles, is_shorter);
                parts.into_iter().take(count)
            })
            .collect();
        Self::from_surface(surface, working, triangles)
    }
}

/// Stands for the midpoint of an edge that is not split.
const NOT_SPLIT: u32 = u32::MAX;

/// The parts of a triangle whose edges, from its first corner on, have these midpoints, and their number. Where two
/// edges are split, the shorter diagonal divides what they leave of the triangle.
fn split(
    [a, b, c]: [u32; 3],
    [ab, bc, ca]: [u32; 3],
    is_shorter: impl Fn([u32; 2], [u32; 2]) -> bool,
) -> ([[u32; 3]; 4], usize) {
    let none = [a, b, c];
    // With the first edge split, and the second one if there are two.
    match [ab, bc, ca].map(|middle| middle != NOT_SPLIT) {
        [false, false, false] => ([none; 4], 1),
        [true, true, true] => ([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]], 4),
        [true, false, false] => ([[a, ab, c], [ab, b, c], none, none], 2),
        [true, true, false] if is_shorter([a, bc], [ab, c]) => {
            ([[ab, b, bc], [a, ab, bc], [a, bc, c], none], 3)
        }
        [true, true, false] => ([[ab, b, bc], [a, ab, c], [ab, bc, c], none], 3),
        _ => split([b, c, a], [bc, ca, ab], is_shorter),
    }
}

/// The neighbours of all vertices in one array; those of `v` are at `first[v]..first[v + 1]`. In
/// a closed oriented manifold the half-edges that leave a vertex end at each neighbour once.
fn neighbours(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<u32>, Vec<u32>) {
    let mut first = vec![0u32; vertices + 1];
    for &v in triangles.iter().flatten() {
        first[v as usize + 1] += 1;
    }
    for v in 0..vertices {
        first[v + 1] += first[v];
    }
    let mut next = first.clone();
    let mut neighbours = vec![0; 3 * triangles.len()];
    for t in triangles {
        for k in 0..3 {
            let slot = &mut next[t[k] as usize];
            neighbours[*slot as usize] = t[(k + 1) % 3];
            *slot += 1;
        }
    }
    (first, neighbours)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{TriMesh, shapes, topology};

    #[test]
    fn subdivision_keeps_area_and_topology() {
        let mesh = shapes::torus(9.0, 3.0, 14, 9);
        let coarse = WeightedSamples::new(&mesh.vertices, &mesh.vertices, &mesh.triangles, 0);
        let fine = WeightedSamples::new(&mesh.vertices, &mesh.vertices, &mesh.triangles, 1000);
        assert!(fine.len() >= 1000 && coarse.len() == mesh.vertices.len());
        let as_mesh = TriMesh {
            vertices: fine.surface.clone(),
            triangles: fine.triangles.clone(),
        };
        assert_eq!(topology::check(&as_mesh).unwrap().euler_characteristic, 0);
        let (a, b): (f64, f64) = (coarse.area.iter().sum(), fine.area.iter().sum());
        assert!((a - b).abs() < 1e-9 * a);
        assert!((a - mesh.area()).abs() < 1e-9 * a);
    }

    /// Whatever the number of new samples, the longest edges are those that are split, and the surface stays closed.
    #[test]
    fn the_longest_edges_are_split() {
        let mut mesh = shapes::torus(9.0, 3.0, 14, 9);
        // No two edges of one length.
        for (n, vertex) in mesh.vertices.iter_mut().enumerate() {
            *vertex *= 1.0 + 0.05 * (7.0 * n as f64).sin();
        }
        let coarse = WeightedSamples::new(&mesh.vertices, &mesh.vertices, &mesh.triangles, 0);
        let length =
            |[a, b]: [u32; 2]| (mesh.vertices[a as usize] - mesh.vertices[b as usize]).norm();
        let mut lengths: Vec<f64> = (mesh.triangles.iter())
            .flat_map(|t| (0..3).map(|k| [t[k], t[(k + 1) % 3]]))
            .filter(|[a, b]| a < b)
            .map(length)
            .collect();
        lengths.sort_by(|a, b| b.total_cmp(a));
        for more in [1, 17, 60, 126, 300, lengths.len()] {
            let fine = coarse.subdivided(more);
            assert_eq!(fine.len(), coarse.len() + more);
            let as_mesh = TriMesh {
                vertices: fine.surface.clone(),
                triangles: fine.triangles.clone(),
            };
            assert_eq!(topology::check(&as_mesh).unwrap().euler_characteristic, 0);
            assert!((as_mesh.area() - mesh.area()).abs() < 1e-9 * mesh.area());
            let longest = as_mesh
                .triangles
                .iter()
                .flat_map(|t| (0..3).map(|k| [t[k], t[(k + 1) % 3]]));
            let longest = longest
                .filter(|edge| edge.iter().all(|v| (*v as usize) < coarse.len()))
                .map(length)
                .fold(0.0, f64::max);
            assert!(
                longest < lengths[more - 1] - 1e-9 || more == lengths.len(),
                "{more}"
            );
        }
    }

    /// W is here S, stretched and moved: subdivision keeps that, and all areas are of W.
    #[test]
    fn both_surfaces_are_subdivided_alike() {
        let mesh = shapes::icosphere(5.0, 1);
        let stretch = |p: &Vec3| Vec3::new(2.0 * p.x + 7.0, p.y - 3.0, 0.5 * p.z);
        let working: Vec<Vec3> = mesh.vertices.iter().map(stretch).collect();
        let fine = WeightedSamples::new(&mesh.vertices, &working, &mesh.triangles, 600);
        assert_eq!(fine.len(), 642);
        for (on_surface, on_working) in fine.surface.iter().zip(&fine.working) {
            assert!((stretch(on_surface) - on_working).norm() < 1e-12);
        }
        let mut around = vec![Vec::new(); fine.len()];
        let mut areas = vec![0.0; fine.len()];
        for t in &fine.triangles {
            let [a, b, c] = t.map(|v| fine.working[v as usize]);
            for k in 0..3 {
                around[t[k] as usize].push(t[(k + 1) % 3]);
                areas[t[k] as usize] += (b - a).cross(&(c - a)).norm() / 6.0;
            }
        }
        for (v, known) in around.iter_mut().enumerate() {
            let mut found = fine.around(v).to_vec();
            found.sort_unstable();
            known.sort_unstable();
            assert_eq!(found, *known);
            assert!((fine.area[v] - areas[v]).abs() < 1e-9);
        }
        // The old vertices come first, and each new one is the middle of an edge of the old mesh or of the next one.
        assert_eq!(fine.surface[..42], mesh.vertices);
        let once = WeightedSamples::new(&mesh.vertices, &working, &mesh.triangles, 43);
        for t in &mesh.triangles {
            for k in 0..3 {
                let [p, q] = [t[k], t[(k + 1) % 3]].map(|v| mesh.vertices[v as usize]);
                assert!(
                    once.surface[42..]
                        .iter()
                        .any(|m| (m - (p + q) / 2.0).norm() < 1e-12)
                );
            }
        }
    }
}
