//! The affine of a header: from the sform, otherwise the qform, otherwise `pixdim`.
//!
//! After `nifti1.h`, "METHOD 1" to "METHOD 3", in the order of preference of the standard's
//! reference library and of nibabel. The three are compared with each other, since a file states its
//! voxel size up to three times. What is used stays the sform, and a warning gives both figures of
//! every difference: size of the voxels, direction of the axes, handedness, place. Sizes that differ
//! by more than half are refused: no alignment with another space scales a body so much, and which
//! of both is true cannot be told (an sform of unit size beside a `pixdim` of 5 mm is a known fault
//! of converters). If the file has neither, the standard leaves the orientation open; then
//! nibabel's convention is used (left-handed storage, i toward the patient's left, the centre of
//! the array at the origin), with a warning.

use super::super::VolumeError;
use super::super::facts::{AffineSource, LengthUnit};
use super::super::open::Placement;
use super::header::Header;
use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use nalgebra::{Matrix4, Vector4};

/// Distance between sform and qform, as a share of a voxel, above which there is a warning.
const FORM_TOLERANCE: f64 = 0.1;

/// Relative difference of two voxel sizes above which there is a warning. Sizes are stated in 32-bit
/// floats, and some writers round them to three decimals.
const SIZE_SLACK: f64 = 1e-3;

/// Ratio of two voxel sizes above which the file is refused.
const SIZE_RATIO: f64 = 1.5;

/// Angle between the axes of sform and qform above which a warning names it, degrees.
const ANGLE_SLACK: f64 = 0.1;

/// Largest excess of `b^2 + c^2 + d^2` over 1 that rounding can explain.
const QUATERNION_SLACK: f64 = 1e-3;

/// Position of the volumes in the patient.
///
/// # Errors
/// [`VolumeError::Field`] if the field that defines the position is invalid.
pub(super) fn place(header: &Header) -> Result<Placement, VolumeError> {
    let mut warnings = Vec::new();
    let (ras, source) = if header.sform_code > 0 {
        let sform = sform(header)?;
        warnings.extend(sizes(header, &sform)?);
        if header.qform_code > 0 {
            warnings.extend(disagreement(header, &sform));
        }
        (sform, AffineSource::Sform)
    } else if header.qform_code > 0 {
        (qform(header)?, AffineSource::Qform)
    } else {
        warnings.push(
            "Neither sform nor qform states the orientation: i is assumed to run to the left, j to \
             the front and k to the head, with the origin at the centre of the array."
                .into(),
        );
        (from_spacing(header)?, AffineSource::Pixdim)
    };
    let scale = header.unit.in_millimetres();
    let millimetres = Matrix4::from_diagonal(&Vector4::new(scale, scale, scale, 1.0)) * ras;
    if scale != 1.0 {
        let unit = header.unit.as_str();
        warnings.push(format!(
            "Lengths are stated in {unit} and were converted to mm."
        ));
    }
    let frame = VoxelToPatient::from_ras(&millimetres).map_err(|_| {
        let value = format!("{:?}", header.srow);
        let reason = "the affine must be finite and invertible";
        wrong(header, "srow_x/y/z", value, reason)
    })?;
    warnings.extend(implausible(&frame));
    Ok(Placement {
        frame,
        source,
        warnings,
    })
}

fn wrong(header: &Header, field: &'static str, value: impl ToString, reason: &str) -> VolumeError {
    VolumeError::Field {
        file: header.file.clone(),
        field,
        value: value.to_string(),
        reason: reason.into(),
        byte: None,
    }
}

fn sform(header: &Header) -> Result<Matrix4<f64>, VolumeError> {
    const ROW_NAMES: [&str; 3] = ["srow_x", "srow_y", "srow_z"];
    for (row, name) in header.srow.iter().zip(ROW_NAMES) {
        if row.iter().any(|v| !v.is_finite()) {
            let reason = "must be four finite numbers";
            return Err(wrong(header, name, format!("{row:?}"), reason));
        }
    }
    let s = &header.srow;
    Ok(Matrix4::from_fn(|r, c| match r {
        3 => f64::from(u8::from(c == 3)),
        _ => s[r][c],
    }))
}

