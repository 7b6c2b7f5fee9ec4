//! Pixels of one file: how they are stored, checked against what the file holds, and read frame by
//! frame.

use super::super::VolumeError;
use super::super::decode::{DataType, Figures, Padding, VoxelFormat, VoxelReader};
use super::super::facts::ByteOrder;
use super::super::limits::ReadLimits;
use super::super::source::{Source, VolumeFile};
use super::stored::StoredDataSet;
use crate::base::progress::Cancelled;
use ventriform_dicom::Endianness;
use ventriform_dicom::codec::{self, FrameError, FrameLayout};
use ventriform_dicom::read::ReadError;
use ventriform_dicom::read::attributes::{
    Attributes, BITS_ALLOCATED, BITS_STORED, COLUMNS, DOUBLE_PADDING, DOUBLE_PADDING_LIMIT,
    FLOAT_PADDING, FLOAT_PADDING_LIMIT, FRAME_RESCALE_INTERCEPT, FRAME_RESCALE_SLOPE, HIGH_BIT,
    MODALITY_TABLE, NUMBER_OF_FRAMES, PADDING, PADDING_LIMIT, PHOTOMETRIC, PIXEL_REPRESENTATION,
    RESCALE_INTERCEPT, RESCALE_SLOPE, ROWS, SAMPLES,
};
use ventriform_dicom::read::fragments::frames_of;
use ventriform_dicom::read::kind::{Kind, is_ct};
use ventriform_dicom::read::real_world::MAPPING_NAME;
use ventriform_dicom::read::scan::{Fragment, PixelElement, PixelPlace, Scan};

/// Slope and intercept; `None` if the values are stored as they are.
pub(super) type Scaling = Option<(f64, f64)>;

/// The pixels of one file.
pub(super) struct Pixels {
    file: VolumeFile,
    stored: StoredDataSet,
    /// Most unpacked bytes of the file to read.
    limit: u64,
    /// Columns and rows.
    pub extent: [usize; 2],
    /// Stored frames.
    pub frames: usize,
    /// Type of a stored number.
    pub data_type: DataType,
    /// Byte order of the stored numbers.
    pub byte_order: ByteOrder,
    unused_bits: u32,
    /// One for each frame, or one for all.
    scaling: Vec<Scaling>,
    /// Stored numbers that stand for no measurement.
    padding: Option<Padding>,
    storage: Storage,
}

/// Where the frames are.
enum Storage {
    /// One after the other from this byte on.
    Whole { begin: u64 },
    /// As `Whole`, one bit per pixel without padding between the frames.
    Bits { begin: u64 },
    /// Compressed, each in one or several fragments.
    Frames(Vec<Vec<Fragment>>),
}

