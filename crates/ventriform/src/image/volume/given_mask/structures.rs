//! The structures in a mask's file.

use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::survey;
use crate::image::volume::Segment;
use crate::image::volume::{Volume, VolumeFacts};
use std::collections::BTreeMap;

/// One structure of a mask's file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MaskStructure {
    /// Label or Segment Number.
    pub number: i64,
    /// Its names: Segment Label, and meanings and values of its codes. Labels of a map have none.
    pub names: Vec<String>,
    /// Number of its voxels, if they were counted.
    pub voxels: Option<usize>,
    /// Whether its codes say that it is the myocardium, or the left ventricle's.
    pub myocardium: bool,
    /// Whether its codes say that it is what the wall encloses.
    pub cavity: bool,
}

impl std::fmt::Display for MaskStructure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.number)?;
        match (self.names.first(), self.voxels) {
            (Some(name), _) => write!(f, " ({name})"),
            (None, Some(voxels)) => write!(f, " ({voxels} voxels)"),
            (None, None) => Ok(()),
        }
    }
}

/// The structures of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct HeldStructures {
    pub(super) kind: HeldKind,
    /// Those that may be meant without being named.
    pub(super) objects: Vec<MaskStructure>,
    /// All values that can be named, the background among them.
    pub(super) all: Vec<MaskStructure>,
    /// Smallest and largest value.
    pub(super) range: [f32; 2],
}

/// Storage of the structures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum HeldKind {
    /// Segments of a DICOM Segmentation.
    Segments,
    /// Whole numbers.
    Labels,
    /// Probabilities, 0..=1: the structure is above one half.
    Probabilities,
    /// Two values that are not both whole; the one at the border is the background.
    TwoValues {
        /// The background, by its bits.
        background: u32,
    },
    /// Intensities.
    None,
}

/// Voxels between two looks at the cancel token.
const VOXELS_PER_CHECK: usize = 1 << 18;

/// Whole numbers that are labels however they lie.
const SMALL_LABELS: usize = 8;

/// Codes of the myocardium: of the heart, and of the left ventricle (SNOMED CT, SNOMED RT, FMA).
const MYOCARDIUM_CODES: [&str; 5] = ["74281007", "49848007", "T-32020", "9462", "9558"];
/// Our code of the cavity (`export::dicom`).
const CAVITY_CODE: &str = "LV-CAVITY";
/// Words of code meanings that say what is not the wall.
const OTHER_MUSCLE: [&str; 8] = [
    "right", "atri", "infarct", "scar", "ischem", "ischaem", "defect", "segment",
];
/// Words of code meanings for what the wall encloses.
const ENCLOSED_WORDS: [&str; 4] = ["cavity", "blood pool", "bloodpool", "lumen"];

/// The structures of a DICOM Segmentation.
pub(super) fn of_segments(segments: &[Segment]) -> HeldStructures {
    let structure = |segment: &Segment| {
        let says = |words: &[&str]| {
            let meanings = segment.codes.iter().map(|code| code.meaning.to_lowercase());
            meanings
                .into_iter()
                .any(|m| words.iter().any(|word| m.contains(word)))
        };
        let coded = |codes: &[&str]| {
            let mut values = segment.codes.iter().map(|code| code.value.as_str());
            values.any(|value| codes.contains(&value))
        };
        let cavity = coded(&[CAVITY_CODE]) || says(&ENCLOSED_WORDS);
        let label = segment.label.iter().cloned();
        let codes = segment.codes.iter();
        let codes = codes.flat_map(|code| [code.meaning.clone(), code.value.clone()]);
        let mut names: Vec<String> = label.chain(codes).filter(|n| !n.is_empty()).collect();
        names.dedup();
        MaskStructure {
            number: segment.number.into(),
            names,
            voxels: None,
            myocardium: !cavity
                && (coded(&MYOCARDIUM_CODES) || says(&["myocard"]) && !says(&OTHER_MUSCLE)),
            cavity,
        }
    };
    let all: Vec<MaskStructure> = segments.iter().map(structure).collect();
    HeldStructures {
        kind: HeldKind::Segments,
        objects: all.clone(),
        all,
        range: [0.0; 2],
    }
}

fn label(number: i64, voxels: usize) -> MaskStructure {
    MaskStructure {
        number,
        names: Vec::new(),
        voxels: Some(voxels),
        myocardium: false,
        cavity: false,
    }
}

/// The labels of a file whose numbers 32-bit floats do not tell apart.
pub(super) fn of_labels(facts: &VolumeFacts) -> HeldStructures {
    let labels = facts.intensity.labels.iter().flatten();
    let all: Vec<_> = labels.map(|l| label(l.label, l.voxels as usize)).collect();
    HeldStructures {
        kind: if all.is_empty() {
            HeldKind::None
        } else {
            HeldKind::Labels
        },
        objects: all.clone(),
        all,
        range: [facts.intensity.minimum, facts.intensity.maximum],
    }
}

