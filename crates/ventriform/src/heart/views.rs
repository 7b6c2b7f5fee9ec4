//! The motion of a fitted heart during a scan, measured in the camera's views.
//!
//! In: the projections that an image was reconstructed of, and the heart that was fitted to it. Out: steps and a drift,
//! as [`HeartMotion`], and by them how far the heart lay from its mean place in every view.
//!
//! 1. Every view is compared with the image's own projections ([`view_shifts`]). Attenuation, which the image knows
//!    nothing of, shifts what is measured by some 2 mm along the axis and 3 mm across it, evenly from view to view; the
//!    counts scatter by half a millimetre from view to view.
//! 2. A patient who moves does so at once, or slowly all the time. So the measured shifts are taken for a sum of steps
//!    (along the axis, or across it by one vector in the patient), a drift along the axis, an even error whose
//!    covariance falls with the angle between two views (Matérn, 5/2), and noise of the size that neighbouring views
//!    show. What the place of the patient explains is free.
//! 3. Steps and drift are added one by one, that which explains most first, as long as it explains more than
//!    [`LEAST_EVIDENCE`] and is at least [`LEAST_STEP_MM`] or [`LEAST_DRIFT_MM`] large. All are then estimated together.
//!
//! The covariances and limits were chosen on simulated scans (`motions` of the evaluation; docs/log/projections.md).
//!
//! Not told: drifts below 10 mm, which the error hides; steps below 5 mm; two steps within two views; more than
//! [`MOST_MOVES`]; what [`view_shifts`] does not measure.

use crate::base::geometry::frame::VoxelToPatient;
use crate::base::numeric::order::upper_median;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::deform::FittedModel;
use crate::image::grid::blur::{Kernel, blur};
use crate::image::grid::voxelise::voxelise;
use crate::image::reconstruct::motion::{MeasuredShift, ViewShift, view_shifts, without_place};
use crate::image::reconstruct::{Projections, View, by_angle};
use nalgebra::{DMatrix, DVector};

/// Most steps and drifts of a scan.
const MOST_MOVES: usize = 4;
/// Most views whose motion is measured: the work goes with their cube.
const MOST_VIEWS: usize = 512;
/// By how much a move lessens the weighted squares at least: a step along the axis, a step across it, a drift.
const LEAST_EVIDENCE: [f64; 3] = [15.0, 25.0, 7.0];
/// Least size of a step, along the axis and across it, mm.
const LEAST_STEP_MM: [f64; 2] = [4.5, 5.0];
/// Least size of a drift over the whole scan, mm.
const LEAST_DRIFT_MM: f64 = 6.0;
/// Views before and after a step at least.
const LEAST_VIEWS: usize = 2;
/// What is to be expected along the axis.
const ALONG: Expected = Expected {
    error_mm: 2.5,
    error_deg: 25.0,
    move_mm: 20.0,
};
/// What is to be expected across it: a step that a few views hardly see is not made large.
const ACROSS: Expected = Expected {
    error_mm: 5.0,
    error_deg: 30.0,
    move_mm: 8.0,
};
/// The power of a view's lack of sharpness with which its errors grow: a half by counting noise alone; what the image
/// does not know of weighs more.
const VAGUE_POWER: f64 = 1.0;
/// Least deviation of the noise of a view, mm.
const LEAST_NOISE_MM: f64 = 0.4;
/// Deviation of the place of the patient, mm: no limit.
const PLACE_MM: f64 = 100.0;

/// Blur of the wall's share of the voxels, sigma in mm, and its factor: 1 within the wall, a half 6 mm beyond it.
const SHARE_BLUR_MM: f64 = 6.0;
const SHARE_FACTOR: f32 = 3.0;

/// One movement of a heart during a scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Move {
    /// A step along the axis of rotation.
    Along {
        /// Number in time, from 0, of the first view after it.
        view: usize,
        /// Towards the head, mm.
        head_mm: f64,
    },
    /// A step across it.
    Across {
        /// Number in time, from 0, of the first view after it.
        view: usize,
        /// To the left of the patient, mm.
        left_mm: f64,
        /// To the back, mm.
        back_mm: f64,
    },
    /// A drift along the axis of rotation, over the whole scan.
    Drift {
        /// Towards the head, mm.
        head_mm: f64,
    },
}

