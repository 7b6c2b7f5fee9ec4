//! The files of a beat.

use super::error::GatedError;
use super::from_files::GatedHeart;
use super::{names, pictures};
use crate::base::progress::{Cancelled, Monitor, Stage};
use crate::heart::beat::SegmentMotion;
use crate::heart::model::wall::VentricleWall;
use crate::heart::polar::{self, FigureDocument, FigureMap, PolarDocument, PolarMap, WallFigure};
use crate::image::grid::voxelise::{Mask, voxelise};
use crate::image::locate::cup::Cup;
use crate::image::volume::Provenance;
use crate::image::volume::nifti::{self, LabelEntry};
use crate::mesh::TriMesh;
use crate::results::export::animated::{self, Cycle};
use crate::results::export::dicom::{
    BeatEnd, BeatObject, DicomBeat, DicomError, DicomObject, EndWall, Moment, SourceScan, Structure,
};
use crate::results::export::{self, Format, Metadata};
use crate::results::report::{self, BeatPage, BeatReport};
use crate::runs::segmentation::fhir_beside;
use crate::runs::segmentation::{
    NamedFile, SegmentationFilesError, csv_file, json_file, json_line, perfusion_files, svg_file,
};
use serde_json::json;
use std::fmt::Write as _;

/// Length of the animation's cycle where the R-R interval is not known, s.
const UNKNOWN_CYCLE_S: f64 = 1.0;

