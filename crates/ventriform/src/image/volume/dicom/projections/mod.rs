//! Projections of a Nuclear Medicine Image: the counts of each gate, and where the detector was.
//!
//! In: the attributes of an image of the Image Type TOMO or GATED TOMO, and its pixels. Out: [`Projections`], gate by
//! gate, for [`reconstruct`](crate::image::reconstruct). After PS3.3:
//!
//! 1. C.8.4.8: the vectors say which frame is which view ([`ViewOrder`]).
//! 2. `angles`: C.8.4.11, C.8.4.12: where the detector was at each view.
//! 3. `windows`: C.8.4.10: the energy window that is reconstructed.
//! 4. Collimators must be parallel, detectors alike and upright, pixels square.
//!
//! Guaranteed: statements about the geometry that contradict each other, or that no parallel projection in equal steps
//! fits, are errors with the attribute's name; sizes are checked against the budget of a reconstruction before memory
//! is taken.
//!
//! Not guaranteed: that the camera counts angles as the standard says. Where Image Orientation (Patient) of the
//! detector says otherwise, a warning does. In a continuous rotation each view is taken for one at its stated angle.
//! Table and detector positions are not used: nothing ties the axis of rotation to the patient.

mod angles;
mod windows;

use super::super::VolumeError;
use super::super::decode::Figures;
use super::super::facts::AffineSource;
use super::super::limits::FromProjections;
use super::super::open::Placement;
use super::geometry::pixel_spacing;
use super::pixels::Pixels;
use super::posture;
use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::{Monitor, Stage};
use crate::image::reconstruct::motion::shifted_back;
use crate::image::reconstruct::{Projections, ProjectionsError, Reconstruction, View, reconstruct};
use ventriform_dicom::read::attributes::{
    Attribute, Attributes, CENTRE_OF_ROTATION, COLLIMATOR_TYPE, CORRECTED_IMAGE,
    DETECTOR_ORIENTATION, DETECTOR_TILT, NUMBER_OF_FRAMES, PIXEL_SPACING, SCAN_ARC, ZOOM_FACTOR,
};
use ventriform_dicom::read::views::ViewOrder;

/// Largest relative difference of numbers that are to be equal.
const EQUAL_SHARE: f64 = 1e-3;

/// Greatest tilt of an upright detector, degrees.
const MAX_TILT_DEG: f64 = 1.0;

/// Least cosine between a detector's columns as stated and as its angle has them.
const LEAST_COSINE: f64 = 0.97;

/// Share of the work that reading the frames is.
const READ_SHARE: f64 = 0.05;

/// An acquisition whose geometry was checked.
pub(super) struct Acquisition {
    views: Vec<View>,
    /// For each gate the stored frame of every view.
    frames: Vec<Vec<usize>>,
    columns: usize,
    rows: usize,
    pixel_mm: f64,
    /// Whether rows run to the head.
    from_feet: bool,
    from: FromProjections,
    /// Degrees that the views cover.
    pub arc_deg: f64,
}

