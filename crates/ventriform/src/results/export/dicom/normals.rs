//! A scan beside normal limits, as measurement groups of a structured report
//! ([`structured_report`](super::structured_report)).
//!
//! Groups of TID 1501: one of the whole wall, which names the limits ([`limits_used`]), one of each artery's territory,
//! and one of each of the 17 segments (CID 3717). Their Measurement Method says that they stand beside limits: the
//! extent below a share of the scan's own maximum is another figure of the same concept. Where the protocol of scan and
//! limits is one at stress or at rest, the groups have that Patient State, and the summed score is that of stress or of
//! rest. Parts without limits or muscle have no group.

use super::Structure;
use super::structured_report::{WALL_SEGMENTS, measured};
use crate::heart::comparison::WhichScan;
use crate::heart::normals::{KIND_NOT_STATED, names_protocol, yes_or_no};
use crate::results::figures::code::own;
use crate::results::figures::perfusion::{
    FIGURES, REST_SCORE, SEGMENT_FIGURES, STRESS_SCORE, SUMMED_SCORE, TERRITORY_FIGURES,
};
use crate::results::figures::{Figure, Group, readable};
use crate::results::report::PerfusionReport;
use ventriform_dicom::write::code::{Code, dcm, sct};
use ventriform_dicom::write::content::{concept, finding_site, group, text, tracking};
use ventriform_dicom::write::data_set::DataSet;
use ventriform_dicom::write::uid::Uids;

const BESIDE_LIMITS: Code = own("NORMAL-LIMITS", "Comparison with normal limits");

/// The groups of a scan beside limits.
pub(super) fn groups(
    perfusion: &PerfusionReport,
    structure: Structure,
    uids: &Uids,
) -> Vec<DataSet> {
    let state = state_of(perfusion);
    let beginning = |name: String, site: Code| {
        let name = format!("{name}, beside normal limits");
        let mut content = tracking(&name, &uids.uid(&name));
        content.push(concept(
            "CONTAINS",
            dcm("121071", "Finding"),
            structure.kind,
        ));
        let method = sct("370129005", "Measurement Method");
        content.push(concept("HAS CONCEPT MOD", method, BESIDE_LIMITS));
        content.extend(state.map(patient_state));
        content.push(finding_site(site));
        content
    };
    let mut content = beginning(structure.label.to_owned(), structure.site);
    let rows = FIGURES.iter().map(|row| named_by_state(*row, state));
    let rows: Vec<Figure> = rows.collect();
    content.extend(measured(&readable(perfusion), &rows, Group::Whole));
    content.extend(limits_used(perfusion));
    let flags = perfusion.flags.iter();
    content.extend(flags.map(|flag| comment(&flag.reason)));
    let mut groups = vec![group("1501", content)];
    for territory in &perfusion.territories {
        let name = format!("Territory of {}", territory.name);
        let mut content = beginning(name, structure.site);
        let territory = readable(territory);
        content.extend(measured(&territory, TERRITORY_FIGURES, Group::Whole));
        groups.push(group("1501", content));
    }
    for segment in &perfusion.segments {
        let number = segment.segment;
        let site = number.checked_sub(1).and_then(|at| WALL_SEGMENTS.get(at));
        let figures = measured(&readable(segment), SEGMENT_FIGURES, Group::Whole);
        let (Some(site), false) = (site, figures.is_empty()) else {
            continue;
        };
        let mut content = beginning(format!("Segment {number}"), *site);
        content.extend(figures);
        groups.push(group("1501", content));
    }
    groups
}

/// A row of the wall: the summed score of a scan at stress or at rest has a code of its own.
fn named_by_state(mut row: Figure, state: Option<WhichScan>) -> Figure {
    if let Some(coded) = row
        .coded
        .as_mut()
        .filter(|coded| coded.concept == SUMMED_SCORE)
    {
        coded.concept = match state {
            Some(WhichScan::Stress) => STRESS_SCORE,
            Some(WhichScan::Rest) => REST_SCORE,
            None => SUMMED_SCORE,
        };
    }
    row
}

/// The limits that figures stand beside, as texts of a measurement group: the people they are of, the version of the
/// program that built them, their SHA-256, and a comment on the figures.
pub(super) fn limits_used(perfusion: &PerfusionReport) -> Vec<DataSet> {
    let used = &perfusion.normals;
    let group = format!(
        "sex {}, protocol {}, tracer {}, attenuation corrected {}, {} cases",
        used.sex.as_str(),
        used.protocol,
        used.tracer,
        yes_or_no(used.attenuation_corrected),
        used.cases
    );
    let says = |code, said: &str| text("CONTAINS", code, said);
    let program = format!("ventriform {}", used.program_version);
    vec![
        says(own("NORMALS-GROUP", "Group of the normal limits"), &group),
        says(
            own("NORMALS-PEOPLE", "People of the normal limits"),
            &used.people,
        ),
        says(
            own("NORMALS-PROGRAM", "Program that built the normal limits"),
            &program,
        ),
        says(
            own("NORMALS-SHA256", "SHA-256 of the normal limits"),
            &used.sha256,
        ),
        comment(&perfusion.note),
    ]
}

/// The state of the patient in a scan (CID 3207).
pub(super) fn patient_state(scan: WhichScan) -> DataSet {
    let state = match scan {
        WhichScan::Stress => sct("432655005", "Cardiac Stress State"),
        WhichScan::Rest => sct("128975004", "Resting State"),
    };
    concept("HAS CONCEPT MOD", dcm("109054", "Patient State"), state)
}

/// The scan that limits are for, if their protocol says so and was compared with that of the scan.
fn state_of(perfusion: &PerfusionReport) -> Option<WhichScan> {
    // The flag lists by name what is not known of the scan.
    let unknown = (perfusion.flags.iter())
        .any(|flag| flag.code == KIND_NOT_STATED && flag.reason.contains("protocol"));
    let named = |role| !unknown && names_protocol(&perfusion.normals.protocol, role);
    match (named("stress"), named("rest")) {
        (true, false) => Some(WhichScan::Stress),
        (false, true) => Some(WhichScan::Rest),
        _ => None,
    }
}

fn comment(said: &str) -> DataSet {
    text("CONTAINS", dcm("121106", "Comment"), said)
}
