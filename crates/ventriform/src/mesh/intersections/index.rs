//! A spatial index over the triangles of a changing mesh, to test new triangles against.
//!
//! Flips, vertex moves and removals ask before every change whether the new triangles would
//! intersect the others. A uniform grid finds the triangles nearby; each is then tested
//! exactly ([`triangles_intersect`]). The answer is that of a test of all triangles.

use super::pair::triangles_intersect;
use crate::base::geometry::bvh::Aabb;
use crate::base::geometry::{Vec3, triangle};
use crate::mesh::ids::{FaceId, VertexId, typed};

/// Largest number of cells along one axis; limits the memory for very long shapes.
const MOST_CELLS: f64 = 128.0;

/// The triangles of a mesh in a uniform grid, updated as edges flip, vertices move and triangles
/// are added or removed.
///
/// The index has its own copy of the corners: after a vertex has moved, call
/// [`set`](Self::set) for every triangle around it. A query takes about as many exact tests as
/// there are triangles that overlap the queried one's bounding box.
///
/// A flip that replaces the triangles `t0` and `t1` by `n0` and `n1` adds no self-intersection
/// if none of `index.intersects(n0, p0, &[t0, t1])`, `index.intersects(n1, p1, &[t0, t1])` and
/// `triangles_intersect(n0, p0, n1, p1)` is true.
#[derive(Debug, Clone)]
pub struct IntersectionIndex {
    origin: Vec3,
    cell: f64,
    shape: [usize; 3],
    cells: Vec<Vec<FaceId>>,
    entries: Vec<Option<Entry>>,
}

#[derive(Debug, Clone)]
struct Entry {
    ids: [VertexId; 3],
    corners: [Vec3; 3],
    aabb: Aabb,
}

impl IntersectionIndex {
    /// An index over `triangles`, numbered by their order. `cell` is the grid's spacing in
    /// millimetres: about the edge length of the triangles that will be queried.
    ///
    /// Positions must be finite. Triangles set later may lie outside the bounding box of the
    /// first ones: queries stay correct but take longer.
    pub fn new(vertices: &[Vec3], triangles: &[[u32; 3]], cell: f64) -> Self {
        let bounds = Aabb::around(triangles.iter().flatten().map(|v| &vertices[*v as usize]));
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
        for (t, ids) in FaceId::first(triangles.len()).zip(triangles) {
            index.set(t, typed(*ids), ids.map(|v| vertices[v as usize]));
        }
        index
    }

    /// Adds triangle `t`, or replaces it, with these vertices at these positions.
    pub fn set(&mut self, t: FaceId, ids: [VertexId; 3], corners: [Vec3; 3]) {
        self.remove(t);
        let aabb = Aabb::around(&corners);
        for cell in self.covered(&corners, &aabb) {
            self.cells[cell].push(t);
        }
        if self.entries.len() <= t.index() {
            self.entries.resize(t.index() + 1, None);
        }
        self.entries[t.index()] = Some(Entry { ids, corners, aabb });
    }

    /// Removes triangle `t`, if it is there.
    pub fn remove(&mut self, t: FaceId) {
        let Some(entry) = self.entries.get_mut(t.index()).and_then(Option::take) else {
            return;
        };
        for cell in self.covered(&entry.corners, &entry.aabb) {
            self.cells[cell].retain(|other| *other != t);
        }
    }

    /// Whether a triangle with these vertices would intersect any indexed triangle, except those
    /// of `except`, in more than shared vertices and edges.
    pub fn intersects(&self, ids: [VertexId; 3], corners: &[Vec3; 3], except: &[FaceId]) -> bool {
        self.first_intersecting(ids, corners, except).is_some()
    }

    /// The lowest numbered triangle that makes [`intersects`](Self::intersects) true.
    pub fn first_intersecting(
        &self,
        ids: [VertexId; 3],
        corners: &[Vec3; 3],
        except: &[FaceId],
    ) -> Option<FaceId> {
        let aabb = Aabb::around(corners);
        let mut near: Vec<FaceId> = Vec::with_capacity(64);
        for cell in self.covered(corners, &aabb) {
            near.extend(self.cells[cell].iter().filter(|t| {
                self.entries[t.index()]
                    .as_ref()
                    .is_some_and(|entry| entry.aabb.overlaps(&aabb))
            }));
        }
        near.sort_unstable();
        near.dedup();
        near.into_iter().find(|t| {
            !except.contains(t)
                && self.entries[t.index()].as_ref().is_some_and(|entry| {
                    triangles_intersect(ids, corners, entry.ids, &entry.corners)
                })
        })
    }