impl Acquisition {
    /// The acquisition in an image with attributes `a`, to be reconstructed as `how` says.
    ///
    /// # Errors
    /// [`VolumeError::Field`] for what is missing, contradicts itself or fits no parallel projections,
    /// [`VolumeError::TooLarge`] beyond the budget of a reconstruction.
    pub(super) fn new(
        a: &Attributes,
        pixels: &Pixels,
        gated: bool,
        from: &FromProjections,
        warnings: &mut Vec<String>,
    ) -> Result<Self, VolumeError> {
        let order = ViewOrder::new(a, pixels.frames, gated, warnings)?;
        let pixel_mm = square_pixel(a)?;
        for detector in 0..order.detectors() {
            check_detector(a, detector, warnings)?;
        }
        let window = windows::chosen(
            a,
            order.windows(),
            from.reconstruction.energy_window,
            warnings,
        )?;
        let runs = angles::runs(a, &order)?;
        let views: Vec<View> = runs
            .iter()
            .flat_map(|run| run.views.iter().copied())
            .collect();
        let by_turn = angles::by_turn(&runs);
        let of_gate = |gate: usize| -> Vec<usize> {
            let of_run =
                |run: &angles::Run| order.views_of(window, run.detector, run.rotation, gate);
            let frames: Vec<usize> = runs
                .iter()
                .flat_map(|run| of_run(run).iter().copied())
                .collect();
            by_turn.iter().map(|at| frames[*at]).collect()
        };
        let frames = (0..order.gates()).map(of_gate).collect();
        let views: Vec<View> = by_turn.iter().map(|at| views[*at]).collect();
        let [columns, rows] = pixels.extent;
        Projections::check(columns, rows, &views).map_err(|error| refused(a, &views, error))?;
        let first = views.first().map_or(0.0, |view| view.angle_deg);
        let from_feet =
            rows_run_to_the_head(a, runs.first().map_or(first, angles::Run::start), warnings)?;
        if let Some(cited) = posture::not_supine(a) {
            warnings.push(format!(
                "{cited}: the angles of the detector are counted from the patient's back, as PS3.3 C.8.4.11 has them. \
                 If the camera counts them from the table, front and back are exchanged."
            ));
        }
        Ok(Self {
            arc_deg: angles::arc_deg(&views),
            views,
            frames,
            columns,
            rows,
            pixel_mm,
            from_feet,
            from: from.clone(),
        })
    }

    /// Gates; 1 without gating.
    pub(super) fn gates(&self) -> usize {
        self.frames.len()
    }

    /// Voxels of a volume.
    pub(super) fn shape(&self) -> [usize; 3] {
        [self.columns, self.columns, self.rows]
    }

    /// The place of the voxels: in the patient's directions, the origin in the middle of the axis of rotation.
    ///
    /// # Errors
    /// [`VolumeError::Field`] for pixels of no size.
    pub(super) fn placement(&self, a: &Attributes) -> Result<Placement, VolumeError> {
        let frame = VoxelToPatient::centred(self.shape(), [self.pixel_mm; 3], Vec3::zeros());
        let frame = frame.map_err(|_| {
            let reason = "the pixels must have a size".into();
            a.wrong(PIXEL_SPACING.name, &self.pixel_mm.to_string(), reason)
        })?;
        Ok(Placement {
            frame,
            source: AffineSource::UnknownOrigin,
            warnings: vec![format!(
                "The file holds {} projections of each volume, and slices were reconstructed here: {}, {}; without \
                 correction of attenuation, scatter and the collimator's resolution. The origin is the middle of the \
                 axis of rotation.",
                self.views.len(),
                self.how().method_text(self.views.len()),
                self.how().filter_text()
            )],
        })
    }

    /// The method and the filter, for the header of what is made.
    pub(super) fn derivation(&self) -> [String; 2] {
        let method = self.how().method_text(self.views.len());
        [
            format!("reconstructed here: {method}"),
            self.how().filter_text(),
        ]
    }

    fn how(&self) -> &Reconstruction {
        &self.from.reconstruction
    }

    /// The volume of the counts of `gates` together, and warnings about them; `coarse` for a quick look.
    ///
    /// # Errors
    /// [`VolumeError`] if a frame cannot be read.
    pub(super) fn volume(
        &self,
        pixels: &Pixels,
        gates: &[usize],
        coarse: bool,
        monitor: &Monitor,
    ) -> Result<(Vec<f32>, Vec<String>), VolumeError> {
        let (mut projections, warnings) = self.counts(pixels, gates, monitor)?;
        if self.from.shifts.len() == self.views.len() {
            projections = shifted_back(&projections, &self.from.shifts);
        }
        let how = *self.how();
        let how = if coarse { how.coarse() } else { how };
        Ok((reconstruct(&projections, &how, monitor)?, warnings))
    }

