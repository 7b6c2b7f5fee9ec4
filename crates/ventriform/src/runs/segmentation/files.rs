//! The files of a segmentation.

use super::cavity::cavity;
use super::from_files::{ExpertFacts, SegmentedVolume};
use super::mask_place::MaskPlace;
use super::region::region;
use super::segment::Segmentation;
use crate::base::progress::{Cancelled, Monitor, Stage};
use crate::heart::deform::WallEdge;
use crate::heart::model::wall_parts;
use crate::heart::normals::{Perfusion, SegmentPerfusion};
use crate::heart::polar::{self, FigureDocument, FigureMap, PolarDocument, PolarMap, WallFigure};
use crate::image::grid::voxelise::Mask;
use crate::image::volume::Provenance;
use crate::image::volume::nifti::{self, LabelEntry, MaskError, StoredType};
use crate::image::volume::{Reading, Volume};
use crate::mesh::TriMesh;
use crate::mesh::part::Part;
use crate::results::export::dicom::{
    DicomError, DicomObject, DicomResults, Moment, SourceScan, Structure,
};
use crate::results::export::fhir;
use crate::results::export::open_part::open_part;
use crate::results::export::{self, ExportError, Format, Metadata, VertexField, seg_nrrd};
use crate::results::report::{self, SegmentationPage, SegmentationSummary};
use serde::Serialize;

/// The mask of the wall that was asked for.
const MASK_FILE: &str = "mask.nii.gz";
/// The mask of the anatomical wall, where `mask.nii.gz` shows the apparent one.
const ANATOMICAL_MASK: &str = "mask_anatomical.nii.gz";
/// The mask of the apparent wall, where `mask.nii.gz` shows the anatomical one.
const APPARENT_MASK: &str = "mask_apparent.nii.gz";
/// The wall as 1 and the cavity as 2.
const LABELS_FILE: &str = "labels.nii.gz";
/// The same for 3D Slicer.
const SEGMENTS_FILE: &str = "labels.seg.nrrd";
/// Views, sinogram and linogram of the projections that the slices were reconstructed of.
const PROJECTIONS_FILE: &str = "projections.png";
/// The scan about the organ, which the page shows.
const REGION_FILE: &str = "region.nii.gz";

