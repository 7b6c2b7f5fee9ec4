//! A fit's result as it is kept, so that a run that was stopped goes on where it was.
//!
//! A record is believed only if its key is the one that the run would give it now: the
//! SHA-256 of everything that the fit depends on (this program, the model, the patient's
//! files, the parameters). It is written to a file beside its own and renamed, so that a run
//! killed in the midst of writing leaves no half record.

use crate::evaluate::fits::Fitted;
use crate::evaluate::rows::{Agreed, Outcome};
use crate::geometry::Vec3;
use crate::locate::cup::Cup;
use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Serialize, Deserialize)]
struct Record {
    key: String,
    outcome: Outcome,
    agreed: [Option<Agreed>; 2],
    figures: BTreeMap<String, f64>,
    /// Centre, axis, length and breadth.
    cup: Option<([f64; 3], [f64; 3], f64, f64)>,
    vertices: Vec<[f64; 3]>,
}

/// The result kept at `path` under `key`.
pub fn read(path: &Path, key: &str) -> Option<Fitted> {
    let record: Record = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
    (record.key == key).then(|| Fitted {
        outcome: record.outcome,
        agreed: record.agreed,
        figures: record.figures,
        cup: record.cup.map(|(centre, axis, length, breadth)| Cup {
            centre: centre.into(),
            axis: axis.into(),
            length,
            breadth,
        }),
        vertices: record.vertices.into_iter().map(Vec3::from).collect(),
    })
}

/// Keeps `fitted` at `path` under `key`.
pub fn write(path: &Path, key: &str, fitted: &Fitted) -> Result<()> {
    let record = Record {
        key: key.to_owned(),
        outcome: fitted.outcome.clone(),
        agreed: fitted.agreed,
        figures: fitted.figures.clone(),
        cup: fitted
            .cup
            .map(|c| (c.centre.into(), c.axis.into(), c.length, c.breadth)),
        vertices: fitted.vertices.iter().map(|v| (*v).into()).collect(),
    };
    write_file(path, &serde_json::to_vec(&record)?)
}

/// Writes a file all at once or not at all.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let beside = path.with_file_name(format!(".{name}.part"));
    std::fs::write(&beside, bytes)
        .and_then(|()| std::fs::rename(&beside, path))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// A SHA-256 over parts, each with its length, so that no two lists of parts read the same.
#[derive(Clone)]
pub struct Key(Sha256);

impl Key {
    /// Begins with this program: another build may fit otherwise.
    pub fn of_this_program() -> Self {
        let program = std::env::current_exe().and_then(std::fs::read);
        Self(Sha256::new()).and(&program.unwrap_or_default())
    }

    /// The key with one part more.
    pub fn and(mut self, part: &[u8]) -> Self {
        self.0.update((part.len() as u64).to_le_bytes());
        self.0.update(part);
        self
    }

    /// The key as text.
    pub fn text(self) -> String {
        let digest = self.0.finalize();
        digest.iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::evaluate::record::*;

    #[test]
    fn a_record_is_read_again_under_its_key_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        let fitted = Fitted {
            outcome: Outcome::Fitted("converged".into()),
            agreed: [
                Some(Agreed {
                    jaccard: 0.812_345,
                    contour_voxels: Some(0.321_098),
                    contour_mm: Some(1.234_567),
                    dice: 0.896_456,
                    hausdorff95_mm: None,
                }),
                None,
            ],
            figures: BTreeMap::from([("wall_ml".into(), 123.456_789)]),
            cup: Some(Cup {
                centre: Vec3::new(1.5, -2.25, 3.125),
                axis: Vec3::x(),
                length: 80.000_001,
                breadth: 1.1,
            }),
            vertices: vec![Vec3::new(0.1, 0.2, 0.3)],
        };
        write(&path, "k1", &fitted).unwrap();
        assert_eq!(read(&path, "k1"), Some(fitted));
        assert_eq!(read(&path, "k2"), None);
        // Half a file, as a crash of an older kind would leave it.
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert_eq!(read(&path, "k1"), None);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn keys_tell_lists_of_parts_apart() {
        let key = |parts: &[&[u8]]| {
            let start = Key(Sha256::new());
            parts.iter().fold(start, |k, p| k.and(p)).text()
        };
        assert_eq!(key(&[b"ab", b"c"]), key(&[b"ab", b"c"]));
        assert_ne!(key(&[b"ab", b"c"]), key(&[b"a", b"bc"]));
        assert_ne!(key(&[b"abc"]), key(&[b"abc", b""]));
    }
}
