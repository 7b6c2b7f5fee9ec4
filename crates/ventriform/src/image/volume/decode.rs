//! Decoding: stored numbers of any real type to `f32`, in portions, directly into the result.

use super::VolumeError;
use super::facts::ByteOrder;
use super::source::Source;
use super::summary::{NO_LABEL, Tally};
use crate::base::progress::{Cancelled, Monitor, Stage};
use std::cell::Cell;

/// Voxels decoded at a time: a few milliseconds of unpacking and at most half a mebibyte.
const VOXELS_PER_PORTION: usize = 1 << 16;

/// Bits of the `f32` above which not every whole number is representable.
const MAX_EXACT_BITS: u32 = 16_777_216_f32.to_bits();
const INFINITY_BITS: u32 = f32::INFINITY.to_bits();
const SIGN_BIT: u32 = 1 << 31;

/// Data type of a stored voxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DataType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

impl DataType {
    /// Bytes per voxel.
    pub(super) fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// Whether values may be negative.
    pub(super) fn is_signed(self) -> bool {
        !matches!(self, Self::U8 | Self::U16 | Self::U32 | Self::U64)
    }

    /// The name that numpy uses.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::U8 => "uint8",
            Self::I8 => "int8",
            Self::U16 => "uint16",
            Self::I16 => "int16",
            Self::U32 => "uint32",
            Self::I32 => "int32",
            Self::U64 => "uint64",
            Self::I64 => "int64",
            Self::F32 => "float32",
            Self::F64 => "float64",
        }
    }
}

/// Storage format of voxels.
#[derive(Debug, Clone)]
pub(super) struct VoxelFormat {
    /// Name of the file, for error messages.
    pub file: String,
    /// Voxels along i, j, k, for error messages.
    pub shape: [usize; 3],
    pub data_type: DataType,
    pub byte_order: ByteOrder,
    /// Leading bits of an integer that are not part of its value; fewer than the type has.
    pub unused_bits: u32,
    /// Slope and intercept to apply.
    pub scaling: Option<(f64, f64)>,
    /// Stored numbers that stand for no measurement.
    pub padding: Option<Padding>,
}

/// Stored numbers that fill a picture where nothing was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Padding {
    /// The least and the greatest of them; both NaN for numbers that are NaN.
    pub low: f64,
    pub high: f64,
    /// Whether they are compared with the leading bits that are no part of other values.
    pub untrimmed: bool,
    /// The value that they count as.
    pub value: f32,
}

impl Padding {
    fn covers(&self, stored: f64) -> bool {
        (self.low..=self.high).contains(&stored) || (self.low.is_nan() && stored.is_nan())
    }
}

impl VoxelFormat {
    /// Whether every voxel is a whole number, whatever is stored.
    fn is_whole(&self) -> bool {
        let real = matches!(self.data_type, DataType::F32 | DataType::F64);
        !real && self.scaling.is_none()
    }

    /// Whether `f32` represents every voxel exactly, whatever is stored.
    fn is_exact(&self) -> bool {
        self.is_whole() && self.data_type.size() <= size_of::<u16>()
    }
}

/// Reads the voxels of a file from front to back.
pub(super) struct VoxelReader<'a> {
    decoder: Decoder,
    source: &'a mut Source,
    buffer: Vec<u8>,
}

/// Decodes portions and keeps running figures over them.
struct Decoder {
    format: VoxelFormat,
    figures: Figures,
    /// A stored number that says something and that a slope of 0 loses.
    lost: Option<f64>,
}

/// Running figures over decoded voxels.
#[derive(Debug, Default)]
pub(super) struct Figures {
    odd: Odd,
    /// Padded voxels of which the stored number would give another value than that of padding.
    padded: Padded,
    tally: Tally,
}

/// Voxels that are padding.
#[derive(Debug, Default)]
struct Padded {
    count: u64,
    /// The value they count as.
    value: f32,
}

/// Values that `f32` cannot represent exactly.
#[derive(Debug, Default)]
struct Odd {
    infinite: u64,
    /// A data type of which values were rounded.
    inexact: Option<DataType>,
}

impl Figures {
    /// Minimum, maximum, sum and counts.
    pub(super) fn tally(&self) -> Tally {
        self.tally
    }

