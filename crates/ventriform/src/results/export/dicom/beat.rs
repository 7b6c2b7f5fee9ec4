//! A beat as DICOM objects: Segmentations of end diastole and end systole, and its figures as a structured report.
//!
//! In: the report of a beat, of both ends the scan with that gate's images or frames and, for a Segmentation, the wall
//! at its end. All may come from a fit or from its stored files. Out: the bytes of [`BeatObject`]s. Each Segmentation
//! refers to the frames of its own gate.
//!
//! The report has groups of TID 1501 ([`structured_report`](super::structured_report)): one of the volume at each end,
//! whose cardiac cycle phase says which (CID 12233), one of what is measured over the whole beat, one of each of the 17
//! segments, unless the gates are no beat, and those beside normal limits ([`normals`]). A figure that the report lacks
//! is left out, and so are phases that are not reliable; their scatter by noise stays. EDV, ESV and EF have the ends of
//! the interval that holds the true value of nine of ten hearts, as distances below and above (TID 310, CID 225).

use super::normals;
use super::structured_report::{self as sr, RANGES_COMMENT, WALL_SEGMENTS, measured};
use super::{
    DicomError, DicomObject, DicomResults, SignedReading, SourceScan, Structure, put_facts, reading,
};
use crate::image::grid::voxelise::Mask;
use crate::mesh::TriMesh;
use crate::results::figures::beat::{FIGURES, SEGMENT_FIGURES};
use crate::results::figures::{Group, readable};
use crate::results::report::BeatReport;
use ventriform_dicom::write::code::{Code, dcm, sct};
use ventriform_dicom::write::content::{concept, finding_site, group, text, tracking};
use ventriform_dicom::write::data_set::DataSet;
use ventriform_dicom::write::uid::Uids;

/// An end of the beat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BeatEnd {
    /// The cavity is largest.
    Diastole,
    /// The cavity is smallest.
    Systole,
}

impl BeatEnd {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Diastole, Self::Systole];

    /// That of this end, of what both ends have: end diastole first.
    pub fn pick<T>(self, [diastole, systole]: [T; 2]) -> T {
        match self {
            Self::Diastole => diastole,
            Self::Systole => systole,
        }
    }

    /// The number of the gate at this end of the beat of `report`, counted from 1.
    pub fn gate(self, report: &BeatReport) -> usize {
        self.pick([report.end_diastole_gate, report.end_systole_gate])
    }

    fn code(self) -> Code {
        self.pick([
            sct("416190007", "End diastole"),
            sct("416430001", "End Systole"),
        ])
    }

    /// Its name, for people.
    pub(super) fn name(self) -> &'static str {
        self.pick(["end diastole", "end systole"])
    }
}

/// The wall at an end of the beat.
#[derive(Debug, Clone)]
pub struct EndWall {
    /// The wall on the scan's grid.
    pub wall: Mask,
    /// The cavity there.
    pub cavity: Mask,
    /// The wall, LPS mm.
    pub mesh: TriMesh,
}

/// An object of a beat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BeatObject {
    /// Wall and cavity at an end of the beat: Segmentation Storage.
    Mask(BeatEnd),
    /// The figures: Comprehensive 3D SR Storage.
    Measurements,
}

impl BeatObject {
    /// All of them.
    pub const ALL: [Self; 3] = [
        Self::Mask(BeatEnd::Diastole),
        Self::Mask(BeatEnd::Systole),
        Self::Measurements,
    ];

    /// The name of the file.
    pub fn file_name(self) -> &'static str {
        match self {
            Self::Mask(BeatEnd::Diastole) => "mask_ed.dcm",
            Self::Mask(BeatEnd::Systole) => "mask_es.dcm",
            Self::Measurements => DicomObject::Measurements.file_name(),
        }
    }
}

/// The results of a beat.
pub struct DicomBeat<'a> {
    structure: Structure,
    /// The scan at end diastole and at end systole.
    scans: &'a [SourceScan; 2],
    report: &'a BeatReport,
    /// The report as JSON in one line, from which UIDs are derived.
    text: &'a str,
    reading: Option<SignedReading<'a>>,
}

impl<'a> DicomBeat<'a> {
    /// The results of a beat of `structure`. `scans` are the scan with the images or frames of the gate at end diastole
    /// and with those at end systole; `text` is the report as JSON in one line, from which UIDs are derived.
    pub fn new(
        structure: Structure,
        scans: &'a [SourceScan; 2],
        report: &'a BeatReport,
        text: &'a str,
    ) -> Self {
        Self {
            structure,
            scans,
            report,
            text,
            reading: None,
        }
    }

