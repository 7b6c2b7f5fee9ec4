//! A model made ready to be fitted: its place as a cup, its struts.

use super::elastic::{self, Strut};
use crate::geometry::Vec3;
use crate::geometry::bvh::Aabb;
use crate::geometry::frame::VoxelToPatient;
use crate::grid::field::Field;
use crate::grid::voxelise::voxelise;
use crate::locate::cup::{Cup, perpendicular};
use crate::locate::localisation as localise;
use crate::locate::localisation::Hints;
use crate::mesh::TriMesh;
use crate::mesh::topology::{self, Defect};
use crate::progress::{Cancelled, Monitor};
use crate::volume::Volume;

/// What a model is a model of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Organ {
    /// The left ventricle's wall: a cup, found by itself.
    LeftVentricle,
    /// A liver: one blob.
    Liver,
    /// A kidney: one blob.
    Kidney,
    /// Anything closed.
    Generic,
}

impl Organ {
    /// Every organ.
    pub const ALL: [Organ; 4] = [
        Organ::LeftVentricle,
        Organ::Liver,
        Organ::Kidney,
        Organ::Generic,
    ];

    /// The organ of that name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|organ| organ.as_str() == name)
    }

    /// The name in parameters and reports.
    pub fn as_str(self) -> &'static str {
        match self {
            Organ::LeftVentricle => "left_ventricle",
            Organ::Liver => "liver",
            Organ::Kidney => "kidney",
            Organ::Generic => "generic",
        }
    }
}

/// Why a mesh cannot be a model to fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TemplateError {
    /// Not a closed manifold.
    #[error("the model is not a closed surface: {0}")]
    Topology(#[from] Defect),
    /// A coordinate is not finite.
    #[error("vertex {vertex} of the model is not finite")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// The triangles face inward, or the mesh encloses nothing.
    #[error("the model encloses {volume_ml:.3} ml; a closed, outward surface is needed")]
    NoVolume {
        /// Enclosed volume, ml.
        volume_ml: f64,
    },
    /// More nodes than the fit is made for.
    #[error("the model has {vertices} vertices; at most {limit} can be fitted")]
    TooLarge {
        /// Number of vertices.
        vertices: usize,
        /// The limit.
        limit: usize,
    },
    /// A ventricle was asked for, and the mesh is no cup.
    #[error(
        "the model is no ventricle: it agrees with a cup by {correlation:.2} only; say \
         organ = generic for other shapes"
    )]
    NoCup {
        /// Correlation with a cup.
        correlation: f64,
    },
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Most nodes of a model to fit.
pub const MAX_NODES: usize = 5000;

/// A model, ready to be fitted.
#[derive(Debug, Clone)]
pub struct Template {
    /// The model, LPS mm of the patient it was made from.
    pub mesh: TriMesh,
    /// What it shows.
    pub organ: Organ,
    /// Its place as a cup; ventricles only.
    pub cup: Option<Cup>,
    /// Node pairs across the wall; none where there is no wall.
    pub struts: Vec<Strut>,
}

impl Template {
    /// Checks `mesh` and finds what the fit has to know of it.
    ///
    /// # Errors
    /// [`TemplateError`].
    pub fn new(mesh: TriMesh, organ: Organ, monitor: &Monitor) -> Result<Self, TemplateError> {
        let finite = |p: &Vec3| p.iter().all(|x| x.is_finite());
        if let Some(vertex) = mesh.vertices.iter().position(|p| !finite(p)) {
            return Err(TemplateError::NotFinite { vertex });
        }
        if mesh.vertices.len() > MAX_NODES {
            return Err(TemplateError::TooLarge {
                vertices: mesh.vertices.len(),
                limit: MAX_NODES,
            });
        }
        topology::check(&mesh)?;
        let volume_ml = mesh.volume() / 1000.0;
        // The picture of the mesh below takes memory by its size: refuse planets.
        if !(volume_ml > 0.1 && volume_ml < 10_000.0) {
            return Err(TemplateError::NoVolume { volume_ml });
        }
        let (cup, struts) = match organ {
            Organ::LeftVentricle => (
                Some(cup_of(&mesh, monitor)?),
                elastic::struts(&mesh, monitor)?,
            ),
            Organ::Liver | Organ::Kidney | Organ::Generic => (None, Vec::new()),
        };
        Ok(Self {
            mesh,
            organ,
            cup,
            struts,
        })
    }
}