    /// The counts of `gates` together, as the camera acquired them.
    pub(super) fn counts(
        &self,
        pixels: &Pixels,
        gates: &[usize],
        monitor: &Monitor,
    ) -> Result<(Projections, Vec<String>), VolumeError> {
        let frame_pixels = self.columns * self.rows;
        let count = frame_pixels * self.views.len();
        let mut counts: Vec<f32> = Vec::new();
        let no_room = |_| VolumeError::Memory {
            bytes: 4 * count as u64,
        };
        counts.try_reserve_exact(count).map_err(no_room)?;
        counts.resize(count, 0.0);
        // Files are read from their beginning to their end.
        let of_gates = gates.iter().filter_map(|gate| self.frames.get(*gate));
        let mut stored: Vec<(usize, usize)> = of_gates
            .flat_map(|frames| {
                frames
                    .iter()
                    .enumerate()
                    .map(|(view, frame)| (*frame, view))
            })
            .collect();
        stored.sort_unstable();
        let mut reader = pixels.open()?;
        let (mut figures, mut odd) = (Figures::default(), 0_u64);
        for (done, (frame, view)) in stored.iter().enumerate() {
            let done = READ_SHARE * done as f64 / stored.len() as f64;
            let mut take = |first: usize, values: &[f32]| {
                for (offset, value) in values.iter().enumerate() {
                    let at = first + offset;
                    let (row, column) = (at / self.columns, at % self.columns);
                    let row = if self.from_feet {
                        self.rows - 1 - row
                    } else {
                        row
                    };
                    let counts = &mut counts[view * frame_pixels + row * self.columns + column];
                    if *value >= 0.0 {
                        *counts += *value;
                    } else {
                        odd += 1;
                    }
                }
            };
            let mut report = |_| monitor.report(Stage::Read, done);
            figures = reader.read(*frame, 0, figures, &mut take, &mut report)?;
        }
        let mut warnings = figures.warnings();
        if odd > 0 {
            warnings.push(format!(
                "{odd} pixels of the projections are missing or below 0, which counts are not: they count as 0."
            ));
        }
        let projections = Projections {
            counts,
            columns: self.columns,
            rows: self.rows,
            pixel_mm: self.pixel_mm,
            views: self.views.clone(),
        };
        Ok((projections, warnings))
    }
}

/// Why no volume can be made of the views.
fn refused(a: &Attributes, views: &[View], error: ProjectionsError) -> VolumeError {
    match error {
        ProjectionsError::TooFew { views, .. } => a
            .wrong(NUMBER_OF_FRAMES.name, &views.to_string(), error.to_string())
            .into(),
        ProjectionsError::Gap { .. } => {
            let value = format!("{:.0}", angles::arc_deg(views));
            a.wrong(SCAN_ARC.name, &value, error.to_string()).into()
        }
        ProjectionsError::Voxels { amount, limit } => VolumeError::TooLarge {
            file: a.file.clone(),
            what: "voxels in the volume of its projections",
            asked: amount,
            limit,
        },
        ProjectionsError::Steps { amount, limit } => VolumeError::TooLarge {
            file: a.file.clone(),
            what: "voxels times views to reconstruct",
            asked: amount,
            limit,
        },
    }
}

/// The edge of a pixel, mm.
fn square_pixel(a: &Attributes) -> Result<f64, VolumeError> {
    let [rows, columns] = pixel_spacing(a, None)?;
    if (rows - columns).abs() > EQUAL_SHARE * rows {
        let reason = "the pixels of projections must be square: export them on a square matrix of the field of view";
        return Err(a
            .wrong(
                PIXEL_SPACING.name,
                &format!("{rows}\\{columns}"),
                reason.into(),
            )
            .into());
    }
    Ok(columns)
}

