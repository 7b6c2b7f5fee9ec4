//! Geometry of a single triangle: normal, shape, closest point, ray intersection.
//!
//! Corners are in millimetres and counter-clockwise seen from outside.

use super::Vec3;

/// The outward normal of the triangle, twice its area long, mm².
pub fn area_normal(a: &Vec3, b: &Vec3, c: &Vec3) -> Vec3 {
    (b - a).cross(&(c - a))
}

/// The unit outward normal; zero for a degenerate triangle.
pub fn unit_normal([a, b, c]: &[Vec3; 3]) -> Vec3 {
    area_normal(a, b, c)
        .try_normalize(0.0)
        .unwrap_or_else(Vec3::zeros)
}

/// The radius ratio 2r/R of inscribed and circumscribed circle: 1 for an equilateral triangle,
/// 0 for a degenerate one.
pub fn radius_ratio(a: &Vec3, b: &Vec3, c: &Vec3) -> f64 {
    let (la, lb, lc) = ((b - c).norm(), (c - a).norm(), (a - b).norm());
    let doubled_area = area_normal(a, b, c).norm();
    let product = la * lb * lc * (la + lb + lc) / 2.0;
    if product > 0.0 {
        // r = A/s, R = abc/(4A), hence 2r/R = 8A²/(abc·s).
        2.0 * doubled_area * doubled_area / product
    } else {
        0.0
    }
}

/// The angle between two vectors of any length, 0..=π; accurate near 0 and π as well.
pub fn angle_between(n0: &Vec3, n1: &Vec3) -> f64 {
    n0.cross(n1).norm().atan2(n0.dot(n1))
}

/// The barycentric coordinates of the point of triangle `a b c` that is closest to `p`
/// (Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5).
#[inline]
pub fn closest_barycentric(p: &Vec3, a: &Vec3, b: &Vec3, c: &Vec3) -> [f64; 3] {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = d1 / (d1 - d3);
        return [1.0 - v, v, 0.0];
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = d2 / (d2 - d6);
        return [1.0 - w, 0.0, w];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - w, w];
    }
    let denominator = 1.0 / (va + vb + vc);
    let (v, w) = (vb * denominator, vc * denominator);
    [1.0 - v - w, v, w]
}

/// The distance from `start` along a ray to the triangle `a b c`, in lengths of `direction`;
/// `None` if the ray misses the triangle (Möller and Trumbore 1997).
pub fn ray_distance(start: &Vec3, direction: &Vec3, a: &Vec3, b: &Vec3, c: &Vec3) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(&ac);
    let determinant = ab.dot(&p);
    if determinant == 0.0 {
        return None;
    }
    let s = start - a;
    let u = s.dot(&p) / determinant;
    let q = s.cross(&ab);
    let v = direction.dot(&q) / determinant;
    let t = ac.dot(&q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equilateral_triangle_has_radius_ratio_one() {
        let a = Vec3::new(0.0, 0.0, 0.0);
        let b = Vec3::new(2.0, 0.0, 0.0);
        let c = Vec3::new(1.0, 3f64.sqrt(), 0.0);
        assert!((radius_ratio(&a, &b, &c) - 1.0).abs() < 1e-12);
        assert_eq!(radius_ratio(&a, &b, &Vec3::new(1.0, 0.0, 0.0)), 0.0);
    }

    #[test]
    fn closest_point_beats_a_dense_sampling_of_the_triangle() {
        let (a, b, c) = (
            Vec3::new(0.0, 0.0, 0.0),
            Vec3::new(3.0, 0.2, 0.1),
            Vec3::new(0.5, 2.0, -0.4),
        );
        for p in [
            Vec3::new(-1.0, -1.0, 1.0),
            Vec3::new(1.0, 0.5, 2.0),
            Vec3::new(4.0, 0.0, 0.0),
            Vec3::new(2.0, 2.0, 0.5),
            Vec3::new(0.0, 3.0, 0.0),
            Vec3::new(1.0, -1.0, 0.0),
        ] {
            let [u, v, w] = closest_barycentric(&p, &a, &b, &c);
            assert!((u + v + w - 1.0).abs() < 1e-12 && u >= 0.0 && v >= 0.0 && w >= 0.0);
            let found = (a * u + b * v + c * w - p).norm();
            for i in 0..=100 {
                for j in 0..=(100 - i) {
                    let (s, t) = (f64::from(i) / 100.0, f64::from(j) / 100.0);
                    let q = a * (1.0 - s - t) + b * s + c * t;
                    assert!(found <= (q - p).norm() + 1e-12);
                }
            }
        }
    }
}
