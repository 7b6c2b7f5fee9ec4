//! The files of a beat.

use super::error::GatedError;
use super::from_files::GatedHeart;
use super::pictures;
use crate::beat::SegmentMotion;
use crate::export::dicom::Structure;
use crate::export::{self, Format, Metadata};
use crate::grid::voxelise::{Mask, voxelise};
use crate::locate::cup::Cup;
use crate::mesh::TriMesh;
use crate::model::wall::VentricleWall;
use crate::polar::{self, FigureDocument, FigureMap, PolarDocument, PolarMap, WallFigure};
use crate::progress::{Monitor, Stage};
use crate::report::BeatReport;
use crate::segmentation::{NamedFile, SegmentationFilesError, json_file};
use crate::volume::nifti::{self, LabelEntry};
use std::fmt::Write as _;

impl GatedHeart {
    /// `beat.json`, `curve.svg`, `phase.svg`, `gates.csv`, `segments.csv`, polar maps (`polar.svg` and `polar.json`, also
    /// `polar_ed`, `polar_es`, `polar_motion`, `polar_thickening` and `polar_phase`), the meshes of end diastole and end systole and
    /// of every gate in `formats`, and every gate's labels (wall 1, cavity 2) on the grid of the gates.
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
            json_file("beat.json", &report),
            svg_file("curve.svg", pictures::curve(&report)),
            svg_file("phase.svg", pictures::phase(&report)),
            text_file("gates.csv", "text/csv; charset=utf-8", gates_csv(&report)),
            text_file(
                "segments.csv",
                "text/csv; charset=utf-8",
                segments_csv(&report),
            ),
        ];
        files.extend(self.maps(monitor)?);
        let meshes = self.beat.fit.carried(&self.wall.mesh, &self.wall.wall);
        let ends = [
            ("mesh_ed".to_owned(), self.beat.end_diastole.gate),
            ("mesh_es".to_owned(), self.beat.end_systole.gate),
        ];
        let gates = (0..meshes.len()).map(|gate| (format!("mesh_gate{:02}", gate + 1), gate));
        for (name, gate) in ends.into_iter().chain(gates) {
            for format in formats {
                monitor.check()?;
                let metadata = Metadata::new(format!("Left ventricle, gate {}", gate + 1));
                files.push(NamedFile {
                    name: format!("{name}.{}", format.extension()),
                    media_type: format.media_type(),
                    bytes: export::encode(*format, &meshes[gate], &metadata)?,
                });
            }
        }
        for (gate, mesh) in meshes.iter().enumerate() {
            let done = gate as f64 / meshes.len() as f64;
            monitor.report(Stage::Export, done)?;
            files.push(self.labels(gate, mesh, monitor)?);
        }
        monitor.report(Stage::Export, 1.0)?;
        Ok(files)
    }

    /// Polar maps as pictures and as numbers: the uptake of all gates, of end diastole and of end systole, each in per cent
    /// of its own brightest quarter, and motion, thickening and phase.
    fn maps(&self, monitor: &Monitor<'_>) -> Result<Vec<NamedFile>, SegmentationFilesError> {
        let Some(map) = &self.segmentation.polar else {
            return Ok(Vec::new());
        };
        let beat = &self.beat;
        let at = |turns: f64| map.with_largest(&beat.counts.at(turns));
        let mut files = Vec::new();
        for (name, map) in [
            ("polar", map.clone()),
            ("polar_ed", at(beat.end_diastole.turns)),
            ("polar_es", at(beat.end_systole.turns)),
        ] {
            monitor.check()?;
            files.push(svg_file(&format!("{name}.svg"), polar::svg(&map)));
            files.push(json_file(&format!("{name}.json"), &PolarDocument::of(&map)));
        }
        for figure in WallFigure::ALL {
            monitor.check()?;
            let figure = self.figure_map(map, figure);
            let name = format!("polar_{}", figure.figure.as_str());
            files.push(svg_file(&format!("{name}.svg"), polar::figure_svg(&figure)));
            files.push(json_file(
                &format!("{name}.json"),
                &FigureDocument::of(&figure),
            ));
        }
        Ok(files)
    }

    fn figure_map<'a>(&self, map: &'a PolarMap, figure: WallFigure) -> FigureMap<'a> {
        let beat = &self.beat;
        let contraction = &beat.contraction;
        let on_wall = |ray: usize| contraction.areas[ray] > 0.0 && map.pixels[ray].is_some();
        let of_ray = |ray: usize| match figure {
            WallFigure::Motion => Some(contraction.motion_mm[ray]),
            WallFigure::Thickening => Some(contraction.thickening_percent[ray]),
            WallFigure::Phase => beat.phases.degrees[ray],
        };
        let of_segment = |segment: &SegmentMotion| match figure {
            WallFigure::Motion => Some(segment.motion_mm),
            WallFigure::Thickening => Some(segment.thickening_percent),
            WallFigure::Phase => segment.phase_degrees,
        };
        FigureMap {
            map,
            figure,
            values: (0..map.pixels.len())
                .map(|ray| of_ray(ray).filter(|_| on_wall(ray)))
                .collect(),
            segments: std::array::from_fn(|index| {
                let mut segments = beat.segments.iter();
                segments
                    .find(|segment| segment.segment == index + 1)
                    .and_then(of_segment)
            }),
        }
    }

    /// The wall as 1 and the cavity as 2 in a gate.
    fn labels(
        &self,
        gate: usize,
        mesh: &TriMesh,
        monitor: &Monitor<'_>,
    ) -> Result<NamedFile, SegmentationFilesError> {
        let volume = &self.reading.gates[gate];
        let wall = voxelise(mesh, volume.shape, &volume.frame);
        let cavity = self.cavity(mesh, &wall, gate, monitor)?;
        let labels: Vec<u8> = (wall.voxels.iter().zip(&cavity.voxels))
            .map(|(wall, cavity)| if *wall { 1 } else { 2 * u8::from(*cavity) })
            .collect();
        let segments = Structure::of(self.parameters.organ.as_str()).segments(true);
        let entries: Vec<LabelEntry> = segments.iter().map(|segment| segment.entry).collect();
        let stated = self.reading.stated_grid.as_ref();
        let grid = (volume.shape, &volume.frame);
        let name = format!("labels_gate{:02}.nii.gz", gate + 1);
        let bytes = nifti::write_labels(&labels, &entries, grid, stated, monitor);
        SegmentationFilesError::nifti(name, bytes)
    }

    fn cavity(
        &self,
        mesh: &TriMesh,
        wall: &Mask,
        gate: usize,
        monitor: &Monitor<'_>,
    ) -> Result<Mask, SegmentationFilesError> {
        let model = &self.segmentation.fit.model;
        let (Some(cup), Some(orientation)) = (&model.cup, &model.patient_orientation) else {
            return Ok(Mask::empty(wall.shape));
        };
        let cup: &Cup = cup;
        let seen = VentricleWall::new(mesh, cup, &orientation.superior, monitor)?;
        Ok(seen.cavity(wall, &self.reading.gates[gate].frame, monitor)?)
    }
}

