//! From voxels to a closed triangle surface of the wall.
//!
//! In: a [`Volume`] of intensities or labels. Out: a [`Surface`]: closed, oriented, manifold,
//! LPS millimetres, and [`SurfaceFacts`] about the volume and every change made.
//!
//! 1. [`survey`](mod@crate::image::grid::survey): range, missing values, label map or intensities.
//! 2. Region ([`select`]). Intensities ([`intensity`]): the left ventricle is searched
//!    ([`crate::image::locate`]) and cut from its neighbours ([`region`]), or a part is taken as asked
//!    for. Labels ([`label`]): the mask is made grey ([`masks`]).
//! 3. Iso-value ([`iso_value`]): half the wall's reference intensity unless asked otherwise.
//! 4. [`topology_control`]: one component without cavities and handles.
//! 5. [`marching_cubes`] (with its generated [`table`]) on [`labels`](crate::image::grid::labels).
//! 6. [`smoothing`]: the smoothed twin for geodesics and curvature.
//! 7. [`denoise`](mod@denoise): for intensities, the noise is measured and taken off the surface.
//!
//! Guaranteed: the mesh is a closed, oriented 2-manifold; with [`TopologyMode::Genus0`] it is a
//! sphere; without step 7 vertices lie at the linear crossings of the iso-value except where voxels
//! were cut or filled (there in the middle of the edge) and within 0.05 voxel of an edge's ends, and
//! step 7 moves none by more than three times the noise there or half a voxel; the same bytes on any number of threads.
//! Not guaranteed: that a doubtful ventricle is the right one; `facts.ventricle_score` and the warnings say how sure
//! the search is.

pub mod optimise;
pub mod retile;

pub mod denoise;
mod error;
mod facts;
mod intensity;
mod iso_value;
mod label;
pub mod marching_cubes;
pub mod masks;
mod object;
mod parameters;
pub mod region;
mod select;
pub mod smoothing;
pub mod table;
pub mod topology_control;

use std::sync::Arc;

use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Bvh;
use crate::base::progress::{Cancelled, Monitor, Stage};
use crate::image::grid::Volume;
use crate::mesh::TriMesh;
use crate::mesh::topology::{self, Census};

use crate::image::grid::components::Components;
use crate::image::grid::survey::Survey;
pub use error::SurfaceError;
pub use facts::{SurfaceFacts, VolumeKind};
use marching_cubes::Samples;
use object::Object;
pub use parameters::{Denoise, IsoLevel, Isolate, SurfaceParameters, TopologyMode};

/// A closed, oriented surface in patient space and how it was made.
#[derive(Debug, Clone)]
pub struct Surface {
    /// The reference surface S: LPS millimetres, closed manifold, facing outward, without the noise of
    /// the volume unless [`SurfaceParameters::denoise`] is off.
    pub mesh: TriMesh,
    /// The working surface W: the surface of Marching Cubes after Taubin smoothing, same connectivity. For
    /// geodesics and curvature only; distances are measured against S.
    pub working: Vec<Vec3>,
    /// Search tree over the triangles of S, if one was needed to make it.
    pub tree: Option<Arc<Bvh>>,
    /// Smallest voxel spacing, mm.
    pub spacing: f64,
    /// About the volume and the changes made.
    pub facts: SurfaceFacts,
}

impl Surface {
    /// A mesh that is exact, without the noise of a scan: it is its own working surface. `spacing`
    /// is that of the volume it stands for, mm; the facts are left at their defaults.
    pub fn exact(mesh: TriMesh, spacing: f64) -> Self {
        Self {
            working: mesh.vertices.clone(),
            mesh,
            tree: None,
            spacing,
            facts: SurfaceFacts::default(),
        }
    }

    /// The component of every vertex, as [`topology::components`] numbers them. They are searched for unless the
    /// census of the surface, which `facts` carries, counted one.
    pub(crate) fn components(&self) -> Vec<u32> {
        match self.facts.components {
            1 => vec![0; self.mesh.vertices.len()],
            _ => topology::components(self.mesh.vertices.len(), &self.mesh.triangles),
        }
    }
}

/// Passes of Taubin's smoothing that make the working surface.
const WORKING_PASSES: usize = 15;
/// Share of the region's voxels from which a change of topology is warned of.
const LARGE_CHANGE: f64 = 0.02;

