//! The files of a comparison.

use super::hearts::ComparedHearts;
use super::report;
use crate::parameters::ComparisonParameters;
use crate::polar::{self, FigureDocument, FigureMap, PolarDocument, PolarMap, WallFigure};
use crate::progress::{Monitor, Stage};
use crate::report::ComparisonReport;
use crate::segmentation::{NamedFile, SegmentationFilesError, json_file};
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
            NamedFile {
                name: "segments.csv".into(),
                media_type: "text/csv; charset=utf-8",
                bytes: segments_csv(&report).into_bytes(),
            },
        ];
        let maps = [
            ("polar_stress", self.stress.map()),
            ("polar_rest", self.rest.map()),
        ];
        for (name, map) in maps
            .into_iter()
            .filter_map(|(name, map)| Some((name, map?)))
        {
            monitor.check()?;
            files.push(NamedFile {
                name: format!("{name}.svg"),
                media_type: "image/svg+xml",
                bytes: polar::svg(map).into_bytes(),
            });
            files.push(NamedFile {
                name: format!("{name}.png"),
                media_type: "image/png",
                bytes: polar::png(map),
            });
            files.push(json_file(&format!("{name}.json"), &PolarDocument::of(map)));
        }
        if let Some(map) = self.rest.map() {
            let figure = self.difference(map);
            files.push(NamedFile {
                name: "polar_difference.svg".into(),
                media_type: "image/svg+xml",
                bytes: polar::figure_svg(&figure).into_bytes(),
            });
            files.push(json_file(
                "polar_difference.json",
                &FigureDocument::of(&figure),
            ));
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
