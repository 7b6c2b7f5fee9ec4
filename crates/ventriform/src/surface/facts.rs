//! Facts about a volume and the changes made on the way to its surface.

use super::denoise::SurfaceNoise;

/// The content of the volume.
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

/// Facts and changes of [`extract`](super::extract); part of the report.
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
    /// The content of the volume.
    pub kind: VolumeKind,
    /// The label surfaced.
    pub label: Option<i64>,
    /// Likeness of the found region to a left ventricle, 0..1; `None` where it was not
    /// searched.
    pub ventricle_score: Option<f64>,
    /// Volume of the voxels that carry the label, ml; `None` for intensities. The surface is made to
    /// enclose it.
    pub mask_ml: Option<f64>,
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
    /// The noise, measured and taken off the surface; `None` for masks and if that is off.
    pub noise: Option<SurfaceNoise>,
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
