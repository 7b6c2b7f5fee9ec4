//! The common parts of structured reports of measurements: Comprehensive 3D SR Storage (PS3.3 A.35.13), template TID
//! 1500 of PS3.16.
//!
//! In: whose scan it is, and the measurement groups. Out: the content tree with language, observer, procedure and the
//! source images, and the evidence. What is measured stands in the rows of [`crate::results::figures`].

use super::{SourceScan, Structure};
use crate::base::numeric::decimals::round;
use crate::results::figures::code::OWN_SCHEME;
use crate::results::figures::{Coded, Figure, Group};
use serde_json::Value;
use ventriform_dicom::tags;
use ventriform_dicom::write::code::{Code, dcm, sct};
use ventriform_dicom::write::content::{concept, container, image, number, template, text, unique};
use ventriform_dicom::write::data_set::{DataSet, reference};

/// The comment of a group with intervals: no code says how sure a range is.
pub(super) const RANGES_COMMENT: &str =
    "Ranges of measurement uncertainty hold the true value of nine of ten hearts.";

/// The distance that the true value may lie below a figure, and above it (CID 225).
const RANGE_BELOW: Code = sct("371885007", "-, range of lower measurement uncertainty");
const RANGE_ABOVE: Code = sct("371886008", "+, range of upper measurement uncertainty");

const MEAN_VALUE: Code = sct("373098007", "Mean");

/// The 17 segments of the left ventricle in their order (CID 3717).
pub(super) const WALL_SEGMENTS: [Code; 17] = [
    sct("264850008", "left ventricle basal anterior segment"),
    sct("396482007", "left ventricle basal anteroseptal segment"),
    sct("396646008", "left ventricle basal inferoseptal segment"),
    sct("264846001", "left ventricle basal inferior segment"),
    sct("396652009", "left ventricle basal inferolateral segment"),
    sct("396654005", "left ventricle basal anterolateral segment"),
    sct("264848000", "left ventricle mid anterior segment"),
    sct("396647004", "left ventricle mid anteroseptal segment"),
    sct("396649001", "left ventricle mid inferoseptal segment"),
    sct("264847005", "left ventricle mid inferior segment"),
    sct("396655006", "left ventricle mid inferolateral segment"),
    sct("396656007", "left ventricle mid anterolateral segment"),
    sct("264844003", "left ventricle apical anterior segment"),
    sct("264845002", "left ventricle apical septal segment"),
    sct("264849008", "left ventricle apical inferior segment"),
    sct("264853005", "left ventricle apical lateral segment"),
    sct("128564006", "Apex of left ventricle"),
];

/// A series that a report refers to beside the images of its scan.
pub(super) struct SeriesReference {
    /// Series Instance UID.
    pub series: String,
    /// SOP Class UID.
    pub class: &'static str,
    /// SOP Instance UID.
    pub instance: String,
}

/// What a reader adds to a report.
pub(super) struct Signature {
    /// Measurement groups.
    pub groups: Vec<DataSet>,
    /// The item of the Verifying Observer Sequence.
    pub observer: DataSet,
    /// The container of qualitative evaluations.
    pub evaluations: Option<DataSet>,
}

