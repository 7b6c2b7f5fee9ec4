//! The rotation that is nearest to a matrix.

use nalgebra::Matrix3;

/// The rotation nearest to `m` in the Frobenius norm: its polar decomposition by SVD, with the
/// least singular direction reversed where the decomposition gives a reflection.
pub fn nearest_rotation(m: &Matrix3<f64>) -> Matrix3<f64> {
    let svd = m.svd(true, true);
    let (Some(mut u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Matrix3::identity();
    };
    if (u * v_t).determinant() < 0.0 {
        let smallest = svd.singular_values.imin();
        u.column_mut(smallest).neg_mut();
    }
    u * v_t
}
