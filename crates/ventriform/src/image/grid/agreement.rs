//! Measures between two masks on one grid, as the paper defines them.
//!
//! - E_J (eq. 2), Jaccard: |A ∩ B| / |A ∪ B|; two empty masks agree (1).
//! - E_CD (eq. 3), mean contour distance: (Σ_a d(a, B) + Σ_b d(b, A)) / (|∂A| + |∂B|) over
//!   the *contour voxels*: voxels of the mask with a 6-neighbour outside it, beyond the
//!   volume's border being outside. d is the Euclidean distance of voxel centres; in voxels
//!   (steps of the grid) and in millimetres.
//! - Dice: 2 |A ∩ B| / (|A| + |B|).
//! - Hausdorff distance of the contours (100 %) and the larger of the two directed 95 %
//!   quantiles, millimetres.
//! - Volume difference: |A| - |B| in millilitres and as a share of |B|.
//!
//! Distances come from an exact Euclidean distance transform (Felzenszwalb and Huttenlocher
//! 2012) over the box that holds both masks.

use crate::base::numeric::order::quantile;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::voxelise::Mask;

/// Voxels, or distances, between two looks at the cancel token.
const VALUES_PER_CHECK: usize = 1 << 20;

/// Figures of two masks' agreement. A is the first, B the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agreement {
    /// E_J, 0..=1.
    pub jaccard: f64,
    /// Dice, 0..=1.
    pub dice: f64,
    /// Distances; `None` where a mask is empty.
    pub contours: Option<ContourDistances>,
    /// Volumes of A and B, ml (voxel counts times voxel volume).
    pub volumes_ml: [f64; 2],
}

/// Distances between the contours of two masks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContourDistances {
    /// E_CD in voxels.
    pub mean_voxels: f64,
    /// E_CD in mm.
    pub mean_mm: f64,
    /// Hausdorff distance, mm.
    pub hausdorff_mm: f64,
    /// 95 % Hausdorff distance, mm.
    pub hausdorff95_mm: f64,
}

/// The masks lie on different grids.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the masks have {a:?} and {b:?} voxels; they must lie on one grid")]
pub struct GridsDiffer {
    /// Shape of the first mask.
    pub a: [usize; 3],
    /// Shape of the second mask.
    pub b: [usize; 3],
}