impl Pixels {
    /// Checks the layout of the pixels in `scan`.
    ///
    /// # Errors
    /// [`VolumeError`] for unsupported pixel formats, more voxels than `limits` allow, and
    /// elements too short for the stated frames.
    pub(super) fn new(
        scan: &Scan,
        file: &VolumeFile,
        stored: StoredDataSet,
        limits: &ReadLimits,
    ) -> Result<Self, VolumeError> {
        let a = &scan.attributes;
        check_colours(a)?;
        let size = |attribute| match a.short(attribute)? {
            0 => Err(a.wrong(attribute.name, "0", "expected at least 1".into())),
            n => Ok(usize::from(n)),
        };
        let extent = [size(COLUMNS)?, size(ROWS)?];
        let frames = number_of_frames(a, scan.kind)?;
        let (data_type, unused_bits) = data_type(scan)?;
        let bits = a.short(BITS_ALLOCATED).is_ok_and(|n| n == 1);
        // Cannot overflow: two factors of 16 bits and one of 20 bits.
        let voxels = (extent[0] * extent[1] * frames) as u64;
        let most = limits.voxels;
        // One gate is read at a time, but every frame of a segmentation.
        let one = match scan.kind {
            Kind::Segmentation => voxels,
            _ => (extent[0] * extent[1]) as u64,
        };
        if one > most {
            return Err(too_many_voxels(a, one, most));
        }
        let storage =
            match &scan.pixels {
                PixelPlace::Whole { begin, length } => {
                    let bytes = if bits {
                        voxels.div_ceil(8)
                    } else {
                        voxels * data_type.size() as u64
                    };
                    if bytes > *length {
                        return Err(VolumeError::Truncated {
                            file: a.file.clone(),
                            needed: begin + bytes,
                            found: begin + length,
                        });
                    }
                    check_surplus(a, frames, voxels, *length, bytes)?;
                    if bits {
                        Storage::Bits { begin: *begin }
                    } else {
                        Storage::Whole { begin: *begin }
                    }
                }
                PixelPlace::Fragments { offsets, fragments } => {
                    if bits {
                        let reason = "bits are not compressed in this transfer syntax".into();
                        return Err(a.wrong(BITS_ALLOCATED.name, "1", reason).into());
                    }
                    let pixels = extent[0] * extent[1];
                    if pixels > codec::MOST_PIXELS {
                        return Err(VolumeError::TooLarge {
                            file: a.file.clone(),
                            what: "pixels in a compressed frame",
                            asked: pixels as u64,
                            limit: codec::MOST_PIXELS as u64,
                        });
                    }
                    // Frames of which each is small can be many: all are counted.
                    let bytes = voxels.saturating_mul(data_type.size() as u64);
                    if bytes > limits.unpacked_bytes {
                        return Err(VolumeError::TooLarge {
                            file: a.file.clone(),
                            what: "bytes of pixels after decompression",
                            asked: bytes,
                            limit: limits.unpacked_bytes,
                        });
                    }
                    let frames = frames_of(offsets, fragments, frames);
                    Storage::Frames(frames.map_err(|reason| {
                        a.wrong("Pixel Data (7FE0,0010)", "in fragments", reason)
                    })?)
                }
            };
        let scaling = match scan.kind {
            Kind::Segmentation => vec![None],
            Kind::Enhanced => {
                let each = (0..frames).map(|frame| scaling(a, Some(frame)));
                each.collect::<Result<_, _>>()?
            }
            _ => vec![scaling(a, None)?],
        };
        Ok(Self {
            file: file.clone(),
            byte_order: match storage {
                // Decoded frames are little endian.
                Storage::Frames(_) | Storage::Bits { .. } => ByteOrder::Little,
                Storage::Whole { .. } => match scan.byte_order {
                    Endianness::Little => ByteOrder::Little,
                    Endianness::Big => ByteOrder::Big,
                },
            },
            limit: limits.unpacked_bytes,
            extent,
            frames,
            data_type,
            unused_bits,
            padding: padding(scan, data_type, unused_bits),
            scaling,
            storage,
            stored,
        })
    }

    /// Name of the file.
    pub(super) fn name(&self) -> &str {
        self.file.name()
    }

    /// Voxels of one frame.
    pub(super) fn frame_voxels(&self) -> usize {
        self.extent[0] * self.extent[1]
    }

    /// Whether the file is gzipped.
    pub(super) fn is_gzip(&self) -> bool {
        self.stored.gzip
    }

    /// Slope and intercept of stored frame number `frame`.
    pub(super) fn scaling(&self, frame: usize) -> Scaling {
        let only = self.scaling.first().copied().flatten();
        self.scaling.get(frame).copied().unwrap_or(only)
    }

    /// Opens the file to read its frames from the first to the last.
    pub(super) fn open(&self) -> Result<FrameReader<'_>, VolumeError> {
        Ok(FrameReader {
            pixels: self,
            source: self.stored.open(&self.file, self.limit)?,
            bits: BitRow::default(),
        })
    }
}

/// The error for a volume of too many voxels.
pub(super) fn too_many_voxels(a: &Attributes, asked: u64, limit: u64) -> VolumeError {
    VolumeError::TooLarge {
        file: a.file.clone(),
        what: "voxels",
        asked,
        limit,
    }
}

/// Reads the frames of a file in rising order.
pub(super) struct FrameReader<'a> {
    pixels: &'a Pixels,
    source: Source,
    bits: BitRow,
}

