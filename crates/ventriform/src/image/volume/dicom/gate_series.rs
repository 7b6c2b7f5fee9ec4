//! A gated study in DICOM files of one gate each, or in one series for each gate.
//!
//! In: 6 to 32 Nuclear Medicine or Enhanced images of one study, or as many PET series of slices. Out: what one image
//! with all gates would be.
//!
//! They are gates if each holds one volume, all lie on one grid, all say that they are gates ([`timing::is_one_gate`],
//! [`timing::is_of_gates`]), nothing says that they are of several scans ([`one_scan`](super::one_scan)), and a number
//! in their headers orders them: of [`ORDERING_ATTRIBUTES`] the first that all have and no two share. Otherwise they
//! are volumes of their own, which only a person can call gates.
//!
//! Guaranteed: the order in which the files are given does not matter. Not guaranteed: that gates are moments of one
//! beat; a fit tells ([`crate::heart::beat`]), and a warning says what was taken for what.

use super::super::limits::FromProjections;
use super::one_scan::{Reach, ScanStatement, contradiction};
use super::{Content, DicomFile, ScannedFile, StoredSlice, VolumeError, timing};
use crate::base::progress::Monitor;
use crate::image::grid::gates::{GATE_COUNTS, SAME_PLACE_MM};

use crate::image::volume::gate_timing::GateTiming;
use crate::image::volume::limits::ReadLimits;
use crate::image::volume::source::VolumeFile;
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::mem;
use ventriform_dicom::read::attributes::{
    ACQUISITION_NUMBER, Attribute, Attributes, INSTANCE_NUMBER, RR_INTERVALS, SERIES_NUMBER,
    TEMPORAL_POSITION, TIME_SLOTS, TRIGGER_TIME,
};
use ventriform_dicom::read::kind::Kind;

/// Numbers by which gates are ordered, the surest first.
const ORDERING_ATTRIBUTES: [Attribute; 5] = [
    TRIGGER_TIME,
    TEMPORAL_POSITION,
    INSTANCE_NUMBER,
    ACQUISITION_NUMBER,
    SERIES_NUMBER,
];

/// What the header of a gate says of its place among the others.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Place {
    numbers: [Option<f64>; ORDERING_ATTRIBUTES.len()],
    /// The gates that the study has, if the header of one of several says so.
    of: usize,
}

impl Place {
    pub(super) fn from_attributes(a: &Attributes) -> Self {
        let number = |attribute| {
            let stated = a.decimals::<1>(attribute).ok().flatten();
            stated.map(|[number]| number)
        };
        let first = |attribute| a.shorts(attribute).first().map_or(1, |n| usize::from(*n));
        Self {
            numbers: ORDERING_ATTRIBUTES.map(number),
            of: first(TIME_SLOTS) * first(RR_INTERVALS),
        }
    }

    /// Whether nothing but the series tells it from `other`.
    fn is_that_of(&self, other: &Self) -> bool {
        let pairs = self
            .numbers
            .iter()
            .zip(&other.numbers)
            .zip(ORDERING_ATTRIBUTES);
        let same = |((own, other), attribute): ((&Option<f64>, &Option<f64>), Attribute)| {
            own == other || attribute.name == SERIES_NUMBER.name
        };
        self.numbers.iter().any(Option::is_some) && { pairs }.all(same)
    }
}

/// What files of a volume each are together.
pub(super) enum Joined {
    /// Gates of one beat.
    Gates(Box<DicomFile>),
    /// They say that they are gates, and are none of one beat for this reason.
    Contradiction(String),
    /// Volumes of their own.
    No,
}

/// The order of gates, as indices, and the name of the number that orders them; `None` if none does.
fn order_of(places: &[Place]) -> Option<(Vec<usize>, &'static str)> {
    for (at, attribute) in ORDERING_ATTRIBUTES.iter().enumerate() {
        let numbers = places.iter().map(|place| place.numbers[at]);
        let Some(numbers) = numbers.collect::<Option<Vec<f64>>>() else {
            continue;
        };
        let mut order: Vec<usize> = (0..places.len()).collect();
        order.sort_by(|&a, &b| numbers[a].total_cmp(&numbers[b]));
        let rises = |two: &[usize]| numbers[two[0]] < numbers[two[1]];
        if order.windows(2).all(rises) {
            return Some((order, attribute.name));
        }
        // Some moments twice are those of two beats.
        let moments = attribute.name == TRIGGER_TIME.name;
        if moments && order.windows(2).any(rises) {
            return None;
        }
    }
    None
}