/// Why there is no comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CompareError {
    /// The masks lie on different grids.
    #[error(transparent)]
    GridsDiffer(#[from] GridsDiffer),
    /// The caller cancelled the comparison.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Compares `a` with the reference `b`; both on the grid with `spacing` mm.
///
/// # Errors
/// [`CompareError`].
pub fn compare(
    a: &Mask,
    b: &Mask,
    spacing: [f64; 3],
    monitor: &Monitor,
) -> Result<Agreement, CompareError> {
    if a.shape != b.shape {
        return Err(CompareError::GridsDiffer(GridsDiffer {
            a: a.shape,
            b: b.shape,
        }));
    }
    let [na, nb, both] = counts(a, b, monitor)?;
    let voxel_ml = spacing.iter().product::<f64>() / 1000.0;
    let contours = match na > 0 && nb > 0 {
        true => Some(contour_distances(a, b, spacing, monitor)?),
        false => None,
    };
    Ok(Agreement {
        jaccard: share(both, na + nb - both),
        dice: share(2 * both, na + nb),
        contours,
        volumes_ml: [na as f64 * voxel_ml, nb as f64 * voxel_ml],
    })
}

/// The Jaccard index (E_J) of two masks on one grid, without the distances that [`compare`] takes most of its time for.
///
/// # Errors
/// [`Cancelled`].
pub fn jaccard(a: &Mask, b: &Mask, monitor: &Monitor) -> Result<f64, Cancelled> {
    let [na, nb, both] = counts(a, b, monitor)?;
    Ok(share(both, na + nb - both))
}

/// Voxels of `a`, of `b`, and of both.
fn counts(a: &Mask, b: &Mask, monitor: &Monitor) -> Result<[usize; 3], Cancelled> {
    let mut counts = [0; 3];
    let portions = (a.voxels.chunks(VALUES_PER_CHECK)).zip(b.voxels.chunks(VALUES_PER_CHECK));
    for (of_a, of_b) in portions {
        monitor.check()?;
        for (x, y) in of_a.iter().zip(of_b) {
            counts[0] += usize::from(*x);
            counts[1] += usize::from(*y);
            counts[2] += usize::from(*x && *y);
        }
    }
    Ok(counts)
}

/// 1 where both masks are empty.
fn share(part: usize, whole: usize) -> f64 {
    if whole == 0 {
        1.0
    } else {
        part as f64 / whole as f64
    }
}

fn contour_distances(
    a: &Mask,
    b: &Mask,
    spacing: [f64; 3],
    monitor: &Monitor,
) -> Result<ContourDistances, Cancelled> {
    let window = MaskWindow::around(a, b, monitor)?;
    let contours = [window.contour(a, monitor)?, window.contour(b, monitor)?];
    let distances = |scale: [f64; 3]| {
        let between = |from: &[usize], to: &[usize]| {
            let squared = window.squared_distances(to, scale, monitor)?;
            let mut found = Vec::with_capacity(from.len());
            for portion in from.chunks(VALUES_PER_CHECK) {
                monitor.check()?;
                found.extend(portion.iter().map(|v| squared[*v].sqrt()));
            }
            Ok(found)
        };
        let [a, b] = &contours;
        Ok::<_, Cancelled>([between(a, b)?, between(b, a)?])
    };
    let mean = |d: &[Vec<f64>; 2]| {
        (d[0].iter().sum::<f64>() + d[1].iter().sum::<f64>()) / (d[0].len() + d[1].len()) as f64
    };
    let mm = distances(spacing)?;
    let mut hausdorff95_mm = 0.0_f64;
    for directed in &mm {
        hausdorff95_mm = hausdorff95_mm.max(quantile_of_distances(directed, 0.95, monitor)?);
    }
    Ok(ContourDistances {
        mean_voxels: mean(&distances([1.0; 3])?),
        mean_mm: mean(&mm),
        hausdorff_mm: mm.iter().flatten().fold(0.0, |a, b| a.max(*b)),
        hausdorff95_mm,
    })
}

/// The `q`-quantile of numbers from 0 on, as [`quantile`] of them in order. There may be as many as a volume has
/// voxels: sorting them would take seconds without a look at the cancel token.
fn quantile_of_distances(values: &[f64], q: f64, monitor: &Monitor) -> Result<f64, Cancelled> {
    let place = q * (values.len() - 1) as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(values.len() - 1);
    let neighbours = [below, above].map(|rank| of_rank(values, rank, monitor));
    let [low, high] = neighbours;
    Ok(quantile(&[low?, high?], place.fract()))
}

/// The number of place `rank`, from 0, of numbers from 0 on in order. The bits of such numbers are in their order: the
/// number is found 16 bits at a time.
fn of_rank(values: &[f64], rank: usize, monitor: &Monitor) -> Result<f64, Cancelled> {
    const DIGIT_BITS: u32 = 16;
    let (mut found, mut before) = (0_u64, rank);
    for shift in [48, 32, 16, 0] {
        let mut counts = vec![0_usize; 1 << DIGIT_BITS];
        for portion in values.chunks(VALUES_PER_CHECK) {
            monitor.check()?;
            for bits in portion.iter().map(|value| value.to_bits() >> shift) {
                if bits >> DIGIT_BITS == found {
                    counts[(bits & ((1 << DIGIT_BITS) - 1)) as usize] += 1;
                }
            }
        }
        let mut digit = 0;
        while before >= counts[digit] {
            before -= counts[digit];
            digit += 1;
        }
        found = (found << DIGIT_BITS) | digit as u64;
    }
    Ok(f64::from_bits(found))
}

/// The part of the grid that holds both masks.
struct MaskWindow {
    first: [usize; 3],
    shape: [usize; 3],
}

impl MaskWindow {
    fn around(a: &Mask, b: &Mask, monitor: &Monitor) -> Result<Self, Cancelled> {
        let mut first = a.shape;
        let mut last = [0; 3];
        for k in 0..a.shape[2] {
            monitor.check()?;
            for j in 0..a.shape[1] {
                for i in 0..a.shape[0] {
                    let v = i + a.shape[0] * (j + a.shape[1] * k);
                    if a.voxels[v] || b.voxels[v] {
                        for (axis, x) in [i, j, k].into_iter().enumerate() {
                            first[axis] = first[axis].min(x);
                            last[axis] = last[axis].max(x);
                        }
                    }
                }
            }
        }
        Ok(Self {
            first,
            shape: [0, 1, 2].map(|axis| last[axis] + 1 - first[axis]),
        })
    }

    /// Indices in the window of the mask's contour voxels.
    fn contour(&self, mask: &Mask, monitor: &Monitor) -> Result<Vec<usize>, Cancelled> {
        let stride = [1, mask.shape[0], mask.shape[0] * mask.shape[1]];
        let mut contour = Vec::new();
        for k in 0..self.shape[2] {
            monitor.check()?;
            for j in 0..self.shape[1] {
                for i in 0..self.shape[0] {
                    let place = [i + self.first[0], j + self.first[1], k + self.first[2]];
                    let v = place[0] + stride[1] * place[1] + stride[2] * place[2];
                    let outside = |axis: usize| {
                        place[axis] == 0
                            || place[axis] + 1 == mask.shape[axis]
                            || !mask.voxels[v - stride[axis]]
                            || !mask.voxels[v + stride[axis]]
                    };
                    if mask.voxels[v] && (0..3).any(outside) {
                        contour.push(i + self.shape[0] * (j + self.shape[1] * k));
                    }
                }
            }
        }
        Ok(contour)
    }

    /// Squared distance of every voxel of the window to the nearest of `seeds`.
    fn squared_distances(
        &self,
        seeds: &[usize],
        scale: [f64; 3],
        monitor: &Monitor,
    ) -> Result<Vec<f64>, Cancelled> {
        let mut field = vec![f64::INFINITY; self.shape.iter().product()];
        for s in seeds {
            field[*s] = 0.0;
        }
        let strides = [1, self.shape[0], self.shape[0] * self.shape[1]];
        let mut line = Vec::new();
        for axis in 0..3 {
            let (n, stride) = (self.shape[axis], strides[axis]);
            let planes = (0..field.len()).step_by(stride * n);
            for start in planes.flat_map(|first| first..first + stride) {
                monitor.check()?;
                line.clear();
                line.extend((0..n).map(|x| field[start + x * stride]));
                let out = lower_envelope(&line, scale[axis]);
                for (x, value) in out.into_iter().enumerate() {
                    field[start + x * stride] = value;
                }
            }
        }
        Ok(field)
    }
}

/// min over q of f(q) + (step (p - q))² for every p.
fn lower_envelope(f: &[f64], step: f64) -> Vec<f64> {
    let mut hull: Vec<(usize, f64)> = Vec::with_capacity(f.len());
    for (q, value) in f.iter().enumerate() {
        if !value.is_finite() {
            continue;
        }
        let height = |p: usize| f[p] / (step * step) + (p * p) as f64;
        let meet = |p: usize| (height(q) - height(p)) / (2.0 * (q as f64 - p as f64));
        while hull.last().is_some_and(|(p, from)| meet(*p) <= *from) {
            hull.pop();
        }
        let from = hull.last().map_or(f64::NEG_INFINITY, |(p, _)| meet(*p));
        hull.push((q, from));
    }
    let mut at = 0;
    (0..f.len())
        .map(|p| {
            while at + 1 < hull.len() && hull[at + 1].1 <= p as f64 {
                at += 1;
            }
            hull.get(at).map_or(f64::INFINITY, |(q, _)| {
                f[*q] + (step * (p as f64 - *q as f64)).powi(2)
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::image::grid::agreement::*;

    fn mask(shape: [usize; 3], inside: impl Fn(usize, usize, usize) -> bool) -> Mask {
        let mut mask = Mask::empty(shape);
        for k in 0..shape[2] {
            for j in 0..shape[1] {
                for i in 0..shape[0] {
                    mask.voxels[i + shape[0] * (j + shape[1] * k)] = inside(i, j, k);
                }
            }
        }
        mask
    }

    #[test]
    fn two_cubes_one_voxel_apart_by_hand() {
        // Cubes of 3³ voxels, the second moved by one voxel along i. Common 2·9 = 18, union
        // 36. All but the centre voxel are contour: 26 each.
        let a = mask([9, 9, 9], |i, j, k| {
            (3..6).contains(&i) && (3..6).contains(&j) && (3..6).contains(&k)
        });
        let b = mask([9, 9, 9], |i, j, k| {
            (4..7).contains(&i) && (3..6).contains(&j) && (3..6).contains(&k)
        });
        let m = compare(&a, &b, [2.0, 3.0, 4.0], &Monitor::silent()).unwrap();
        assert_eq!(m.jaccard, 0.5);
        assert!((m.dice - 36.0 / 54.0).abs() < 1e-15);
        let c = m.contours.unwrap();
        // The nine voxels of A's outer face lie one voxel from B's contour, and so does the one
        // voxel of A's contour that is B's centre; the rest is common. Likewise for B.
        assert!((c.mean_voxels - 20.0 / 52.0).abs() < 1e-12);
        assert!((c.mean_mm - 40.0 / 52.0).abs() < 1e-12);
        assert_eq!((c.hausdorff_mm, c.hausdorff95_mm), (2.0, 2.0));
        assert_eq!(m.volumes_ml, [27.0 * 0.024, 27.0 * 0.024]);
    }

    #[test]
    fn a_mask_without_voxels_has_no_contour_and_nothing_in_common() {
        let (none, some) = (mask([4; 3], |_, _, _| false), mask([4; 3], |i, _, _| i < 2));
        for (a, b) in [(&none, &some), (&some, &none)] {
            let m = compare(a, b, [1.0; 3], &Monitor::silent()).unwrap();
            assert_eq!((m.jaccard, m.dice), (0.0, 0.0));
            assert!(m.contours.is_none());
        }
        let m = compare(&none, &none, [1.0; 3], &Monitor::silent()).unwrap();
        assert_eq!((m.jaccard, m.dice), (1.0, 1.0));
        assert!(m.contours.is_none());
    }

    #[test]
    fn distances_agree_with_brute_force() {
        let shape = [14, 12, 10];
        let noise = |seed: usize, i: usize, j: usize, k: usize| {
            let x = (i * 73 + j * 179 + k * 283 + seed * 991) % 101;
            x * x % 101 < 30
        };
        let a = mask(shape, |i, j, k| noise(1, i, j, k));
        let b = mask(shape, |i, j, k| noise(2, i, j, k) && i > 3);
        let scale = [1.5, 2.0, 3.1];
        let m = compare(&a, &b, scale, &Monitor::silent())
            .unwrap()
            .contours
            .unwrap();
        let contour = |m: &Mask| -> Vec<[f64; 3]> {
            let at = |p: [isize; 3]| {
                let inside = (0..3).all(|x| p[x] >= 0 && p[x] < shape[x] as isize);
                inside && m.voxels[p[0] as usize + 14 * (p[1] as usize + 12 * p[2] as usize)]
            };
            let mut out = Vec::new();
            for k in 0..10 {
                for j in 0..12 {
                    for i in 0..14 {
                        let around = [
                            [i - 1, j, k],
                            [i + 1, j, k],
                            [i, j - 1, k],
                            [i, j + 1, k],
                            [i, j, k - 1],
                            [i, j, k + 1],
                        ];
                        if at([i, j, k]) && around.iter().any(|p| !at(*p)) {
                            out.push([i as f64, j as f64, k as f64]);
                        }
                    }
                }
            }
            out
        };
        let (ca, cb) = (contour(&a), contour(&b));
        let nearest = |p: &[f64; 3], c: &[[f64; 3]], s: [f64; 3]| {
            c.iter()
                .map(|q| (0..3).map(|x| (s[x] * (p[x] - q[x])).powi(2)).sum::<f64>())
                .fold(f64::INFINITY, f64::min)
                .sqrt()
        };
        for (s, found) in [([1.0; 3], m.mean_voxels), (scale, m.mean_mm)] {
            let sum = ca.iter().map(|p| nearest(p, &cb, s)).sum::<f64>()
                + cb.iter().map(|p| nearest(p, &ca, s)).sum::<f64>();
            assert!((sum / (ca.len() + cb.len()) as f64 - found).abs() < 1e-12);
        }
    }

    #[test]
    fn quantiles_are_those_of_the_numbers_in_order() {
        let mut values: Vec<f64> = (0..3000_u32)
            .map(|n| f64::from(n * 7919 % 2003).sqrt() * [1e-3, 1.0, 1e6][n as usize % 3])
            .collect();
        values.extend([0.0, 0.0, f64::MIN_POSITIVE, 1e300]);
        for length in [1, 2, 3, 20, values.len()] {
            let some = &values[values.len() - length..];
            let mut sorted = some.to_vec();
            sorted.sort_by(f64::total_cmp);
            for q in [0.0, 0.05, 0.5, 0.95, 1.0] {
                let found = quantile_of_distances(some, q, &Monitor::silent()).unwrap();
                assert_eq!(found, quantile(&sorted, q), "{length} {q}");
            }
        }
    }

    #[test]
    fn empty_masks_have_no_distance() {
        let none = Mask::empty([4, 4, 4]);
        let one = mask([4, 4, 4], |i, j, k| i + j + k == 0);
        let both = compare(&none, &none, [1.0; 3], &Monitor::silent()).unwrap();
        assert_eq!((both.jaccard, both.dice, both.contours), (1.0, 1.0, None));
        let half = compare(&one, &none, [1.0; 3], &Monitor::silent()).unwrap();
        assert_eq!((half.jaccard, half.contours), (0.0, None));
        let same = compare(&one, &one, [1.0; 3], &Monitor::silent()).unwrap();
        assert_eq!(same.contours.unwrap().mean_mm, 0.0);
        assert!(compare(&one, &Mask::empty([4, 4, 5]), [1.0; 3], &Monitor::silent()).is_err());
    }
}