impl FrameReader<'_> {
    /// Decodes stored frame number `frame` in portions, gives each to `take` with the number of voxels
    /// before it in the frame, and adds them to `figures`.
    ///
    /// # Errors
    /// [`VolumeError`] if the file is damaged or cut off.
    pub(super) fn read(
        &mut self,
        frame: usize,
        slice: usize,
        figures: Figures,
        take: &mut dyn FnMut(usize, &[f32]),
        report: &mut dyn FnMut(f64) -> Result<(), Cancelled>,
    ) -> Result<Figures, VolumeError> {
        let pixels = self.pixels;
        let count = pixels.frame_voxels();
        let [columns, rows] = pixels.extent;
        let format = VoxelFormat {
            file: pixels.file.name().into(),
            shape: [columns, rows, slice + 1],
            data_type: pixels.data_type,
            byte_order: pixels.byte_order,
            unused_bits: pixels.unused_bits,
            scaling: pixels.scaling(frame),
            padding: pixels.padding,
        };
        let mut unpacked;
        let (source, begin) = match &pixels.storage {
            Storage::Whole { begin } => {
                let bytes = (count * pixels.data_type.size()) as u64;
                (&mut self.source, begin + frame as u64 * bytes)
            }
            Storage::Bits { begin } => {
                let bytes = self.bits.read(&mut self.source, *begin, frame, count)?;
                unpacked = Source::plain(&pixels.file, bytes);
                (&mut unpacked, 0)
            }
            Storage::Frames(frames) => {
                let bytes = self.decompress(&frames[frame], &mut || report(0.0))?;
                unpacked = Source::plain(&pixels.file, bytes);
                (&mut unpacked, 0)
            }
        };
        let mut reader = VoxelReader::continuing(figures, format, source);
        reader.stream(begin, count, take, report)?;
        if let Some(stored) = reader.stored_without_slope() {
            return Err(VolumeError::Field {
                file: pixels.file.name().into(),
                field: RESCALE_SLOPE.name,
                value: "0".into(),
                reason: format!(
                    "the slice is not empty (a stored number is {stored}), and a slope of 0 makes all its values \
                     one; expected the slope that the slice was scaled by"
                ),
                byte: None,
            });
        }
        Ok(reader.into_figures())
    }

    /// Reads and decodes a compressed frame. `report` is called regularly.
    fn decompress(
        &mut self,
        fragments: &[Fragment],
        report: &mut dyn FnMut() -> Result<(), Cancelled>,
    ) -> Result<Vec<u8>, VolumeError> {
        let pixels = self.pixels;
        let [columns, rows] = pixels.extent;
        let layout = FrameLayout {
            columns,
            rows,
            size: pixels.data_type.size(),
            bits: 8 * pixels.data_type.size() as u32 - pixels.unused_bits,
            signed: pixels.data_type.is_signed(),
        };
        // No encoder makes more of the numbers than twice their size.
        let most = 2 * columns * rows * layout.size + (64 << 10);
        let length: u64 = fragments.iter().map(|f| u64::from(f.length)).sum();
        let corrupt = |byte, reason| VolumeError::Corrupt {
            file: pixels.file.name().into(),
            byte,
            reason,
        };
        let begin = fragments.first().map_or(0, |f| f.begin);
        if length > most as u64 {
            let reason = format!("a frame of {most} bytes at most is stored in {length} bytes");
            return Err(corrupt(begin, reason));
        }
        let mut packed = vec![0; length as usize];
        let mut filled = 0;
        for fragment in fragments {
            self.source.skip_to(fragment.begin)?;
            let end = filled + fragment.length as usize;
            let needed = fragment.begin + u64::from(fragment.length);
            self.source.fill_all(&mut packed[filled..end], needed)?;
            filled = end;
        }
        let mut goes_on = || report().is_ok();
        let compression = pixels.stored.syntax.compression;
        codec::decode(compression, &packed, layout, &mut goes_on).map_err(|error| match error {
            FrameError::Wrong(reason) => corrupt(begin, reason),
            FrameError::Stopped => Cancelled.into(),
        })
    }
}

/// The place in pixels of one bit.
#[derive(Default)]
struct BitRow {
    /// The next frame.
    next: usize,
    held: u8,
    /// Bits of `held` that belong to the next frame.
    left: u32,
}

impl BitRow {
    /// The bits of `frame`, the least significant of each byte first, as bytes 0 and 1.
    fn read(
        &mut self,
        source: &mut Source,
        begin: u64,
        frame: usize,
        count: usize,
    ) -> Result<Vec<u8>, VolumeError> {
        debug_assert!(frame == self.next, "bits are read from front to back");
        if frame == 0 {
            source.skip_to(begin)?;
        }
        let mut bits = Vec::with_capacity(count);
        let mut byte = [0];
        while bits.len() < count {
            if self.left == 0 {
                let needed = source.position() + 1;
                source.fill_all(&mut byte, needed)?;
                (self.held, self.left) = (byte[0], 8);
            }
            let taken = (self.left as usize).min(count - bits.len());
            for _ in 0..taken {
                bits.push(self.held & 1);
                self.held >>= 1;
            }
            self.left -= taken as u32;
        }
        self.next = frame + 1;
        Ok(bits)
    }
}

