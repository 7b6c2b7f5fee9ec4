//! The rim of a ventricle, by anatomy as well as by where the signal ends.
//!
//! The sensors end the wall where its uptake ends. An infarct at the base then shortens the wall, and the
//! segment reads normal; a wall of the right ventricle lengthens it. In go the fitted model, its cup and the
//! patient's superior direction; out comes the model with its rim moved along the long axis.
//!
//! 1. The rim's height in each of [`RIM_DIRECTIONS`] directions about the axis.
//! 2. The shape of the rim that hearts have ([`RIM_SHAPE`], in three harmonics and shares of the heart's length) is
//!    fitted to them, robustly: a short stretch far from the rest hardly pulls it.
//! 3. The distance from that shape is the sum of what is true of this heart and what the signal took away
//!    or added. A piecewise linear function ([`RIM_CORRECTION`]) says how much of it to take back.
//! 4. Where the signal ends in the image ([`signal_end`](super::signal_end)) corrects that: the heart's expected rim,
//!    given the heart's length, the distance by which step 3 moves the rim and the ends of the signal
//!    ([`RIM_REGRESSION`]). Where the base is dark, it moves the rim towards the base only.
//! 5. Nodes within [`STRETCHED_LENGTH_MM`](super::rim_frame::STRETCHED_LENGTH_MM) of the rim move along the axis, those
//!    at the rim by the whole, so that the wall is stretched or compressed there.
//!
//! Shape and functions are least-squares fits to simulated hearts whose rims are known;
//! `scripts/measure/calibrate_walls.py` estimates them again. On hearts that were left out, the rms error of the rim's
//! height falls from 3.8 mm as sensed to 3.3 by shape and 2.9 with the ends of the signal (docs/log/walls.md). Not
//! guaranteed: an infarct over half of the base moves the shape itself; a wall that is short where its base is dark
//! stays too long. A model whose orientation is unknown keeps its rim.

use nalgebra::{DMatrix, DVector};

use super::calibration::{RIM_CORRECTION, RIM_DEVIATION, RIM_REGRESSION, RIM_SHAPE};
use super::rim_frame::{RIM_DIRECTIONS, RimFrame, rim_angle};
use super::rim_model::{RIM_TERMS, RimEvidence};
use super::signal_end::SignalEnds;
use crate::base::geometry::Vec3;
use crate::base::numeric::order;
use crate::heart::model::wall::VentricleWall;
use crate::image::grid::field::Field;
use crate::image::locate::cup::Cup;
use crate::mesh::TriMesh;
use crate::mesh::intersections::self_intersections;

/// Distance from the shape at which a direction counts half, mm.
const OUTLIER_DISTANCE_MM: f64 = 4.0;
/// Neighbouring directions are not independent: as many of them count as one.
const CORRELATED_DIRECTIONS: f64 = 3.0;
/// Rounds of reweighting.
const REWEIGHTING_ROUNDS: usize = 30;

/// `mesh` with its rim where anatomy and image together put it; where there is no `evidence` of the image, where its
/// shape puts it. `None` without a rim in every direction, and where the moved surface would intersect itself: then the
/// mesh stays.
pub fn settled(
    mesh: &TriMesh,
    cup: &Cup,
    superior: &Vec3,
    evidence: Option<&RimEvidence>,
) -> Option<TriMesh> {
    let rim = Rim::new(mesh, cup, superior)?;
    let shifts = match evidence {
        Some(evidence) => RIM_REGRESSION.shifts(evidence),
        None => rim.shifts_by_shape()?,
    };
    let moved = rim.frame.stretched(mesh, &rim.heights, &shifts);
    self_intersections(&moved).is_empty().then_some(moved)
}

/// What tells where the rim of `mesh` is, whose wall is `wall`, in the image `field` about it. `None` without a rim or
/// a signal in every direction.
pub fn rim_evidence(
    mesh: &TriMesh,
    cup: &Cup,
    superior: &Vec3,
    wall: &VentricleWall,
    field: &Field,
) -> Option<RimEvidence> {
    let rim = Rim::new(mesh, cup, superior)?;
    rim.evidence(&rim.shifts_by_shape()?, wall, field)
}

/// Standard deviation of the height of the rim that this `evidence` puts, mm.
pub fn rim_deviation_mm(evidence: &RimEvidence) -> f64 {
    RIM_DEVIATION.predicted(evidence)
}

/// The rim of a mesh.
struct Rim {
    frame: RimFrame,
    /// Height in each direction, mm.
    heights: Vec<f64>,
    /// From the middle rim to the apex, mm.
    length: f64,
}

