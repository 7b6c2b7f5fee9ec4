//! Slices in DICOM: Nuclear Medicine, Enhanced and single-frame images, and Segmentations.
//!
//! In: one file, or the files of a series. Out: voxels, their place in the patient, and whose scan it
//! is. After DICOM PS3.3 and PS3.5:
//!
//! 1. `stored`: the data set of a file, whose attributes [`ventriform_dicom::read`] collects in one pass up to the
//!    pixels.
//! 2. What the object is, the same crate says. One that holds no slices is refused by its name, with what to send;
//!    `company`: beside others it is left out.
//! 3. The frames of a Nuclear Medicine Image are ordered by its vectors; `geometry` places them; `projections`: those
//!    that slices are reconstructed from; `posture`: what else says how they lie in the patient. `stack`: orders and
//!    places all other frames by their positions. `segments`: labels. `gate_series`: files or series of one gate each.
//!    `one_scan`: what files of one volume must agree on; `scans` lists those that are several.
//! 4. `pixels`: checks the pixel format and decodes frame by frame ([`ventriform_dicom::codec`]).
//! 5. `provenance`: patient, study, series, instances and acquisition; `rest_stress`: which scan of a study they name.
//!
//! Guaranteed: no memory is taken for a stated size before the file was found large enough for it;
//! beside the voxels, one compressed frame and at most 16 MiB of attributes are held. A damaged
//! compressed frame is an error, even if a decoder panics.
//!
//! Not read: pixels in colour, JPEG with more than 8 bits that is not lossless, High-Throughput
//! JPEG 2000, JPEG XL, video, and values that are mapped by a table or in ranges.

mod company;
mod described;
mod gate_series;
mod geometry;
mod header;
pub(crate) mod one_scan;
mod pixels;
mod posture;
mod projections;
mod provenance;
mod rest_stress;
mod scans;
mod segments;
mod stack;
mod stored;
mod timing;

#[cfg(test)]
mod tests;

pub use header::{DicomHeader, read_header, storage_classes, transfer_syntaxes};
pub(super) use ventriform_dicom::read::syntax::is_dicom;

use self::gate_series::{Joined, Place};
use self::one_scan::{Reach, ScanStatement, contradiction};
use self::pixels::{Pixels, too_many_voxels};
use self::projections::Acquisition;
use self::scans::Scans;
use self::segments::Segments;
use self::stack::{Located, Stack, stated_gap};
use self::stored::StoredDataSet;
use super::decode::{DataType, Figures};
use super::facts::{FileFormat, LengthUnit};
use super::gate_timing::GateTiming;
use super::limits::{FromProjections, ReadLimits};
use super::open::{Decoded, HeaderFacts, OpenVolume, Placement};
use super::source::VolumeFile;
use super::summary::Tally;
use super::{Provenance, Segment, VolumeError};
use crate::base::progress::{Monitor, Stage};
use crate::image::grid::gates::GATE_COUNTS;
use crate::image::reconstruct::Projections;
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::mem;
use ventriform_dicom::read::ReadError;
use ventriform_dicom::read::attributes::{
    Attributes, IMAGES_IN_ACQUISITION, INSTANCE_NUMBER, MODALITY, NUMBER_OF_FRAMES,
    NUMBER_OF_SLICES, RR_INTERVALS, SERIES_DESCRIPTION, SERIES_UID, SLICE_THICKNESS, SOP_INSTANCE,
    TIME_SLICES, TIME_SLOTS,
};
use ventriform_dicom::read::frames::FrameOrder;
use ventriform_dicom::read::kind::Kind;
use ventriform_dicom::read::scan::{self, Scan};
use ventriform_dicom::read::volumes::Marks;
use ventriform_dicom::values::is_uid;

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
    /// Whose scan each gate is, if each is a file or a series of its own; empty otherwise.
    gate_scans: Vec<Provenance>,
    /// What its first file says of the scan.
    statement: ScanStatement,
    warnings: Vec<String>,
}

/// The values of the frames.
enum Content {
    /// Slices, in the order in which they are stored.
    Slices(Vec<StoredSlice>),
    /// Segments on a grid.
    Labels(Segments),
    /// Projections, of which each volume is made.
    Projections(Acquisition),
}