/// One file of a segmentation.
#[derive(Debug, Clone)]
pub struct NamedFile {
    /// `mask.nii.gz`, `mesh.glb`, `report.json`, `polar.svg` ...
    pub name: String,
    /// Its media type.
    pub media_type: &'static str,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// Why a segmentation cannot be written as files.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SegmentationFilesError {
    /// A mesh format cannot hold the mesh.
    #[error(transparent)]
    Mesh(#[from] ExportError),
    /// The mask or the polar map cannot be written.
    #[error("{what}: {reason}")]
    Other {
        /// The file.
        what: &'static str,
        /// Why.
        reason: String,
    },
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl SegmentedVolume {
    /// Mask and labels on the input's grid, or at right angles if the parameters say so, the mesh in `formats`, the
    /// report, slices, the scan about the organ in 256 steps and, of a ventricle, the polar map. `volume_id` names
    /// the volume in the mesh files.
    ///
    /// # Errors
    /// See [`SegmentationFilesError`].
    pub fn files(
        &self,
        formats: &[Format],
        volume_id: Option<String>,
        monitor: &Monitor<'_>,
    ) -> Result<Vec<NamedFile>, SegmentationFilesError> {
        monitor.report(Stage::Export, 0.0)?;
        let segmentation = &self.segmentation;
        let edge = self.parameters.deform.edge;
        let place = MaskPlace::new(&self.reading, self.parameters.mask_grid).ok_or_else(|| {
            SegmentationFilesError::Other {
                what: MASK_FILE,
                reason: "a grid at right angles that covers so skewed a scan has too many voxels; \
                         leave out mask_grid, or resample the scan first"
                    .into(),
            }
        })?;
        let mask = place.mask(&segmentation.mask, &segmentation.fit.model.mesh, monitor)?;
        let mut files = vec![self.mask(MASK_FILE, &mask, &place, monitor)?];
        if let (Some(mask), Some(surface)) = (
            &segmentation.other_mask,
            segmentation.fit.model.other_surface(edge),
        ) {
            let name = match edge {
                WallEdge::Apparent => ANATOMICAL_MASK,
                WallEdge::Anatomical => APPARENT_MASK,
            };
            let mask = place.mask(mask, &surface.mesh, monitor)?;
            files.push(self.mask(name, &mask, &place, monitor)?);
        }
        files.extend(self.labels(&mask, &place, monitor)?);
        monitor.report(Stage::Export, 0.5)?;
        let fit = &segmentation.fit;
        for (name, mesh, metadata) in self.meshes(volume_id, monitor)? {
            for format in formats {
                monitor.check()?;
                files.push(NamedFile {
                    name: format!("{name}.{}", format.extension()),
                    media_type: format.media_type(),
                    bytes: export::encode(*format, mesh, &metadata)?,
                });
            }
        }
        monitor.report(Stage::Export, 0.9)?;
        files.push(json_file("report.json", &self.report()));
        files.push(NamedFile {
            name: "slices.png".into(),
            media_type: "image/png",
            bytes: self.segmentation.slices.clone(),
        });
        if let Some(acquired) = &self.acquired {
            files.push(png_file(
                PROJECTIONS_FILE,
                acquired.picture(&fit.model, monitor)?,
            ));
        }
        files.push(region_file(
            REGION_FILE,
            &self.reading.volume,
            &fit.model.mesh,
            monitor,
        )?);
        files.extend(self.polar(monitor)?);
        monitor.report(Stage::Export, 1.0)?;
        Ok(files)
    }

    /// One part of the wall in `formats` as open surfaces, `mesh_endocardium.glb` ..., also of the wall
    /// that is not shown; empty for other organs.
    ///
    /// # Errors
    /// See [`SegmentationFilesError`].
    pub fn part_files(
        &self,
        part: Part,
        formats: &[Format],
        monitor: &Monitor<'_>,
    ) -> Result<Vec<NamedFile>, SegmentationFilesError> {
        let mut files = Vec::new();
        for (name, mesh, metadata) in self.meshes(None, monitor)? {
            let Some((mesh, metadata)) = open_part(mesh, &metadata, part) else {
                continue;
            };
            for format in formats {
                files.push(NamedFile {
                    name: format!("{name}_{}.{}", part.as_str(), format.extension()),
                    media_type: format.media_type(),
                    bytes: export::encode(*format, &mesh, &metadata)?,
                });
            }
        }
        Ok(files)
    }

    /// The meshes with their names and what is known of them: that of the wall that is shown, and of a ventricle
    /// that of the other.
    fn meshes<'a>(
        &'a self,
        volume_id: Option<String>,
        monitor: &Monitor<'_>,
    ) -> Result<Vec<(&'static str, &'a TriMesh, Metadata)>, Cancelled> {
        let edge = self.parameters.deform.edge;
        let fit = &self.segmentation.fit;
        let metadata = Metadata {
            volume_id,
            frame_of_reference_uid: self.reading.frame_of_reference().map(str::to_owned),
            quality: report::object(&self.summary()),
            ..Metadata::new("Fitted model")
        };
        let shown = fit.uncertainty(edge).unwrap_or_default();
        let mut meshes = vec![("mesh", &fit.model.mesh, shown)];
        if let Some(other) = fit.model.other_surface(edge) {
            let name = match edge {
                WallEdge::Apparent => "mesh_anatomical",
                WallEdge::Anatomical => "mesh_apparent",
            };
            let uncertainty = fit.uncertainty(edge.other()).unwrap_or_default();
            meshes.push((name, &other.mesh, uncertainty));
        }
        let described = |(name, mesh, uncertainty): (&'static str, &'a TriMesh, &[f64])| {
            let metadata = Metadata {
                parts: self.segmentation.parts(mesh, monitor)?,
                uncertainty: uncertainty.to_vec(),
                field: self.segmentation.uptake(mesh),
                ..metadata.clone()
            };
            Ok((name, mesh, metadata))
        };
        meshes.into_iter().map(described).collect()
    }

    /// Warnings about the input and about the grid of its masks.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = self.reading.facts.warnings.clone();
        let frame = &self.reading.volume.frame;
        warnings.extend(MaskPlace::warning(frame, self.parameters.mask_grid));
        warnings.extend(self.expert.iter().flat_map(ExpertFacts::warnings));
        warnings
    }