    /// Adds what a reader states, to [`BeatObject::Measurements`].
    #[must_use]
    pub fn with_reading(self, reading: Option<SignedReading<'a>>) -> Self {
        Self { reading, ..self }
    }

    /// The bytes of [`BeatObject::Mask`].
    ///
    /// # Errors
    /// See [`DicomError`].
    pub fn mask(&self, end: BeatEnd, of: &EndWall) -> Result<Vec<u8>, DicomError> {
        let scan = end.pick(self.scans.each_ref());
        DicomResults::new(scan, self.structure, &of.wall, &of.mesh, self.text)
            .with_cavity(Some(&of.cavity))
            .at(end)
            .write_always(DicomObject::Mask)
    }

    /// The bytes of [`BeatObject::Measurements`].
    ///
    /// # Errors
    /// See [`DicomError`].
    pub fn measurements(&self) -> Result<Vec<u8>, DicomError> {
        let scans = self.scans.each_ref();
        for scan in scans {
            scan.check()?;
        }
        let uids = Uids::over_all(|add| {
            add(env!("CARGO_PKG_VERSION").as_bytes());
            add(b"beat");
            scans.iter().for_each(|scan| scan.add_to(add));
            add(self.text.as_bytes());
        });
        let mut set = DataSet::new();
        let signature = self
            .reading
            .map(|reading| reading.signature(self.structure, scans[0]));
        sr::put(
            &scans,
            self.structure,
            self.groups(&uids),
            &[],
            signature,
            &mut set,
        );
        let name = BeatObject::Measurements.file_name();
        put_facts(
            scans[0],
            &DicomObject::Measurements.facts(),
            [name.to_owned(), format!("series of {name}")]
                .map(|name| reading::uid(&uids, &name, self.reading)),
            format!("{}: measurements of the beat", self.structure.label),
            &mut set,
        );
        Ok(set.file()?)
    }

    fn groups(&self, uids: &Uids) -> Vec<DataSet> {
        let label = self.structure.label;
        let mut groups = Vec::new();
        let report = readable(self.report);
        for (end, measured_at) in [
            (BeatEnd::Diastole, Group::EndDiastole),
            (BeatEnd::Systole, Group::EndSystole),
        ] {
            let name = format!("{label}, {}", end.name());
            let mut content = self.beginning(&name, uids);
            content.push(concept(
                "HAS CONCEPT MOD",
                sct("246092007", "Cardiac cycle phase (attribute)"),
                end.code(),
            ));
            content.push(finding_site(self.structure.site));
            content.extend(measured(&report, FIGURES, measured_at));
            groups.push(group("1501", content));
        }
        let mut content = self.beginning(label, uids);
        content.push(finding_site(self.structure.site));
        content.extend(measured(&report, FIGURES, Group::Whole));
        content.push(text("CONTAINS", dcm("121106", "Comment"), RANGES_COMMENT));
        let flags = self.report.flags.iter();
        content.extend(flags.map(|flag| text("CONTAINS", dcm("121106", "Comment"), &flag.reason)));
        groups.push(group("1501", content));
        let moving = self.report.ef_percent.is_some();
        for segment in self.report.segments.iter().filter(|_| moving) {
            let number = segment.segment;
            let site = number.checked_sub(1).and_then(|at| WALL_SEGMENTS.get(at));
            let Some(site) = site else { continue };
            let mut content = self.beginning(&format!("Segment {number}"), uids);
            content.push(finding_site(*site));
            let mut segment = segment.clone();
            segment.phase_degrees = segment.phase_degrees.filter(|_| self.report.phase.reliable);
            content.extend(measured(&readable(&segment), SEGMENT_FIGURES, Group::Whole));
            groups.push(group("1501", content));
        }
        let perfusion = self.report.perfusion.iter();
        groups.extend(
            perfusion.flat_map(|perfusion| normals::groups(perfusion, self.structure, uids)),
        );
        groups
    }

    /// Tracking and finding of a group.
    fn beginning(&self, name: &str, uids: &Uids) -> Vec<DataSet> {
        let mut content = tracking(name, &uids.uid(name));
        let finding = dcm("121071", "Finding");
        content.push(concept("CONTAINS", finding, self.structure.kind));
        content
    }
}
