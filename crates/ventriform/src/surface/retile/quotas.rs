//! The number of points that each component of the surface gets.
//!
//! In: the surface and the load of each component, its area over the square of the wanted
//! spacing. Out: numbers proportional to the loads that add up to N, but none smaller than the
//! smallest triangulation of the component's genus needs.

use std::cmp::Ordering;

use crate::mesh::topology;
use crate::surface::Surface;

/// The smallest number of vertices of any mesh with the same components and handles.
pub(super) fn least_points(surface: &Surface) -> usize {
    least_of(&surface.mesh.triangles, &surface.components())
        .iter()
        .sum()
}

/// The same for each component of a closed mesh, given the component of every vertex by
/// [`topology::components`].
pub(super) fn least_of(triangles: &[[u32; 3]], component: &[u32]) -> Vec<usize> {
    let characteristics = topology::component_characteristics(triangles, component);
    characteristics.into_iter().map(least_vertices).collect()
}

/// The smallest number of vertices of any triangulation of the closed orientable surface with
/// this Euler characteristic: Heawood's bound, except for genus 2, which takes one vertex more
/// (Jungerman and Ringel 1980).
pub(super) fn least_vertices(euler: i64) -> usize {
    match euler {
        -2 => 10,
        e => ((7.0 + (49.0 - 24.0 * e as f64).sqrt()) / 2.0).ceil() as usize,
    }
}

/// Divides `points` among the components in proportion to `load`, giving each at least what its
/// topology needs: `least`, by [`least_of`]. The sum is `points`, which must be at least that of `least`.
pub(super) fn share(least: &[usize], load: &[f64], points: usize) -> Vec<usize> {
    let total: f64 = load.iter().sum();
    let fair: Vec<f64> = load.iter().map(|l| l / total * points as f64).collect();
    let mut quotas: Vec<usize> = (least.iter().zip(&fair))
        .map(|(least, fair)| (*fair as usize).max(*least))
        .collect();
    // The difference goes to, or comes from, the component farthest from its fair share.
    loop {
        let sum: usize = quotas.iter().sum();
        let surplus = |c: usize| quotas[c] as f64 - fair[c];
        let order = |a: &usize, b: &usize| surplus(*a).total_cmp(&surplus(*b));
        match sum.cmp(&points) {
            Ordering::Equal => return quotas,
            Ordering::Less => {
                let c = (0..quotas.len()).min_by(order).expect("a component");
                quotas[c] += 1;
            }
            Ordering::Greater => {
                let c = (0..quotas.len())
                    .filter(|&c| quotas[c] > least[c])
                    .max_by(order)
                    .expect("more points than minima");
                quotas[c] -= 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{TriMesh, shapes};
    use crate::surface::from_mesh;
    use crate::surface::retile::tessellate::test_surfaces::together;

    fn with_torus(mesh: TriMesh) -> Surface {
        let mesh = together(&[mesh, shapes::torus(90.0, 30.0, 12, 7)]);
        Surface::exact(mesh, 1.0)
    }

    #[test]
    fn every_component_gets_its_share_and_what_it_needs() {
        let surface = with_torus(shapes::icosphere(1.0, 0));
        assert_eq!(least_points(&surface), 4 + 7);
        let least = least_of(&surface.mesh.triangles, &surface.components());
        assert_eq!(share(&least, &[3.0, 1.0], 40), vec![30, 10]);
        assert_eq!(share(&least, &[3.0, 1.0], 16), vec![9, 7]);
        assert_eq!(share(&least, &[0.001, 1000.0], 50), vec![4, 46]);
        assert_eq!(share(&least, &[1.0, 1.0], 11), vec![4, 7]);
    }

    #[test]
    fn a_surface_with_its_census_needs_as_many_points_as_one_without() {
        for mesh in [
            shapes::icosphere(1.0, 1),
            shapes::torus(3.0, 1.0, 12, 7),
            with_torus(shapes::icosphere(1.0, 0)).mesh,
        ] {
            let (counted, carried) = (
                Surface::exact(mesh.clone(), 1.0),
                from_mesh(mesh, 1.0).unwrap(),
            );
            assert_eq!(carried.components(), counted.components());
            assert_eq!(least_points(&carried), least_points(&counted));
        }
    }

    /// Of V vertices every two may be joined once, and a triangulation has 3 (V - χ) edges. Genus 2 is the one
    /// exception.
    #[test]
    fn the_least_number_of_vertices_has_enough_pairs_for_the_edges() {
        for genus in 0..40i64 {
            let euler = 2 - 2 * genus;
            let fits = |v: &i64| 3 * (v - euler) <= v * (v - 1) / 2;
            let fewest = (4..).find(fits).unwrap() as usize;
            let expected = if genus == 2 { fewest + 1 } else { fewest };
            assert_eq!(least_vertices(euler), expected, "{genus}");
        }
    }

    #[test]
    fn shares_add_up_and_differ_from_the_fair_ones_by_less_than_one_point() {
        let surface = with_torus(shapes::icosphere(1.0, 0));
        let least = least_of(&surface.mesh.triangles, &surface.components());
        for points in 12..120 {
            for part in [0.01, 0.2, 0.37, 0.5, 0.9, 0.999] {
                let found = share(&least, &[part * 7.0, (1.0 - part) * 7.0], points);
                assert_eq!(found.iter().sum::<usize>(), points);
                let fair = part * points as f64;
                match found[..] {
                    [4, _] => assert!(fair < 5.0, "{fair}"),
                    [_, 7] => assert!(points as f64 - fair < 8.0, "{fair}"),
                    [ball, ring] => {
                        assert!((ball as f64 - fair).abs() < 1.0, "{found:?} {fair}");
                        assert!(ball > 4 && ring > 7);
                    }
                    _ => panic!("{found:?}"),
                }
            }
        }
    }
}
