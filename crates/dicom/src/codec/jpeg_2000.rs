//! JPEG 2000 (ISO 15444-1) for one component: its structure here, its numbers by `hayro-jpeg2000`.
//!
//! The decoder asks nobody whether to go on, so the marker segments of the main header and of every
//! tile-part are read before, and a stream is refused that
//!
//! - names another part of the standard (High-Throughput, ISO 15444-15), or uses what is not checked
//!   against another decoder: regions of interest, changes of the progression, packed packet headers;
//! - is irreversible where the transfer syntax says that it is not, or lacks a tile or a part of one;
//! - has more code blocks, layers and precincts than its pixels warrant ([`most_parts`]).
//!
//! The rest costs a time per pixel that is bounded by the bit-planes, of which the decoder takes 31.
//! Numbers outside the range of their bits, which quantised wavelets give at edges, are set to its ends
//! (ISO 15444-1, G.1.2). Letters of fields (`Xsiz`, `Isot`) are those of the standard.

use super::{FrameError, FrameLayout, Numbers};
use hayro_jpeg2000::{DecodeSettings, DecoderContext, Image};

/// Most tiles of a frame.
const MOST_TILES: u64 = 4096;

/// Most layers, which is the decoder's limit.
const MOST_LAYERS: u64 = 32;

/// Most bits of a number: above, the wavelet's sums exceed the 24 bits of the decoder's floats.
const MOST_BITS: u32 = 20;

/// Most decomposition levels (A.6.1).
const MOST_LEVELS: u8 = 32;

/// Most code blocks times layers, and precincts, of a frame.
fn most_parts(pixels: u64) -> u64 {
    (pixels / 4).max(16_384)
}

/// Decodes the frame in `bytes`; `irreversible` if the transfer syntax allows that.
pub(super) fn decode(
    irreversible: bool,
    bytes: &[u8],
    layout: FrameLayout,
) -> Result<Numbers, FrameError> {
    let stream = code_stream(bytes)?;
    let size = ImageSize::read(stream).ok_or("the JPEG 2000 image size (SIZ) is damaged")?;
    layout.check(size.columns(), size.rows(), size.components)?;
    layout.check_bits(size.bits)?;
    if size.bits > MOST_BITS {
        return Err(FrameError::Wrong(format!(
            "the JPEG 2000 frame has {} bits per number; at most {MOST_BITS} are decoded exactly",
            size.bits
        )));
    }
    if size.sampling != [1, 1] {
        return Err("the JPEG 2000 component is subsampled".into());
    }
    let tiles = size
        .tiles()
        .ok_or("the JPEG 2000 tiles contradict the image size")?;
    if tiles > MOST_TILES {
        return Err(FrameError::Wrong(format!(
            "the JPEG 2000 frame has {tiles} tiles; at most {MOST_TILES} are read"
        )));
    }
    let structure = Structure::read(stream, &size, tiles)?;
    structure.check(&size, tiles, irreversible)?;
    let settings = DecodeSettings {
        resolve_palette_indices: false,
        strict: true,
        target_resolution: None,
    };
    let wrong = |e: hayro_jpeg2000::DecodeError| format!("the JPEG 2000 frame is damaged: {e}");
    let image = Image::new(&structure.stream, &settings).map_err(wrong)?;
    let mut context = DecoderContext::default();
    let decoded = image.decode(&mut context).map_err(wrong)?;
    let [component] = decoded.components() else {
        return Err("the JPEG 2000 frame has several components".into());
    };
    // The decoder shifts signed numbers as it does unsigned ones, so that the least becomes 0.
    let shift = if size.signed { 1 << (size.bits - 1) } else { 0 };
    let most = ((1_u32 << size.bits) - 1) as f32;
    let samples = component.samples().iter();
    let values = samples.map(|v| v.round_ties_even().clamp(0.0, most) as i32 - shift);
    Ok(Numbers {
        values: values.collect(),
        bits: size.bits,
        lossless: structure.is_reversible(),
    })
}

