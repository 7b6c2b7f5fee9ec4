//! The voxels whose centres lie inside a closed surface.
//!
//! **Partial-volume rule.** A voxel belongs to the mask if its *centre* lies inside the
//! surface; nothing is rounded up or smoothed. Volumes in millilitres are therefore taken
//! from the surface and not by counting voxels.
//!
//! Parity along the i axis: each triangle is projected on the plane of j and k, the columns
//! inside it are found with exact orientation tests, and the voxels between pairs of
//! crossings are set. A column that runs exactly through an edge or a vertex is moved by a
//! symbolic epsilon (first j, then k), so that it crosses exactly one of the triangles that
//! meet there. O(triangles + columns + crossings).

use robust::{Coord, orient2d};

use crate::geometry::Vec3;
use crate::geometry::frame::VoxelToPatient;
use crate::mesh::TriMesh;

/// A binary volume, i fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Mask {
    /// Number of voxels along i, j, k.
    pub shape: [usize; 3],
    /// `shape[0] * shape[1] * shape[2]` entries.
    pub voxels: Vec<bool>,
}

impl Mask {
    /// A mask with nothing in it.
    pub fn empty(shape: [usize; 3]) -> Self {
        Self {
            shape,
            voxels: vec![false; shape.iter().product()],
        }
    }

    /// Number of voxels set.
    pub fn count(&self) -> usize {
        self.voxels.iter().filter(|v| **v).count()
    }
}

/// The voxels of the grid `shape` at `frame` whose centres lie inside the closed `mesh`
/// (LPS mm). Parts of the mesh beyond the grid are cut off.
pub fn voxelise(mesh: &TriMesh, shape: [usize; 3], frame: &VoxelToPatient) -> Mask {
    let corners: Vec<Vec3> = mesh.vertices.iter().map(|p| frame.to_voxel(p)).collect();
    let mut crossings: Vec<(u32, f64)> = Vec::new();
    for triangle in &mesh.triangles {
        let corners = triangle.map(|v| corners[v as usize]);
        cross_columns(&corners, shape, &mut crossings);
    }
    crossings.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut mask = Mask::empty(shape);
    for column in crossings.chunk_by(|a, b| a.0 == b.0) {
        let row = column[0].0 as usize * shape[0];
        for pair in column.chunks_exact(2) {
            let first = pair[0].1.ceil().max(0.0) as usize;
            let end = ((pair[1].1.ceil()).max(0.0) as usize).min(shape[0]);
            if first < end {
                mask.voxels[row + first..row + end].fill(true);
            }
        }
    }
    mask
}

/// Appends (column, i) for every column that passes through the triangle.
fn cross_columns(corners: &[Vec3; 3], shape: [usize; 3], crossings: &mut Vec<(u32, f64)>) {
    let range = |a: usize| {
        let low = corners.iter().map(|c| c[a]).fold(f64::INFINITY, f64::min);
        let high = corners
            .iter()
            .map(|c| c[a])
            .fold(f64::NEG_INFINITY, f64::max);
        let first = low.ceil().max(0.0) as usize;
        let last = high.floor().min(shape[a] as f64 - 1.0);
        first..=last.max(-1.0) as usize
    };
    let flat = corners.map(|c| Coord { x: c.y, y: c.z });
    let (js, ks) = (range(1), range(2));
    if corners.iter().any(|c| !c.iter().all(|x| x.is_finite())) {
        return;
    }
    for k in ks {
        for j in js.clone() {
            if j >= shape[1] || k >= shape[2] {
                continue;
            }
            let p = Coord {
                x: j as f64,
                y: k as f64,
            };
            let sides = [0, 1, 2].map(|e| side(flat[e], flat[(e + 1) % 3], p));
            if sides[0].0 == sides[1].0 && sides[1].0 == sides[2].0 {
                let weights = [sides[1].1, sides[2].1, sides[0].1];
                let total: f64 = weights.iter().sum();
                let i = if total == 0.0 {
                    corners[0].x
                } else {
                    (0..3).map(|c| weights[c] * corners[c].x).sum::<f64>() / total
                };
                crossings.push(((j + shape[1] * k) as u32, i));
            }
        }
    }
}

