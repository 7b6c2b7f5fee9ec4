//! Slices in DICOM: Nuclear Medicine, Enhanced and single-frame images, and Segmentations.
//!
//! In: one file, or the files of a series. Out: voxels, their place in the patient, and whose scan it
//! is. After DICOM PS3.3 and PS3.5:
//!
//! 1. `syntax`: finds the data set, its encoding and the compression of its pixels.
//! 2. `scan`: one pass over the data set collects the needed `attributes` and finds the pixels. It
//!    follows at most 32 nested sequences and rejects lengths beyond the size of the file. `unknown`:
//!    sequences that a program wrote without knowing them.
//! 3. `kind`: what the object is. One that holds no slices is refused by its name, with what to send.
//! 4. `frames`: orders the frames of a Nuclear Medicine Image by its vectors; `geometry` places them.
//!    `stack`: orders and places all other frames by their positions. `segments`: labels.
//! 5. `pixels`, `fragments` and `codec`: checks the pixel format and decodes frame by frame.
//! 6. `provenance`: patient, study, series, instances and acquisition.
//!
//! Guaranteed: no memory is taken for a stated size before the file was found large enough for it;
//! beside the voxels, one compressed frame and at most 16 MiB of attributes are held. A damaged
//! compressed frame is an error, even if a decoder panics.
//!
//! Not read: pixels in colour, JPEG with more than 8 bits that is not lossless, High-Throughput
//! JPEG 2000, JPEG XL, video, and values that are mapped by a table.

mod attributes;
mod codec;
mod described;
mod fragments;
mod frames;
mod geometry;
mod header;
mod kind;
mod pixels;
mod provenance;
mod scan;
mod segments;
mod stack;
mod syntax;
mod unknown;

#[cfg(test)]
mod tests;

pub use described::{Segment, SegmentCode};
pub use header::{DicomHeader, read_header, storage_classes, transfer_syntaxes};
pub use provenance::Provenance;
pub(super) use syntax::is_dicom;

use self::attributes::{Attributes, SERIES_NUMBER, SERIES_UID, SLICE_THICKNESS, SOP_INSTANCE};
use self::frames::FrameOrder;
use self::kind::Kind;
use self::pixels::{Pixels, too_many_voxels};
use self::scan::Scan;
use self::segments::Segments;
use self::stack::{Located, Stack, stated_gap};
use super::VolumeError;
use super::decode::Figures;
use super::facts::{FileFormat, LengthUnit};
use super::limits::ReadLimits;
use super::open::{Decoded, HeaderFacts, OpenVolume, Placement};
use super::source::VolumeFile;
use super::summary::Tally;
use crate::progress::{Monitor, Stage};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// DICOM files whose attributes have been read and checked.
pub(super) struct DicomFile {
    name: String,
    format: FileFormat,
    /// The files' pixels.
    parts: Vec<Pixels>,
    content: Content,
    /// Number of volumes.
    volumes: usize,
    /// Whether the volumes are gates of one heart beat.
    gated: bool,
    shape: [usize; 3],
    placement: Placement,
    provenance: Provenance,
    /// SOP Instance UID of each file of a series.
    instances: Vec<String>,
    warnings: Vec<String>,
}

/// What the frames hold.
enum Content {
    /// Slices, in the order in which they are stored.
    Slices(Vec<StoredSlice>),
    /// Segments on a grid.
    Labels(Segments),
}

/// A stored frame and the slice that it holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct StoredSlice {
    part: usize,
    frame: usize,
    volume: usize,
    slice: usize,
}

/// Runs a pass over the data set of `file`. The parser states invariants of its own by panics, which
/// are errors of the file.
fn guarded<T>(
    file: &VolumeFile,
    pass: impl FnOnce() -> Result<T, VolumeError>,
) -> Result<T, VolumeError> {
    catch_unwind(AssertUnwindSafe(pass)).unwrap_or_else(|_| {
        Err(VolumeError::Corrupt {
            file: file.name().into(),
            byte: 0,
            reason: "the data set's structure contradicts itself".into(),
        })
    })
}

/// The scan of one file.
struct ScannedFile {
    scan: Scan,
    pixels: Pixels,
}

impl ScannedFile {
    fn open(
        file: &VolumeFile,
        limits: &ReadLimits,
        monitor: &Monitor,
    ) -> Result<Self, VolumeError> {
        let syntax = syntax::find(file, limits)?;
        let mut source = syntax.open(file, limits.unpacked_bytes)?;
        let scan = guarded(file, || scan::scan(&mut source, &syntax, monitor))?;
        let pixels = Pixels::of(&scan, file, syntax, limits)?;
        Ok(Self { scan, pixels })
    }
}