    /// Warnings about values that `f32` cannot represent.
    pub(super) fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.odd.infinite > 0 {
            let n = self.odd.infinite;
            warnings.push(format!(
                "{n} voxels are infinite and are treated as missing (NaN)."
            ));
        }
        if self.padded.count > 0 {
            warnings.push(format!(
                "{} voxels are Pixel Padding, no measurement, and count as {}.",
                self.padded.count, self.padded.value
            ));
        }
        if let Some(rounded) = self.odd.inexact {
            let name = rounded.name();
            warnings.push(format!(
                "Some {name} values exceed 2^24 and were rounded to 24 significant bits."
            ));
        }
        warnings
    }
}

impl<'a> VoxelReader<'a> {
    /// A reader for the voxels in `source`. The caller has checked that `source` holds them.
    pub(super) fn new(format: VoxelFormat, source: &'a mut Source) -> Self {
        Self::continuing(Figures::default(), format, source)
    }

    /// As [`VoxelReader::new`], but the voxels are added to `figures`.
    pub(super) fn continuing(
        figures: Figures,
        format: VoxelFormat,
        source: &'a mut Source,
    ) -> Self {
        Self {
            decoder: Decoder {
                format,
                figures,
                lost: None,
            },
            source,
            buffer: Vec::new(),
        }
    }

    /// The figures over all voxels so far.
    pub(super) fn into_figures(self) -> Figures {
        self.decoder.figures
    }

    /// A stored number other than 0, and than the least of its type, among those that were read with a slope of
    /// 0: their slice is not empty.
    pub(super) fn stored_without_slope(&self) -> Option<f64> {
        self.decoder.lost
    }

    /// Appends the `count` voxels from byte `begin` on to `voxels`. `begin` must not lie before the
    /// end of the previous call. `report` is called with the share of `count` that is done.
    ///
    /// # Errors
    /// [`VolumeError`] if the file is damaged, a value exceeds the range of `f32`, or memory is
    /// short.
    pub(super) fn append(
        &mut self,
        begin: u64,
        count: usize,
        voxels: &mut Vec<f32>,
        report: &mut dyn FnMut(f64) -> Result<(), Cancelled>,
    ) -> Result<(), VolumeError> {
        let size = self.decoder.format.data_type.size();
        let end = begin + count as u64 * size as u64;
        self.source.prepare(end)?;
        self.source.skip_to(begin)?;
        if size == size_of::<f32>()
            && voxels.is_empty()
            && let Some((words, place)) = self.source.give_up(count * size)
        {
            *voxels = self.in_place(words, place, count, report)?;
            return Ok(report(1.0)?);
        }
        voxels
            .try_reserve_exact(count)
            .map_err(|_| VolumeError::Memory {
                bytes: 4 * count as u64,
            })?;
        self.portions(end, count, report, |decoder, bytes, _| {
            decoder.append(bytes, voxels.len(), voxels)
        })
    }

    /// Decodes the `count` voxels from byte `begin` on in portions, and gives each to `take` with the
    /// number of voxels before it. Memory stays under one mebibyte beside what the source holds.
    ///
    /// # Errors
    /// As [`VoxelReader::append`].
    pub(super) fn stream(
        &mut self,
        begin: u64,
        count: usize,
        take: &mut dyn FnMut(usize, &[f32]),
        report: &mut dyn FnMut(f64) -> Result<(), Cancelled>,
    ) -> Result<(), VolumeError> {
        let end = begin + count as u64 * self.decoder.format.data_type.size() as u64;
        self.source.prepare(end)?;
        self.source.skip_to(begin)?;
        let mut voxels = Vec::with_capacity(VOXELS_PER_PORTION.min(count));
        self.portions(end, count, report, |decoder, bytes, done| {
            voxels.clear();
            decoder.append(bytes, done, &mut voxels)?;
            take(done, &voxels);
            Ok(())
        })
    }

    /// As [`VoxelReader::stream`], with the exact whole number of every voxel: 32-bit floats do not tell
    /// labels beyond 2^24 apart. Fractions and what exceeds 64 bits are [`NO_LABEL`].
    ///
    /// # Errors
    /// As [`VoxelReader::append`].
    pub(super) fn stream_exact(
        &mut self,
        begin: u64,
        count: usize,
        take: &mut dyn FnMut(usize, &[i64]),
        report: &mut dyn FnMut(f64) -> Result<(), Cancelled>,
    ) -> Result<(), VolumeError> {
        let end = begin + count as u64 * self.decoder.format.data_type.size() as u64;
        self.source.prepare(end)?;
        self.source.skip_to(begin)?;
        let mut labels = Vec::with_capacity(VOXELS_PER_PORTION.min(count));
        self.portions(end, count, report, |decoder, bytes, done| {
            labels.clear();
            exact_labels(bytes, &decoder.format, &mut labels);
            take(done, &labels);
            Ok(())
        })
    }

