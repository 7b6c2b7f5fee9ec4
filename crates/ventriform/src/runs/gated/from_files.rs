//! A beat from files: read, segment the sum, fit all gates, keep what the output needs.

use super::error::GatedError;
use super::order::GatedOrder;
use crate::base::progress::Monitor;
use crate::heart::beat::{self, Beat, BeatError, BeatFlag, BeatParameters, GatedStudy};
use crate::heart::deform::WallSurface;
use crate::heart::judge::Flag;
use crate::heart::model::MYOCARDIAL_DENSITY_G_PER_ML;
use crate::heart::normals::{HeartFigure, Perfusion};
use crate::heart::polar::SEGMENT_NAMES;
use crate::image::volume::{
    FileFormat, FromProjections, GatedReading, ReadLimits, Volume, read_gates_with,
};
use crate::mesh::TriMesh;
use crate::parameters::{BeatChoice, FitParameters, GatedParameters};
use crate::results::report::{
    BeatParts, BeatReport, FileFacts, LongAxis, PerfusionReport, Posture, RaisedFlag, Resolution,
    impression,
};
use crate::runs::segmentation::{
    MadeOfSlices, Segmentation, SegmentationParameters, heart_figures, judged_by_normals, prepare,
    segment, with_motion,
};

/// The beat of a study with what it was made from.
#[derive(Debug)]
pub struct GatedHeart {
    /// The gates and the facts of their files.
    pub reading: GatedReading,
    /// The segmentation of the gates' sum.
    pub segmentation: Segmentation,
    /// The anatomical wall of the gates' sum.
    pub wall: WallSurface,
    /// The beat.
    pub beat: Beat,
    /// The sum of the gates, each scaled to equal counts.
    pub sum: Volume,
    /// The wall of every gate, in the mean over its width, LPS mm.
    pub meshes: Vec<TriMesh>,
    /// The parameters of the fit to the gates' sum.
    pub parameters: FitParameters,
    /// The parameters of the beat.
    pub choice: BeatChoice,
    /// The R-R interval, ms: as given, or as the file states it.
    pub rr_ms: Option<f64>,
    /// Uptake and beat beside normal limits, if some were given.
    pub perfusion: Option<Perfusion>,
}

/// Makes the beat of the study of `order`.
///
/// # Errors
/// [`GatedError`].
pub fn from_files(
    order: &GatedOrder<'_>,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<GatedHeart, GatedError> {
    if let Some((name, value, [least, greatest])) = order.choice.out_of_range() {
        return Err(GatedError::Parameter {
            name,
            value,
            least,
            greatest,
        });
    }
    fitted_sum(order, limits, monitor)?.beat(order, monitor)
}

impl FittedSum {
    /// The beat of these gates.
    ///
    /// # Errors
    /// [`GatedError`].
    pub(crate) fn beat(
        self,
        order: &GatedOrder<'_>,
        monitor: &Monitor<'_>,
    ) -> Result<GatedHeart, GatedError> {
        let FittedSum {
            mut reading,
            study,
            segmentation,
        } = self;
        let parameters = order.parameters.clone();
        let model = &segmentation.fit.model;
        let surfaces = model.surfaces.as_ref().ok_or(BeatError::NoVentricle)?;
        let wall = surfaces.anatomical.clone();
        let (Some(map), Some(resolution)) = (&segmentation.polar, segmentation.resolution) else {
            return Err(BeatError::NoVentricle.into());
        };
        let beat_parameters = BeatParameters {
            thickness: surfaces.thickness,
            muscle_ml: (parameters.mass_g).map(|mass_g| mass_g / MYOCARDIAL_DENSITY_G_PER_ML),
            ..BeatParameters::default()
        };
        let fitted = beat::fit(
            &study,
            &wall.wall,
            resolution.value,
            &beat_parameters,
            monitor,
        )?;
        let rr_ms = (order.choice.rr_ms).or_else(|| reading.timing.rr_of(study.gates.len()));
        let beat = Beat::new(fitted, &study, map, rr_ms);
        reading.gates = study.gates;
        let judged = |limits| {
            let figures = beat_figures(&segmentation, &beat);
            let scan = reading.provenance();
            judged_by_normals(&segmentation, &figures, scan, &parameters, limits)
        };
        let perfusion = order.normals.map(judged).transpose()?;
        Ok(GatedHeart {
            meshes: beat.fit.carried(&wall.mesh, &wall.wall),
            perfusion,
            sum: study.sum,
            reading,
            wall,
            beat,
            parameters,
            choice: order.choice,
            rr_ms,
            segmentation,
        })
    }
}

/// The gates' sum and its segmentation.
#[derive(Debug)]
pub(crate) struct FittedSum {
    /// The files, without the gates.
    pub reading: GatedReading,
    /// The gates and their sum.
    pub study: GatedStudy,
    /// The segmentation of the sum.
    pub segmentation: Segmentation,
}

impl MadeOfSlices for FittedSum {
    fn parts(&self) -> (FileFormat, &Volume, &Segmentation) {
        let format = self.reading.facts.format;
        (format, &self.study.sum, &self.segmentation)
    }

    fn flags(&mut self) -> &mut Vec<Flag> {
        &mut self.segmentation.fit.judgement.flags
    }
}