    /// The report as a self-contained page; `files` are those of [`SegmentedVolume::files`]. It names
    /// patient, study and series as far as `scan` does.
    pub fn page(&self, files: &[NamedFile], scan: Option<&Provenance>) -> NamedFile {
        let bytes = |name: &str| {
            let found = files.iter().find(|file| file.name == name);
            found.map(|file| file.bytes.as_slice())
        };
        let edge = self.parameters.deform.edge;
        let fit = &self.segmentation.fit;
        let map = self
            .segmentation
            .polar
            .as_ref()
            .map(PolarDocument::from_map);
        let map = map.map(|map| report::object(&map).into());
        let page = report::segmentation_page(&SegmentationPage {
            report: &self.report(),
            mesh: &fit.model.mesh,
            uncertainty: fit.uncertainty(edge).unwrap_or_default(),
            other: fit.model.other_surface(edge).map(|other| {
                (
                    &other.mesh,
                    fit.uncertainty(edge.other()).unwrap_or_default(),
                )
            }),
            slices: bytes("slices.png"),
            polar: bytes("polar.svg"),
            polar_map: map.as_ref(),
            region: bytes(REGION_FILE),
            projections: bytes(PROJECTIONS_FILE),
            scan,
        });
        NamedFile {
            name: "report.html".into(),
            media_type: "text/html; charset=utf-8",
            bytes: page.into_bytes(),
        }
    }

    /// The main figures, for lists and mesh files.
    pub fn summary(&self) -> SegmentationSummary {
        SegmentationSummary::new(
            self.report(),
            self.segmentation.fit.model.mesh.vertices.len(),
        )
    }

    /// The scan that the results belong to, with the given identity.
    pub fn scan(&self, identity: Provenance, made: Moment) -> SourceScan {
        let Reading { volume, facts, .. } = &self.reading;
        let placed = facts.affine_source.is_placed();
        SourceScan::new(identity, volume.frame.clone(), volume.shape, placed, made)
    }

    /// The results as DICOM objects of `scan` (see [`SegmentedVolume::scan`]).
    ///
    /// # Errors
    /// See [`DicomError`].
    pub fn dicom_files(&self, scan: &SourceScan) -> Result<Vec<NamedFile>, DicomError> {
        let made = &self.segmentation;
        let structure = Structure::from_organ(self.parameters.organ.as_str());
        let report = self.report();
        let polar = made.polar.as_ref().map(polar::png);
        let cavity = report.axes().and_then(|(axis, superior)| {
            // A silent monitor is never cancelled.
            let cavity = cavity(
                &axis,
                &superior,
                &made.fit.model.mesh,
                &made.mask,
                &self.reading.volume.frame,
                &Monitor::silent(),
            );
            cavity.unwrap_or_default()
        });
        let text = json_line(&report);
        let results = DicomResults::new(scan, structure, &made.mask, &made.fit.model.mesh, &text)
            .with_figures(&report)
            .with_cavity(cavity.as_ref())
            .with_pictures(Some(&made.slices), polar.as_deref());
        let mut files = Vec::new();
        for object in DicomObject::ALL {
            if let Some(bytes) = results.write(object)? {
                files.push(NamedFile {
                    name: object.file_name().into(),
                    media_type: DicomObject::MEDIA_TYPE,
                    bytes,
                });
            }
        }
        fhir_beside(&mut files)?;
        Ok(files)
    }

    fn mask(
        &self,
        name: &'static str,
        mask: &Mask,
        place: &MaskPlace<'_>,
        monitor: &Monitor<'_>,
    ) -> Result<NamedFile, SegmentationFilesError> {
        let bytes = nifti::write_mask(
            &mask.voxels,
            mask.shape,
            &place.frame,
            place.stated,
            monitor,
        );
        nifti_file(name, bytes)
    }

