//! From voxels to a closed triangle surface of the wall.
//!
//! In: a [`Volume`] of intensities or labels. Out: a [`Surface`]: closed, oriented, manifold,
//! LPS millimetres, and [`SurfaceFacts`] about everything that was seen and changed.
//!
//! 1. [`survey`]: range, missing values, label map or intensities.
//! 2. Region. Intensities: the left ventricle is searched ([`coarse`], [`component_tree`],
//!    [`left_ventricle`]) and cut from its neighbours ([`region`]), or taken as asked for.
//!    Labels: the mask is made grey ([`masks`]).
//! 3. Iso-value: half the wall's reference intensity unless asked otherwise.
//! 4. [`topology_control`]: one component without cavities and handles.
//! 5. [`marching_cubes`] (with its generated [`table`]) on [`labels`].
//! 6. [`working`]: the smoothed twin for geodesics and curvature.
//!
//! Guaranteed: the mesh is a closed, oriented 2-manifold; with [`TopologyMode::Genus0`] it is a
//! sphere; vertices lie at the linear crossings of the iso-value except where voxels were cut
//! or filled (there in the middle of the edge) and within 0.05 voxel of an edge's ends; the
//! same bytes on any number of threads. Not guaranteed: that a doubtful ventricle is the right
//! one - `facts.ventricle_score` and the warnings say how sure the search is.

pub mod coarse;
pub mod component_tree;
pub mod components;
pub mod labels;
pub mod left_ventricle;
pub mod marching_cubes;
pub mod masks;
pub mod region;
pub mod survey;
pub mod table;
pub mod topology_control;
pub mod working;

use crate::geometry::Vec3;
use crate::geometry::frame::VoxelToPatient;
use crate::mesh::TriMesh;
use crate::mesh::topology::{self, Census, Defect};
use crate::progress::{Cancelled, Monitor, Stage};
use crate::volume::Volume;

use components::Components;
use labels::Labels;
use left_ventricle::{DOUBTFUL, PLAUSIBLE};
use marching_cubes::{MarchingCubesError, Samples};
use survey::Survey;

/// How the iso-value is chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum IsoLevel {
    /// The region's own choice: a fraction of the ventricle's maximum that does not merge it
    /// with its neighbours; for masks the level that keeps their volume.
    Auto,
    /// A fraction (0, 1) of the ventricle's reference maximum.
    Fraction(f64),
    /// An intensity in the volume's own units.
    Absolute(f64),
}

/// Which part of the volume is the object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Isolate {
    /// A label map's label, or else the left ventricle, searched among liver and gut.
    Auto,
    /// Everything above the iso-value.
    None,
    /// The largest connected part above the iso-value.
    Largest,
    /// Voxels inside the box, first and last index (inclusive) along i, j, k.
    Box([usize; 3], [usize; 3]),
    /// The connected part that holds the voxel (0-based i, j, k).
    Seed([usize; 3]),
    /// Voxels that carry this value in a label map.
    Label(i64),
}

/// What becomes of handles, cavities and further components.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TopologyMode {
    /// Make one component without handles or cavities (a digital ball) and say what it took.
    Genus0,
    /// Leave everything as the iso-surface has it.
    Keep,
}

/// Parameters of [`extract`].
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceParameters {
    /// Default [`IsoLevel::Auto`].
    pub iso: IsoLevel,
    /// Default [`Isolate::Auto`].
    pub isolate: Isolate,
    /// Default [`TopologyMode::Genus0`].
    pub topology: TopologyMode,
    /// Gaussian sigma in voxels that smooths binary masks before surfacing, 0..=3. Default
    /// 0.8 (measured best of the range on a known surface).
    pub mask_smoothing: f64,
}

impl Default for SurfaceParameters {
    fn default() -> Self {
        Self {
            iso: IsoLevel::Auto,
            isolate: Isolate::Auto,
            topology: TopologyMode::Genus0,
            mask_smoothing: 0.8,
        }
    }
}

/// A closed, oriented surface in patient space and what was done to get it.
#[derive(Debug, Clone)]
pub struct Surface {
    /// The reference surface S: LPS millimetres, closed manifold, facing outward.
    pub mesh: TriMesh,
    /// The working surface W: S's vertices after Taubin smoothing, same connectivity. For
    /// geodesics and curvature only; distances are measured against S.
    pub working: Vec<Vec3>,
    /// Smallest voxel spacing, mm.
    pub spacing: f64,
    /// What was seen and changed on the way.
    pub facts: SurfaceFacts,
}

