//! Steps that are the same for every format once a file's header has been checked.
//!
//! A format implements [`OpenVolume`]; [`read`] and [`inspect`] do the rest.

use super::decode::DataType;
use super::dicom::one_scan::ScanStatement;
use super::facts::{
    AffineSource, ByteOrder, FileFormat, GateFacts, IntensitySummary, LengthUnit, VolumeFacts,
};
use super::gate_names::NamesSay;
use super::gate_timing::GateTiming;
use super::left_out::LeftOut;
use super::limits::ReadOptions;
use super::nifti::grid::StatedGrid;
use super::preview::MiddlePlanes;
use super::summary::{Coherence, LabelCounts, NO_LABEL, Tally, judge, summarise};
use super::{Provenance, Segment, Volume, VolumeError};
use crate::base::geometry::frame::{VOXEL_MM, VoxelToPatient};
use crate::base::progress::Monitor;
use crate::image::draw::Image;
use crate::image::grid::gates::GATE_COUNTS;
use crate::image::reconstruct::Projections;
use crate::mesh::TriMesh;

/// Above this size 32-bit floats do not tell all whole numbers apart.
const MAX_EXACT_WHOLE: f32 = 16_777_216.0;

/// A volume and the facts about the file it was read from.
#[derive(Debug, Clone)]
pub struct Reading {
    /// Voxels and their position in the patient.
    pub volume: Volume,
    /// Facts about the file.
    pub facts: VolumeFacts,
    /// Whose scan it is; `None` unless the file is DICOM.
    pub provenance: Option<Provenance>,
    /// The place of the grid as the file states it; `None` unless the file is NIfTI.
    pub stated_grid: Option<StatedGrid>,
    /// Why no model can be made of it, though it can be described.
    pub problem: Option<VolumeError>,
}

impl Reading {
    /// Refuses what can be described, and of which no model can be made: a single slice, and a surface whose unit
    /// nobody stated and whose size is not that of an organ.
    ///
    /// # Errors
    /// [`VolumeError::SingleSlice`], [`VolumeError::VoxelSize`] or [`VolumeError::Mesh`].
    pub fn usable(self) -> Result<Self, VolumeError> {
        let shape = self.volume.shape;
        let spacing_mm = self.volume.frame.spacing();
        match &self.problem {
            Some(problem) => Err(problem.clone()),
            None if shape.contains(&1) => Err(VolumeError::SingleSlice { shape }),
            None if !spacing_mm.iter().all(|mm| VOXEL_MM.contains(mm)) => {
                Err(VolumeError::VoxelSize { spacing_mm })
            }
            None => Ok(self),
        }
    }

    /// The DICOM Frame of Reference UID of the volume; `None` unless its position there is known.
    pub fn frame_of_reference(&self) -> Option<&str> {
        let placed = self.facts.affine_source == AffineSource::ImagePosition;
        let from = self.provenance.as_ref().filter(|_| placed)?;
        from.frame_of_reference()
    }
}

/// Whether `intensity` is of whole numbers of which 32-bit floats do not tell all apart.
pub(super) fn is_rounded(intensity: &IntensitySummary, data_type: &str) -> bool {
    let wide = !matches!(data_type, "uint8" | "int8" | "uint16" | "int16" | "float32");
    let size = intensity.maximum.max(-intensity.minimum);
    wide && intensity.integral && size >= MAX_EXACT_WHOLE
}

/// A file whose header has been read and checked.
pub(super) trait OpenVolume {
    /// Everything the header says about the volumes.
    fn header(&self) -> HeaderFacts<'_>;

    /// Whose scan volume number `frame`, from 0, is; `None` where the format does not say.
    fn provenance(&self, _frame: usize) -> Option<Provenance> {
        None
    }

    /// What its first file says of the scan; `None` unless it is DICOM.
    fn scan_statement(&self) -> Option<&ScanStatement> {
        None
    }

    /// The place of the grid in the words of NIfTI; `None` for other formats.
    fn stated_grid(&self) -> Option<StatedGrid> {
        None
    }

    /// Why no model can be made of it.
    fn problem(&self) -> Option<VolumeError> {
        None
    }

    /// The closed surface whose inside the voxels are, LPS mm; `None` for others.
    fn surface(&self) -> Option<&TriMesh> {
        None
    }