    /// Calls `decode` with the bytes of every portion of the next `count` voxels, which end at byte
    /// `end`, and with the number of voxels before it.
    fn portions(
        &mut self,
        end: u64,
        count: usize,
        report: &mut dyn FnMut(f64) -> Result<(), Cancelled>,
        mut decode: impl FnMut(&mut Decoder, &[u8], usize) -> Result<(), VolumeError>,
    ) -> Result<(), VolumeError> {
        let size = self.decoder.format.data_type.size();
        let mut done = 0;
        while done < count {
            report(done as f64 / count as f64)?;
            let portion = (count - done).min(VOXELS_PER_PORTION);
            let bytes = match self.source.lend(portion * size) {
                Some(bytes) => bytes,
                None => {
                    self.buffer.resize(portion * size, 0);
                    self.source.fill_all(&mut self.buffer, end)?;
                    &self.buffer
                }
            };
            decode(&mut self.decoder, bytes, done)?;
            done += portion;
        }
        Ok(report(1.0)?)
    }

    /// Decodes in place the `count` voxels stored in `words` from byte `place` on. No voxel moves
    /// back, so none is overwritten before it has been decoded.
    fn in_place(
        &mut self,
        mut words: Vec<f32>,
        place: usize,
        count: usize,
        report: &mut dyn FnMut(f64) -> Result<(), Cancelled>,
    ) -> Result<Vec<f32>, VolumeError> {
        let mut decoded = Vec::with_capacity(VOXELS_PER_PORTION.min(count));
        for done in (0..count).step_by(VOXELS_PER_PORTION) {
            report(done as f64 / count as f64)?;
            let portion = (count - done).min(VOXELS_PER_PORTION);
            let begin = place + size_of::<f32>() * done;
            let bytes = &bytemuck::cast_slice(&words)[begin..begin + size_of::<f32>() * portion];
            decoded.clear();
            self.decoder.append(bytes, done, &mut decoded)?;
            words[done..done + portion].copy_from_slice(&decoded);
        }
        words.truncate(count);
        Ok(words)
    }

    /// Decodes `frames` volumes of `count` voxels each, stored one after the other from byte `begin`
    /// on, without keeping their voxels. Each portion is given to `take` as by
    /// [`VoxelReader::stream`].
    ///
    /// # Errors
    /// As [`VoxelReader::append`].
    pub(super) fn tally_all(
        &mut self,
        begin: u64,
        count: usize,
        frames: usize,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        let bytes = count as u64 * self.decoder.format.data_type.size() as u64;
        for frame in 0..frames {
            let begin = begin + frame as u64 * bytes;
            self.stream(begin, count, take, &mut |done| {
                monitor.report(Stage::Read, (frame as f64 + done) / frames as f64)
            })?;
        }
        Ok(())
    }

    /// Figures over all voxels read so far.
    pub(super) fn tally(&self) -> Tally {
        self.decoder.figures.tally()
    }

    /// Warnings about values that `f32` cannot represent.
    pub(super) fn warnings(&self) -> Vec<String> {
        self.decoder.figures.warnings()
    }

    /// Checks the end of the file after the last volume, which verifies the checksum of a gzip
    /// member. Returns a warning if more bytes follow.
    pub(super) fn finish(&mut self) -> Result<Option<String>, VolumeError> {
        let left_over = self.source.finish()?;
        Ok(left_over.then(|| "Bytes after the last voxel were ignored.".into()))
    }
}

impl Decoder {
    /// Appends the voxels stored in `bytes` to `out`. The first of them is voxel number `first` of
    /// the volume.
    fn append(
        &mut self,
        bytes: &[u8],
        first: usize,
        out: &mut Vec<f32>,
    ) -> Result<(), VolumeError> {
        if self.lost.is_none() && matches!(self.format.scaling, Some((0.0, _))) {
            self.lost = telling_number(bytes, &self.format);
        }
        let start = out.len();
        let padded = decode(bytes, &self.format, out);
        if padded > 0
            && let Some(padding) = self.format.padding
        {
            self.figures.padded.count += padded;
            self.figures.padded.value = padding.value;
        }
        let decoded = &mut out[start..];
        let (format, figures) = (&self.format, &mut self.figures);
        if !format.is_exact() {
            figures.odd.settle(bytes, format, decoded, first)?;
        }
        // Tallied here because the portion is still in the cache.
        if format.is_whole() {
            figures.tally.add_whole_portion(decoded)
        } else {
            figures.tally.add_portion(decoded)
        }
        Ok(())
    }
}

