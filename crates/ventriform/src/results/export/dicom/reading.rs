//! What a reader states of a result, in the structured report of that result.
//!
//! In: a reading with its id. Out: the flags of a verified report with who verified it and when (PS3.3 C.17.2); a
//! measurement group of each scan's sum and of each scored segment, by the method `READER`, beside the automatic ones; and
//! qualitative evaluations (TID 1500): the quality, the limits and the impression.
//!
//! Of a scan that is freed of the identity there are scores and the quality alone: free text and the reader's name are left
//! out, as the Basic Application Level Confidentiality Profile asks for (PS3.15 annex E).

use super::normals::patient_state;
use super::structured_report::{Signature, WALL_SEGMENTS};
use super::{SourceScan, Structure};
use crate::heart::comparison::WhichScan;
use crate::results::figures::Unit;
use crate::results::figures::code::own;
use crate::results::figures::perfusion::{REST_SCORE, SEGMENT_SCORE, STRESS_SCORE, SUMMED_SCORE};
use crate::results::report::{ReadScores, ReadingReport};
use ventriform_dicom::tags;
use ventriform_dicom::write::code::{Code, dcm, sct};
use ventriform_dicom::write::content::{
    concept, container, finding_site, group, number, text, tracking,
};
use ventriform_dicom::write::data_set::DataSet;
use ventriform_dicom::write::uid::{Uids, derived};

/// A reading, with the id under which a service stores it.
#[derive(Debug, Clone, Copy)]
pub struct SignedReading<'a> {
    /// The id.
    pub id: &'a str,
    /// What the reader states.
    pub reading: &'a ReadingReport,
}

/// The reader's method, beside that of the program.
const READER: Code = own("READER", "Scored by the reader");
const QUALITY: Code = own("QUALITY", "Quality of the study");
const LIMITS: Code = own("LIMITS", "Limits of the study");
const QUALITATIVE_EVALUATIONS: Code = Code::new("C0034375", "UMLS", "Qualitative Evaluations");

/// The UID called `name` of an object, or of its version that `reading` signs.
pub(super) fn uid(uids: &Uids, name: &str, reading: Option<SignedReading<'_>>) -> String {
    let id = reading.map_or(&b""[..], |reading| reading.id.as_bytes());
    uids.over(name, id)
}

impl SignedReading<'_> {
    /// The reader's scores, who verified the report and when, and what they say of the study.
    pub(super) fn signature(&self, structure: Structure, scan: &SourceScan) -> Signature {
        let read_at = self.reading.read_at.chars();
        let digits: String = read_at.filter(char::is_ascii_digit).collect();
        let reader = match scan.shown() {
            Some(_) => self.reading.reader.as_str(),
            None => "reader",
        };
        let mut observer = DataSet::new();
        // Which organisation vouches for the reader is not known here; the attribute must not be empty.
        observer.text(tags::VERIFYING_ORGANIZATION, "not stated");
        observer.text(tags::VERIFICATION_DATE_TIME, format!("{digits}+0000"));
        observer.text(tags::VERIFYING_OBSERVER_NAME, reader);
        observer.items(
            tags::VERIFYING_OBSERVER_IDENTIFICATION_CODE_SEQUENCE,
            Vec::new(),
        );
        Signature {
            groups: self.groups(structure),
            observer,
            evaluations: self.evaluations(scan),
        }
    }

    /// The groups of the reader's scores.
    fn groups(&self, structure: Structure) -> Vec<DataSet> {
        let scans = self.reading.scores.iter();
        scans
            .flat_map(|scores| self.groups_of(scores, structure))
            .collect()
    }

    fn groups_of(&self, scores: &ReadScores, structure: Structure) -> Vec<DataSet> {
        let (scan, sum) = match scores.scan.as_str() {
            "stress" => (Some(WhichScan::Stress), STRESS_SCORE),
            "rest" => (Some(WhichScan::Rest), REST_SCORE),
            _ => (None, SUMMED_SCORE),
        };
        let beginning = |name: &str, site: Code| {
            let name = format!("{name}, {}, by the reader", scores.scan);
            let uid = derived(&[b"reading", self.id.as_bytes(), name.as_bytes()]);
            let mut content = tracking(&name, &uid);
            content.push(concept(
                "CONTAINS",
                dcm("121071", "Finding"),
                structure.kind,
            ));
            content.extend(scan.map(patient_state));
            content.push(concept(
                "HAS CONCEPT MOD",
                sct("370129005", "Measurement Method"),
                READER,
            ));
            content.push(finding_site(site));
            content
        };
        let unit = Unit::SCORE.code;
        let mut whole = beginning(structure.label, structure.site);
        whole.push(number("CONTAINS", sum, f64::from(scores.sum), unit));
        let segments = scores.segments.iter().zip(WALL_SEGMENTS).enumerate();
        let segments = segments.map(|(at, (score, site))| {
            let mut content = beginning(&format!("Segment {}", at + 1), site);
            content.push(number("CONTAINS", SEGMENT_SCORE, f64::from(*score), unit));
            content
        });
        let all = std::iter::once(whole).chain(segments);
        all.map(|content| group("1501", content)).collect()
    }

    /// The qualitative evaluations; `None` where nothing is stated.
    fn evaluations(&self, scan: &SourceScan) -> Option<DataSet> {
        let reading = self.reading;
        let grade = reading.quality.as_deref().map(|quality| match quality {
            "good" => own("GOOD", "Good"),
            "fair" => own("FAIR", "Fair"),
            _ => own("POOR", "Poor"),
        });
        let mut stated: Vec<DataSet> = grade
            .map(|grade| concept("CONTAINS", QUALITY, grade))
            .into_iter()
            .collect();
        if scan.shown().is_some() {
            let texts = [
                (LIMITS, &reading.limits),
                (dcm("121073", "Impression"), &reading.impression),
            ];
            let texts = texts
                .into_iter()
                .filter_map(|(name, said)| Some(text("CONTAINS", name, said.as_deref()?)));
            stated.extend(texts);
        }
        (!stated.is_empty()).then(|| container(QUALITATIVE_EVALUATIONS, stated))
    }
}