impl DicomFile {
    /// Reads and checks the attributes of `files`, of which there is at least one.
    pub(super) fn open(
        files: &[&VolumeFile],
        limits: &ReadLimits,
        monitor: &Monitor,
    ) -> Result<Self, VolumeError> {
        match files {
            [file] => Self::single(file, limits, monitor),
            files => Self::series(files, limits, monitor),
        }
    }

    fn single(
        file: &VolumeFile,
        limits: &ReadLimits,
        monitor: &Monitor,
    ) -> Result<Self, VolumeError> {
        let ScannedFile { scan, pixels } = ScannedFile::open(file, limits, monitor)?;
        let a = &scan.attributes;
        let mut warnings = Vec::new();
        let [columns, rows] = pixels.extent;
        let (content, volumes, slices, placement) = match scan.kind {
            Kind::Nuclear { gated } => {
                let order = FrameOrder::of(a, pixels.frames, gated, &mut warnings)?;
                let (slices, volumes) = (order.slices(), order.gates());
                let stored = (0..volumes).flat_map(|volume| {
                    let slices = order.slices_of(volume).iter().enumerate();
                    slices.map(move |(slice, frame)| StoredSlice {
                        part: 0,
                        frame: *frame,
                        volume,
                        slice,
                    })
                });
                let stored = sorted(stored.collect());
                let placement = geometry::place(a, [columns, rows, slices])?;
                (Content::Slices(stored), volumes, slices, placement)
            }
            Kind::Segmentation => {
                let (segments, placement) = Segments::of(a, &pixels, limits.voxels)?;
                let slices = segments.slices;
                (Content::Labels(segments), 1, slices, placement)
            }
            Kind::Enhanced | Kind::Slice => {
                let located = (0..pixels.frames).map(|frame| Located::of(a, 0, frame));
                let located: Vec<Located> = located.collect::<Result<_, _>>()?;
                let gap = stated_gap(a)?;
                if located.len() == 1 && gap.is_none() {
                    return Err(a.missing(SLICE_THICKNESS));
                }
                let stack = Stack::of(&located, pixels.extent, gap);
                let stack = stack.map_err(|reason| {
                    a.wrong(
                        "Image Position (Patient) (0020,0032)",
                        "contradictory",
                        reason,
                    )
                })?;
                let volumes = located.len() / stack.slices;
                let stored = stored_slices(&stack, &located);
                (
                    Content::Slices(stored),
                    volumes,
                    stack.slices,
                    stack.placement,
                )
            }
        };
        let voxels = (columns * rows) as u64 * slices as u64;
        if voxels > limits.voxels {
            return Err(too_many_voxels(a, voxels, limits.voxels));
        }
        Ok(Self {
            name: file.name().into(),
            format: match scan.kind {
                Kind::Nuclear { .. } => FileFormat::DicomNm,
                Kind::Enhanced => FileFormat::DicomEnhanced,
                Kind::Slice => FileFormat::DicomSeries,
                Kind::Segmentation => FileFormat::DicomSeg,
            },
            content,
            volumes,
            gated: volumes > 1 && scan.kind == Kind::Nuclear { gated: true },
            shape: [columns, rows, slices],
            placement,
            provenance: Provenance::of(a),
            parts: vec![pixels],
            instances: Vec::new(),
            warnings,
        })
    }

    /// Opens the files of a series, each with one slice.
    fn series(
        files: &[&VolumeFile],
        limits: &ReadLimits,
        monitor: &Monitor,
    ) -> Result<Self, VolumeError> {
        let refuse = |reason| {
            Err(VolumeError::NotOneSeries {
                count: files.len(),
                reason,
            })
        };
        let mut series = Series::default();
        for file in files {
            monitor.check()?;
            let ScannedFile { scan, pixels } = ScannedFile::open(file, limits, monitor)?;
            if !scan.kind.is_single_slice() {
                return refuse(format!(
                    "{} is a volume of its own and not a slice of a series",
                    file.name()
                ));
            }
            series.add(&scan.attributes, pixels)?;
        }
        if let Some(reason) = series.contradiction() {
            return refuse(reason);
        }
        let Some(provenance) = series.provenance else {
            return Err(VolumeError::NoFile);
        };
        let extent = series.parts[0].extent;
        let stack = match Stack::of(&series.located, extent, series.gap) {
            Ok(stack) => stack,
            Err(reason) => return refuse(reason),
        };
        let volumes = series.located.len() / stack.slices;
        let voxels = (extent[0] * extent[1]) as u64 * stack.slices as u64;
        if voxels > limits.voxels {
            return Err(VolumeError::TooLarge {
                file: "the series".into(),
                what: "voxels",
                asked: voxels,
                limit: limits.voxels,
            });
        }
        let repeated = series.repeated;
        let warning = (repeated > 0).then(|| {
            format!("{repeated} files repeat an instance of the series and were left out.")
        });
        Ok(Self {
            name: "the series".into(),
            format: FileFormat::DicomSeries,
            content: Content::Slices(stored_slices(&stack, &series.located)),
            volumes,
            gated: false,
            shape: [extent[0], extent[1], stack.slices],
            placement: stack.placement,
            provenance,
            parts: series.parts,
            instances: series.instances,
            warnings: warning.into_iter().collect(),
        })
    }

