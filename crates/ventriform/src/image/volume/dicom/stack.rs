//! Puts frames that each have a position in order: slices of a series, frames of an Enhanced image or
//! of a Segmentation.
//!
//! After PS3.3 C.7.6.2.1.1: Image Position (Patient) is the centre of the first pixel, Image
//! Orientation (Patient) the directions of a row and of a column. Neither file names, nor Instance
//! Numbers, nor the stored order say where a slice lies. Steps:
//!
//! 1. All frames must have the same directions and pixel spacing.
//! 2. Positions along row x column, rising, are the slices; positions closer than 0.01 mm are one.
//! 3. Several frames at every position are several volumes: [`ventriform_dicom::read::volumes`] tells which belong
//!    together.
//! 4. Neighbouring slices must lie equally far apart. The step from one to the next is taken from the
//!    positions, so that it may be oblique to the slices (a tilted gantry).
//!
//! A slice that is missing is an error, because a volume with a gap would show the anatomy too short.

use super::super::VolumeError;
use super::super::facts::AffineSource;
use super::super::open::Placement;
use super::geometry::{directions, pixel_spacing};
use super::posture;
use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use nalgebra::Matrix3;
use std::collections::BTreeSet;
use ventriform_dicom::read::attributes::{
    Attribute, Attributes, DETECTOR_ORIENTATION, DETECTOR_POSITION, FRAME_BETWEEN_SLICES,
    FRAME_ORIENTATION, FRAME_POSITION, FRAME_THICKNESS, ORIENTATION, POSITION, SLICE_THICKNESS,
    SPACING_BETWEEN_SLICES,
};
use ventriform_dicom::read::kind::is_nuclear;
use ventriform_dicom::read::volumes::{Marks, deal};

/// Positions closer than this are the same, mm.
const SAME_POSITION: f64 = 0.01;

/// Largest deviation of a slice from its place, as a share of the distance of slices.
const PLACE_SLACK: f64 = 0.03;

/// Largest deviation of directions and relative deviation of spacings between frames.
const SAME_GRID: f64 = 1e-3;

/// A frame and its place.
#[derive(Debug, Clone)]
pub(super) struct Located {
    /// Number of the file, from 0.
    pub part: usize,
    /// Number of the stored frame in the file, from 0.
    pub frame: usize,
    /// Centre of the first pixel, if known.
    pub position: Option<Vec3>,
    /// Directions of a row and of a column.
    axes: [Vec3; 2],
    /// Whether the file states the directions.
    oriented: bool,
    /// What they were taken from if it does not, or what contradicts them.
    notes: Vec<String>,
    /// Distance of rows and of columns, mm.
    spacing: [f64; 2],
    /// Attributes that tell frames at the same position apart.
    pub marks: Marks,
}

/// Frames in order.
pub(super) struct Stack {
    /// Slices of one volume.
    pub slices: usize,
    /// Indices of frames: volume after volume, slice after slice.
    pub order: Vec<usize>,
    /// Position of the volume.
    pub placement: Placement,
}

impl Located {
    /// The place of stored frame number `frame` of file number `part`.
    ///
    /// # Errors
    /// [`VolumeError::Field`] for invalid or missing spacings and directions.
    pub(super) fn new(a: &Attributes, part: usize, frame: usize) -> Result<Self, VolumeError> {
        let of = Some(frame);
        let first = |attributes: [Attribute; 3]| {
            let stated = attributes.into_iter();
            let mut stated = stated.filter(|attribute| !a.texts_of(*attribute, of).is_empty());
            stated.next()
        };
        let mut orientations = [FRAME_ORIENTATION, ORIENTATION, DETECTOR_ORIENTATION];
        let mut positions = [FRAME_POSITION, POSITION, DETECTOR_POSITION];
        // A slice of a Nuclear Medicine series has its place where an image of all its slices has.
        if is_nuclear(a) {
            orientations.swap(1, 2);
            positions.swap(1, 2);
        }
        let orientation = match first(orientations) {
            Some(attribute) => a.decimals_of(attribute, of)?,
            None => None,
        };
        let position = match first(positions) {
            Some(attribute) => a.decimals_of::<3>(attribute, of)?,
            None => None,
        };
        let mut notes = Vec::new();
        let cosines = match orientation {
            Some(cosines) => cosines,
            None => {
                let assumed = posture::assumed(a)?;
                notes.push(assumed.warning);
                assumed.cosines
            }
        };
        let (x, y) = directions(a, cosines)?;
        if orientation.is_some() {
            notes.extend(posture::contradictions(a, [x, y], Vec3::zeros()));
        }
        Ok(Self {
            part,
            frame,
            position: position.map(Vec3::from),
            axes: [x, y],
            oriented: orientation.is_some(),
            notes,
            spacing: pixel_spacing(a, of)?,
            marks: Marks::default(),
        })
    }