/// The code stream in `bytes`, which may be wrapped in a JP2 file (annex I).
fn code_stream(bytes: &[u8]) -> Result<&[u8], String> {
    const CODESTREAM_START: [u8; 4] = [0xff, 0x4f, 0xff, 0x51];
    const JP2_SIGNATURE: [u8; 8] = *b"\0\0\0\x0cjP  ";
    if bytes.starts_with(&CODESTREAM_START) {
        return Ok(bytes);
    }
    if !bytes.starts_with(&JP2_SIGNATURE) {
        return Err(
            "the frame is not a JPEG 2000 stream: it does not begin with FF 4F FF 51".into(),
        );
    }
    let start = bytes.windows(4).position(|four| four == CODESTREAM_START);
    let (boxes, stream) = bytes.split_at(start.unwrap_or(bytes.len()));
    if boxes.windows(4).any(|four| four == b"pclr") {
        Err("the JPEG 2000 frame has a palette".into())
    } else {
        Ok(stream)
    }
}

/// A big endian number of two or four bytes.
fn short(bytes: &[u8], at: usize) -> Option<u64> {
    let two = bytes.get(at..)?.first_chunk()?;
    Some(u16::from_be_bytes(*two).into())
}
fn long(bytes: &[u8], at: usize) -> Option<u64> {
    let four = bytes.get(at..)?.first_chunk()?;
    Some(u32::from_be_bytes(*four).into())
}

/// The SIZ marker segment (A.5.1).
struct ImageSize {
    /// Whether it names extensions of other parts.
    extended: bool,
    /// `XOsiz`, `Xsiz` and `YOsiz`, `Ysiz`: the image on the reference grid.
    image: [[u64; 2]; 2],
    /// `XTOsiz` and `YTOsiz`: the first tile.
    first_tile: [u64; 2],
    /// `XTsiz` and `YTsiz`: size of a tile.
    tile: [u64; 2],
    components: u64,
    bits: u32,
    signed: bool,
    sampling: [u8; 2],
}

impl ImageSize {
    /// Reads the segment at the start of `stream`; `None` if it is cut off or contradicts itself.
    fn read(stream: &[u8]) -> Option<Self> {
        let at = |place| long(stream, place);
        let depth = *stream.get(42)?;
        let size = Self {
            extended: short(stream, 6)? & 0xc000 != 0,
            image: [[at(16)?, at(8)?], [at(20)?, at(12)?]],
            tile: [at(24)?, at(28)?],
            first_tile: [at(32)?, at(36)?],
            components: short(stream, 40)?,
            bits: u32::from(depth & 0x7f) + 1,
            signed: depth & 0x80 != 0,
            sampling: [*stream.get(43)?, *stream.get(44)?],
        };
        let whole = (0..2).all(|axis| {
            let [begin, end] = size.image[axis];
            let first = size.first_tile[axis];
            begin < end && first <= begin && first + size.tile[axis] > begin && size.tile[axis] > 0
        });
        whole.then_some(size)
    }

    fn columns(&self) -> u64 {
        self.image[0][1] - self.image[0][0]
    }

    fn rows(&self) -> u64 {
        self.image[1][1] - self.image[1][0]
    }

    /// Tiles along an axis (B-5).
    fn tiles_along(&self, axis: usize) -> u64 {
        (self.image[axis][1] - self.first_tile[axis]).div_ceil(self.tile[axis])
    }

    fn tiles(&self) -> Option<u64> {
        self.tiles_along(0).checked_mul(self.tiles_along(1))
    }

    /// Begin and end of tile number `n` along an axis (B-7 to B-10).
    fn tile_span(&self, axis: usize, n: u64) -> [u64; 2] {
        let begin = self.first_tile[axis] + n * self.tile[axis];
        let [from, to] = self.image[axis];
        [begin.max(from), (begin + self.tile[axis]).min(to)]
    }
}