/// A stored frame and the slice that it holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct StoredSlice {
    part: usize,
    frame: usize,
    volume: usize,
    slice: usize,
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
        let stored = StoredDataSet::find(file, limits)?;
        let mut source = stored.open(file, limits.unpacked_bytes)?;
        let scan = scan::scan(&mut source, &stored.syntax, &monitor.goes_on())?;
        let pixels = Pixels::new(&scan, file, stored, limits)?;
        Ok(Self { scan, pixels })
    }

    /// Whether it is a Nuclear Medicine image of one frame: a slice, if others of its series lie beside it.
    fn is_one_slice(&self) -> bool {
        matches!(self.scan.kind, Kind::Nuclear { .. }) && self.pixels.frames == 1
    }
}

impl DicomFile {
    /// Reads and checks the attributes of `files`, of which there is at least one.
    pub(super) fn open(
        files: &[&VolumeFile],
        from: &FromProjections,
        limits: &ReadLimits,
        monitor: &Monitor,
    ) -> Result<Self, VolumeError> {
        // What an error names must not depend on the order of the files.
        let mut files = files.to_vec();
        files.sort_by(|a, b| a.name().cmp(b.name()));
        let sorted = company::set_apart(&files, limits, monitor)?;
        let mut opened = match &sorted.slices[..] {
            [file] => Self::single(file, from, limits, monitor)?,
            slices => match gate_series::open(slices, limits, monitor)? {
                Joined::Gates(gates) => *gates,
                Joined::Contradiction(reason) => return Err(not_one(slices.len(), reason)),
                Joined::No => Self::series(slices, limits, monitor)?,
            },
        };
        opened.warnings.extend(sorted.notes);
        Ok(opened)
    }

    fn single(
        file: &VolumeFile,
        from: &FromProjections,
        limits: &ReadLimits,
        monitor: &Monitor,
    ) -> Result<Self, VolumeError> {
        let scanned = ScannedFile::open(file, limits, monitor)?;
        Self::of_scan(file, scanned, from, limits)
    }

