//! Where the detectors were at each view (PS3.3 C.8.4.11, C.8.4.12).
//!
//! Start Angle (0054,0200) is that of [`crate::image::reconstruct::View`]. Of a single detector the rotation states it;
//! several detectors state their own, and each turns as the rotation says: by Angular Step (0018,1144) from view to
//! view, counter-clockwise as seen from the feet (Rotation Direction (0018,1140) CC), which adds to the angle, or
//! clockwise (CW), which takes from it.

use crate::image::reconstruct::View;
use ventriform_dicom::read::ReadError;
use ventriform_dicom::read::attributes::{
    ANGULAR_STEP, Attributes, DETECTOR_START, FRAME_DURATION, ROTATION_DIRECTION, ROTATION_FRAMES,
    ROTATION_START, SCAN_ARC,
};
use ventriform_dicom::read::views::ViewOrder;

/// Greatest angular step, degrees.
const MAX_STEP_DEG: f64 = 45.0;

/// Farthest that two angles that are to be one may lie apart, degrees.
const SAME_ANGLE_DEG: f64 = 0.5;

/// Farthest that the stated arc may lie from steps times views, in steps.
const MAX_ARC_STEPS: f64 = 0.3;

/// Largest relative difference of the durations of views.
const MAX_DURATION_SHARE: f64 = 0.01;

/// One rotation of a detector, both counted from 0.
pub(super) struct Run {
    pub detector: usize,
    pub rotation: usize,
    pub views: Vec<View>,
    /// 1 counter-clockwise, -1 clockwise.
    sign: f64,
}

impl Run {
    /// The angle of the first view, degrees.
    pub(super) fn start(&self) -> f64 {
        self.views.first().map_or(0.0, |view| view.angle_deg)
    }
}

/// How a rotation goes on from its first view.
struct Rotation {
    step_deg: f64,
    sign: f64,
}

/// The rotations of all detectors.
///
/// # Errors
/// [`ReadError::Field`] for an attribute that is missing or contradicts another.
pub(super) fn runs(a: &Attributes, order: &ViewOrder) -> Result<Vec<Run>, ReadError> {
    check_durations(a, order)?;
    let mut runs = Vec::new();
    let starts = detector_starts(a, order)?;
    for (detector, start) in starts.into_iter().enumerate() {
        for rotation in 0..order.rotations() {
            let Rotation { step_deg, sign } = Rotation::new(a, rotation, order)?;
            let first = start + later_start(a, rotation)?;
            let view = |number: usize| View {
                angle_deg: first + sign * step_deg * number as f64,
                time: rotation * order.views() + number,
            };
            runs.push(Run {
                detector,
                rotation,
                views: (0..order.views()).map(view).collect(),
                sign,
            });
        }
    }
    Ok(runs)
}

/// The order of the views of all `runs` by how far the camera had turned: those of one run as they are.
pub(super) fn by_turn(runs: &[Run]) -> Vec<usize> {
    let sign = runs.first().map_or(1.0, |run| run.sign);
    let first = runs.first().map_or(0.0, Run::start);
    let angles = runs.iter().flat_map(|run| run.views.iter());
    // A hair back, so that the first view is not taken for one a turn later.
    let turned = |view: &View| (sign * (view.angle_deg - first) + 1e-6).rem_euclid(360.0);
    let turned: Vec<f64> = angles.map(turned).collect();
    let mut order: Vec<usize> = (0..turned.len()).collect();
    if runs.len() > 1 {
        order.sort_by(|a, b| turned[*a].total_cmp(&turned[*b]));
    }
    order
}

/// Degrees that the views cover, each with its step.
pub(super) fn arc_deg(views: &[View]) -> f64 {
    let mut angles: Vec<f64> = views
        .iter()
        .map(|v| v.angle_deg.rem_euclid(360.0))
        .collect();
    angles.sort_by(f64::total_cmp);
    let Some(first) = angles.first().copied() else {
        return 0.0;
    };
    angles.push(first + 360.0);
    let mut gaps: Vec<f64> = angles.windows(2).map(|two| two[1] - two[0]).collect();
    gaps.sort_by(f64::total_cmp);
    let (widest, usual) = (gaps[gaps.len() - 1], gaps[gaps.len() / 2]);
    360.0 - widest + usual.min(widest)
}

/// The angle of each detector at its first view.
fn detector_starts(a: &Attributes, order: &ViewOrder) -> Result<Vec<f64>, ReadError> {
    let of_rotation = a
        .decimals_of_item::<1>(ROTATION_START, 0)?
        .map(|[angle]| angle);
    let of_detector = |detector| a.decimals_of_item::<1>(DETECTOR_START, detector);
    let detectors = order.detectors();
    if detectors == 1 {
        let own = of_detector(0)?.map(|[angle]| angle);
        return match (of_rotation, own) {
            (Some(stated), Some(own)) if !is_same(stated, own) => {
                Err(contradiction(a, stated, own))
            }
            (Some(angle), _) | (None, Some(angle)) => Ok(vec![angle]),
            (None, None) => Err(a.missing(ROTATION_START)),
        };
    }
    let mut starts: Vec<f64> = Vec::with_capacity(detectors);
    for detector in 0..detectors {
        let Some([start]) = of_detector(detector)? else {
            let reason = format!(
                "the frames are of {detectors} detectors, and each must state its own angle in the Detector \
                 Information Sequence (0054,0022); detector {} does not",
                detector + 1
            );
            return Err(a.wrong(DETECTOR_START.name, "missing", reason));
        };
        if let Some(same) = starts.iter().position(|other| is_same(*other, start)) {
            let reason = format!(
                "detectors {} and {} cannot be at one angle",
                same + 1,
                detector + 1
            );
            return Err(a.wrong(DETECTOR_START.name, &start.to_string(), reason));
        }
        starts.push(start);
    }
    match of_rotation {
        Some(stated) if !starts.iter().any(|start| is_same(*start, stated)) => {
            Err(contradiction(a, stated, starts[0]))
        }
        _ => Ok(starts),
    }
}