impl Rim {
    fn new(mesh: &TriMesh, cup: &Cup, superior: &Vec3) -> Option<Self> {
        let frame = RimFrame::new(cup, superior);
        let heights = frame.heights(mesh)?;
        let apex = mesh.vertices.iter().map(|p| frame.along(p));
        let length = apex.fold(f64::MIN, f64::max) - median(&heights);
        Some(Self {
            frame,
            heights,
            length,
        })
    }

    /// Distances by which the rim's shape moves it towards the base, mm.
    fn shifts_by_shape(&self) -> Option<Vec<f64>> {
        let shape = expected(&self.heights, self.length)?;
        let off = self.heights.iter().zip(&shape).map(|(h, e)| h - e);
        Some(off.map(|distance| RIM_CORRECTION.at(distance)).collect())
    }

    fn evidence(
        &self,
        by_shape: &[f64],
        wall: &VentricleWall,
        field: &Field,
    ) -> Option<RimEvidence> {
        let ends = SignalEnds::new(&self.frame, &self.heights, wall, field)?;
        Some(RimEvidence {
            length_mm: self.length,
            by_shape_mm: by_shape.to_vec(),
            ends,
        })
    }
}

/// The height at which `mesh` begins in each of [`RIM_DIRECTIONS`] directions about the axis, mm from the cup's
/// centre towards the apex; `None` without a rim in every direction.
pub fn rim_heights(mesh: &TriMesh, cup: &Cup, superior: &Vec3) -> Option<Vec<f64>> {
    RimFrame::new(cup, superior).heights(mesh)
}

/// `mesh` with its whole rim moved towards the base by `distance` mm. It stays as it is without a rim in
/// every direction.
pub fn extended(mesh: &TriMesh, cup: &Cup, superior: &Vec3, distance: f64) -> TriMesh {
    let frame = RimFrame::new(cup, superior);
    match frame.heights(mesh) {
        Some(rim) => frame.stretched(mesh, &rim, &[distance; RIM_DIRECTIONS]),
        None => mesh.clone(),
    }
}

/// `mesh` with its whole rim moved along the axis, so that its median height is that of `base`. It is moved less
/// where the whole way is longer than [`RIM_SHIFT_RANGE_MM`] or would make the surface intersect itself; `None`
/// without a rim in every direction, and where it cannot be moved at all.
pub fn put(mesh: &TriMesh, cup: &Cup, superior: &Vec3, base: &Vec3) -> Option<TriMesh> {
    let frame = RimFrame::new(cup, superior);
    let rim = frame.heights(mesh)?;
    let distance =
        (median(&rim) - frame.along(base)).clamp(RIM_SHIFT_RANGE_MM[0], RIM_SHIFT_RANGE_MM[1]);
    [1.0, 0.75, 0.5, 0.25]
        .into_iter()
        .map(|share| frame.stretched(mesh, &rim, &[share * distance; RIM_DIRECTIONS]))
        .find(|moved| self_intersections(moved).is_empty())
}

/// Range of the distance by which a rim is moved, mm towards the base. Towards the apex, wall of the length
/// [`STRETCHED_LENGTH_MM`](super::rim_frame::STRETCHED_LENGTH_MM) is pushed together, so it must stay below that.
const RIM_SHIFT_RANGE_MM: [f64; 2] = [-20.0, 40.0];

