//! The names of the files of a comparison.

use crate::heart::comparison::WhichScan;

/// The files that a comparison may have beside meshes: report, its page, table, polar maps, and the image about each
/// heart. Z and scores are of comparisons with normal limits.
pub const FILE_NAMES: &[&str] = &[
    "comparison.json",
    "report.html",
    "slices.png",
    "segments.csv",
    "polar_stress.svg",
    "polar_stress.png",
    "polar_stress.json",
    "polar_rest.svg",
    "polar_rest.png",
    "polar_rest.json",
    "polar_difference.svg",
    "polar_difference.png",
    "polar_difference.json",
    "polar_z_stress.svg",
    "polar_z_stress.png",
    "polar_z_stress.json",
    "polar_z_rest.svg",
    "polar_z_rest.png",
    "polar_z_rest.json",
    "polar_score_stress.svg",
    "polar_score_stress.png",
    "polar_score_stress.json",
    "polar_score_rest.svg",
    "polar_score_rest.png",
    "polar_score_rest.json",
    "region_stress.nii.gz",
    "region_rest.nii.gz",
];

/// The name, without extension, of the mesh of the wall in that scan.
pub const fn mesh(scan: WhichScan) -> &'static str {
    match scan {
        WhichScan::Stress => "mesh_stress",
        WhichScan::Rest => "mesh_rest",
    }
}

/// The name of the image about the heart in that scan.
pub(super) fn region(scan: WhichScan) -> String {
    format!("region_{}.nii.gz", scan.as_str())
}