/// What the volume holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum VolumeKind {
    /// Uptake, counts: any grey values.
    #[default]
    Intensity,
    /// One label beside the background.
    Mask,
    /// Several labels.
    Labels,
}

/// What [`extract`] saw and did; goes into the report.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SurfaceFacts {
    /// The iso-value used, in the volume's units (for masks: level of the smoothed mask, 0..1).
    pub iso_value: f64,
    /// `iso_value / reference`.
    pub iso_fraction: f64,
    /// The intensity that fractions refer to: 98th percentile of the wall's voxels above 0.3 of
    /// its maximum. 1 for masks.
    pub reference: f64,
    /// Otsu's threshold round the region, for comparison. `None` for masks.
    pub otsu: Option<f64>,
    /// Smallest and largest finite value of the volume.
    pub range: [f64; 2],
    /// What the volume holds.
    pub kind: VolumeKind,
    /// The label surfaced.
    pub label: Option<i64>,
    /// How much like a left ventricle the found region looks, 0..1; `None` where it was not
    /// searched.
    pub ventricle_score: Option<f64>,
    /// Volume of the voxels enclosed by the surface, ml.
    pub region_ml: f64,
    /// Voxels cut from the region where a neighbour touches it at the iso-value.
    pub neighbour_voxels_cut: usize,
    /// Area of that cut, mm².
    pub neighbour_cut_mm2: f64,
    /// Components of the region at the iso-value before topology control.
    pub components_before: usize,
    /// Cavities before topology control.
    pub cavities_before: usize,
    /// Handles before topology control.
    pub handles_before: usize,
    /// Voxels of further components left out by topology control.
    pub voxels_dropped: usize,
    /// Voxels taken away by topology control to open handles.
    pub voxels_cut: usize,
    /// Voxels added by topology control to close cavities and handles.
    pub voxels_filled: usize,
    /// Whether the region touches the volume's border, where it was closed.
    pub touches_border: bool,
    /// Voxels that are NaN or infinite, taken as outside.
    pub not_finite: usize,
    /// Euler characteristic of the mesh.
    pub euler_characteristic: i64,
    /// Components of the mesh.
    pub components: usize,
    /// Handles of the mesh.
    pub genus: i64,
    /// Vertices of the mesh.
    pub vertices: usize,
    /// Triangles of the mesh.
    pub triangles: usize,
    /// Things a user should know, as sentences.
    pub warnings: Vec<String>,
}