/// Refuses pictures in colour.
fn check_colours(a: &Attributes) -> Result<(), ReadError> {
    let samples = a.shorts(SAMPLES).first().copied().unwrap_or(1);
    if samples != 1 {
        let reason = "expected 1: colour images are not supported".into();
        return Err(a.wrong(SAMPLES.name, &samples.to_string(), reason));
    }
    match a.text(PHOTOMETRIC) {
        Some(meaning) if !meaning.starts_with("MONOCHROME") => {
            let reason = "expected MONOCHROME1 or MONOCHROME2".into();
            Err(a.wrong(PHOTOMETRIC.name, &meaning, reason))
        }
        _ => Ok(()),
    }
}

fn number_of_frames(a: &Attributes, kind: Kind) -> Result<usize, ReadError> {
    let frames = match a.decimals(NUMBER_OF_FRAMES)? {
        Some([frames]) => frames,
        None if matches!(kind, Kind::Nuclear { .. } | Kind::Projections { .. }) => {
            return Err(a.missing(NUMBER_OF_FRAMES));
        }
        None => 1.0,
    };
    let (most, reason) = if kind.is_single_slice() {
        (1.0, "expected 1 for this SOP class")
    } else {
        // The vectors hold 16 bits per frame in an element of at most one mebibyte.
        (524_288.0, "expected a whole number from 1 to 524288")
    };
    if frames.fract() == 0.0 && (1.0..=most).contains(&frames) {
        Ok(frames as usize)
    } else {
        Err(a.wrong(NUMBER_OF_FRAMES.name, &frames.to_string(), reason.into()))
    }
}

/// The data type, and the number of leading bits that are not part of the value.
fn data_type(scan: &Scan) -> Result<(DataType, u32), ReadError> {
    let a = &scan.attributes;
    match scan.element {
        PixelElement::Integer => {}
        PixelElement::Float => return Ok((DataType::F32, 0)),
        PixelElement::Double => return Ok((DataType::F64, 0)),
    }
    let allocated = a.short(BITS_ALLOCATED)?;
    if allocated == 1 && scan.kind == Kind::Segmentation && a.byte_order == Endianness::Little {
        return Ok((DataType::U8, 0));
    }
    let signed = match a.short(PIXEL_REPRESENTATION)? {
        0 => false,
        1 => true,
        other => {
            let reason = "expected 0 (unsigned) or 1 (signed)".into();
            return Err(a.wrong(PIXEL_REPRESENTATION.name, &other.to_string(), reason));
        }
    };
    let data_type = match (allocated, signed) {
        // Two 8-bit pixels share a word in swapped order.
        (8, _) if a.byte_order == Endianness::Big && scan.words => {
            let reason = "8-bit pixels in big endian words are not supported".into();
            return Err(a.wrong(BITS_ALLOCATED.name, "8", reason));
        }
        (8, false) => DataType::U8,
        (8, true) => DataType::I8,
        (16, false) => DataType::U16,
        (16, true) => DataType::I16,
        (32, false) => DataType::U32,
        (32, true) => DataType::I32,
        (other, _) => {
            let reason = "expected 8, 16 or 32".into();
            return Err(a.wrong(BITS_ALLOCATED.name, &other.to_string(), reason));
        }
    };
    let stored = a.shorts(BITS_STORED).first().copied().unwrap_or(allocated);
    if stored == 0 || stored > allocated {
        let reason = format!("expected 1 to {allocated} (Bits Allocated)");
        return Err(a.wrong(BITS_STORED.name, &stored.to_string(), reason));
    }
    let high_bit = a.shorts(HIGH_BIT).first().copied().unwrap_or(stored - 1);
    if high_bit != stored - 1 {
        let reason = format!("expected {} (Bits Stored - 1)", stored - 1);
        return Err(a.wrong(HIGH_BIT.name, &high_bit.to_string(), reason));
    }
    Ok((data_type, u32::from(allocated - stored)))
}

/// Refuses Pixel Data in one piece of `length` bytes that hold at least one more frame than is stated.
fn check_surplus(
    a: &Attributes,
    frames: usize,
    voxels: u64,
    length: u64,
    bytes: u64,
) -> Result<(), ReadError> {
    let of_one = (bytes / frames as u64).max(1);
    let held = length / of_one;
    if voxels > 0 && held > frames as u64 && length - bytes >= of_one.max(2) {
        Err(a.wrong(
            NUMBER_OF_FRAMES.name,
            &frames.to_string(),
            format!("the Pixel Data (7FE0,0010) of {length} bytes hold {held} frames"),
        ))
    } else {
        Ok(())
    }
}