    fn slice_voxels(&self) -> usize {
        self.shape[0] * self.shape[1]
    }

    /// Decodes the slices for which `wanted` is true, as they lie in the files, and gives each portion
    /// to `take` with the number of voxels before it in its volume.
    fn decode_slices(
        &self,
        stored: &[StoredSlice],
        wanted: impl Fn(&StoredSlice) -> bool,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<Figures, VolumeError> {
        let count = stored.iter().filter(|slice| wanted(slice)).count() as f64;
        let mut figures = Figures::default();
        let mut done = 0.0;
        for part in stored.chunk_by(|a, b| a.part == b.part) {
            if !part.iter().any(&wanted) {
                continue;
            }
            let mut reader = self.parts[part[0].part].open()?;
            for stored in part.iter().filter(|slice| wanted(slice)) {
                let before = stored.slice * self.slice_voxels();
                let mut place = |first: usize, voxels: &[f32]| take(before + first, voxels);
                figures = reader.read(
                    stored.frame,
                    stored.slice,
                    figures,
                    &mut place,
                    &mut |share| monitor.report(Stage::Read, (done + share) / count),
                )?;
                done += 1.0;
            }
        }
        Ok(figures)
    }

    /// Decodes all labels and gives them to `take` slice by slice.
    fn decode_labels(
        &self,
        segments: &Segments,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(Tally, Vec<String>), VolumeError> {
        let (labels, warning) = segments.labels(&self.parts[0], monitor)?;
        let mut tally = Tally::default();
        let count = self.slice_voxels();
        let mut voxels = Vec::with_capacity(count);
        for (slice, labels) in labels.chunks(count).enumerate() {
            voxels.clear();
            voxels.extend(labels.iter().map(|label| f32::from(*label)));
            tally.add_portion(&voxels);
            take(slice * count, &voxels);
        }
        Ok((tally, warning.into_iter().collect()))
    }

    fn stream(
        &self,
        volume: Option<usize>,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(Tally, Vec<String>), VolumeError> {
        match &self.content {
            Content::Slices(stored) => {
                let wanted = |slice: &StoredSlice| volume.is_none_or(|v| slice.volume == v);
                let figures = self.decode_slices(stored, wanted, take, monitor)?;
                Ok((figures.tally(), figures.warnings()))
            }
            Content::Labels(segments) => self.decode_labels(segments, take, monitor),
        }
    }
}

/// The files of a series found so far.
#[derive(Default)]
struct Series {
    parts: Vec<Pixels>,
    located: Vec<Located>,
    /// SOP Instance UID of each part.
    instances: Vec<String>,
    /// Every series, with its number and how many files it has.
    names: Vec<(String, String, usize)>,
    provenance: Option<Provenance>,
    gap: Option<f64>,
    /// Files that repeat an instance.
    repeated: usize,
}

impl Series {
    fn add(&mut self, a: &Attributes, pixels: Pixels) -> Result<(), VolumeError> {
        let name = a.text(SERIES_UID).unwrap_or_default();
        match self.names.iter_mut().find(|(known, ..)| *known == name) {
            Some((.., count)) => *count += 1,
            None => {
                let number = a
                    .text(SERIES_NUMBER)
                    .unwrap_or_else(|| "without number".into());
                self.names.push((name, number, 1));
            }
        }
        let instance = a.text(SOP_INSTANCE).unwrap_or_default();
        if !instance.is_empty() && self.instances.contains(&instance) {
            self.repeated += 1;
            return Ok(());
        }
        self.located.push(Located::of(a, self.parts.len(), 0)?);
        if self.provenance.is_none() {
            self.provenance = Some(Provenance::of(a));
            self.gap = stated_gap(a)?;
        }
        self.instances.push(instance);
        self.parts.push(pixels);
        Ok(())
    }

    /// Why the files are not one series.
    fn contradiction(&self) -> Option<String> {
        if self.names.len() > 1 {
            let each = self.names.iter().take(8);
            let each = each.map(|(_, number, count)| format!("{number} ({count} files)"));
            let list: Vec<String> = each.collect();
            return Some(format!(
                "they belong to {} series, numbers {}; send the files of one of them",
                self.names.len(),
                list.join(", ")
            ));
        }
        let first = self.parts.first()?.extent;
        let other = self.parts.iter().find(|part| part.extent != first)?.extent;
        Some(format!(
            "some have {} x {} pixels, others {} x {}",
            first[0], first[1], other[0], other[1]
        ))
    }
}

fn sorted(mut stored: Vec<StoredSlice>) -> Vec<StoredSlice> {
    stored.sort_unstable();
    stored
}

/// The slices of `stack` in stored order.
fn stored_slices(stack: &Stack, located: &[Located]) -> Vec<StoredSlice> {
    let places = stack.order.iter().enumerate();
    let stored = places.map(|(place, index)| StoredSlice {
        part: located[*index].part,
        frame: located[*index].frame,
        volume: place / stack.slices,
        slice: place % stack.slices,
    });
    sorted(stored.collect())
}

impl OpenVolume for DicomFile {
    fn header(&self) -> HeaderFacts<'_> {
        let first = &self.parts[0];
        let mut file_shape = self.shape.to_vec();
        file_shape.extend((self.volumes > 1).then_some(self.volumes));
        let scaling = first.scaling(0);
        let mut every = self
            .parts
            .iter()
            .flat_map(|part| (0..part.frames).map(|frame| part.scaling(frame)));
        HeaderFacts {
            file: &self.name,
            format: self.format,
            byte_order: first.byte_order,
            compressed: self.parts.iter().any(Pixels::is_gzip),
            data_type: first.data_type.name(),
            // Slices may be scaled each in its own way; then there is no common factor.
            scaling: scaling.filter(|_| every.all(|other| other == scaling)),
            file_shape,
            frames: self.volumes,
            gated: self.gated,
            shape: self.shape,
            placement: &self.placement,
            unit: LengthUnit::Millimetre,
            warnings: &self.warnings,
        }
    }

    fn provenance(&self, frame: usize) -> Option<Provenance> {
        let mut provenance = self.provenance.clone();
        if let Content::Slices(stored) = &self.content {
            let mut slices: Vec<&StoredSlice> = stored
                .iter()
                .filter(|slice| slice.volume == frame)
                .collect();
            slices.sort_unstable_by_key(|slice| slice.slice);
            if self.instances.len() > 1 {
                let uids = slices
                    .iter()
                    .map(|slice| self.instances[slice.part].clone());
                provenance.instance_uids = uids.collect();
                provenance.sop_instance_uid = provenance.instance_uids.first().cloned();
            } else if self.parts.len() == 1 && self.format != FileFormat::DicomSeries {
                let frames = slices.iter().map(|slice| slice.frame as u32 + 1);
                provenance.slice_frames = frames.collect();
            }
        }
        Some(provenance)
    }

    fn segments(&self) -> &[Segment] {
        match &self.content {
            Content::Labels(segments) => &segments.described,
            Content::Slices(_) => &[],
        }
    }

    fn keep_segment(&mut self, number: u16) {
        if let Content::Labels(segments) = &mut self.content {
            segments.only = Some(number);
        }
    }

    fn decode_frame(&mut self, frame: usize, monitor: &Monitor) -> Result<Decoded, VolumeError> {
        let count = self.slice_voxels() * self.shape[2];
        let mut voxels: Vec<f32> = Vec::new();
        voxels
            .try_reserve_exact(count)
            .map_err(|_| VolumeError::Memory {
                bytes: 4 * count as u64,
            })?;
        voxels.resize(count, 0.0);
        let mut take = |first: usize, part: &[f32]| {
            voxels[first..first + part.len()].copy_from_slice(part);
        };
        let (tally, warnings) = self.stream(Some(frame), &mut take, monitor)?;
        Ok(Decoded {
            voxels,
            tally,
            warnings,
        })
    }

    fn stream_frame(
        &mut self,
        frame: usize,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        self.stream(Some(frame), take, monitor).map(|_| ())
    }

    fn decode_all(
        &mut self,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(Tally, Vec<String>), VolumeError> {
        self.stream(None, take, monitor)
    }
}