/// Puts everything that is particular to a report on `scans` with these measurement groups, and what a reader adds. The
/// report and `others` belong to the study of the first.
pub(super) fn put(
    scans: &[&SourceScan],
    structure: Structure,
    mut groups: Vec<DataSet>,
    others: &[SeriesReference],
    signature: Option<Signature>,
    set: &mut DataSet,
) {
    scans[0].put_made(set);
    set.items(
        tags::REFERENCED_PERFORMED_PROCEDURE_STEP_SEQUENCE,
        Vec::new(),
    );
    set.items(tags::PERFORMED_PROCEDURE_CODE_SEQUENCE, Vec::new());
    set.text(tags::PRELIMINARY_FLAG, "PRELIMINARY");
    set.text(tags::COMPLETION_FLAG, "COMPLETE");
    set.text(tags::VERIFICATION_FLAG, "UNVERIFIED");
    let evaluations = signature.and_then(|signature| {
        set.text(tags::PRELIMINARY_FLAG, "FINAL");
        set.text(tags::VERIFICATION_FLAG, "VERIFIED");
        set.item(tags::VERIFYING_OBSERVER_SEQUENCE, signature.observer);
        groups.extend(signature.groups);
        signature.evaluations
    });
    let mut own = Vec::new();
    let mut of_other_studies = Vec::new();
    for (study, evidence) in evidence(scans, others) {
        if study == scans[0].study() {
            own.push(evidence);
        } else {
            of_other_studies.push(evidence);
        }
    }
    if !own.is_empty() {
        set.items(tags::CURRENT_REQUESTED_PROCEDURE_EVIDENCE_SEQUENCE, own);
    }
    if !of_other_studies.is_empty() {
        set.items(tags::PERTINENT_OTHER_EVIDENCE_SEQUENCE, of_other_studies);
    }
    let mut scheme = DataSet::new();
    scheme.text(tags::CODING_SCHEME_DESIGNATOR, OWN_SCHEME);
    scheme.text(tags::CODING_SCHEME_NAME, "Concepts of ventriform");
    scheme.text(tags::CODING_SCHEME_RESPONSIBLE_ORGANIZATION, "ventriform");
    set.item(tags::CODING_SCHEME_IDENTIFICATION_SEQUENCE, scheme);

    set.text(tags::VALUE_TYPE, "CONTAINER");
    set.code(
        tags::CONCEPT_NAME_CODE_SEQUENCE,
        dcm("126000", "Imaging Measurement Report"),
    );
    set.text(tags::CONTINUITY_OF_CONTENT, "SEPARATE");
    set.item(tags::CONTENT_TEMPLATE_SEQUENCE, template("1500"));
    let mut content = context(structure);
    content.extend(image_library(scans));
    content.push(container(dcm("126010", "Imaging Measurements"), groups));
    content.extend(evaluations);
    set.items(tags::CONTENT_SEQUENCE, content);
}

/// Language, observer and procedure.
fn context(structure: Structure) -> Vec<DataSet> {
    const OBSERVER_RELATION: &str = "HAS OBS CONTEXT";
    let english = Code {
        value: "en",
        scheme: "RFC5646",
        meaning: "English",
    };
    let language = dcm("121049", "Language of Content Item and Descendants");
    let study = sct("252432008", "Radionuclide myocardial perfusion study");
    let imaging = sct("363679005", "Imaging procedure");
    let procedure = match structure.body_part {
        "HEART" => study,
        _ => imaging,
    };
    // The device is the software: one UID for each version.
    let device =
        ventriform_dicom::write::uid::derived(&[b"device", env!("CARGO_PKG_VERSION").as_bytes()]);
    vec![
        concept("HAS CONCEPT MOD", language, english),
        concept(
            OBSERVER_RELATION,
            dcm("121005", "Observer Type"),
            dcm("121007", "Device"),
        ),
        unique(
            OBSERVER_RELATION,
            dcm("121012", "Device Observer UID"),
            &device,
        ),
        text(
            OBSERVER_RELATION,
            dcm("121013", "Device Observer Name"),
            "ventriform",
        ),
        concept(
            "HAS CONCEPT MOD",
            dcm("121058", "Procedure reported"),
            procedure,
        ),
    ]
}

/// The source images, as TID 1600 lists them; nothing without DICOM images.
fn image_library(scans: &[&SourceScan]) -> Option<DataSet> {
    let all: Vec<DataSet> = (series_of(scans).into_iter())
        .flat_map(|(_, _, instances)| instances)
        .map(|(class, uid)| image("CONTAINS", None, reference(class, uid)))
        .collect();
    if all.is_empty() {
        return None;
    }
    let group = container(dcm("126200", "Image Library Group"), all);
    Some(container(dcm("111028", "Image Library"), vec![group]))
}

/// A series of a study, with class and UID of its instances.
type SourceSeries<'a> = (&'a str, &'a str, Vec<(&'a str, &'a str)>);

