//! The names of the files of a beat.

/// The files that every beat has beside its meshes: pictures, tables and the report.
pub const FILE_NAMES: &[&str] = &[
    "beat.json",
    "curve.svg",
    "phase.svg",
    "gates.csv",
    "segments.csv",
];

/// The names of the files of one gate, counted from 01, as a regular expression: its mesh in each format, and its labels.
pub const GATE_FILE_PATTERN: &str =
    r"^(mesh_gate[0-9]{2}\.(glb|gltf|stl|ply|obj|vtk|vtp|json)|labels_gate[0-9]{2}\.nii\.gz)$";
