//! A comparison of rest and stress as DICOM objects: its figures as a structured report, its pictures as Secondary
//! Captures.
//!
//! In: the report of a comparison, both scans with their images, and the pictures. Out: the bytes of
//! [`ComparisonObject`]s. The page joins the pictures and what the report says into one. All belong to the patient and
//! the study of the scan at stress; the report refers to the images of both scans, each in its own study.
//!
//! The report has groups of TID 1501 ([`structured_report`](super::structured_report)): one of both scans together, one
//! of each scan, whose patient's state says which (CID 3207), one of each artery's territory, one of each of the 17
//! segments in each state, and one of each segment's change. The group of a scan names the limits that its scores stand
//! beside ([`limits_used`]). A figure that the report lacks is left out: without normal limits there are no scores. What
//! noise lets a figure be is a range of measurement uncertainty; its verdict stands in a comment, for which there is no
//! code.

use super::normals::{limits_used, patient_state};
use super::structured_report::{self as sr, WALL_SEGMENTS, measured, verdicts};
use super::{
    DicomError, DicomObject, ObjectFacts, SignedReading, SourceScan, Structure, capture, put_facts,
    reading,
};
use crate::heart::comparison::WhichScan;
use crate::image::draw::Image;
use crate::results::figures::comparison::{
    FIGURES, SCAN_FIGURES, SEGMENT_FIGURES, TERRITORY_FIGURES,
};
use crate::results::figures::{Group, readable};
use crate::results::report::{ComparisonReport, ComparisonSheet, DrawnPage, comparison_sheet};
use ventriform_dicom::uids;
use ventriform_dicom::write::code::{Code, dcm};
use ventriform_dicom::write::content::{concept, finding_site, group, text, tracking};
use ventriform_dicom::write::data_set::DataSet;
use ventriform_dicom::write::uid::Uids;

/// An object of a comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ComparisonObject {
    /// The figures: Comprehensive 3D SR Storage.
    Measurements,
    /// The page of the report as one picture: Secondary Capture.
    Page,
    /// The polar map of a scan: Secondary Capture.
    Polar(WhichScan),
    /// The difference of both maps: Secondary Capture.
    Difference,
}

impl ComparisonObject {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Measurements,
        Self::Page,
        Self::Polar(WhichScan::Stress),
        Self::Polar(WhichScan::Rest),
        Self::Difference,
    ];

    /// The name of the file.
    pub fn file_name(self) -> &'static str {
        self.facts().name
    }

    /// The files of the comparison with the pictures that the object shows, PNG: of a page those that there are, of a
    /// polar map the one that it is. None for the figures.
    pub fn pictures(self) -> &'static [&'static str] {
        match self {
            Self::Measurements => &[],
            Self::Page => &PAGE_PICTURES,
            Self::Polar(WhichScan::Stress) => &["polar_stress.png"],
            Self::Polar(WhichScan::Rest) => &["polar_rest.png"],
            Self::Difference => &["polar_difference.png"],
        }
    }

    /// The picture without which there is no such object.
    pub fn needed_picture(self) -> Option<&'static str> {
        match self {
            Self::Measurements | Self::Page => None,
            Self::Polar(_) | Self::Difference => self.pictures().first().copied(),
        }
    }

    fn facts(self) -> ObjectFacts {
        let picture = |name, series, description| ObjectFacts {
            name,
            class: uids::SECONDARY_CAPTURE_IMAGE_STORAGE,
            modality: "OT",
            series,
            description,
        };
        match self {
            Self::Measurements => DicomObject::Measurements.facts(),
            Self::Page => picture("page.dcm", 9107, "page of rest and stress"),
            Self::Polar(WhichScan::Stress) => {
                picture("polar_stress.dcm", 9108, "polar map at stress")
            }
            Self::Polar(WhichScan::Rest) => picture("polar_rest.dcm", 9109, "polar map at rest"),
            Self::Difference => {
                picture("polar_difference.dcm", 9110, "polar map, rest less stress")
            }
        }
    }
}

/// The comment of the group of both scans: no code says how sure a range is.
const NOISE_COMMENT: &str = "Ranges of measurement uncertainty are the 5th and the 95th percentile by the noise of both scans.";

/// Slices of stress above those of rest.
const SLICES_PICTURE: &str = "slices.png";