/// The stored numbers that are padding (PS3.3 C.7.5.1.1.2), and what they count as: no uptake, or air in
/// CT images in Hounsfield units.
fn padding(scan: &Scan, data_type: DataType, unused_bits: u32) -> Option<Padding> {
    const AIR_HU: f32 = -1000.0;
    let a = &scan.attributes;
    if scan.kind == Kind::Segmentation {
        return None;
    }
    let (value, limit) = match scan.element {
        PixelElement::Float => {
            let value = |attribute| a.single(attribute).map(f64::from);
            (value(FLOAT_PADDING)?, value(FLOAT_PADDING_LIMIT))
        }
        PixelElement::Double => (
            a.double(DOUBLE_PADDING, None)?,
            a.double(DOUBLE_PADDING_LIMIT, None),
        ),
        PixelElement::Integer => {
            let signed = matches!(data_type, DataType::I8 | DataType::I16 | DataType::I32);
            let value = |attribute| {
                let stored = a.shorts(attribute).first().copied()?;
                Some(if signed {
                    f64::from(stored as i16)
                } else {
                    f64::from(stored)
                })
            };
            (value(PADDING)?, value(PADDING_LIMIT))
        }
    };
    let limit = limit.unwrap_or(value);
    let (low, high) = (value.min(limit), value.max(limit));
    // Some writers pad with numbers that need bits above Bits Stored.
    let bits = 8 * data_type.size() as u32 - unused_bits;
    let (least, most) = match data_type {
        DataType::U8 | DataType::U16 | DataType::U32 => (0.0, 2_f64.powi(bits as i32) - 1.0),
        DataType::I8 | DataType::I16 | DataType::I32 => {
            let half = 2_f64.powi(bits as i32 - 1);
            (-half, half - 1.0)
        }
        _ => (f64::NEG_INFINITY, f64::INFINITY),
    };
    let intercept = [FRAME_RESCALE_INTERCEPT, RESCALE_INTERCEPT]
        .into_iter()
        .find_map(|attribute| a.decimals_of::<1>(attribute, Some(0)).ok().flatten());
    let in_hounsfield = is_ct(a) && intercept.is_some_and(|[value]| value < 0.0);
    Some(Padding {
        low,
        high,
        untrimmed: low < least || high > most,
        value: if in_hounsfield { AIR_HU } else { 0.0 },
    })
}

/// A decimal text in single precision, as NIfTI files have it, so that the same image gives the same values in both;
/// unchanged beyond the range of single precision.
fn single(number: f64) -> f64 {
    let rounded = f64::from(number as f32);
    if rounded.is_finite() && (rounded != 0.0) == (number != 0.0) {
        rounded
    } else {
        number
    }
}

/// Slope and intercept of `frame` or of the whole file: Rescale Slope and Intercept, otherwise the Real
/// World Value Mapping; `None` if there is neither or they change nothing. A slope of 0 is one of an empty slice.
fn scaling(a: &Attributes, frame: Option<usize>) -> Result<Scaling, ReadError> {
    let rescale = [
        (FRAME_RESCALE_SLOPE, FRAME_RESCALE_INTERCEPT),
        (RESCALE_SLOPE, RESCALE_INTERCEPT),
    ];
    let mut found = None;
    for (slope, inter) in rescale {
        if let (None, Some([value])) = (&found, a.decimals_of(slope, frame)?) {
            let [inter] = a.decimals_of(inter, frame)?.unwrap_or([0.0]);
            found = Some((slope.name, single(value), single(inter)));
        }
    }
    if found.is_none() && !a.shorts(MODALITY_TABLE).is_empty() {
        let reason = "values by a table are not supported; expected Rescale Slope".into();
        return Err(a.wrong(MODALITY_TABLE.name, "present", reason));
    }
    if found.is_none() {
        let mapping = a.mappings.linear(frame);
        let mapping = mapping.map_err(|reason| a.wrong(MAPPING_NAME, "not linear", reason))?;
        found = mapping.map(|(slope, inter)| (MAPPING_NAME, slope, inter));
    }
    let Some((field, slope, inter)) = found else {
        return Ok(None);
    };
    // A writer that scales each slice by its own maximum gives an empty one the slope 0.
    let is_rescale = field != MAPPING_NAME;
    if !slope.is_finite() || (slope == 0.0 && !is_rescale) || !inter.is_finite() {
        let value = format!("{slope} (intercept {inter})");
        let reason = "expected a finite slope other than 0 and a finite intercept".into();
        return Err(a.wrong(field, &value, reason));
    }
    Ok(((slope, inter) != (1.0, 0.0)).then_some((slope, inter)))
}
