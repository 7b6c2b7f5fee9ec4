//! Slices in DICOM: Nuclear Medicine, Enhanced and single-frame images, and Segmentations.
//!
//! In: one file, or the files of a series. Out: voxels, their place in the patient, and whose scan it
//! is. After DICOM PS3.3 and PS3.5:
//!
//! 1. `syntax`: finds the data set, its encoding and the compression of its pixels.
//! 2. `scan`: one pass over the data set collects the needed `attributes` and finds the pixels. It
//!    follows at most 32 nested sequences and rejects lengths beyond the size of the file. `unknown`:
//!    sequences that a program wrote without knowing them.
//! 3. `kind`: what the object is. One that holds no slices is refused by its name, with what to send;
//!    `company`: beside others it is left out.
//! 4. `frames`: orders the frames of a Nuclear Medicine Image by its vectors; `geometry` places them.
//!    `stack`: orders and places all other frames by their positions; `volumes` tells which of those at
//!    one place belong together. `segments`: labels. `gate_series`: files of one gate each.
//! 5. `pixels`, `fragments` and `codec`: checks the pixel format and decodes frame by frame.
//! 6. `provenance`: patient, study, series, instances and acquisition; `characters`: their text.
//!
//! Guaranteed: no memory is taken for a stated size before the file was found large enough for it;
//! beside the voxels, one compressed frame and at most 16 MiB of attributes are held. A damaged
//! compressed frame is an error, even if a decoder panics.
//!
//! Not read: pixels in colour, JPEG with more than 8 bits that is not lossless, High-Throughput
//! JPEG 2000, JPEG XL, video, and values that are mapped by a table.

mod attributes;
mod characters;
mod codec;
mod company;
mod described;
mod fragments;
mod frames;
mod gate_series;
mod geometry;
mod header;
mod kind;
mod pixels;
mod provenance;
mod scan;
mod segments;
mod stack;
mod syntax;
mod timing;
mod unknown;
mod volumes;

#[cfg(test)]
mod tests;

pub use header::{DicomHeader, read_header, storage_classes, transfer_syntaxes};
pub(super) use syntax::is_dicom;

use self::attributes::{
    Attributes, IMAGES_IN_ACQUISITION, INSTANCE_NUMBER, MODALITY, NUMBER_OF_FRAMES,
    NUMBER_OF_SLICES, RR_INTERVAL_VECTOR, RR_INTERVALS, SERIES_DESCRIPTION, SERIES_NUMBER,
    SERIES_UID, SLICE_THICKNESS, SOP_INSTANCE, TIME_SLICES, TIME_SLOT_VECTOR, TIME_SLOTS, clip,
};
use self::frames::FrameOrder;
use self::kind::Kind;
use self::pixels::{Pixels, too_many_voxels};
use self::scan::Scan;
use self::segments::Segments;
use self::stack::{Located, Stack, stated_gap};
use self::volumes::Marks;
use super::decode::Figures;
use super::facts::{FileFormat, LengthUnit};
use super::gate_timing::GateTiming;
use super::limits::ReadLimits;
use super::open::{Decoded, HeaderFacts, OpenVolume, Placement};
use super::source::VolumeFile;
use super::summary::Tally;
use super::{Provenance, Segment, VolumeError};
use crate::progress::{Monitor, Stage};
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::mem;
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
    /// The stated timing of each R-R interval, if the file is gated.
    timings: Vec<GateTiming>,
    shape: [usize; 3],
    placement: Placement,
    provenance: Provenance,
    /// SOP Instance UID of each file of a series.
    instances: Vec<String>,
    /// Whose scan each gate is, if each is a file of its own; empty otherwise.
    gate_scans: Vec<Provenance>,
    warnings: Vec<String>,
}