/// The gates' sum, segmented; of projections with the heart's motion measured, and corrected if the parameters ask for it.
///
/// # Errors
/// [`GatedError`].
pub(crate) fn fitted_sum(
    order: &GatedOrder<'_>,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<FittedSum, GatedError> {
    let make = |from: &FromProjections| made_of(order, from, limits, monitor);
    let (fitted, _) = with_motion(order.gates, order.parameters, limits, monitor, make)?;
    Ok(fitted)
}

/// The segmentation of the sum of gates that are made as `from` says.
fn made_of(
    order: &GatedOrder<'_>,
    from: &FromProjections,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<FittedSum, GatedError> {
    let parameters = order.parameters;
    let mut reading = read_gates_with(order.gates, order.choice.gated, from, limits, monitor)?;
    let study = GatedStudy::new(std::mem::take(&mut reading.gates), &reading.lost, monitor)?;
    let fit = SegmentationParameters {
        deform: parameters
            .on(
                &study.sum,
                reading.facts.affine_source,
                reading.provenance(),
            )
            .map_err(crate::runs::segmentation::SegmentationError::from)?,
        polar: parameters.polar,
        kept_model: parameters.kept_model.clone(),
        segments_from: parameters.segments_from,
        reader: None,
    };
    let (templates, refused) = prepare(order.auto, &order.models, parameters.organ, monitor)?;
    let mut segmentation = segment(&study.sum, &templates, &fit, None, monitor)?;
    segmentation.refused.splice(0..0, refused);
    Ok(FittedSum {
        reading,
        study,
        segmentation,
    })
}

/// Figures of the heart that limits may have: those of the wall of the gates' sum, and of the beat if the gates are
/// one.
pub fn beat_figures(segmentation: &Segmentation, beat: &Beat) -> Vec<HeartFigure> {
    let whole = HeartFigure::whole;
    let mut figures = heart_figures(segmentation);
    let Some(ef_percent) = beat.ef_percent else {
        return figures;
    };
    figures.extend([
        whole("ef_percent", ef_percent),
        whole("edv_ml", beat.end_diastole.cavity_ml),
        whole("esv_ml", beat.end_systole.cavity_ml),
    ]);
    if beat.has_phases() {
        figures.extend([
            whole("phase_sd_degrees", beat.phases.sd_degrees),
            whole("phase_bandwidth_degrees", beat.phases.bandwidth_degrees),
        ]);
    }
    for segment in &beat.segments {
        let own = |figure, value| HeartFigure::of_segment(figure, segment.segment, value);
        figures.extend([
            own("motion_mm", segment.motion_mm),
            own("thickening_percent", segment.thickening_percent),
        ]);
    }
    figures
}

impl GatedHeart {
    /// Reasons to look closer by what the file says of the beats, and by what the caller says of the wall.
    fn stated_flags(&self) -> Vec<BeatFlag> {
        let found_g = MYOCARDIAL_DENSITY_G_PER_ML * self.beat.mean_wall_ml();
        let given = self.parameters.mass_g;
        let rejected = (self.reading.timing.rejected_share()).and_then(BeatFlag::of_rejected);
        let mass = given.and_then(|given_g| BeatFlag::of_mass(given_g, found_g));
        rejected.into_iter().chain(mass).collect()
    }

    /// Reasons to look closer at the beat.
    pub fn flags(&self) -> Vec<BeatFlag> {
        let mut flags = self.stated_flags();
        flags.extend(self.beat.flags.iter().cloned());
        flags
    }

    /// The report.
    pub fn report(&self) -> BeatReport {
        let segmentation = &self.segmentation;
        let names = match &segmentation.polar {
            Some(map) => (1..=17).map(|segment| map.name_of(segment)).collect(),
            None => SEGMENT_NAMES.map(str::to_owned).to_vec(),
        };
        let parameters = GatedParameters {
            fit: self.parameters.clone(),
            choice: self.choice,
        };
        let stated = self.stated_flags();
        let parts = BeatParts {
            segment_names: names,
            frames: self.reading.frames.clone(),
            rr_ms: self.rr_ms,
            timing: self.reading.timing.clone(),
            long_axis: segmentation.fit.model.cup.as_ref().map(LongAxis::from_cup),
            posture: (segmentation.fit.model.patient_orientation)
                .as_ref()
                .map(Posture::from_orientation),
            resolution: segmentation
                .resolution
                .map(|r| Resolution::new(r.value, r.given)),
            template: segmentation.candidates[segmentation.chosen].name.clone(),
            confidence: segmentation.fit.judgement.confidence,
            flags: (segmentation.fit.judgement.flags.iter())
                .map(|flag| RaisedFlag::new(flag.code(), flag))
                .chain(stated.iter().map(|flag| RaisedFlag::new(flag.code(), flag)))
                .collect(),
            parameters: parameters.to_json(),
            input: FileFacts::from_facts(&self.reading.facts),
            warnings: self.reading.facts.warnings.clone(),
            perfusion: (self.perfusion.as_ref().zip(segmentation.polar.as_ref()))
                .map(|(perfusion, map)| PerfusionReport::new(perfusion, map)),
        };
        let mut report = BeatReport::new(&self.beat, parts);
        report.impression = Some(impression::of_beat(&report));
        report
    }
}