/// How a heart moved during a scan.
#[derive(Debug, Clone, PartialEq)]
pub struct HeartMotion {
    /// What was measured in every view, with its error.
    pub measured: Vec<ViewShift>,
    /// How it moved; empty if that is not told from rest.
    pub moves: Vec<Move>,
    /// By the moves, how far it lay from its mean place in every view.
    pub shifts: Vec<ViewShift>,
}

impl HeartMotion {
    /// Measures the motion of the heart of `model`, fitted to the image of `projections` at `frame`; `None` of more
    /// than [`MOST_VIEWS`] views.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn measured(
        projections: &Projections,
        axis_offset_mm: f64,
        model: &FittedModel,
        frame: &VoxelToPatient,
        monitor: &Monitor,
    ) -> Result<Option<Self>, Cancelled> {
        if projections.views.len() > MOST_VIEWS {
            return Ok(None);
        }
        let share = wall_share(model, projections.shape(), frame, monitor)?;
        let measured = view_shifts(projections, axis_offset_mm, &share, monitor)?;
        Self::of_shifts(&projections.views, &measured, monitor).map(Some)
    }

    /// The motion that the measured shifts of `views` tell.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn of_shifts(
        views: &[View],
        measured: &[MeasuredShift],
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let directions = Directions::new(views);
        let each = measured.iter();
        let along: Vec<(f64, f64)> = (each.clone())
            .map(|own| (own.shift.along_mm, own.sharpness[0]))
            .collect();
        let across: Vec<(f64, f64)> = each
            .map(|own| (own.shift.across_mm, own.sharpness[1]))
            .collect();
        let mut along = Line::new(views, &along, &ALONG, &[directions.even()]);
        let place = [directions.left.clone(), directions.back.clone()];
        let mut across = Line::new(views, &across, &ACROSS, &place);
        let mut kept = Vec::new();
        for _ in 0..MOST_MOVES {
            monitor.check()?;
            let Some(best) = best_of(&directions, &along, &across, monitor)? else {
                break;
            };
            let at = match best {
                Kind::Across(view) => across.take(directions.across_from(view)),
                Kind::Along(view) => along.take([directions.from(view)]),
                Kind::Drift => along.take([directions.drift()]),
            };
            kept.push((best, at));
        }
        let moves = kept.into_iter().map(|(kind, at)| match kind {
            Kind::Along(view) => Move::Along {
                view,
                head_mm: along.sizes[at],
            },
            Kind::Drift => Move::Drift {
                head_mm: along.sizes[at],
            },
            Kind::Across(view) => Move::Across {
                view,
                left_mm: across.sizes[at],
                back_mm: across.sizes[at + 1],
            },
        });
        let moves: Vec<Move> = moves.collect();
        let (along_mm, across_mm) = (along.sum(), across.sum());
        let mut shifts: Vec<ViewShift> = (along_mm.iter().zip(across_mm.iter()))
            .map(|(along_mm, across_mm)| ViewShift {
                along_mm: *along_mm,
                across_mm: *across_mm,
            })
            .collect();
        without_place(views, &mut shifts);
        Ok(Self {
            measured: measured.iter().map(|own| own.shift).collect(),
            moves,
            shifts,
        })
    }

    /// Whether it moved.
    pub fn moved(&self) -> bool {
        !self.moves.is_empty()
    }

    /// The greatest distance between its places in two views, along the axis of rotation and on the detector across it,
    /// mm.
    pub fn range_mm(&self) -> [f64; 2] {
        let range = |own: fn(&ViewShift) -> f64| {
            let all = self.shifts.iter().map(own);
            let ends = all.fold([0.0_f64; 2], |[least, most], v| [least.min(v), most.max(v)]);
            ends[1] - ends[0]
        };
        [range(|s| s.along_mm), range(|s| s.across_mm)]
    }
}

/// A move that may be added.
#[derive(Debug, Clone, Copy)]
enum Kind {
    Along(usize),
    Across(usize),
    Drift,
}

