//! The figures of a report as Comprehensive 3D SR Storage (PS3.3 A.35.13), template TID 1500 of
//! PS3.16.
//!
//! One measurement group holds what was measured of the whole structure ([`STRUCTURE_FIGURES`]). It is a
//! group of TID 1411 that refers to the segment of `mask.dcm`, or of TID 1501 where the source is no
//! DICOM image that the template could name. For a ventricle the cavity, and the apparent and the anatomical
//! wall and cavity have a group of TID 1501 each ([`WALL_FIGURES`]), and so has each of the 17 segments of the heart
//! association ([`WALL_SEGMENTS`]): readers of the template look at the group for where and how a figure was
//! measured, not at the figure. A figure that the report lacks is left out.

use super::codes::{CAVITY, Code, MILLIMETRE, OWN_SCHEME, dcm, own, sct, ucum};
use super::data_set::{DataSet, reference};
use super::{DicomObject, DicomResults};
use crate::polar::PolarSegment;
use crate::report::SegmentationReport;
use dicom_core::Tag;
use dicom_dictionary_std::{tags, uids};

/// A figure of a report, or of an entry `T` of one, and how it is coded.
struct Figure<T = SegmentationReport> {
    /// The figure; `None` or not finite where there is none.
    value: fn(&T) -> Option<f64>,
    concept: Code,
    unit: Code,
    /// Derivation from the single values.
    derivation: Option<Code>,
}

const VOLUME: Code = sct("118565006", "Volume");
const MASS: Code = sct("118538004", "Mass");
const THICKNESS: Code = dcm("122445", "Wall Thickness");
const DEFECT: Code = sct(
    "427751006",
    "Extent of cardiac perfusion defect (observable entity)",
);
const PERFUSION: Code = sct("251053005", "Myocardial perfusion (observable entity)");
const MEAN: Code = sct("373098007", "Mean");

const MILLILITRE: Code = ucum("ml", "milliliter");
const GRAM: Code = ucum("g", "gram");
const PERCENT: Code = ucum("%", "Percent");
const RATIO: Code = ucum("1", "no units");

const fn figure<T>(value: fn(&T) -> Option<f64>, concept: Code, unit: Code) -> Figure<T> {
    Figure {
        value,
        concept,
        unit,
        derivation: None,
    }
}

const fn mean<T>(value: fn(&T) -> Option<f64>, concept: Code, unit: Code) -> Figure<T> {
    Figure {
        value,
        concept,
        unit,
        derivation: Some(MEAN),
    }
}

/// Measurements of the whole structure. A new figure of the report is a new line here.
const STRUCTURE_FIGURES: &[Figure] = &[
    figure(|r| Some(r.volumes_ml.wall), VOLUME, MILLILITRE),
    figure(|r| r.mass_g, MASS, GRAM),
    mean(|r| r.wall_thickness_mm, THICKNESS, MILLIMETRE),
    figure(|r| Some(r.polar.as_ref()?.extent_percent), DEFECT, PERCENT),
    figure(
        |r| Some(r.measures?.jaccard),
        own("JACCARD", "Jaccard index with the expert's mask"),
        RATIO,
    ),
    figure(
        |r| Some(r.measures?.dice),
        own("DICE", "Dice index with the expert's mask"),
        RATIO,
    ),
    figure(
        |r| r.measures?.contour_distance_mm,
        own("CONTOUR-MM", "Mean contour distance to the expert's mask"),
        MILLIMETRE,
    ),
    figure(
        |r| r.measures?.hausdorff_mm,
        own("HAUSDORFF-MM", "Hausdorff distance to the expert's mask"),
        MILLIMETRE,
    ),
];

/// A part of a ventricle that has volumes of its own, and what is measured of it.
struct Part {
    /// Its name, after the name of the structure.
    name: &'static str,
    /// Method of measurement, if there are several.
    method: Option<Code>,
    /// Where it was measured, if not in the whole structure.
    site: Option<Code>,
    figures: &'static [Figure],
}