    /// The volumes of one file.
    fn of_scan(
        file: &VolumeFile,
        scanned: ScannedFile,
        from: &FromProjections,
        limits: &ReadLimits,
    ) -> Result<Self, VolumeError> {
        let ScannedFile { scan, pixels } = scanned;
        let a = &scan.attributes;
        let mut warnings = Provenance::warnings(a);
        let [columns, rows] = pixels.extent;
        let (content, volumes, slices, placement) = match scan.kind {
            Kind::Nuclear { gated } => {
                let order = FrameOrder::new(a, pixels.frames, gated, &mut warnings)?;
                let (slices, volumes) = (order.slices(), order.gates());
                check_numbers(a, &order, &mut warnings)?;
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
            Kind::Projections { gated } => {
                let raw = Acquisition::new(a, &pixels, gated, from, &mut warnings)?;
                let placement = raw.placement(a)?;
                let (volumes, slices) = (raw.gates(), rows);
                (Content::Projections(raw), volumes, slices, placement)
            }
            Kind::Segmentation => {
                let (segments, placement) = Segments::new(a, &pixels, limits.voxels)?;
                let slices = segments.slices;
                (Content::Labels(segments), 1, slices, placement)
            }
            Kind::Enhanced | Kind::Slice => {
                check_groups(a, pixels.frames)?;
                let located = (0..pixels.frames).map(|frame| {
                    let mut located = Located::new(a, 0, frame)?;
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
                    return Err(a.missing(SLICE_THICKNESS).into());
                }
                let name = |frame| format!("frame {}", frame + 1);
                let stack = Stack::new(&located, pixels.extent, gap, &name);
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
        let nuclear_gates = matches!(
            scan.kind,
            Kind::Nuclear { gated: true } | Kind::Projections { gated: true }
        );
        let gated = volumes > 1 && (nuclear_gates || enhanced_gates);
        let timings = if enhanced_gates {
            vec![timing::of_frames(a)?]
        } else {
            timing::gate_timings(a)?
        };
        let mut provenance = Provenance::from_attributes(a);
        let shape = match &content {
            Content::Projections(raw) => {
                let [method, filter] = raw.derivation();
                provenance.reconstruction_method = Some(method);
                provenance.convolution_kernel = Some(filter);
                provenance.scan_arc = Some(format!("{:.0}", raw.arc_deg));
                raw.shape()
            }
            _ => [columns, rows, slices],
        };
        let voxels = (shape[0] * shape[1]) as u64 * slices as u64;
        if voxels > limits.voxels {
            return Err(too_many_voxels(a, voxels, limits.voxels));
        }
        Ok(Self {
            name: file.name().into(),
            format: match scan.kind {
                Kind::Nuclear { .. } => FileFormat::DicomNm,
                Kind::Projections { .. } => FileFormat::DicomProjections,
                Kind::Enhanced => FileFormat::DicomEnhanced,
                Kind::Slice => FileFormat::DicomSeries,
                Kind::Segmentation => FileFormat::DicomSeg,
            },
            content,
            volumes,
            gated,
            timings,
            shape,
            placement,
            provenance,
            parts: vec![pixels],
            instances: Vec::new(),
            gate_scans: Vec::new(),
            statement: ScanStatement::from_attributes(a),
            warnings,
        })
    }

    /// Opens the files of a series, each with one slice, or of a series for each gate.
    fn series(
        files: &[&VolumeFile],
        limits: &ReadLimits,
        monitor: &Monitor,
    ) -> Result<Self, VolumeError> {
        let mut scans = Scans::default();
        let mut all: BTreeMap<String, Series> = BTreeMap::new();
        for file in files {
            monitor.check()?;
            let scanned = ScannedFile::open(file, limits, monitor)?;
            let statement = ScanStatement::from_attributes(&scanned.scan.attributes);
            let whole = !scanned.scan.kind.is_single_slice() && !scanned.is_one_slice();
            scans.add(&scanned, &statement, whole);
            if !whole {
                let ScannedFile { scan, pixels } = scanned;
                let uid = scan.attributes.text(SERIES_UID).unwrap_or_default();
                let series = all.entry(uid).or_default();
                series.add(&scan.attributes, pixels, statement)?;
            }
        }
        if scans.whole() > 0 {
            return Err(not_one(files.len(), scans.listed()));
        }
        if scans.series() > 1 {
            return match Series::gates(all.into_values().collect(), limits)? {
                Joined::Gates(gates) => Ok(*gates),
                Joined::Contradiction(reason) => Err(not_one(files.len(), reason)),
                Joined::No => Err(not_one(files.len(), scans.listed())),
            };
        }
        let series = all.into_values().next().ok_or(VolumeError::NoFile)?;
        series.volumes(false, limits).map(|(file, _)| file)
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
            Content::Projections(raw) => {
                let volumes = volume.map_or(0..self.volumes, |volume| volume..volume + 1);
                let count = volumes.len();
                let (mut tally, mut warnings) = (Tally::default(), Vec::new());
                for (done, volume) in volumes.enumerate() {
                    let part = monitor.part(done, count);
                    let (voxels, own) = raw.volume(&self.parts[0], &[volume], false, &part)?;
                    tally.add_portion(&voxels);
                    take(0, &voxels);
                    for warning in own {
                        if !warnings.contains(&warning) {
                            warnings.push(warning);
                        }
                    }
                }
                Ok((tally, warnings))
            }
        }
    }
}

/// Checks that the numbers of slices, time slots and R-R intervals that a Nuclear Medicine Image states
/// are not above those that its vectors count.
fn check_numbers(
    a: &Attributes,
    order: &FrameOrder,
    warnings: &mut Vec<String>,
) -> Result<(), ReadError> {
    let (slices, gates) = (order.slices(), order.gates());
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
    let [intervals, slots] = order.gating();
    for (number, held, what) in [
        (TIME_SLOTS, slots, "time slots"),
        (RR_INTERVALS, intervals, "R-R intervals"),
    ] {
        let stated = stated(number).unwrap_or(1);
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
fn check_groups(a: &Attributes, frames: usize) -> Result<(), ReadError> {
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
    /// What each part says of the scan.
    statements: Vec<ScanStatement>,
    /// What each part says of its place among gates.
    places: Vec<Place>,
    /// The part of each SOP Instance UID.
    known: BTreeMap<String, usize>,
    /// The first instance.
    first: Option<First>,
    /// Whether a file says that the volumes are gates.
    gated: bool,
    /// Files that say that the series is one gate.
    of_a_gate: usize,
    /// What files that repeat an instance say of the scan.
    repeated: Vec<ScanStatement>,
    /// Two files that have one UID and are different images.
    clash: Option<String>,
    /// The most that any file states: slices of a volume, volumes, images.
    slices: usize,
    time_points: usize,
    images: f64,
    /// Whether the description is that of another kind of image.
    warning: Option<String>,
}

impl Series {
    /// Adds a slice.
    fn add(
        &mut self,
        a: &Attributes,
        pixels: Pixels,
        statement: ScanStatement,
    ) -> Result<(), VolumeError> {
        let instance = a.text(SOP_INSTANCE).unwrap_or_default();
        let mut located = Located::new(a, self.parts.len(), 0)?;
        located.marks = Marks::of_file(a);
        if let Some(known) = self.known.get(&instance) {
            if located.is_same_place(&self.located[*known])
                && image_hash(&pixels)? == image_hash(&self.parts[*known])?
            {
                self.repeated.push(statement);
                return Ok(());
            }
            let mut names = [pixels.name(), self.parts[*known].name()];
            names.sort_unstable();
            self.clash.get_or_insert(format!(
                "{} and {} have the same SOP Instance UID (0008,0018) and are different images; \
                 an export that gives each image its own is needed",
                names[0], names[1]
            ));
        }
        if !instance.is_empty() && !self.known.contains_key(&instance) {
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
                provenance: Provenance::from_attributes(a),
                warnings: Provenance::warnings(a),
                gap: stated_gap(a)?,
            });
        }
        if timing::is_of_gates(a) {
            self.gated = true;
        }
        if timing::is_slice_of_a_gate(a) {
            self.of_a_gate += 1;
        }
        let stated = |attribute| a.shorts(attribute).first().map_or(1, |n| usize::from(*n));
        self.slices = self.slices.max(stated(NUMBER_OF_SLICES));
        let time_points = stated(TIME_SLOTS) * stated(RR_INTERVALS) * stated(TIME_SLICES);
        self.time_points = self.time_points.max(time_points);
        self.warning = attenuation_warning(a).or(self.warning.take());
        if let Ok(Some([images])) = a.decimals::<1>(IMAGES_IN_ACQUISITION) {
            self.images = self.images.max(images);
        }
        self.located.push(located);
        self.instances.push(instance);
        self.timings.push(timing::of_slice(a));
        self.statements.push(statement);
        self.places.push(Place::from_attributes(a));
        self.parts.push(pixels);
        Ok(())
    }

    /// Why the files are not one series.
    fn contradiction(&self) -> Option<String> {
        let said: Vec<&ScanStatement> = self.statements.iter().chain(&self.repeated).collect();
        if let Some(reason) = contradiction(&said, Reach::Series) {
            return Some(reason);
        }
        if let Some(clash) = &self.clash {
            return Some(clash.clone());
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

    /// Why the slices in `stack` are not of one scan each; all of it is one if it is `gated`.
    fn mixture(&self, stack: &Stack, gated: bool) -> Option<String> {
        let each = if gated {
            stack.order.len()
        } else {
            stack.slices
        };
        let mut volumes = stack.order.chunks(each);
        volumes.find_map(|volume| {
            let said: Vec<&ScanStatement> = volume.iter().map(|at| &self.statements[*at]).collect();
            contradiction(&said, Reach::Volume)
        })
    }

    /// The gates that `all` series are, one each.
    fn gates(all: Vec<Self>, limits: &ReadLimits) -> Result<Joined, VolumeError> {
        let is_gate = |series: &Self| series.of_a_gate == series.parts.len();
        if all.len() < *GATE_COUNTS.start() || !all.iter().all(is_gate) {
            return Ok(Joined::No);
        }
        let (mut gates, mut places) = (Vec::new(), Vec::new());
        for series in all {
            let (gate, place) = series.volumes(true, limits)?;
            if gate.volumes != 1 {
                return Ok(Joined::No);
            }
            gates.push(gate);
            places.push(place);
        }
        let said = gates.iter().map(|gate| gate.statement.clone()).collect();
        gate_series::joined(gates, places, said, "series")
    }

    /// The volumes that the files make up, with the place of the first slice among gates; of a series that is one gate
    /// of several if `one_gate`.
    fn volumes(
        mut self,
        one_gate: bool,
        limits: &ReadLimits,
    ) -> Result<(DicomFile, Place), VolumeError> {
        let count = self.parts.len() + self.repeated.len();
        let refuse = |reason| Err(not_one(count, reason));
        if let Some(reason) = self.contradiction() {
            return refuse(reason);
        }
        let Some(mut first) = self.first.take() else {
            return Err(VolumeError::NoFile);
        };
        let extent = self.parts[0].extent;
        let name = |part: usize| self.parts[part].name().to_owned();
        let stack = match Stack::new(&self.located, extent, first.gap, &name) {
            Ok(stack) => stack,
            Err(reason) => return refuse(reason),
        };
        let volumes = self.located.len() / stack.slices;
        if self.slices > stack.slices {
            return refuse(format!(
                "{} is {}, and they hold {} slices; slices are missing at an end",
                NUMBER_OF_SLICES.name, self.slices, stack.slices
            ));
        }
        let gated = volumes > 1 && self.gated;
        if let Some(reason) = self.mixture(&stack, gated) {
            return refuse(reason);
        }
        let timings = if gated || one_gate {
            self.timings_of(&stack)?
        } else {
            Vec::new()
        };
        let mut warnings = first.warnings;
        let stated = if one_gate { self.time_points } else { volumes };
        warnings.extend(self.warnings(&stack, stated));
        let voxels = (extent[0] * extent[1]) as u64 * stack.slices as u64;
        if voxels > limits.voxels {
            return Err(VolumeError::TooLarge {
                file: "the series".into(),
                what: "voxels",
                asked: voxels,
                limit: limits.voxels,
            });
        }
        let lowest = stack.order[0];
        let (statement, place) = (
            mem::take(&mut self.statements[lowest]),
            self.places[lowest].clone(),
        );
        let (parts, mut instances) = self.in_order(&stack.order);
        let nameless = instances.iter().filter(|uid| !is_uid(uid)).count();
        if nameless > 0 {
            warnings.push(format!(
                "{} of {nameless} files is no UID; no DICOM object made of them refers to the files.",
                SOP_INSTANCE.name
            ));
            instances.clear();
            first.provenance.sop_instance_uid = None;
        }
        let stored = (0..parts.len()).map(|part| StoredSlice {
            part,
            frame: 0,
            volume: part / stack.slices,
            slice: part % stack.slices,
        });
        let file = DicomFile {
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
            statement,
            warnings,
        };
        Ok((file, place))
    }

    /// Warnings about `volumes` volumes in `stack`.
    fn warnings(&self, stack: &Stack, volumes: usize) -> Vec<String> {
        let mut warnings: Vec<String> = self.warning.clone().into_iter().collect();
        if !self.repeated.is_empty() {
            warnings.push(format!(
                "{} files repeat an instance of the series and were left out.",
                self.repeated.len()
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
        if self.time_points > volumes {
            warnings.push(format!(
                "The header states {} volumes (time slots, R-R intervals, time slices), and the \
                 files hold {volumes}: part of the series may be missing.",
                self.time_points
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

/// The refusal of `count` files for `reason`.
fn not_one(count: usize, reason: String) -> VolumeError {
    VolumeError::NotOneSeries { count, reason }
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
        let made = matches!(self.content, Content::Projections(_));
        if made {
            file_shape = vec![first.extent[0], first.extent[1], first.frames];
        }
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
            data_type: if made { DataType::F32 } else { first.data_type }.name(),
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

    fn reads_again(&self) -> bool {
        true
    }

    fn scan_statement(&self) -> Option<&ScanStatement> {
        Some(&self.statement)
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
            Content::Slices(_) | Content::Projections(_) => &[],
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

    fn stream_coarse(
        &mut self,
        frame: usize,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        let Content::Projections(raw) = &self.content else {
            return self.stream_frame(frame, take, monitor);
        };
        let (voxels, _) = raw.volume(&self.parts[0], &[frame], true, monitor)?;
        take(0, &voxels);
        Ok(())
    }

    /// Of projections, the counts are added before an image is made of them: noise then weighs less.
    fn decode_sum(
        &mut self,
        frames: &[usize],
        monitor: &Monitor,
    ) -> Option<Result<Decoded, VolumeError>> {
        let Content::Projections(raw) = &self.content else {
            return None;
        };
        let made = raw.volume(&self.parts[0], frames, false, monitor);
        Some(made.map(|(voxels, warnings)| {
            let mut tally = Tally::default();
            tally.add_portion(&voxels);
            Decoded {
                voxels,
                tally,
                warnings,
            }
        }))
    }

    fn projections(
        &self,
        frames: &[usize],
        monitor: &Monitor,
    ) -> Option<Result<Projections, VolumeError>> {
        let Content::Projections(raw) = &self.content else {
            return None;
        };
        let counts = raw.counts(&self.parts[0], frames, monitor);
        Some(counts.map(|(projections, _)| projections))
    }

    fn decode_all(
        &mut self,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(Tally, Vec<String>), VolumeError> {
        self.stream(None, take, monitor)
    }
}
