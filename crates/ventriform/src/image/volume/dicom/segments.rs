//! Segmentations (PS3.3 C.8.20, C.8.23) as one volume of labels.
//!
//! The value of a voxel is the Segment Number. Frames lie on the grid that their positions and the
//! Spacing Between Slices define; slices without a frame are empty, as the standard allows to omit
//! them. Of a fractional segmentation, fractions of at least one half belong to the segment.

use super::super::decode::Figures;
use super::super::facts::AffineSource;
use super::super::open::Placement;
use super::super::{Segment, VolumeError};
use super::pixels::{Pixels, too_many_voxels};
use super::stack::{Located, heights, stated_gap};
use crate::base::progress::{Monitor, Stage};
use ventriform_dicom::read::attributes::{
    Attributes, FRAME_SEGMENT, MAXIMUM_FRACTION, SEGMENTATION_TYPE, SPACING_BETWEEN_SLICES,
};

/// Most slices of the grid for each stored frame; segmentations cover few slices of long scans.
const MOST_SLICES: f64 = 4096.0;

/// Most voxels of a segmentation: 64 MiB of labels.
const MOST_VOXELS: u64 = 1 << 25;

/// Largest deviation of a frame from its slice, as a share of the distance of slices.
const PLACE_SLACK: f64 = 0.05;

/// The meaning of a stored number as a label.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Meaning {
    /// 1: the voxel belongs to the frame's segment.
    Binary,
    /// At least this number: the voxel belongs to the frame's segment.
    Fraction(f32),
    /// The number is the label.
    Label,
}

/// The frames of a segmentation on a grid.
pub(super) struct Segments {
    /// The segments.
    pub described: Vec<Segment>,
    /// The only segment to read; `None` for all.
    pub only: Option<u16>,
    meaning: Meaning,
    /// Slice and segment number of each stored frame.
    frames: Vec<(usize, u16)>,
    /// Slices of the grid.
    pub slices: usize,
}

impl Segments {
    /// Places the frames of the segmentation with attributes `a`.
    ///
    /// # Errors
    /// [`VolumeError`] if the frames do not lie on one grid, or the grid is too large.
    pub(super) fn new(
        a: &Attributes,
        pixels: &Pixels,
        most: u64,
    ) -> Result<(Self, Placement), VolumeError> {
        let contradiction = |reason: String| {
            let field = "Per-frame Functional Groups Sequence (5200,9230)";
            a.wrong(field, "contradictory", reason)
        };
        let kind = a.text(SEGMENTATION_TYPE);
        let meaning = match kind.as_deref() {
            Some("BINARY") => Meaning::Binary,
            Some("FRACTIONAL") => {
                let most = a.shorts(MAXIMUM_FRACTION).first().copied().unwrap_or(255);
                Meaning::Fraction(f32::from(most) / 2.0)
            }
            Some("LABELMAP") => Meaning::Label,
            other => {
                let value = other.unwrap_or("missing");
                let reason = "expected BINARY, FRACTIONAL or LABELMAP".into();
                return Err(a.wrong(SEGMENTATION_TYPE.name, value, reason).into());
            }
        };
        let located = (0..pixels.frames).map(|frame| Located::new(a, 0, frame));
        let located: Vec<Located> = located.collect::<Result<_, _>>()?;
        let heights = heights(&located).map_err(contradiction)?;
        let lowest = (0..heights.len()).min_by(|a, b| heights[*a].total_cmp(&heights[*b]));
        let lowest = lowest.unwrap_or_default();
        let mut rising = heights.clone();
        rising.sort_by(f64::total_cmp);
        let nearest = rising
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .filter(|gap| *gap > 0.01)
            .fold(f64::INFINITY, f64::min);
        let gap = match stated_gap(a)? {
            // A thickness above the distance of neighbouring frames is not the distance of slices.
            Some(gap) if gap <= nearest * (1.0 + PLACE_SLACK) => gap,
            _ if nearest.is_finite() => nearest,
            Some(gap) => gap,
            None => return Err(a.missing(SPACING_BETWEEN_SLICES).into()),
        };
        let mut frames = Vec::with_capacity(heights.len());
        for (frame, height) in heights.iter().enumerate() {
            let place = (height - heights[lowest]) / gap;
            let slice = place.round();
            if (place - slice).abs() > PLACE_SLACK || slice >= MOST_SLICES {
                return Err(contradiction(format!(
                    "frame {} lies {place:.2} slices of {gap:.3} mm from the first",
                    frame + 1
                ))
                .into());
            }
            let segment = a.shorts_of(FRAME_SEGMENT, Some(frame)).first().copied();
            match (segment, meaning) {
                (_, Meaning::Label) => frames.push((slice as usize, 0)),
                (Some(segment @ 1..), _) => frames.push((slice as usize, segment)),
                _ => return Err(a.missing(FRAME_SEGMENT).into()),
            }
        }
        let slices = frames.iter().map(|(slice, _)| slice + 1).max().unwrap_or(1);
        let voxels = (pixels.frame_voxels() * slices) as u64;
        let most = most.min(MOST_VOXELS);
        if voxels > most {
            return Err(too_many_voxels(a, voxels, most));
        }
        let first = &located[lowest];
        let origin = first.position.unwrap_or_default();
        let frame = first.frame(origin, first.normal() * gap);
        let frame = frame.ok_or_else(|| contradiction("the frames are flat".into()))?;
        let placement = Placement {
            frame,
            source: AffineSource::ImagePosition,
            warnings: match meaning {
                Meaning::Fraction(_) => vec![
                    "The segmentation is fractional: fractions of at least one half count.".into(),
                ],
                _ => Vec::new(),
            },
        };
        let segments = Self {
            described: Segment::all(a),
            only: None,
            meaning,
            frames,
            slices,
        };
        Ok((segments, placement))
    }

    /// The labels of all voxels, and a warning if voxels belong to several segments.
    ///
    /// # Errors
    /// [`VolumeError`] if the file is damaged, or memory is short.
    pub(super) fn labels(
        &self,
        pixels: &Pixels,
        monitor: &Monitor,
    ) -> Result<(Vec<u16>, Option<String>), VolumeError> {
        let count = pixels.frame_voxels();
        let mut labels = Vec::new();
        labels
            .try_reserve_exact(count * self.slices)
            .map_err(|_| VolumeError::Memory {
                bytes: 2 * (count * self.slices) as u64,
            })?;
        labels.resize(count * self.slices, 0);
        let mut reader = pixels.open()?;
        let mut overlaps = 0_u64;
        let meaning = self.meaning;
        for (frame, (slice, segment)) in self.frames.iter().enumerate() {
            let mut take = |first: usize, part: &[f32]| {
                let begin = slice * count + first;
                for (label, value) in labels[begin..].iter_mut().zip(part) {
                    let new = match meaning {
                        Meaning::Binary if *value > 0.0 => *segment,
                        Meaning::Fraction(least) if *value >= least => *segment,
                        Meaning::Label => *value as u16,
                        _ => 0,
                    };
                    if new > 0 && self.only.is_none_or(|only| only == new) {
                        overlaps += u64::from(*label > 0 && *label != new);
                        *label = new;
                    }
                }
            };
            let figures = Figures::default();
            reader.read(frame, *slice, figures, &mut take, &mut |share| {
                let done = (frame as f64 + share) / self.frames.len() as f64;
                monitor.report(Stage::Read, done)
            })?;
        }
        let warning = (overlaps > 0).then(|| {
            format!(
                "{overlaps} voxels belong to several segments; they have the number of the one \
                 that the file stores last."
            )
        });
        Ok((labels, warning))
    }
}