    /// The direction of rising slices.
    pub(super) fn normal(&self) -> Vec3 {
        self.axes[0].cross(&self.axes[1]).normalize()
    }

    /// Whether rows, columns and pixels are those of `other`.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let axes = self.axes.iter().zip(&other.axes);
        let spacing = self.spacing.iter().zip(&other.spacing);
        axes.into_iter().all(|(a, b)| (a - b).norm() <= SAME_GRID)
            && spacing
                .into_iter()
                .all(|(a, b)| (a - b).abs() <= SAME_GRID * a)
    }

    /// Whether it covers the same pixels of the patient as `other`.
    pub(super) fn is_same_place(&self, other: &Self) -> bool {
        let apart = match (self.position, other.position) {
            (Some(a), Some(b)) => (a - b).norm(),
            (None, None) => 0.0,
            _ => f64::INFINITY,
        };
        self.is_like(other) && apart <= SAME_POSITION
    }

    /// Voxel index to patient, with the first voxel at `origin` and `step` from slice to slice.
    pub(super) fn frame(&self, origin: Vec3, step: Vec3) -> Option<VoxelToPatient> {
        let ([x, y], [rows, columns]) = (self.axes, self.spacing);
        let linear = Matrix3::from_columns(&[columns * x, rows * y, step]);
        VoxelToPatient::new(linear, origin).ok()
    }
}

/// The stated distance of slices of file `a`, mm; positive.
///
/// # Errors
/// [`VolumeError::Field`] if the value is no number.
pub(super) fn stated_gap(a: &Attributes) -> Result<Option<f64>, VolumeError> {
    for attribute in [
        FRAME_BETWEEN_SLICES,
        SPACING_BETWEEN_SLICES,
        FRAME_THICKNESS,
        SLICE_THICKNESS,
    ] {
        if let Some([gap]) = a.decimals_of(attribute, Some(0))?
            && gap != 0.0
        {
            return Ok(Some(gap.abs()));
        }
    }
    Ok(None)
}

/// Checks that all frames have the grid of the first and a position, and returns for each how far it
/// lies along row x column, mm.
///
/// # Errors
/// The contradiction to one volume.
pub(super) fn heights(frames: &[Located]) -> Result<Vec<f64>, String> {
    let first = &frames[0];
    if let Some(other) = frames.iter().find(|frame| !frame.is_like(first)) {
        return Err(format!(
            "the slices lie in different directions or have different pixel spacings ({:.3?} and \
             {:.3?} mm)",
            first.spacing, other.spacing
        ));
    }
    let normal = first.normal();
    let each = frames
        .iter()
        .map(|frame| Some(frame.position?.dot(&normal)));
    let heights: Option<Vec<f64>> = each.collect();
    heights.ok_or_else(|| "slices without an Image Position (Patient) have no order".into())
}

