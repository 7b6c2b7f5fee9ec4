//! The names of the files of a beat.

use crate::results::export::dicom::BeatEnd;

/// The files that a beat has beside the meshes of its gates: report, its page, pictures, tables, polar maps, and
/// the beat as an animation; z and scores only with normal limits.
pub const FILE_NAMES: &[&str] = &[
    "beat.json",
    "report.html",
    "curve.svg",
    "phase.svg",
    "gates.csv",
    "segments.csv",
    "polar.svg",
    "polar.json",
    "polar_ed.svg",
    "polar_ed.json",
    "polar_es.svg",
    "polar_es.json",
    "polar_motion.svg",
    "polar_motion.json",
    "polar_thickening.svg",
    "polar_thickening.json",
    "polar_phase.svg",
    "polar_phase.json",
    "polar_z.svg",
    "polar_z.png",
    "polar_z.json",
    "polar_score.svg",
    "polar_score.png",
    "polar_score.json",
    "mesh.glb",
];

/// The names of the files of one gate, counted from 01, as a regular expression: its mesh in each format, and its
/// labels.
pub const GATE_FILE_PATTERN: &str =
    r"^(mesh_gate[0-9]{2}\.(glb|gltf|stl|ply|obj|vtk|vtp|json)|labels_gate[0-9]{2}\.nii\.gz)$";

/// The name, without extension, of the mesh of the gate at that end.
pub const fn end_mesh(end: BeatEnd) -> &'static str {
    match end {
        BeatEnd::Diastole => "mesh_ed",
        BeatEnd::Systole => "mesh_es",
    }
}

/// Whether `stem` is the name, without extension, of the mesh of a gate.
pub fn is_gate_mesh(stem: &str) -> bool {
    let number = stem.strip_prefix("mesh_gate");
    let number = number.and_then(|digits| digits.parse().ok());
    number.is_some_and(|number| gate_mesh(number) == stem)
}

/// The name, without extension, of the mesh of the gate with that number, counted from 1.
pub(super) fn gate_mesh(number: usize) -> String {
    format!("mesh_gate{number:02}")
}

/// The name of the labels of the gate with that number, counted from 1.
pub fn gate_labels(number: usize) -> String {
    format!("labels_gate{number:02}.nii.gz")
}