/// Extracts the surface.
///
/// # Errors
/// See [`SurfaceError`].
pub fn extract(
    volume: &Volume,
    parameters: &SurfaceParameters,
    monitor: &Monitor,
) -> Result<Surface, SurfaceError> {
    monitor.report(Stage::Surface, 0.0)?;
    parameters.check(volume)?;
    if let IsoLevel::Below(level) = parameters.iso {
        return below(volume, level, parameters, monitor);
    }
    let survey = crate::image::grid::survey::survey(volume, monitor)?;
    let mut facts = SurfaceFacts::default();
    let mut object = select::select(volume, parameters, &survey, &mut facts, monitor)?;
    monitor.report(Stage::Surface, 0.5)?;
    control_topology(&mut object, parameters.topology, &mut facts, monitor)?;
    monitor.report(Stage::Surface, 0.7)?;
    look_at_border(&object, &mut facts);
    facts.region_ml = object.labels.count() as f64 * object.frame.voxel_volume() / 1000.0;

    let (labels, frame, iso) = (&object.labels, &object.frame, object.iso);
    let mut mesh = match &object.mask {
        Some(mask) => {
            let level = (iso, mask.passes);
            masks::surface_of(labels, &object.values, object.shape, level, frame, monitor)?
        }
        None => {
            let samples = Samples {
                values: &object.values,
                shape: object.shape,
                beyond: beyond(iso, &survey),
            };
            marching_cubes::marching_cubes(labels, &samples, iso, frame, monitor)?
        }
    };
    monitor.report(Stage::Surface, 0.9)?;
    facts.iso_value = f64::from(object.iso);
    let spacing = object
        .frame
        .spacing()
        .into_iter()
        .fold(f64::INFINITY, f64::min);
    let (census, working) = rayon::join(
        || topology::check(&mesh),
        || working_surface(&mesh, monitor),
    );
    let (census, working) = (census?, working?);
    let mut tree = None;
    if parameters.denoise == Denoise::Auto && object.mask.is_none() {
        let intensity = |p: &Vec3| object.at(p);
        let found = denoise::denoise(&mut mesh, &working, intensity, spacing, monitor)?;
        if let Some((noise, search)) = found {
            facts.noise = Some(noise);
            tree = search.map(Arc::new);
        }
    }
    let surface = Surface {
        tree,
        ..finish(mesh, working, census, spacing, facts)
    };
    monitor.report(Stage::Surface, 1.0)?;
    Ok(surface)
}

/// The surface of what lies below `level`: the one at `-level` of the volume turned over. Nothing below a
/// value is searched for a ventricle.
fn below(
    volume: &Volume,
    level: f64,
    parameters: &SurfaceParameters,
    monitor: &Monitor,
) -> Result<Surface, SurfaceError> {
    let over = Volume {
        voxels: volume.voxels.iter().map(|v| -v).collect(),
        frame: volume.frame.clone(),
        ..*volume
    };
    let above = SurfaceParameters {
        iso: IsoLevel::Absolute(-level),
        isolate: match parameters.isolate {
            Isolate::Auto => Isolate::Largest,
            isolate => isolate,
        },
        ..parameters.clone()
    };
    let mut surface = extract(&over, &above, monitor).map_err(|error| match error {
        SurfaceError::NoSurface {
            minimum, maximum, ..
        } => SurfaceError::NoSurface {
            iso: level,
            minimum: -maximum,
            maximum: -minimum,
        },
        SurfaceError::SeedOutside { seed, value, .. } => SurfaceError::SeedOutside {
            seed,
            value: -value,
            iso: level,
        },
        error => error,
    })?;
    let facts = &mut surface.facts;
    let [low, high] = facts.range;
    facts.range = [-high, -low];
    facts.iso_value = level;
    facts.reference = -facts.reference;
    facts.otsu = facts.otsu.map(|otsu| -otsu);
    Ok(surface)
}

/// Makes a surface of any closed, oriented manifold.
///
/// `spacing` (mm) is the voxel size that tolerances refer to.
///
/// # Errors
/// [`SurfaceError::NotClosed`], [`SurfaceError::BadVertex`].
pub fn from_mesh(mesh: TriMesh, spacing: f64) -> Result<Surface, SurfaceError> {
    if let Some(vertex) = mesh
        .vertices
        .iter()
        .position(|v| !v.iter().all(|x| x.is_finite()))
    {
        return Err(SurfaceError::BadVertex { vertex });
    }
    let census = topology::check(&mesh)?;
    let facts = SurfaceFacts {
        region_ml: mesh.volume() / 1000.0,
        ..SurfaceFacts::default()
    };
    let working = working_surface(&mesh, &Monitor::silent())?;
    Ok(finish(mesh, working, census, spacing, facts))
}

fn working_surface(mesh: &TriMesh, monitor: &Monitor) -> Result<Vec<Vec3>, Cancelled> {
    smoothing::taubin(&mesh.vertices, &mesh.triangles, WORKING_PASSES, monitor)
}

fn finish(
    mesh: TriMesh,
    working: Vec<Vec3>,
    census: Census,
    spacing: f64,
    mut facts: SurfaceFacts,
) -> Surface {
    facts.euler_characteristic = census.euler_characteristic;
    facts.components = census.components;
    facts.genus = census.genus();
    facts.vertices = census.vertices;
    facts.triangles = census.triangles;
    Surface {
        working,
        mesh,
        tree: None,
        spacing,
        facts,
    }
}