    /// The wall as 1 and, of a ventricle, the cavity as 2, for programs that read labels.
    fn labels(
        &self,
        wall: &Mask,
        place: &MaskPlace<'_>,
        monitor: &Monitor<'_>,
    ) -> Result<[NamedFile; 2], SegmentationFilesError> {
        let mesh = &self.segmentation.fit.model.mesh;
        let cavity = match self.report().axes() {
            Some((axis, superior)) => cavity(&axis, &superior, mesh, wall, &place.frame, monitor)?,
            None => None,
        };
        let mut labels: Vec<u8> = wall.voxels.iter().map(|inside| u8::from(*inside)).collect();
        if let Some(cavity) = &cavity {
            let inside = labels.iter_mut().zip(&cavity.voxels);
            inside
                .filter(|(_, inside)| **inside)
                .for_each(|(label, _)| *label = 2);
        }
        let structure = Structure::from_organ(self.parameters.organ.as_str());
        let segments = structure.segments(cavity.is_some());
        let entries: Vec<LabelEntry> = segments.iter().map(|segment| segment.entry).collect();
        let grid = (place.shape, &place.frame);
        let nifti = nifti::write_labels(&labels, &entries, grid, place.stated, monitor);
        let nrrd = NamedFile {
            name: SEGMENTS_FILE.into(),
            media_type: seg_nrrd::MEDIA_TYPE,
            bytes: seg_nrrd::encode(&labels, &segments, grid, monitor)?,
        };
        Ok([nifti_file(LABELS_FILE, nifti)?, nrrd])
    }

    fn polar(&self, monitor: &Monitor<'_>) -> Result<Vec<NamedFile>, SegmentationFilesError> {
        let Some(map) = &self.segmentation.polar else {
            return Ok(Vec::new());
        };
        let mut files = uptake_files("polar", map);
        if let Some(perfusion) = &self.perfusion {
            monitor.check()?;
            files.extend(perfusion_files(perfusion, map, ""));
        }
        Ok(files)
    }
}

/// A map of uptake as JSON, SVG and PNG.
pub(crate) fn uptake_files(name: &str, map: &PolarMap) -> Vec<NamedFile> {
    vec![
        json_file(&format!("{name}.json"), &PolarDocument::from_map(map)),
        svg_file(&format!("{name}.svg"), polar::svg(map)),
        png_file(&format!("{name}.png"), polar::png(map)),
    ]
}

/// The maps of a wall beside normal limits: `polar_z` and `polar_score` with `of_scan` after their names, each as
/// JSON, SVG and PNG.
pub(crate) fn perfusion_files(
    perfusion: &Perfusion,
    map: &PolarMap,
    of_scan: &str,
) -> Vec<NamedFile> {
    let figures = [WallFigure::Z, WallFigure::Score];
    let files = figures.map(|figure| {
        let of_segment = |segment: &SegmentPerfusion| match figure {
            WallFigure::Z => segment.z,
            _ => segment.score.map(f64::from),
        };
        let values = if figure == WallFigure::Z {
            &perfusion.z
        } else {
            &perfusion.scores
        };
        let map = FigureMap {
            map,
            figure,
            values: values.clone(),
            segments: perfusion.segments.each_ref().map(of_segment),
        };
        figure_files(&format!("polar_{}{of_scan}", figure.as_str()), &map)
    });
    files.into_iter().flatten().collect()
}

/// A polar map of another figure than uptake, as numbers and pictures.
pub(crate) fn figure_files(name: &str, map: &FigureMap<'_>) -> [NamedFile; 3] {
    [
        json_file(&format!("{name}.json"), &FigureDocument::from_figure(map)),
        svg_file(&format!("{name}.svg"), polar::figure_svg(map)),
        png_file(&format!("{name}.png"), polar::figure_png(map)),
    ]
}

