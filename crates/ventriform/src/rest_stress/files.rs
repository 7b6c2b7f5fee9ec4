//! The files of a comparison.

use super::hearts::ComparedHearts;
use super::report;
use crate::parameters::ComparisonParameters;
use crate::polar::{self, FigureDocument, FigureMap, PolarMap, WallFigure};
use crate::progress::{Monitor, Stage};
use crate::report::ComparisonReport;
use crate::segmentation::{
    NamedFile, SegmentationFilesError, csv_file, json_file, svg_file, uptake_files,
};
use std::fmt::Write as _;

impl ComparedHearts {
    /// The report.
    pub fn report(&self) -> ComparisonReport {
        let parameters = ComparisonParameters {
            fit: self.parameters.clone(),
            choice: self.choice,
        };
        report::of(self, parameters.to_json())
    }

    /// `comparison.json`, `segments.csv` and polar maps as pictures and numbers: `polar_stress` and `polar_rest`,
    /// each by its own reference, and `polar_difference`.
    ///
    /// # Errors
    /// [`SegmentationFilesError`].
    pub fn files(&self, monitor: &Monitor<'_>) -> Result<Vec<NamedFile>, SegmentationFilesError> {
        monitor.report(Stage::Export, 0.0)?;
        let report = self.report();
        let mut files = vec![
            json_file("comparison.json", &report),
            csv_file("segments.csv", segments_csv(&report)),
        ];
        let maps = [
            ("polar_stress", self.stress.map()),
            ("polar_rest", self.rest.map()),
        ];
        for (name, map) in maps {
            monitor.check()?;
            files.extend(map.into_iter().flat_map(|map| uptake_files(name, map)));
        }
        if let Some(map) = self.rest.map() {
            let figure = self.difference(map);
            let document = FigureDocument::of(&figure);
            files.push(svg_file("polar_difference.svg", polar::figure_svg(&figure)));
            files.push(json_file("polar_difference.json", &document));
        }
        monitor.report(Stage::Export, 1.0)?;
        Ok(files)
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

fn segments_csv(report: &ComparisonReport) -> String {
    let mut text = String::from(
        "segment,name,stress_percent,rest_percent,difference_points,reversible_percent,fixed_percent\n",
    );
    let known = |figure: Option<f64>| figure.map_or_else(String::new, |figure| figure.to_string());
    for segment in &report.segments {
        let uptake = &segment.uptake;
        // Writing into a String cannot fail.
        let _ = writeln!(
            text,
            "{},\"{}\",{},{},{},{},{}",
            segment.segment,
            segment.name,
            known(uptake.stress_percent),
            known(uptake.rest_percent),
            known(uptake.difference_points),
            uptake.reversible_percent,
            uptake.fixed_percent
        );
    }
    text
}
