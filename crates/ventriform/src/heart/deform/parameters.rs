//! The parameters of a fit.

use super::dynamics::Motion;
use super::elastic::Stiffness;
use super::error::DeformError;
use super::sensors::SensorKind;
use super::through::ThroughPoint;
use crate::base::geometry::Vec3;
use crate::image::locate::Hints;
use crate::image::locate::patient_orientation::Superior;
use std::ops::RangeInclusive;

/// Parameters of [`fit`](super::fit()).
#[derive(Debug, Clone, PartialEq)]
pub struct DeformParameters {
    /// Hints at the organ's position. Default: none.
    pub hints: Hints,
    /// Rotation of the template about the long axis, added to the least rotation that aligns the
    /// axes, degrees. Default 0.
    pub roll: f64,
    /// Source of the patient's superior direction. The model is posed by it, and the columns
    /// and segments of the wall are counted from it. Ventricles only. Default
    /// [`Superior::Body`].
    pub superior: Superior,
    /// Direction from the long axis to the anterior wall, LPS, any length. The wall is counted from
    /// it unless [`Superior::Stated`] tells more. Default `None`.
    pub anterior: Option<Vec3>,
    /// A point of the base, LPS mm: the rim is put there, as far as the wall reaches or can be stretched, instead
    /// of where image and anatomy put it. Ventricles only. Default `None`.
    pub base: Option<Vec3>,
    /// Points that the surface of the apparent wall passes through. Ventricles only. Default: none.
    pub through: Vec<ThroughPoint>,
    /// Whether the model is aligned as a whole before it is deformed. Default true. If false, as
    /// for models that are placed by hand, the rest state is the posed template.
    pub align: bool,
    /// Stiffness of the model.
    pub stiffness: Stiffness,
    /// Which point of an edge the sensors report. Default [`SensorKind::HalfMaximum`].
    pub sensor: SensorKind,
    /// Initial reach of the sensors, mm, 2..=30. Default 10.
    pub reach: f64,
    /// Gaussian blur of the image, sigma in mm, 0..=10. Default 3.
    pub blur: f64,
    /// Distance of the reader's edge from the edge found, mm outward, -5..=5. Default 0.
    pub margin: f64,
    /// Which wall of a ventricle the fit shows; the other one is kept beside it
    /// ([`FittedModel::surfaces`](super::FittedModel::surfaces)). Default [`WallEdge::Apparent`].
    pub edge: WallEdge,
    /// The image's resolution (full width of a point at half its maximum, motion and filter
    /// included), mm, 0..=30, for the anatomical wall. Default `None`: by calibration.
    pub resolution: Option<f64>,
    /// Volume of the muscle, ml, 10..=600: the anatomical wall encloses it. Ventricles only. Default `None`: by the
    /// wall's width.
    pub muscle_ml: Option<f64>,
    /// How the camera turned, by which motion of the patient is judged. Default [`Orbit::Auto`].
    pub orbit: Orbit,
    /// The kind of motion.
    pub motion: Motion,
}

impl Default for DeformParameters {
    fn default() -> Self {
        Self {
            hints: Hints::default(),
            roll: 0.0,
            superior: Superior::Body,
            anterior: None,
            base: None,
            through: Vec::new(),
            align: true,
            stiffness: Stiffness::default(),
            sensor: SensorKind::HalfMaximum,
            reach: 10.0,
            blur: 3.0,
            margin: 0.0,
            edge: WallEdge::Apparent,
            resolution: None,
            muscle_ml: None,
            orbit: Orbit::Auto,
            motion: Motion::default(),
        }
    }
}

/// How the camera turned about the patient.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Orbit {
    /// As the scan's header says; unknown where it does not.
    Auto,
    /// Not at all: it saw all angles at once. No view is later than another, so that a patient who moves blurs all.
    None,
    /// By half a turn.
    Half,
    /// By a whole turn.
    Full,
}

/// Scan arcs of half a turn, degrees; greater ones are whole turns, smaller ones none that is known.
const HALF_TURN_DEG: RangeInclusive<f64> = 90.0..=270.0;

