//! The names of the files of a beat.

/// The files that every beat has beside the meshes of its gates: report, pictures, tables, polar maps, and the beat as an
/// animation.
pub const FILE_NAMES: &[&str] = &[
    "beat.json",
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
    "mesh.glb",
];

/// The names of the files of one gate, counted from 01, as a regular expression: its mesh in each format, and its labels.
pub const GATE_FILE_PATTERN: &str =
    r"^(mesh_gate[0-9]{2}\.(glb|gltf|stl|ply|obj|vtk|vtp|json)|labels_gate[0-9]{2}\.nii\.gz)$";