impl Odd {
    /// Counts the values among `voxels` that `f32` cannot represent exactly. The first of `voxels`
    /// is voxel number `first` of the volume.
    fn settle(
        &mut self,
        bytes: &[u8],
        format: &VoxelFormat,
        voxels: &mut [f32],
        first: usize,
    ) -> Result<(), VolumeError> {
        let (mut infinite, mut large) = (false, false);
        for v in &*voxels {
            // Non-negative floats have the same order as their bits.
            let size = v.to_bits() & !SIGN_BIT;
            infinite |= size == INFINITY_BITS;
            large |= size > MAX_EXACT_BITS && size < INFINITY_BITS;
        }
        if large && format.data_type != DataType::F32 {
            self.inexact = Some(format.data_type);
        }
        if infinite {
            self.settle_infinite(bytes, format, voxels, first)
        } else {
            Ok(())
        }
    }

    /// Replaces infinities by NaN. An infinity that stands for a finite number in the file is an
    /// error: the number exceeds the range of `f32`.
    fn settle_infinite(
        &mut self,
        bytes: &[u8],
        format: &VoxelFormat,
        voxels: &mut [f32],
        first: usize,
    ) -> Result<(), VolumeError> {
        let stored = bytes.chunks_exact(format.data_type.size());
        for ((n, v), bytes) in (first..).zip(voxels).zip(stored) {
            if v.is_infinite() {
                let value = exact(bytes, format);
                if value.is_finite() {
                    return Err(overflow(format, n, value));
                }
                *v = f32::NAN;
                self.infinite += 1;
            }
        }
        Ok(())
    }
}

fn overflow(format: &VoxelFormat, index: usize, value: f64) -> VolumeError {
    let [nx, ny, _] = format.shape;
    VolumeError::Overflow {
        file: format.file.clone(),
        voxel: [index % nx, index / nx % ny, index / nx / ny],
        value,
    }
}

/// A stored number.
trait Stored: Copy {
    /// Appends `take` of every number in `bytes` to `out`.
    fn each<O>(bytes: &[u8], order: ByteOrder, out: &mut Vec<O>, take: impl Fn(Self) -> O);
    /// The value without its leading `unused` bits, sign-extended for signed types.
    fn trim(self, unused: u32) -> Self;
    fn single(self) -> f32;
    fn double(self) -> f64;
    /// The whole number, or [`NO_LABEL`].
    fn label(self) -> i64;
}

macro_rules! trim {
    (f32, $v:expr, $unused:expr) => {{
        let _ = $unused;
        $v
    }};
    (f64, $v:expr, $unused:expr) => {{
        let _ = $unused;
        $v
    }};
    ($t:ident, $v:expr, $unused:expr) => {
        ($v << $unused) >> $unused
    };
}

macro_rules! label {
    (f32, $v:expr) => {
        whole(f64::from($v))
    };
    (f64, $v:expr) => {
        whole($v)
    };
    (u64, $v:expr) => {
        i64::try_from($v).unwrap_or(NO_LABEL)
    };
    ($t:ident, $v:expr) => {
        $v as i64
    };
}

/// The whole number that `value` is, or [`NO_LABEL`].
fn whole(value: f64) -> i64 {
    // From 2^53 on, not every whole number is representable.
    if value.fract() == 0.0 && value.abs() <= 9_007_199_254_740_992.0 {
        value as i64
    } else {
        NO_LABEL
    }
}

macro_rules! stored {
    ($($t:ident),*) => {$(
        impl Stored for $t {
            fn each<O>(bytes: &[u8], order: ByteOrder, out: &mut Vec<O>, take: impl Fn(Self) -> O) {
                let (numbers, _) = bytes.as_chunks::<{ size_of::<$t>() }>();
                match order {
                    ByteOrder::Little => {
                        out.extend(numbers.iter().map(|b| take(<$t>::from_le_bytes(*b))));
                    }
                    ByteOrder::Big => {
                        out.extend(numbers.iter().map(|b| take(<$t>::from_be_bytes(*b))));
                    }
                }
            }
            fn trim(self, unused: u32) -> Self { trim!($t, self, unused) }
            fn single(self) -> f32 { self as f32 }
            fn double(self) -> f64 { self as f64 }
            fn label(self) -> i64 { label!($t, self) }
        }
    )*};
}
stored!(u8, i8, u16, i16, u32, i32, u64, i64, f32, f64);

