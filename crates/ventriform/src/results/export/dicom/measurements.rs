//! The figures of a segmentation's report as measurement groups of a structured report
//! ([`structured_report`](super::structured_report)).
//!
//! The figures are those of [`crate::results::figures::segmentation`]. One measurement group holds what was measured of
//! the whole structure. It is a group of TID 1411 that refers to the segment of `mask.dcm`, or of TID 1501 where the source is no
//! DICOM image that the template could name. For a ventricle the cavity, and the apparent and the anatomical
//! wall and cavity have a group of TID 1501 each, and so has each of the 17 segments of the heart
//! association ([`WALL_SEGMENTS`]): readers of the template look at the group for where and how a figure was
//! measured, not at the figure. The volumes of the anatomical
//! wall and cavity have the ends of the interval that holds the true one. A scan beside normal limits has the groups of
//! [`normals`] too. A figure that the report lacks is left out.

use super::codes::LV_CAVITY;
use super::normals;
use super::structured_report::{
    self as report, RANGES_COMMENT, SeriesReference, WALL_SEGMENTS, measured,
};
use super::{DicomObject, DicomResults};
use crate::results::figures::code::own;
use crate::results::figures::segmentation::{FIGURES, SEGMENT_FIGURES};
use crate::results::figures::{Group, readable};
use serde_json::Value;
use ventriform_dicom::write::code::{Code, dcm, sct};
use ventriform_dicom::write::content::{concept, finding_site, group, image, text, tracking};
use ventriform_dicom::write::data_set::{DataSet, reference};
use ventriform_dicom::{tags, uids};

/// A part of a ventricle that has figures of its own.
struct Part {
    /// What its figures say of themselves.
    group: Group,
    /// Its name, after the name of the structure.
    name: &'static str,
    /// Method of measurement, if there are several.
    method: Option<Code>,
    /// Where it was measured, if not in the whole structure.
    site: Option<Code>,
}

const WITH_BLUR: Code = own("APPARENT", "With the blur of the image");
const WITHOUT_BLUR: Code = own("ANATOMICAL", "Without the blur of the image");

const PARTS: [Part; 5] = [
    Part {
        group: Group::Cavity,
        name: "cavity",
        method: None,
        site: Some(LV_CAVITY),
    },
    Part {
        group: Group::ApparentWall,
        name: "apparent wall",
        method: Some(WITH_BLUR),
        site: None,
    },
    Part {
        group: Group::ApparentCavity,
        name: "apparent cavity",
        method: Some(WITH_BLUR),
        site: Some(LV_CAVITY),
    },
    Part {
        group: Group::AnatomicalWall,
        name: "anatomical wall",
        method: Some(WITHOUT_BLUR),
        site: None,
    },
    Part {
        group: Group::AnatomicalCavity,
        name: "anatomical cavity",
        method: Some(WITHOUT_BLUR),
        site: Some(LV_CAVITY),
    },
];

/// Puts everything that is particular to this object.
pub(super) fn put(results: &DicomResults<'_>, set: &mut DataSet) {
    let mask = SeriesReference {
        series: results.series(DicomObject::Mask),
        class: uids::SEGMENTATION_STORAGE,
        instance: results.instance(DicomObject::Mask, None),
    };
    report::put(
        &[results.scan],
        results.structure,
        groups(results),
        &[mask],
        results
            .reading
            .map(|reading| reading.signature(results.structure, results.scan)),
        set,
    );
}

fn groups(results: &DicomResults<'_>) -> Vec<DataSet> {
    let report = results.figures.map(readable);
    let mut groups = vec![whole(results, report.as_ref())];
    let parts = PARTS.iter();
    groups.extend(parts.filter_map(|part| part_group(results, report.as_ref()?, part)));
    let polar = results.figures.and_then(|report| report.polar.as_ref());
    for segment in polar.iter().flat_map(|polar| &polar.segments) {
        let number = segment.number;
        let site = number.checked_sub(1).and_then(|at| WALL_SEGMENTS.get(at));
        let figures = measured(&readable(segment), SEGMENT_FIGURES, Group::Whole);
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
    let perfusion = (results.figures).and_then(|report| report.perfusion.as_ref());
    groups.extend(
        perfusion
            .into_iter()
            .flat_map(|perfusion| normals::groups(perfusion, results.structure, &results.uids)),
    );
    groups
}

/// The group of the whole structure.
fn whole(results: &DicomResults<'_>, figures: Option<&Value>) -> DataSet {
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
    content.extend((figures.iter()).flat_map(|report| measured(report, FIGURES, Group::Whole)));
    if let Some(report) = results.figures {
        let comment = dcm("121106", "Comment");
        let flags = report.flags.iter();
        content.extend(flags.map(|flag| text("CONTAINS", comment, &flag.reason)));
        let ranges = report
            .volumes_ml
            .anatomical_interval
            .map(|_| RANGES_COMMENT);
        content.extend(ranges.map(|ranges| text("CONTAINS", comment, ranges)));
        let attenuation = report
            .polar
            .as_ref()
            .and_then(|polar| polar.attenuation.as_ref());
        content.extend(attenuation.map(|it| text("CONTAINS", comment, &it.note)));
    }
    group(if images.is_some() { "1411" } else { "1501" }, content)
}

/// The group of one part; `None` where the report has nothing of it.
fn part_group(results: &DicomResults<'_>, report: &Value, part: &Part) -> Option<DataSet> {
    let figures = measured(report, FIGURES, part.group);
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
    let instance = results.instance(DicomObject::Mask, None);
    let mut item = reference(uids::SEGMENTATION_STORAGE, &instance);
    item.short(tags::REFERENCED_SEGMENT_NUMBER, 1);
    item
}
