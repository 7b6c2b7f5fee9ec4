//! What a camera acquired, where slices were reconstructed here: the projections, and the heart's motion in them.

use super::segment::Segmentation;
use crate::base::numeric::decimals::round;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::deform::FittedModel;
use crate::heart::judge::Flag;
use crate::heart::polar::PolarSummary;
use crate::heart::views::HeartMotion;
use crate::image::draw::Image;
use crate::image::reconstruct::Projections;
use crate::image::volume::{
    self, FileFormat, FromProjections, ReadLimits, Volume, VolumeError, VolumeFile,
};
use crate::parameters::FitParameters;
use crate::results::report::{ProjectionsReport, UncorrectedReport};

/// Height of the pictures of the projections, pixels.
const PICTURE_HEIGHT: usize = 256;
/// Views in the picture.
const VIEWS_SHOWN: usize = 8;
/// Share of a picture's pixels that may be whiter than white.
const SATURATED_SHARE: f64 = 0.005;

/// The projections that a scan was reconstructed of.
#[derive(Debug, Clone)]
pub struct Acquired {
    /// The counts of all gates, as the camera acquired them.
    pub projections: Projections,
    /// The heart's motion, in views from before a correction; `None` if it was not measured.
    pub motion: Option<HeartMotion>,
    /// What the fit gave before the views were shifted back; `None` if they were not.
    pub uncorrected: Option<UncorrectedReport>,
}

/// What is made of slices.
pub(crate) trait MadeOfSlices {
    /// The format of the files, the volume that the model was fitted to, and its segmentation.
    fn parts(&self) -> (FileFormat, &Volume, &Segmentation);
    /// The flags of the fit.
    fn flags(&mut self) -> &mut Vec<Flag>;
}

/// What `make` makes of the slices in `files`, with what a camera acquired if they are projections: the heart's motion is
/// measured, its views are shifted back and all is made again if the parameters ask for it, and the flags of the fit
/// say so.
///
/// # Errors
/// Those of `make`, and [`VolumeError`].
pub(crate) fn with_motion<M: MadeOfSlices, E: From<VolumeError>>(
    files: &[VolumeFile],
    parameters: &FitParameters,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
    make: impl Fn(&FromProjections) -> Result<M, E>,
) -> Result<(M, Option<Acquired>), E> {
    let mut from = FromProjections::from(parameters.reconstruction);
    let mut made = make(&from)?;
    let (format, volume, segmentation) = made.parts();
    if format != FileFormat::DicomProjections {
        return Ok((made, None));
    }
    let how = &parameters.reconstruction;
    let Some(projections) = volume::projections(files, parameters.frame, how, limits, monitor)?
    else {
        return Ok((made, None));
    };
    let (model, offset_mm) = (&segmentation.fit.model, how.axis_offset_mm);
    let motion = HeartMotion::measured(&projections, offset_mm, model, &volume.frame, monitor);
    let mut acquired = Acquired {
        motion: motion.map_err(VolumeError::from)?,
        projections,
        uncorrected: None,
    };
    let moved = (acquired.motion.as_ref()).filter(|motion| motion.moved());
    if let Some(motion) = moved.filter(|_| parameters.correct_motion) {
        from.shifts.clone_from(&motion.shifts);
        let before = std::mem::replace(&mut made, make(&from)?);
        acquired.uncorrected = Some(uncorrected(before.parts().2, made.parts().2));
    }
    let flags = made.flags();
    *flags = acquired.judged(std::mem::take(flags));
    Ok((made, Some(acquired)))
}

impl Acquired {
    /// `flags` of a fit with what the projections tell: motion is measured, not guessed by the image.
    pub fn judged(&self, mut flags: Vec<Flag>) -> Vec<Flag> {
        if let Some(motion) = &self.motion {
            flags.retain(|flag| !matches!(flag, Flag::Motion { .. }));
            if motion.moved() {
                let [along_mm, across_mm] = motion.range_mm();
                flags.push(Flag::Moved {
                    along_mm,
                    across_mm,
                    corrected: self.uncorrected.is_some(),
                });
            }
        }
        flags.extend(self.projections.odd_view().map(|odd| Flag::OddView {
            view: odd.view + 1,
            percent: odd.percent,
        }));
        flags
    }

    /// The part of the report.
    pub fn report(&self) -> ProjectionsReport {
        ProjectionsReport::new(
            &self.projections,
            self.motion.as_ref(),
            self.uncorrected.clone(),
        )
    }