/// Finds the cup in the model by the search that finds it in patients, so that both mean the
/// same by centre, axis and length.
fn cup_of(mesh: &TriMesh, monitor: &Monitor) -> Result<Cup, TemplateError> {
    const SPACING: f64 = 3.25;
    let bounds = Aabb::of(&mesh.vertices);
    let size = bounds.max - bounds.min;
    let too_long = size.iter().any(|x| *x > 400.0);
    let none = TemplateError::NoCup { correlation: 0.0 };
    if too_long {
        return Err(none);
    }
    let shape = [0, 1, 2].map(|a| ((size[a] + 80.0) / SPACING).ceil() as usize);
    let centre = (bounds.min + bounds.max) / 2.0;
    let Ok(frame) = VoxelToPatient::centred(shape, [SPACING; 3], centre) else {
        return Err(none);
    };
    let mask = voxelise(mesh, shape, &frame);
    let picture = Volume {
        shape,
        voxels: mask
            .voxels
            .iter()
            .map(|v| f32::from(u8::from(*v)))
            .collect(),
        frame,
        integral: false,
    };
    match localise::localise(&picture, &Hints::default(), monitor) {
        Ok(found) if found.correlation > 0.6 => {
            let mut sharper = Field::coarse(&picture, SPACING, monitor)?;
            sharper.blur(5.5, monitor)?;
            Ok(localise::refine(&sharper, &found.cup).cup)
        }
        Ok(found) => Err(TemplateError::NoCup {
            correlation: found.correlation,
        }),
        Err(localise::LocaliseError::NoHeart { correlation, .. }) => {
            Err(TemplateError::NoCup { correlation })
        }
        Err(localise::LocaliseError::Cancelled(c)) => Err(c.into()),
        Err(_) => Err(none),
    }
}

/// The map from one cup to another: the patient's own tilt, then the least turn from axis to
/// axis, then `roll` radians about the axis, lengths along the axis by the lengths, across by
/// the breadths. So a heart that is tilted with its patient meets the same side of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct Pose {
    from: Cup,
    to: Cup,
    turn: nalgebra::Rotation3<f64>,
}

impl Pose {
    /// The pose that takes `from` to `to` in a patient who is turned by `tilt` in the frame.
    pub fn between(from: &Cup, to: &Cup, tilt: &nalgebra::Rotation3<f64>, roll: f64) -> Self {
        let tilted = tilt * from.axis;
        let least = nalgebra::Rotation3::rotation_between(&tilted, &to.axis)
            // Opposite axes: half a turn about anything across.
            .unwrap_or_else(|| {
                let (across, _) = perpendicular(&tilted);
                nalgebra::Rotation3::from_axis_angle(
                    &nalgebra::Unit::new_normalize(across),
                    std::f64::consts::PI,
                )
            });
        let about =
            nalgebra::Rotation3::from_axis_angle(&nalgebra::Unit::new_normalize(to.axis), roll);
        Self {
            from: *from,
            to: *to,
            turn: about * least * tilt,
        }
    }

    /// Isotropic scale: the cube root of the change of volume.
    pub fn scale(&self) -> f64 {
        let along = self.to.length / self.from.length;
        let across = along * self.to.breadth / self.from.breadth;
        (along * across * across).cbrt()
    }

    /// The rotation.
    pub fn rotation(&self) -> &nalgebra::Rotation3<f64> {
        &self.turn
    }

    /// Where a point of the template goes.
    pub fn apply(&self, p: &Vec3) -> Vec3 {
        let along = self.to.length / self.from.length;
        let across = along * self.to.breadth / self.from.breadth;
        let turned = self.turn * (p - self.from.centre);
        let share = turned.dot(&self.to.axis);
        self.to.centre + self.to.axis * (share * (along - across)) + turned * across
    }
}