    /// Why several volumes are not gates of one heart beat, in words that continue a sentence; `None` if
    /// the format does not say.
    fn why_not_gated(&self) -> Option<&str> {
        None
    }

    /// Whether nothing but their number calls its volumes gates.
    fn assumes_gates(&self) -> bool {
        false
    }

    /// What the names of files of one volume each say.
    fn names_say(&self) -> NamesSay {
        NamesSay::Nothing
    }

    /// Whether volumes can be decoded in any order and more than once.
    fn reads_again(&self) -> bool {
        false
    }

    /// The names of the files that hold a volume each; empty for others.
    fn volume_names(&self) -> Vec<&str> {
        Vec::new()
    }

    /// Volumes among gates that are left out of their sum and of the beat.
    fn left_out(&self) -> LeftOut {
        LeftOut::default()
    }

    /// The stated timing of gated volumes, for each R-R interval; empty if the file states none.
    fn gate_timings(&self) -> Vec<GateTiming> {
        Vec::new()
    }

    /// The segments of a DICOM Segmentation; empty for all others.
    fn segments(&self) -> &[Segment] {
        &[]
    }

    /// Reads of a DICOM Segmentation no other segment from now on.
    fn keep_segment(&mut self, _number: u16) {}

    /// Decodes volume number `frame`, from 0.
    fn decode_frame(&mut self, frame: usize, monitor: &Monitor) -> Result<Decoded, VolumeError>;

