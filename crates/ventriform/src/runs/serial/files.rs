//! The files of a serial comparison.

use super::hearts::{SerialHearts, SerialPair};
use super::order::SCAN_COUNTS;
use super::{names, trend};
use crate::base::progress::{Monitor, Stage};
use crate::heart::polar::{FigureMap, WallFigure};
use crate::image::volume::Provenance;
use crate::results::export::dicom::{DicomError, DicomObject, DicomSerial, SourceScan, Structure};
use crate::results::export::{self, Format};
use crate::results::figures::readable;
use crate::results::figures::serial::{SCAN_FIGURES, SEGMENT_FIGURES};
use crate::results::report::{self, SerialPage, SerialReport};
use crate::runs::segmentation::fhir_beside;
use crate::runs::segmentation::{
    NamedFile, SegmentationFilesError, csv_file, figure_files, json_file, json_line, region_file,
    svg_file, uptake_files,
};
use std::fmt::Write as _;

impl SerialHearts {
    /// `serial.json`, `figures.csv` (figures by date), `changes.csv`, `segments.csv`, `trend.svg`; of every scan its polar
    /// map (`polar_scan01`), the wall in `formats` (`mesh_scan01`) and the image about the heart; of every pair the map of
    /// the change (`polar_change_01_02`).
    ///
    /// # Errors
    /// [`SegmentationFilesError`].
    pub fn files(
        &self,
        formats: &[Format],
        monitor: &Monitor<'_>,
    ) -> Result<Vec<NamedFile>, SegmentationFilesError> {
        monitor.report(Stage::Export, 0.0)?;
        let report = self.report();
        let mut files = vec![
            json_file("serial.json", &report),
            csv_file("figures.csv", figures_csv(&report)),
            csv_file("changes.csv", changes_csv(&report)),
            csv_file("segments.csv", segments_csv(&report)),
        ];
        files.extend(trend::picture(&report).map(|svg| svg_file("trend.svg", svg)));
        for pair in &self.pairs {
            monitor.check()?;
            files.extend(self.change_files(pair));
        }
        for (place, scan) in self.scans.iter().enumerate() {
            let (heart, number) = (&scan.heart, place + 1);
            monitor.report(Stage::Export, place as f64 / self.scans.len() as f64)?;
            if let Some(map) = heart.map() {
                files.extend(uptake_files(&names::polar_of(number), map));
            }
            let mesh = heart.mesh();
            let title = format!("Left ventricle, scan {number}");
            let metadata = heart.metadata(title, monitor)?;
            for format in formats {
                monitor.check()?;
                files.push(NamedFile {
                    name: format!("{}.{}", names::mesh_of(number), format.extension()),
                    media_type: format.media_type(),
                    bytes: export::encode(*format, mesh, &metadata)?,
                });
            }
            let region = names::region_of(number);
            files.push(region_file(&region, heart.image(), mesh, monitor)?);
        }
        monitor.report(Stage::Export, 1.0)?;
        Ok(files)
    }

    /// The map of the change of a pair.
    fn change_files(&self, pair: &SerialPair) -> Vec<NamedFile> {
        let Some(map) = self.scans[pair.earlier].heart.map() else {
            return Vec::new();
        };
        let change = FigureMap {
            map,
            figure: WallFigure::Difference,
            values: pair.change.difference_points.clone(),
            segments: (pair.change.segments).map(|own| own.figures.difference_points),
        };
        let name = names::change_of([pair.earlier + 1, pair.later + 1]);
        figure_files(&name, &change).into()
    }

    /// The report as a self-contained page; `files` are those of [`SerialHearts::files`]. It names patient, study and series
    /// of the first scan as far as `scan` does.
    pub fn page(&self, files: &[NamedFile], scan: Option<&Provenance>) -> NamedFile {
        let report = self.report();
        let page = report::serial_page(&SerialPage {
            report: &report,
            trend: content(files, "trend.svg"),
            maps: &maps_of(&report, |name| content(files, name)),
            scan,
        });
        NamedFile {
            name: "report.html".into(),
            media_type: "text/html; charset=utf-8",
            bytes: page.into_bytes(),
        }
    }
}

impl SerialHearts {
    /// The figures as a DICOM structured report of `scans`, which stand in the order of the report
    /// ([`ComparedHeart::scan`](crate::runs::rest_stress::ComparedHeart::scan)).
    ///
    /// # Errors
    /// See [`DicomError`].
    pub fn dicom_files(&self, scans: &[SourceScan]) -> Result<Vec<NamedFile>, DicomError> {
        let report = self.report();
        let text = json_line(&report);
        let structure = Structure::from_organ("left_ventricle");
        let made = DicomSerial::new(structure, scans, &report, &text).measurements()?;
        let file = |bytes| NamedFile {
            name: DicomObject::Measurements.file_name().into(),
            media_type: DicomObject::MEDIA_TYPE,
            bytes,
        };
        let mut files = made.map(file).into_iter().collect();
        fhir_beside(&mut files)?;
        Ok(files)
    }
}

