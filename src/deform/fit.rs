//! A fitted model with the figures needed to judge it.

use super::dynamics::StopReason;
use super::flags::Flag;
use crate::geometry::Vec3;
use crate::locate::cup::Cup;
use crate::locate::localisation::Localisation;
use crate::locate::patient_orientation::PatientOrientation;
use crate::locate::{Hints, LocateError, NotAHeart};
use crate::mesh::TriMesh;
use crate::model::wall::VentricleWall;
use nalgebra::Rotation3;

/// A fitted model is no heart if less than this share of its area sees an edge, and the edges
/// are farther away than this (weighted rms, mm). Hearts have at least 0.63 or at most 1.15,
/// also with 100 % defects over seven segments; noise has at most 0.51 and at least 1.6.
const EDGELESS: (f64, f64) = (0.57, 1.3);

/// A fitted model.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The model in the patient, LPS mm; nodes and triangles are the template's.
    pub mesh: TriMesh,
    /// Displacement of every node from the posed template, mm.
    pub displacements: Vec<Vec3>,
    /// Where the ventricle was found; `None` for other organs.
    pub localisation: Option<Localisation>,
    /// The long axis of the fitted model; `None` for other organs.
    pub cup: Option<Cup>,
    /// The patient's orientation in the frame; ventricles only.
    pub patient_orientation: Option<PatientOrientation>,
    /// The wall seen from the long axis; ventricles only.
    pub wall: Option<VentricleWall>,
    /// Volume that the model encloses, the wall's of a ventricle, ml.
    pub wall_ml: f64,
    /// Isotropic scale of the pose against the template.
    pub scale: f64,
    /// Rotation of the pose against the template.
    pub rotation: Rotation3<f64>,
    /// 0 (a guess) to 1: the confidence of the localisation, lowered where few sensors see an
    /// edge. 0.5 or less for organs that are no ventricle.
    pub confidence: f64,
    /// Why the motion ended.
    pub reason: StopReason,
    /// Steps made in the last run.
    pub iterations: usize,
    /// Runs: 1, or more where the model had folded.
    pub runs: usize,
    /// Energy after each step of the last run, mm².
    pub energy: Vec<f64>,
    /// Weighted rms distance from the model to the edges that its sensors see, mm.
    pub residual: f64,
    /// Share of the model's area whose sensors see an edge (weight above 0.25), 0..=1.
    pub active: f64,
    /// Mean squared strain of the model against its aligned start.
    pub strain: f64,
    /// Pairs of triangles that intersect other than at shared vertices and edges. The fit is
    /// repeated with a stiffer model to avoid them.
    pub self_intersections: usize,
    /// Triangles whose normal turned by more than 90 degrees against the aligned start.
    pub turned_triangles: usize,
    /// Reasons to doubt the fit.
    pub flags: Vec<Flag>,
}

impl Fit {
    /// Refuses a ventricle whose model found no wall, unless a hint says that it is there.
    ///
    /// # Errors
    /// [`LocateError::NoHeart`].
    pub(super) fn require_wall(&self, hints: &Hints) -> Result<(), LocateError> {
        let (active, residual) = (self.active, self.residual);
        match &self.localisation {
            Some(found)
                if hints.centre.is_none() && active < EDGELESS.0 && !(residual < EDGELESS.1) =>
            {
                Err(LocateError::NoHeart {
                    centre: found.cup.centre.into(),
                    correlation: found.correlation,
                    reason: NotAHeart::Edgeless { active, residual },
                })
            }
            _ => Ok(()),
        }
    }

    /// A figure to rank templates by: the share of area with edges, less strain, misfit and
    /// flags, and, where the apex does not show, less the change of the model's length. Without
    /// the last term a model that shrinks to the visible part of the wall would rank higher,
    /// because more of its area sees an edge.
    pub fn merit(&self) -> f64 {
        self.active
            - 0.5 * self.change_of_length().abs()
            - 0.5 * self.strain.sqrt()
            - 0.05 * self.residual
            - 0.02 * self.flags.len() as f64
    }

    /// The logarithm of the ratio of two distances of the apex from the base plane that was
    /// found: now, and in the posed template. 0 where the apex shows.
    fn change_of_length(&self) -> f64 {
        let Some(found) = self.localisation.as_ref().filter(|l| l.dark_apex.is_some()) else {
            return 0.0;
        };
        let (base, axis) = (found.cup.base(), found.cup.axis);
        let along = |p: Vec3| (p - base).dot(&axis);
        let nodes = self.mesh.vertices.iter().zip(&self.displacements);
        let (now, posed) = nodes.fold((0f64, 0f64), |(now, posed), (p, moved)| {
            (now.max(along(*p)), posed.max(along(p - moved)))
        });
        (now / posed).ln()
    }
}