/// The coding style of a COD or COC segment (A.6.1, A.6.2).
struct CodingStyle {
    levels: u8,
    /// Exponents of a code block's width and height.
    block: [u32; 2],
    reversible: bool,
    /// Exponents of the precincts' width and height for each resolution; none for 15.
    precincts: Vec<[u32; 2]>,
}

impl CodingStyle {
    /// Reads the parameters that follow the flags of a segment.
    fn read(parameters: &[u8], precincts: bool) -> Result<Self, String> {
        let [levels, width, height, style, transform, sizes @ ..] = parameters else {
            return Err("a JPEG 2000 coding style is cut off".into());
        };
        if style & 0x40 != 0 {
            return Err("the frame is High-Throughput JPEG 2000, which is not supported".into());
        }
        if style & 0x80 != 0 || *transform > 1 {
            return Err("the JPEG 2000 coding style is one of another part".into());
        }
        let block = [u32::from(*width) + 2, u32::from(*height) + 2];
        let [wide, high] = block;
        if *levels > MOST_LEVELS || wide > 10 || high > 10 || wide + high > 12 {
            return Err("the JPEG 2000 code blocks or levels exceed the standard's".into());
        }
        let sizes = if precincts {
            sizes.get(..usize::from(*levels) + 1)
        } else {
            Some(&[][..])
        };
        let sizes = sizes.ok_or("the JPEG 2000 precincts are cut off")?;
        let exponents = |size: &u8| [u32::from(size & 15), u32::from(size >> 4)];
        Ok(Self {
            levels: *levels,
            block,
            reversible: *transform == 1,
            precincts: sizes.iter().map(exponents).collect(),
        })
    }

    /// Code blocks and precincts in the tile `[x, y]` of begins and ends; `None` if there are more than
    /// can be counted (B.5 to B.7).
    fn parts(&self, tile: [[u64; 2]; 2]) -> Option<(u64, u64)> {
        let (mut blocks, mut precincts) = (0_u64, 0_u64);
        for resolution in 0..=self.levels {
            let level = u32::from(self.levels - resolution);
            let exponents = self.precincts.get(usize::from(resolution));
            let exponents = exponents.copied().unwrap_or([15, 15]);
            // Precincts on the grid of the resolution (B-16).
            let along = |axis: usize| {
                let [begin, end] = tile[axis].map(|edge| scaled(edge, level, 0));
                if begin < end {
                    spans([begin, end], exponents[axis])
                } else {
                    0
                }
            };
            precincts = precincts.checked_add(along(0).checked_mul(along(1))?)?;
            let bands: &[[u64; 2]] = match resolution {
                0 => &[[0, 0]],
                _ => &[[1, 0], [0, 1], [1, 1]],
            };
            let (depth, halved) = match resolution {
                0 => (level, 0),
                _ => (level + 1, 1),
            };
            for band in bands {
                let along = |axis: usize| {
                    let [begin, end] = tile[axis].map(|edge| scaled(edge, depth, band[axis]));
                    // A precinct of one number of the resolution holds none or one of the band.
                    let precinct = exponents[axis].saturating_sub(halved);
                    if begin < end {
                        spans([begin, end], self.block[axis].min(precinct))
                    } else {
                        0
                    }
                };
                blocks = blocks.checked_add(along(0).checked_mul(along(1))?)?;
            }
        }
        Some((blocks, precincts))
    }
}

/// An edge on the reference grid, on that of a sub-band (B-15).
fn scaled(edge: u64, depth: u32, high: u64) -> u64 {
    let offset = match depth {
        0 => 0,
        _ => high << (depth - 1),
    };
    edge.saturating_sub(offset).div_ceil(1 << depth)
}