impl GatedHeart {
    /// `beat.json`, `curve.svg`, `phase.svg`, `gates.csv`, `segments.csv`, polar maps (`polar.svg` and `polar.json`,
    /// also `polar_ed`, `polar_es`, `polar_motion`, `polar_thickening` and `polar_phase`), the meshes of end diastole
    /// and end systole and of every gate in `formats`, `mesh.glb` (the beat as an animation), and every gate's labels
    /// (wall 1, cavity 2) on the grid of the gates.
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
            csv_file("gates.csv", gates_csv(&report)),
            csv_file("segments.csv", segments_csv(&report)),
        ];
        files.extend(self.maps(monitor)?);
        let meshes = &self.meshes;
        let ends = BeatEnd::ALL.map(|end| (names::end_mesh(end).to_owned(), self.gate_at(end)));
        let gates = (0..meshes.len()).map(|gate| (names::gate_mesh(gate + 1), gate));
        let known = self.metadata(&report, monitor)?;
        for (name, gate) in ends.into_iter().chain(gates) {
            for format in formats {
                monitor.check()?;
                let metadata = Metadata {
                    title: format!("Left ventricle, gate {}", gate + 1),
                    ..known.clone()
                };
                files.push(NamedFile {
                    name: format!("{name}.{}", format.extension()),
                    media_type: format.media_type(),
                    bytes: export::encode(*format, &meshes[gate], &metadata)?,
                });
            }
        }
        let cycle = Cycle {
            meshes,
            rest: self.beat.end_diastole.gate,
            seconds: self.rr_ms.map_or(UNKNOWN_CYCLE_S, |ms| ms / 1000.0),
        };
        files.push(NamedFile {
            name: "mesh.glb".into(),
            media_type: Format::Glb.media_type(),
            bytes: animated::encode(&cycle, &known)?,
        });
        for (gate, mesh) in meshes.iter().enumerate() {
            let done = gate as f64 / meshes.len() as f64;
            monitor.report(Stage::Export, done)?;
            files.push(self.labels(gate, mesh, monitor)?);
        }
        monitor.report(Stage::Export, 1.0)?;
        Ok(files)
    }

    /// Polar maps as pictures and as numbers: the uptake of all gates, of end diastole and of end systole, each in
    /// per cent of its own brightest quarter, and motion, thickening and phase.
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
            files.push(json_file(
                &format!("{name}.json"),
                &PolarDocument::from_map(&map),
            ));
        }
        for figure in WallFigure::OF_BEAT {
            monitor.check()?;
            let figure = self.figure_map(map, figure);
            let name = format!("polar_{}", figure.figure.as_str());
            files.push(svg_file(&format!("{name}.svg"), polar::figure_svg(&figure)));
            files.push(json_file(
                &format!("{name}.json"),
                &FigureDocument::from_figure(&figure),
            ));
        }
        if let Some(perfusion) = &self.perfusion {
            monitor.check()?;
            files.extend(perfusion_files(perfusion, map, ""));
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
            WallFigure::Difference | WallFigure::Z | WallFigure::Score => None,
        };
        let of_segment = |segment: &SegmentMotion| match figure {
            WallFigure::Motion => Some(segment.motion_mm),
            WallFigure::Thickening => Some(segment.thickening_percent),
            WallFigure::Phase => segment.phase_degrees,
            WallFigure::Difference | WallFigure::Z | WallFigure::Score => None,
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

    /// The report as a self-contained page; `files` are those of [`GatedHeart::files`]. It names patient, study and
    /// series as far as `scan` does.
    pub fn page(&self, files: &[NamedFile], scan: Option<&Provenance>) -> NamedFile {
        let bytes = |name: &str| {
            let found = files.iter().find(|file| file.name == name);
            found.map(|file| file.bytes.as_slice())
        };
        let picture = |(name, _)| Some((name, bytes(name)?));
        let maps: Vec<(&str, &[u8])> = BeatPage::POLAR_MAPS
            .into_iter()
            .filter_map(picture)
            .collect();
        let page = report::beat_page(&BeatPage {
            report: &self.report(),
            curve: bytes("curve.svg"),
            phase: bytes("phase.svg"),
            maps: &maps,
            meshes: BeatEnd::ALL.map(|end| &self.meshes[self.gate_at(end)]),
            scan,
        });
        NamedFile {
            name: "report.html".into(),
            media_type: "text/html; charset=utf-8",
            bytes: page.into_bytes(),
        }
    }

    /// The description in the meshes' files: parts and uptake are those of the gates' sum, whose nodes they have.
    fn metadata(&self, report: &BeatReport, monitor: &Monitor<'_>) -> Result<Metadata, Cancelled> {
        let scan = self.reading.provenance();
        let figures = json!({
            "edv_ml": report.edv_ml, "esv_ml": report.esv_ml, "ef_percent": report.ef_percent,
        });
        Ok(Metadata {
            frame_of_reference_uid: scan
                .and_then(|scan| scan.frame_of_reference().map(str::to_owned)),
            quality: report::object(&figures),
            parts: self.segmentation.parts(&self.wall.mesh, monitor)?,
            field: self.segmentation.uptake(&self.wall.mesh),
            ..Metadata::new("Left ventricle")
        })
    }

    /// End diastole and end systole as scans with the given identity, each with the images or frames of its gate.
    pub fn scans(&self, identity: &Provenance, made: &Moment) -> [SourceScan; 2] {
        let placed = self.reading.facts.affine_source.is_placed();
        BeatEnd::ALL.map(|end| {
            let gate = self.gate_at(end);
            let volume = &self.reading.gates[gate];
            let known = match self.reading.scans.get(gate) {
                Some(own) => Provenance {
                    series_uid: own.series_uid.clone(),
                    sop_class_uid: own.sop_class_uid.clone(),
                    sop_instance_uid: own.sop_instance_uid.clone(),
                    instance_uids: own.instance_uids.clone(),
                    slice_frames: own.slice_frames.clone(),
                    ..identity.clone()
                },
                None => identity.clone(),
            };
            let frame = volume.frame.clone();
            SourceScan::new(known, frame, volume.shape, placed, made.clone())
        })
    }

    /// Segmentations of both ends and the figures as DICOM objects of `scans`, those of end diastole and end systole
    /// (see [`GatedHeart::scans`]).
    ///
    /// # Errors
    /// See [`DicomError`].
    pub fn dicom_files(&self, scans: &[SourceScan; 2]) -> Result<Vec<NamedFile>, DicomError> {
        let report = self.report();
        let text = json_line(&report);
        let results = DicomBeat::new(self.structure(), scans, &report, &text);
        let wall = |end: BeatEnd| {
            let gate = self.gate_at(end);
            let mesh = self.meshes[gate].clone();
            let [wall, cavity] = self
                .masks(gate, &mesh, &Monitor::silent())
                .expect("a silent monitor is never cancelled");
            EndWall { wall, cavity, mesh }
        };
        let files: Result<Vec<NamedFile>, DicomError> = BeatObject::ALL
            .into_iter()
            .map(|object| {
                let bytes = match object {
                    BeatObject::Mask(end) => results.mask(end, &wall(end)),
                    BeatObject::Measurements => results.measurements(),
                };
                Ok(NamedFile {
                    name: object.file_name().into(),
                    media_type: DicomObject::MEDIA_TYPE,
                    bytes: bytes?,
                })
            })
            .collect();
        let mut files = files?;
        fhir_beside(&mut files)?;
        Ok(files)
    }

    /// The gate at that end, from 0.
    fn gate_at(&self, end: BeatEnd) -> usize {
        end.pick([self.beat.end_diastole.gate, self.beat.end_systole.gate])
    }

    /// The wall as 1 and the cavity as 2 in a gate.
    fn labels(
        &self,
        gate: usize,
        mesh: &TriMesh,
        monitor: &Monitor<'_>,
    ) -> Result<NamedFile, SegmentationFilesError> {
        let volume = &self.reading.gates[gate];
        let [wall, cavity] = self.masks(gate, mesh, monitor)?;
        let labels: Vec<u8> = (wall.voxels.iter().zip(&cavity.voxels))
            .map(|(wall, cavity)| if *wall { 1 } else { 2 * u8::from(*cavity) })
            .collect();
        let segments = self.structure().segments(true);
        let entries: Vec<LabelEntry> = segments.iter().map(|segment| segment.entry).collect();
        let stated = self.reading.stated_grid.as_ref();
        let grid = (volume.shape, &volume.frame);
        let name = names::gate_labels(gate + 1);
        let bytes = nifti::write_labels(&labels, &entries, grid, stated, monitor);
        SegmentationFilesError::nifti(name, bytes)
    }

    fn structure(&self) -> Structure {
        Structure::from_organ(self.parameters.organ.as_str())
    }

    /// Wall and cavity of a gate on the grid of the gates.
    fn masks(
        &self,
        gate: usize,
        mesh: &TriMesh,
        monitor: &Monitor<'_>,
    ) -> Result<[Mask; 2], Cancelled> {
        let volume = &self.reading.gates[gate];
        let wall = voxelise(mesh, volume.shape, &volume.frame, monitor)?;
        let cavity = self.cavity(mesh, &wall, gate, monitor)?;
        Ok([wall, cavity])
    }

    fn cavity(
        &self,
        mesh: &TriMesh,
        wall: &Mask,
        gate: usize,
        monitor: &Monitor<'_>,
    ) -> Result<Mask, Cancelled> {
        let model = &self.segmentation.fit.model;
        let (Some(cup), Some(orientation)) = (&model.cup, &model.patient_orientation) else {
            return Ok(Mask::empty(wall.shape));
        };
        let cup: &Cup = cup;
        let seen = VentricleWall::new(mesh, cup, &orientation.superior, monitor)?;
        seen.cavity(wall, &self.reading.gates[gate].frame, monitor)
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
