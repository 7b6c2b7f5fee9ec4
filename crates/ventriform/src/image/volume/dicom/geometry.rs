//! Position and orientation of the slices of a Nuclear Medicine Image in the patient.
//!
//! After PS3.3 C.8.4.15: Image Position (Patient) in the first item of the Detector Information
//! Sequence is the position of the *first* slice. Slice k lies at position + (row x column) *
//! Spacing Between Slices * k. The sign of that spacing matters: GE and Siemens write negative
//! values. Pixel Spacing holds the distance of rows first, then the distance of columns.
//!
//! The numbers are rounded to single precision, in which NIfTI stores them: a scan gives the same
//! bytes after its conversion.

use super::super::VolumeError;
use super::super::facts::AffineSource;
use super::super::open::Placement;
use super::posture;
use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use nalgebra::Matrix3;
use ventriform_dicom::read::ReadError;
use ventriform_dicom::read::attributes::{
    Attributes, DETECTOR_ORIENTATION, DETECTOR_POSITION, FRAME_PIXEL_SPACING, ORIENTATION,
    PIXEL_SPACING, POSITION, SLICE_THICKNESS, SPACING_BETWEEN_SLICES,
};

/// Largest deviation of direction cosines from unit length and from a right angle.
const COSINE_SLACK: f64 = 1e-2;

/// Position in the patient of a grid of `shape` (columns, rows, slices).
///
/// # Errors
/// [`VolumeError::Field`] for invalid or missing spacings and directions.
pub(super) fn place(a: &Attributes, shape: [usize; 3]) -> Result<Placement, VolumeError> {
    let mut warnings = Vec::new();
    let [between_rows, between_columns] = pixel_spacing(a, None)?;
    let between_slices = slice_spacing(a, &mut warnings)?;
    let orientation = match a.decimals(DETECTOR_ORIENTATION)? {
        Some(orientation) => Some(orientation),
        None => a.decimals(ORIENTATION)?,
    };
    let position = match a.decimals::<3>(DETECTOR_POSITION)? {
        Some(position) => Some(position),
        None => a.decimals(POSITION)?,
    };
    let known = orientation.is_some() && position.is_some();
    let cosines = match orientation {
        Some(cosines) => cosines,
        None => {
            let assumed = posture::assumed(a)?;
            warnings.push(assumed.warning);
            assumed.cosines
        }
    };
    let (x, y) = directions(a, cosines)?;
    let z = x.cross(&y).normalize();
    if orientation.is_some() {
        warnings.extend(posture::contradictions(a, [x, y], between_slices * z));
    }
    let linear =
        Matrix3::from_columns(&[between_columns * x, between_rows * y, between_slices * z]);
    let origin = position.map(Vec3::from).unwrap_or_else(|| {
        warnings.push(
            "The file has no Image Position (Patient): the origin is placed at the centre of the \
             array."
                .into(),
        );
        -(linear * Vec3::from_fn(|axis, _| (shape[axis] as f64 - 1.0) / 2.0))
    });
    let single = |x: f64| f64::from(x as f32);
    let (linear, origin) = (linear.map(single), origin.map(single));
    let frame = VoxelToPatient::new(linear, origin).map_err(|_| {
        let reason = "directions and spacings must span three dimensions".into();
        a.wrong(
            DETECTOR_ORIENTATION.name,
            &format!("{orientation:?}"),
            reason,
        )
    })?;
    Ok(Placement {
        frame,
        source: if known {
            AffineSource::ImagePosition
        } else {
            AffineSource::UnknownOrigin
        },
        warnings,
    })
}

/// Distance of rows and distance of columns, mm, of `frame` or of the whole file.
pub(super) fn pixel_spacing(a: &Attributes, frame: Option<usize>) -> Result<[f64; 2], ReadError> {
    let stated = match a.decimals_of(FRAME_PIXEL_SPACING, frame)? {
        Some(spacing) => Some(spacing),
        None => a.decimals(PIXEL_SPACING)?,
    };
    let Some([between_rows, between_columns]) = stated else {
        return Err(a.missing(PIXEL_SPACING));
    };
    if between_rows > 0.0 && between_columns > 0.0 {
        Ok([between_rows, between_columns])
    } else {
        Err(a.wrong(
            PIXEL_SPACING.name,
            &format!("{between_rows}\\{between_columns}"),
            "expected positive numbers".into(),
        ))
    }
}

/// Signed distance of slices along row x column, mm.
fn slice_spacing(a: &Attributes, warnings: &mut Vec<String>) -> Result<f64, ReadError> {
    match a.decimals(SPACING_BETWEEN_SLICES)? {
        Some([0.0]) => Err(a.wrong(
            SPACING_BETWEEN_SLICES.name,
            "0",
            "slices must lie at different positions".into(),
        )),
        Some([spacing]) => Ok(spacing),
        None => match a.decimals(SLICE_THICKNESS)? {
            Some([thickness]) if thickness > 0.0 => {
                warnings.push(format!(
                    "The file has no Spacing Between Slices: Slice Thickness {thickness} is used, \
                     and the direction of the slices is an assumption."
                ));
                Ok(thickness)
            }
            _ => Err(a.missing(SPACING_BETWEEN_SLICES)),
        },
    }
}

/// Unit vectors along a row (toward higher columns) and along a column (toward higher rows).
pub(super) fn directions(a: &Attributes, cosines: [f64; 6]) -> Result<(Vec3, Vec3), ReadError> {
    let [x0, x1, x2, y0, y1, y2] = cosines;
    let (x, y) = (Vec3::new(x0, x1, x2), Vec3::new(y0, y1, y2));
    let unit = |v: &Vec3| (v.norm() - 1.0).abs() <= COSINE_SLACK;
    if unit(&x) && unit(&y) && x.dot(&y).abs() <= COSINE_SLACK {
        Ok((x.normalize(), y.normalize()))
    } else {
        Err(a.wrong(
            DETECTOR_ORIENTATION.name,
            &format!("{cosines:?}"),
            "expected two perpendicular unit vectors".into(),
        ))
    }
}
