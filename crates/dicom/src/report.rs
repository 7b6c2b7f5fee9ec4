//! A structured report as a tree of content items (PS3.3 C.17.3).
//!
//! In: the bytes of a report, such as those that [`write`](mod@crate::write) makes. Out: texts of its header, its content, and
//! the instances that it refers to. Text is taken as the report's character set decodes it.
//!
//! Not for reports from elsewhere: their size is not bounded here.

use dicom_core::Tag;
use dicom_dictionary_std::tags;
use dicom_object::{DefaultDicomObject, InMemDicomObject, from_reader};

/// Why bytes are no structured report.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the structured report cannot be read: {0}")]
pub struct ReportError(String);

/// A coded concept that was read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Concept {
    /// Code Value.
    pub value: String,
    /// Coding Scheme Designator.
    pub scheme: String,
    /// Code Meaning.
    pub meaning: String,
}

impl Concept {
    /// Whether it is this concept, whatever its meaning is called.
    pub fn is(&self, scheme: &str, value: &str) -> bool {
        self.scheme == scheme && self.value == value
    }
}

/// The value of a content item.
#[derive(Debug, Clone, PartialEq)]
pub enum ContentValue {
    /// CONTAINER.
    Container,
    /// TEXT.
    Text(String),
    /// NUM: the number and its unit.
    Number(f64, Concept),
    /// CODE.
    Code(Concept),
    /// UIDREF.
    Uid(String),
    /// Anything else, such as IMAGE.
    Other,
}

/// A content item with the items below it.
#[derive(Debug, Clone, PartialEq)]
pub struct ContentItem {
    /// Its name; images have none.
    pub name: Option<Concept>,
    /// Its value.
    pub value: ContentValue,
    /// The items below it.
    pub content: Vec<ContentItem>,
}

impl ContentItem {
    /// The items below it with this name.
    pub fn named(
        &self,
        scheme: &'static str,
        value: &'static str,
    ) -> impl Iterator<Item = &ContentItem> {
        let is = move |name: &Concept| name.is(scheme, value);
        (self.content.iter()).filter(move |item| item.name.as_ref().is_some_and(is))
    }

    /// The code of the first item below it with this name.
    pub fn code(&self, scheme: &'static str, value: &'static str) -> Option<&Concept> {
        self.named(scheme, value)
            .find_map(|item| match &item.value {
                ContentValue::Code(code) => Some(code),
                _ => None,
            })
    }

    /// The text or the UID of the first item below it with this name.
    pub fn text(&self, scheme: &'static str, value: &'static str) -> Option<&str> {
        self.named(scheme, value)
            .find_map(|item| match &item.value {
                ContentValue::Text(text) | ContentValue::Uid(text) => Some(text.as_str()),
                _ => None,
            })
    }
}

/// A study with the series and instances in it that a report refers to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReferencedStudy {
    /// Study Instance UID.
    pub uid: String,
    /// Series Instance UID, and of each instance SOP Class UID and SOP Instance UID.
    pub series: Vec<(String, Vec<[String; 2]>)>,
}

/// A structured report.
#[derive(Debug, Clone)]
pub struct StructuredReport(DefaultDicomObject);

impl StructuredReport {
    /// The report in `bytes`, a whole file.
    ///
    /// # Errors
    /// If they are no DICOM file, or have no content.
    pub fn read(bytes: &[u8]) -> Result<Self, ReportError> {
        let file = from_reader(bytes).map_err(|error| ReportError(error.to_string()))?;
        match file.get(tags::CONTENT_SEQUENCE) {
            Some(_) => Ok(Self(file)),
            None => Err(ReportError("it has no Content Sequence".to_owned())),
        }
    }

    /// The text of an attribute of the header; `None` where it is absent or empty.
    pub fn text(&self, tag: Tag) -> Option<String> {
        text(&self.0, tag)
    }

    /// The text of an attribute in the first item of a sequence of the header.
    pub fn text_in(&self, sequence: Tag, tag: Tag) -> Option<String> {
        text(items(&self.0, sequence).first()?, tag)
    }

    /// The root of the content.
    pub fn root(&self) -> ContentItem {
        item(&self.0)
    }

    /// The studies that it refers to: its own first.
    pub fn evidence(&self) -> Vec<ReferencedStudy> {
        let sequences = [
            tags::CURRENT_REQUESTED_PROCEDURE_EVIDENCE_SEQUENCE,
            tags::PERTINENT_OTHER_EVIDENCE_SEQUENCE,
        ];
        let studies = sequences.into_iter().flat_map(|tag| items(&self.0, tag));
        studies
            .filter_map(|study| {
                let series = items(study, tags::REFERENCED_SERIES_SEQUENCE).iter();
                Some(ReferencedStudy {
                    uid: text(study, tags::STUDY_INSTANCE_UID)?,
                    series: series.filter_map(referenced_series).collect(),
                })
            })
            .collect()
    }
}

