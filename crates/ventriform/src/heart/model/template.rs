//! A model made ready to be fitted.
//!
//! In goes a mesh and the organ it shows. The mesh must be a closed, outward surface of at most
//! [`MAX_NODES`] nodes; a ventricle must agree with a cup. Out comes the mesh with its cup (centre,
//! long axis, length) and the pairs of nodes across its wall.

use super::organ::Organ;
use super::struts::{Strut, struts};
use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::Volume;
use crate::image::grid::field::Field;
use crate::image::grid::voxelise::voxelise;
use crate::image::locate::cup::Cup;
use crate::image::locate::localisation::Localisation;
use crate::image::locate::{LocateError, localisation};
use crate::mesh::TriMesh;
use crate::mesh::topology::{self, MeshDefect};

/// Why a mesh cannot be a model to fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TemplateError {
    /// Not a closed manifold.
    #[error("the model is not a closed surface: {0}")]
    Topology(#[from] MeshDefect),
    /// A coordinate is not finite.
    #[error("vertex {vertex} of the model is not finite")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// The triangles face inward, or the enclosed volume is out of range.
    #[error(
        "the model encloses {volume_ml:.3} ml; 0.1 to 10000 ml are needed, its triangles facing outward"
    )]
    NoVolume {
        /// Enclosed volume, ml.
        volume_ml: f64,
    },
    /// More nodes than [`MAX_NODES`].
    #[error("the model has {vertices} vertices; at most {limit} can be fitted")]
    TooLarge {
        /// Number of vertices.
        vertices: usize,
        /// The limit.
        limit: usize,
    },
    /// The organ is a left ventricle, and the mesh is no cup.
    #[error(
        "the model is no ventricle: its correlation with a cup is {correlation:.2}, more than \
         0.6 is needed"
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
    /// The organ.
    pub organ: Organ,
    /// Centre, long axis and size of the wall; ventricles only.
    pub cup: Option<Cup>,
    /// Node pairs across the wall; ventricles only, empty otherwise.
    pub struts: Vec<Strut>,
}

impl Template {
    /// Checks `mesh`, finds its cup and its struts.
    ///
    /// # Errors
    /// [`TemplateError`].
    pub fn new(mesh: TriMesh, organ: Organ, monitor: &Monitor) -> Result<Self, TemplateError> {
        check(&mesh)?;
        let (cup, struts) = match organ {
            Organ::LeftVentricle => {
                let found = |picture: &Volume| localisation::of_model(picture, monitor);
                let cup = cup_of(&mesh, found, monitor)?;
                (Some(cup), struts(&mesh, monitor)?)
            }
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

impl Template {
    /// A ventricle that was checked before, with the cup found in it then.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn of_cup(mesh: TriMesh, cup: Cup, monitor: &Monitor) -> Result<Self, Cancelled> {
        Ok(Self {
            struts: struts(&mesh, monitor)?,
            mesh,
            organ: Organ::LeftVentricle,
            cup: Some(cup),
        })
    }
}

/// Refuses a mesh that cannot be fitted, whatever organ it shows.
fn check(mesh: &TriMesh) -> Result<(), TemplateError> {
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
    topology::check(mesh)?;
    let volume_ml = mesh.volume() / 1000.0;
    // The voxel picture of `cup_of` takes memory by the size of the mesh.
    if !(volume_ml > 0.1 && volume_ml < 10_000.0) {
        return Err(TemplateError::NoVolume { volume_ml });
    }
    Ok(())
}

/// The cup of `mesh`, a ventricle's wall, as [`Template::new`] finds it but for the search's last steps: within 2 mm
/// and 3 degrees for the built-in hearts. The search starts at the middle of the mesh alone, which takes a fifth off
/// the time of a model from file to file.
///
/// # Errors
/// [`TemplateError`], as [`Template::new`].
pub fn cup_about_middle(mesh: &TriMesh, monitor: &Monitor) -> Result<Cup, TemplateError> {
    check(mesh)?;
    let bounds = Aabb::around(&mesh.vertices);
    let middle = (bounds.min + bounds.max) / 2.0;
    let found = |picture: &Volume| localisation::of_model_about(picture, middle, monitor);
    cup_of(mesh, found, monitor)
}

/// Finds the cup in the model by `search` of its picture, the same search as in patients, so that centre, axis and
/// length are defined alike in both.
fn cup_of(
    mesh: &TriMesh,
    search: impl FnOnce(&Volume) -> Result<Localisation, LocateError>,
    monitor: &Monitor,
) -> Result<Cup, TemplateError> {
    const NODE_SPACING_MM: f64 = 3.25;
    let bounds = Aabb::around(&mesh.vertices);
    let size = bounds.max - bounds.min;
    let too_long = size.iter().any(|x| *x > 400.0);
    let none = TemplateError::NoCup { correlation: 0.0 };
    if too_long {
        return Err(none);
    }
    let shape = [0, 1, 2].map(|a| ((size[a] + 80.0) / NODE_SPACING_MM).ceil() as usize);
    let centre = (bounds.min + bounds.max) / 2.0;
    let Ok(frame) = VoxelToPatient::centred(shape, [NODE_SPACING_MM; 3], centre) else {
        return Err(none);
    };
    let mask = voxelise(mesh, shape, &frame, monitor)?;
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
    match search(&picture) {
        Ok(found) if found.correlation > 0.6 => {
            let mut sharper = Field::coarse(&picture, None, NODE_SPACING_MM, monitor)?;
            sharper.blur(5.5, monitor)?;
            Ok(localisation::refine(&sharper, &found.cup))
        }
        Ok(found) => Err(TemplateError::NoCup {
            correlation: found.correlation,
        }),
        Err(LocateError::NoHeart { correlation, .. }) => Err(TemplateError::NoCup { correlation }),
        Err(LocateError::Cancelled(c)) => Err(c.into()),
        Err(_) => Err(none),
    }
}