/// The series of the scans' images, each once, with its study and its instances, each once.
fn series_of<'a>(scans: &[&'a SourceScan]) -> Vec<SourceSeries<'a>> {
    let mut all: Vec<SourceSeries<'_>> = Vec::new();
    for scan in scans {
        let Some(images) = scan.images() else {
            continue;
        };
        let at = all
            .iter()
            .position(|(_, series, _)| *series == images.series);
        let at = at.unwrap_or_else(|| {
            all.push((scan.study(), images.series, Vec::new()));
            all.len() - 1
        });
        let known = &mut all[at].2;
        for instance in images.instances() {
            if !known.contains(&instance) {
                known.push(instance);
            }
        }
    }
    all
}

/// Of the `rows` that stand in such a measurement group those that `report` has, as NUM items.
pub(super) fn measured(report: &Value, rows: &[Figure], group: Group) -> Vec<DataSet> {
    rows.iter()
        .filter_map(|row| {
            let coded = row.coded.filter(|coded| coded.group == group)?;
            measurement(report, row, coded)
        })
        .collect()
}

/// What may be said of the figures of `rows` in that group, in one comment; none where nothing is said of any.
pub(super) fn verdicts(report: &Value, rows: &[Figure], group: Group) -> Option<DataSet> {
    let said: Vec<String> = (rows.iter())
        .filter(|row| row.coded.is_some_and(|coded| coded.group == group))
        .filter_map(|row| Some(format!("{}: {}", row.label, row.verdict(report)?)))
        .collect();
    (!said.is_empty()).then(|| {
        let said = format!("Beyond what noise explains: {}", said.join("; "));
        text("CONTAINS", dcm("121106", "Comment"), &said)
    })
}

fn measurement(report: &Value, row: &Figure, coded: Coded) -> Option<DataSet> {
    let value = row.value(report).filter(|value| value.is_finite())?;
    let unit = row.unit.code;
    let mut item = number("CONTAINS", coded.concept, value, unit);
    let derived = dcm("121401", "Derivation");
    let derivation = (coded.is_mean).then(|| concept("HAS CONCEPT MOD", derived, MEAN_VALUE));
    let ends = row.interval(report).into_iter().flat_map(|[low, high]| {
        let ends = [(RANGE_BELOW, value - low), (RANGE_ABOVE, high - value)];
        ends.map(|(name, range)| number("HAS PROPERTIES", name, round(range), unit))
    });
    let properties: Vec<DataSet> = derivation.into_iter().chain(ends).collect();
    if !properties.is_empty() {
        item.items(tags::CONTENT_SEQUENCE, properties);
    }
    Some(item)
}

/// Every study with the instances in it that the content refers to; none if it refers to none.
fn evidence<'a>(scans: &[&'a SourceScan], others: &[SeriesReference]) -> Vec<(&'a str, DataSet)> {
    let mut studies: Vec<(&str, Vec<DataSet>)> = Vec::new();
    let mut add = |study: &'a str, series: &str, instances: Vec<DataSet>| {
        let mut item = DataSet::new();
        item.items(tags::REFERENCED_SOP_SEQUENCE, instances);
        item.text(tags::SERIES_INSTANCE_UID, series);
        match studies.iter_mut().find(|(known, _)| *known == study) {
            Some((_, all)) => all.push(item),
            None => studies.push((study, vec![item])),
        }
    };
    for (study, series, instances) in series_of(scans) {
        let instances = instances.into_iter();
        let references = instances.map(|(class, uid)| reference(class, uid));
        add(study, series, references.collect());
    }
    for other in others {
        let instance = reference(other.class, &other.instance);
        add(scans[0].study(), &other.series, vec![instance]);
    }
    let studies = studies.into_iter().map(|(study, series)| {
        let mut item = DataSet::new();
        item.items(tags::REFERENCED_SERIES_SEQUENCE, series);
        item.text(tags::STUDY_INSTANCE_UID, study);
        (study, item)
    });
    studies.collect()
}
