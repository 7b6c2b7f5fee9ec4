//! Triangles that change, and the question whether one more would pierce them.

use super::pair::triangles_intersect;
use crate::geometry::bvh::Aabb;
use crate::geometry::{Vec3, triangle};

/// Most cells of the grid along one axis: bounds the memory of odd shapes.
const MOST_CELLS: f64 = 128.0;

/// The triangles of a mesh in a uniform grid, kept up to date while edges flip, vertices move
/// or triangles come and go.
///
/// It holds its own copy of the corners, so it sees exactly what [`set`](Self::set) told it:
/// after a vertex has moved, `set` every triangle around it. A query costs about as many
/// exact tests as there are triangles within a triangle's box.
///
/// A flip of the edge between triangles `t0` and `t1` into `n0` and `n1` keeps a mesh free of
/// self-intersections where neither of `index.pierces(n0, p0, &[t0, t1])`,
/// `index.pierces(n1, p1, &[t0, t1])` and `triangles_intersect(n0, p0, n1, p1)` holds.
#[derive(Debug, Clone)]
pub struct IntersectionIndex {
    origin: Vec3,
    cell: f64,
    shape: [usize; 3],
    cells: Vec<Vec<u32>>,
    entries: Vec<Option<Entry>>,
}

#[derive(Debug, Clone)]
struct Entry {
    ids: [u32; 3],
    corners: [Vec3; 3],
    aabb: Aabb,
}

impl IntersectionIndex {
    /// An index over `triangles`, numbered as they stand. `cell` is the grid's spacing in
    /// millimetres: about the edge length of the triangles that will be asked for.
    ///
    /// Positions must be finite. Later triangles may lie outside of the first ones' box;
    /// queries stay right and grow slower.
    pub fn new(vertices: &[Vec3], triangles: &[[u32; 3]], cell: f64) -> Self {
        let bounds = Aabb::of(triangles.iter().flatten().map(|v| &vertices[*v as usize]));
        let extent = bounds.max - bounds.min;
        let cell = cell
            .max(extent.max() / MOST_CELLS)
            .max(f64::MIN_POSITIVE.sqrt());
        let shape = [0, 1, 2].map(|axis| (extent[axis] / cell).max(0.0) as usize + 1);
        let mut index = Self {
            origin: bounds.min,
            cell,
            shape,
            cells: vec![Vec::new(); shape.iter().product()],
            entries: vec![None; triangles.len()],
        };
        for (t, ids) in (0..).zip(triangles) {
            index.set(t, *ids, ids.map(|v| vertices[v as usize]));
        }
        index
    }

    /// Triangle `t` now has these vertices at these positions; new numbers are welcome.
    pub fn set(&mut self, t: u32, ids: [u32; 3], corners: [Vec3; 3]) {
        self.remove(t);
        let aabb = Aabb::of(&corners);
        for cell in self.covered(&corners, &aabb) {
            self.cells[cell].push(t);
        }
        if self.entries.len() <= t as usize {
            self.entries.resize(t as usize + 1, None);
        }
        self.entries[t as usize] = Some(Entry { ids, corners, aabb });
    }

    /// Triangle `t` is no more.
    pub fn remove(&mut self, t: u32) {
        let Some(entry) = self.entries.get_mut(t as usize).and_then(Option::take) else {
            return;
        };
        for cell in self.covered(&entry.corners, &entry.aabb) {
            self.cells[cell].retain(|other| *other != t);
        }
    }

    /// Whether a triangle with these vertices would meet any triangle but those of `except`
    /// in more than shared vertices and edges.
    pub fn pierces(&self, ids: [u32; 3], corners: &[Vec3; 3], except: &[u32]) -> bool {
        self.first_pierced(ids, corners, except).is_some()
    }

    /// The lowest numbered triangle that makes [`pierces`](Self::pierces) true.
    pub fn first_pierced(&self, ids: [u32; 3], corners: &[Vec3; 3], except: &[u32]) -> Option<u32> {
        let aabb = Aabb::of(corners);
        let mut near: Vec<u32> = Vec::with_capacity(64);
        for cell in self.covered(corners, &aabb) {
            near.extend(self.cells[cell].iter().filter(|t| {
                self.entries[**t as usize]
                    .as_ref()
                    .is_some_and(|entry| entry.aabb.overlaps(&aabb))
            }));
        }
        near.sort_unstable();
        near.dedup();
        near.into_iter().find(|t| {
            !except.contains(t)
                && self.entries[*t as usize].as_ref().is_some_and(|entry| {
                    triangles_intersect(ids, corners, entry.ids, &entry.corners)
                })
        })
    }

