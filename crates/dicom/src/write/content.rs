//! The content items of a structured report (PS3.3 C.17.3), each with its relationship to the item that holds it.

use super::code::{Code, dcm, sct};
use super::data_set::DataSet;
use dicom_core::Tag;
use dicom_dictionary_std::tags;

/// A CONTAINER item with `content`.
pub fn container(name: Code, content: Vec<DataSet>) -> DataSet {
    let mut item = item("CONTAINS", "CONTAINER", Some(name));
    item.text(tags::CONTINUITY_OF_CONTENT, "SEPARATE");
    item.items(tags::CONTENT_SEQUENCE, content);
    item
}

/// A Measurement Group by the template `id`.
pub fn group(id: &str, content: Vec<DataSet>) -> DataSet {
    let mut group = container(dcm("125007", "Measurement Group"), content);
    group.item(tags::CONTENT_TEMPLATE_SEQUENCE, template(id));
    group
}

/// The item that names a template of PS3.16.
pub fn template(id: &str) -> DataSet {
    let mut item = DataSet::new();
    item.text(tags::MAPPING_RESOURCE, "DCMR");
    item.text(tags::TEMPLATE_IDENTIFIER, id);
    item
}

/// A NUM item.
pub fn number(relationship: &str, name: Code, value: f64, unit: Code) -> DataSet {
    let mut measured = DataSet::new();
    measured.decimals(tags::NUMERIC_VALUE, &[value]);
    measured.code(tags::MEASUREMENT_UNITS_CODE_SEQUENCE, unit);
    let mut item = item(relationship, "NUM", Some(name));
    item.item(tags::MEASURED_VALUE_SEQUENCE, measured);
    item
}

/// A CODE item.
pub fn concept(relationship: &str, name: Code, code: Code) -> DataSet {
    let mut item = item(relationship, "CODE", Some(name));
    item.code(tags::CONCEPT_CODE_SEQUENCE, code);
    item
}

/// A TEXT item.
pub fn text(relationship: &str, name: Code, text: &str) -> DataSet {
    let item = item(relationship, "TEXT", Some(name));
    with_text(item, tags::TEXT_VALUE, text)
}

/// A UIDREF item.
pub fn unique(relationship: &str, name: Code, uid: &str) -> DataSet {
    with_text(item(relationship, "UIDREF", Some(name)), tags::UID, uid)
}

/// An IMAGE item that refers to an instance.
pub fn image(relationship: &str, name: Option<Code>, referenced: DataSet) -> DataSet {
    let mut item = item(relationship, "IMAGE", name);
    item.item(tags::REFERENCED_SOP_SEQUENCE, referenced);
    item
}

/// Name and UID by which a measured structure is found again.
pub fn tracking(name: &str, uid: &str) -> Vec<DataSet> {
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

/// Where a finding lies.
pub fn finding_site(site: Code) -> DataSet {
    concept("HAS CONCEPT MOD", sct("363698007", "Finding Site"), site)
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