const APPARENT: Code = own("APPARENT", "With the blur of the image");
const ANATOMICAL: Code = own("ANATOMICAL", "Without the blur of the image");

const WALL_FIGURES: [Part; 5] = [
    Part {
        name: "cavity",
        method: None,
        site: Some(CAVITY),
        figures: &[figure(|r| r.volumes_ml.cavity, VOLUME, MILLILITRE)],
    },
    Part {
        name: "apparent wall",
        method: Some(APPARENT),
        site: None,
        figures: &[
            figure(|r| Some(r.volumes_ml.apparent?.wall), VOLUME, MILLILITRE),
            mean(
                |r| Some(r.thickness_mm?.apparent.mean),
                THICKNESS,
                MILLIMETRE,
            ),
        ],
    },
    Part {
        name: "apparent cavity",
        method: Some(APPARENT),
        site: Some(CAVITY),
        figures: &[figure(
            |r| Some(r.volumes_ml.apparent?.cavity),
            VOLUME,
            MILLILITRE,
        )],
    },
    Part {
        name: "anatomical wall",
        method: Some(ANATOMICAL),
        site: None,
        figures: &[
            figure(|r| Some(r.volumes_ml.anatomical?.wall), VOLUME, MILLILITRE),
            mean(
                |r| Some(r.thickness_mm?.anatomical.mean),
                THICKNESS,
                MILLIMETRE,
            ),
        ],
    },
    Part {
        name: "anatomical cavity",
        method: Some(ANATOMICAL),
        site: Some(CAVITY),
        figures: &[figure(
            |r| Some(r.volumes_ml.anatomical?.cavity),
            VOLUME,
            MILLILITRE,
        )],
    },
];