/// The gates in `files`, of which each is one volume.
///
/// # Errors
/// [`VolumeError`] if one of them cannot be read.
pub(super) fn open(
    files: &[&VolumeFile],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Joined, VolumeError> {
    if files.len() < *GATE_COUNTS.start() {
        return Ok(Joined::No);
    }
    let (mut places, mut gates, mut said) = (Vec::new(), Vec::new(), Vec::new());
    for file in files {
        monitor.check()?;
        let scanned = ScannedFile::open(file, limits, monitor)?;
        let (kind, a) = (scanned.scan.kind, &scanned.scan.attributes);
        let whole =
            matches!(kind, Kind::Nuclear { .. } | Kind::Enhanced) && !scanned.is_one_slice();
        if !whole || !timing::is_one_gate(a, kind) {
            return Ok(Joined::No);
        }
        places.push(Place::from_attributes(a));
        said.push(ScanStatement::from_attributes(a));
        let gate = DicomFile::of_scan(file, scanned, &FromProjections::default(), limits)?;
        if gate.volumes != 1 {
            return Ok(Joined::No);
        }
        gates.push(gate);
    }
    joined(gates, places, said, "files")
}

/// Whether so many volumes, whose places are these, are the gates that they say they are parts of.
fn are_all(places: &[Place]) -> bool {
    let said = places.iter().map(|place| place.of);
    { said }.all(|of| of <= 1 || of == places.len())
}

/// All `gates`, which say that they are gates, as one file, without those that are there twice. `what` holds one gate
/// each.
///
/// # Errors
/// [`VolumeError`] if the pixels of a gate that may be there twice cannot be read.
pub(super) fn joined(
    mut gates: Vec<DicomFile>,
    mut places: Vec<Place>,
    mut said: Vec<ScanStatement>,
    what: &str,
) -> Result<Joined, VolumeError> {
    let statements: Vec<&ScanStatement> = said.iter().collect();
    if let Some(reason) = contradiction(&statements, Reach::Gates) {
        return Ok(Joined::Contradiction(format!(
            "they say that they are gates, but not of one scan: {reason}"
        )));
    }
    if !on_one_grid(&gates) {
        return Ok(Joined::No);
    }
    let repeats = match repeats(&gates, &places)? {
        Ok(repeats) => repeats,
        Err(reason) => return Ok(Joined::Contradiction(reason)),
    };
    for &(at, _) in repeats.iter().rev() {
        gates.remove(at);
        places.remove(at);
        said.remove(at);
    }
    if !GATE_COUNTS.contains(&gates.len()) || !are_all(&places) {
        return Ok(Joined::No);
    }
    let Some((order, name)) = order_of(&places) else {
        return Ok(Joined::No);
    };
    let mut file = in_order(gates, &order, name, what);
    let told = repeats.into_iter().map(|(_, told)| told);
    file.warnings.extend(told);
    Ok(Joined::Gates(Box::new(file)))
}

/// The gates that repeat an earlier one, in their order, and what is said of them; or why one of them can be none. A
/// gate repeats another if both have one SOP Instance UID, or the same place among the gates, and the same pixels.
fn repeats(
    gates: &[DicomFile],
    places: &[Place],
) -> Result<Result<Vec<(usize, String)>, String>, VolumeError> {
    let mut repeats = Vec::new();
    for at in 1..gates.len() {
        let gate = &gates[at];
        let uid = gate.provenance.sop_instance_uid.as_ref();
        for earlier in 0..at {
            let other = &gates[earlier];
            let one_uid = uid.is_some() && uid == other.provenance.sop_instance_uid.as_ref();
            if !(one_uid || places[at].is_that_of(&places[earlier])) {
                continue;
            }
            let [own, first] = [gate.parts[0].name(), other.parts[0].name()];
            if same_pixels(gate, other)? {
                let told = format!("{own} repeats the gate in {first} and was left out.");
                repeats.push((at, told));
                break;
            }
            if one_uid {
                return Ok(Err(format!(
                    "{first} and {own} have the same SOP Instance UID (0008,0018) and are different images; an export \
                     that gives each image its own is needed"
                )));
            }
        }
    }
    Ok(Ok(repeats))
}

/// Whether two gates have the same pixels at the same places.
fn same_pixels(a: &DicomFile, b: &DicomFile) -> Result<bool, VolumeError> {
    let hash = |gate: &DicomFile| {
        let mut hasher = DefaultHasher::new();
        let mut take = |first: usize, voxels: &[f32]| {
            for (offset, value) in voxels.iter().enumerate() {
                (first + offset, value.to_bits()).hash(&mut hasher);
            }
        };
        gate.stream(Some(0), &mut take, &Monitor::silent())?;
        Ok::<u64, VolumeError>(hasher.finish())
    };
    Ok(hash(a)? == hash(b)?)
}

fn on_one_grid(gates: &[DicomFile]) -> bool {
    gates.iter().all(|gate| {
        let (own, first) = (&gate.placement.frame, &gates[0].placement.frame);
        gate.shape == gates[0].shape && first.greatest_distance(own, gate.shape) <= SAME_PLACE_MM
    })
}

/// All `gates` as one file, in this order, which the attribute called `name` gives.
fn in_order(gates: Vec<DicomFile>, order: &[usize], name: &str, what: &str) -> DicomFile {
    let mut gates: Vec<Option<DicomFile>> = gates.into_iter().map(Some).collect();
    let in_order = order.iter().filter_map(|&at| gates[at].take());
    let mut gates: Vec<DicomFile> = in_order.collect();
    let mut warnings: Vec<String> = Vec::new();
    let (mut parts, mut stored, mut instances) = (Vec::new(), Vec::new(), Vec::new());
    for (volume, gate) in gates.iter_mut().enumerate() {
        for warning in mem::take(&mut gate.warnings) {
            if !warnings.contains(&warning) {
                warnings.push(warning);
            }
        }
        if let Content::Slices(slices) = &gate.content {
            let before = parts.len();
            let of_gate = |slice: &StoredSlice| StoredSlice {
                part: before + slice.part,
                volume,
                ..*slice
            };
            stored.extend(slices.iter().map(of_gate));
        }
        parts.append(&mut gate.parts);
        instances.append(&mut gate.instances);
    }
    warnings.push(format!(
        "{} {what} of one volume each were taken for the gates of one heart beat, in the order of their {name}.",
        gates.len()
    ));
    let gate_scans = gates.iter().map(|gate| gate.provenance.clone()).collect();
    let volumes = gates.len();
    let first = gates.swap_remove(0);
    let timing = first.timings.first().cloned().unwrap_or_default();
    DicomFile {
        name: format!("the {what} of gates"),
        content: Content::Slices(stored),
        volumes,
        gated: true,
        // What one file says of its gates is about itself.
        timings: vec![GateTiming {
            gates_per_interval: None,
            ..timing
        }],
        parts,
        instances,
        gate_scans,
        warnings,
        ..first
    }
}