/// The structures of a volume.
///
/// # Errors
/// [`Cancelled`].
pub(super) fn of_volume(volume: &Volume, monitor: &Monitor) -> Result<HeldStructures, Cancelled> {
    let (low, high, not_finite) = survey::range(&volume.voxels, monitor)?;
    let held = |kind, objects: Vec<MaskStructure>, all| HeldStructures {
        kind,
        objects,
        all,
        range: [low, high],
    };
    if let Some(values) = survey::whole_values(volume, monitor)? {
        let mut labels = values.clone();
        labels.remove(&0);
        let objects = match labels.len() {
            // Every voxel is of the one structure, or none.
            1 if values.len() == 1 && low == high && not_finite == 0 => labels,
            _ => survey::objects(volume, &labels, monitor)?.0,
        };
        // Counts are whole numbers, too.
        if objects.len() > SMALL_LABELS && survey::label_map(volume, monitor)?.is_none() {
            return Ok(held(HeldKind::None, Vec::new(), Vec::new()));
        }
        let list = |map: BTreeMap<i64, usize>| {
            map.into_iter()
                .map(|(number, voxels)| label(number, voxels))
                .collect()
        };
        return Ok(held(HeldKind::Labels, list(objects), list(values)));
    }
    let one = || vec![label(1, 0)];
    if let Some(background) = two_values(volume, monitor)? {
        let background = background.to_bits();
        return Ok(held(HeldKind::TwoValues { background }, one(), Vec::new()));
    }
    // Scaling may exceed 1 by rounding.
    Ok(if low >= 0.0 && high <= 1.0 + 1e-5 {
        held(HeldKind::Probabilities, one(), Vec::new())
    } else {
        held(HeldKind::None, Vec::new(), Vec::new())
    })
}

/// The value at most of the border of a volume that has two values, missing ones counted as one; `None`
/// for more or fewer.
fn two_values(volume: &Volume, monitor: &Monitor) -> Result<Option<f32>, Cancelled> {
    let [nx, ny, nz] = volume.shape;
    let value = |v: f32| if v.is_nan() { 0.0 } else { v };
    let first = value(volume.voxels[0]);
    let mut other = None;
    let mut border = [0_usize; 2];
    for (n, v) in volume.voxels.iter().enumerate() {
        if n.is_multiple_of(VOXELS_PER_CHECK) {
            monitor.check()?;
        }
        let v = value(*v);
        let at = [n % nx, n / nx % ny, n / (nx * ny)];
        let outer = at
            .iter()
            .zip([nx, ny, nz])
            .any(|(x, n)| *x == 0 || x + 1 == n);
        if v == first {
            border[0] += usize::from(outer);
        } else if *other.get_or_insert(v) == v {
            border[1] += usize::from(outer);
        } else {
            return Ok(None);
        }
    }
    Ok(other.map(|other| if border[0] >= border[1] { first } else { other }))
}

impl HeldStructures {
    /// Which structure number `chosen` is; `None` if the file holds nothing else.
    pub(super) fn describe(&self, chosen: i64) -> Option<String> {
        let found = self.all.iter().find(|s| s.number == chosen)?;
        match self.kind {
            HeldKind::Segments => Some(format!("segment {found}")),
            _ if self.objects.len() == 1 && self.objects[0].number == chosen => None,
            _ => Some(format!("label {chosen}")),
        }
    }

    /// The voxels of `volume` that are of structure number `chosen`.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub(super) fn voxels(
        &self,
        volume: &Volume,
        chosen: i64,
        monitor: &Monitor,
    ) -> Result<Vec<bool>, Cancelled> {
        let inside = |v: f32| match self.kind {
            HeldKind::Segments | HeldKind::Labels => v == chosen as f32,
            HeldKind::Probabilities => v > 0.5,
            HeldKind::TwoValues { background } => {
                let v = if v.is_nan() { 0.0 } else { v };
                v != f32::from_bits(background)
            }
            HeldKind::None => false,
        };
        those(&volume.voxels, inside, monitor)
    }
}

/// Of which of the values `inside` is true.
///
/// # Errors
/// [`Cancelled`].
pub(super) fn those(
    values: &[f32],
    inside: impl Fn(f32) -> bool,
    monitor: &Monitor,
) -> Result<Vec<bool>, Cancelled> {
    let mut found = Vec::with_capacity(values.len());
    for portion in values.chunks(VOXELS_PER_CHECK) {
        monitor.check()?;
        found.extend(portion.iter().map(|v| inside(*v)));
    }
    Ok(found)
}