/// The 17 segments of the left ventricle in their order (CID 3717).
const WALL_SEGMENTS: [Code; 17] = [
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

/// Measurements of each of them.
const SEGMENT_FIGURES: &[Figure<PolarSegment>] = &[
    mean(|s| s.mean_percent, PERFUSION, PERCENT),
    figure(|s| Some(s.extent_percent), DEFECT, PERCENT),
];

/// Puts everything that is particular to this object.
pub(super) fn put(results: &DicomResults<'_>, set: &mut DataSet) {
    results.put_made(set);
    set.items(
        tags::REFERENCED_PERFORMED_PROCEDURE_STEP_SEQUENCE,
        Vec::new(),
    );
    set.items(tags::PERFORMED_PROCEDURE_CODE_SEQUENCE, Vec::new());
    set.text(tags::PRELIMINARY_FLAG, "PRELIMINARY");
    set.text(tags::COMPLETION_FLAG, "COMPLETE");
    set.text(tags::VERIFICATION_FLAG, "UNVERIFIED");
    set.item(
        tags::CURRENT_REQUESTED_PROCEDURE_EVIDENCE_SEQUENCE,
        evidence(results),
    );
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
    let mut content = context(results);
    content.extend(image_library(results));
    content.push(container(
        dcm("126010", "Imaging Measurements"),
        groups(results),
    ));
    set.items(tags::CONTENT_SEQUENCE, content);
}

/// Language, observer and procedure.
fn context(results: &DicomResults<'_>) -> Vec<DataSet> {
    const OBSERVER_RELATION: &str = "HAS OBS CONTEXT";
    let english = Code {
        value: "en",
        scheme: "RFC5646",
        meaning: "English",
    };
    let language = dcm("121049", "Language of Content Item and Descendants");
    let study = sct("252432008", "Radionuclide myocardial perfusion study");
    let imaging = sct("363679005", "Imaging procedure");
    let procedure = match results.structure.body_part {
        "HEART" => study,
        _ => imaging,
    };
    // The device is the software: one UID for each version.
    let device = super::uid::derived(&[b"device", env!("CARGO_PKG_VERSION").as_bytes()]);
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
fn image_library(results: &DicomResults<'_>) -> Option<DataSet> {
    let images = results.scan.images()?;
    let all = images.references().into_iter();
    let all = all.map(|reference| image("CONTAINS", None, reference));
    let group = container(dcm("126200", "Image Library Group"), all.collect());
    Some(container(dcm("111028", "Image Library"), vec![group]))
}

fn groups(results: &DicomResults<'_>) -> Vec<DataSet> {
    let mut groups = vec![whole(results)];
    groups.extend(
        WALL_FIGURES
            .iter()
            .filter_map(|part| of_part(results, part)),
    );
    let polar = results.figures.and_then(|report| report.polar.as_ref());
    for segment in polar.iter().flat_map(|polar| &polar.segments) {
        let number = segment.number;
        let site = number.checked_sub(1).and_then(|at| WALL_SEGMENTS.get(at));
        let figures = measured(segment, SEGMENT_FIGURES);
        let (Some(site), false) = (site, figures.is_empty()) else {
            continue;
        };
        let name = format!("Segment {number}");
        let mut content = tracking(&name, &results.uids.uid(&name));
        content.push(concept(
            "CONTAINS",
            dcm("121071", "Finding"),
            results.structure.kind,
        ));
        content.push(finding_site(*site));
        content.extend(figures);
        groups.push(group("1501", content));
    }
    groups
}

/// The group of the whole structure.
fn whole(results: &DicomResults<'_>) -> DataSet {
    let structure = results.structure;
    let mut content = tracking(structure.label, &results.tracking());
    content.push(concept(
        "CONTAINS",
        dcm("121071", "Finding"),
        structure.kind,
    ));
    content.push(finding_site(structure.site));
    let images = results.scan.images();
    if let Some(images) = &images {
        content.push(image(
            "CONTAINS",
            Some(dcm("121191", "Referenced Segment")),
            segment_reference(results),
        ));
        for reference in images.references() {
            content.push(image(
                "CONTAINS",
                Some(dcm("121233", "Source image for segmentation")),
                reference,
            ));
        }
    }
    if let Some(report) = results.figures {
        content.extend(measured(report, STRUCTURE_FIGURES));
        let comment = dcm("121106", "Comment");
        let flags = report.flags.iter();
        content.extend(flags.map(|flag| text("CONTAINS", comment, &flag.reason)));
    }
    group(if images.is_some() { "1411" } else { "1501" }, content)
}

/// The group of one part; `None` where the report tells nothing of it.
fn of_part(results: &DicomResults<'_>, part: &Part) -> Option<DataSet> {
    let figures = measured(results.figures?, part.figures);
    if figures.is_empty() {
        return None;
    }
    let structure = results.structure;
    let name = format!("{}, {}", structure.label, part.name);
    let mut content = tracking(&name, &results.uids.uid(part.name));
    let finding = dcm("121071", "Finding");
    content.push(concept("CONTAINS", finding, structure.kind));
    let method = sct("370129005", "Measurement Method");
    content.extend(
        part.method
            .map(|code| concept("HAS CONCEPT MOD", method, code)),
    );
    content.push(finding_site(part.site.unwrap_or(structure.site)));
    content.extend(figures);
    Some(group("1501", content))
}

fn segment_reference(results: &DicomResults<'_>) -> DataSet {
    let instance = results.instance(DicomObject::Mask);
    let mut item = reference(uids::SEGMENTATION_STORAGE, &instance);
    item.short(tags::REFERENCED_SEGMENT_NUMBER, 1);
    item
}

/// Those of `figures` that `source` has, as NUM items.
fn measured<T>(source: &T, figures: &[Figure<T>]) -> Vec<DataSet> {
    let item = |figure: &Figure<T>| {
        let number = (figure.value)(source).filter(|number| number.is_finite())?;
        let mut value = DataSet::new();
        value.decimals(tags::NUMERIC_VALUE, &[number]);
        value.code(tags::MEASUREMENT_UNITS_CODE_SEQUENCE, figure.unit);
        let mut item = item("CONTAINS", "NUM", Some(figure.concept));
        item.item(tags::MEASURED_VALUE_SEQUENCE, value);
        if let Some(code) = figure.derivation {
            let derivation = dcm("121401", "Derivation");
            item.item(
                tags::CONTENT_SEQUENCE,
                concept("HAS CONCEPT MOD", derivation, code),
            );
        }
        Some(item)
    };
    figures.iter().filter_map(item).collect()
}

fn tracking(name: &str, uid: &str) -> Vec<DataSet> {
    const OBSERVATION_RELATION: &str = "HAS OBS CONTEXT";
    vec![
        text(
            OBSERVATION_RELATION,
            dcm("112039", "Tracking Identifier"),
            name,
        ),
        unique(
            OBSERVATION_RELATION,
            dcm("112040", "Tracking Unique Identifier"),
            uid,
        ),
    ]
}

fn finding_site(site: Code) -> DataSet {
    concept("HAS CONCEPT MOD", sct("363698007", "Finding Site"), site)
}

fn group(id: &str, content: Vec<DataSet>) -> DataSet {
    let mut group = container(dcm("125007", "Measurement Group"), content);
    group.item(tags::CONTENT_TEMPLATE_SEQUENCE, template(id));
    group
}

fn template(id: &str) -> DataSet {
    let mut item = DataSet::new();
    item.text(tags::MAPPING_RESOURCE, "DCMR");
    item.text(tags::TEMPLATE_IDENTIFIER, id);
    item
}

fn item(relationship: &str, kind: &str, name: Option<Code>) -> DataSet {
    let mut item = DataSet::new();
    item.text(tags::RELATIONSHIP_TYPE, relationship);
    item.text(tags::VALUE_TYPE, kind);
    if let Some(name) = name {
        item.code(tags::CONCEPT_NAME_CODE_SEQUENCE, name);
    }
    item
}

fn with_text(mut item: DataSet, tag: Tag, text: &str) -> DataSet {
    item.text(tag, text);
    item
}

fn container(name: Code, content: Vec<DataSet>) -> DataSet {
    let mut item = item("CONTAINS", "CONTAINER", Some(name));
    item.text(tags::CONTINUITY_OF_CONTENT, "SEPARATE");
    item.items(tags::CONTENT_SEQUENCE, content);
    item
}

fn concept(relationship: &str, name: Code, code: Code) -> DataSet {
    let mut item = item(relationship, "CODE", Some(name));
    item.code(tags::CONCEPT_CODE_SEQUENCE, code);
    item
}

fn text(relationship: &str, name: Code, text: &str) -> DataSet {
    with_text(
        item(relationship, "TEXT", Some(name)),
        tags::TEXT_VALUE,
        text,
    )
}

fn unique(relationship: &str, name: Code, uid: &str) -> DataSet {
    with_text(item(relationship, "UIDREF", Some(name)), tags::UID, uid)
}

fn image(relationship: &str, name: Option<Code>, referenced: DataSet) -> DataSet {
    let mut item = item(relationship, "IMAGE", name);
    item.item(tags::REFERENCED_SOP_SEQUENCE, referenced);
    item
}

/// The study with every instance that the content refers to.
fn evidence(results: &DicomResults<'_>) -> DataSet {
    let mut all = Vec::new();
    let mut add = |uid: &str, instances: Vec<DataSet>| {
        let mut series = DataSet::new();
        series.items(tags::REFERENCED_SOP_SEQUENCE, instances);
        series.text(tags::SERIES_INSTANCE_UID, uid);
        all.push(series);
    };
    if let Some(images) = results.scan.images() {
        add(images.series, images.references());
    }
    let mask = results.instance(DicomObject::Mask);
    add(
        &results.series(DicomObject::Mask),
        vec![reference(uids::SEGMENTATION_STORAGE, &mask)],
    );
    let mut study = DataSet::new();
    study.items(tags::REFERENCED_SERIES_SEQUENCE, all);
    study.text(tags::STUDY_INSTANCE_UID, results.scan.study());
    study
}