impl Stack {
    /// Orders `frames`, of which there is at least one. `gap` is the stated distance of slices, for a
    /// volume of one slice; `name` says for error messages which frame that of an index is.
    ///
    /// # Errors
    /// The contradiction to one volume.
    pub(super) fn new(
        frames: &[Located],
        [columns, rows]: [usize; 2],
        gap: Option<f64>,
        name: &dyn Fn(usize) -> String,
    ) -> Result<Self, String> {
        let first = &frames[0];
        if frames.len() == 1 && first.position.is_none() {
            return Self::unplaced(first, [columns, rows], gap);
        }
        let heights = heights(frames)?;
        let mut order: Vec<usize> = (0..frames.len()).collect();
        order.sort_by(|&a, &b| heights[a].total_cmp(&heights[b]));
        let groups: Vec<&[usize]> = order
            .chunk_by(|&a, &b| heights[b] - heights[a] <= SAME_POSITION)
            .collect();
        let (slices, volumes) = (groups.len(), groups[0].len());
        if let Some(group) = groups.iter().find(|group| group.len() != volumes) {
            return Err(format!(
                "there are {} slices at {:.2} mm along the axis of the slices, but {volumes} at \
                 {:.2} mm",
                group.len(),
                heights[group[0]],
                heights[groups[0][0]],
            ));
        }
        if slices == 1 && volumes > 1 {
            return Err(format!(
                "all {volumes} images lie at one place, {:.2} mm along the axis of the slices \
                 (Image Position (Patient) (0020,0032)); a volume needs slices at different places",
                heights[0]
            ));
        }
        for group in &groups {
            check_side_by_side(frames, group, name)?;
        }
        let groups: Vec<Vec<usize>> = groups.iter().map(|group| group.to_vec()).collect();
        let marks: Vec<&Marks> = frames.iter().map(|frame| &frame.marks).collect();
        let dealt = deal(&groups, &marks, name).map_err(|reason| {
            format!("there are {volumes} images at every place of a slice, and {reason}")
        })?;
        let sorted: Vec<usize> = dealt.into_iter().flatten().collect();
        let position = |slice: usize| frames[sorted[slice]].position.unwrap_or_default();
        let origin = position(0);
        let mut warnings = Vec::new();
        let step = match slices {
            1 => {
                warnings.push(one_slice());
                first.normal() * known_gap(gap)?
            }
            _ => (position(slices - 1) - origin) / (slices as f64 - 1.0),
        };
        check_steps(&position, slices, step)?;
        let notes: BTreeSet<&String> = frames.iter().flat_map(|frame| &frame.notes).collect();
        warnings.extend(notes.into_iter().cloned());
        let frame = first.frame(origin, step).ok_or_else(flat)?;
        Ok(Self {
            slices,
            order: sorted,
            placement: Placement {
                frame,
                source: if first.oriented {
                    AffineSource::ImagePosition
                } else {
                    AffineSource::UnknownOrigin
                },
                warnings,
            },
        })
    }

    /// One slice without a position.
    fn unplaced(first: &Located, extent: [usize; 2], gap: Option<f64>) -> Result<Self, String> {
        let step = first.normal() * known_gap(gap)?;
        let around = first.frame(Vec3::zeros(), step).ok_or_else(flat)?;
        let [columns, rows] = extent.map(|n| (n as f64 - 1.0) / 2.0);
        let origin = -around.to_patient(&Vec3::new(columns, rows, 0.0));
        let mut warnings = vec![
            one_slice(),
            "The file has no Image Position (Patient): the origin is placed at the centre of the \
             array."
                .into(),
        ];
        warnings.extend(first.notes.iter().cloned());
        Ok(Self {
            slices: 1,
            order: vec![0],
            placement: Placement {
                frame: first.frame(origin, step).ok_or_else(flat)?,
                source: AffineSource::UnknownOrigin,
                warnings,
            },
        })
    }
}

/// The warning about a volume of one slice.
pub(super) fn one_slice() -> String {
    "The file holds a single slice. Send all files of the series together to get the whole volume."
        .into()
}

fn flat() -> String {
    "directions and spacings must span three dimensions".into()
}

fn known_gap(gap: Option<f64>) -> Result<f64, String> {
    gap.ok_or_else(|| "a single slice needs a Slice Thickness (0018,0050)".into())
}