/// The rotation of the unit quaternion with its columns scaled by the spacing; qfac is the sign of k.
fn qform(header: &Header) -> Result<Matrix4<f64>, VolumeError> {
    let [b, c, d] = header.quatern;
    let length = b * b + c * c + d * d;
    if !length.is_finite() || length > 1.0 + QUATERNION_SLACK {
        let value = format!("({b}, {c}, {d})");
        let reason = "the squares of quatern_b, _c, _d must add up to at most 1";
        return Err(wrong(header, "quatern_b/c/d", value, reason));
    }
    // Rounding makes a^2 slightly negative for half turns; their quaternion is b, c, d alone.
    let (a, norm) = match 1.0 - length {
        rest if rest < 1e-7 => (0.0, length.sqrt()),
        rest => (rest.sqrt(), 1.0),
    };
    let (b, c, d) = (b / norm, c / norm, d / norm);
    let [dx, dy, dz] = spacing(header)?;
    let dz = if header.pixdim[0] < 0.0 { -dz } else { dz };
    for (value, name) in header
        .qoffset
        .iter()
        .zip(["qoffset_x", "qoffset_y", "qoffset_z"])
    {
        if !value.is_finite() {
            return Err(wrong(header, name, value, "must be a finite number"));
        }
    }
    let [x, y, z] = header.qoffset;
    #[rustfmt::skip]
    let affine = Matrix4::new(
        (a*a + b*b - c*c - d*d) * dx, 2.0 * (b*c - a*d) * dy, 2.0 * (b*d + a*c) * dz, x,
        2.0 * (b*c + a*d) * dx, (a*a + c*c - b*b - d*d) * dy, 2.0 * (c*d - a*b) * dz, y,
        2.0 * (b*d - a*c) * dx, 2.0 * (c*d + a*b) * dy, (a*a + d*d - b*b - c*c) * dz, z,
        0.0, 0.0, 0.0, 1.0,
    );
    Ok(affine)
}

fn from_spacing(header: &Header) -> Result<Matrix4<f64>, VolumeError> {
    let spacing = spacing(header)?;
    let signs = [-1.0, 1.0, 1.0];
    let mut affine = Matrix4::identity();
    for axis in 0..3 {
        let step = signs[axis] * spacing[axis];
        affine[(axis, axis)] = step;
        affine[(axis, 3)] = -step * (header.shape[axis] as f64 - 1.0) / 2.0;
    }
    Ok(affine)
}

/// The absolute values of the spacing, as in the reference library; 1 for dimensions that the file
/// does not have.
fn spacing(header: &Header) -> Result<[f64; 3], VolumeError> {
    const SPACING_NAMES: [&str; 3] = ["pixdim[1]", "pixdim[2]", "pixdim[3]"];
    let mut spacing = [1.0; 3];
    for axis in 0..header.dim.len().min(3) {
        let stated = header.pixdim[axis + 1].abs();
        if stated.is_finite() && stated > 0.0 {
            spacing[axis] = stated;
        } else if stated != 0.0 || header.shape[axis] != 1 {
            let value = header.pixdim[axis + 1];
            let reason = "the spacing must be a positive number";
            return Err(wrong(header, SPACING_NAMES[axis], value, reason));
        }
    }
    Ok(spacing)
}

/// A warning if the voxels of `sform` have other sizes than `pixdim` states. The sizes of the qform
/// are those of `pixdim`.
///
/// # Errors
/// [`VolumeError::Field`] if they differ by more than half.
fn sizes(header: &Header, sform: &Matrix4<f64>) -> Result<Option<String>, VolumeError> {
    let axes: Vec<usize> = (0..header.dim.len().min(3))
        .filter(|axis| header.shape[*axis] > 1)
        .collect();
    let columns = [0, 1, 2].map(|axis| sform.fixed_view::<3, 1>(0, axis).norm());
    let stated = [1, 2, 3].map(|n| header.pixdim[n].abs());
    let unit = match header.unit {
        LengthUnit::Unknown => "mm",
        unit => unit.as_str(),
    };
    let list = |sizes: [f64; 3]| {
        let sizes: Vec<String> = axes.iter().map(|axis| figure(sizes[*axis])).collect();
        format!("{} {unit}", sizes.join(" x "))
    };
    let known = |axis: &usize| stated[*axis].is_finite() && stated[*axis] > 0.0;
    if columns.contains(&0.0) {
        // No affine; refused as such.
        return Ok(None);
    }
    if !axes.iter().all(known) {
        // Fields that were never filled in. No transform is computed from them.
        return Ok((header.qform_code <= 0).then(|| {
            format!(
                "pixdim states no voxel size ({}): the sform's {} was used.",
                list(stated),
                list(columns)
            )
        }));
    }
    let ratio = |axis: &usize| {
        let ratio = columns[*axis] / stated[*axis];
        ratio.max(1.0 / ratio)
    };
    let most = axes.iter().map(ratio).fold(1.0, f64::max);
    // Also the default of a field that was never filled in, if no qform is computed from it.
    let unfilled = header.qform_code <= 0 && axes.iter().all(|axis| stated[*axis] == 1.0);
    if most > SIZE_RATIO && !unfilled {
        let reason = format!(
            "the sform (srow_x, srow_y, srow_z) states voxels of {}; which size is true cannot be told",
            list(columns)
        );
        return Err(wrong(header, "pixdim", list(stated), &reason));
    }
    Ok((most > 1.0 + SIZE_SLACK).then(|| {
        format!(
            "The sform states voxels of {} and pixdim of {}: the sform was used.",
            list(columns),
            list(stated)
        )
    }))
}

