//! A gated study in DICOM files of one gate each.
//!
//! In: 6 to 32 Nuclear Medicine or Enhanced images of one study. Out: what one image with all gates would be.
//!
//! They are gates if each holds one volume, all lie on one grid, all belong to one series or say each that they are a gate
//! ([`timing::is_one_gate`]), and a number in their headers orders them: of [`ORDERING_ATTRIBUTES`] the first that all have and no
//! two share. Otherwise they are volumes of their own, which only a person can call gates.
//!
//! Guaranteed: the order in which the files are given does not matter. Not guaranteed: that the volumes of one series are moments of
//! one beat; a fit tells ([`crate::beat`]), and a warning says what was taken for what.

use super::attributes::{
    ACQUISITION_NUMBER, Attribute, Attributes, INSTANCE_NUMBER, SERIES_NUMBER, SERIES_UID,
    STUDY_UID, TEMPORAL_POSITION, TRIGGER_TIME,
};
use super::kind::Kind;
use super::{Content, DicomFile, ScannedFile, StoredSlice, VolumeError, timing};
use crate::grid::gates::{GATE_COUNTS, SAME_PLACE_MM};
use crate::progress::Monitor;
use crate::volume::gate_timing::GateTiming;
use crate::volume::limits::ReadLimits;
use crate::volume::source::VolumeFile;
use std::mem;

/// Numbers by which gates are ordered, the surest first.
const ORDERING_ATTRIBUTES: [Attribute; 5] = [
    TRIGGER_TIME,
    TEMPORAL_POSITION,
    INSTANCE_NUMBER,
    ACQUISITION_NUMBER,
    SERIES_NUMBER,
];

/// What the header of one file says of its place among the others.
struct Place {
    study: Option<String>,
    series: Option<String>,
    is_one_gate: bool,
    numbers: [Option<f64>; ORDERING_ATTRIBUTES.len()],
}

impl Place {
    fn of(a: &Attributes, kind: Kind) -> Self {
        let number = |attribute| {
            let stated = a.decimals::<1>(attribute).ok().flatten();
            stated.map(|[number]| number)
        };
        Self {
            study: a.text(STUDY_UID),
            series: a.text(SERIES_UID),
            is_one_gate: timing::is_one_gate(a, kind),
            numbers: ORDERING_ATTRIBUTES.map(number),
        }
    }
}

/// Whether the files belong together: one study, and one series or gates by their own words.
fn belong_together(places: &[Place]) -> bool {
    let same = |of: fn(&Place) -> &Option<String>| {
        let first = places.first().and_then(|place| of(place).as_ref());
        first.is_some() && places.iter().all(|place| of(place).as_ref() == first)
    };
    same(|place| &place.study)
        && (same(|place| &place.series) || places.iter().all(|place| place.is_one_gate))
}

/// The order of the files, as indices, and the name of the number that orders them.
fn order_of(places: &[Place]) -> Option<(Vec<usize>, &'static str)> {
    let by = |(at, attribute): (usize, &Attribute)| {
        let numbers = places.iter().map(|place| place.numbers[at]);
        let numbers: Vec<f64> = numbers.collect::<Option<_>>()?;
        let mut order: Vec<usize> = (0..places.len()).collect();
        order.sort_by(|&a, &b| numbers[a].total_cmp(&numbers[b]));
        let distinct = (order.windows(2)).all(|two| numbers[two[0]] < numbers[two[1]]);
        distinct.then_some((order, attribute.name))
    };
    ORDERING_ATTRIBUTES.iter().enumerate().find_map(by)
}

/// The gates in `files`; `None` if they are not one gate each.
///
/// # Errors
/// [`VolumeError`] if one of them cannot be read.
pub(super) fn open(
    files: &[&VolumeFile],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Option<DicomFile>, VolumeError> {
    if !GATE_COUNTS.contains(&files.len()) {
        return Ok(None);
    }
    let (mut places, mut gates) = (Vec::new(), Vec::new());
    for file in files {
        monitor.check()?;
        let scanned = ScannedFile::open(file, limits, monitor)?;
        let kind = scanned.scan.kind;
        if !matches!(kind, Kind::Nuclear { .. } | Kind::Enhanced) || scanned.is_one_slice() {
            return Ok(None);
        }
        places.push(Place::of(&scanned.scan.attributes, kind));
        let gate = DicomFile::of_scan(file, scanned, limits)?;
        if gate.volumes != 1 {
            return Ok(None);
        }
        gates.push(gate);
    }
    if !belong_together(&places) || !on_one_grid(&gates) {
        return Ok(None);
    }
    Ok(order_of(&places).map(|(order, name)| joined(gates, &order, name)))
}

fn on_one_grid(gates: &[DicomFile]) -> bool {
    gates.iter().all(|gate| {
        let (own, first) = (&gate.placement.frame, &gates[0].placement.frame);
        gate.shape == gates[0].shape && first.greatest_distance(own, gate.shape) <= SAME_PLACE_MM
    })
}

/// All `gates` as one file, in this order, which the attribute called `name` gives.
fn joined(gates: Vec<DicomFile>, order: &[usize], name: &str) -> DicomFile {
    let mut gates: Vec<Option<DicomFile>> = gates.into_iter().map(Some).collect();
    let in_order = order.iter().filter_map(|&at| gates[at].take());
    let mut gates: Vec<DicomFile> = in_order.collect();
    let mut warnings: Vec<String> = Vec::new();
    let (mut parts, mut stored) = (Vec::new(), Vec::new());
    for (volume, gate) in gates.iter_mut().enumerate() {
        for warning in mem::take(&mut gate.warnings) {
            if !warnings.contains(&warning) {
                warnings.push(warning);
            }
        }
        if let Content::Slices(slices) = &gate.content {
            let of_gate = |slice: &StoredSlice| StoredSlice {
                part: volume,
                volume,
                ..*slice
            };
            stored.extend(slices.iter().map(of_gate));
        }
        parts.append(&mut gate.parts);
    }
    warnings.push(format!(
        "{} files of one volume each were taken for the gates of one heart beat, in the order of their {name}.",
        gates.len()
    ));
    let gate_scans = gates.iter().map(|gate| gate.provenance.clone()).collect();
    let volumes = gates.len();
    let first = gates.swap_remove(0);
    let timing = first.timings.first().cloned().unwrap_or_default();
    DicomFile {
        name: "the files of gates".into(),
        content: Content::Slices(stored),
        volumes,
        gated: true,
        // What one file says of its gates is about itself.
        timings: vec![GateTiming {
            gates_per_interval: None,
            ..timing
        }],
        parts,
        gate_scans,
        warnings,
        ..first
    }
}
