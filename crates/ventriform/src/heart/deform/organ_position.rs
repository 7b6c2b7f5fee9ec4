//! The position of an organ in a volume.

use super::error::DeformError;
use super::fitted_model::FittedModel;
use super::parameters::DeformParameters;
use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::base::progress::{Cancelled, Monitor, Stage};
use crate::heart::model::Template;
use crate::image::grid::Volume;
use crate::image::grid::blur::FWHM_PER_SIGMA;
use crate::image::grid::field::Field;
use crate::image::grid::noise_length::noise_length_mm;
use crate::image::grid::smoothness::smoothness_mm;
use crate::image::locate;
use crate::image::locate::body::{self, Blob};
use crate::image::locate::cup::Cup;
use crate::image::locate::localisation::Localisation;
use crate::image::locate::patient_orientation::PatientOrientation;

/// Half the side of the cube about a ventricle's centre whose smoothness is measured, mm.
const SMOOTHNESS_REACH_MM: f64 = 75.0;
/// Multiple of the wall's uptake at which that cube is clipped: large hot neighbours, such as a liver, are smooth.
const SMOOTHNESS_CEILING: f64 = 1.3;
/// Gaussian blur of that cube, which takes its noise away, sigma in mm.
const SMOOTHNESS_BLUR_MM: f64 = 5.0;

/// Half the side of the cube about a ventricle's centre whose noise is looked at, mm.
const NOISE_REACH_MM: f64 = 120.0;
/// Radius of the sphere about the centre that is left out: the heart itself, mm.
const NOISE_HEART_RADIUS_MM: f64 = 75.0;
/// Full width at half maximum of the blur that tells the activity about a voxel, mm.
const NOISE_ACTIVITY_BLUR_MM: f64 = 20.0;
/// Least activity of the body, of the wall's.
const NOISE_BODY_SHARE: f64 = 0.03;

/// The position of an organ in a volume: the same for all templates of the organ.
#[derive(Debug, Clone)]
pub enum OrganPosition {
    /// A left ventricle.
    Ventricle {
        /// Where it was found.
        found: Localisation,
        /// The patient's orientation in the frame.
        orientation: PatientOrientation,
        /// The smoothness of the image about it, mm ([`smoothness`](crate::image::grid::smoothness)).
        smoothness_mm: Option<f64>,
        /// The length of the image's noise beside it, mm ([`noise_length`](crate::image::grid::noise_length)).
        noise_length_mm: Option<f64>,
        /// Whether the template lies in the patient already. Otherwise it is posed by its cup.
        in_place: bool,
    },
    /// Any other organ.
    Body {
        /// The bright body.
        blob: Blob,
        /// In a map of several labels, the mask of the label that is fitted.
        mask: Option<Volume>,
    },
}

impl OrganPosition {
    /// Searches `volume` for the organ of `template`.
    ///
    /// # Errors
    /// [`DeformError`].
    pub fn find(
        volume: &Volume,
        template: &Template,
        parameters: &DeformParameters,
        monitor: &Monitor,
    ) -> Result<Self, DeformError> {
        parameters.validate()?;
        monitor.report(Stage::Localise, 0.0)?;
        let position = match template.cup {
            Some(_) => {
                let found = locate::find(volume, &parameters.hints, monitor)?.localisation()?;
                let (superior, cup) = (parameters.superior, &found.cup);
                let stated = PatientOrientation::stated(superior, parameters.anterior, &cup.axis);
                let orientation = match stated {
                    Some(stated) => stated,
                    None => PatientOrientation::observed(volume, cup, superior, monitor)?,
                };
                OrganPosition::Ventricle {
                    smoothness_mm: smoothness_about(&found, volume, monitor)?,
                    noise_length_mm: noise_length_beside(&found, volume, monitor)?,
                    found,
                    orientation,
                    in_place: false,
                }
            }
            None => {
                let mask = body::one_label(volume, &parameters.hints, monitor)?;
                let picture = mask.as_ref().unwrap_or(volume);
                let blob = body::find(picture, &parameters.hints, monitor)?;
                OrganPosition::Body { blob, mask }
            }
        };
        monitor.report(Stage::Localise, 1.0)?;
        Ok(position)
    }