/// By how much a rotation begins at another angle than the first.
fn later_start(a: &Attributes, rotation: usize) -> Result<f64, ReadError> {
    if rotation == 0 {
        return Ok(0.0);
    }
    let start = |rotation| match a.decimals_of_item::<1>(ROTATION_START, rotation)? {
        Some([angle]) => Ok(angle),
        None => {
            let reason = format!("rotation {} must state where it begins", rotation + 1);
            Err(a.wrong(ROTATION_START.name, "missing", reason))
        }
    };
    Ok(start(rotation)? - start(0)?)
}

fn is_same(a_deg: f64, b_deg: f64) -> bool {
    let apart = (a_deg - b_deg).rem_euclid(360.0);
    apart.min(360.0 - apart) <= SAME_ANGLE_DEG
}

fn contradiction(a: &Attributes, rotation: f64, detector: f64) -> ReadError {
    let reason = format!(
        "the Rotation Information Sequence (0054,0052) states it, and the Detector Information Sequence (0054,0022) \
         states {detector}; both must be where the detector is at the first view"
    );
    a.wrong(ROTATION_START.name, &rotation.to_string(), reason)
}

impl Rotation {
    fn new(a: &Attributes, rotation: usize, order: &ViewOrder) -> Result<Self, ReadError> {
        let views = order.views();
        let missing = |name: &'static str| {
            let reason = format!("rotation {} must state it", rotation + 1);
            a.wrong(name, "missing", reason)
        };
        let Some([step_deg]) = a.decimals_of_item(ANGULAR_STEP, rotation)? else {
            return Err(missing(ANGULAR_STEP.name));
        };
        if !(step_deg > 0.0 && step_deg <= MAX_STEP_DEG) {
            let reason = format!(
                "expected degrees above 0 and up to {MAX_STEP_DEG}; {} says which way",
                ROTATION_DIRECTION.name
            );
            return Err(a.wrong(ANGULAR_STEP.name, &step_deg.to_string(), reason));
        }
        let sign = match a.texts_of_item(ROTATION_DIRECTION, rotation).first() {
            Some(text) if text == "CC" => 1.0,
            Some(text) if text == "CW" => -1.0,
            Some(other) => {
                let reason = "expected CW (clockwise) or CC (counter-clockwise)".into();
                return Err(a.wrong(ROTATION_DIRECTION.name, other, reason));
            }
            None => return Err(missing(ROTATION_DIRECTION.name)),
        };
        let all = views * order.detectors();
        if let Some(stated) = a.shorts_of_item(ROTATION_FRAMES, rotation).first().copied()
            && stated != 0
            && ![views, all].contains(&usize::from(stated))
        {
            let reason =
                format!("the Angular View Vector (0054,0090) has {views} views of a rotation");
            return Err(a.wrong(ROTATION_FRAMES.name, &stated.to_string(), reason));
        }
        if let Some([arc]) = a.decimals_of_item::<1>(SCAN_ARC, rotation)?
            && arc != 0.0
        {
            // Writers count the steps or the views, of one detector or of all.
            let fits = [views, views - 1, all, all - 1].into_iter().any(|steps| {
                (arc.abs() - steps as f64 * step_deg).abs() <= MAX_ARC_STEPS * step_deg
            });
            if !fits {
                let reason = format!(
                    "{views} views in steps of {step_deg} degrees cover {} degrees; {} and {} must agree",
                    views as f64 * step_deg,
                    ANGULAR_STEP.name,
                    SCAN_ARC.name
                );
                return Err(a.wrong(SCAN_ARC.name, &arc.to_string(), reason));
            }
        }
        Ok(Self { step_deg, sign })
    }
}

/// Checks that the views of all rotations took equally long.
fn check_durations(a: &Attributes, order: &ViewOrder) -> Result<(), ReadError> {
    let mut first = None;
    for rotation in 0..order.rotations() {
        let Some([own]) = a.decimals_of_item::<1>(FRAME_DURATION, rotation)? else {
            continue;
        };
        let first = *first.get_or_insert(own);
        if (own - first).abs() > MAX_DURATION_SHARE * first.abs() {
            let reason = format!(
                "rotation {} has views of another duration than the first ({first} ms); their counts do not compare",
                rotation + 1
            );
            return Err(a.wrong(FRAME_DURATION.name, &own.to_string(), reason));
        }
    }
    Ok(())
}