/// Checks that a detector has parallel holes, stands upright and is like the first.
fn check_detector(
    a: &Attributes,
    detector: usize,
    warnings: &mut Vec<String>,
) -> Result<(), VolumeError> {
    match a
        .texts_of_item(COLLIMATOR_TYPE, detector)
        .first()
        .map(String::as_str)
    {
        Some("PARA") => {}
        None | Some("" | "UNKN") => {
            if detector == 0 {
                warnings.push(format!(
                    "The file does not say what its {} is: parallel holes are assumed.",
                    COLLIMATOR_TYPE.name
                ));
            }
        }
        Some(other) => {
            let reason = "only projections of collimators with parallel holes (PARA) are reconstructed; send the \
                          slices that the camera's own software reconstructs";
            return Err(a.wrong(COLLIMATOR_TYPE.name, other, reason.into()).into());
        }
    }
    let number = |attribute: Attribute| a.decimals_of_item::<1>(attribute, detector);
    if let Some([tilt]) = number(DETECTOR_TILT)?
        && tilt.abs() > MAX_TILT_DEG
    {
        let reason = "projections of a tilted detector are not parallel to the slices; send reconstructed slices";
        return Err(a
            .wrong(DETECTOR_TILT.name, &tilt.to_string(), reason.into())
            .into());
    }
    let zoom = |detector| a.texts_of_item(ZOOM_FACTOR, detector);
    let numbers = |texts: Vec<String>| -> Vec<f64> {
        texts.iter().filter_map(|text| text.parse().ok()).collect()
    };
    let (own, first) = (numbers(zoom(detector)), numbers(zoom(0)));
    let differs = |(own, first): (&f64, &f64)| (own - first).abs() > EQUAL_SHARE * first.abs();
    if own.iter().zip(&first).any(differs) {
        let reason = format!(
            "detector {} has another zoom than the first; they must be alike",
            detector + 1
        );
        return Err(a
            .wrong(ZOOM_FACTOR.name, &format!("{own:?}"), reason)
            .into());
    }
    let corrected = a.texts(CORRECTED_IMAGE).iter().any(|value| value == "COR");
    if let Some([offset]) = number(CENTRE_OF_ROTATION)?
        && offset != 0.0
        && !corrected
    {
        warnings.push(format!(
            "{} of detector {} is {offset}, and Corrected Image (0028,0051) does not say that it was made up for \
             (COR): the axis of rotation is taken to be in the middle of the frames. `axis_offset_mm` of `reconstruct` \
             states where it is.",
            CENTRE_OF_ROTATION.name,
            detector + 1
        ));
    }
    Ok(())
}

/// Whether the first row is that at the feet, by Image Orientation (Patient) of the first detector, whose angle at the
/// first view is `start_deg`. One that fits no detector is said, and not used.
fn rows_run_to_the_head(
    a: &Attributes,
    start_deg: f64,
    warnings: &mut Vec<String>,
) -> Result<bool, VolumeError> {
    let Some([x0, x1, x2, y0, y1, y2]) = a.decimals::<6>(DETECTOR_ORIENTATION)? else {
        return Ok(false);
    };
    let (columns, rows) = (Vec3::new(x0, x1, x2), Vec3::new(y0, y1, y2));
    let (sin, cos) = start_deg.to_radians().sin_cos();
    let by_angle = Vec3::new(-cos, sin, 0.0);
    if columns.dot(&by_angle) > LEAST_COSINE && rows.z.abs() > LEAST_COSINE {
        return Ok(rows.z > 0.0);
    }
    warnings.push(format!(
        "{} of the detector is {x0}\\{x1}\\{x2}\\{y0}\\{y1}\\{y2}, which a detector at the angle of {start_deg} \
         degrees has not, whose columns run along {:.3}\\{:.3}\\0 and rows to the feet. The angle is used: compare left \
         and right of the result with the image.",
        DETECTOR_ORIENTATION.name,
        by_angle.x + 0.0,
        by_angle.y + 0.0
    ));
    Ok(false)
}
