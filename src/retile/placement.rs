//! Random points on the surface: the paper's first step.
//!
//! A triangle is drawn with probability proportional to its area times the wanted density, a
//! place in it uniformly. Every component gets its share of the points by the same measure,
//! and no fewer than a closed mesh needs.

use rand::RngExt;

use super::domain::Domain;
use super::sizing::Sizing;
use super::trace::inset;
use super::{RetileError, SurfacePoint};
use crate::geometry::random::{self, Purpose};
use crate::mesh::topology::components;

/// Fewest points for a component without handles: an octahedron. Fewer close (a tetrahedron
/// does) but leave the later steps nothing to choose.
const LEAST_PER_COMPONENT: usize = 6;

/// Draws exactly `count` points.
///
/// # Errors
/// [`RetileError::TooFewPoints`] where there are not enough for every component.
pub(crate) fn place(
    domain: &Domain,
    sizing: &Sizing,
    count: usize,
    seed: u64,
) -> Result<Vec<SurfacePoint>, RetileError> {
    let component_of = components(domain.vertices.len(), &domain.triangles);
    let number = component_of.iter().max().map_or(0, |c| *c as usize + 1);
    let mut cumulative: Vec<Vec<(f64, u32)>> = vec![Vec::new(); number];
    for (t, corners) in domain.triangles.iter().enumerate() {
        let list = &mut cumulative[component_of[corners[0] as usize] as usize];
        let before = list.last().map_or(0.0, |l| l.0);
        list.push((before + sizing.expected_points(domain, t), t as u32));
    }
    let shares: Vec<f64> = cumulative
        .iter()
        .map(|list| list.last().map_or(0.0, |l| l.0))
        .collect();
    let counts = distribute(&shares, count)?;
    let mut random = random::stream(seed, Purpose::Placement);
    let mut points = Vec::with_capacity(count);
    for (list, n) in cumulative.iter().zip(counts) {
        let total = list.last().map_or(0.0, |l| l.0);
        for _ in 0..n {
            let drawn = random.random::<f64>() * total;
            let slot = list.partition_point(|l| l.0 <= drawn).min(list.len() - 1);
            let root = random.random::<f64>().sqrt();
            let along = random.random::<f64>();
            points.push(SurfacePoint {
                triangle: list[slot].1,
                barycentric: inset([1.0 - root, root * (1.0 - along), root * along]),
            });
        }
    }
    Ok(points)
}

/// Whole numbers proportional to `shares`, at least [`LEAST_PER_COMPONENT`] each, sum `count`
/// (largest remainders; ties to the lower index).
fn distribute(shares: &[f64], count: usize) -> Result<Vec<usize>, RetileError> {
    let least = LEAST_PER_COMPONENT * shares.len();
    if count < least {
        return Err(RetileError::TooFewPoints {
            points: count,
            needed: least,
        });
    }
    let total: f64 = shares.iter().sum();
    let spare = (count - least) as f64;
    let wanted: Vec<f64> = shares.iter().map(|s| s / total * spare).collect();
    let mut counts: Vec<usize> = wanted.iter().map(|w| *w as usize).collect();
    let mut order: Vec<usize> = (0..shares.len()).collect();
    order.sort_by(|&i, &j| {
        wanted[j]
            .fract()
            .total_cmp(&wanted[i].fract())
            .then(i.cmp(&j))
    });
    let missing = count - least - counts.iter().sum::<usize>();
    for &i in order.iter().cycle().take(missing) {
        counts[i] += 1;
    }
    Ok(counts.iter().map(|c| c + LEAST_PER_COMPONENT).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn points_fall_evenly_and_never_on_edges() {
        let mesh = shapes::icosphere(10.0, 3);
        let domain = Domain::new(mesh.vertices.clone(), mesh.triangles.clone()).unwrap();
        let points = place(&domain, &Sizing::even(&domain), 4000, 7).unwrap();
        assert_eq!(points.len(), 4000);
        let mut octants = [0usize; 8];
        for p in &points {
            assert!(p.barycentric.iter().all(|b| *b > 1e-4));
            assert!((p.barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let x = p.position(&mesh.vertices, &mesh.triangles);
            let bit = |v: f64| usize::from(v > 0.0);
            octants[bit(x.x) + 2 * bit(x.y) + 4 * bit(x.z)] += 1;
        }
        // Binomial: 500 expected, standard deviation 21.
        assert!(octants.iter().all(|n| (400..600).contains(n)), "{octants:?}");
        assert_eq!(points, place(&domain, &Sizing::even(&domain), 4000, 7).unwrap());
        assert_ne!(points, place(&domain, &Sizing::even(&domain), 4000, 8).unwrap());
    }

    #[test]
    fn every_component_gets_its_share() {
        assert_eq!(distribute(&[3.0, 1.0], 20).unwrap(), vec![12, 8]);
        assert_eq!(distribute(&[1000.0, 0.001], 30).unwrap(), vec![24, 6]);
        assert_eq!(
            distribute(&[1.0, 1.0, 1.0], 17),
            Err(RetileError::TooFewPoints {
                points: 17,
                needed: 18
            })
        );
    }
}