    /// The position of the ventricle that `model` shows, with its cup at `cup` and the patient's orientation `superior`, for
    /// a template that lies there already; `None` for other organs.
    pub fn of_fitted(model: &FittedModel, cup: Cup, superior: Vec3) -> Option<Self> {
        let orientation = model.patient_orientation?;
        Some(Self::Ventricle {
            found: Localisation {
                cup,
                ..model.localisation.clone()?
            },
            orientation: PatientOrientation {
                superior,
                ..orientation
            },
            smoothness_mm: model.smoothness_mm,
            noise_length_mm: model.noise_length_mm,
            in_place: true,
        })
    }

    /// The patient's orientation in the frame; the frame's own for organs other than ventricles.
    pub(super) fn patient_orientation(&self) -> PatientOrientation {
        match self {
            OrganPosition::Ventricle { orientation, .. } => *orientation,
            OrganPosition::Body { .. } => PatientOrientation::FRAME,
        }
    }

    /// The smoothness of the image about a ventricle, mm; `None` for other organs.
    pub(super) fn smoothness_mm(&self) -> Option<f64> {
        match self {
            OrganPosition::Ventricle { smoothness_mm, .. } => *smoothness_mm,
            OrganPosition::Body { .. } => None,
        }
    }

    /// The length of the image's noise beside a ventricle, mm; `None` for other organs, and where too little of the
    /// body is seen.
    pub(super) fn noise_length_mm(&self) -> Option<f64> {
        match self {
            OrganPosition::Ventricle {
                noise_length_mm, ..
            } => *noise_length_mm,
            OrganPosition::Body { .. } => None,
        }
    }

    /// The image to fit to, where it is not the volume itself.
    pub(super) fn mask(&self) -> Option<&Volume> {
        match self {
            OrganPosition::Ventricle { .. } => None,
            OrganPosition::Body { mask, .. } => mask.as_ref(),
        }
    }
}

/// The image in a cube of twice `reach_mm` about `centre`.
fn cube_about(
    centre: &Vec3,
    reach_mm: f64,
    volume: &Volume,
    monitor: &Monitor,
) -> Result<Field, Cancelled> {
    let reach = Vec3::repeat(reach_mm);
    let region = Aabb::around(&[centre - reach, centre + reach]);
    Field::cut_out(volume, Some(&region), 0.0, monitor)
}

/// The smoothness of the image about the ventricle that was found, mm.
fn smoothness_about(
    found: &Localisation,
    volume: &Volume,
    monitor: &Monitor,
) -> Result<Option<f64>, Cancelled> {
    let cube = cube_about(&found.cup.centre, SMOOTHNESS_REACH_MM, volume, monitor)?;
    let mut cube = cube.clipped(SMOOTHNESS_CEILING * found.wall);
    cube.blur(SMOOTHNESS_BLUR_MM, monitor)?;
    Ok(smoothness_mm(cube.values(), cube.shape(), cube.spacing()))
}

/// The length of the image's noise in the body beside the ventricle that was found, mm.
fn noise_length_beside(
    found: &Localisation,
    volume: &Volume,
    monitor: &Monitor,
) -> Result<Option<f64>, Cancelled> {
    let centre = found.cup.centre;
    let cube = cube_about(&centre, NOISE_REACH_MM, volume, monitor)?;
    let mut activity = cube.clone();
    activity.blur(NOISE_ACTIVITY_BLUR_MM / FWHM_PER_SIGMA, monitor)?;
    let least = NOISE_BODY_SHARE * found.wall;
    let [nx, ny, _] = cube.shape();
    let counts = |index: usize| {
        let place = [index % nx, index / nx % ny, index / (nx * ny)].map(|i| i as f64);
        let place = cube.to_patient(&Vec3::from(place));
        f64::from(activity.values()[index]) >= least
            && (place - centre).norm() >= NOISE_HEART_RADIUS_MM
    };
    Ok(noise_length_mm(
        cube.values(),
        cube.shape(),
        cube.spacing(),
        counts,
    ))
}
