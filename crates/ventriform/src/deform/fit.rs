//! A fitted model with the figures needed to judge it.

use super::anatomical::anatomical_mesh;
use super::confidence;
use super::dynamics::StopReason;
use super::evidence::Evidence;
use super::flags::Flag;
use super::parameters::{DeformParameters, WallEdge};
use super::uncertainty::{self, NodeEvidence};
use crate::geometry::Vec3;
use crate::grid::field::Field;
use crate::locate::cup::Cup;
use crate::locate::localisation::Localisation;
use crate::locate::patient_orientation::PatientOrientation;
use crate::locate::{Hints, LocateError, NotAHeart};
use crate::mesh::TriMesh;
use crate::model::wall::VentricleWall;
use crate::progress::{Cancelled, Monitor};
use nalgebra::Rotation3;

/// Where [`confidence::of_heart`] does not decide, a fitted model is no heart if less than this share of its
/// area sees an edge, and the edges are farther away than this (weighted rms, mm). Hearts have at least 0.63 or at most 1.15,
/// also with 100 % defects over seven segments; noise has at most 0.51 and at least 1.6.
const EDGELESS: (f64, f64) = (0.57, 1.3);

/// Likewise, if the search's confidence and the chance of a good fit are below one
/// of these pairs. Hearts that fit badly, for motion or infarcts, are found with 0.32 at least, and
/// with 0.58 where the chance is below the second limit; what was found in scans without a heart had
/// 0.38 at most.
const UNLIKELY: [(f64, f64); 2] = [(0.3, 0.25), (0.5, 0.05)];
/// Least chance of a heart ([`confidence::of_heart`]). Of 106 fits of hearts one has less (motion; Jaccard index 0.21),
/// of 59 fits to scans without one or beside it all but one, which took a hot right ventricle (calibrating seeds).
const LIKELY: f64 = 0.5;
/// In a map of labels, or with a greater share of the model beyond the volume (per cent), the search's
/// confidence does not count.
const OUTSIDE: f64 = 50.0;

/// A wall of a ventricle.
#[derive(Debug, Clone)]
pub struct WallSurface {
    /// The wall's surface, LPS mm.
    pub mesh: TriMesh,
    /// The wall seen from the long axis.
    pub wall: VentricleWall,
    /// Volume of the wall, ml.
    pub wall_ml: f64,
    /// Standard deviation of each node's distance from the wall, mm ([`super::uncertainty`]).
    pub uncertainty: Vec<f64>,
}

/// Both walls of a ventricle, with the same nodes and triangles.
#[derive(Debug, Clone)]
pub struct WallSurfaces {
    /// The wall as it looks in the blurred image.
    pub apparent: WallSurface,
    /// The wall itself ([`super::anatomical`]).
    pub anatomical: WallSurface,
}