/// The move that explains most of what is needed of its kind; `None` if none explains enough.
fn best_of(
    directions: &Directions,
    along: &Line,
    across: &Line,
    monitor: &Monitor,
) -> Result<Option<Kind>, Cancelled> {
    let mut best: Option<(f64, Kind)> = None;
    let mut take = |gain: f64, least: f64, size_mm: f64, least_mm: f64, kind: Kind| {
        let share = gain / least;
        if share >= 1.0 && size_mm >= least_mm && best.is_none_or(|(most, _)| share > most) {
            best = Some((share, kind));
        }
    };
    let last = directions.times().saturating_sub(LEAST_VIEWS);
    for view in LEAST_VIEWS..=last {
        monitor.check()?;
        let (gain, sizes) = along.gain(&[directions.from(view)]);
        take(
            gain,
            LEAST_EVIDENCE[0],
            sizes[0].abs(),
            LEAST_STEP_MM[0],
            Kind::Along(view),
        );
        let (gain, sizes) = across.gain(&directions.across_from(view));
        let size = sizes[0].hypot(sizes[1]);
        take(
            gain,
            LEAST_EVIDENCE[1],
            size,
            LEAST_STEP_MM[1],
            Kind::Across(view),
        );
    }
    let (gain, sizes) = along.gain(&[directions.drift()]);
    take(
        gain,
        LEAST_EVIDENCE[2],
        sizes[0].abs(),
        LEAST_DRIFT_MM,
        Kind::Drift,
    );
    Ok(best.map(|(_, kind)| kind))
}

/// The times of the views, and the patient's directions on the detector.
struct Directions {
    times: Vec<usize>,
    left: DVector<f64>,
    back: DVector<f64>,
}

impl Directions {
    fn new(views: &[View]) -> Self {
        let of = |axis: usize| {
            let parts = views.iter().map(|view| view.columns()[axis]);
            DVector::from_iterator(views.len(), parts)
        };
        Self {
            times: views.iter().map(|view| view.time).collect(),
            left: of(0),
            back: of(1),
        }
    }

    fn times(&self) -> usize {
        self.times.iter().max().map_or(0, |last| last + 1)
    }

    fn even(&self) -> DVector<f64> {
        DVector::from_element(self.times.len(), 1.0)
    }

    /// 1 from a view on.
    fn from(&self, view: usize) -> DVector<f64> {
        let after = self
            .times
            .iter()
            .map(|time| f64::from(u8::from(*time >= view)));
        DVector::from_iterator(self.times.len(), after)
    }

    fn across_from(&self, view: usize) -> [DVector<f64>; 2] {
        let after = self.from(view);
        [&self.left, &self.back].map(|direction| direction.component_mul(&after))
    }

    /// 0 to 1 over the scan.
    fn drift(&self) -> DVector<f64> {
        let last = self.times().saturating_sub(1).max(1) as f64;
        let shares = self.times.iter().map(|time| *time as f64 / last);
        DVector::from_iterator(self.times.len(), shares)
    }
}

/// Errors and moves of one direction.
struct Expected {
    /// Deviation of the even error, mm.
    error_mm: f64,
    /// The angle over which it stays, degrees.
    error_deg: f64,
    /// Deviation of the moves, mm.
    move_mm: f64,
}

/// What was measured in one direction, the inverse of its covariance, and the moves that are taken for true.
struct Line {
    values: DVector<f64>,
    inverse: DMatrix<f64>,
    /// Deviation of the moves, mm.
    move_mm: f64,
    terms: Vec<DVector<f64>>,
    /// The weighted squares that `terms` explain.
    explained: f64,
    /// The sizes of `terms`, mm.
    sizes: Vec<f64>,
}

impl Line {
    /// `free` are what the place of the patient adds.
    fn new(
        views: &[View],
        measured: &[(f64, f64)],
        expected: &Expected,
        free: &[DVector<f64>],
    ) -> Self {
        let count = measured.len();
        let values = DVector::from_iterator(count, measured.iter().map(|own| own.0));
        let noise = noise_mm(views, &values);
        let vague = vagueness(measured);
        let mut covariance = DMatrix::from_fn(count, count, |i, j| {
            let apart = (views[i].angle_deg - views[j].angle_deg).rem_euclid(360.0);
            let root = 5_f64.sqrt() * apart.min(360.0 - apart) / expected.error_deg;
            let even = expected.error_mm.powi(2) * (1.0 + root + root * root / 3.0) * (-root).exp();
            vague[i] * vague[j] * (even + if i == j { noise * noise } else { 0.0 })
        });
        for direction in free {
            covariance += PLACE_MM.powi(2) * direction * direction.transpose();
        }
        let inverse = covariance.cholesky().map(|factor| factor.inverse());
        Self {
            inverse: inverse.unwrap_or_else(|| DMatrix::identity(count, count)),
            values,
            move_mm: expected.move_mm,
            terms: Vec::new(),
            explained: 0.0,
            sizes: Vec::new(),
        }
    }