/// A length with as many digits as tell two sizes apart, without trailing zeros.
fn figure(length: f64) -> String {
    let rounded = format!("{length:.4}");
    match rounded.parse::<f64>() {
        Ok(value) if value != 0.0 => value.to_string(),
        _ => length.to_string(),
    }
}

/// A warning if the qform puts a corner of the volume at another position than `sform` does, with
/// all that differs.
fn disagreement(header: &Header, sform: &Matrix4<f64>) -> Option<String> {
    let qform = match qform(header) {
        Ok(qform) => qform,
        Err(e) => return Some(format!("The sform was used; the qform is invalid: {e}.")),
    };
    let corner = |c: usize| {
        let at = |axis: usize| match (c >> axis) & 1 {
            0 => 0.0,
            _ => header.shape[axis] as f64 - 1.0,
        };
        Vector4::new(at(0), at(1), at(2), 1.0)
    };
    let apart = (0..8).map(|c| ((sform - qform) * corner(c)).norm());
    let apart = apart.fold(0.0, f64::max);
    let axis = |m: &Matrix4<f64>, c: usize| m.fixed_view::<3, 1>(0, c).into_owned();
    let voxel = (0..3).map(|c| axis(sform, c).norm());
    let voxel = voxel.fold(f64::INFINITY, f64::min);
    let hands = [sform, &qform].map(|m| m.fixed_view::<3, 3>(0, 0).determinant() > 0.0);
    if apart <= FORM_TOLERANCE * voxel && hands[0] == hands[1] {
        return None;
    }
    let scale = header.unit.in_millimetres();
    let mut differences = Vec::new();
    let origins = [sform, &qform].map(|m| axis(m, 3) * scale);
    if (origins[0] - origins[1]).norm() > FORM_TOLERANCE * voxel * scale {
        let [s, q] = origins.map(|o| format!("({:.3}, {:.3}, {:.3})", o.x, o.y, o.z));
        differences.push(format!("origins {s} and {q} mm, RAS"));
    }
    let angle = (0..3).map(|c| axis(sform, c).angle(&axis(&qform, c)).to_degrees());
    let angle = angle.fold(0.0, f64::max);
    if angle > ANGLE_SLACK {
        differences.push(format!("axes up to {angle:.1} degrees apart"));
    }
    if hands[0] != hands[1] {
        let [s, q] = hands.map(|right| if right { "right" } else { "left" });
        differences.push(format!(
            "a {s}-handed and a {q}-handed grid: one mirrors the other"
        ));
    }
    let differences = if differences.is_empty() {
        String::new()
    } else {
        format!(" ({})", differences.join("; "))
    };
    let apart = apart * scale;
    Some(format!(
        "sform and qform put voxels up to {apart:.4} mm apart{differences}: the sform was used."
    ))
}

/// A warning if the voxel size is outside the range of any scanner.
fn implausible(frame: &VoxelToPatient) -> Option<String> {
    let [x, y, z] = frame.spacing();
    let odd = |s: f64| !(0.05..=50.0).contains(&s);
    (odd(x) || odd(y) || odd(z)).then(|| {
        let size = Vec3::new(x, y, z).map(|s| (s * 1e4).round() / 1e4);
        format!(
            "Voxels of {} x {} x {} mm are implausible: is the unit of length right?",
            size.x, size.y, size.z
        )
    })
}
