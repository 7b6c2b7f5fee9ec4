//! The files of a comparison.

use super::hearts::{ComparedHeart, ComparedHearts};
use super::{names, report as written, slices};
use crate::base::progress::{Monitor, Stage};
use crate::heart::comparison::{Verdict, WhichScan};
use crate::heart::polar::{FigureMap, PolarMap, WallFigure};
use crate::image::volume::Provenance;
use crate::parameters::ComparisonParameters;
use crate::results::export::dicom::{
    ComparisonObject, DicomComparison, DicomError, DicomObject, SourceScan, Structure,
};
use crate::results::export::{self, Format};
use crate::results::report::{self, ComparisonPage, ComparisonReport};
use crate::runs::segmentation::fhir_beside;
use crate::runs::segmentation::{
    NamedFile, SegmentationFilesError, csv_file, figure_files, json_file, json_line,
    perfusion_files, png_file, region_file, uptake_files,
};
use std::fmt::Write as _;

impl ComparedHearts {
    /// The report.
    pub fn report(&self) -> ComparisonReport {
        let parameters = ComparisonParameters {
            fit: self.parameters.clone(),
            choice: self.choice.clone(),
        };
        written::comparison_report(self, parameters.to_json())
    }

    /// `comparison.json`, `segments.csv`; polar maps as pictures and numbers: `polar_stress` and `polar_rest`, each by
    /// its own reference, `polar_difference`, and with normal limits z and scores of both; of each scan the wall in
    /// `formats` (`mesh_stress`, `mesh_rest`) and the image about the heart (`region_stress`, `region_rest`); slices of
    /// stress above those of rest (`slices.png`).
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
            json_file("comparison.json", &report),
            csv_file("segments.csv", segments_csv(&report)),
        ];
        for (scan, heart) in self.hearts() {
            monitor.check()?;
            files.extend(maps_of(scan, heart));
        }
        if let Some(map) = self.rest.map() {
            files.extend(figure_files("polar_difference", &self.difference(map)));
        }
        files.extend(slices::png(self, monitor)?.map(|png| png_file("slices.png", png)));
        monitor.report(Stage::Export, 0.5)?;
        for (scan, heart) in self.hearts() {
            let mesh = heart.mesh();
            let metadata = heart.metadata(format!("Left ventricle at {scan}"), monitor)?;
            for format in formats {
                monitor.check()?;
                files.push(NamedFile {
                    name: format!("{}.{}", names::mesh(scan), format.extension()),
                    media_type: format.media_type(),
                    bytes: export::encode(*format, mesh, &metadata)?,
                });
            }
            files.push(region_file(
                &names::region(scan),
                heart.image(),
                mesh,
                monitor,
            )?);
        }
        monitor.report(Stage::Export, 1.0)?;
        Ok(files)
    }

    /// The report as a self-contained page; `files` are those of [`ComparedHearts::files`]. It names patient, study and
    /// series of the scan at stress as far as `scan` does.
    pub fn page(&self, files: &[NamedFile], scan: Option<&Provenance>) -> NamedFile {
        let picture = |(name, _)| Some((name, content(files, name)?));
        let maps: Vec<(&str, &[u8])> = (ComparisonPage::POLAR_MAPS.into_iter())
            .filter_map(picture)
            .collect();
        let page = report::comparison_page(&ComparisonPage {
            report: &self.report(),
            slices: content(files, "slices.png"),
            maps: &maps,
            scan,
        });
        NamedFile {
            name: "report.html".into(),
            media_type: "text/html; charset=utf-8",
            bytes: page.into_bytes(),
        }
    }

    /// The figures and the pictures among `files`, which are those of [`ComparedHearts::files`], as DICOM objects of
    /// `scans`: that at stress and that at rest (see [`ComparedHeart::scan`]).
    ///
    /// # Errors
    /// See [`DicomError`].
    pub fn dicom_files(
        &self,
        scans: &[SourceScan; 2],
        files: &[NamedFile],
    ) -> Result<Vec<NamedFile>, DicomError> {
        let report = self.report();
        let text = json_line(&report);
        let structure = Structure::from_organ("left_ventricle");
        let results = DicomComparison::new(structure, scans, &report, &text);
        let mut objects = Vec::new();
        for object in ComparisonObject::ALL {
            let pictures = object.pictures().iter();
            let pictures: Vec<(&str, &[u8])> = pictures
                .filter_map(|name| Some((*name, content(files, name)?)))
                .collect();
            let bytes = match object {
                ComparisonObject::Measurements => Some(results.measurements()?),
                _ => results.picture(object, &pictures)?,
            };
            let Some(bytes) = bytes else { continue };
            objects.push(NamedFile {
                name: object.file_name().into(),
                media_type: DicomObject::MEDIA_TYPE,
                bytes,
            });
        }
        fhir_beside(&mut objects)?;
        Ok(objects)
    }

    fn hearts(&self) -> [(WhichScan, &ComparedHeart); 2] {
        [
            (WhichScan::Stress, &self.stress),
            (WhichScan::Rest, &self.rest),
        ]
    }

    fn difference<'a>(&self, map: &'a PolarMap) -> FigureMap<'a> {
        FigureMap {
            map,
            figure: WallFigure::Difference,
            values: self.change.difference_points.clone(),
            segments: self
                .change
                .segments
                .map(|own| own.figures.difference_points),
        }
    }
}

/// The content of the file of that name.
fn content<'a>(files: &'a [NamedFile], name: &str) -> Option<&'a [u8]> {
    let found = files.iter().find(|file| file.name == name);
    found.map(|file| file.bytes.as_slice())
}

/// Uptake, z and scores of one scan.
fn maps_of(scan: WhichScan, heart: &ComparedHeart) -> Vec<NamedFile> {
    let Some(map) = heart.map() else {
        return Vec::new();
    };
    let scan = scan.as_str();
    let mut files = uptake_files(&format!("polar_{scan}"), map);
    if let Some(perfusion) = heart.perfusion() {
        files.extend(perfusion_files(perfusion, map, &format!("_{scan}")));
    }
    files
}

fn segments_csv(report: &ComparisonReport) -> String {
    let mut text = String::from(
        "segment,name,stress_percent,rest_percent,difference_points,reversible_percent,fixed_percent,\
         stress_score,rest_score,motion_change_mm,motion_changed,thickening_change_points,thickening_changed\n",
    );
    let known = |figure: Option<f64>| figure.map_or_else(String::new, |figure| figure.to_string());
    let score = |score: Option<u8>| known(score.map(f64::from));
    let verdict = |verdict: Option<Verdict>| verdict.map_or("", Verdict::as_str);
    for segment in &report.segments {
        let uptake = &segment.uptake;
        // Writing into a String cannot fail.
        let _ = writeln!(
            text,
            "{},\"{}\",{},{},{},{},{},{},{},{},{},{},{}",
            segment.segment,
            segment.name,
            known(uptake.stress_percent),
            known(uptake.rest_percent),
            known(uptake.difference_points),
            uptake.reversible_percent,
            uptake.fixed_percent,
            score(segment.stress_score),
            score(segment.rest_score),
            known(segment.motion_change_mm),
            verdict(segment.motion_change_verdict),
            known(segment.thickening_change_points),
            verdict(segment.thickening_change_verdict)
        );
    }
    text
}