/// Why there is no surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// Asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Every voxel is NaN or infinite.
    #[error("the volume holds no finite value (all {voxels} voxels are NaN or infinite)")]
    NoFiniteVoxel {
        /// Number of voxels.
        voxels: usize,
    },
    /// All voxels are equal.
    #[error("every voxel of the volume has the value {value}: there is nothing to find")]
    Constant {
        /// The value.
        value: f32,
    },
    /// Nothing of the volume reaches the iso-value.
    #[error(
        "there is no surface at the iso-value {iso}: the volume's values run from {minimum} to {maximum}; choose an iso-value between them"
    )]
    NoSurface {
        /// The iso-value.
        iso: f64,
        /// Smallest value.
        minimum: f32,
        /// Largest value.
        maximum: f32,
    },
    /// A fraction outside (0, 1), an absolute value that is not finite.
    #[error("iso: {value} is not {expected}")]
    BadIso {
        /// What was given.
        value: f64,
        /// What would do.
        expected: &'static str,
    },
    /// `mask_smoothing` outside its range.
    #[error("mask_smoothing: {value} is not between 0 and 3 voxels")]
    BadSmoothing {
        /// What was given.
        value: f64,
    },
    /// The label does not occur, or the volume is not a label map.
    #[error(
        "isolate: no voxel carries the label {label}; the volume has {}",
        describe_labels(present)
    )]
    NoSuchLabel {
        /// The label asked for.
        label: i64,
        /// The labels present and their voxel counts; empty if it is not a label map.
        present: Vec<(i64, usize)>,
    },
    /// The seed or the box leaves the volume.
    #[error("isolate: voxel {voxel:?} is outside the volume of {shape:?} voxels")]
    OutsideVolume {
        /// The voxel given.
        voxel: [usize; 3],
        /// The volume's shape.
        shape: [usize; 3],
    },
    /// The box's first voxel lies behind its last.
    #[error("isolate: the box's first voxel {first:?} lies behind its last {last:?}")]
    EmptyBox {
        /// First voxel given.
        first: [usize; 3],
        /// Last voxel given.
        last: [usize; 3],
    },
    /// The seed's voxel is below the iso-value.
    #[error("isolate: the seed {seed:?} has the value {value}, below the iso-value {iso}")]
    SeedOutside {
        /// The seed.
        seed: [usize; 3],
        /// Its value.
        value: f32,
        /// The iso-value.
        iso: f64,
    },
    /// The shape does not belong to the voxels.
    #[error("the volume's shape {shape:?} does not fit its {voxels} voxels")]
    BadShape {
        /// The shape.
        shape: [usize; 3],
        /// Number of values.
        voxels: usize,
    },
    /// The surface has more vertices than 32-bit indices can name.
    #[error(transparent)]
    TooManyVertices(#[from] marching_cubes::TooManyVertices),
    /// A mesh handed to [`from_mesh`] is not a closed manifold.
    #[error("the mesh is not a closed, oriented manifold: {0}")]
    NotClosed(#[from] Defect),
    /// A mesh handed to [`from_mesh`] has coordinates that are not finite.
    #[error("vertex {vertex} is not finite")]
    BadVertex {
        /// Index of the vertex.
        vertex: usize,
    },
}

impl SurfaceError {
    /// The parameter that the error is about, by its name for users.
    pub fn field(&self) -> Option<&'static str> {
        match self {
            SurfaceError::NoSurface { .. } | SurfaceError::BadIso { .. } => Some("iso"),
            SurfaceError::BadSmoothing { .. } => Some("mask_smoothing"),
            SurfaceError::NoSuchLabel { .. } => Some("label"),
            SurfaceError::EmptyBox { .. } => Some("box"),
            SurfaceError::OutsideVolume { .. } => Some("isolate"),
            SurfaceError::SeedOutside { .. } => Some("seed_point"),
            _ => None,
        }
    }

    /// What the caller can do about it.
    pub fn fix(&self) -> String {
        match self {
            SurfaceError::Cancelled(_) => "Ask again if the result is still wanted.".into(),
            SurfaceError::NoFiniteVoxel { .. } | SurfaceError::Constant { .. } => {
                "Look at the file in a viewer: there is nothing in it.".into()
            }
            SurfaceError::NoSurface {
                minimum, maximum, ..
            } => {
                format!(
                    "Set `iso` to auto or to an absolute value between {minimum} and {maximum}."
                )
            }
            SurfaceError::BadIso { expected, .. } => format!("Set `iso` to {expected}."),
            SurfaceError::BadSmoothing { .. } => "Set `mask_smoothing` from 0 to 3.".into(),
            SurfaceError::NoSuchLabel { .. } => "Set `label` to one that occurs.".into(),
            SurfaceError::OutsideVolume { shape, .. } => {
                format!("Give voxel indices below {shape:?}, counted from 0.")
            }
            SurfaceError::EmptyBox { .. } => "Give the lower corner of the box first.".into(),
            SurfaceError::SeedOutside { value, .. } => {
                format!("Choose a voxel inside the wall, or an `iso` below {value}.")
            }
            SurfaceError::BadShape { .. }
            | SurfaceError::TooManyVertices(_)
            | SurfaceError::NotClosed(_)
            | SurfaceError::BadVertex { .. } => "Send a smaller or a valid object.".into(),
        }
    }
}

fn describe_labels(present: &[(i64, usize)]) -> String {
    if present.is_empty() {
        return "no labels (its values are intensities)".into();
    }
    let shown: Vec<String> = present
        .iter()
        .take(40)
        .map(|(label, count)| format!("{label} ({count} voxels)"))
        .collect();
    let more = present.len().saturating_sub(40);
    if more > 0 {
        format!("labels {} and {more} more", shown.join(", "))
    } else {
        format!("labels {}", shown.join(", "))
    }
}