/// The pictures of a page: the slices, and polar maps with their titles.
const PAGE_MAPS: [(&str, &str); 5] = [
    ("polar_stress.png", "Stress"),
    ("polar_rest.png", "Rest"),
    ("polar_difference.png", "Rest less stress"),
    ("polar_z_stress.png", "Stress against normal limits, z"),
    ("polar_z_rest.png", "Rest against normal limits, z"),
];

const PAGE_PICTURES: [&str; 6] = [
    SLICES_PICTURE,
    PAGE_MAPS[0].0,
    PAGE_MAPS[1].0,
    PAGE_MAPS[2].0,
    PAGE_MAPS[3].0,
    PAGE_MAPS[4].0,
];

/// The results of a comparison.
pub struct DicomComparison<'a> {
    structure: Structure,
    /// The scan at stress and the scan at rest.
    scans: &'a [SourceScan; 2],
    report: &'a ComparisonReport,
    reading: Option<SignedReading<'a>>,
    uids: Uids,
}

impl<'a> DicomComparison<'a> {
    /// The results of a comparison of `structure`. `scans` are the scan at stress and the scan at rest; `text` is the
    /// report as JSON in one line, from which UIDs are derived.
    pub fn new(
        structure: Structure,
        scans: &'a [SourceScan; 2],
        report: &'a ComparisonReport,
        text: &str,
    ) -> Self {
        let uids = Uids::over_all(|add| {
            add(env!("CARGO_PKG_VERSION").as_bytes());
            add(b"comparison");
            scans.iter().for_each(|scan| scan.add_to(add));
            add(text.as_bytes());
        });
        Self {
            structure,
            scans,
            report,
            reading: None,
            uids,
        }
    }

    /// Adds what a reader states, to [`ComparisonObject::Measurements`].
    #[must_use]
    pub fn with_reading(self, reading: Option<SignedReading<'a>>) -> Self {
        Self { reading, ..self }
    }

    /// The bytes of [`ComparisonObject::Measurements`].
    ///
    /// # Errors
    /// See [`DicomError`].
    pub fn measurements(&self) -> Result<Vec<u8>, DicomError> {
        self.check()?;
        let mut set = DataSet::new();
        let scans = self.scans.each_ref();
        let signature = self
            .reading
            .map(|reading| reading.signature(self.structure, scans[0]));
        sr::put(
            &scans,
            self.structure,
            self.groups(),
            &[],
            signature,
            &mut set,
        );
        let name = ComparisonObject::Measurements.file_name();
        let instance = reading::uid(&self.uids, name, self.reading);
        self.put(ComparisonObject::Measurements, instance, &mut set);
        Ok(set.file()?)
    }

    /// The bytes of an object that shows pictures: `pictures` are those of [`ComparisonObject::pictures`] that there
    /// are, each with its name. `None` for the figures, and for an object whose [`ComparisonObject::needed_picture`] is
    /// not there.
    ///
    /// # Errors
    /// See [`DicomError`].
    pub fn picture(
        &self,
        object: ComparisonObject,
        pictures: &[(&str, &[u8])],
    ) -> Result<Option<Vec<u8>>, DicomError> {
        self.check()?;
        let name = object.file_name();
        let decoded = |picture: &str| {
            let found = pictures.iter().find(|(known, _)| *known == picture);
            found
                .map(|(_, png)| capture::decoded(name, png))
                .transpose()
        };
        let drawn = match object {
            ComparisonObject::Measurements => None,
            ComparisonObject::Page => {
                let slices = decoded(SLICES_PICTURE)?;
                let mut maps = Vec::new();
                for (map, title) in PAGE_MAPS {
                    maps.extend(decoded(map)?.map(|image| (title, image)));
                }
                Some(self.page(slices.as_ref(), &maps))
            }
            ComparisonObject::Polar(_) | ComparisonObject::Difference => {
                let map = object.needed_picture().map(decoded).transpose()?;
                map.flatten().map(capture::anonymous)
            }
        };
        let Some(drawn) = drawn else {
            return Ok(None);
        };
        let mut set = DataSet::new();
        let scan = match object {
            ComparisonObject::Polar(WhichScan::Rest) if self.is_one_study() => &self.scans[1],
            _ => &self.scans[0],
        };
        let instance = self.uids.over(name, drawn.image.pixels.as_flattened());
        capture::put(scan, self.structure, name, drawn, &mut set)?;
        self.put(object, instance, &mut set);
        Ok(Some(set.file()?))
    }

