//! The scans in files that are not one volume, for an error that lists them: by name, series, and what differs.

use super::ScannedFile;
use super::one_scan::{ScanStatement, differing};
use crate::image::grid::gates::GATE_COUNTS;
use std::collections::{BTreeMap, BTreeSet};
use ventriform_dicom::read::attributes::{SERIES_DESCRIPTION, SERIES_NUMBER, SERIES_UID, clip};

/// Most scans that are listed.
const MOST_LISTED: usize = 8;

/// Most attributes that are said of each scan.
const MOST_DIFFERENCES: usize = 4;

/// A scan that could be read alone.
struct Listed {
    /// The file and what it is, if the scan is one file.
    file: Option<(String, &'static str)>,
    uid: String,
    number: Option<String>,
    description: Option<String>,
    files: usize,
    statement: ScanStatement,
}

/// The scans found so far.
#[derive(Default)]
pub(super) struct Scans {
    /// Series of slices by their UID.
    series: BTreeMap<String, Listed>,
    /// Files that are a volume each.
    whole: Vec<Listed>,
}

impl Scans {
    /// Counts a file to its scan: it is a `whole` volume, or a slice of its series.
    pub(super) fn add(&mut self, scanned: &ScannedFile, statement: &ScanStatement, whole: bool) {
        let a = &scanned.scan.attributes;
        let uid = a.text(SERIES_UID).unwrap_or_default();
        let own = Listed {
            file: whole.then(|| (a.file.clone(), scanned.scan.kind.noun())),
            uid: uid.clone(),
            number: a.text(SERIES_NUMBER),
            description: a.prose(SERIES_DESCRIPTION),
            files: 1,
            statement: statement.clone(),
        };
        if whole {
            self.whole.push(own);
            return;
        }
        // The least, whatever the order of the files.
        let least = |known: &mut Option<String>, given: Option<String>| {
            if known.is_none() || given.is_some() && given < *known {
                *known = given;
            }
        };
        match self.series.get_mut(&uid) {
            None => {
                self.series.insert(uid, own);
            }
            Some(known) => {
                least(&mut known.number, own.number);
                least(&mut known.description, own.description);
                known.files += 1;
            }
        }
    }

    /// Series of slices.
    pub(super) fn series(&self) -> usize {
        self.series.len()
    }

    /// Files that are a volume each.
    pub(super) fn whole(&self) -> usize {
        self.whole.len()
    }

    /// The scans, and how to choose one.
    pub(super) fn listed(&self) -> String {
        let mut whole: Vec<&Listed> = self.whole.iter().collect();
        whole.sort_by(|a, b| (&a.file, &a.uid).cmp(&(&b.file, &b.uid)));
        let all: Vec<&Listed> = whole.iter().copied().chain(self.series.values()).collect();
        let statements: Vec<&ScanStatement> = all.iter().map(|scan| &scan.statement).collect();
        let differences = differing(&statements, MOST_DIFFERENCES);
        let each = all.iter().zip(&differences).take(MOST_LISTED);
        let mut list: Vec<String> = each.map(|(scan, differs)| scan.text(differs)).collect();
        if let Some(more) = all.len().checked_sub(MOST_LISTED).filter(|more| *more > 0) {
            list.push(format!("and {more} more"));
        }
        let list = list.join(", ");
        match (whole.len(), self.series.len()) {
            (0, series) => {
                format!(
                    "they belong to {series} series: {list}; send the files of one of them alone"
                )
            }
            (whole, 0) if GATE_COUNTS.contains(&whole) => format!(
                "they are {whole} scans, of which each file is a volume of its own, since they do not all say that \
                 they are gates of one heart beat (Image Type RECON GATED TOMO, or a Trigger Time (0018,1060)): \
                 {list}; send one of them alone"
            ),
            (whole, 0) => format!(
                "they are {whole} scans, of which each file is a volume of its own: {list}; send one of them alone"
            ),
            (whole, series) => {
                let whole = match whole {
                    1 => "one file is a volume of its own".to_owned(),
                    whole => format!("{whole} files are each a volume of its own"),
                };
                let slices = match series {
                    1 => "the others are slices of a series".to_owned(),
                    series => format!("the others are slices of {series} series"),
                };
                let uids: BTreeSet<&str> = all.iter().map(|scan| &*scan.uid).collect();
                let although = match uids.len() {
                    1 => ", although all have one Series Instance UID (0020,000E)",
                    _ => "",
                };
                format!("{whole} and {slices}{although}: {list}; send one of them alone")
            }
        }
    }
}

impl Listed {
    fn text(&self, differs: &str) -> String {
        let number = self.number.as_deref().map(clip);
        let number = number.map_or_else(|| "without number".into(), |n| format!("number {n}"));
        let described = self.description.as_deref().map(clip);
        let described = described.map_or_else(String::new, |text| format!(" \"{text}\""));
        let differs = match differs {
            "" => String::new(),
            differs => format!("; {differs}"),
        };
        let uid = clip(&self.uid);
        match &self.file {
            Some((file, what)) => {
                format!("{file} ({what}): series {number}{described} (UID {uid}{differs})")
            }
            None => format!(
                "{number}{described} (UID {uid}, {} files{differs})",
                self.files
            ),
        }
    }
}