/// The value that closes the object beyond the border.
fn beyond(iso: f32, survey: &Survey) -> f32 {
    let range = survey.maximum - survey.minimum;
    let value = iso - range;
    // The range may vanish against the iso-value or overflow f32; a value below is still needed.
    if value.is_finite() && value < iso {
        value
    } else {
        f32::MIN
    }
}

fn control_topology(
    object: &mut Object,
    mode: TopologyMode,
    facts: &mut SurfaceFacts,
    monitor: &Monitor,
) -> Result<(), SurfaceError> {
    let parts = Components::of_inside(&object.labels, monitor)?;
    let outside = Components::of_outside(&object.labels, monitor)?;
    let cavities = outside.sizes.len() - 1;
    let chi = object.labels.euler_characteristic();
    let [parts_before, voxels_before] = object.mask.map_or([0; 2], |mask| mask.dropped);
    facts.components_before = parts.sizes.len() + parts_before;
    facts.cavities_before = cavities;
    facts.handles_before = (parts.sizes.len() as i64 + cavities as i64 - chi).max(0) as usize;
    monitor.check()?;
    if mode == TopologyMode::Keep {
        return Ok(());
    }
    let largest = parts.sizes.iter().copied().max().unwrap_or(0);
    facts.voxels_dropped = voxels_before + parts.sizes.iter().sum::<usize>() - largest;
    let (values, shape, origin) = (&object.values, object.shape, object.labels.origin);
    let value = |p: [usize; 3]| {
        let [i, j, k] = [0, 1, 2].map(|r| p[r] + origin[r]);
        values[i + shape[0] * (j + shape[1] * k)]
    };
    let changes = topology_control::make_ball(&mut object.labels, value, monitor)?;
    facts.voxels_cut = changes.cut;
    facts.voxels_filled = changes.filled;
    warn_of_topology(facts, largest);
    if let Some(mask) = object.mask.filter(|mask| mask.joined > 0) {
        facts.voxels_filled += mask.joined;
        facts.warnings.push(format!(
            "parts of the mask touch along edges or at corners only: {} voxels were added to join them, and \
             the surface was drawn in to keep the volume; topology: keep leaves them apart",
            mask.joined
        ));
    }
    Ok(())
}

fn warn_of_topology(facts: &mut SurfaceFacts, largest: usize) {
    if facts.voxels_dropped > 0 {
        facts.warnings.push(format!(
            "{} further components with {} voxels were left out; topology: keep retains them",
            facts.components_before - 1,
            facts.voxels_dropped
        ));
    }
    let changed = facts.voxels_cut + facts.voxels_filled;
    if changed == 0 {
        return;
    }
    let share = changed as f64 / largest.max(1) as f64;
    let what = format!(
        "{} handles and {} cavities were removed by cutting {} and filling {} voxels ({:.2} % of the region)",
        facts.handles_before,
        facts.cavities_before,
        facts.voxels_cut,
        facts.voxels_filled,
        100.0 * share
    );
    facts.warnings.push(if share > LARGE_CHANGE {
        format!(
            "{what}: this is a large change. The object may truly have handles or cavities; topology: keep retains \
             them, another iso-value may avoid them"
        )
    } else {
        what
    });
}

/// Share of the volume's border from which the object at an iso-value is likely its surroundings.
const SURROUNDINGS_BORDER_SHARE: f64 = 0.5;

fn look_at_border(object: &Object, facts: &mut SurfaceFacts) {
    if object.mask.is_none() {
        facts.touches_border = object.labels.bounds().is_some_and(|(low, extent)| {
            (0..3).any(|r| {
                let first = low[r] + object.labels.origin[r];
                first == 0 || first + extent[r] == object.shape[r]
            })
        });
    }
    if !facts.touches_border {
        return;
    }
    facts.warnings.push(
        "the region touches the volume's border and was closed there; part of the object may lie outside the \
         volume".into(),
    );
    let share = match object.mask {
        None => share_of_border(object),
        Some(_) => 0.0,
    };
    if share > SURROUNDINGS_BORDER_SHARE {
        facts.warnings.push(format!(
            "the region takes {:.0} % of the volume's border: an object darker than its surroundings is taken by `iso` \
             = below:{}",
            100.0 * share,
            object.iso
        ));
    }
}

/// Share of the voxels at the volume's border that are of the object.
fn share_of_border(object: &Object) -> f64 {
    let shape = object.shape;
    let inner: usize = shape.iter().map(|n| n.saturating_sub(2)).product();
    let all = shape.iter().product::<usize>() - inner;
    let origin = object.labels.origin;
    let at_border = |p: &[usize; 3]| {
        (0..3).any(|r| {
            let place = p[r] + origin[r];
            place == 0 || place + 1 == shape[r]
        })
    };
    object.labels.voxels().filter(at_border).count() as f64 / all as f64
}