    /// Takes moves for true, and gives the place of the first among the terms.
    fn take(&mut self, more: impl IntoIterator<Item = DVector<f64>>) -> usize {
        let first = self.terms.len();
        self.terms.extend(more);
        (self.explained, self.sizes) = self.explained_with(&[]);
        first
    }

    /// By how much the weighted squares get less with these moves beside those that are taken for true, and the sizes
    /// of these.
    fn gain(&self, more: &[DVector<f64>]) -> (f64, Vec<f64>) {
        let (explained, mut sizes) = self.explained_with(more);
        (
            explained - self.explained,
            sizes.split_off(self.terms.len()),
        )
    }

    /// The weighted squares that the moves and `more` explain, and the sizes of all of them.
    fn explained_with(&self, more: &[DVector<f64>]) -> (f64, Vec<f64>) {
        let terms: Vec<&DVector<f64>> = self.terms.iter().chain(more).collect();
        let weighted: Vec<DVector<f64>> = terms.iter().map(|term| &self.inverse * *term).collect();
        let squares = DMatrix::from_fn(terms.len(), terms.len(), |i, j| {
            let prior = if i == j { self.move_mm.powi(-2) } else { 0.0 };
            weighted[i].dot(terms[j]) + prior
        });
        let products =
            DVector::from_iterator(terms.len(), weighted.iter().map(|w| w.dot(&self.values)));
        match squares.cholesky() {
            Some(factor) => {
                let sizes = factor.solve(&products);
                (sizes.dot(&products), sizes.as_slice().to_vec())
            }
            None => (0.0, vec![0.0; terms.len()]),
        }
    }

    /// What the moves that are taken for true add up to in each view, mm.
    fn sum(&self) -> DVector<f64> {
        let parts = self.terms.iter().zip(&self.sizes);
        let parts = parts.map(|(term, size)| term * *size);
        parts.fold(DVector::zeros(self.values.len()), |sum, part| sum + part)
    }
}

/// By what factor the errors of each view are greater than those of most: views in which the heart hardly shows tell
/// less.
fn vagueness(measured: &[(f64, f64)]) -> Vec<f64> {
    if measured.is_empty() {
        return Vec::new();
    }
    let usual = upper_median(measured.iter().map(|(_, sharpness)| *sharpness));
    let factor = |(_, sharpness): &(f64, f64)| {
        (usual / sharpness.max(1e-3 * usual))
            .powf(VAGUE_POWER)
            .max(1.0)
    };
    measured.iter().map(factor).collect()
}

/// The deviation of the noise of a view, mm, by second differences of views that follow each other.
fn noise_mm(views: &[View], values: &DVector<f64>) -> f64 {
    /// Deviation over median size of a normal distribution, and over a second difference's.
    const PER_MEDIAN: f64 = 1.4826;
    const PER_DIFFERENCE: f64 = 2.449_489_742_783_178;
    if views.len() < 3 {
        return LEAST_NOISE_MM;
    }
    let order = by_angle(views);
    let second = order
        .windows(3)
        .map(|v| (values[v[0]] - 2.0 * values[v[1]] + values[v[2]]).abs());
    (PER_MEDIAN * upper_median(second) / PER_DIFFERENCE).max(LEAST_NOISE_MM)
}