impl From<MarchingCubesError> for SurfaceError {
    fn from(error: MarchingCubesError) -> Self {
        match error {
            MarchingCubesError::Cancelled(e) => e.into(),
            MarchingCubesError::TooManyVertices(e) => e.into(),
        }
    }
}

/// Passes of Taubin's smoothing that make the working surface.
const WORKING_PASSES: usize = 15;
/// Passes that take the rest of the staircase off a mask's surface.
const MASK_PASSES: usize = 10;
/// Enclosed voids from which on the cavity counts as closed, ml.
const CLOSED_ML: f64 = 2.0;
/// Share of the region's voxels from which a change of topology is warned of.
const MUCH: f64 = 0.02;

/// The voxels to surface, and the samples that place the vertices.
struct Object<'a> {
    labels: Labels,
    values: std::borrow::Cow<'a, [f32]>,
    shape: [usize; 3],
    frame: VoxelToPatient,
    iso: f32,
    is_mask: bool,
}

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
    check_parameters(volume, parameters)?;
    let survey = survey::survey(volume, monitor)?;
    let mut facts = SurfaceFacts::default();
    let mut object = select(volume, parameters, &survey, &mut facts, monitor)?;
    monitor.report(Stage::Surface, 0.5)?;
    control_topology(&mut object, parameters.topology, &mut facts, monitor)?;
    monitor.report(Stage::Surface, 0.7)?;
    look_at_border(&object, &mut facts);
    facts.region_ml = object.labels.count() as f64 * object.frame.voxel_volume() / 1000.0;

    let samples = Samples {
        values: &object.values,
        shape: object.shape,
        beyond: beyond(object.iso, &survey, object.is_mask),
    };
    let mut mesh = marching_cubes::marching_cubes(
        &object.labels,
        &samples,
        object.iso,
        &object.frame,
        monitor,
    )?;
    monitor.report(Stage::Surface, 0.9)?;
    if object.is_mask {
        mesh.vertices = working::taubin(&mesh.vertices, &mesh.triangles, MASK_PASSES);
    }
    facts.iso_value = f64::from(object.iso);
    let spacing = object
        .frame
        .spacing()
        .into_iter()
        .fold(f64::INFINITY, f64::min);
    let (census, working) = rayon::join(|| topology::check(&mesh), || working_surface(&mesh));
    let surface = finish(mesh, working, census?, spacing, facts);
    monitor.report(Stage::Surface, 1.0)?;
    Ok(surface)
}

/// Takes any closed, oriented manifold over as a surface.
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
    let working = working_surface(&mesh);
    Ok(finish(mesh, working, census, spacing, facts))
}

fn working_surface(mesh: &TriMesh) -> Vec<Vec3> {
    working::taubin(&mesh.vertices, &mesh.triangles, WORKING_PASSES)
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
        spacing,
        facts,
    }
}

fn check_parameters(volume: &Volume, parameters: &SurfaceParameters) -> Result<(), SurfaceError> {
    let bad_iso = |value, expected| Err(SurfaceError::BadIso { value, expected });
    match parameters.iso {
        IsoLevel::Fraction(f) if !(f > 0.0 && f < 1.0) => {
            return bad_iso(f, "a fraction between 0 and 1 (0 % and 100 %)");
        }
        IsoLevel::Absolute(v) if !(v as f32).is_finite() => {
            return bad_iso(v, "a finite intensity");
        }
        _ => {}
    }
    if !(0.0..=3.0).contains(&parameters.mask_smoothing) {
        let value = parameters.mask_smoothing;
        return Err(SurfaceError::BadSmoothing { value });
    }
    let shape = volume.shape;
    let voxels = volume.voxels.len();
    let product = shape.iter().try_fold(1usize, |a, &n| a.checked_mul(n));
    if product != Some(voxels) || voxels == 0 {
        return Err(SurfaceError::BadShape { shape, voxels });
    }
    let inside = |p: [usize; 3]| {
        if (0..3).all(|r| p[r] < shape[r]) {
            Ok(())
        } else {
            Err(SurfaceError::OutsideVolume { voxel: p, shape })
        }
    };
    match parameters.isolate {
        Isolate::Seed(seed) => inside(seed),
        Isolate::Box(first, last) => {
            inside(first)?;
            inside(last)?;
            if (0..3).any(|r| first[r] > last[r]) {
                return Err(SurfaceError::EmptyBox { first, last });
            }
            Ok(())
        }
        _ => Ok(()),
    }
}