    /// The cells that a triangle may touch: those that its bounding box touches, except those
    /// that its plane misses. The border cells stand for everything beyond the grid as well.
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

    /// The triangle's plane in units of cells. `None` where testing against it would not pay,
    /// or where a border cell is concerned, which stands for more than its own box.
    fn plane(&self, corners: &[Vec3; 3], low: [usize; 3], high: [usize; 3]) -> Option<CellPlane> {
        let inside = (0..3).all(|axis| low[axis] > 0 && high[axis] + 1 < self.shape[axis]);
        let cells: usize = (0..3).map(|axis| high[axis] - low[axis] + 1).product();
        if !inside || cells < 12 {
            return None;
        }
        let [a, b, c] = corners;
        let normal = triangle::area_normal(a, b, c).try_normalize(0.0)?;
        Some(CellPlane {
            normal,
            // The centre of a cell lies half a cell from its lowest corner.
            offset: normal.dot(&((a - self.origin) / self.cell - Vec3::repeat(0.5))),
            // The added hundredth exceeds all rounding of the normal and the offset.
            reach: normal.abs().sum() / 2.0 + 0.01,
        })
    }
}

/// A plane in the coordinates of the grid, one cell wide.
#[derive(Debug, Clone, Copy)]
struct CellPlane {
    normal: Vec3,
    offset: f64,
    /// Distance from a cell's centre to the plane up to which the plane touches the cell.
    reach: f64,
}

impl CellPlane {
    fn touches(&self, cell: [usize; 3]) -> bool {
        let centre = Vec3::from(cell.map(|x| x as f64));
        (self.normal.dot(&centre) - self.offset).abs() <= self.reach
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::random::{Purpose, stream};
    use crate::mesh::shapes;
    use rand::RngExt;

    #[test]
    fn agrees_with_a_test_of_all_triangles_while_the_mesh_changes() {
        let mut mesh = shapes::torus(9.0, 3.0, 24, 12);
        let mut index = IntersectionIndex::new(&mesh.vertices, &mesh.triangles, 1.5);
        let mut rng = stream(3, Purpose::Measure);
        let mut intersecting = 0;
        let count = mesh.triangles.len();
        for _ in 0..400 {
            // Move one vertex, update the index, and query a random triangle.
            let v = rng.random_range(0..mesh.vertices.len() as u32);
            mesh.vertices[v as usize] += Vec3::from_fn(|_, _| rng.random_range(-4.0..4.0));
            for t in FaceId::first(count) {
                if mesh.corner_ids(t).contains(&VertexId(v)) {
                    index.set(t, mesh.corner_ids(t), mesh.corners(t.index()));
                }
            }
            let queried = FaceId::from_index(rng.random_range(0..count));
            let (ids, corners) = (mesh.corner_ids(queried), mesh.corners(queried.index()));
            let expected = FaceId::first(count).any(|t| {
                let (others, p) = (mesh.corner_ids(t), mesh.corners(t.index()));
                t != queried && triangles_intersect(ids, &corners, others, &p)
            });
            assert_eq!(index.intersects(ids, &corners, &[queried]), expected);
            intersecting += usize::from(expected);
        }
        assert!((20..380).contains(&intersecting));
    }

    #[test]
    fn removed_triangles_are_not_found() {
        let mesh = shapes::tetrahedron(2.0);
        let mut index = IntersectionIndex::new(&mesh.vertices, &mesh.triangles, 1.0);
        // It leaves through the face opposite to vertex 0.
        let spike = [[0.0, 0.0, 0.0], [-9.0, -9.0, -9.0], [-9.0, -9.0, -8.0]].map(Vec3::from);
        let ids = typed([7, 8, 9]);
        let found = index.first_intersecting(ids, &spike, &[]).unwrap();
        index.remove(found);
        assert!(!index.intersects(ids, &spike, &[]));
    }
}