/// The share of every voxel that the wall of a model has, and what lies a few millimetres about it.
fn wall_share(
    model: &FittedModel,
    shape: [usize; 3],
    frame: &VoxelToPatient,
    monitor: &Monitor,
) -> Result<Vec<f32>, Cancelled> {
    let wall = (model.surfaces.as_ref()).map_or(&model.mesh, |both| &both.apparent.mesh);
    let mask = voxelise(wall, shape, frame, monitor)?;
    let mut share: Vec<f32> = mask
        .voxels
        .iter()
        .map(|own| f32::from(u8::from(*own)))
        .collect();
    let kernels = frame
        .spacing()
        .map(|spacing| Kernel::gaussian(SHARE_BLUR_MM / spacing, 3.0));
    blur(&mut share, shape, &kernels, monitor)?;
    for value in &mut share {
        *value = (SHARE_FACTOR * *value).min(1.0);
    }
    Ok(share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::random::{Purpose, normal, stream};

    /// Views of a half turn by one detector, or of a quarter turn each by two.
    fn views(count: usize, detectors: usize) -> Vec<View> {
        let each = count / detectors;
        let view = |n: usize| View {
            angle_deg: 225.0 - 180.0 * n as f64 / count as f64,
            time: n % each,
        };
        (0..count).map(view).collect()
    }

    /// What is measured of a motion: with an even error of 2 mm and noise of half a millimetre.
    fn measured(
        views: &[View],
        moved: impl Fn(usize) -> [f64; 3],
        seed: u64,
    ) -> Vec<MeasuredShift> {
        let mut random = stream(seed, Purpose::PhantomNoise);
        let phase = normal(&mut random);
        let one = |view: &View| {
            let angle = view.angle_deg.to_radians();
            let [head, left, back] = moved(view.time);
            let error = 2.0 * (3.0 * angle + phase).sin();
            MeasuredShift {
                shift: ViewShift {
                    along_mm: head + error + 0.5 * normal(&mut random),
                    across_mm: back * angle.sin() - left * angle.cos()
                        + error
                        + 0.5 * normal(&mut random),
                },
                sharpness: [1.0; 2],
            }
        };
        views.iter().map(one).collect()
    }

    fn motion(views: &[View], moved: impl Fn(usize) -> [f64; 3], seed: u64) -> HeartMotion {
        let measured = measured(views, moved, seed);
        HeartMotion::of_shifts(views, &measured, &Monitor::silent()).unwrap()
    }

    #[test]
    fn a_heart_at_rest_does_not_move() {
        for seed in 0..20 {
            for (count, detectors) in [(30, 1), (60, 1), (64, 2)] {
                let found = motion(&views(count, detectors), |_| [0.0; 3], seed);
                assert_eq!(found.moves, [], "{count} {detectors} {seed}");
                assert_eq!(found.range_mm(), [0.0; 2]);
            }
        }
    }

    #[test]
    fn a_step_is_told_with_its_time_and_size_also_by_two_detectors() {
        for (count, detectors) in [(30, 1), (60, 1), (64, 2)] {
            let at = count / detectors / 2;
            let step = |time| [if time >= at { 8.0 } else { 0.0 }, 0.0, 0.0];
            let found = motion(&views(count, detectors), step, 3);
            let [Move::Along { view, head_mm }] = found.moves[..] else {
                panic!("{count} {detectors}: {:?}", found.moves);
            };
            assert!(view.abs_diff(at) <= 1, "{view} {at}");
            assert!((head_mm - 8.0).abs() < 2.0, "{head_mm}");
        }
    }

    #[test]
    fn a_step_across_the_table_is_told_in_the_patients_directions() {
        let step = |time| {
            if time >= 25 {
                [0.0, 9.0, -6.0]
            } else {
                [0.0; 3]
            }
        };
        let found = motion(&views(60, 1), step, 5);
        let across =
            |own: &Move| matches!(own, Move::Across { view, .. } if view.abs_diff(25) <= 1);
        assert!(found.moves.iter().any(across), "{:?}", found.moves);
        let views = views(60, 1);
        let mut known: Vec<ViewShift> = (views.iter())
            .map(|view| {
                let [_, left, back] = step(view.time);
                let (sin, cos) = view.angle_deg.to_radians().sin_cos();
                ViewShift {
                    along_mm: 0.0,
                    across_mm: back * sin - left * cos,
                }
            })
            .collect();
        without_place(&views, &mut known);
        let squares = found.shifts.iter().zip(&known);
        let squares: f64 = squares
            .map(|(a, b)| (a.across_mm - b.across_mm).powi(2))
            .sum();
        let rms_mm = (squares / 60.0).sqrt();
        assert!(rms_mm < 2.0, "{rms_mm}");
    }

    #[test]
    fn a_long_drift_is_told() {
        let found = motion(
            &views(60, 1),
            |time| [18.0 * time as f64 / 59.0, 0.0, 0.0],
            2,
        );
        let [along, _] = found.range_mm();
        assert!((along - 18.0).abs() < 5.0, "{:?}", found.moves);
    }

    #[test]
    fn a_jump_in_views_that_hardly_show_the_heart_is_no_step() {
        let views = views(30, 1);
        let mut measured = measured(&views, |_| [0.0; 3], 4);
        for own in &mut measured[28..] {
            own.shift.along_mm += 9.0;
            own.sharpness = [0.08; 2];
        }
        let found = HeartMotion::of_shifts(&views, &measured, &Monitor::silent()).unwrap();
        assert_eq!(found.moves, []);
    }
}