/// The value that closes the object beyond the border.
fn beyond(iso: f32, survey: &Survey, is_mask: bool) -> f32 {
    if is_mask {
        return 0.0;
    }
    let range = survey.maximum - survey.minimum;
    let value = iso - range;
    // A range that is lost against the iso-value, or no f32 at all, still needs a value below.
    if value.is_finite() && value < iso {
        value
    } else {
        f32::MIN
    }
}

/// Steps 1 to 3 of the module's list.
fn select<'a>(
    volume: &'a Volume,
    parameters: &SurfaceParameters,
    survey: &Survey,
    facts: &mut SurfaceFacts,
    monitor: &Monitor,
) -> Result<Object<'a>, SurfaceError> {
    if survey.finite == 0 {
        let voxels = volume.voxels.len();
        return Err(SurfaceError::NoFiniteVoxel { voxels });
    }
    facts.range = [survey.minimum, survey.maximum].map(f64::from);
    facts.not_finite = survey.not_finite;
    if survey.not_finite > 0 {
        facts.warnings.push(format!(
            "{} of {} voxels are NaN or infinite; they count as outside",
            survey.not_finite,
            volume.voxels.len()
        ));
    }
    if survey.minimum == survey.maximum {
        let value = survey.minimum;
        return Err(SurfaceError::Constant { value });
    }
    match (parameters.isolate, &survey.labels) {
        (Isolate::Label(label), present) => {
            let count = present.as_ref().and_then(|p| p.get(&label)).copied();
            if count.is_none() {
                let present = present.iter().flatten().map(|(&l, &n)| (l, n)).collect();
                return Err(SurfaceError::NoSuchLabel { label, present });
            }
            select_label(volume, parameters, label, facts)
        }
        // Who names an iso-value wants the values as they are.
        (Isolate::Auto, Some(present)) if parameters.iso == IsoLevel::Auto => {
            let largest = present
                .iter()
                .max_by_key(|&(&label, &n)| (n, std::cmp::Reverse(label)));
            let label = largest.map_or(0, |(&label, _)| label);
            facts.kind = if present.len() == 1 {
                VolumeKind::Mask
            } else {
                let all: Vec<_> = present.iter().map(|(&l, &n)| (l, n)).collect();
                facts.warnings.push(format!(
                    "the volume is a label map with {}; the largest, {label}, was taken: name another one by isolate: label",
                    describe_labels(&all)
                ));
                VolumeKind::Labels
            };
            select_label(volume, parameters, label, facts)
        }
        _ => select_intensity(volume, parameters, survey, facts, monitor),
    }
}

fn select_label<'a>(
    volume: &Volume,
    parameters: &SurfaceParameters,
    label: i64,
    facts: &mut SurfaceFacts,
) -> Result<Object<'a>, SurfaceError> {
    if facts.kind == VolumeKind::Intensity {
        facts.kind = VolumeKind::Labels;
    }
    facts.label = Some(label);
    let mask = mask_of(volume, label);
    let smoothed = masks::smooth(&mask, parameters.mask_smoothing);
    if smoothed.sigma < parameters.mask_smoothing {
        facts.warnings.push(format!(
            "thin parts of the mask would be lost: smoothed with {} instead of {} voxels",
            smoothed.sigma, parameters.mask_smoothing
        ));
    }
    let level = match parameters.iso {
        IsoLevel::Auto => smoothed.level,
        IsoLevel::Fraction(f) | IsoLevel::Absolute(f) => f as f32,
    };
    facts.reference = 1.0;
    facts.iso_fraction = f64::from(level);
    let shape = smoothed.shape;
    let labels = Labels::threshold(&smoothed.values, shape, [0; 3], shape, level);
    if labels.count() == 0 || !(level > 0.0) {
        return Err(SurfaceError::NoSurface {
            iso: f64::from(level),
            minimum: 0.0,
            maximum: smoothed.values.iter().copied().fold(0.0, f32::max),
        });
    }
    let corner = Vec3::from(smoothed.origin.map(|o| o as f64));
    let frame = VoxelToPatient::new(*volume.frame.linear(), volume.frame.to_patient(&corner))
        .expect("a moved frame is as invertible as the volume's own");
    let bounds = mask.bounds();
    facts.touches_border = bounds.is_some_and(|(low, extent)| {
        (0..3).any(|r| {
            let first = low[r] + mask.origin[r];
            first == 0 || first + extent[r] == volume.shape[r]
        })
    });
    Ok(Object {
        labels,
        values: smoothed.values.into(),
        shape,
        frame,
        iso: level,
        is_mask: true,
    })
}

