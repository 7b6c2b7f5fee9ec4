//! A template fitted to a patient: shape, position, and the figures of the motion.

use super::anatomical::{BlurredImage, anatomical_mesh};
use super::dynamics::StopReason;
use super::parameters::WallEdge;
use super::rim_model::RimEvidence;
use super::sensors::SensorReading;
use super::wall_thickness::WallThickness;
use crate::base::geometry::Vec3;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::model::wall::VentricleWall;
use crate::image::locate::cup::Cup;
use crate::image::locate::localisation::Localisation;
use crate::image::locate::patient_orientation::{PatientOrientation, Superior};
use crate::mesh::TriMesh;
use nalgebra::Rotation3;

/// A wall of a ventricle.
#[derive(Debug, Clone)]
pub struct WallSurface {
    /// The wall's surface, LPS mm.
    pub mesh: TriMesh,
    /// The wall seen from the long axis.
    pub wall: VentricleWall,
    /// Volume of the wall, ml.
    pub wall_ml: f64,
}

/// Both walls of a ventricle, with the same nodes and triangles.
#[derive(Debug, Clone)]
pub struct WallSurfaces {
    /// The wall as it looks in the blurred image.
    pub apparent: WallSurface,
    /// The wall itself ([`super::anatomical`]).
    pub anatomical: WallSurface,
    /// What is known of the thickness of the latter; `None` where a direction has no wall.
    pub thickness: Option<WallThickness>,
}

impl WallSurfaces {
    /// Both walls of the ventricle whose apparent one is `apparent`, with its long axis along `cup`; `image` is that
    /// about it. The anatomical one has `muscle_ml`, if that is stated.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub(super) fn new(
        apparent: WallSurface,
        cup: &Cup,
        orientation: &PatientOrientation,
        image: &BlurredImage<'_>,
        muscle_ml: Option<f64>,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let (mesh, thickness) = anatomical_mesh(&apparent.mesh, &apparent.wall, image, muscle_ml);
        let anatomical = WallSurface {
            wall: VentricleWall::new(&mesh, cup, &orientation.superior, monitor)?,
            wall_ml: mesh.volume() / 1000.0,
            mesh,
        };
        Ok(Self {
            apparent,
            anatomical,
            thickness,
        })
    }

    /// The wall with this `edge`.
    pub fn at_edge(&self, edge: WallEdge) -> &WallSurface {
        match edge {
            WallEdge::Apparent => &self.apparent,
            WallEdge::Anatomical => &self.anatomical,
        }
    }
}

/// A fitted model.
#[derive(Debug, Clone)]
pub struct FittedModel {
    /// The model in the patient, LPS mm; nodes and triangles are the template's.
    pub mesh: TriMesh,
    /// Displacement of every node of the apparent wall from the posed template, mm.
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
    /// The wall as the sensors left it, before the base plane was put; ventricles only.
    pub sensed_wall: Option<VentricleWall>,
    /// Height of its rim in each of [`RIM_DIRECTIONS`](super::rim_frame::RIM_DIRECTIONS) directions, mm from the
    /// cup's centre towards the apex; `None` without a rim in every direction.
    pub sensed_rim_mm: Option<Vec<f64>>,
    /// What told where the rim is; `None` for other organs, where the image has no signal at the rim, where the
    /// patient's orientation is unknown and where the base was given.
    pub rim_evidence: Option<RimEvidence>,
    /// The smoothness of the image about it, mm; ventricles only.
    pub smoothness_mm: Option<f64>,
    /// The length of the image's noise beside it, mm; ventricles only.
    pub noise_length_mm: Option<f64>,
    /// The sensors' readings when the motion ended, [`PER_TRIANGLE`](super::sensors::PER_TRIANGLE) of each triangle.
    pub readings: Vec<SensorReading>,
    /// Isotropic scale of the pose against the template.
    pub scale: f64,
    /// Rotation of the pose against the template.
    pub rotation: Rotation3<f64>,
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
}

impl FittedModel {
    /// The same heart with its places counted from the wall on the side of `anterior`, LPS: names of places change,
    /// and nothing else. As it is where that runs along the axis, and of other organs.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn counted_from(self, anterior: &Vec3, monitor: &Monitor) -> Result<Self, Cancelled> {
        let axis = self.cup.as_ref().map(|cup| cup.axis);
        let stated = axis
            .and_then(|axis| PatientOrientation::stated(Superior::Body, Some(*anterior), &axis))
            .filter(|stated| stated.source.is_stated());
        let Some(stated) = stated else {
            return Ok(self);
        };
        let counted = |mesh: &TriMesh, wall: &VentricleWall| {
            wall.counted_from(mesh, &stated.superior, monitor)
        };
        let surface = |surface: WallSurface| {
            let wall = counted(&surface.mesh, &surface.wall)?;
            Ok(WallSurface { wall, ..surface })
        };
        let surfaces = |both: WallSurfaces| {
            Ok(WallSurfaces {
                apparent: surface(both.apparent)?,
                anatomical: surface(both.anatomical)?,
                thickness: both.thickness,
            })
        };
        Ok(Self {
            patient_orientation: Some(stated),
            wall: (self.wall.as_ref())
                .map(|wall| counted(&self.mesh, wall))
                .transpose()?,
            surfaces: self.surfaces.map(surfaces).transpose()?,
            ..self
        })
    }

    /// The model's surface as it looks in the image: of a ventricle, that of the apparent wall.
    pub fn apparent_mesh(&self) -> &TriMesh {
        let surfaces = self.surfaces.as_ref();
        surfaces.map_or(&self.mesh, |surfaces| &surfaces.apparent.mesh)
    }

    /// The wall of a ventricle that a fit with this `edge` does not show.
    pub fn other_surface(&self, edge: WallEdge) -> Option<&WallSurface> {
        let surfaces = self.surfaces.as_ref();
        surfaces.map(|surfaces| surfaces.at_edge(edge.other()))
    }

    /// The logarithm of the ratio of two distances of the apex from the base plane that was
    /// found: now, and in the posed template. 0 where the apex shows.
    pub(crate) fn change_of_length(&self) -> f64 {
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