/// The number of cells of `2^exponent` in which the numbers from begin to end lie.
fn spans([begin, end]: [u64; 2], exponent: u32) -> u64 {
    end.div_ceil(1 << exponent) - (begin >> exponent)
}

/// The marker segments of a stream.
struct Structure<'a> {
    /// The stream; the length of its last tile-part is filled in if it was left open.
    stream: std::borrow::Cow<'a, [u8]>,
    styles: Vec<CodingStyle>,
    layers: u64,
    /// Whether a segment quantises, and whether one does not.
    quantised: [bool; 2],
}

impl<'a> Structure<'a> {
    /// Reads the marker segments of `stream`.
    fn read(stream: &'a [u8], size: &ImageSize, tiles: u64) -> Result<Self, String> {
        if size.extended {
            return Err(
                "the frame uses extensions of JPEG 2000 (Rsiz), which are not supported".into(),
            );
        }
        let mut structure = Self {
            stream: stream.into(),
            styles: Vec::new(),
            layers: 0,
            quantised: [false; 2],
        };
        // Tile-parts read and stated of each tile.
        let mut parts = vec![(0_u8, 0_u8); tiles as usize];
        let cut = || "the JPEG 2000 stream is cut off".to_owned();
        let mut at = 2;
        // The end of the tile-part whose header is being read.
        let mut end = None;
        loop {
            let marker = short(stream, at).ok_or_else(cut)?;
            if marker == 0xffd9 && end.is_none() {
                break;
            }
            if marker == 0xff93 {
                at = end
                    .take()
                    .ok_or("JPEG 2000 data begin outside of a tile-part")?;
                continue;
            }
            // Markers without a segment (A.1).
            if let 0xff30..=0xff3f = marker {
                at += 2;
                continue;
            }
            let length = short(stream, at + 2).ok_or_else(cut)? as usize;
            let segment = stream.get(at + 4..at + 2 + length).ok_or_else(cut)?;
            if marker == 0xff90 {
                if end.is_some() {
                    return Err("a JPEG 2000 tile-part has no data".into());
                }
                end = Some(structure.tile_part(at, segment, &mut parts)?);
            } else {
                structure.segment(marker, segment)?;
            }
            at += 2 + length;
            if end.is_some_and(|end| at > end) {
                return Err("a JPEG 2000 tile-part is shorter than its header".into());
            }
        }
        let mut each = (0_u64..).zip(&parts);
        let lacking =
            each.find(|(_, (read, stated))| *read == 0 || (*stated > 0 && read != stated));
        match lacking {
            None => Ok(structure),
            Some((tile, (read, stated))) => Err(format!(
                "tile {tile} of the JPEG 2000 frame has {read} of {} parts",
                (*stated).max(1)
            )),
        }
    }

    /// Reads the SOT segment whose marker is at byte `at` (A.4.2). Returns where its tile-part ends.
    fn tile_part(
        &mut self,
        at: usize,
        segment: &[u8],
        parts: &mut [(u8, u8)],
    ) -> Result<usize, String> {
        let short_header = "a JPEG 2000 tile-part header is too short";
        let &[_, _, _, _, _, _, number, count] = segment.first_chunk().ok_or(short_header)?;
        let tile = short(segment, 0).ok_or(short_header)?;
        let length = long(segment, 2).ok_or(short_header)? as usize;
        let part = parts.get_mut(tile as usize);
        let (read, stated) =
            part.ok_or_else(|| format!("the JPEG 2000 frame has no tile {tile}"))?;
        if number != *read || *read == u8::MAX {
            return Err(format!(
                "part {number} of JPEG 2000 tile {tile} stands where part {read} is due"
            ));
        }
        *read += 1;
        *stated = (*stated).max(count);
        let end = match length {
            // The last tile-part, up to the end of the stream.
            0 => {
                let last = self.stream.windows(2).rposition(|two| two == [0xff, 0xd9]);
                let last = last.filter(|last| *last > at);
                let last = last.ok_or("the JPEG 2000 stream has no end")?;
                let length = ((last - at) as u32).to_be_bytes();
                self.stream.to_mut()[at + 6..at + 10].copy_from_slice(&length);
                last
            }
            _ => at + length,
        };
        if end <= self.stream.len() {
            Ok(end)
        } else {
            Err("the JPEG 2000 stream is cut off".into())
        }
    }