impl WallSurfaces {
    /// The wall with this `edge`.
    pub fn of(&self, edge: WallEdge) -> &WallSurface {
        match edge {
            WallEdge::Apparent => &self.apparent,
            WallEdge::Anatomical => &self.anatomical,
        }
    }
}

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
    /// The wall as it looks and the wall itself; ventricles only. `mesh`, `wall` and `wall_ml` are
    /// those of the one that was asked for.
    pub surfaces: Option<WallSurfaces>,
    /// Isotropic scale of the pose against the template.
    pub scale: f64,
    /// Rotation of the pose against the template.
    pub rotation: Rotation3<f64>,
    /// Of a ventricle, the chance that the mask agrees with an expert's by a Jaccard index of 0.75
    /// or more ([`confidence::of_agreement`]). Of other organs, half the share of the surface that
    /// sees an edge, at most 0.5.
    pub confidence: f64,
    /// The figures behind it; ventricles only.
    pub evidence: Option<Evidence>,
    /// What is known of each node; empty for other organs.
    pub nodes: Vec<NodeEvidence>,
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
    /// Refuses a ventricle that is more likely none: by [`confidence::of_heart`], or, in a map of labels and
    /// where it is unknown how the patient lay, one whose model found no wall or that neither the search nor the fit
    /// believes in. A hint says that it is there.
    ///
    /// # Errors
    /// [`LocateError::NoHeart`].
    pub(super) fn require_wall(&self, hints: &Hints) -> Result<(), LocateError> {
        let Some(found) = &self.localisation else {
            return Ok(());
        };
        match self.doubt(found.confidence) {
            Some(reason) if hints.centre.is_none() => Err(LocateError::NoHeart {
                centre: found.cup.centre.into(),
                correlation: found.correlation,
                reason,
            }),
            _ => Ok(()),
        }
    }

    /// Why this is no heart, which the search found with the confidence `search`.
    fn doubt(&self, search: f64) -> Option<NotAHeart> {
        let misled = self.flags.iter().any(|flag| match flag {
            Flag::LabelMap { .. } => true,
            Flag::TouchesBorder { share } => *share > OUTSIDE,
            _ => false,
        });
        if !misled
            && let Some(evidence) = &self.evidence
            && let Some(views) = &evidence.views
            && let Some(chance) = confidence::of_heart(evidence, search)
        {
            return (chance < LIKELY).then_some(NotAHeart::Unseen {
                hollowness: evidence.hollowness,
                agreement: views.agreement,
                search,
                chance,
            });
        }
        let (active, residual, chance) = (self.active, self.residual, self.confidence);
        if active < EDGELESS.0 && !(residual < EDGELESS.1) {
            return Some(NotAHeart::Edgeless { active, residual });
        }
        let believed = if misled { 0.0 } else { search };
        UNLIKELY
            .iter()
            .any(|(limit, least)| believed < *limit && chance < *least)
            .then_some(NotAHeart::Unlikely { search, chance })
    }

    /// 0 (a guess) to 1: the confidence of the search for a ventricle, lowered where few sensors see
    /// an edge. 0.5 or less for other organs.
    pub fn place_confidence(&self) -> f64 {
        let search = self.localisation.as_ref().map_or(0.5, |l| l.confidence);
        search * (self.active / 0.5).min(1.0)
    }

    /// The chance of a good fit with this `chance` by all else, in view of what told the place.
    pub(super) fn chance_there(&self, chance: f64) -> f64 {
        match &self.localisation {
            Some(found) if found.infarcted => confidence::of_a_part(chance),
            _ => chance,
        }
    }

    /// Adds both walls of a ventricle, and shows the one of `edge`.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub(super) fn with_surfaces(
        self,
        image: &Field,
        parameters: &DeformParameters,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let (Some(cup), Some(orientation), Some(wall)) =
            (self.cup, self.patient_orientation, self.wall.clone())
        else {
            return Ok(self);
        };
        let uncertainty = self.uncertainty(WallEdge::Apparent);
        let thin = anatomical_mesh(&self.mesh, &wall, image, parameters.resolution);
        let surfaces = WallSurfaces {
            anatomical: WallSurface {
                wall: VentricleWall::new(&thin, &cup, &orientation.superior, monitor)?,
                wall_ml: thin.volume() / 1000.0,
                mesh: thin,
                uncertainty: self.uncertainty(WallEdge::Anatomical),
            },
            apparent: WallSurface {
                mesh: self.mesh,
                wall,
                wall_ml: self.wall_ml,
                uncertainty,
            },
        };
        let shown = surfaces.of(parameters.edge);
        Ok(Self {
            mesh: shown.mesh.clone(),
            wall: Some(shown.wall.clone()),
            wall_ml: shown.wall_ml,
            surfaces: Some(surfaces),
            ..self
        })
    }

    /// The standard deviation of each node's distance from the wall with this `edge`, mm.
    pub(super) fn uncertainty(&self, edge: WallEdge) -> Vec<f64> {
        uncertainty::of_nodes(&self.nodes, self.confidence, edge)
    }

    /// The uncertainty of the wall that a fit with this `edge` shows, mm; ventricles only.
    pub fn shown_uncertainty(&self, edge: WallEdge) -> Option<&[f64]> {
        let surfaces = self.surfaces.as_ref();
        surfaces.map(|surfaces| surfaces.of(edge).uncertainty.as_slice())
    }

    /// The wall of a ventricle that a fit with this `edge` does not show.
    pub fn other_surface(&self, edge: WallEdge) -> Option<&WallSurface> {
        let surfaces = self.surfaces.as_ref();
        surfaces.map(|surfaces| surfaces.of(edge.other()))
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

#[cfg(test)]
mod tests {
    use super::super::test_fits::ball;
    use super::*;

    #[test]
    fn what_has_no_edges_or_no_chance_is_no_heart() {
        let (_, found) = ball();
        assert!(found.evidence.is_none());
        let doubt = |active: f64, residual: f64, search: f64, chance: f64, share: f64| {
            let mut fit = found.clone();
            (fit.active, fit.residual, fit.confidence) = (active, residual, chance);
            fit.flags.push(Flag::TouchesBorder { share });
            match fit.doubt(search) {
                None => "",
                Some(NotAHeart::Edgeless { .. }) => "edgeless",
                Some(NotAHeart::Unlikely { .. }) => "unlikely",
                Some(_) => "another",
            }
        };
        assert_eq!(doubt(0.9, 1.0, 0.9, 0.9, 1.0), "");
        // Few edges, and far ones.
        assert_eq!(doubt(0.5, 1.4, 0.9, 0.9, 1.0), "edgeless");
        assert_eq!(doubt(0.5, f64::NAN, 0.9, 0.9, 1.0), "edgeless");
        assert_eq!(doubt(0.5, 1.2, 0.9, 0.9, 1.0), "");
        assert_eq!(doubt(0.6, 1.4, 0.9, 0.9, 1.0), "");
        for (limit, least) in UNLIKELY {
            assert_eq!(doubt(0.9, 1.0, limit - 0.01, least - 0.01, 1.0), "unlikely");
            assert_eq!(doubt(0.9, 1.0, limit, least, 1.0), "");
        }
        // The search does not count where most of the model lies beyond the volume.
        assert_eq!(doubt(0.9, 1.0, 0.9, 0.2, OUTSIDE), "");
        assert_eq!(doubt(0.9, 1.0, 0.9, 0.2, OUTSIDE + 1.0), "unlikely");
    }

    #[test]
    fn a_hint_and_what_is_no_ventricle_are_believed() {
        let (_, mut fit) = ball();
        let hinted = Hints {
            centre: Some(Vec3::zeros()),
            ..Hints::default()
        };
        (fit.active, fit.residual) = (0.1, 9.0);
        assert!(fit.require_wall(&Hints::default()).is_ok());
        let centre = Vec3::new(1.0, 2.0, 3.0);
        fit.localisation = Some(Localisation {
            cup: Cup {
                centre,
                axis: Vec3::z(),
                length: 70.0,
                breadth: 1.0,
            },
            correlation: 0.8,
            wall: 1.0,
            hollowness: 0.5,
            dark_apex: None,
            runner_up: None,
            infarcted: false,
            confidence: 0.9,
        });
        assert!(fit.require_wall(&hinted).is_ok());
        let Err(LocateError::NoHeart { centre: at, .. }) = fit.require_wall(&Hints::default())
        else {
            panic!("a model without edges is no heart");
        };
        assert_eq!(Vec3::from(at), centre);
        (fit.active, fit.residual, fit.confidence) = (0.9, 1.0, 0.9);
        assert!(fit.require_wall(&Hints::default()).is_ok());
    }
}