/// The voxels that carry `label`, in the smallest box that holds them.
fn mask_of(volume: &Volume, label: i64) -> Labels {
    let [nx, ny, _] = volume.shape;
    let carries = |v: f32| v == label as f32;
    let mut low = [usize::MAX; 3];
    let mut high = [0; 3];
    for (row, values) in volume.voxels.chunks(nx).enumerate() {
        let Some(first) = values.iter().position(|&v| carries(v)) else {
            continue;
        };
        let last = values.iter().rposition(|&v| carries(v)).unwrap_or(first);
        let ends = [(first, last), (row % ny, row % ny), (row / ny, row / ny)];
        for (r, (a, b)) in ends.into_iter().enumerate() {
            low[r] = low[r].min(a);
            high[r] = high[r].max(b);
        }
    }
    if low[0] == usize::MAX {
        return Labels::empty([0; 3], [1; 3]);
    }
    let extent = [0, 1, 2].map(|r| high[r] - low[r] + 1);
    let mut mask = Labels::empty(low, extent);
    for k in 0..extent[2] {
        for j in 0..extent[1] {
            let start = low[0] + nx * (low[1] + j + ny * (low[2] + k));
            for (i, &v) in volume.voxels[start..start + extent[0]].iter().enumerate() {
                if carries(v) {
                    mask.set([i, j, k], true);
                }
            }
        }
    }
    mask
}

fn select_intensity<'a>(
    volume: &'a Volume,
    parameters: &SurfaceParameters,
    survey: &Survey,
    facts: &mut SurfaceFacts,
    monitor: &Monitor,
) -> Result<Object<'a>, SurfaceError> {
    if parameters.isolate == Isolate::Auto
        && let Some(labels) = find_ventricle(volume, parameters, survey, facts, monitor)?
    {
        let iso = facts.iso_value as f32;
        return Ok(whole(volume, labels, iso));
    }
    let (origin, extent) = match parameters.isolate {
        Isolate::Box(first, last) => (first, [0, 1, 2].map(|r| last[r] - first[r] + 1)),
        _ => ([0; 3], volume.shape),
    };
    let reference = reference_in_box(volume, origin, extent, survey);
    let iso = iso_value(parameters.iso, reference, survey)?;
    note_iso(facts, iso, reference);
    facts.otsu = Some(f64::from(otsu_in_box(volume, origin, extent, survey)));
    let mut labels = Labels::threshold(&volume.voxels, volume.shape, origin, extent, iso);
    if labels.count() == 0 {
        return Err(no_surface(iso, survey));
    }
    let one = match parameters.isolate {
        Isolate::Auto | Isolate::Largest => Components::of_inside(&labels).largest(),
        Isolate::Seed(seed) => {
            let components = Components::of_inside(&labels);
            let chosen = components.containing(&labels, seed);
            if chosen.is_none() {
                return Err(SurfaceError::SeedOutside {
                    seed,
                    value: volume.at(seed[0], seed[1], seed[2]),
                    iso: f64::from(iso),
                });
            }
            chosen
        }
        _ => None,
    };
    if let Some(one) = one {
        Components::of_inside(&labels).paint(&mut labels, false, |c| c != one);
    }
    Ok(whole(volume, labels, iso))
}

fn whole(volume: &Volume, labels: Labels, iso: f32) -> Object<'_> {
    Object {
        labels,
        values: volume.voxels.as_slice().into(),
        shape: volume.shape,
        frame: volume.frame.clone(),
        iso,
        is_mask: false,
    }
}

fn no_surface(iso: f32, survey: &Survey) -> SurfaceError {
    SurfaceError::NoSurface {
        iso: f64::from(iso),
        minimum: survey.minimum,
        maximum: survey.maximum,
    }
}

