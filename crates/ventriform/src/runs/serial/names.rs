//! The names of the files of a serial comparison. Scans are counted from 01 in the order of the report.

/// The files beside those of single scans and pairs.
pub const FILE_NAMES: &[&str] = &[
    "serial.json",
    "report.html",
    "trend.svg",
    "figures.csv",
    "changes.csv",
    "segments.csv",
];

/// The names of the files of scans and pairs, as a regular expression: of every scan the wall in each format, its polar
/// map, and the image about the heart; of every pair the map of the change.
pub const NUMBERED_FILE_PATTERN: &str = r"^(mesh_scan[0-9]{2}\.(glb|gltf|stl|ply|obj|vtk|vtp|json)|polar_scan[0-9]{2}\.(svg|png|json)|region_scan[0-9]{2}\.nii\.gz|polar_change_[0-9]{2}_[0-9]{2}\.(svg|png|json))$";

/// The name, without extension, of the mesh of the scan with that number.
pub fn mesh_of(scan: usize) -> String {
    format!("mesh_scan{scan:02}")
}

/// Whether `stem` is the name, without extension, of the mesh of a scan.
pub fn is_scan_mesh(stem: &str) -> bool {
    let number = stem.strip_prefix("mesh_scan");
    let number = number.and_then(|digits| digits.parse().ok());
    number.is_some_and(|number| mesh_of(number) == stem)
}

/// The name, without extension, of the polar map of the scan with that number.
pub(super) fn polar_of(scan: usize) -> String {
    format!("polar_scan{scan:02}")
}

/// The name, without extension, of the map of the change between two scans.
pub(super) fn change_of([earlier, later]: [usize; 2]) -> String {
    format!("polar_change_{earlier:02}_{later:02}")
}

/// The name of the image about the heart of the scan with that number.
pub(super) fn region_of(scan: usize) -> String {
    format!("region_scan{scan:02}.nii.gz")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_of_scans_are_told_by_their_names() {
        assert!(is_scan_mesh("mesh_scan01") && is_scan_mesh("mesh_scan20"));
        for other in [
            "mesh_scan1",
            "mesh_scan001",
            "mesh_scan",
            "mesh_rest",
            "mesh_scan+1",
        ] {
            assert!(!is_scan_mesh(other), "{other}");
        }
    }
}
