//! Scans that lie beside the project, not in it: `../shared/data`.

use std::path::{Path, PathBuf};

/// The file or folder of that name in `../shared/data`; `None`, after a line that says so, if it is absent.
pub fn shared_data(name: &str) -> Option<PathBuf> {
    // Tests run in the folder of their package.
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let path = project.join("../shared/data").join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: ../shared/data/{name} is absent");
    None
}