fn svg_file(name: &str, text: String) -> NamedFile {
    text_file(name, "image/svg+xml", text)
}

fn text_file(name: &str, media_type: &'static str, text: String) -> NamedFile {
    NamedFile {
        name: name.to_owned(),
        media_type,
        bytes: text.into_bytes(),
    }
}

fn gates_csv(report: &BeatReport) -> String {
    let mut text = String::from("gate,cavity_ml,wall_ml,counts_factor\n");
    for gate in &report.gates {
        // Writing into a String cannot fail.
        let _ = writeln!(
            text,
            "{},{},{},{}",
            gate.gate, gate.cavity_ml, gate.wall_ml, gate.counts_factor
        );
    }
    text
}

fn segments_csv(report: &BeatReport) -> String {
    let mut text = String::from(
        "segment,name,motion_mm,thickening_percent,thickening_counts_percent,phase_degrees\n",
    );
    for segment in &report.segments {
        let known = |figure: Option<f64>| figure.map(|figure| figure.to_string());
        let _ = writeln!(
            text,
            "{},\"{}\",{},{},{},{}",
            segment.segment,
            segment.name,
            segment.motion_mm,
            segment.thickening_percent,
            known(segment.thickening_counts_percent).unwrap_or_default(),
            known(segment.phase_degrees).unwrap_or_default()
        );
    }
    text
}

impl From<SegmentationFilesError> for GatedError {
    fn from(error: SegmentationFilesError) -> Self {
        match error {
            SegmentationFilesError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            error => Self::Files(error),
        }
    }
}
