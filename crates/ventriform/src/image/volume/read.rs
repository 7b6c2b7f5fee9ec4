//! The two entry points: a volume to compute with, or only the facts about a file.

use super::array_file::ArrayFile;
use super::dicom::DicomFile;
use super::dicom::one_scan::ScanStatement;
use super::gate_files::{GateFiles, order_of, taken_for_gates};
use super::gate_look::{CalledBy, look, look_at};
use super::gate_timing::GateTiming;
use super::gates::GatedReading;
use super::judged_gates::judged;
use super::limits::{FromProjections, ReadLimits, ReadOptions};
use super::open::{self, OpenVolume, Reading, is_rounded};
use super::recognise::{Recognised, recognise};
use super::source::{FOLDER, VolumeFile};
use super::summary::LabelCounts;
use super::surface_file::SurfaceFile;
use super::{
    GateFacts, LabelCount, Provenance, Segment, Volume, VolumeError, VolumeFacts, archive, nifti,
};
use crate::base::progress::Monitor;
use crate::image::draw::Image;
use crate::image::grid::gates::GATE_COUNTS;
use crate::mesh::TriMesh;
use crate::mesh::files::MeshStatement;
use std::cell::RefCell;

/// Reads one volume from `files`: a single file, a `.hdr` file and its `.img` file in any order, the
/// DICOM files of a series, or a zip archive of any of these; or 6 to 32 NIfTI files, or DICOM files of one gate each,
/// which are the gates of a study. Of several files, those that are no volumes are left out.
///
/// # Errors
/// [`VolumeError`]; in particular [`VolumeError::FrameNeeded`] if the file holds several volumes
/// and `options` name none.
pub fn read(
    files: &[VolumeFile],
    options: &ReadOptions,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Reading, VolumeError> {
    read_with(files, options, &FromProjections::default(), limits, monitor)
}

/// As [`read()`], with projections reconstructed as `from` says.
///
/// # Errors
/// As [`read()`].
pub fn read_with(
    files: &[VolumeFile],
    options: &ReadOptions,
    from: &FromProjections,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Reading, VolumeError> {
    read_with_statements(files, options, from, limits, monitor).map(|(reading, _)| reading)
}

/// What files say beside their volume.
struct Statements {
    /// Of the beats of gated volumes.
    timings: Vec<GateTiming>,
    /// Of the scan.
    scan: Option<ScanStatement>,
}

/// As [`read()`], with what the files say beside the volume.
fn read_with_statements(
    files: &[VolumeFile],
    options: &ReadOptions,
    from: &FromProjections,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<(Reading, Statements), VolumeError> {
    let told = Told::of(from);
    // A volume that the caller chose is what it is.
    let mut opened = match options.frame {
        Some(_) => open_as(files, &told, limits, monitor)?,
        None => open_judged(files, &told, limits, monitor)?,
    };
    let reading = open::read(&mut *opened.file, *options, monitor);
    let mut reading = reading.map_err(|error| error.with_path(files))?;
    reading.facts.warnings.extend(opened.notes);
    let intensity = &reading.facts.intensity;
    if intensity.labels.is_some() && is_rounded(intensity, reading.facts.data_type) {
        reading.facts.intensity.labels = exact_labels(files, &reading, limits, monitor)?;
    }
    let said = Statements {
        timings: opened.file.gate_timings(),
        scan: opened.file.scan_statement().cloned(),
    };
    Ok((reading, said))
}

/// Reads every gate of a study from `files`: one file whose volumes are the gates, or one file for each gate, in the
/// order that DICOM headers state, or else of the numbers in their names
/// ([`order_by_numbers`](super::order_by_numbers)), or else in the order given. Volumes whose header says that they are
/// no gates are refused unless `gated` says that they are.
///
/// # Errors
/// [`VolumeError`], also for a single volume, and for gates that have together more voxels than a volume may.
pub fn read_gates(
    files: &[VolumeFile],
    gated: bool,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<GatedReading, VolumeError> {
    read_gates_with(files, gated, &FromProjections::default(), limits, monitor)
}

/// As [`read_gates`], with projections reconstructed as `from` says.
///
/// # Errors
/// As [`read_gates`].
pub fn read_gates_with(
    files: &[VolumeFile],
    gated: bool,
    from: &FromProjections,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<GatedReading, VolumeError> {
    let told = Told::of(from);
    let opened = open_as(files, &told, limits, monitor);
    // Files of one gate each are not one volume.
    let apart = (2..=*GATE_COUNTS.end()).contains(&files.len())
        && match &opened {
            Ok(opened) => opened.file.header().frames == 1,
            Err(
                VolumeError::Cancelled(_)
                | VolumeError::OtherGate { .. }
                | VolumeError::TooLarge { .. },
            ) => false,
            Err(_) => true,
        };
    if apart {
        let names: Vec<&str> = files.iter().map(VolumeFile::name).collect();
        let order = order_of(&names);
        let sorted: Vec<VolumeFile> = order.iter().map(|&at| files[at].clone()).collect();
        return match one_by_one(&sorted, limits, monitor) {
            // What the files are together says more than that one of them is no volume.
            Err(error) if !matches!(error, VolumeError::Cancelled(_)) => {
                Err(opened.err().unwrap_or(error))
            }
            read => {
                let (mut readings, timing, said) = read?;
                let volumes: Vec<&Volume> = readings.iter().map(|own| &own.volume).collect();
                let mut look = look_at(&volumes, monitor)?;
                let kept = (0..readings.len()).filter(|n| !look.left_out.extra.contains(n));
                let kept: Vec<usize> = kept.collect();
                let mut file = 0..;
                readings.retain(|_| file.next().is_some_and(|file| kept.contains(&file)));
                let mut gated =
                    GatedReading::new(readings, kept, &look.left_out, &[timing], &said)?;
                gated.facts.warnings.append(&mut look.warnings);
                gated.facts.warnings.push(taken_for_gates(&order));
                Ok(gated)
            }
        };
    }
    let mut opened = opened?;
    let header = opened.file.header();
    let (frames, taken) = (header.frames, header.gated || gated);
    let voxels = header.shape.iter().product::<usize>() as u64 * frames as u64;
    if frames == 1 {
        return Err(VolumeError::NotGated {
            file: header.file.to_owned(),
        });
    }
    if !taken {
        let needed = VolumeError::FrameNeeded { frames, why: None };
        return Err(open::because(needed, opened.file.why_not_gated()));
    }
    if voxels > limits.voxels {
        return Err(too_many_voxels(header.file, voxels, limits));
    }
    let timings = opened.file.gate_timings();
    let mut look = look(&mut *opened.file, &CalledBy::Header, monitor)?;
    if !opened.file.reads_again() {
        opened.file = open_as(files, &told, limits, monitor)?.file;
    }
    let kept = (0..frames).filter(|frame| !look.left_out.extra.contains(frame));
    let kept: Vec<usize> = kept.collect();
    let one = |frame: &usize| {
        let options = ReadOptions {
            frame: Some(*frame),
        };
        let read = open::read(&mut *opened.file, options, &monitor.part(*frame, frames));
        read.map_err(|error| error.with_path(files))
    };
    let mut readings: Vec<Reading> = kept.iter().map(one).collect::<Result<_, _>>()?;
    let first = &mut readings[0].facts;
    first.warnings.append(&mut look.warnings);
    first.warnings.append(&mut opened.notes);
    first.gates = first.gates.map(|gates| GateFacts {
        number: gates.number - (frames - kept.len()).min(gates.number),
        ..gates
    });
    GatedReading::new(readings, kept, &look.left_out, &timings, &[])
}

/// What files hold of a heart beat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeldGates {
    /// As many gates as a beat can be fitted to.
    Beat,
    /// Gates, but too few or too many of them.
    OtherNumber {
        /// Gates of an R-R interval.
        gates: usize,
    },
    /// One volume, or volumes that nobody says are gates.
    NotGated,
}

/// Whether `files` hold gates of a heart beat that a beat can be fitted to, by the header or because `gated` says that
/// their volumes are gates.
///
/// # Errors
/// [`VolumeError`].
pub fn hold_gates(
    files: &[VolumeFile],
    gated: bool,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<HeldGates, VolumeError> {
    let opened = if gated {
        open(files, limits, monitor)?
    } else {
        open_judged(files, &Told::default(), limits, monitor)?
    };
    let header = opened.file.header();
    let gates = header.frames - opened.file.left_out().extra.len();
    let stated = opened.file.gate_timings().into_iter().next();
    let each = stated.unwrap_or_default().gates_of_interval(gates);
    if header.frames == 1 || !(header.gated || gated) {
        return Ok(HeldGates::NotGated);
    }
    Ok(if GATE_COUNTS.contains(&each) {
        HeldGates::Beat
    } else {
        HeldGates::OtherNumber { gates: each }
    })
}

/// Whether both lists of files hold the same volumes voxel by voxel, whatever their formats and names. Nothing is
/// decoded after the first volume that differs, and one volume of each is held in memory.
///
/// # Errors
/// [`VolumeError`].
pub fn hold_same_voxels(
    files: [&[VolumeFile]; 2],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<bool, VolumeError> {
    let [mut one, mut other] = [
        open(files[0], limits, monitor)?.file,
        open(files[1], limits, monitor)?.file,
    ];
    let [size, other_size] = [&one, &other].map(|file| {
        let header = file.header();
        (header.shape, header.frames)
    });
    if size != other_size {
        return Ok(false);
    }
    for frame in 0..size.1 {
        let voxels = one.decode_frame(frame, monitor)?.voxels;
        if voxels != other.decode_frame(frame, monitor)?.voxels {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Gates that have together more voxels than a volume may.
fn too_many_voxels(file: &str, asked: u64, limits: &ReadLimits) -> VolumeError {
    VolumeError::TooLarge {
        file: file.to_owned(),
        what: "voxels in its gates",
        asked,
        limit: limits.voxels,
    }
}

/// Reads files that hold one gate each, as long as they have together no more voxels than a volume may, with what the
/// first says of the beats, and what each says of the scan.
fn one_by_one(
    files: &[VolumeFile],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<(Vec<Reading>, GateTiming, Vec<ScanStatement>), VolumeError> {
    let (mut readings, mut voxels) = (Vec::with_capacity(files.len()), 0);
    let mut said = Vec::new();
    let mut of_first = None;
    for (index, file) in files.iter().enumerate() {
        let part = monitor.part(index, files.len());
        let own = std::slice::from_ref(file);
        let (reading, stated) = read_with_statements(
            own,
            &ReadOptions::default(),
            &FromProjections::default(),
            limits,
            &part,
        )?;
        let reading = reading.usable()?;
        said.extend(stated.scan);
        of_first.get_or_insert(stated.timings.into_iter().next());
        voxels += reading.volume.voxels.len() as u64;
        if voxels > limits.voxels {
            return Err(too_many_voxels(file.name(), voxels, limits));
        }
        readings.push(reading);
    }
    let timing = GateTiming {
        gates_per_interval: None,
        ..of_first.flatten().unwrap_or_default()
    };
    Ok((readings, timing, said))
}

/// The exact labels of the volume that was read as `reading`; `None` if there are too many.
fn exact_labels(
    files: &[VolumeFile],
    reading: &Reading,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Option<Vec<LabelCount>>, VolumeError> {
    let mut counts = LabelCounts::new();
    let mut file = open(files, limits, monitor)?.file;
    let frame = reading.facts.frame.unwrap_or(0);
    file.stream_labels(frame, &mut |_, labels| counts.add_exact(labels), monitor)?;
    Ok(counts.labels())
}

/// Whether voxels of `reading` are whole numbers beyond 2^24, which its 32-bit floats do not tell
/// apart. [`voxels_of_label`] does.
pub fn labels_are_rounded(reading: &Reading) -> bool {
    is_rounded(&reading.facts.intensity, reading.facts.data_type) && reading.facts.frame.is_some()
}

/// Which voxels of the volume that was read from `files` as `reading` carry exactly `label`, whatever
/// the size of the number.
///
/// # Errors
/// [`VolumeError`], as for [`read()`].
pub fn voxels_of_label(
    files: &[VolumeFile],
    reading: &Reading,
    label: i64,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Vec<bool>, VolumeError> {
    let mut carries = vec![false; reading.volume.voxels.len()];
    let mut take = |first: usize, labels: &[i64]| {
        for (carries, found) in carries[first..].iter_mut().zip(labels) {
            *carries = *found == label;
        }
    };
    let mut file = open(files, limits, monitor)?.file;
    file.stream_labels(reading.facts.frame.unwrap_or(0), &mut take, monitor)?;
    Ok(carries)
}

/// The segments that a DICOM Segmentation describes; empty for other files. Only headers are read.
///
/// # Errors
/// [`VolumeError`], as for [`read()`].
pub fn segments(
    files: &[VolumeFile],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Vec<Segment>, VolumeError> {
    Ok(open(files, limits, monitor)?.file.segments().to_vec())
}

/// Reads one segment of a DICOM Segmentation: its voxels have its number, all others 0. Where it
/// overlaps others, its voxels are its own.
///
/// # Errors
/// [`VolumeError`], as for [`read()`].
pub fn read_segment(
    files: &[VolumeFile],
    number: u16,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Reading, VolumeError> {
    let mut file = open(files, limits, monitor)?.file;
    file.keep_segment(number);
    open::read(&mut *file, ReadOptions::default(), monitor)
}

/// The closed surface in `files`, LPS mm, as `stated`, and the volume that is read of it; `None` if the files are no
/// mesh.
///
/// # Errors
/// [`VolumeError`], also for a surface whose unit nobody states and whose size is not that of an organ.
pub fn surface(
    files: &[VolumeFile],
    stated: &MeshStatement,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Option<(TriMesh, Reading)>, VolumeError> {
    let told = Told {
        mesh: *stated,
        ..Told::default()
    };
    let mut file = open_as(files, &told, limits, monitor)?.file;
    let Some(mesh) = file.surface().cloned() else {
        return Ok(None);
    };
    let reading = open::read(&mut *file, ReadOptions::default(), monitor)?.usable()?;
    Ok(Some((mesh, reading)))
}

/// Whose scan the volume in `files` is; `None` unless they are DICOM. Only headers are read.
/// Where gates are summed, frames and instances are those of the first gate.
///
/// # Errors
/// [`VolumeError`], as for [`read()`].
pub fn provenance(
    files: &[VolumeFile],
    options: &ReadOptions,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Option<Provenance>, VolumeError> {
    let file = match options.frame {
        Some(_) => open(files, limits, monitor)?.file,
        None => open_judged(files, &Told::default(), limits, monitor)?.file,
    };
    let header = file.header();
    let frame = options.choose(header.frames, header.gated);
    let frame = frame.map_err(|error| open::because(error, file.why_not_gated()))?;
    Ok(file.provenance(frame.unwrap_or_else(|| open::first_summed(&*file))))
}

/// Returns the facts about `files`. For several volumes the intensities are taken over all of them.
///
/// Every voxel is decoded, so that a file that passes here can also be read. The voxels are not kept,
/// so this needs less memory than [`read()`].
///
/// # Errors
/// [`VolumeError`].
pub fn inspect(
    files: &[VolumeFile],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<VolumeFacts, VolumeError> {
    let notes = RefCell::new(Vec::new());
    let again = || {
        let opened = open_judged(files, &Told::default(), limits, monitor)?;
        notes.replace(opened.notes);
        Ok(opened.file)
    };
    let facts = open::inspect(again, monitor);
    let mut facts = facts.map_err(|error| error.with_path(files))?;
    facts.warnings.extend(notes.take());
    Ok(facts)
}

/// Draws the three middle slices of the first volume in `files`; see [`mod@super::preview`]. The
/// volume is decoded in portions and not held in memory.
///
/// # Errors
/// [`VolumeError`].
pub fn preview_files(
    files: &[VolumeFile],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Image<1>, VolumeError> {
    open::preview(&mut *open(files, limits, monitor)?.file, monitor)
}

/// A volume whose header was checked.
pub(super) struct Opened {
    pub(super) file: Box<dyn OpenVolume>,
    /// The files that were left out.
    pub(super) notes: Vec<String>,
}

/// What a caller tells of files that are no volumes yet.
#[derive(Debug, Clone, Default)]
pub(super) struct Told {
    /// Of a mesh.
    pub(super) mesh: MeshStatement,
    /// How volumes are made of projections.
    pub(super) from: FromProjections,
}

impl Told {
    pub(super) fn of(from: &FromProjections) -> Self {
        Self {
            from: from.clone(),
            ..Self::default()
        }
    }
}

/// Recognises the format of `files` and checks the header. Archives stand for the files in them.
fn open(
    files: &[VolumeFile],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Opened, VolumeError> {
    open_as(files, &Told::default(), limits, monitor)
}

/// As [`open()`], with the volumes that are taken for gates looked at.
fn open_judged(
    files: &[VolumeFile],
    told: &Told,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Opened, VolumeError> {
    let opened = open_as(files, told, limits, monitor)?;
    let again = || Ok(open_as(files, told, limits, monitor)?.file);
    Ok(Opened {
        file: judged(opened.file, again, monitor)?,
        notes: opened.notes,
    })
}

/// As [`open()`], with what the caller tells of the files.
pub(super) fn open_as(
    files: &[VolumeFile],
    told: &Told,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Opened, VolumeError> {
    open_named(files, told, limits, monitor).map_err(|error| error.with_path(files))
}

fn open_named(
    files: &[VolumeFile],
    told: &Told,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Opened, VolumeError> {
    let in_folder = files.iter().any(VolumeFile::was_found);
    let mut inside = in_folder.then_some(FOLDER);
    let mut members = Vec::with_capacity(files.len());
    for file in files {
        monitor.check()?;
        match archive::files_in(file, limits)? {
            Some(packed) => {
                inside = inside.or(Some(file.name()));
                members.extend(packed);
            }
            None => members.push(file.clone()),
        }
    }
    // Archives list their files in any order.
    if inside.is_some() {
        members.sort_by(|a, b| a.name().cmp(b.name()));
    }
    let found = recognise(&members, inside, limits, monitor)?;
    let file: Box<dyn OpenVolume> = match found.volume {
        Recognised::Nifti { header, voxels } => {
            Box::new(nifti::NiftiFile::open(header, voxels, limits)?)
        }
        Recognised::Gates(files) => Box::new(GateFiles::open(&files, limits)?),
        Recognised::Dicom(files) => Box::new(DicomFile::open(&files, &told.from, limits, monitor)?),
        Recognised::Mesh(file) => Box::new(SurfaceFile::open(file, &told.mesh, limits, monitor)?),
        Recognised::Arrays(file) => Box::new(ArrayFile::open(file, limits)?),
    };
    Ok(Opened {
        file,
        notes: found.notes,
    })
}
