//! Looks at volumes by [`crate::volume`], at templates by [`crate::deform`].

use super::{Failure, Fault, Intensity, Output, OutputFile, VolumeFacts, VolumeReader};
use crate::deform::template::{Organ, Template};
use crate::export::{self, Format, Metadata, read_json};
use crate::pipeline::pages::PageError;
use crate::progress::Monitor;
use crate::volume::{self, ReadLimits, ReadOptions, VolumeError, VolumeFile};
use serde_json::json;
use std::path::PathBuf;

/// The real reader.
#[derive(Debug, Clone, Copy)]
pub struct Reader {
    /// What a file may cost.
    pub limits: ReadLimits,
}

impl VolumeReader for Reader {
    fn inspect(&self, files: &[PathBuf]) -> Result<VolumeFacts, Failure> {
        let facts = volume::inspect(&volume_files(files), &self.limits, &Monitor::silent())
            .map_err(|e| refusal(&e))?;
        let affine = facts.affine_lps;
        Ok(VolumeFacts {
            format: facts.format.as_str().into(),
            compressed: facts.compressed,
            shape: facts.shape,
            frames: facts.frames,
            spacing_mm: facts.spacing_mm,
            affine: std::array::from_fn(|row| std::array::from_fn(|column| affine[(row, column)])),
            affine_source: facts.affine_source.as_str().into(),
            dtype: facts.data_type.into(),
            intensity: Intensity {
                min: facts.intensity.minimum.into(),
                max: facts.intensity.maximum.into(),
                mean: facts.intensity.mean,
                not_finite: facts.intensity.missing,
            },
            labels: facts
                .intensity
                .labels
                .map(|labels| labels.iter().map(|l| l.label).collect()),
            warnings: facts.warnings,
        })
    }

    fn preview(&self, files: &[PathBuf]) -> Result<Vec<u8>, Failure> {
        let options = ReadOptions { frame: Some(0) };
        let reading = volume::read(
            &volume_files(files),
            &options,
            &self.limits,
            &Monitor::silent(),
        )
        .map_err(|e| refusal(&e))?;
        Ok(volume::preview_png(&reading.volume))
    }

    fn template(&self, mesh: &[u8], organ: &str) -> Result<Output, Failure> {
        let unsuitable = |detail: &dyn std::error::Error, fix: &str| {
            Failure::new(Fault::Content, "unsuitable-model", sentence(detail)).fix(fix)
        };
        let mesh = read_json::decode(mesh).map_err(|error| {
            unsuitable(
                &error,
                "Send a JSON mesh as `generate` writes it (mesh.json).",
            )
        })?;
        let organ = Organ::parse(organ).ok_or_else(|| unknown_organ(organ))?;
        let template = Template::new(mesh, organ, &Monitor::silent()).map_err(|error| {
            unsuitable(
                &error,
                "Send a closed surface that faces outward, in LPS millimetres; of another organ \
                 than the left ventricle with `organ`.",
            )
        })?;
        let metadata = Metadata::new(format!("Template of a {}", organ.as_str()));
        let mut files = Vec::new();
        for format in Format::ALL {
            let bytes = export::encode(format, &template.mesh, &metadata).map_err(|error| {
                unsuitable(
                    &error,
                    "Send a mesh whose vertices lie apart from each other.",
                )
            })?;
            files.push(OutputFile {
                name: format!("mesh.{}", format.extension()),
                media_type: format.media_type(),
                bytes,
            });
        }
        let summary = [
            ("vertices", json!(template.mesh.vertices.len())),
            ("triangles", json!(template.mesh.triangles.len())),
            ("volume_ml", json!(template.mesh.volume() / 1000.0)),
            ("length_mm", json!(template.cup.map(|cup| cup.length))),
        ];
        Ok(Output {
            summary: summary
                .map(|(name, figure)| (name.to_owned(), figure))
                .into_iter()
                .collect(),
            files,
        })
    }
}

fn unknown_organ(organ: &str) -> Failure {
    let words = Organ::ALL.map(Organ::as_str).join(", ");
    Failure::new(
        Fault::Request,
        "invalid-parameter",
        format!("There is no organ `{organ}`."),
    )
    .at("organ")
    .fix(format!("Give one of {words}."))
}

/// Files as the volume's readers take them. Their stored names say nothing to the sender,
/// but for the two halves of a pair.
pub(super) fn volume_files(paths: &[PathBuf]) -> Vec<VolumeFile> {
    match paths {
        [path] => vec![VolumeFile::named("the file", path)],
        _ => paths.iter().map(VolumeFile::at).collect(),
    }
}

/// Why a volume was refused, for its sender.
pub(super) fn refusal(error: &VolumeError) -> Failure {
    let (fault, code) = match error {
        VolumeError::TooLarge { .. } => (Fault::TooLarge, "volume-too-large"),
        VolumeError::FrameNeeded { .. } => (Fault::Request, "frame-needed"),
        VolumeError::FrameOutOfRange { .. } => (Fault::Request, "frame-out-of-range"),
        VolumeError::Unsupported { .. } => (Fault::Content, "unsupported-format"),
        VolumeError::Unrecognised { .. } => (Fault::Content, "unrecognised-format"),
        VolumeError::Truncated { .. } => (Fault::Content, "truncated-volume"),
        VolumeError::Corrupt { .. } => (Fault::Content, "corrupt-volume"),
        VolumeError::Field { .. } => (Fault::Content, "invalid-header"),
        VolumeError::Io { .. } | VolumeError::Memory { .. } => (Fault::Service, "unreadable"),
        _ => (Fault::Content, "unusable-volume"),
    };
    let failure = Failure::new(fault, code, sentence(error)).fix(error.fix());
    match error.field() {
        Some(field) => failure.at(field),
        None => failure,
    }
}

/// Why a page cannot be made, for whoever asked for it.
pub(super) fn no_page(error: &PageError) -> Failure {
    Failure::new(Fault::Service, "unreadable", sentence(error))
        .fix("The report itself can still be had: GET report.json.")
}

/// An error's words as a sentence.
pub(super) fn sentence(error: &dyn std::error::Error) -> String {
    let text = error.to_string();
    let mut letters = text.chars();
    let mut sentence: String = letters
        .next()
        .map(|first| first.to_uppercase().chain(letters).collect())
        .unwrap_or_default();
    if !sentence.ends_with('.') {
        sentence.push('.');
    }
    sentence
}