/// The values of the frames.
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
        let sorted = company::set_apart(files, limits, monitor)?;
        let mut opened = match &sorted.slices[..] {
            [file] => Self::single(file, limits, monitor)?,
            slices => match gate_series::open(slices, limits, monitor)? {
                Some(gates) => gates,
                None => Self::series(slices, limits, monitor)?,
            },
        };
        opened.warnings.extend(sorted.notes);
        Ok(opened)
    }

    fn single(
        file: &VolumeFile,
        limits: &ReadLimits,
        monitor: &Monitor,
    ) -> Result<Self, VolumeError> {
        let scanned = ScannedFile::open(file, limits, monitor)?;
        Self::of_scan(file, scanned, limits)
    }

    /// The volumes of one file.
    fn of_scan(
        file: &VolumeFile,
        scanned: ScannedFile,
        limits: &ReadLimits,
    ) -> Result<Self, VolumeError> {
        let ScannedFile { scan, pixels } = scanned;
        let a = &scan.attributes;
        let mut warnings = Provenance::warnings(a);
        let [columns, rows] = pixels.extent;
        let (content, volumes, slices, placement) = match scan.kind {
            Kind::Nuclear { gated } => {
                let order = FrameOrder::of(a, pixels.frames, gated, &mut warnings)?;
                let (slices, volumes) = (order.slices(), order.gates());
                check_numbers(a, slices, volumes, &mut warnings)?;
                if slices == 1 {
                    warnings.push(stack::one_slice());
                }
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
                check_groups(a, pixels.frames)?;
                let located = (0..pixels.frames).map(|frame| {
                    let mut located = Located::of(a, 0, frame)?;
                    located.marks = Marks::of_frame(a, frame);
                    Ok(located)
                });
                let located: Vec<Located> = located.collect::<Result<_, VolumeError>>()?;
                let stated = a.shorts(NUMBER_OF_SLICES).first().copied().unwrap_or(1);
                if scan.kind == Kind::Slice && stated > 1 {
                    warnings.push(format!(
                        "{} is {stated}, and the file holds one of them.",
                        NUMBER_OF_SLICES.name
                    ));
                }
                let gap = stated_gap(a)?;
                if located.len() == 1 && gap.is_none() {
                    return Err(a.missing(SLICE_THICKNESS));
                }
                let name = |frame| format!("frame {}", frame + 1);
                let stack = Stack::of(&located, pixels.extent, gap, &name);
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
        warnings.extend(attenuation_warning(a));
        let enhanced_gates = scan.kind == Kind::Enhanced && timing::has_gates(a, pixels.frames);
        let gated = volumes > 1 && (scan.kind == Kind::Nuclear { gated: true } || enhanced_gates);
        let timings = if enhanced_gates {
            vec![timing::of_frames(a)?]
        } else {
            timing::of(a)?
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
            gated,
            timings,
            shape: [columns, rows, slices],
            placement,
            provenance: Provenance::of(a),
            parts: vec![pixels],
            instances: Vec::new(),
            gate_scans: Vec::new(),
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
        let mut whole = Vec::new();
        for file in files {
            monitor.check()?;
            let ScannedFile { scan, pixels } = ScannedFile::open(file, limits, monitor)?;
            series.name(&scan.attributes);
            if !scan.kind.is_single_slice() {
                whole.push(file.name());
            } else if let Some(reason) = series.add(&scan.attributes, pixels)? {
                return refuse(reason);
            }
        }
        whole.sort_unstable();
        if let Some(name) = whole.first() {
            return refuse(format!(
                "{name} is a volume of its own and not a slice of a series; {}",
                series.listed()
            ));
        }
        if let Some(reason) = series.contradiction() {
            return refuse(reason);
        }
        let Some(first) = series.first.take() else {
            return Err(VolumeError::NoFile);
        };
        let extent = series.parts[0].extent;
        let name = |part: usize| series.parts[part].name().to_owned();
        let stack = match Stack::of(&series.located, extent, first.gap, &name) {
            Ok(stack) => stack,
            Err(reason) => return refuse(reason),
        };
        let volumes = series.located.len() / stack.slices;
        if series.slices > stack.slices {
            return refuse(format!(
                "{} is {}, and they hold {} slices; slices are missing at an end",
                NUMBER_OF_SLICES.name, series.slices, stack.slices
            ));
        }
        let gated = volumes > 1 && series.gated;
        let timings = if gated {
            series.timings_of(&stack)?
        } else {
            Vec::new()
        };
        let mut warnings = first.warnings;
        warnings.extend(series.warnings(&stack, volumes));
        let voxels = (extent[0] * extent[1]) as u64 * stack.slices as u64;
        if voxels > limits.voxels {
            return Err(VolumeError::TooLarge {
                file: "the series".into(),
                what: "voxels",
                asked: voxels,
                limit: limits.voxels,
            });
        }
        let (parts, instances) = series.in_order(&stack.order);
        let stored = (0..parts.len()).map(|part| StoredSlice {
            part,
            frame: 0,
            volume: part / stack.slices,
            slice: part % stack.slices,
        });
        Ok(Self {
            name: "the series".into(),
            format: FileFormat::DicomSeries,
            content: Content::Slices(stored.collect()),
            volumes,
            gated,
            timings,
            shape: [extent[0], extent[1], stack.slices],
            placement: stack.placement,
            provenance: first.provenance,
            parts,
            instances,
            gate_scans: Vec::new(),
            warnings,
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

/// Checks that the numbers of slices, time slots and R-R intervals that a Nuclear Medicine Image states
/// are not above those that its vectors count.
fn check_numbers(
    a: &Attributes,
    slices: usize,
    gates: usize,
    warnings: &mut Vec<String>,
) -> Result<(), VolumeError> {
    let stated = |attribute| a.shorts(attribute).first().map(|n| usize::from(*n));
    if let Some(stated) = stated(NUMBER_OF_SLICES) {
        if stated > slices {
            let reason = format!("the frames hold {slices} slices; slices are missing");
            return Err(a.wrong(NUMBER_OF_SLICES.name, &stated.to_string(), reason));
        }
        if stated < slices {
            warnings.push(format!(
                "{} is {stated}, but the frames hold {slices} slices, which are all read.",
                NUMBER_OF_SLICES.name
            ));
        }
    }
    let counted = |vector| a.shorts(vector).into_iter().max().map(usize::from);
    for (number, vector, what) in [
        (TIME_SLOTS, TIME_SLOT_VECTOR, "time slots"),
        (RR_INTERVALS, RR_INTERVAL_VECTOR, "R-R intervals"),
    ] {
        let (stated, held) = (stated(number).unwrap_or(1), counted(vector).unwrap_or(1));
        if stated > held {
            let reason =
                format!("the frames hold {held} {what} ({gates} gates); gates are missing");
            return Err(a.wrong(number.name, &stated.to_string(), reason));
        }
    }
    Ok(())
}

/// A warning about an emission image whose description is that of an attenuation map.
fn attenuation_warning(a: &Attributes) -> Option<String> {
    if !matches!(a.text(MODALITY).as_deref(), Some("NM" | "PT")) {
        return None;
    }
    let text = a.prose(SERIES_DESCRIPTION)?.to_lowercase();
    let words: Vec<&str> = text.split(|c: char| !c.is_alphanumeric()).collect();
    let any = |names: &[&str]| words.iter().any(|word| names.contains(word));
    let map = any(&["mumap", "umap", "µmap", "μmap", "transmission"])
        || any(&["attenuation", "mu", "µ", "μ"]) && any(&["map", "maps"]);
    map.then(|| {
        format!(
            "{} is that of an attenuation map: a scan of uptake is expected.",
            SERIES_DESCRIPTION.name
        )
    })
}

/// Checks that the functional groups do not describe more frames than there are.
fn check_groups(a: &Attributes, frames: usize) -> Result<(), VolumeError> {
    let described = a.frames_described();
    if described > frames {
        Err(a.wrong(
            NUMBER_OF_FRAMES.name,
            &frames.to_string(),
            format!(
                "the Per-frame Functional Groups Sequence (5200,9230) describes {described} frames"
            ),
        ))
    } else {
        Ok(())
    }
}

/// The order of files where one of them has to speak for all: Instance Number, SOP Instance UID,
/// name.
type FirstKey = (u64, String, String);

/// The file that speaks for its series.
struct First {
    key: FirstKey,
    provenance: Provenance,
    /// About its text.
    warnings: Vec<String>,
    /// The distance of slices that it states, in millimetres.
    gap: Option<f64>,
}

/// The files of a series found so far.
#[derive(Default)]
struct Series {
    parts: Vec<Pixels>,
    located: Vec<Located>,
    /// SOP Instance UID of each part.
    instances: Vec<String>,
    /// The timing that each part states; an error counts only where the series is gated.
    timings: Vec<Result<GateTiming, VolumeError>>,
    /// The part of each SOP Instance UID.
    known: BTreeMap<String, usize>,
    /// Every series by its UID.
    names: BTreeMap<String, SeriesName>,
    /// The first instance.
    first: Option<First>,
    /// Whether a file says that the volumes are gates.
    gated: bool,
    /// Files that repeat an instance.
    repeated: usize,
    /// The most that any file states: slices of a volume, volumes, images.
    slices: usize,
    volumes: usize,
    images: f64,
    /// Whether the description is that of another kind of image.
    warning: Option<String>,
}

/// A series in a person's words.
#[derive(Default)]
struct SeriesName {
    number: Option<String>,
    description: Option<String>,
    files: usize,
}

impl Series {
    /// Counts the file with attributes `a` to its series.
    fn name(&mut self, a: &Attributes) {
        let uid = a.text(SERIES_UID).unwrap_or_default();
        let name = self.names.entry(uid).or_default();
        // The least, whatever the order of the files.
        let least = |known: &mut Option<String>, given: Option<String>| {
            if known.is_none() || given.is_some() && given < *known {
                *known = given;
            }
        };
        least(&mut name.number, a.text(SERIES_NUMBER));
        least(&mut name.description, a.prose(SERIES_DESCRIPTION));
        name.files += 1;
    }

    /// Adds a slice; `Some` says why it cannot be one of the series.
    fn add(&mut self, a: &Attributes, pixels: Pixels) -> Result<Option<String>, VolumeError> {
        let instance = a.text(SOP_INSTANCE).unwrap_or_default();
        let mut located = Located::of(a, self.parts.len(), 0)?;
        located.marks = Marks::of_file(a);
        if let Some(known) = self.known.get(&instance) {
            if located.is_same_place(&self.located[*known])
                && image_hash(&pixels)? == image_hash(&self.parts[*known])?
            {
                self.repeated += 1;
                return Ok(None);
            }
            let mut names = [pixels.name(), self.parts[*known].name()];
            names.sort_unstable();
            return Ok(Some(format!(
                "{} and {} have the same SOP Instance UID (0008,0018) and are different images; \
                 an export that gives each image its own is needed",
                names[0], names[1]
            )));
        }
        if !instance.is_empty() {
            self.known.insert(instance.clone(), self.parts.len());
        }
        let number = match a.decimals::<1>(INSTANCE_NUMBER) {
            Ok(Some([number])) if number >= 0.0 => number as u64,
            _ => u64::MAX,
        };
        let key = (number, instance.clone(), pixels.name().to_owned());
        if self.first.as_ref().is_none_or(|first| key < first.key) {
            self.first = Some(First {
                key,
                provenance: Provenance::of(a),
                warnings: Provenance::warnings(a),
                gap: stated_gap(a)?,
            });
        }
        if timing::is_of_gates(a) {
            self.gated = true;
        }
        let stated = |attribute| a.shorts(attribute).first().map_or(1, |n| usize::from(*n));
        self.slices = self.slices.max(stated(NUMBER_OF_SLICES));
        let volumes = stated(TIME_SLOTS) * stated(RR_INTERVALS) * stated(TIME_SLICES);
        self.volumes = self.volumes.max(volumes);
        self.warning = attenuation_warning(a).or(self.warning.take());
        if let Ok(Some([images])) = a.decimals::<1>(IMAGES_IN_ACQUISITION) {
            self.images = self.images.max(images);
        }
        self.located.push(located);
        self.instances.push(instance);
        self.timings.push(timing::of_slice(a));
        self.parts.push(pixels);
        Ok(None)
    }

    /// The series, and how to choose one.
    fn listed(&self) -> String {
        let each = self.names.iter().take(8).map(|(uid, name)| {
            let number = name.number.as_deref().map(clip);
            let number = number.map_or_else(|| "without number".into(), |n| format!("number {n}"));
            let described = name.description.as_deref().map(clip);
            let described = described.map_or_else(String::new, |text| format!(" \"{text}\""));
            format!(
                "{number}{described} (UID {}, {} files)",
                clip(uid),
                name.files
            )
        });
        let list: Vec<String> = each.collect();
        format!(
            "they belong to {} series: {}; send the files of one of them alone",
            self.names.len(),
            list.join(", ")
        )
    }

    /// Why the files are not one series.
    fn contradiction(&self) -> Option<String> {
        if self.names.len() > 1 {
            return Some(self.listed());
        }
        let extents = self.parts.iter().map(|part| part.extent);
        let (least, most) = (extents.clone().min()?, extents.max()?);
        (least != most).then(|| {
            format!(
                "some have {} x {} pixels, others {} x {}",
                least[0], least[1], most[0], most[1]
            )
        })
    }

    /// Warnings about `volumes` volumes in `stack`.
    fn warnings(&self, stack: &Stack, volumes: usize) -> Vec<String> {
        let mut warnings: Vec<String> = self.warning.clone().into_iter().collect();
        if self.repeated > 0 {
            warnings.push(format!(
                "{} files repeat an instance of the series and were left out.",
                self.repeated
            ));
        }
        if self.images > self.parts.len() as f64 {
            warnings.push(format!(
                "{} is {}, and {} images were sent: part of the series may be missing.",
                IMAGES_IN_ACQUISITION.name,
                self.images,
                self.parts.len()
            ));
        }
        if self.slices > 1 && self.slices < stack.slices {
            warnings.push(format!(
                "{} is {}, but the files hold {} slices, which are all read.",
                NUMBER_OF_SLICES.name, self.slices, stack.slices
            ));
        }
        if self.volumes > volumes {
            warnings.push(format!(
                "The header states {} volumes (time slots, R-R intervals, time slices), and the \
                 files hold {volumes}: part of the series may be missing.",
                self.volumes
            ));
        }
        warnings
    }

    /// The timing of each R-R interval, as the first slice of its first gate states it.
    fn timings_of(&mut self, stack: &Stack) -> Result<Vec<GateTiming>, VolumeError> {
        let volumes = stack.order.len() / stack.slices;
        let mut timings = Vec::new();
        let mut gate = 0;
        while gate < volumes {
            let part = stack.order[gate * stack.slices];
            let stated = mem::replace(&mut self.timings[part], Ok(GateTiming::default()))?;
            gate += stated.gates_of_interval(volumes);
            timings.push(stated);
        }
        Ok(timings)
    }

    /// The parts and instances in the given order.
    fn in_order(self, order: &[usize]) -> (Vec<Pixels>, Vec<String>) {
        let mut numbered: Vec<usize> = vec![0; order.len()];
        for (place, part) in order.iter().enumerate() {
            numbered[*part] = place;
        }
        let files = self.parts.into_iter().zip(self.instances);
        let mut files: Vec<_> = numbered.into_iter().zip(files).collect();
        files.sort_unstable_by_key(|(place, _)| *place);
        files.into_iter().map(|(_, file)| file).unzip()
    }
}

/// A hash over the values of the only frame of `pixels`.
fn image_hash(pixels: &Pixels) -> Result<u64, VolumeError> {
    let mut hasher = DefaultHasher::new();
    let mut take = |_: usize, values: &[f32]| {
        for value in values {
            value.to_bits().hash(&mut hasher);
        }
    };
    let figures = Figures::default();
    let mut reader = pixels.open()?;
    reader.read(0, 0, figures, &mut take, &mut |_| Ok(()))?;
    Ok(hasher.finish())
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

    fn gate_timings(&self) -> Vec<GateTiming> {
        self.timings.clone()
    }

    fn provenance(&self, frame: usize) -> Option<Provenance> {
        let of_gate = self.gate_scans.get(frame);
        let mut provenance = of_gate.unwrap_or(&self.provenance).clone();
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
                // Instances of one frame each have no numbers of frames.
                if slices.iter().any(|slice| slice.frame > 0) {
                    let frames = slices.iter().map(|slice| slice.frame as u32 + 1);
                    provenance.slice_frames = frames.collect();
                }
            } else if (self.parts.len() == 1 || of_gate.is_some())
                && self.format != FileFormat::DicomSeries
            {
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
