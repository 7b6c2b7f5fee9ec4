//! A segmentation beside normal limits.

use super::error::SegmentationError;
use super::segment::Segmentation;
use crate::heart::normals::{
    HeartFigure, NormalLimits, NormalsError, NormalsFlag, Perfusion, ScanKind, Sex, apply,
};
use crate::image::volume::Provenance;
use crate::parameters::FitParameters;
use crate::parameters::Parameters;

/// Parameters that the uptake of a map depends on.
const PARAMETERS_OF_UPTAKE: [&str; 2] = ["polar_blur", "polar_extension"];

/// Figures of the heart that limits may have: the cavity and the muscle of the anatomical wall.
pub fn heart_figures(segmentation: &Segmentation) -> Vec<HeartFigure> {
    let Some(surfaces) = &segmentation.fit.model.surfaces else {
        return Vec::new();
    };
    vec![
        HeartFigure::whole("cavity_ml", surfaces.anatomical.wall.cavity_ml),
        HeartFigure::whole("wall_ml", surfaces.anatomical.wall_ml),
    ]
}

/// The segmentation of a scan, and `figures` of the same heart, beside `limits`. Sex, protocol, tracer and correction
/// are those of the scan's header, if the parameters do not state them.
///
/// # Errors
/// [`SegmentationError::Normals`]: there is no polar map, the header states the other sex, or the limits do not suit
/// the scan.
pub fn judged_by_normals(
    segmentation: &Segmentation,
    figures: &[HeartFigure],
    scan: Option<&Provenance>,
    parameters: &FitParameters,
    limits: &NormalLimits,
) -> Result<Perfusion, SegmentationError> {
    let map = (segmentation.polar.as_ref()).ok_or(NormalsError::TooLittleWall { percent: 0.0 })?;
    let header = scan.and_then(|scan| Sex::parse(scan.patient_sex.as_deref()?));
    let stated = parameters.scan.sex;
    if let (Some(header), Some(stated)) = (header, stated)
        && header != stated
    {
        return Err(NormalsError::OtherSex { header, stated }.into());
    }
    let kind = ScanKind {
        sex: stated.or(header),
        tracer: (parameters.scan.tracer.clone()).or_else(|| {
            let named = limits.tracer_named(scan?.radiopharmaceutical.as_deref()?)?;
            Some(named.to_owned())
        }),
        attenuation_corrected: (parameters.scan.attenuation_corrected)
            .or_else(|| scan?.attenuation_corrected()),
        protocol: (parameters.scan.protocol.clone())
            .or_else(|| limits.protocol_of(scan?.rest_or_stress.as_deref()?)),
    };
    let mut perfusion = apply(map, figures, &kind, limits)?;
    let own = parameters.to_json();
    let built = &limits.parameters;
    let other = |name: &&&str| {
        built
            .get(**name)
            .is_some_and(|value| own.get(**name) != Some(value))
    };
    let names: Vec<String> = PARAMETERS_OF_UPTAKE
        .iter()
        .filter(other)
        .map(|name| (*name).to_owned())
        .collect();
    if !names.is_empty() {
        perfusion.flags.push(NormalsFlag::OtherParameters { names });
    }
    Ok(perfusion)
}