    /// The page, which names patient and studies unless a scan is freed of the identity.
    fn page(&self, slices: Option<&Image<3>>, maps: &[(&'static str, Image<3>)]) -> DrawnPage {
        let [stress, rest] = self.scans.each_ref().map(SourceScan::shown);
        comparison_sheet(&ComparisonSheet {
            report: self.report,
            slices,
            maps,
            scans: stress.zip(rest).map(|(stress, rest)| [stress, rest]),
        })
    }

    fn check(&self) -> Result<(), DicomError> {
        self.scans.iter().try_for_each(SourceScan::check)
    }

    fn is_one_study(&self) -> bool {
        self.scans[0].study() == self.scans[1].study()
    }

    fn put(&self, object: ComparisonObject, instance: String, set: &mut DataSet) {
        let facts = object.facts();
        let series = format!("series of {}", facts.name);
        let series = reading::uid(&self.uids, &series, self.reading);
        let what = match object {
            ComparisonObject::Measurements => "measurements of rest and stress",
            _ => facts.description,
        };
        let description = format!("{}: {what}", self.structure.label);
        put_facts(&self.scans[0], &facts, [instance, series], description, set);
    }

    fn groups(&self) -> Vec<DataSet> {
        let (report, label) = (self.report, self.structure.label);
        let (site, whole) = (self.structure.site, readable(report));
        let mut content = self.beginning(&format!("{label}, rest and stress"), None, site);
        content.extend(measured(&whole, FIGURES, Group::Whole));
        content.extend(verdicts(&whole, FIGURES, Group::Whole));
        let flags = report.flags.iter().map(|flag| flag.reason.as_str());
        let comments = [NOISE_COMMENT].into_iter().chain(flags);
        content.extend(comments.map(|said| text("CONTAINS", dcm("121106", "Comment"), said)));
        let mut groups = vec![group("1501", content)];
        for (scan, own, state) in [
            (WhichScan::Stress, &report.stress, Group::Stress),
            (WhichScan::Rest, &report.rest, Group::Rest),
        ] {
            let name = format!("{label} at {scan}");
            let mut content = self.beginning(&name, Some(scan), site);
            let scores = readable(own);
            content.extend(measured(&scores, SCAN_FIGURES, Group::Whole));
            content.extend(measured(&whole, FIGURES, state));
            content.extend(verdicts(&scores, SCAN_FIGURES, Group::Whole));
            content.extend(verdicts(&whole, FIGURES, state));
            content.extend(own.perfusion.iter().flat_map(limits_used));
            let attenuation = own
                .polar
                .as_ref()
                .and_then(|polar| polar.attenuation.as_ref());
            let note = attenuation.map(|it| it.note.as_str());
            content.extend(note.map(|said| text("CONTAINS", dcm("121106", "Comment"), said)));
            groups.push(group("1501", content));
        }
        for territory in &report.territories {
            let name = format!("Territory of {}", territory.name);
            let mut content = self.beginning(&name, None, site);
            let territory = readable(territory);
            content.extend(measured(&territory, TERRITORY_FIGURES, Group::Whole));
            groups.push(group("1501", content));
        }
        for segment in &report.segments {
            let number = segment.segment;
            let site = number.checked_sub(1).and_then(|at| WALL_SEGMENTS.get(at));
            let Some(site) = site else { continue };
            let segment = readable(segment);
            for (state, measured_at) in [
                (Some(WhichScan::Stress), Group::Stress),
                (Some(WhichScan::Rest), Group::Rest),
                (None, Group::Whole),
            ] {
                let figures = measured(&segment, SEGMENT_FIGURES, measured_at);
                if figures.is_empty() {
                    continue;
                }
                let of = state.map_or("change".to_owned(), |scan| scan.to_string());
                let name = format!("Segment {number}, {of}");
                let mut content = self.beginning(&name, state, *site);
                content.extend(figures);
                groups.push(group("1501", content));
            }
        }
        groups
    }

    /// Tracking, finding, the patient's state and the site of a group.
    fn beginning(&self, name: &str, state: Option<WhichScan>, site: Code) -> Vec<DataSet> {
        let mut content = tracking(name, &self.uids.uid(name));
        let finding = dcm("121071", "Finding");
        content.push(concept("CONTAINS", finding, self.structure.kind));
        content.extend(state.map(patient_state));
        content.push(finding_site(site));
        content
    }
}
