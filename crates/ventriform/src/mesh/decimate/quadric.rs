//! Quadrics: weighted sums of squared distances to planes (Garland and Heckbert 1997, section 4).

use nalgebra::Matrix3;

use crate::base::geometry::Vec3;

/// Fraction of the largest singular value below which singular values count as zero. In their
/// directions, along a ridge or on a flat part, all points have about the same error, and the
/// one nearest to the edge is taken.
const RANK_TOLERANCE: f64 = 1e-3;

/// Q(x) = xᵀ A x + 2 bᵀ x + c = Σ area · (distance of x from a plane)², mm⁴.
#[derive(Debug, Clone, Copy)]
pub struct Quadric {
    a: Matrix3<f64>,
    b: Vec3,
    c: f64,
}

impl Quadric {
    /// The quadric of no planes.
    pub fn zero() -> Self {
        Self {
            a: Matrix3::zeros(),
            b: Vec3::zeros(),
            c: 0.0,
        }
    }

    /// The quadric of a triangle's plane through `p`; `area_normal` is the triangle's normal, twice
    /// its area long.
    pub fn of_plane(area_normal: &Vec3, p: &Vec3) -> Self {
        let length = area_normal.norm();
        if length == 0.0 {
            return Self::zero();
        }
        let (n, area) = (area_normal / length, 0.5 * length);
        let d = -n.dot(p);
        Self {
            a: n * n.transpose() * area,
            b: n * (d * area),
            c: d * d * area,
        }
    }

    /// The sum of two quadrics.
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            a: self.a + other.a,
            b: self.b + other.b,
            c: self.c + other.c,
        }
    }

    /// Q(x), at least zero: rounding errors below zero are removed.
    pub fn at(&self, x: &Vec3) -> f64 {
        (x.dot(&(self.a * x)) + 2.0 * self.b.dot(x) + self.c).max(0.0)
    }

    /// The point of smallest error; of several the one nearest to `near`.
    pub fn best_near(&self, near: &Vec3) -> Vec3 {
        let svd = self.a.svd(true, true);
        let tolerance = RANK_TOLERANCE * svd.singular_values.max();
        let gradient = -(self.b + self.a * near);
        svd.solve(&gradient, tolerance)
            .map_or(*near, |step| near + step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_planes_meet_in_their_corner() {
        let corner = Vec3::new(1.0, -2.0, 3.0);
        let planes = [Vec3::x(), Vec3::y(), Vec3::z()];
        let sum = planes.iter().fold(Quadric::zero(), |q, n| {
            q.plus(&Quadric::of_plane(&(n * 2.0), &corner))
        });
        assert!((sum.best_near(&Vec3::zeros()) - corner).norm() < 1e-12);
        // One unit away from each of three planes of area 1.
        assert!((sum.at(&(corner + Vec3::repeat(1.0))) - 3.0).abs() < 1e-12);
    }

    #[test]
    fn with_a_single_plane_the_point_is_projected_onto_it() {
        let q = Quadric::of_plane(&(Vec3::z() * 4.0), &Vec3::new(0.0, 0.0, 5.0));
        let best = q.best_near(&Vec3::new(7.0, 8.0, 9.0));
        assert!((best - Vec3::new(7.0, 8.0, 5.0)).norm() < 1e-12);
    }
}