fn note_iso(facts: &mut SurfaceFacts, iso: f32, reference: f32) {
    facts.iso_value = f64::from(iso);
    facts.reference = f64::from(reference);
    facts.iso_fraction = f64::from(iso) / f64::from(reference);
}

/// The iso-value asked for; half the reference by default.
fn iso_value(level: IsoLevel, reference: f32, survey: &Survey) -> Result<f32, SurfaceError> {
    let iso = match level {
        IsoLevel::Auto => 0.5 * reference,
        IsoLevel::Fraction(f) => f as f32 * reference,
        IsoLevel::Absolute(v) => v as f32,
    };
    if iso > survey.maximum || iso <= survey.minimum {
        return Err(no_surface(iso, survey));
    }
    Ok(iso)
}

/// The region of the left ventricle with its iso-value noted in `facts`, or `None` (and a
/// warning) where none was found.
fn find_ventricle(
    volume: &Volume,
    parameters: &SurfaceParameters,
    survey: &Survey,
    facts: &mut SurfaceFacts,
    monitor: &Monitor,
) -> Result<Option<Labels>, SurfaceError> {
    let found = left_ventricle::find(volume, survey, monitor)?;
    let Some(ventricle) = found.filter(|v| v.score >= PLAUSIBLE) else {
        facts.warnings.push(
            "no left ventricle was recognised; the largest connected part was taken instead".into(),
        );
        return Ok(None);
    };
    facts.ventricle_score = Some(ventricle.score);
    if ventricle.score < DOUBTFUL {
        facts.warnings.push(format!(
            "the left ventricle was recognised with little certainty (score {:.2} of 1): look whether the region is right, or give a box or a seed",
            ventricle.score
        ));
    }
    let wall = region::Wall::new(volume, &ventricle);
    let asked = iso_value(parameters.iso, wall.reference, survey)?;
    let Some(region) = wall.region(asked, monitor)? else {
        return Err(no_surface(asked, survey));
    };
    let (iso, region) = if parameters.iso == IsoLevel::Auto {
        move_iso(volume, &wall, asked, region, facts, monitor)?
    } else {
        (asked, region)
    };
    note_iso(facts, iso, wall.reference);
    facts.otsu = Some(f64::from(otsu_in_box(
        volume,
        region.labels.origin,
        region.labels.extent,
        survey,
    )));
    facts.neighbour_voxels_cut = region.cut_voxels;
    facts.neighbour_cut_mm2 = region.cut_area;
    if region.cut_voxels > 0 {
        facts.warnings.push(format!(
            "a neighbouring organ touches the ventricle at the iso-value; it was cut off along {:.0} mm²",
            region.cut_area
        ));
    }
    if region.loose_voxels > region.labels.count() / 20 {
        facts.warnings.push(format!(
            "{} voxels of the wall are not connected to the rest at the iso-value and were left out (a defect splits the wall); a lower iso-value may join them",
            region.loose_voxels
        ));
    }
    Ok(Some(region.labels))
}

/// Moves the automatic iso-value where half the reference tears the wall (down to 0.35) or
/// closes the cavity (up to 0.6), and says so. Where that does not help it stays.
fn move_iso(
    volume: &Volume,
    wall: &region::Wall,
    iso: f32,
    region: region::Region,
    facts: &mut SurfaceFacts,
    monitor: &Monitor,
) -> Result<(f32, region::Region), SurfaceError> {
    let enclosed_ml =
        |r: &region::Region| r.enclosed_voxels() as f64 * volume.frame.voxel_volume() / 1000.0;
    let (fractions, why): (&[f32], _) = if region.is_torn() {
        (&[0.45, 0.4, 0.35], "the wall falls into pieces")
    } else if enclosed_ml(&region) > CLOSED_ML {
        (&[0.55, 0.6], "the cavity closes at the base")
    } else {
        return Ok((iso, region));
    };
    for &fraction in fractions {
        let level = fraction * wall.reference;
        if let Some(moved) = wall.region(level, monitor)?
            && !moved.is_torn()
            && enclosed_ml(&moved) <= CLOSED_ML
        {
            facts.warnings.push(format!(
                "at half the reference intensity {why}; the iso-value was moved to {fraction} of it"
            ));
            return Ok((level, moved));
        }
    }
    facts.warnings.push(format!(
        "at half the reference intensity {why}, and at no iso-value near by does it not"
    ));
    Ok((iso, region))
}