/// Checks that the frames of `group`, which lie at the same height, cover the same pixels.
fn check_side_by_side(
    frames: &[Located],
    group: &[usize],
    name: &dyn Fn(usize) -> String,
) -> Result<(), String> {
    let [rows, columns] = frames[group[0]].spacing;
    let slack = (PLACE_SLACK * rows.min(columns)).max(SAME_POSITION);
    let apart = |a: usize, b: usize| match (frames[a].position, frames[b].position) {
        (Some(a), Some(b)) => (a - b).norm(),
        _ => 0.0,
    };
    if group.iter().all(|other| apart(group[0], *other) <= slack) {
        return Ok(());
    }
    // The same two in whatever order the files came.
    let mut named: Vec<(String, usize)> =
        group.iter().map(|frame| (name(*frame), *frame)).collect();
    named.sort_unstable();
    let first = named[0].1;
    let far = |(_, a): &&(String, usize), (_, b): &&(String, usize)| {
        apart(first, *a).total_cmp(&apart(first, *b))
    };
    let other = named.iter().rev().max_by(far).unwrap_or(&named[0]);
    Err(format!(
        "{} and {} lie side by side in one plane, {:.2} mm apart",
        named[0].0,
        other.0,
        apart(first, other.1)
    ))
}

/// Checks that slice k lies `step` * k from the first.
fn check_steps(position: &dyn Fn(usize) -> Vec3, slices: usize, step: Vec3) -> Result<(), String> {
    let slack = (PLACE_SLACK * step.norm()).max(SAME_POSITION);
    let off = |slice: &usize| {
        let expected = position(0) + step * *slice as f64;
        (position(*slice) - expected).norm() > slack
    };
    if !(0..slices).any(|slice| off(&slice)) {
        return Ok(());
    }
    let gaps = (1..slices).map(|k| (position(k) - position(k - 1)).norm());
    let (least, most) = gaps.fold((f64::INFINITY, 0.0_f64), |(least, most), gap| {
        (least.min(gap), most.max(gap))
    });
    Err(format!(
        "neighbouring slices lie {least:.3} to {most:.3} mm apart; slices are missing, or they do \
         not form one block"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ventriform_dicom::read::volumes::Mark;

    fn name(frame: usize) -> String {
        format!("frame {frame}")
    }

    fn at(z: f64, rank: f64) -> Located {
        Located {
            part: 0,
            frame: 0,
            position: Some(Vec3::new(1.0, 2.0, z)),
            axes: [Vec3::x(), Vec3::y()],
            oriented: true,
            notes: Vec::new(),
            spacing: [2.0, 3.0],
            marks: Marks::from([Mark::trigger_time(rank)]),
        }
    }

    #[test]
    fn positions_order_slices_and_ranks_order_volumes() {
        let frames = [at(8.0, 2.0), at(4.0, 1.0), at(4.0, 2.0), at(8.0, 1.0)];
        let stack = Stack::new(&frames, [5, 5], None, &name).unwrap();
        assert_eq!((stack.slices, &*stack.order), (2, &[1, 3, 2, 0][..]));
        let frame = &stack.placement.frame;
        assert_eq!(frame.spacing(), [3.0, 2.0, 4.0]);
        let last = frame.to_patient(&Vec3::new(1.0, 1.0, 1.0));
        assert!((last - Vec3::new(4.0, 4.0, 8.0)).norm() < 1e-12);
    }

    #[test]
    fn gaps_and_strangers_are_named() {
        let of =
            |frames: &[Located]| Stack::new(frames, [5, 5], Some(4.0), &name).map(|s| s.slices);
        let gap = of(&[at(0.0, 0.0), at(4.0, 0.0), at(12.0, 0.0)]).unwrap_err();
        assert!(gap.contains("4.000 to 8.000 mm"), "{gap}");
        let twice = of(&[at(0.0, 0.0), at(0.0, 1.0), at(4.0, 0.0)]).unwrap_err();
        assert!(twice.contains("1 slices at 4.00 mm"), "{twice}");
        let mut wide = at(4.0, 0.0);
        wide.spacing = [2.0, 3.1];
        assert!(of(&[at(0.0, 0.0), wide]).unwrap_err().contains("different"));
        let mut lost = at(4.0, 0.0);
        lost.position = None;
        assert!(of(&[at(0.0, 0.0), lost.clone()]).is_err());
        assert_eq!(of(&[lost]), Ok(1));
        // A tilted gantry moves each slice along the rows too.
        let tilted: Vec<Located> = (0..4)
            .map(|k| {
                let mut slice = at(4.0 * f64::from(k), 0.0);
                slice.position = Some(Vec3::new(0.0, f64::from(k), 4.0 * f64::from(k)));
                slice
            })
            .collect();
        assert_eq!(of(&tilted), Ok(4));
    }
}
