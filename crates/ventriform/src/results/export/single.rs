//! Positions and normals in single precision, with all vertices kept distinct.
//!
//! Readers of STL, and many readers of GLB, join the corners of triangles by equal coordinates.
//! Rounding to `f32` may give two vertices the same position: at 200 mm its steps are 0.000 015
//! mm. In that case the later vertex is moved along x by as few steps as make it distinct, at
//! most [`MAX_STEPS`].

use std::collections::BTreeSet;

use super::ExportError;
use crate::base::geometry::Vec3;

/// Largest number of `f32` steps by which a vertex is moved. More would be needed only if dozens
/// of vertices had the same position, and single precision is not suitable for such a mesh.
const MAX_STEPS: usize = 64;

/// The positions rounded to `f32`, all distinct.
///
/// # Errors
/// [`ExportError::NotFinite`] beyond the range of `f32`, [`ExportError::Inseparable`] if too many
/// vertices have the same position.
pub fn positions(vertices: &[Vec3]) -> Result<Vec<[f32; 3]>, ExportError> {
    let mut rounded: Vec<[f32; 3]> = vertices.iter().map(round).collect();
    if let Some(vertex) = rounded
        .iter()
        .position(|p| !p.iter().all(|x| x.is_finite()))
    {
        return Err(ExportError::NotFinite { vertex });
    }
    let mut taken = BTreeSet::new();
    for (vertex, p) in rounded.iter_mut().enumerate() {
        let mut steps = 0;
        while !taken.insert(p.map(f32::to_bits)) {
            steps += 1;
            if steps > MAX_STEPS {
                return Err(ExportError::Inseparable { vertex });
            }
            // Adding zero turns -0 into +0, since readers consider both equal.
            p[0] = p[0].next_up() + 0.0;
        }
    }
    Ok(rounded)
}

/// Unit normals rounded to `f32`; +z for a vertex without area around it.
pub fn normals(normals: &[Vec3]) -> Vec<[f32; 3]> {
    normals
        .iter()
        .map(|n| {
            if *n == Vec3::zeros() {
                [0.0, 0.0, 1.0]
            } else {
                round(n)
            }
        })
        .collect()
}

fn round(p: &Vec3) -> [f32; 3] {
    [p.x, p.y, p.z].map(|x| x as f32 + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_that_rounding_would_join_stay_distinct_and_near() {
        let base = Vec3::new(-181.123_456_789, 95.5, 12.25);
        let near: Vec<Vec3> = (0..40)
            .map(|i| base + Vec3::new(0.0, 1e-9 * f64::from(i), 0.0))
            .collect();
        let single = positions(&near).unwrap();
        let distinct: BTreeSet<_> = single.iter().map(|p| p.map(f32::to_bits)).collect();
        assert_eq!(distinct.len(), near.len());
        for (s, v) in single.iter().zip(&near) {
            assert!((f64::from(s[0]) - v.x).abs() < 41.0 * 1.6e-5);
        }
    }

    #[test]
    fn zeros_of_both_signs_count_as_the_same_position() {
        let pair = [Vec3::new(0.0, 1.0, 2.0), Vec3::new(-0.0, 1.0, 2.0)];
        let [a, b] = positions(&pair).unwrap()[..] else {
            panic!("two vertices")
        };
        assert_ne!(a, b);
    }

    #[test]
    fn positions_beyond_single_precision_are_refused() {
        let far = [Vec3::new(1e39, 0.0, 0.0)];
        assert_eq!(
            positions(&far).unwrap_err(),
            ExportError::NotFinite { vertex: 0 }
        );
        let heap = vec![Vec3::zeros(); 100];
        assert!(matches!(
            positions(&heap).unwrap_err(),
            ExportError::Inseparable { .. }
        ));
    }
}