/// The shape of a rim with these heights, mm, of a heart of this length.
fn expected(rim: &[f64], length: f64) -> Option<Vec<f64>> {
    let basis = DMatrix::from_fn(RIM_DIRECTIONS, RIM_TERMS + 1, |direction, term| {
        let angle = rim_angle(direction);
        let times = term.div_ceil(2) as f64;
        match term {
            0 => 1.0,
            term if term % 2 == 1 => (times * angle).cos(),
            _ => (times * angle).sin(),
        }
    });
    let usual_terms = RIM_SHAPE.mean_terms();
    let mean = DVector::from_fn(RIM_TERMS + 1, |term, _| match term {
        0 => 0.0,
        term => usual_terms[term - 1] * length,
    });
    let prior = DMatrix::from_fn(RIM_TERMS + 1, RIM_TERMS + 1, |a, b| match (a, b) {
        (0, _) | (_, 0) => 0.0,
        (a, b) => RIM_SHAPE.precision[a - 1][b - 1] / (length * length),
    });
    let heights = DVector::from_column_slice(rim);
    let usual = &basis * &mean;
    let level: Vec<f64> = (&heights - &usual).iter().copied().collect();
    let mut shape = usual.add_scalar(median(&level));
    for _ in 0..REWEIGHTING_ROUNDS {
        let weights = (&heights - &shape).map(|r| {
            let odd = r / OUTLIER_DISTANCE_MM;
            1.0 / (1.0 + odd * odd)
                / (OUTLIER_DISTANCE_MM * OUTLIER_DISTANCE_MM * CORRELATED_DIRECTIONS)
        });
        let weighted = DMatrix::from_fn(RIM_TERMS + 1, RIM_DIRECTIONS, |t, d| {
            basis[(d, t)] * weights[d]
        });
        let system = &weighted * &basis + &prior;
        let right = &weighted * &heights + &prior * &mean;
        shape = &basis * system.cholesky()?.solve(&right);
    }
    Some(shape.iter().copied().collect())
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    order::quantile(&sorted, 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use std::f64::consts::TAU;

    /// A cup whose axis points down, with the rim of the mean heart, and cut short by `notch` mm where the
    /// angle from lateral lies within 30 degrees of 90.
    fn heart(notch: f64) -> (TriMesh, Cup) {
        let cup = Cup {
            centre: Vec3::zeros(),
            axis: -Vec3::z(),
            length: 70.0,
            breadth: 1.0,
        };
        let frame = RimFrame::new(&cup, &Vec3::y());
        let mut mesh = shapes::cup(70.0, 31.0, 12.0, 24);
        let least = mesh.vertices.iter().map(|p| frame.along(p));
        let base = least.fold(f64::MAX, f64::min);
        for p in &mut mesh.vertices {
            let angle = TAU * (frame.direction(p) + 0.5) / RIM_DIRECTIONS as f64;
            let usual: f64 = (0..RIM_TERMS)
                .map(|t| {
                    let times = (t / 2 + 1) as f64 * angle;
                    RIM_SHAPE.mean_terms()[t]
                        * 70.0
                        * if t % 2 == 0 { times.cos() } else { times.sin() }
                })
                .sum();
            let off = (angle.to_degrees() - 90.0).abs();
            let short = notch * (1.0 - off / 30.0).clamp(0.0, 0.5) * 2.0;
            let share = (1.0 - (frame.along(p) - base) / 40.0).clamp(0.0, 1.0);
            *p += cup.axis * ((usual + short) * share);
        }
        (mesh, cup)
    }

    fn rim(mesh: &TriMesh, cup: &Cup) -> Vec<f64> {
        RimFrame::new(cup, &Vec3::y()).heights(mesh).unwrap()
    }

    #[test]
    fn a_stretch_of_rim_that_is_missing_is_put_back() {
        let (whole, cup) = heart(0.0);
        let (cut, _) = heart(12.0);
        let anterior = RIM_DIRECTIONS / 4;
        let settled = settled(&cut, &cup, &Vec3::y(), None).unwrap();
        let heights = [&whole, &cut, &settled].map(|m| rim(m, &cup)[anterior]);
        let [whole, cut, settled] = heights;
        assert!(cut > whole + 9.0, "{heights:?}");
        assert!((settled - whole).abs() < 0.5 * (cut - whole), "{heights:?}");
    }

    #[test]
    fn the_rim_is_put_at_a_stated_base_as_far_as_it_can() {
        let (whole, cup) = heart(0.0);
        let middle = median(&rim(&whole, &cup));
        // Positive is towards the base, against the axis.
        for (asked, moved) in [(8.0, 8.0), (-12.0, -12.0), (-60.0, -20.0), (90.0, 40.0)] {
            let base = cup.axis * (middle - asked) + Vec3::x() * 11.0;
            let put = put(&whole, &cup, &Vec3::y(), &base).unwrap();
            let found = middle - median(&rim(&put, &cup));
            assert!((found - moved).abs() < 0.5, "{asked}: {found}");
            assert!(self_intersections(&put).is_empty());
            // The apex stays.
            let apex = |mesh: &TriMesh| {
                mesh.vertices
                    .iter()
                    .map(|p| p.dot(&cup.axis))
                    .fold(0.0, f64::max)
            };
            assert_eq!(apex(&put), apex(&whole));
        }
    }

    #[test]
    fn a_usual_rim_stays_within_two_millimetres() {
        let (whole, cup) = heart(0.0);
        let settled = settled(&whole, &cup, &Vec3::y(), None).unwrap();
        for (before, after) in rim(&whole, &cup).iter().zip(rim(&settled, &cup)) {
            assert!((before - after).abs() < 2.0, "{before} {after}");
        }
        assert_eq!(settled.triangles, whole.triangles);
    }

    fn wave(term: usize, direction: usize) -> f64 {
        let angle = TAU * (direction as f64 + 0.5) / RIM_DIRECTIONS as f64;
        let times = (term / 2 + 1) as f64 * angle;
        if term.is_multiple_of(2) {
            times.cos()
        } else {
            times.sin()
        }
    }

    /// The aorta leaves between septum and anterior wall: the wall of hearts is shortest there, and longest
    /// opposite to it.
    #[test]
    fn the_mean_rim_is_that_of_hearts() {
        let height = |d: usize| {
            (0..RIM_TERMS)
                .map(|t| RIM_SHAPE.mean_terms()[t] * wave(t, d))
                .sum::<f64>()
        };
        let by_height = |a: &usize, b: &usize| height(*a).total_cmp(&height(*b));
        let angle = |direction: usize| 360.0 * (direction as f64 + 0.5) / RIM_DIRECTIONS as f64;
        let shortest = angle((0..RIM_DIRECTIONS).max_by(by_height).unwrap());
        let longest = angle((0..RIM_DIRECTIONS).min_by(by_height).unwrap());
        assert!((145.0..170.0).contains(&shortest), "{shortest}");
        assert!((300.0..350.0).contains(&longest), "{longest}");
        let precision = DMatrix::from_fn(RIM_TERMS, RIM_TERMS, |a, b| RIM_SHAPE.precision[a][b]);
        assert_eq!(precision, precision.transpose());
        assert!(precision.cholesky().is_some());
    }

    /// Any other shape costs more: the sum of the robust distances to the heights, three directions counting
    /// as one, and of the distance from the mean shape.
    #[test]
    fn the_expected_rim_is_the_best_compromise() {
        for length in [60.0, 95.0] {
            let rim: Vec<f64> = (0..RIM_DIRECTIONS)
                .map(|n| 3.0 + 2.0 * (1.7 * n as f64).sin() + if n < 4 { 9.0 } else { 0.0 })
                .collect();
            let cost = |shape: &[f64]| {
                let robust = rim
                    .iter()
                    .zip(shape)
                    .map(|(h, s)| (1.0 + ((h - s) / 4.0).powi(2)).ln() / 2.0 / 3.0);
                let off: [f64; RIM_TERMS] = std::array::from_fn(|t| {
                    let sum: f64 = (0..RIM_DIRECTIONS).map(|d| shape[d] * wave(t, d)).sum();
                    2.0 * sum / RIM_DIRECTIONS as f64 / length - RIM_SHAPE.mean_terms()[t]
                });
                let mut prior = 0.0;
                for a in 0..RIM_TERMS {
                    for b in 0..RIM_TERMS {
                        prior += off[a] * RIM_SHAPE.precision[a][b] * off[b] / 2.0;
                    }
                }
                robust.sum::<f64>() + prior
            };
            let shape = expected(&rim, length).unwrap();
            let least = cost(&shape);
            for term in 0..=RIM_TERMS {
                for step in [-0.02, 0.02] {
                    let by = |d: usize| if term < RIM_TERMS { wave(term, d) } else { 1.0 };
                    let moved: Vec<f64> = (0..RIM_DIRECTIONS)
                        .map(|d| shape[d] + step * by(d))
                        .collect();
                    assert!(cost(&moved) > least, "{length} {term} {step}");
                }
            }
        }
    }

    /// A rim far from its shape is moved by more than the distance beyond 4 mm, and by 12 or 16 mm at most.
    #[test]
    fn the_correction_grows_steadily_to_its_limits() {
        let steps: Vec<f64> = (-300..=300)
            .map(|n| RIM_CORRECTION.at(f64::from(n) / 10.0))
            .collect();
        assert!(steps.windows(2).all(|s| s[1] >= s[0] && s[1] - s[0] < 0.25));
        assert_eq!((steps[0], steps[600]), (-12.0, 16.0));
        let slope = |d: f64| (RIM_CORRECTION.at(d + 0.5) - RIM_CORRECTION.at(d - 0.5)).abs();
        assert!(RIM_CORRECTION.at(0.0).abs() < 1.0);
        for within in [-3.0, 0.0, 3.0] {
            assert!((slope(within) - 0.95).abs() < 1e-9);
        }
        assert!(slope(6.0) > 2.0 && slope(7.0) > 2.0 && slope(-6.0) < 0.95 && slope(-6.0) > 0.5);
    }
}