    /// The cells that a triangle may touch: those that its box touches, without those that
    /// lie beside its plane. Everything outside of the grid belongs to the grid's border.
    fn covered(&self, corners: &[Vec3; 3], aabb: &Aabb) -> impl Iterator<Item = usize> + use<> {
        let (low, high) = (self.place(&aabb.min), self.place(&aabb.max));
        let plane = self.plane(corners, low, high);
        let shape = self.shape;
        (low[2]..=high[2]).flat_map(move |k| {
            (low[1]..=high[1]).flat_map(move |j| {
                (low[0]..=high[0])
                    .filter(move |&i| plane.is_none_or(|plane| plane.touches([i, j, k])))
                    .map(move |i| (k * shape[1] + j) * shape[0] + i)
            })
        })
    }

    fn place(&self, p: &Vec3) -> [usize; 3] {
        [0, 1, 2].map(|axis| {
            let place = ((p[axis] - self.origin[axis]) / self.cell).max(0.0) as usize;
            place.min(self.shape[axis] - 1)
        })
    }

    /// The triangle's plane in units of cells, where asking it pays and no cell of the border
    /// is concerned, which stands for more than its own box.
    fn plane(&self, corners: &[Vec3; 3], low: [usize; 3], high: [usize; 3]) -> Option<Plane> {
        let inside = (0..3).all(|axis| low[axis] > 0 && high[axis] + 1 < self.shape[axis]);
        let cells: usize = (0..3).map(|axis| high[axis] - low[axis] + 1).product();
        if !inside || cells < 12 {
            return None;
        }
        let [a, b, c] = corners;
        let normal = triangle::area_normal(a, b, c).try_normalize(0.0)?;
        Some(Plane {
            normal,
            // Centres of cells lie half a cell from their lowest corner.
            offset: normal.dot(&((a - self.origin) / self.cell - Vec3::repeat(0.5))),
            // Rounding of the normal and the offset stays far below the hundredth.
            reach: normal.abs().sum() / 2.0 + 0.01,
        })
    }
}

/// A plane among the cells of a grid.
#[derive(Debug, Clone, Copy)]
struct Plane {
    normal: Vec3,
    offset: f64,
    reach: f64,
}

impl Plane {
    fn touches(&self, cell: [usize; 3]) -> bool {
        let centre = Vec3::from(cell.map(|x| x as f64));
        (self.normal.dot(&centre) - self.offset).abs() <= self.reach
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::random::{Purpose, stream};
    use crate::mesh::shapes;
    use rand::RngExt;

    #[test]
    fn answers_as_a_search_through_all_triangles_while_the_mesh_changes() {
        let mut mesh = shapes::torus(9.0, 3.0, 24, 12);
        let mut index = IntersectionIndex::new(&mesh.vertices, &mesh.triangles, 1.5);
        let mut rng = stream(3, Purpose::Measure);
        let mut pierced = 0;
        for _ in 0..400 {
            // Jolt one vertex, tell the index, and ask for a random triangle.
            let v = rng.random_range(0..mesh.vertices.len() as u32);
            mesh.vertices[v as usize] += Vec3::from_fn(|_, _| rng.random_range(-4.0..4.0));
            for t in 0..mesh.triangles.len() {
                if mesh.triangles[t].contains(&v) {
                    index.set(t as u32, mesh.triangles[t], mesh.corners(t));
                }
            }
            let asked = rng.random_range(0..mesh.triangles.len());
            let (ids, corners) = (mesh.triangles[asked], mesh.corners(asked));
            let except = [asked as u32];
            let expected = (0..mesh.triangles.len()).any(|t| {
                t != asked
                    && triangles_intersect(ids, &corners, mesh.triangles[t], &mesh.corners(t))
            });
            assert_eq!(index.pierces(ids, &corners, &except), expected);
            pierced += usize::from(expected);
        }
        assert!((20..380).contains(&pierced));
    }

    #[test]
    fn removed_triangles_are_not_met() {
        let mesh = shapes::tetrahedron(2.0);
        let mut index = IntersectionIndex::new(&mesh.vertices, &mesh.triangles, 1.0);
        // It leaves through the face opposite to vertex 0.
        let spike = [[0.0, 0.0, 0.0], [-9.0, -9.0, -9.0], [-9.0, -9.0, -8.0]].map(Vec3::from);
        let met = index.first_pierced([7, 8, 9], &spike, &[]).unwrap();
        index.remove(met);
        assert!(!index.pierces([7, 8, 9], &spike, &[]));
    }
}
