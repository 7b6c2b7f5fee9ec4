//! The files of a segmentation.

use super::cavity::cavity;
use super::from_files::{ExpertFacts, SegmentedVolume};
use super::region::region;
use super::report::report_json;
use crate::deform::WallEdge;
use crate::export::dicom::{DicomError, DicomObject, DicomResults, Moment, SourceScan, Structure};
use crate::export::{self, ExportError, Format, Metadata, VertexField};
use crate::grid::voxelise::Mask;
use crate::mesh::TriMesh;
use crate::parameters::Parameters;
use crate::polar;
use crate::progress::{Cancelled, Monitor, Stage};
use crate::report::{self, SegmentationPage, SegmentationReport};
use crate::volume::dicom::Provenance;
use crate::volume::nifti::{self, MaskError, StoredType};
use crate::volume::{AffineSource, Reading};
use serde_json::{Map, Value, json};

/// The mask of the anatomical wall, where `mask.nii.gz` shows the apparent one.
const ANATOMICAL_MASK: &str = "mask_anatomical.nii.gz";
/// The mask of the apparent wall, where `mask.nii.gz` shows the anatomical one.
const APPARENT_MASK: &str = "mask_apparent.nii.gz";
/// The scan about the organ, which the page shows.
const REGION: &str = "region.nii.gz";

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
    /// The mask on the input's grid, the mesh in `formats`, the report, slices, the scan about the organ
    /// in 256 steps and, of a ventricle, the polar map. `volume_id` names the volume in the mesh files.
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
        let mut files = vec![self.mask("mask.nii.gz", &segmentation.mask, monitor)?];
        if let Some(mask) = &segmentation.other_mask {
            let name = match edge {
                WallEdge::Apparent => ANATOMICAL_MASK,
                WallEdge::Anatomical => APPARENT_MASK,
            };
            files.push(self.mask(name, mask, monitor)?);
        }
        monitor.report(Stage::Export, 0.5)?;
        let metadata = Metadata {
            volume_id,
            frame_of_reference_uid: self.reading.frame_of_reference().map(str::to_owned),
            quality: self.summary(),
            ..Metadata::new("Fitted model")
        };
        let fit = &segmentation.fit;
        let shown = fit.shown_uncertainty(edge).unwrap_or_default();
        let mut meshes = vec![("mesh", &fit.mesh, shown)];
        if let Some(other) = segmentation.fit.other_surface(edge) {
            let name = match edge {
                WallEdge::Apparent => "mesh_anatomical",
                WallEdge::Anatomical => "mesh_apparent",
            };
            meshes.push((name, &other.mesh, &other.uncertainty));
        }
        for (name, mesh, uncertainty) in meshes {
            let metadata = Metadata {
                uncertainty: uncertainty.to_vec(),
                field: self.uptake(mesh),
                ..metadata.clone()
            };
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
        let region = region(&self.reading.volume, &fit.mesh, monitor)?;
        let region = nifti::write(&region, StoredType::Scaled8, true);
        files.push(NamedFile {
            name: REGION.into(),
            media_type: "application/gzip",
            bytes: region.map_err(|error| other(REGION, &error))?,
        });
        files.extend(self.polar(monitor)?);
        monitor.report(Stage::Export, 1.0)?;
        Ok(files)
    }

    /// The uptake of the wall at every vertex of `mesh`; ventricles only.
    fn uptake(&self, mesh: &TriMesh) -> Option<VertexField> {
        let surfaces = self.segmentation.fit.surfaces.as_ref()?;
        let map = self.segmentation.polar.as_ref()?;
        let of = |p| map.uptake_at(&surfaces.apparent.wall, p);
        let values: Vec<f64> = mesh.vertices.iter().map(of).collect();
        Some(VertexField {
            name: "Uptake",
            colours: values.iter().map(|x| polar::colour_of(*x)).collect(),
            values,
        })
    }

    /// The report, with the parameters used, the facts of the input and warnings.
    pub fn report(&self) -> Value {
        let mut report = report_json(&self.segmentation);
        if let Some(object) = report.as_object_mut() {
            let parameters = self.parameters.to_json();
            object.insert("parameters".into(), parameters.into());
            object.insert("input".into(), report::input(&self.reading.facts));
            let mut warnings = self.reading.facts.warnings.clone();
            warnings.extend(self.expert.iter().flat_map(ExpertFacts::warnings));
            object.insert("warnings".into(), warnings.into());
        }
        report
    }

    /// The report as a self-contained page; `files` are those of [`SegmentedVolume::files`].
    pub fn page(&self, files: &[NamedFile]) -> NamedFile {
        let bytes = |name: &str| {
            let found = files.iter().find(|file| file.name == name);
            found.map(|file| file.bytes.as_slice())
        };
        let report: SegmentationReport = serde_json::from_value(self.report())
            .expect("the page reads the fields of the report by the types it was written with");
        let edge = self.parameters.deform.edge;
        let fit = &self.segmentation.fit;
        let map = self.segmentation.polar.as_ref().map(polar::json);
        let page = report::segmentation_page(&SegmentationPage {
            report: &report,
            mesh: &fit.mesh,
            uncertainty: fit.shown_uncertainty(edge).unwrap_or_default(),
            other: fit
                .other_surface(edge)
                .map(|other| (&other.mesh, other.uncertainty.as_slice())),
            slices: bytes("slices.png"),
            polar: bytes("polar.svg"),
            polar_map: map.as_ref(),
            region: bytes(REGION),
        });
        NamedFile {
            name: "report.html".into(),
            media_type: "text/html; charset=utf-8",
            bytes: page.into_bytes(),
        }
    }

    /// The main figures, for lists and mesh files.
    pub fn summary(&self) -> Map<String, Value> {
        let report = report_json(&self.segmentation);
        let fit = &report["fit"];
        [
            ("template", report["template"].clone()),
            ("choice", report["choice"].clone()),
            ("candidates", report["candidates"].clone()),
            ("reason", fit["reason"].clone()),
            ("confidence", fit["confidence"].clone()),
            ("volumes_ml", report["volumes_ml"].clone()),
            ("measures", report["measures"].clone()),
            ("flags", report["flags"].clone()),
            ("vertices", json!(self.segmentation.fit.mesh.vertices.len())),
        ]
        .into_iter()
        .map(|(key, value)| (key.to_owned(), value))
        .collect()
    }

    /// The scan that the results belong to, with the given identity.
    pub fn scan(&self, identity: Provenance, made: Moment) -> SourceScan {
        let Reading { volume, facts, .. } = &self.reading;
        let assumed = [AffineSource::Pixdim, AffineSource::UnknownOrigin];
        let placed = !assumed.contains(&facts.affine_source);
        SourceScan::new(identity, volume.frame.clone(), volume.shape, placed, made)
    }

    /// The results as DICOM objects of `scan` (see [`SegmentedVolume::scan`]).
    ///
    /// # Errors
    /// See [`DicomError`].
    pub fn dicom_files(&self, scan: &SourceScan) -> Result<Vec<NamedFile>, DicomError> {
        let made = &self.segmentation;
        let structure = Structure::of(self.parameters.organ.as_str());
        let report = self.report();
        let polar = made.polar.as_ref().map(polar::png);
        let placed = (&made.mask, &self.reading.volume.frame);
        // A silent monitor is never cancelled.
        let cavity =
            cavity(&report, &made.fit.mesh, placed, &Monitor::silent()).unwrap_or_default();
        let results = DicomResults::new(scan, structure, &made.mask, &made.fit.mesh, &report)
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
        Ok(files)
    }

    fn mask(
        &self,
        name: &'static str,
        mask: &Mask,
        monitor: &Monitor<'_>,
    ) -> Result<NamedFile, SegmentationFilesError> {
        let frame = &self.reading.volume.frame;
        let bytes = nifti::write_mask(&mask.voxels, mask.shape, frame, monitor);
        Ok(NamedFile {
            name: name.into(),
            media_type: "application/gzip",
            bytes: bytes.map_err(|error| match error {
                MaskError::Cancelled(cancelled) => cancelled.into(),
                MaskError::TooLong(error) => other(name, &error),
            })?,
        })
    }

    fn polar(&self, monitor: &Monitor<'_>) -> Result<Vec<NamedFile>, SegmentationFilesError> {
        let Some(map) = &self.segmentation.polar else {
            return Ok(Vec::new());
        };
        let svg = NamedFile {
            name: "polar.svg".into(),
            media_type: "image/svg+xml",
            bytes: polar::svg(map).into_bytes(),
        };
        monitor.check()?;
        let png = NamedFile {
            name: "polar.png".into(),
            media_type: "image/png",
            bytes: polar::png(map),
        };
        Ok(vec![json_file("polar.json", &polar::json(map)), svg, png])
    }
}

fn json_file(name: &str, value: &Value) -> NamedFile {
    NamedFile {
        name: name.into(),
        media_type: "application/json",
        bytes: format!("{value:#}\n").into_bytes(),
    }
}

fn other(what: &'static str, error: &dyn std::error::Error) -> SegmentationFilesError {
    SegmentationFilesError::Other {
        what,
        reason: error.to_string(),
    }
}
