//! The file of one fit's result, so that a run that was stopped continues where it ended.
//!
//! A record is used only if its key is the one that this run would give it: the SHA-256 of
//! everything that the fit depends on (program, model, the patient's files, parameters).

use super::cohort_fit::CohortFit;
use super::error::EvaluateError;
use super::files::write_whole;
use super::rows::{Agreed, FitOutcome};
use crate::base::geometry::Vec3;
use crate::base::text::hex;
use crate::image::locate::cup::Cup;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Serialize, Deserialize)]
struct Record {
    key: String,
    outcome: FitOutcome,
    agreed: [Option<Agreed>; 2],
    figures: BTreeMap<String, f64>,
    /// Centre, axis, length and breadth.
    cup: Option<([f64; 3], [f64; 3], f64, f64)>,
    superior: [f64; 3],
    vertices: Vec<[f64; 3]>,
}

/// The result in the file `path`; `None` if there is no whole record with this key.
pub fn read(path: &Path, key: &str) -> Option<CohortFit> {
    let record: Record = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
    (record.key == key).then(|| CohortFit {
        outcome: record.outcome,
        agreed: record.agreed,
        figures: record.figures,
        cup: record.cup.map(|(centre, axis, length, breadth)| Cup {
            centre: centre.into(),
            axis: axis.into(),
            length,
            breadth,
        }),
        superior: record.superior.into(),
        vertices: record.vertices.into_iter().map(Vec3::from).collect(),
    })
}

/// Writes the result with its key to the file `path`.
///
/// # Errors
/// [`EvaluateError::Write`].
pub fn write(path: &Path, key: &str, fit: &CohortFit) -> Result<(), EvaluateError> {
    let record = Record {
        key: key.to_owned(),
        outcome: fit.outcome.clone(),
        agreed: fit.agreed,
        figures: fit.figures.clone(),
        cup: fit
            .cup
            .map(|c| (c.centre.into(), c.axis.into(), c.length, c.breadth)),
        superior: fit.superior.into(),
        vertices: fit.vertices.iter().map(|v| (*v).into()).collect(),
    };
    write_whole(path, &serde_json::to_vec(&record)?)
}

/// A SHA-256 over parts, each with its length, so that no two lists of parts read the same.
#[derive(Clone, Default)]
pub struct Key(Sha256);

impl Key {
    /// The key of no parts.
    pub fn new() -> Self {
        Self(Sha256::new())
    }

    /// The key with one more part.
    pub fn and(mut self, part: &[u8]) -> Self {
        self.0.update((part.len() as u64).to_le_bytes());
        self.0.update(part);
        self
    }

    /// The key as text.
    pub fn text(self) -> String {
        hex(&self.0.finalize())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_read_again_under_its_key_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        let fitted = CohortFit {
            outcome: FitOutcome::Fitted("converged".into()),
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
            superior: Vec3::z(),
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
        let key = |parts: &[&[u8]]| parts.iter().fold(Key::new(), |k, p| k.and(p)).text();
        assert_eq!(key(&[b"ab", b"c"]), key(&[b"ab", b"c"]));
        assert_ne!(key(&[b"ab", b"c"]), key(&[b"a", b"bc"]));
        assert_ne!(key(&[b"abc"]), key(&[b"abc", b""]));
    }
}
