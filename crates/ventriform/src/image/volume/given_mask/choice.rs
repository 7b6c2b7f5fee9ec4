//! Which structure of a mask's file is meant.

use super::error::GivenMaskError;
use super::label::MaskLabel;
use super::structures::{HeldKind, HeldStructures, MaskStructure};
use crate::mesh::files::MeshStatement;

/// The caller's statements about a mask.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct MaskChoice {
    /// The structure. Default: the only one, or the myocardium among segments.
    pub label: Option<MaskLabel>,
    /// Whether a mask on another lattice of voxels is resampled. Default: it is refused.
    pub resample: bool,
    /// Unit and frame of a mask that is a mesh.
    pub mesh: MeshStatement,
}

/// The number of the structure among `held` that `choice` means.
///
/// # Errors
/// [`GivenMaskError`] if there is none, or several may be meant.
pub(super) fn choose(held: &HeldStructures, choice: &MaskChoice) -> Result<i64, GivenMaskError> {
    if held.kind == HeldKind::None {
        let [minimum, maximum] = held.range;
        return Err(GivenMaskError::NotMask { minimum, maximum });
    }
    let Some(label) = &choice.label else {
        return unnamed(held);
    };
    let name = match label {
        MaskLabel::Number(number) => number.to_string(),
        MaskLabel::Name(name) => name.to_lowercase(),
    };
    let number = |s: &&MaskStructure| *label == MaskLabel::Number(s.number);
    // A code may look like a number.
    let called = |s: &&MaskStructure| s.names.iter().any(|own| own.to_lowercase() == name);
    let mut named: Vec<&MaskStructure> = held.all.iter().filter(number).collect();
    if named.is_empty() {
        named = held.all.iter().filter(called).collect();
    }
    match named[..] {
        [one] => Ok(one.number),
        [] => Err(GivenMaskError::NoSuchStructure {
            label: label.clone(),
            present: held.all.clone(),
        }),
        _ => Err(several(&named)),
    }
}

/// The structure that is meant where none is named.
fn unnamed(held: &HeldStructures) -> Result<i64, GivenMaskError> {
    let muscle: Vec<&MaskStructure> = held.objects.iter().filter(|s| s.myocardium).collect();
    match (&held.objects[..], &muscle[..]) {
        ([], _) => Err(GivenMaskError::Empty),
        ([one], _) if one.cavity => Err(GivenMaskError::OnlyCavity {
            present: held.objects.clone(),
        }),
        ([one], _) => Ok(one.number),
        (_, [one]) => Ok(one.number),
        (objects, []) => Err(several(&objects.iter().collect::<Vec<_>>())),
        (_, muscle) => Err(several(muscle)),
    }
}

fn several(structures: &[&MaskStructure]) -> GivenMaskError {
    GivenMaskError::SeveralStructures {
        present: structures.iter().map(|s| (*s).clone()).collect(),
    }
}
