//! A serial comparison as a DICOM structured report: the figures of every scan, and what changed.
//!
//! In: the report of a serial comparison, and its scans. Out: the bytes of a Comprehensive 3D SR that belongs to the
//! patient and the study of the last scan; it refers to the images of all scans, each in its own study.
//!
//! Groups of TID 1501 ([`structured_report`](super::structured_report)): one of every scan with its figures, and one of
//! every pair of scans with the wall that got worse and better. What changed of the figures, with its interval and its
//! verdict, stands in comments of the pair's group, for which there is no code.

use super::structured_report::{self as sr, measured, verdicts};
use super::{DicomError, DicomObject, SourceScan, Structure, put_facts};
use crate::results::figures::serial::{PAIR_FIGURES, SCAN_FIGURES};
use crate::results::figures::{Group, readable};
use crate::results::report::{SerialPairReport, SerialReport};
use ventriform_dicom::write::code::dcm;
use ventriform_dicom::write::content::{concept, finding_site, group, text, tracking};
use ventriform_dicom::write::data_set::DataSet;
use ventriform_dicom::write::uid::Uids;

/// The comment of the group of a pair: no code says how sure a range is.
const NOISE_COMMENT: &str = "Ranges of measurement uncertainty are the 5th and the 95th percentile by the noise of both scans; \
    intervals in comments are those of 95 %.";

/// The results of a serial comparison.
pub struct DicomSerial<'a> {
    structure: Structure,
    scans: &'a [SourceScan],
    report: &'a SerialReport,
    uids: Uids,
}

impl<'a> DicomSerial<'a> {
    /// The results of a serial comparison of `structure`. `scans` stand in the order of the report; `text` is the report as
    /// JSON in one line, from which UIDs are derived.
    pub fn new(
        structure: Structure,
        scans: &'a [SourceScan],
        report: &'a SerialReport,
        text: &str,
    ) -> Self {
        let uids = Uids::over_all(|add| {
            add(env!("CARGO_PKG_VERSION").as_bytes());
            add(b"serial");
            scans.iter().for_each(|scan| scan.add_to(add));
            add(text.as_bytes());
        });
        Self {
            structure,
            scans,
            report,
            uids,
        }
    }

    /// The bytes of the structured report, [`DicomObject::Measurements`]. `None` without a scan.
    ///
    /// # Errors
    /// See [`DicomError`].
    pub fn measurements(&self) -> Result<Option<Vec<u8>>, DicomError> {
        self.scans.iter().try_for_each(SourceScan::check)?;
        let Some(last) = self.scans.last() else {
            return Ok(None);
        };
        let mut set = DataSet::new();
        let scans: Vec<&SourceScan> = self.scans.iter().collect();
        sr::put(&scans, self.structure, self.groups(), &[], None, &mut set);
        let facts = DicomObject::Measurements.facts();
        let [instance, series] = [facts.name.to_owned(), format!("series of {}", facts.name)]
            .map(|name| self.uids.uid(&name));
        let description = format!("{}: measurements over the years", self.structure.label);
        put_facts(last, &facts, [instance, series], description, &mut set);
        Ok(Some(set.file()?))
    }

    fn groups(&self) -> Vec<DataSet> {
        let report = self.report;
        // Objects that are freed of the identity say nothing of the headers.
        let named = self.scans.iter().all(|scan| scan.shown().is_some());
        let scans = report.scans.iter().map(|scan| {
            let name = match scan.date.as_ref().filter(|_| named) {
                Some(date) => format!("{}, scan {}, {date}", self.structure.label, scan.number),
                None => format!("{}, scan {}", self.structure.label, scan.number),
            };
            let mut content = self.beginning(&name);
            let figures = readable(scan);
            content.extend(measured(&figures, SCAN_FIGURES, Group::Whole));
            let said = SCAN_FIGURES.iter().filter(|row| row.coded.is_none());
            let said = said.filter_map(|row| {
                let value = row.written(row.value(&figures)?);
                Some(format!("{}: {value} {}", row.label, row.unit.symbol))
            });
            content.extend(said.map(|said| comment(&said)));
            group("1501", content)
        });
        let pairs = report.pairs.iter().enumerate().map(|(place, pair)| {
            let (earlier, later) = (pair.earlier, pair.later);
            let label = self.structure.label;
            let name = format!("{label}, change from scan {earlier} to scan {later}");
            let mut content = self.beginning(&name);
            let shares = readable(pair);
            content.extend(measured(&shares, PAIR_FIGURES, Group::Whole));
            content.extend(verdicts(&shares, PAIR_FIGURES, Group::Whole));
            let flags = report.flags.iter().filter(|_| place == 0 && named);
            let flags = flags.map(|flag| flag.reason.clone());
            let said = std::iter::once(NOISE_COMMENT.to_owned())
                .chain(self.changes(pair))
                .chain(flags);
            content.extend(said.map(|said| comment(&said)));
            group("1501", content)
        });
        scans.chain(pairs).collect()
    }

    /// What changed of the figures between both scans, in words.
    fn changes(&self, pair: &SerialPairReport) -> Vec<String> {
        let said = SCAN_FIGURES.iter().filter_map(|row| {
            let own = self.report.change(row.place, pair.earlier, pair.later)?;
            let [low, high] = own.interval.map(|end| row.written(end));
            Some(format!(
                "{}: change {} {}, 95 % {low} to {high}, changed: {}",
                row.label,
                row.written(own.change),
                row.unit.symbol,
                own.verdict.as_str()
            ))
        });
        said.collect()
    }

    /// Tracking, finding and site of a group.
    fn beginning(&self, name: &str) -> Vec<DataSet> {
        let mut content = tracking(name, &self.uids.uid(name));
        let finding = dcm("121071", "Finding");
        content.push(concept("CONTAINS", finding, self.structure.kind));
        content.push(finding_site(self.structure.site));
        content
    }
}

fn comment(said: &str) -> DataSet {
    text("CONTAINS", dcm("121106", "Comment"), said)
}