/// 98th percentile of the voxels above 0.3 of the box's maximum.
fn reference_in_box(
    volume: &Volume,
    origin: [usize; 3],
    extent: [usize; 3],
    survey: &Survey,
) -> f32 {
    let values = || rows_in_box(volume, origin, extent).flatten().copied();
    let highest = values()
        .filter(|v| v.is_finite())
        .fold(survey.minimum, f32::max);
    let floor = if highest > 0.0 {
        0.3 * highest
    } else {
        survey.minimum
    };
    // A histogram instead of a sorted copy: the box may be the whole of a large volume.
    const BINS: usize = 4096;
    let width = f64::from(highest) - f64::from(floor);
    if !(width > 0.0) {
        return highest;
    }
    let mut histogram = vec![0u64; BINS];
    for v in values().filter(|v| v.is_finite() && *v > floor) {
        let bin = ((f64::from(v) - f64::from(floor)) / width * BINS as f64) as usize;
        histogram[bin.min(BINS - 1)] += 1;
    }
    let total: u64 = histogram.iter().sum();
    let mut below = 0;
    for (bin, n) in histogram.iter().enumerate() {
        below += n;
        if 100 * below >= 98 * total {
            return (f64::from(floor) + (bin as f64 + 0.5) / BINS as f64 * width) as f32;
        }
    }
    highest
}

fn otsu_in_box(volume: &Volume, origin: [usize; 3], extent: [usize; 3], survey: &Survey) -> f32 {
    let rows: Vec<&[f32]> = rows_in_box(volume, origin, extent).collect();
    survey::otsu(&rows, survey.minimum, survey.maximum)
}

fn rows_in_box(
    volume: &Volume,
    origin: [usize; 3],
    extent: [usize; 3],
) -> impl Iterator<Item = &[f32]> {
    let [nx, ny, _] = volume.shape;
    (0..extent[1] * extent[2]).map(move |row| {
        let (j, k) = (row % extent[1] + origin[1], row / extent[1] + origin[2]);
        let start = origin[0] + nx * (j + ny * k);
        &volume.voxels[start..start + extent[0]]
    })
}

fn control_topology(
    object: &mut Object,
    mode: TopologyMode,
    facts: &mut SurfaceFacts,
    monitor: &Monitor,
) -> Result<(), SurfaceError> {
    let parts = Components::of_inside(&object.labels);
    let cavities = Components::of_outside(&object.labels).sizes.len() - 1;
    let chi = object.labels.euler_characteristic();
    facts.components_before = parts.sizes.len();
    facts.cavities_before = cavities;
    facts.handles_before = (parts.sizes.len() as i64 + cavities as i64 - chi).max(0) as usize;
    monitor.check()?;
    if mode == TopologyMode::Keep {
        return Ok(());
    }
    let largest = parts.sizes.iter().copied().max().unwrap_or(0);
    facts.voxels_dropped = parts.sizes.iter().sum::<usize>() - largest;
    let (values, shape, origin) = (&object.values, object.shape, object.labels.origin);
    let value = |p: [usize; 3]| {
        let [i, j, k] = [0, 1, 2].map(|r| p[r] + origin[r]);
        values[i + shape[0] * (j + shape[1] * k)]
    };
    let changes = topology_control::make_ball(&mut object.labels, value, monitor)?;
    facts.voxels_cut = changes.cut;
    facts.voxels_filled = changes.filled;
    warn_of_topology(facts, largest);
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
    facts.warnings.push(if share > MUCH {
        format!(
            "{what}: THIS IS MUCH. The object may truly have handles or cavities; topology: keep retains them, another iso-value may avoid them"
        )
    } else {
        what
    });
}

fn look_at_border(object: &Object, facts: &mut SurfaceFacts) {
    if !object.is_mask {
        facts.touches_border = object.labels.bounds().is_some_and(|(low, extent)| {
            (0..3).any(|r| {
                let first = low[r] + object.labels.origin[r];
                first == 0 || first + extent[r] == object.shape[r]
            })
        });
    }
    if facts.touches_border {
        facts.warnings.push(
            "the region touches the volume's border and was closed there; part of the object may lie outside the volume".into(),
        );
    }
}