/// Whether `p`, moved by (eps, eps²), lies left of a → b, and the exact-sign area.
fn side(a: Coord<f64>, b: Coord<f64>, p: Coord<f64>) -> (bool, f64) {
    let area = orient2d(a, b, p);
    let left = if area != 0.0 {
        area > 0.0
    } else if a.y != b.y {
        // d(area)/dx = a.y - b.y.
        a.y > b.y
    } else {
        b.x > a.x
    };
    (left, area)
}

#[cfg(test)]
mod tests {
    use crate::grid::voxelise::*;
    use crate::mesh::shapes;

    fn frame() -> VoxelToPatient {
        VoxelToPatient::centred([40, 41, 42], [1.0, 1.1, 1.3], Vec3::zeros()).unwrap()
    }

    #[test]
    fn a_torus_is_filled_where_its_formula_says() {
        // Against the triangles' own winding number, brute force.
        let mesh = shapes::torus(11.0, 5.0, 31, 17);
        let mask = voxelise(&mesh, [40, 41, 42], &frame());
        let mut checked = 0;
        for k in (0..42).step_by(3) {
            for j in (0..41).step_by(3) {
                for i in 0..40 {
                    let p = frame().to_patient(&Vec3::new(i as f64, j as f64, k as f64));
                    let inside = winding(&mesh, &p) > 0.5;
                    assert_eq!(mask.voxels[i + 40 * (j + 41 * k)], inside, "{p:?}");
                    checked += usize::from(inside);
                }
            }
        }
        assert!(checked > 200);
    }

    /// Van Oosterom and Strackee's solid angles, summed.
    fn winding(mesh: &TriMesh, p: &Vec3) -> f64 {
        let solid: f64 = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t).map(|v| v - p);
                let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
                let d = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
                2.0 * a.dot(&b.cross(&c)).atan2(d)
            })
            .sum();
        solid / (4.0 * std::f64::consts::PI)
    }

    #[test]
    fn columns_through_edges_and_vertices_count_once() {
        // An octahedron with vertices on grid points: columns meet edges and vertices.
        let r = 5.0;
        let mesh = TriMesh {
            vertices: vec![
                Vec3::new(r, 0.0, 0.0),
                Vec3::new(-r, 0.0, 0.0),
                Vec3::new(0.0, r, 0.0),
                Vec3::new(0.0, -r, 0.0),
                Vec3::new(0.0, 0.0, r),
                Vec3::new(0.0, 0.0, -r),
            ],
            triangles: vec![
                [0, 2, 4],
                [2, 1, 4],
                [1, 3, 4],
                [3, 0, 4],
                [2, 0, 5],
                [1, 2, 5],
                [3, 1, 5],
                [0, 3, 5],
            ],
        };
        let frame = VoxelToPatient::centred([21, 21, 21], [1.0; 3], Vec3::zeros()).unwrap();
        let mask = voxelise(&mesh, [21, 21, 21], &frame);
        for k in -10i32..=10 {
            for j in -10i32..=10 {
                for i in -10i32..=10 {
                    let (inner, sum) = (
                        i.abs() + j.abs() + k.abs() < 5,
                        i.abs() + j.abs() + k.abs() > 5,
                    );
                    let v = (i + 10) + 21 * ((j + 10) + 21 * (k + 10));
                    if inner || sum {
                        assert_eq!(mask.voxels[v as usize], inner, "{i} {j} {k}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_mesh_beyond_the_grid_is_cut_off() {
        let mut mesh = shapes::icosphere(60.0, 2);
        assert_eq!(
            voxelise(&mesh, [40, 41, 42], &frame()).count(),
            40 * 41 * 42
        );
        mesh.vertices.iter_mut().for_each(|p| p.x += 500.0);
        assert_eq!(voxelise(&mesh, [40, 41, 42], &frame()).count(), 0);
    }
}