/// Evaluates `$body` with `$t` as the Rust type of `$data_type`.
macro_rules! with_type {
    ($data_type:expr, $t:ident => $body:expr) => {
        with_type!($data_type, $t => $body;
            U8 u8, I8 i8, U16 u16, I16 i16, U32 u32, I32 i32, U64 u64, I64 i64, F32 f32, F64 f64)
    };
    ($data_type:expr, $t:ident => $body:expr; $($variant:ident $type:ty),*) => {
        match $data_type {
            $(DataType::$variant => {
                type $t = $type;
                $body
            })*
        }
    };
}

/// Appends the numbers in `bytes` to `voxels`. Slope and intercept are applied in double precision,
/// as nibabel does. Returns how many padded numbers got another value than their own.
fn decode(bytes: &[u8], format: &VoxelFormat, voxels: &mut Vec<f32>) -> u64 {
    let (order, unused) = (format.byte_order, format.unused_bits);
    let scaling = match unused {
        0 => format.scaling,
        _ => Some(format.scaling.unwrap_or((1.0, 0.0))),
    };
    let padded = Cell::new(0);
    with_type!(format.data_type, T => match (format.padding, scaling) {
        (Some(padding), _) => {
            let (slope, inter) = scaling.unwrap_or((1.0, 0.0));
            T::each(bytes, order, voxels, |v| {
                let value = v.trim(unused).double();
                let stored = if padding.untrimmed { v.double() } else { value };
                let own = (value * slope + inter) as f32;
                if !padding.covers(stored) {
                    return own;
                }
                padded.set(padded.get() + u64::from(own != padding.value));
                padding.value
            });
        }
        (None, None) => T::each(bytes, order, voxels, |v| v.single()),
        (None, Some((slope, inter))) => {
            let scale = |v: f64| (v * slope + inter) as f32;
            T::each(bytes, order, voxels, |v| scale(v.trim(unused).double()));
        }
    });
    padded.get()
}

/// The first stored number in `bytes` that is no padding, not 0 and not the least of its type: writers that scale
/// each slice put one of these where a slice is empty.
fn telling_number(bytes: &[u8], format: &VoxelFormat) -> Option<f64> {
    let mut stored: Vec<f64> = Vec::with_capacity(bytes.len() / format.data_type.size());
    let unused = format.unused_bits;
    with_type!(format.data_type, T => {
        T::each(bytes, format.byte_order, &mut stored, |v| v.trim(unused).double());
    });
    let bits = 8 * format.data_type.size() as u32 - unused;
    let least = if format.data_type.is_signed() {
        -2_f64.powi(bits as i32 - 1)
    } else {
        0.0
    };
    let is_padding = |number| format.padding.is_some_and(|p| p.covers(number));
    let mut numbers = stored.into_iter();
    numbers.find(|number| *number != 0.0 && *number != least && !is_padding(*number))
}

/// Appends the whole numbers in `bytes`, slope and intercept applied, to `labels`.
fn exact_labels(bytes: &[u8], format: &VoxelFormat, labels: &mut Vec<i64>) {
    let (order, unused) = (format.byte_order, format.unused_bits);
    with_type!(format.data_type, T => match format.scaling {
        None => T::each(bytes, order, labels, |v| v.trim(unused).label()),
        Some((slope, inter)) => {
            T::each(bytes, order, labels, |v| whole(v.trim(unused).double() * slope + inter));
        }
    });
}

/// The first number in `bytes` in double precision, which distinguishes large from infinite values.
fn exact(bytes: &[u8], format: &VoxelFormat) -> f64 {
    let (slope, inter) = format.scaling.unwrap_or((1.0, 0.0));
    let unused = format.unused_bits;
    let mut value = Vec::with_capacity(1);
    with_type!(format.data_type, T => {
        let scale = |v: f64| v * slope + inter;
        T::each(bytes, format.byte_order, &mut value, |v| scale(v.trim(unused).double()));
    });
    value.first().copied().unwrap_or(f64::NAN)
}