fn referenced_series(series: &InMemDicomObject) -> Option<(String, Vec<[String; 2]>)> {
    let instances = items(series, tags::REFERENCED_SOP_SEQUENCE).iter();
    let instances = instances.filter_map(|instance| {
        let class = text(instance, tags::REFERENCED_SOP_CLASS_UID)?;
        Some([class, text(instance, tags::REFERENCED_SOP_INSTANCE_UID)?])
    });
    Some((
        text(series, tags::SERIES_INSTANCE_UID)?,
        instances.collect(),
    ))
}

fn item(set: &InMemDicomObject) -> ContentItem {
    let kind = text(set, tags::VALUE_TYPE).unwrap_or_default();
    let value = match kind.as_str() {
        "CONTAINER" => Some(ContentValue::Container),
        "TEXT" => text(set, tags::TEXT_VALUE).map(ContentValue::Text),
        "UIDREF" => text(set, tags::UID).map(ContentValue::Uid),
        "CODE" => concept(set, tags::CONCEPT_CODE_SEQUENCE).map(ContentValue::Code),
        "NUM" => number(set),
        _ => None,
    };
    let content = items(set, tags::CONTENT_SEQUENCE);
    ContentItem {
        name: concept(set, tags::CONCEPT_NAME_CODE_SEQUENCE),
        value: value.unwrap_or(ContentValue::Other),
        content: content.iter().map(item).collect(),
    }
}

fn number(set: &InMemDicomObject) -> Option<ContentValue> {
    let measured = items(set, tags::MEASURED_VALUE_SEQUENCE).first()?;
    let value = text(measured, tags::NUMERIC_VALUE)?.parse().ok()?;
    let unit = concept(measured, tags::MEASUREMENT_UNITS_CODE_SEQUENCE)?;
    Some(ContentValue::Number(value, unit))
}

fn concept(set: &InMemDicomObject, tag: Tag) -> Option<Concept> {
    let code = items(set, tag).first()?;
    Some(Concept {
        value: text(code, tags::CODE_VALUE)?,
        scheme: text(code, tags::CODING_SCHEME_DESIGNATOR)?,
        meaning: text(code, tags::CODE_MEANING)?,
    })
}

fn items(set: &InMemDicomObject, tag: Tag) -> &[InMemDicomObject] {
    let element = set.get(tag);
    element
        .and_then(|element| element.items())
        .unwrap_or_default()
}

fn text(set: &InMemDicomObject, tag: Tag) -> Option<String> {
    let text = set.get(tag)?.to_str().ok()?;
    let text = text.trim_end_matches(['\0', ' ']).trim_start();
    (!text.is_empty()).then(|| text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::uids;
    use crate::write::code::{dcm, ucum};
    use crate::write::content;
    use crate::write::data_set::{DataSet, reference};

    #[test]
    fn what_was_written_is_read() {
        let mut root = DataSet::new();
        root.text(tags::SOP_CLASS_UID, uids::COMPREHENSIVE3_DSR_STORAGE);
        root.text(tags::SOP_INSTANCE_UID, "1.2.3");
        root.text(tags::SPECIFIC_CHARACTER_SET, "ISO_IR 192");
        root.text(tags::PATIENT_NAME, "Müller^Ada");
        root.text(tags::VALUE_TYPE, "CONTAINER");
        let size = content::number("CONTAINS", dcm("1", "Size"), 1.5, ucum("mm", "mm"));
        let group = content::group("1501", vec![size]);
        root.items(tags::CONTENT_SEQUENCE, vec![group]);
        let mut series = DataSet::new();
        let instance = reference("1.2.840.10008.5.1.4.1.1.20", "1.2.5");
        series.items(tags::REFERENCED_SOP_SEQUENCE, vec![instance]);
        series.text(tags::SERIES_INSTANCE_UID, "1.2.6");
        let mut study = DataSet::new();
        study.items(tags::REFERENCED_SERIES_SEQUENCE, vec![series]);
        study.text(tags::STUDY_INSTANCE_UID, "1.2.7");
        root.item(tags::CURRENT_REQUESTED_PROCEDURE_EVIDENCE_SEQUENCE, study);

        let report = StructuredReport::read(&root.file().unwrap()).unwrap();
        assert_eq!(report.text(tags::PATIENT_NAME).unwrap(), "Müller^Ada");
        assert_eq!(report.text(tags::PATIENT_ID), None);
        let group = &report.root().content[0];
        assert!(group.name.as_ref().unwrap().is("DCM", "125007"));
        let size = group.named("DCM", "1").next().unwrap();
        let ContentValue::Number(value, unit) = &size.value else {
            panic!("no number: {size:?}");
        };
        assert!((value - 1.5).abs() < 1e-12 && unit.is("UCUM", "mm"));
        let [study] = &report.evidence()[..] else {
            panic!("one study is referred to");
        };
        assert_eq!(study.uid, "1.2.7");
        assert_eq!(study.series[0].0, "1.2.6");
        assert_eq!(study.series[0].1[0][1], "1.2.5");
        assert!(StructuredReport::read(b"none").is_err());
    }
}
