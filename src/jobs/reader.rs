//! Looks at volumes by [`crate::volume`].

use super::{Failure, Fault, Intensity, VolumeFacts, VolumeReader};
use crate::progress::Monitor;
use crate::volume::{self, ReadLimits, ReadOptions, VolumeError, VolumeFile};
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
