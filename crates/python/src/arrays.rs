//! Voxels and meshes as NumPy arrays.

use crate::errors::{exception, refused};
use numpy::npyffi::NPY_ORDER;
use numpy::{Element, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::mesh::TriMesh;

/// Voxels, i fastest, as an array (i, j, k) in Fortran order, without a copy.
pub fn voxels<T: Element>(
    py: Python<'_>,
    voxels: Vec<T>,
    shape: [usize; 3],
) -> PyResult<Bound<'_, PyArray3<T>>> {
    PyArray1::from_vec(py, voxels).reshape_with_order(shape, NPY_ORDER::NPY_FORTRANORDER)
}

/// Positions, LPS mm, as an array (n, 3).
pub fn positions<'py>(py: Python<'py>, positions: &[Vec3]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Vec<f64> = positions.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    PyArray1::from_vec(py, flat).reshape([positions.len(), 3])
}

/// The corners of triangles as an array (m, 3).
pub fn corners<'py>(
    py: Python<'py>,
    triangles: &[[u32; 3]],
) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let flat = triangles.iter().flatten();
    let flat: Vec<i32> = flat
        .map(|v| i32::try_from(*v).unwrap_or(i32::MAX))
        .collect();
    PyArray1::from_vec(py, flat).reshape([triangles.len(), 3])
}

/// Vertices and triangles of a mesh.
pub type MeshArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<i32>>);

/// A mesh as arrays.
pub fn mesh<'py>(py: Python<'py>, mesh: &TriMesh) -> PyResult<MeshArrays<'py>> {
    Ok((
        positions(py, &mesh.vertices)?,
        corners(py, &mesh.triangles)?,
    ))
}

/// The mesh of vertices, LPS mm, and triangles.
pub fn to_mesh(py: Python<'_>, vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> PyResult<TriMesh> {
    let finite = vertices.iter().flatten().all(|x| x.is_finite());
    let known = |corner: &u32| (*corner as usize) < vertices.len();
    if !finite || !triangles.iter().flatten().all(known) {
        let reason = "a vertex is not finite, or a triangle refers to a vertex that does not exist";
        return Err(exception(
            py,
            &refused("mesh", reason, "Give a closed surface."),
        ));
    }
    Ok(TriMesh {
        vertices: vertices.iter().map(|p| Vec3::from(*p)).collect(),
        triangles: triangles.to_vec(),
    })
}

/// The rows of the affine from voxel indices to LPS mm.
pub fn affine(frame: &VoxelToPatient) -> [[f64; 4]; 4] {
    // Adding 0 turns negative zeros into positive ones.
    let matrix = frame.matrix().add_scalar(0.0);
    [0, 1, 2, 3].map(|r| [0, 1, 2, 3].map(|c| matrix[(r, c)]))
}
