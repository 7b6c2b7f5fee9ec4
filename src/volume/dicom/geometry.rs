//! Where the slices lie in the patient.
//!
//! PS3.3 C.8.4.15: Image Position (Patient) in the first item of the Detector Information
//! Sequence is that of the *first* slice; slice k lies at position + (row x column) * Spacing
//! Between Slices * k, and the sign of that spacing counts: GE and Siemens write negative ones.
//! Pixel Spacing is the distance of rows, then that of columns.

use super::super::VolumeError;
use super::super::facts::AffineSource;
use super::scan::{
    Attributes, DETECTOR_ORIENTATION, DETECTOR_POSITION, ORIENTATION, PIXEL_SPACING, POSITION,
    SLICE_THICKNESS, SPACING_BETWEEN_SLICES,
};
use crate::geometry::Vec3;
use crate::geometry::frame::VoxelToPatient;
use nalgebra::Matrix3;

/// How far direction cosines may be from unit length and from perpendicular.
const COSINE_SLACK: f64 = 1e-2;

/// Where the voxels are.
#[derive(Debug, Clone)]
pub(super) struct Placement {
    /// Index to LPS millimetres.
    pub frame: VoxelToPatient,
    /// Whether the origin is known.
    pub source: AffineSource,
    /// Assumptions.
    pub warnings: Vec<String>,
}

/// Places columns x rows x slices voxels in the patient.
pub(super) fn place(a: &Attributes, shape: [usize; 3]) -> Result<Placement, VolumeError> {
    let mut warnings = Vec::new();
    let Some([between_rows, between_columns]) = a.decimals(PIXEL_SPACING)? else {
        return Err(a.missing(PIXEL_SPACING));
    };
    if between_rows <= 0.0 || between_columns <= 0.0 {
        let value = format!("{between_rows}\\{between_columns}");
        return Err(a.wrong(
            PIXEL_SPACING.name,
            &value,
            "positive numbers expected".into(),
        ));
    }
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
    let (x, y) = directions(a, orientation.unwrap_or([1.0, 0.0, 0.0, 0.0, 1.0, 0.0]))?;
    if orientation.is_none() {
        warnings.push(
            "There is no Image Orientation (Patient): axial slices of a patient on the back are \
             assumed."
                .into(),
        );
    }
    let z = x.cross(&y).normalize();
    let linear =
        Matrix3::from_columns(&[between_columns * x, between_rows * y, between_slices * z]);
    let origin = position.map(Vec3::from).unwrap_or_else(|| {
        warnings.push(
            "There is no Image Position (Patient): the origin is unknown, and the array's \
             centre was taken for it."
                .into(),
        );
        -(linear * Vec3::from_fn(|axis, _| (shape[axis] as f64 - 1.0) / 2.0))
    });
    let frame = VoxelToPatient::new(linear, origin).map_err(|_| {
        let reason = "the directions and spacings span no space".into();
        a.wrong(
            DETECTOR_ORIENTATION.name,
            &format!("{orientation:?}"),
            reason,
        )
    })?;
    Ok(Placement {
        frame,
        source: match known {
            true => AffineSource::ImagePosition,
            false => AffineSource::UnknownOrigin,
        },
        warnings,
    })
}

/// Signed distance of slices along row x column.
fn slice_spacing(a: &Attributes, warnings: &mut Vec<String>) -> Result<f64, VolumeError> {
    match a.decimals(SPACING_BETWEEN_SLICES)? {
        Some([0.0]) => Err(a.wrong(
            SPACING_BETWEEN_SLICES.name,
            "0",
            "slices cannot lie in one place".into(),
        )),
        Some([spacing]) => Ok(spacing),
        None => match a.decimals(SLICE_THICKNESS)? {
            Some([thickness]) if thickness > 0.0 => {
                warnings.push(format!(
                    "There is no Spacing Between Slices: Slice Thickness {thickness} was taken, \
                     and the slices' direction is an assumption."
                ));
                Ok(thickness)
            }
            _ => Err(a.missing(SPACING_BETWEEN_SLICES)),
        },
    }
}

/// Unit vectors along a row (of rising columns) and along a column (of rising rows).
fn directions(a: &Attributes, cosines: [f64; 6]) -> Result<(Vec3, Vec3), VolumeError> {
    let [x0, x1, x2, y0, y1, y2] = cosines;
    let (x, y) = (Vec3::new(x0, x1, x2), Vec3::new(y0, y1, y2));
    let unit = |v: &Vec3| (v.norm() - 1.0).abs() <= COSINE_SLACK;
    match unit(&x) && unit(&y) && x.dot(&y).abs() <= COSINE_SLACK {
        true => Ok((x.normalize(), y.normalize())),
        false => Err(a.wrong(
            DETECTOR_ORIENTATION.name,
            &format!("{cosines:?}"),
            "two perpendicular unit vectors expected".into(),
        )),
    }
}
