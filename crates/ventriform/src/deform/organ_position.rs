//! The position of an organ in a volume.

use super::error::DeformError;
use super::parameters::DeformParameters;
use crate::grid::Volume;
use crate::locate;
use crate::locate::body::{self, Blob};
use crate::locate::localisation::Localisation;
use crate::locate::patient_orientation::PatientOrientation;
use crate::model::Template;
use crate::progress::{Monitor, Stage};

/// The position of an organ in a volume: the same for all templates of the organ.
#[derive(Debug, Clone)]
pub enum OrganPosition {
    /// A left ventricle.
    Ventricle {
        /// Where it was found.
        found: Localisation,
        /// The patient's orientation in the frame.
        orientation: PatientOrientation,
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
                let found =
                    locate::find(volume, &parameters.hints, monitor)?.localisation(monitor)?;
                let (superior, cup) = (parameters.superior, &found.cup);
                let stated = PatientOrientation::stated(superior, parameters.anterior, &cup.axis);
                let orientation = match stated {
                    Some(stated) => stated,
                    None => PatientOrientation::observed(volume, cup, superior, monitor)?,
                };
                OrganPosition::Ventricle { found, orientation }
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

    /// The patient's orientation in the frame; the frame's own for organs other than ventricles.
    pub(super) fn patient_orientation(&self) -> PatientOrientation {
        match self {
            OrganPosition::Ventricle { orientation, .. } => *orientation,
            OrganPosition::Body { .. } => PatientOrientation::FRAME,
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
