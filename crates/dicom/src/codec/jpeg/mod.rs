//! JPEG (ISO 10918-1, ITU-T T.81) for one component: the [`baseline`] process and the
//! [`lossless`] one with every predictor, both Huffman coded, with or without restarts.
//!
//! The marker segments are read first. A process that the transfer syntax does not allow is refused by
//! its name, so that a frame has exactly one scan and is decoded in a time that its pixels bound: every
//! code is read once, and each takes at least one bit of the frame. Letters and numbers of sections are
//! those of the standard.
//!
//! `jpeg-decoder` is not used: it decodes restarts in the lossless process wrongly, fills what is cut
//! off with zeros, and has no limit to the scans of a progressive frame.

mod baseline;
mod bits;
mod lossless;

use super::{FrameError, FrameLayout, Numbers, Pace};
use bits::{Bits, Table};

/// The process that a transfer syntax allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Process {
    /// Baseline DCT, process 1.
    Baseline,
    /// Lossless with Huffman codes, process 14.
    Lossless,
}

impl Process {
    fn name(self) -> &'static str {
        match self {
            Self::Baseline => "baseline",
            Self::Lossless => "lossless",
        }
    }

    /// Its Start of Frame marker.
    fn marker(self) -> u8 {
        match self {
            Self::Baseline => 0xc0,
            Self::Lossless => 0xc3,
        }
    }
}

/// The name of the code stream that has this Start of Frame marker (B.1.1.3).
fn frame_name(marker: u8) -> &'static str {
    match marker {
        0xc0 => "baseline JPEG",
        0xc1 => "extended sequential JPEG",
        0xc2 => "progressive JPEG",
        0xc3 => "lossless JPEG",
        0xc5..=0xc7 => "hierarchical JPEG",
        0xf7 => "JPEG-LS",
        _ => "arithmetic JPEG",
    }
}

/// The marker segments before the coded numbers.
struct Header<'a> {
    bits: u32,
    /// Tables of quantisation, in zigzag order.
    quantisation: [Option<[u8; 64]>; 4],
    /// Huffman tables for differences.
    differences: [Option<Table>; 4],
    /// Huffman tables for the other coefficients.
    coefficients: [Option<Table>; 4],
    /// Codes between two restarts; 0 without restarts.
    restart: usize,
    frame: Option<Component>,
    scan: Scan,
    /// The coded numbers and what follows.
    data: &'a [u8],
}

/// The component in the Start of Frame segment.
#[derive(Clone, Copy)]
struct Component {
    identifier: u8,
    quantisation: u8,
}

/// The parameters in the Start of Scan segment.
#[derive(Default, Clone, Copy)]
struct Scan {
    /// Huffman tables for differences and for other coefficients.
    tables: [usize; 2],
    /// Start of spectral selection, or the predictor.
    first: u8,
    /// End of spectral selection.
    last: u8,
    /// Successive approximation, or the point transform.
    approximation: u8,
}

/// Decodes the frame in `bytes`.
pub(super) fn decode(
    process: Process,
    bytes: &[u8],
    layout: FrameLayout,
    pace: &mut Pace<'_>,
) -> Result<Numbers, FrameError> {
    let header = Header::read(process, bytes, layout)?;
    let mut bits = Bits::new(header.data);
    let values = match process {
        Process::Baseline => baseline::decode(&header, &mut bits, layout, pace)?,
        Process::Lossless => lossless::decode(&header, &mut bits, layout, pace)?,
    };
    bits.end()?;
    Ok(Numbers {
        values,
        bits: header.bits,
        lossless: process == Process::Lossless,
    })
}

impl<'a> Header<'a> {
    fn read(process: Process, bytes: &'a [u8], layout: FrameLayout) -> Result<Self, String> {
        if !bytes.starts_with(&[0xff, 0xd8]) {
            return Err("the frame is not a JPEG stream: it does not begin with FF D8".into());
        }
        let mut header = Self {
            bits: 0,
            quantisation: [None; 4],
            differences: [const { None }; 4],
            coefficients: [const { None }; 4],
            restart: 0,
            frame: None,
            scan: Scan::default(),
            data: &[],
        };
        let cut = || "the JPEG header is cut off".to_owned();
        let mut at = 2;
        loop {
            let marker = bytes.get(at..at + 2).ok_or_else(cut)?;
            if marker[0] != 0xff {
                return Err("a marker is missing in the JPEG header".into());
            }
            // Fill bytes before a marker.
            if marker[1] == 0xff {
                at += 1;
                continue;
            }
            let code = marker[1];
            if matches!(code, 0x00 | 0x01 | 0xd0..=0xd9) {
                return Err(format!(
                    "the marker FF {code:02X} stands in the JPEG header"
                ));
            }
            let length = bytes.get(at + 2..).and_then(<[u8]>::first_chunk);
            let length = usize::from(u16::from_be_bytes(*length.ok_or_else(cut)?));
            let segment = bytes.get(at + 4..at + 2 + length).ok_or_else(cut)?;
            at += 2 + length;
            match code {
                0xc4 => header.huffman(segment)?,
                0xdb => header.quantise(segment)?,
                0xdd => {
                    let interval = segment.first_chunk().ok_or_else(cut)?;
                    header.restart = u16::from_be_bytes(*interval).into();
                }
                0xda => {
                    header.start_scan(segment)?;
                    header.data = &bytes[at..];
                    return header.checked(process);
                }
                0xc0..=0xc3 | 0xc5..=0xc7 | 0xc9..=0xcb | 0xcd..=0xcf | 0xf7 => {
                    if code != process.marker() {
                        return Err(format!(
                            "the frame is {}; the transfer syntax allows {} JPEG only",
                            frame_name(code),
                            process.name()
                        ));
                    }
                    header.start_frame(segment, layout)?;
                }
                0xcc => return Err("the JPEG frame is arithmetic coded".into()),
                0xde | 0xdf => return Err("the JPEG frame is hierarchical".into()),
                // APPn, COM and what has no meaning before the coded numbers.
                0xe0..=0xef | 0xfe => {}
                _ => {
                    return Err(format!(
                        "the JPEG header has the marker FF {code:02X}, which is not supported"
                    ));
                }
            }
        }
    }