    /// Decodes volume number `frame` without keeping its voxels: `take` is called with every portion
    /// of one or several rows or of a part of a row, and the number in the volume of its first voxel.
    fn stream_frame(
        &mut self,
        frame: usize,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError>;

    /// As [`OpenVolume::stream_frame`], with values from which volumes can be told apart by coarse blocks: those that are
    /// made from something else may be made quickly.
    fn stream_coarse(
        &mut self,
        frame: usize,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        self.stream_frame(frame, take, monitor)
    }

    /// The sum of these volumes, if something better is known than to add their values; `None` otherwise.
    fn decode_sum(
        &mut self,
        _frames: &[usize],
        _monitor: &Monitor,
    ) -> Option<Result<Decoded, VolumeError>> {
        None
    }

    /// The counts of these volumes together, as a camera acquired them; `None` unless the volumes are reconstructed
    /// here.
    fn projections(
        &self,
        _frames: &[usize],
        _monitor: &Monitor,
    ) -> Option<Result<Projections, VolumeError>> {
        None
    }

    /// As [`OpenVolume::stream_frame`], with the exact whole numbers of the voxels; fractions and missing
    /// values are [`NO_LABEL`].
    fn stream_labels(
        &mut self,
        frame: usize,
        take: &mut dyn FnMut(usize, &[i64]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        let label = |v: &f32| {
            if v.fract() == 0.0 && v.abs() <= MAX_EXACT_WHOLE {
                *v as i64
            } else {
                NO_LABEL
            }
        };
        let mut labels = Vec::new();
        let mut portion = |first: usize, voxels: &[f32]| {
            labels.clear();
            labels.extend(voxels.iter().map(label));
            take(first, &labels);
        };
        self.stream_frame(frame, &mut portion, monitor)
    }

    /// Decodes all volumes one after the other without keeping their voxels: `take` is called with
    /// every portion and the number of voxels before it in its volume, slices in stored order.
    fn decode_all(
        &mut self,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(Tally, Vec<String>), VolumeError>;
}

/// The content of a header that [`VolumeFacts`] repeats.
pub(super) struct HeaderFacts<'a> {
    /// Name of the file.
    pub file: &'a str,
    pub format: FileFormat,
    pub byte_order: ByteOrder,
    /// Whether the voxels are stored in a gzipped file.
    pub compressed: bool,
    /// The stored data type, for example `int16`.
    pub data_type: &'static str,
    /// Slope and intercept, if the voxels are scaled.
    pub scaling: Option<(f64, f64)>,
    /// All dimensions in the file.
    pub file_shape: Vec<usize>,
    /// Number of volumes.
    pub frames: usize,
    /// Whether the volumes are gates of one heart beat, which may be summed.
    pub gated: bool,
    /// Voxels along i, j, k of one volume.
    pub shape: [usize; 3],
    pub placement: &'a Placement,
    pub unit: LengthUnit,
    /// Warnings about the header other than those of its placement.
    pub warnings: &'a [String],
}

/// Position of a voxel grid in the patient.
#[derive(Debug, Clone)]
pub(super) struct Placement {
    /// Voxel index to LPS millimetres.
    pub frame: VoxelToPatient,
    /// The fields that define the position.
    pub source: AffineSource,
    /// Assumptions and contradictions.
    pub warnings: Vec<String>,
}

/// The decoded voxels of one volume.
pub(super) struct Decoded {
    /// Values with slope and intercept applied, i fastest.
    pub voxels: Vec<f32>,
    /// Running figures over the voxels.
    pub tally: Tally,
    /// Warnings about the values.
    pub warnings: Vec<String>,
}

/// Reads the volume that `options` ask for.
pub(super) fn read(
    file: &mut dyn OpenVolume,
    options: ReadOptions,
    monitor: &Monitor,
) -> Result<Reading, VolumeError> {
    let header = file.header();
    let frame = options.choose(header.frames, header.gated);
    let frame = frame.map_err(|error| because(error, file.why_not_gated()))?;
    let decoded = match frame {
        Some(frame) => file.decode_frame(frame, monitor)?,
        None => sum(file, monitor)?,
    };
    let header = file.header();
    let shape = header.shape;
    let intensity = decoded
        .tally
        .with_labels(&decoded.voxels, shape[0], monitor)?;
    let volume = Volume {
        shape,
        voxels: decoded.voxels,
        frame: header.placement.frame.clone(),
        integral: intensity.integral,
    };
    let facts = VolumeFacts {
        gates: gates_of(file),
        ..facts(header, frame, intensity, decoded.warnings)?
    };
    let provenance = file.provenance(frame.unwrap_or_else(|| first_summed(file)));
    Ok(Reading {
        volume,
        facts,
        provenance,
        stated_grid: file.stated_grid(),
        problem: file.problem(),
    })
}

/// The gates of `file`; `None` if its volumes are no gates.
fn gates_of(file: &dyn OpenVolume) -> Option<GateFacts> {
    let header = file.header();
    let frames = header.frames - file.left_out().extra.len();
    header
        .gated
        .then(|| GateTiming::facts(&file.gate_timings(), frames))
}

/// `error` with the reason why the volumes are not summed.
pub(super) fn because(error: VolumeError, why: Option<&str>) -> VolumeError {
    match (error, why) {
        (VolumeError::FrameNeeded { frames, .. }, Some(why)) => VolumeError::FrameNeeded {
            frames,
            why: Some(why.to_owned()),
        },
        (error, _) => error,
    }
}

/// The first volume of `file` that is summed.
pub(super) fn first_summed(file: &dyn OpenVolume) -> usize {
    let left_out = file.left_out();
    let mut frames = 0..file.header().frames;
    frames.find(|frame| !left_out.has(*frame)).unwrap_or(0)
}

/// The sum of all volumes of `file` that are not left out.
fn sum(file: &mut dyn OpenVolume, monitor: &Monitor) -> Result<Decoded, VolumeError> {
    let frames = file.header().frames;
    let left_out = file.left_out();
    let kept: Vec<usize> = (0..frames).filter(|frame| !left_out.has(*frame)).collect();
    let mut sum = match file.decode_sum(&kept, monitor) {
        Some(sum) => sum?,
        None => added(file, &kept, monitor)?,
    };
    let mut tally = Tally::default();
    tally.add_portion(&sum.voxels);
    sum.tally = tally;
    sum.warnings.push(format!(
        "The {} gates were summed. Set `frame` to a number from 0 (the first) to {} (the last) for \
         one of them.",
        frames - left_out.count(),
        frames - 1
    ));
    Ok(sum)
}

/// The volumes `kept`, their values added.
fn added(
    file: &mut dyn OpenVolume,
    kept: &[usize],
    monitor: &Monitor,
) -> Result<Decoded, VolumeError> {
    let first = kept.first().copied().unwrap_or(0);
    let mut sum = file.decode_frame(first, monitor)?;
    for frame in kept.iter().skip(1) {
        let mut add = |first: usize, part: &[f32]| {
            let voxels = sum.voxels[first..].iter_mut();
            voxels.zip(part).for_each(|(sum, voxel)| *sum += voxel);
        };
        file.stream_frame(*frame, &mut add, monitor)?;
    }
    Ok(sum)
}

/// Decodes every volume of a file and returns the facts. `open` opens the file; it is called a second
/// time to count the labels if the first pass shows that the volume may be a label map. No volume is
/// held in memory.
pub(super) fn inspect<'a>(
    open: impl Fn() -> Result<Box<dyn OpenVolume + 'a>, VolumeError>,
    monitor: &Monitor,
) -> Result<VolumeFacts, VolumeError> {
    let mut file = open()?;
    let (frames, row) = (file.header().frames, file.header().shape[0]);
    if frames > 1 {
        let (tally, warnings) = file.decode_all(&mut |_, _| {}, monitor)?;
        let facts = facts(file.header(), None, tally.summary(None), warnings)?;
        return Ok(VolumeFacts {
            gates: gates_of(&*file),
            ..facts
        });
    }
    let mut coherence = Coherence::new(row);
    let mut compare = |first, voxels: &[f32]| coherence.add(first, voxels);
    let (tally, warnings) = file.decode_all(&mut compare, monitor)?;
    let mut labels = None;
    if tally.is_whole() && coherence.suits_labels() {
        let rounded = is_rounded(&tally.summary(None), file.header().data_type);
        let mut counts = LabelCounts::new();
        let mut again = open()?;
        if rounded {
            again.stream_labels(0, &mut |_, labels| counts.add_exact(labels), monitor)?
        } else {
            again.decode_all(&mut |_, voxels| counts.add(voxels), monitor)?;
        }
        labels = counts.labels();
    }
    facts(file.header(), Some(0), tally.summary(labels), warnings)
}

/// Draws the first volume of `file` without holding it in memory.
pub(super) fn preview(
    file: &mut dyn OpenVolume,
    monitor: &Monitor,
) -> Result<Image<1>, VolumeError> {
    let mut planes = MiddlePlanes::new(file.header().shape);
    file.stream_frame(0, &mut |first, voxels| planes.add(first, voxels), monitor)?;
    Ok(planes.draw(&file.header().placement.frame))
}

/// The facts about a volume that comes from an array in memory instead of a file.
///
/// # Errors
/// [`VolumeError::NoFiniteVoxel`] if every voxel is NaN.
pub fn describe(volume: &Volume) -> Result<VolumeFacts, VolumeError> {
    let placement = Placement {
        frame: volume.frame.clone(),
        source: AffineSource::Caller,
        warnings: Vec::new(),
    };
    let header = array_header("the array", &placement, volume.shape, 1);
    let intensity = summarise(&volume.voxels, volume.shape[0]);
    facts(header, Some(0), intensity, Vec::new())
}

/// The header of a file that holds `frames` volumes in memory.
pub(super) fn array_header<'a>(
    file: &'a str,
    placement: &'a Placement,
    shape: [usize; 3],
    frames: usize,
) -> HeaderFacts<'a> {
    let mut file_shape = shape.to_vec();
    if frames > 1 {
        file_shape.push(frames);
    }
    HeaderFacts {
        file,
        format: FileFormat::Array,
        byte_order: ByteOrder::Little,
        compressed: false,
        data_type: DataType::F32.name(),
        scaling: None,
        file_shape,
        frames,
        gated: GATE_COUNTS.contains(&frames),
        shape,
        placement,
        unit: LengthUnit::Millimetre,
        warnings: &[],
    }
}

fn facts(
    header: HeaderFacts<'_>,
    frame: Option<usize>,
    intensity: IntensitySummary,
    voxel_warnings: Vec<String>,
) -> Result<VolumeFacts, VolumeError> {
    let placement = header.placement;
    let mut warnings = header.warnings.to_vec();
    warnings.extend(placement.warnings.iter().cloned());
    warnings.extend(voxel_warnings);
    warnings.extend(judge(&intensity, header.file)?);
    Ok(VolumeFacts {
        format: header.format,
        byte_order: header.byte_order,
        compressed: header.compressed,
        data_type: header.data_type,
        scaling: header.scaling,
        file_shape: header.file_shape,
        frames: header.frames,
        frame,
        gates: None,
        shape: header.shape,
        spacing_mm: placement.frame.spacing(),
        // Adding 0 turns negative zeros into positive ones.
        affine_lps: placement.frame.matrix().add_scalar(0.0),
        affine_ras: placement.frame.to_ras().add_scalar(0.0),
        affine_source: placement.source,
        unit: header.unit,
        intensity,
        warnings,
    })
}
