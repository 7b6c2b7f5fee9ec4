//! The rotation that is nearest to a matrix, and the least one between two directions.

use super::Vec3;
use nalgebra::{Matrix3, Rotation3};

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

/// The least rotation that takes the unit vector `from` to the unit vector `to`; `None` for opposite ones.
/// Equal vectors give no rotation, also where rounding makes their scalar product exceed 1.
pub fn least_rotation(from: &Vec3, to: &Vec3) -> Option<Rotation3<f64>> {
    if (from - to).norm() < 1e-9 {
        Some(Rotation3::identity())
    } else {
        Rotation3::rotation_between(from, to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_that_differ_by_rounding_are_not_turned() {
        for k in 0..200 {
            let from = Vec3::new(0.3 + 0.01 * f64::from(k), -0.6, -0.48).normalize();
            let to = (from + Vec3::new(1e-16, -2e-16, 1e-16)).normalize();
            for to in [to, from] {
                let turn = least_rotation(&from, &to).unwrap();
                assert!((turn * from - to).norm() < 1e-12, "{k}: {turn}");
            }
        }
        let turn = least_rotation(&Vec3::x(), &Vec3::y()).unwrap();
        assert!((turn * Vec3::x() - Vec3::y()).norm() < 1e-12);
    }
}
