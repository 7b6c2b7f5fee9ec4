//! Seeds of many cells from relaxed cells of a quarter of their number.
//!
//! In: the samples, relaxed [`Cells`], and the number of seeds. Out: seeds at the sites, and between the sites of
//! neighbouring cells. Of regular cells, which have six neighbours, that makes four times as many that are as regular:
//! what took relaxation many rounds on random seeds is done where rounds are cheap.

use super::cells::Cells;
use super::surface_samples::WeightedSamples;

/// Two neighbouring cells: their numbers, the lower one first, and the samples on their border by the distance from the
/// middle between the two sites, nearest first.
struct Neighbours {
    sites: [u32; 2],
    border: Vec<u32>,
}

/// Distinct samples: first those nearest to the sites of `cells`, then those between neighbouring sites, the farthest
/// neighbours first, as many as `wanted` says for each component of the surface; at most as many as there are
/// neighbours. `components` has that of each sample, `spacing` the wanted relative distance of sites there.
pub(super) fn seeds(
    cells: &Cells,
    samples: &WeightedSamples,
    components: &[u32],
    spacing: &[f64],
    wanted: &[usize],
) -> Vec<u32> {
    let mut taken = vec![false; samples.len()];
    let mut seeds = nearest_samples(cells, samples);
    let mut missing = wanted.to_vec();
    for &v in &seeds {
        taken[v as usize] = true;
        let missing = &mut missing[components[v as usize] as usize];
        *missing = missing.saturating_sub(1);
    }
    for pair in farthest_first(neighbours(cells, samples), cells, spacing) {
        let missing = &mut missing[components[pair.border[0] as usize] as usize];
        if *missing == 0 {
            continue;
        }
        if let Some(&v) = pair.border.iter().find(|v| !taken[**v as usize]) {
            taken[v as usize] = true;
            seeds.push(v);
            *missing -= 1;
        }
    }
    seeds
}

/// The sample of each cell that is nearest to its site.
fn nearest_samples(cells: &Cells, samples: &WeightedSamples) -> Vec<u32> {
    let mut nearest = vec![(f64::INFINITY, 0); cells.sites.len()];
    for (v, &site) in (0..).zip(&cells.labels) {
        let site = site as usize;
        let distance = (samples.working[v as usize] - cells.sites[site]).norm_squared();
        if distance < nearest[site].0 {
            nearest[site] = (distance, v);
        }
    }
    nearest.into_iter().map(|(_, v)| v).collect()
}

fn neighbours(cells: &Cells, samples: &WeightedSamples) -> Vec<Neighbours> {
    let mut at_borders: Vec<([u32; 2], f64, u32)> = Vec::new();
    for (v, &own) in (0u32..).zip(&cells.labels) {
        for &n in samples.around(v as usize) {
            let other = cells.labels[n as usize];
            if other == own {
                continue;
            }
            let pair = [own.min(other), own.max(other)];
            let [a, b] = pair.map(|site| cells.sites[site as usize]);
            let off = (samples.working[v as usize] - (a + b) / 2.0).norm_squared();
            at_borders.push((pair, off, v));
        }
    }
    at_borders
        .sort_unstable_by(|(p, a, v), (q, b, w)| p.cmp(q).then(a.total_cmp(b)).then(v.cmp(w)));
    at_borders.dedup();
    let pairs = at_borders.chunk_by(|(p, ..), (q, ..)| p == q);
    let of_pair = |of_pair: &[([u32; 2], f64, u32)]| Neighbours {
        sites: of_pair[0].0,
        border: of_pair.iter().map(|(_, _, v)| *v).collect(),
    };
    pairs.map(of_pair).collect()
}

/// Sorted by the distance of the sites relative to the wanted spacing, the greatest first.
fn farthest_first(
    pairs: Vec<Neighbours>,
    cells: &Cells,
    spacing: &[f64],
) -> impl Iterator<Item = Neighbours> {
    let relative_distance = |pair: &Neighbours| {
        let [a, b] = pair.sites.map(|site| cells.sites[site as usize]);
        (a - b).norm() / spacing[pair.border[0] as usize]
    };
    let mut keyed: Vec<(f64, Neighbours)> = (pairs.into_iter())
        .map(|pair| (relative_distance(&pair), pair))
        .collect();
    keyed.sort_by(|(a, p), (b, q)| b.total_cmp(a).then(p.sites.cmp(&q.sites)));
    keyed.into_iter().map(|(_, pair)| pair)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::mesh::shapes;
    use std::collections::BTreeSet;

    /// Cells about the twelve vertices of an icosahedron, each with five neighbours: 30 edges.
    #[test]
    fn seeds_lie_at_the_sites_and_between_neighbours() {
        let mesh = shapes::icosphere(10.0, 4);
        let samples = WeightedSamples::new(&mesh.vertices, &mesh.vertices, &mesh.triangles, 0);
        let sites: Vec<u32> = (0..12).collect();
        let cells = Cells::grow(&samples, &sites);
        let (components, spacing) = (vec![0; samples.len()], vec![1.0; samples.len()]);
        let all = seeds(&cells, &samples, &components, &spacing, &[1000]);
        assert_eq!(all[..12], sites);
        assert_eq!(all.len(), 42);
        assert_eq!(all.iter().collect::<BTreeSet<_>>().len(), 42);
        let least = |v: &Vec3| {
            let distances = sites
                .iter()
                .map(|s| (samples.working[*s as usize] - v).norm());
            distances.fold(f64::INFINITY, f64::min)
        };
        // Half the angle between neighbours is 31.7 degrees.
        for &v in &all[12..] {
            let off = least(&samples.working[v as usize]);
            assert!(
                (off - 20.0 * 15.86f64.to_radians().sin()).abs() < 1.0,
                "{off}"
            );
        }
        let some = seeds(&cells, &samples, &components, &spacing, &[30]);
        assert_eq!(some.len(), 30);
        assert!(some.iter().all(|v| all.contains(v)));
    }

    /// The farthest neighbours relative to the wanted spacing come first.
    #[test]
    fn seeds_come_first_where_neighbours_are_too_far_apart() {
        let mesh = shapes::icosphere(10.0, 4);
        let samples = WeightedSamples::new(&mesh.vertices, &mesh.vertices, &mesh.triangles, 0);
        let sites: Vec<u32> = (0..12).collect();
        let cells = Cells::grow(&samples, &sites);
        let components = vec![0; samples.len()];
        let fine_above = |p: &Vec3| if p.z > 0.0 { 0.5 } else { 1.0 };
        let spacing: Vec<f64> = samples.working.iter().map(fine_above).collect();
        let some = seeds(&cells, &samples, &components, &spacing, &[20]);
        let above = |v: &u32| samples.working[*v as usize].z > 0.0;
        assert!(some.len() == 20 && some[12..].iter().all(above));
    }
}