    /// Reads another segment of a header.
    fn segment(&mut self, marker: u64, segment: &[u8]) -> Result<(), String> {
        let cut = "a JPEG 2000 coding style is cut off";
        let unsupported = match marker {
            0xff50 => "capabilities of another part (CAP)",
            0xff5e => "a region of interest (RGN)",
            0xff5f => "a change of the progression (POC)",
            0xff60 => "packed packet headers (PPM)",
            0xff61 => "packed packet headers (PPT)",
            // Image size, lengths, component registration and comments.
            0xff51 | 0xff55 | 0xff57 | 0xff58 | 0xff63 | 0xff64 => return Ok(()),
            0xff52 => {
                let [flags, _, l1, l0, _, parameters @ ..] = segment else {
                    return Err(cut.into());
                };
                let layers = u16::from_be_bytes([*l1, *l0]).into();
                self.layers = self.layers.max(layers);
                if !(1..=MOST_LAYERS).contains(&layers) {
                    return Err(format!(
                        "the JPEG 2000 frame has {layers} layers; 1 to {MOST_LAYERS} are read"
                    ));
                }
                self.styles
                    .push(CodingStyle::read(parameters, flags & 1 != 0)?);
                return Ok(());
            }
            0xff53 => {
                let [_, flags, parameters @ ..] = segment else {
                    return Err(cut.into());
                };
                self.styles
                    .push(CodingStyle::read(parameters, flags & 1 != 0)?);
                return Ok(());
            }
            0xff5c | 0xff5d => {
                let style = segment.get(usize::from(marker == 0xff5d));
                let style = style.ok_or("a JPEG 2000 quantisation is cut off")?;
                self.quantised[usize::from(style & 0x1f != 0)] = true;
                return Ok(());
            }
            _ => {
                return Err(format!(
                    "the JPEG 2000 header has the marker {marker:04X}, which is not supported"
                ));
            }
        };
        Err(format!(
            "the JPEG 2000 frame has {unsupported}, which is not supported"
        ))
    }

    fn is_reversible(&self) -> bool {
        self.styles.iter().all(|style| style.reversible)
    }

    /// Checks the kind of wavelet and the number of parts.
    fn check(&self, size: &ImageSize, tiles: u64, irreversible: bool) -> Result<(), String> {
        let reversible = self.is_reversible();
        if !irreversible && !reversible {
            return Err(
                "the frame is irreversible JPEG 2000; the transfer syntax allows reversible only"
                    .into(),
            );
        }
        let mixed = self.styles.iter().any(|style| style.reversible) && !reversible;
        if mixed || self.quantised[usize::from(reversible)] {
            return Err("the JPEG 2000 wavelet and quantisation contradict each other".into());
        }
        let most = most_parts(size.columns() * size.rows());
        for style in &self.styles {
            let mut parts = 0_u64;
            for tile in 0..tiles {
                let along = size.tiles_along(0);
                let tile = [
                    size.tile_span(0, tile % along),
                    size.tile_span(1, tile / along),
                ];
                let counted = style.parts(tile).and_then(|(blocks, precincts)| {
                    blocks.checked_mul(self.layers)?.checked_add(precincts)
                });
                parts = parts.saturating_add(counted.unwrap_or(u64::MAX));
                if parts > most {
                    return Err(format!(
                        "the JPEG 2000 frame has more than {most} code blocks, layers and \
                         precincts for its {} x {} pixels",
                        size.columns(),
                        size.rows()
                    ));
                }
            }
        }
        Ok(())
    }
}