/// The files of which a page is made: report, trend, and every polar map that there may be.
pub fn page_files() -> Vec<String> {
    let most = *SCAN_COUNTS.end();
    let scans = (1..=most).map(names::polar_of);
    let from_first = (2..=most).map(|later| names::change_of([1, later]));
    let from_former = (3..=most).map(|later| names::change_of([later - 1, later]));
    let maps = scans.chain(from_first).chain(from_former);
    ["serial.json", "trend.svg"]
        .map(str::to_owned)
        .into_iter()
        .chain(maps.map(|name| format!("{name}.svg")))
        .collect()
}

/// The polar maps of a report, each with its title: of every scan, and of every pair.
pub fn maps_of<'a>(
    report: &SerialReport,
    content: impl Fn(&str) -> Option<&'a [u8]>,
) -> Vec<(String, &'a [u8])> {
    let scans = report.scans.iter().map(|scan| {
        let title = format!("Scan {}", scan.number);
        (title, names::polar_of(scan.number))
    });
    let pairs = report.pairs.iter().map(|pair| {
        let title = format!("Scan {} less scan {}", pair.earlier, pair.later);
        (title, names::change_of([pair.earlier, pair.later]))
    });
    scans
        .chain(pairs)
        .filter_map(|(title, name)| Some((title, content(&format!("{name}.svg"))?)))
        .collect()
}

/// The content of the file of that name.
fn content<'a>(files: &'a [NamedFile], name: &str) -> Option<&'a [u8]> {
    let found = files.iter().find(|file| file.name == name);
    found.map(|file| file.bytes.as_slice())
}

fn known(figure: Option<f64>) -> String {
    figure.map_or_else(String::new, |figure| figure.to_string())
}

/// A row a scan, a column a figure.
fn figures_csv(report: &SerialReport) -> String {
    let mut text = String::from("scan,date");
    for row in SCAN_FIGURES {
        text.push(',');
        text.push_str(row.place);
    }
    text.push('\n');
    for scan in &report.scans {
        let values = readable(scan);
        let date = scan.date.as_deref().unwrap_or_default();
        // Writing into a String cannot fail.
        let _ = write!(text, "{},\"{}\"", scan.number, date.replace('"', "\"\""));
        for row in SCAN_FIGURES {
            let _ = write!(text, ",{}", known(row.value(&values)));
        }
        text.push('\n');
    }
    text
}

/// A row a change.
fn changes_csv(report: &SerialReport) -> String {
    let mut text = String::from(
        "earlier,later,figure,unit,change,interval_low,interval_high,changed,least_change\n",
    );
    for own in &report.changes {
        let row = SCAN_FIGURES.iter().find(|row| row.place == own.figure);
        let unit = row.map_or("", |row| row.unit.symbol);
        let [low, high] = own.interval;
        let changed = own.verdict.as_str();
        let _ = writeln!(
            text,
            "{},{},{},{unit},{},{low},{high},{changed},{}",
            own.earlier, own.later, own.figure, own.change, own.least_change
        );
    }
    for pair in &report.pairs {
        let shares = [
            (
                "worse_percent",
                pair.worse_percent,
                pair.worse_interval_percent,
                pair.worse_verdict,
            ),
            (
                "better_percent",
                pair.better_percent,
                pair.better_interval_percent,
                pair.better_verdict,
            ),
        ];
        for (figure, value, [low, high], verdict) in shares {
            let changed = verdict.as_str();
            let _ = writeln!(
                text,
                "{},{},{figure},%,{value},{low},{high},{changed},{}",
                pair.earlier, pair.later, pair.detectable_percent
            );
        }
    }
    text
}

/// A row a segment of a pair.
fn segments_csv(report: &SerialReport) -> String {
    let mut text = String::from("earlier,later,segment,name");
    for row in SEGMENT_FIGURES {
        text.push(',');
        text.push_str(row.place);
    }
    text.push_str(",change_interval_low,change_interval_high,changed\n");
    for pair in &report.pairs {
        for segment in &pair.segments {
            let values = readable(segment);
            let _ = write!(
                text,
                "{},{},{},\"{}\"",
                pair.earlier, pair.later, segment.segment, segment.name
            );
            for row in SEGMENT_FIGURES {
                let _ = write!(text, ",{}", known(row.value(&values)));
            }
            let [low, high] = match segment.change_interval_points {
                Some(ends) => ends.map(|end| known(Some(end))),
                None => [String::new(), String::new()],
            };
            let changed = segment
                .change_verdict
                .map_or("", |verdict| verdict.as_str());
            let _ = writeln!(text, ",{low},{high},{changed}");
        }
    }
    text
}