impl Orbit {
    /// The orbit of a scan arc, degrees; `None` if no camera turns so.
    pub fn of_arc(degrees: f64) -> Option<Self> {
        match degrees {
            0.0 => Some(Self::None),
            arc if HALF_TURN_DEG.contains(&arc) => Some(Self::Half),
            arc if arc > *HALF_TURN_DEG.end() && arc <= 720.0 => Some(Self::Full),
            _ => None,
        }
    }

    /// The orbit, or that which the header states if it is to be looked up.
    pub fn or_stated(self, stated: Option<Self>) -> Self {
        match self {
            Self::Auto => stated.unwrap_or(Self::Auto),
            _ => self,
        }
    }
}

/// An edge of a ventricle's wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WallEdge {
    /// The edge seen in the blurred image.
    Apparent,
    /// The edge of the wall itself: the thickness that blur adds is subtracted.
    Anatomical,
}

impl WallEdge {
    /// The other one.
    pub fn other(self) -> Self {
        match self {
            WallEdge::Apparent => WallEdge::Anatomical,
            WallEdge::Anatomical => WallEdge::Apparent,
        }
    }

    /// Its name in parameters and reports.
    pub fn as_str(self) -> &'static str {
        match self {
            WallEdge::Apparent => "apparent",
            WallEdge::Anatomical => "anatomical",
        }
    }

    /// The reverse of [`WallEdge::as_str`].
    pub fn parse(name: &str) -> Option<Self> {
        [WallEdge::Apparent, WallEdge::Anatomical]
            .into_iter()
            .find(|edge| edge.as_str() == name)
    }
}

impl DeformParameters {
    /// Checks every number.
    ///
    /// # Errors
    /// [`DeformError::Parameter`] names the first one that cannot be used.
    pub fn validate(&self) -> Result<(), DeformError> {
        let (k, m) = (&self.stiffness, &self.motion);
        let checks = [
            ("roll", self.roll, -360.0, 360.0),
            ("stiffness.spring", k.spring, 0.0, 1e6),
            ("stiffness.torsion", k.torsion, 0.0, 1e6),
            ("stiffness.body", k.body, 0.0, 1e6),
            ("stiffness.thickness", k.thickness, 0.0, 1e6),
            ("stiffness.support", k.support, 0.0, 1e6),
            ("stiffness.support_radius", k.support_radius, 0.0, 1e3),
            ("reach", self.reach, 2.0, 30.0),
            ("blur", self.blur, 0.0, 10.0),
            ("margin", self.margin, -5.0, 5.0),
            ("resolution", self.resolution.unwrap_or(0.0), 0.0, 30.0),
            ("muscle_ml", self.muscle_ml.unwrap_or(100.0), 10.0, 600.0),
            ("motion.mass", m.mass, 1e-6, 1e6),
            ("motion.damping", m.damping, 0.0, 1e6),
            ("motion.time_step", m.time_step, 1e-3, 1e3),
            ("motion.last_reach", m.last_reach, 1.0, 30.0),
            ("motion.narrowing", m.narrowing, 0.1, 0.99),
            ("motion.tolerance", m.tolerance, 1e-6, 1.0),
            ("motion.max_iterations", m.max_iterations as f64, 1.0, 1e4),
        ];
        for (field, value, least, most) in checks {
            if !(least..=most).contains(&value) {
                return Err(DeformError::Parameter {
                    field,
                    value,
                    least,
                    most,
                });
            }
        }
        let hints = self.hints.centre.iter().chain(&self.hints.axis);
        let region = self.hints.region.iter().flat_map(|r| [&r.min, &r.max]);
        let points = hints
            .chain(region)
            .chain(self.through.iter().map(|point| &point.place));
        if !points.clone().all(|p| p.iter().all(|x| x.is_finite())) {
            return Err(DeformError::HintNotFinite);
        }
        let superior = match self.superior {
            Superior::Stated(direction) => Some(direction),
            Superior::Body | Superior::Frame | Superior::Untold => None,
        };
        let directions = [self.hints.axis, superior, self.anterior];
        let usable = |d: &Vec3| d.norm() > 1e-6 && d.norm().is_finite();
        if !directions.iter().flatten().all(usable) {
            return Err(DeformError::HintNotFinite);
        }
        Ok(())
    }
}
