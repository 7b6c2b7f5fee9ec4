//! Puts frames that each have a position in order: slices of a series, frames of an Enhanced image or
//! of a Segmentation.
//!
//! After PS3.3 C.7.6.2.1.1: Image Position (Patient) is the centre of the first pixel, Image
//! Orientation (Patient) the directions of a row and of a column. Neither file names, nor Instance
//! Numbers, nor the stored order say where a slice lies. Steps:
//!
//! 1. All frames must have the same directions and pixel spacing.
//! 2. Positions along row x column, rising, are the slices; positions closer than 0.01 mm are one.
//! 3. Several frames at every position are several volumes: ordered by time, then by number.
//! 4. Neighbouring slices must lie equally far apart. The step from one to the next is taken from the
//!    positions, so that it may be oblique to the slices (a tilted gantry).
//!
//! A slice that is missing is an error, because a volume with a gap would show the anatomy too short.

use super::super::VolumeError;
use super::super::facts::AffineSource;
use super::super::open::Placement;
use super::attributes::{
    Attributes, FRAME_BETWEEN_SLICES, FRAME_DATE_TIME, FRAME_ORIENTATION, FRAME_POSITION,
    FRAME_REFERENCE_TIME, FRAME_TEMPORAL_INDEX, FRAME_THICKNESS, INSTANCE_NUMBER, ORIENTATION,
    POSITION, SLICE_THICKNESS, SPACING_BETWEEN_SLICES, TEMPORAL_POSITION, TRIGGER_TIME,
};
use super::geometry::{directions, pixel_spacing};
use crate::geometry::Vec3;
use crate::geometry::frame::VoxelToPatient;
use nalgebra::Matrix3;

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
    /// Distance of rows and of columns, mm.
    spacing: [f64; 2],
    /// What orders frames at the same position.
    rank: [f64; 5],
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
    pub(super) fn of(a: &Attributes, part: usize, frame: usize) -> Result<Self, VolumeError> {
        let of = Some(frame);
        let orientation = match a.decimals_of(FRAME_ORIENTATION, of)? {
            Some(orientation) => Some(orientation),
            None => a.decimals(ORIENTATION)?,
        };
        let position = match a.decimals_of::<3>(FRAME_POSITION, of)? {
            Some(position) => Some(position),
            None => a.decimals(POSITION)?,
        };
        let (x, y) = directions(a, orientation.unwrap_or([1.0, 0.0, 0.0, 0.0, 1.0, 0.0]))?;
        let number = |attribute| match a.decimals::<1>(attribute) {
            Ok(Some([number])) => number,
            _ => 0.0,
        };
        let index = a.long_of(FRAME_TEMPORAL_INDEX, frame);
        Ok(Self {
            part,
            frame,
            position: position.map(Vec3::from),
            axes: [x, y],
            oriented: orientation.is_some(),
            spacing: pixel_spacing(a, of)?,
            rank: [
                index.map_or_else(|| number(TEMPORAL_POSITION), f64::from),
                number(TRIGGER_TIME),
                number(FRAME_REFERENCE_TIME),
                a.decimals_of::<1>(FRAME_DATE_TIME, of)
                    .ok()
                    .flatten()
                    .map_or(0.0, |[time]| time),
                number(INSTANCE_NUMBER),
            ],
        })
    }

    /// The direction of rising slices.
    pub(super) fn normal(&self) -> Vec3 {
        self.axes[0].cross(&self.axes[1]).normalize()
    }

    /// Whether rows, columns and pixels are those of `other`.
    fn is_like(&self, other: &Self) -> bool {
        let axes = self.axes.iter().zip(&other.axes);
        let spacing = self.spacing.iter().zip(&other.spacing);
        axes.into_iter().all(|(a, b)| (a - b).norm() <= SAME_GRID)
            && spacing
                .into_iter()
                .all(|(a, b)| (a - b).abs() <= SAME_GRID * a)
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
/// What contradicts one volume.
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
    /// volume of one slice; `shape` has the columns and rows.
    ///
    /// # Errors
    /// What contradicts one volume.
    pub(super) fn of(
        frames: &[Located],
        [columns, rows]: [usize; 2],
        gap: Option<f64>,
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
        let by_rank = |a: &usize, b: &usize| {
            let (a, b) = (&frames[*a], &frames[*b]);
            let ranks = a.rank.iter().zip(&b.rank).map(|(a, b)| a.total_cmp(b));
            let ranks = ranks.fold(std::cmp::Ordering::Equal, |all, next| all.then(next));
            ranks.then((a.part, a.frame).cmp(&(b.part, b.frame)))
        };
        let mut sorted = vec![0; frames.len()];
        for (slice, group) in groups.iter().enumerate() {
            let mut group = group.to_vec();
            group.sort_by(by_rank);
            for (volume, frame) in group.into_iter().enumerate() {
                sorted[volume * slices + slice] = frame;
            }
        }
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
        if !first.oriented {
            warnings.push(unoriented());
        }
        let frame = first.frame(origin, step).ok_or_else(flat)?;
        Ok(Self {
            slices,
            order: sorted,
            placement: Placement {
                frame,
                source: match first.oriented {
                    true => AffineSource::ImagePosition,
                    false => AffineSource::UnknownOrigin,
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
        warnings.extend((!first.oriented).then(unoriented));
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

fn one_slice() -> String {
    "The file holds a single slice. Send all files of the series together to get the whole volume."
        .into()
}

fn unoriented() -> String {
    "The file has no Image Orientation (Patient): axial slices of a supine patient are assumed."
        .into()
}

fn flat() -> String {
    "directions and spacings must span three dimensions".into()
}

fn known_gap(gap: Option<f64>) -> Result<f64, String> {
    gap.ok_or_else(|| "a single slice needs a Slice Thickness (0018,0050)".into())
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

    fn at(z: f64, rank: f64) -> Located {
        Located {
            part: 0,
            frame: 0,
            position: Some(Vec3::new(1.0, 2.0, z)),
            axes: [Vec3::x(), Vec3::y()],
            oriented: true,
            spacing: [2.0, 3.0],
            rank: [rank, 0.0, 0.0, 0.0, 0.0],
        }
    }

    #[test]
    fn positions_order_slices_and_ranks_order_volumes() {
        let frames = [at(8.0, 2.0), at(4.0, 1.0), at(4.0, 2.0), at(8.0, 1.0)];
        let stack = Stack::of(&frames, [5, 5], None).unwrap();
        assert_eq!((stack.slices, &*stack.order), (2, &[1, 3, 2, 0][..]));
        let frame = &stack.placement.frame;
        assert_eq!(frame.spacing(), [3.0, 2.0, 4.0]);
        let last = frame.to_patient(&Vec3::new(1.0, 1.0, 1.0));
        assert!((last - Vec3::new(4.0, 4.0, 8.0)).norm() < 1e-12);
    }

    #[test]
    fn gaps_and_strangers_are_named() {
        let of = |frames: &[Located]| Stack::of(frames, [5, 5], Some(4.0)).map(|s| s.slices);
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
