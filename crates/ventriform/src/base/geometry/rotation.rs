//! The rotation that is nearest to a matrix, and the least one between two directions.

use super::Vec3;
use nalgebra::{Matrix3, Rotation3};

/// The least determinant, relative to the cube of the Frobenius norm, of matrices that Newton's iteration decomposes:
/// their rotation is as exact as that of the SVD.
const LEAST_DETERMINANT: f64 = 1e-7;
/// Most rounds of Newton's iteration; matrices above [`LEAST_DETERMINANT`] take four to nine.
const MAX_NEWTON_ROUNDS: usize = 20;
/// Square of a round's change in the Frobenius norm below which the next round would change nothing: the change is
/// squared from round to round.
const NEWTON_TOLERANCE_SQUARED: f64 = 1e-17;

/// The rotation nearest to `m` in the Frobenius norm: its polar decomposition, with the
/// least singular direction reversed where the decomposition gives a reflection.
pub fn nearest_rotation(m: &Matrix3<f64>) -> Matrix3<f64> {
    polar_rotation(m).unwrap_or_else(|| nearest_rotation_by_svd(m))
}

/// The rotation of the polar decomposition of `m` by Newton's iteration X ← (s X + X^-T / s) / 2 with scale s (Higham
/// 1986), a tenth of the work of an SVD; `None` where `m` is a reflection or nearly singular.
fn polar_rotation(m: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let mut x = *m;
    for round in 0..MAX_NEWTON_ROUNDS {
        let [a, b, c] = [0, 1, 2].map(|k| x.column(k).into_owned());
        let cofactors = [b.cross(&c), c.cross(&a), a.cross(&b)];
        let determinant = a.dot(&cofactors[0]);
        let squares = x.norm_squared();
        // False for NaN.
        let is_regular = determinant > LEAST_DETERMINANT * squares * squares.sqrt();
        if round == 0 && !is_regular {
            return None;
        }
        let inverse = Matrix3::from_columns(&cofactors) / determinant;
        let scale = (inverse.norm_squared() / squares).sqrt().sqrt();
        let next = (x * scale + inverse / scale) * 0.5;
        let change = (next - x).norm_squared();
        x = next;
        if change < NEWTON_TOLERANCE_SQUARED {
            return Some(x);
        }
    }
    None
}

fn nearest_rotation_by_svd(m: &Matrix3<f64>) -> Matrix3<f64> {
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

/// The similarity that maps points to others best, in the sense of least squares: about the mean of the ones, a turn and a
/// scale, and then to the mean of the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointAlignment {
    /// Mean of the points that are mapped.
    pub from: Vec3,
    /// Mean of those that they are mapped to.
    pub to: Vec3,
    /// The turn.
    pub turn: Matrix3<f64>,
    /// The scale.
    pub scale: f64,
}

impl PointAlignment {
    /// That of the points `from` to the points `to`, each to the one with its number.
    pub fn between(from: &[Vec3], to: &[Vec3]) -> Self {
        let mean = |points: &[Vec3]| points.iter().sum::<Vec3>() / points.len() as f64;
        let means = (mean(from), mean(to));
        let (mut moment, mut spread) = (Matrix3::zeros(), 0.0);
        for (p, q) in from.iter().zip(to) {
            moment += (q - means.1) * (p - means.0).transpose();
            spread += (p - means.0).norm_squared();
        }
        let turn = nearest_rotation(&moment);
        Self {
            from: means.0,
            to: means.1,
            turn,
            scale: (turn.transpose() * moment).trace() / spread,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stretches along three directions, by factors down to the least that the iteration takes, after a turn.
    #[test]
    fn the_iteration_finds_the_rotation_of_the_svd() {
        let mut iterated = 0;
        for n in 0..3000 {
            let t = f64::from(n);
            let angles = [1.3, 0.7, 2.1].map(|rate| 4.0 * (rate * t).sin());
            let [turn, axes] = [1.0, -0.6].map(|factor| {
                let [a, b, c] = angles.map(|angle| factor * angle);
                Rotation3::from_euler_angles(a, b, c).into_inner()
            });
            // The least of the three from 1 to 1e-9, the others between it and 1.
            let least = 10f64.powf(-t / 333.0);
            let stretch = Matrix3::from_diagonal(&Vec3::new(1.0, least.powf(0.3), least));
            let size = 10f64.powf(6.0 * (0.3 * t).sin());
            let m = turn * axes * stretch * axes.transpose() * size;
            let found = nearest_rotation(&m);
            let allowed = 1e-12 / least.powf(0.3);
            assert!(
                (found - turn).norm() < allowed,
                "{n}: {}",
                (found - turn).norm()
            );
            assert!((found - nearest_rotation_by_svd(&m)).norm() < allowed);
            assert!((found.determinant() - 1.0).abs() < 1e-12);
            iterated += usize::from(polar_rotation(&m).is_some());
        }
        assert!((1000..3000).contains(&iterated), "{iterated}");
        // Reflections, singular matrices and what is no number are the SVD's.
        let reflection = Matrix3::from_diagonal(&Vec3::new(3.0, 2.0, -1.0));
        for m in [
            reflection,
            Matrix3::zeros(),
            Matrix3::repeat(1.0),
            reflection * f64::NAN,
        ] {
            assert!(polar_rotation(&m).is_none());
        }
        assert!((nearest_rotation(&reflection) - Matrix3::identity()).norm() < 1e-12);
    }

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