    /// Some of the views, the sinogram of the heart's rows, and the linogram, from left to right.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn picture(
        &self,
        model: &FittedModel,
        monitor: &Monitor<'_>,
    ) -> Result<Vec<u8>, Cancelled> {
        let p = &self.projections;
        let views = p.views.len();
        let shown: Vec<usize> = (0..VIEWS_SHOWN.min(views))
            .map(|n| n * views / VIEWS_SHOWN.min(views))
            .collect();
        let mut grey = vec![0.0; shown.len() / 2 * p.columns * 2 * p.rows];
        let wide = shown.len() / 2 * p.columns;
        for (n, view) in shown.iter().take(2 * (shown.len() / 2)).enumerate() {
            monitor.check()?;
            let (left, top) = (
                n % (shown.len() / 2) * p.columns,
                n / (shown.len() / 2) * p.rows,
            );
            for row in 0..p.rows {
                let own = &p.view(*view)[row * p.columns..][..p.columns];
                grey[(top + row) * wide + left..][..p.columns].copy_from_slice(own);
            }
        }
        let sheet = picture(&grey, wide, 2 * p.rows);
        let centre_row = self.row_of(model);
        let near = |row: &usize| row.abs_diff(centre_row) as f64 * p.pixel_mm < 30.0;
        let rows: Vec<usize> = (0..p.rows).filter(near).collect();
        // A row for each view, head to feet or left to right.
        let sum = |view: usize, column: usize| -> f32 {
            rows.iter()
                .map(|row| p.view(view)[row * p.columns + column])
                .sum()
        };
        let sinogram: Vec<f32> = (0..views)
            .flat_map(|view| (0..p.columns).map(move |column| (view, column)))
            .map(|(view, column)| sum(view, column))
            .collect();
        let line = |view: usize, row: usize| -> f32 {
            p.view(view)[row * p.columns..][..p.columns].iter().sum()
        };
        let linogram: Vec<f32> = (0..p.rows)
            .flat_map(|row| (0..views).map(move |view| (view, row)))
            .map(|(view, row)| line(view, row))
            .collect();
        let parts = [
            sheet,
            picture(&sinogram, p.columns, views),
            picture(&linogram, views, p.rows),
        ];
        Ok(Image::side_by_side(&parts, 8).png())
    }

    /// The row of the frames in which the heart's middle lies.
    fn row_of(&self, model: &FittedModel) -> usize {
        let z_mm = model.cup.as_ref().map_or(0.0, |cup| cup.centre.z);
        let middle = 0.5 * (self.projections.rows as f64 - 1.0);
        (middle - z_mm / self.projections.pixel_mm).clamp(0.0, 2.0 * middle) as usize
    }
}

/// What a fit gave before views were shifted back, beside what it gave after that.
fn uncorrected(before: &Segmentation, after: &Segmentation) -> UncorrectedReport {
    let segments = |made: &Segmentation| -> Vec<Option<f64>> {
        let map = made.polar.as_ref().map(PolarSummary::from_map);
        map.map_or_else(Vec::new, |map| {
            let means = map.segments.iter().map(|segment| segment.mean_percent);
            means.collect()
        })
    };
    let (own, other) = (segments(before), segments(after));
    let change = own.iter().zip(&other).map(|(before, after)| {
        let change = after.zip(*before).map(|(after, before)| after - before);
        change.map(round)
    });
    let model = &before.fit.model;
    UncorrectedReport {
        confidence: round(before.fit.judgement.confidence),
        wall_ml: round(model.wall_ml),
        cavity_ml: model.wall.as_ref().map(|wall| round(wall.cavity_ml)),
        segments_change: change.collect(),
        segments_percent: own,
    }
}

/// Values as grey, at the height of the pictures.
fn picture(values: &[f32], width: usize, height: usize) -> Image<1> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f32::total_cmp);
    let white = sorted[((1.0 - SATURATED_SHARE) * (sorted.len() - 1) as f64) as usize].max(1e-6);
    let wide = (width * PICTURE_HEIGHT / height.max(1)).clamp(1, 4 * PICTURE_HEIGHT);
    let pixels = (0..PICTURE_HEIGHT).flat_map(|y| (0..wide).map(move |x| (x, y)));
    Image {
        width: wide,
        height: PICTURE_HEIGHT,
        pixels: pixels
            .map(|(x, y)| {
                let value = values[y * height / PICTURE_HEIGHT * width + x * width / wide];
                [(255.0 * (value / white).clamp(0.0, 1.0)) as u8]
            })
            .collect(),
    }
}