/// The image about a heart in 256 steps, which pages show.
pub(crate) fn region_file(
    name: &str,
    image: &Volume,
    heart: &TriMesh,
    monitor: &Monitor<'_>,
) -> Result<NamedFile, SegmentationFilesError> {
    let region = nifti::write(&region(image, heart, monitor)?, StoredType::Scaled8, true);
    Ok(NamedFile {
        name: name.to_owned(),
        media_type: "application/gzip",
        bytes: region.map_err(|error| other(REGION_FILE, &error))?,
    })
}

impl Segmentation {
    /// The part of the wall that each triangle of `mesh` is of; empty for other organs.
    pub(crate) fn parts(
        &self,
        mesh: &TriMesh,
        monitor: &Monitor<'_>,
    ) -> Result<Vec<Part>, Cancelled> {
        let parts = match &self.fit.model.cup {
            Some(cup) => wall_parts(mesh, cup, monitor)?,
            None => None,
        };
        Ok(parts.unwrap_or_default())
    }

    /// The uptake of the wall at every vertex of `mesh`; ventricles only.
    pub(crate) fn uptake(&self, mesh: &TriMesh) -> Option<VertexField> {
        let surfaces = self.fit.model.surfaces.as_ref()?;
        let map = self.polar.as_ref()?;
        let of = |p| map.uptake_at(&surfaces.apparent.wall, p);
        let values: Vec<f64> = mesh.vertices.iter().map(of).collect();
        Some(VertexField {
            name: "Uptake",
            colours: values.iter().map(|x| polar::colour_of(*x)).collect(),
            values,
        })
    }
}

impl SegmentationFilesError {
    /// A file of labels, or why it cannot be written.
    pub(crate) fn nifti(
        name: String,
        bytes: Result<Vec<u8>, MaskError>,
    ) -> Result<NamedFile, Self> {
        let file = nifti_file(LABELS_FILE, bytes)?;
        Ok(NamedFile { name, ..file })
    }
}

fn nifti_file(
    name: &'static str,
    bytes: Result<Vec<u8>, MaskError>,
) -> Result<NamedFile, SegmentationFilesError> {
    Ok(NamedFile {
        name: name.into(),
        media_type: "application/gzip",
        bytes: bytes.map_err(|error| match error {
            MaskError::Cancelled(cancelled) => cancelled.into(),
            MaskError::TooLong(error) => other(name, &error),
        })?,
    })
}

pub(crate) fn json_file(name: &str, document: &impl Serialize) -> NamedFile {
    let text = serde_json::to_string_pretty(document).expect("every key of a document is a text");
    NamedFile {
        name: name.into(),
        media_type: "application/json",
        bytes: format!("{text}\n").into_bytes(),
    }
}

pub(crate) fn svg_file(name: &str, text: String) -> NamedFile {
    text_file(name, "image/svg+xml", text)
}

pub(crate) fn csv_file(name: &str, text: String) -> NamedFile {
    text_file(name, "text/csv; charset=utf-8", text)
}

fn text_file(name: &str, media_type: &'static str, text: String) -> NamedFile {
    NamedFile {
        name: name.to_owned(),
        media_type,
        bytes: text.into_bytes(),
    }
}

pub(crate) fn png_file(name: &str, bytes: Vec<u8>) -> NamedFile {
    NamedFile {
        name: name.to_owned(),
        media_type: "image/png",
        bytes,
    }
}

/// Adds the structured report among DICOM objects as FHIR resources.
pub(crate) fn fhir_beside(objects: &mut Vec<NamedFile>) -> Result<(), DicomError> {
    let report = DicomObject::Measurements.file_name();
    if let Some(report) = objects.iter().find(|file| file.name == report) {
        let bytes = fhir::bundle(&report.bytes, false)?;
        objects.push(NamedFile {
            name: fhir::FHIR_FILE.into(),
            media_type: fhir::FHIR_MEDIA_TYPE,
            bytes,
        });
    }
    Ok(())
}

/// A document as JSON in one line.
pub(crate) fn json_line(document: &impl Serialize) -> String {
    serde_json::to_string(document).expect("every key of a document is a text")
}

fn other(what: &'static str, error: &dyn std::error::Error) -> SegmentationFilesError {
    SegmentationFilesError::Other {
        what,
        reason: error.to_string(),
    }
}
