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
//! meet there. Crossings are sorted by column and then within each. O(triangles + columns + crossings).

use robust::{Coord, orient2d};

use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::{Cancelled, Monitor};
use crate::mesh::TriMesh;

/// Crossings, or columns, between two looks at the cancel token.
const CROSSINGS_PER_CHECK: usize = 1 << 16;

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
///
/// # Errors
/// [`Cancelled`].
pub fn voxelise(
    mesh: &TriMesh,
    shape: [usize; 3],
    frame: &VoxelToPatient,
    monitor: &Monitor,
) -> Result<Mask, Cancelled> {
    let corners: Vec<Vec3> = mesh.vertices.iter().map(|p| frame.to_voxel(p)).collect();
    let mut crossings: Vec<(u32, f64)> = Vec::new();
    for triangle in &mesh.triangles {
        monitor.check()?;
        let corners = triangle.map(|v| corners[v as usize]);
        cross_columns(&corners, shape, &mut crossings);
    }
    let mut mask = Mask::empty(shape);
    let (mut sorted, ends) = by_column(&crossings, shape[1] * shape[2], monitor)?;
    let mut begin = 0;
    for (column, end) in ends.into_iter().enumerate() {
        if column.is_multiple_of(CROSSINGS_PER_CHECK) {
            monitor.check()?;
        }
        let column_crossings = &mut sorted[begin..end];
        begin = end;
        column_crossings.sort_unstable_by(f64::total_cmp);
        let row = column * shape[0];
        for pair in column_crossings.chunks_exact(2) {
            let first = pair[0].ceil().max(0.0) as usize;
            let end = (pair[1].ceil().max(0.0) as usize).min(shape[0]);
            if first < end {
                mask.voxels[row + first..row + end].fill(true);
            }
        }
    }
    Ok(mask)
}

/// The places along i of all crossings, those of a column together, and the end of each column.
fn by_column(
    crossings: &[(u32, f64)],
    columns: usize,
    monitor: &Monitor,
) -> Result<(Vec<f64>, Vec<usize>), Cancelled> {
    let mut ends = vec![0_usize; columns];
    for part in crossings.chunks(CROSSINGS_PER_CHECK) {
        monitor.check()?;
        for (column, _) in part {
            ends[*column as usize] += 1;
        }
    }
    let mut before = 0;
    for end in &mut ends {
        // The place of the column's next crossing, which is its end after the last.
        before += std::mem::replace(end, before);
    }
    let mut sorted = vec![0.0; crossings.len()];
    for part in crossings.chunks(CROSSINGS_PER_CHECK) {
        monitor.check()?;
        for (column, i) in part {
            let place = &mut ends[*column as usize];
            sorted[*place] = *i;
            *place += 1;
        }
    }
    Ok((sorted, ends))
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
    use crate::image::grid::voxelise::*;
    use crate::mesh::shapes;

    fn frame() -> VoxelToPatient {
        VoxelToPatient::centred([40, 41, 42], [1.0, 1.1, 1.3], Vec3::zeros()).unwrap()
    }

    #[test]
    fn a_torus_is_filled_where_its_formula_says() {
        // Against the triangles' own winding number, brute force.
        let mesh = shapes::torus(11.0, 5.0, 31, 17);
        let mask = voxelise(&mesh, [40, 41, 42], &frame(), &Monitor::silent()).unwrap();
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
        let mask = voxelise(&mesh, [21, 21, 21], &frame, &Monitor::silent()).unwrap();
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
        let count = |mesh: &TriMesh| {
            let mask = voxelise(mesh, [40, 41, 42], &frame(), &Monitor::silent());
            mask.unwrap().count()
        };
        let mut mesh = shapes::icosphere(60.0, 2);
        assert_eq!(count(&mesh), 40 * 41 * 42);
        mesh.vertices.iter_mut().for_each(|p| p.x += 500.0);
        assert_eq!(count(&mesh), 0);
    }
}