    fn start_frame(&mut self, segment: &[u8], layout: FrameLayout) -> Result<(), String> {
        let cut = "the JPEG frame header is too short";
        let [bits, r1, r0, c1, c0, components] = *segment.first_chunk().ok_or(cut)?;
        if self.frame.is_some() {
            return Err("the JPEG stream has several frame headers".into());
        }
        let rows = u16::from_be_bytes([r1, r0]);
        let columns = u16::from_be_bytes([c1, c0]);
        layout.check(columns.into(), rows.into(), components.into())?;
        self.bits = bits.into();
        layout.check_bits(self.bits)?;
        let [identifier, _, quantisation] = *segment[6..].first_chunk().ok_or(cut)?;
        self.frame = Some(Component {
            identifier,
            quantisation,
        });
        Ok(())
    }

    fn start_scan(&mut self, segment: &[u8]) -> Result<(), String> {
        let Some(component) = self.frame else {
            return Err("the JPEG scan has no frame header".into());
        };
        let [1, identifier, tables, first, last, approximation] = *segment else {
            return Err("the JPEG scan is not one of one component".into());
        };
        if identifier != component.identifier {
            return Err(format!(
                "the JPEG scan is of component {identifier}, the frame has component {}",
                component.identifier
            ));
        }
        self.scan = Scan {
            tables: [usize::from(tables >> 4), usize::from(tables & 15)],
            first,
            last,
            approximation,
        };
        Ok(())
    }

    /// Reads the tables of a DHT segment (B.2.4.2).
    fn huffman(&mut self, mut segment: &[u8]) -> Result<(), String> {
        while let Some((&place, rest)) = segment.split_first() {
            let (counts, rest) = rest
                .split_first_chunk::<16>()
                .ok_or("a JPEG Huffman table is cut off")?;
            let symbols = counts.iter().map(|n| usize::from(*n)).sum::<usize>();
            let symbols = rest
                .get(..symbols)
                .ok_or("a JPEG Huffman table is cut off")?;
            segment = &rest[symbols.len()..];
            let table = Some(Table::new(counts, symbols)?);
            match (place >> 4, usize::from(place & 15)) {
                (0, n @ 0..=3) => self.differences[n] = table,
                (1, n @ 0..=3) => self.coefficients[n] = table,
                _ => return Err(format!("a JPEG Huffman table has the number {place:#04x}")),
            }
        }
        Ok(())
    }

    /// Reads the tables of a DQT segment (B.2.4.1).
    fn quantise(&mut self, mut segment: &[u8]) -> Result<(), String> {
        while let Some((&place, rest)) = segment.split_first() {
            let n @ 0..=3 = place else {
                return Err(format!(
                    "a JPEG table of quantisation has the number and width {place:#04x}"
                ));
            };
            let (table, rest) = rest
                .split_first_chunk::<64>()
                .ok_or("a JPEG table of quantisation is cut off")?;
            self.quantisation[usize::from(n)] = Some(*table);
            segment = rest;
        }
        Ok(())
    }

    fn checked(self, process: Process) -> Result<Self, String> {
        let scan = self.scan;
        let wrong = match process {
            Process::Baseline if self.bits != 8 => format!("{} bits per number", self.bits),
            Process::Baseline if (scan.first, scan.last, scan.approximation) != (0, 63, 0) => {
                format!(
                    "a scan of the coefficients {} to {} with approximation {:#04x}",
                    scan.first, scan.last, scan.approximation
                )
            }
            Process::Lossless if !(2..=16).contains(&self.bits) => {
                format!("{} bits per number", self.bits)
            }
            Process::Lossless if !(1..=7).contains(&scan.first) || scan.last != 0 => {
                format!("the predictor {} to {}", scan.first, scan.last)
            }
            Process::Lossless if u32::from(scan.approximation) >= self.bits => {
                format!("the point transform {:#04x}", scan.approximation)
            }
            _ => return Ok(self),
        };
        Err(format!(
            "the frame has {wrong}, which {} JPEG does not allow",
            process.name()
        ))
    }

    /// The Huffman table of differences.
    fn difference_table(&self) -> Result<&Table, String> {
        let table = self.differences.get(self.scan.tables[0]);
        let table = table.and_then(Option::as_ref);
        table.ok_or_else(|| "the JPEG scan has no Huffman table for differences".to_owned())
    }
}

#[cfg(test)]
mod tests;
