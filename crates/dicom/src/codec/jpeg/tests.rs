//! Frames by an encoder that follows annex H, and by libjpeg-turbo.

use super::super::tests::decoded;
use super::super::{Compression, FrameError, FrameLayout};
use super::*;

/// Bits of a scan.
#[derive(Default)]
struct Writer {
    bytes: Vec<u8>,
    held: u8,
    count: u32,
}

impl Writer {
    fn put(&mut self, number: u32, bits: u32) {
        for n in (0..bits).rev() {
            self.held = self.held << 1 | (number >> n & 1) as u8;
            self.count += 1;
            if self.count == 8 {
                self.bytes.push(self.held);
                if self.held == 0xff {
                    self.bytes.push(0);
                }
                (self.held, self.count) = (0, 0);
            }
        }
    }

    fn flush(&mut self) {
        while self.count > 0 {
            self.put(1, 1);
        }
    }
}

/// The parts of a lossless frame.
#[derive(Clone, Copy)]
struct Options {
    bits: u32,
    predictor: u8,
    point: u32,
    /// Rows between restarts; 0 for none.
    interval: usize,
}

/// Encodes `image`, which has `columns` columns. The differences of 0 to 13 bits have codes of 4 bits, the
/// others of 5.
fn encode(image: &[i32], columns: usize, options: Options) -> Vec<u8> {
    let Options {
        bits,
        predictor,
        point,
        interval,
    } = options;
    let rows = image.len() / columns;
    let mut out = vec![0xff, 0xd8];
    if interval > 0 {
        let [high, low] = ((interval * columns) as u16).to_be_bytes();
        out.extend([0xff, 0xdd, 0, 4, high, low]);
    }
    out.extend([0xff, 0xc4, 0, 36, 0, 0, 0, 0, 14, 3]);
    out.extend([0; 11]);
    out.extend(0..17);
    let [r1, r0] = (rows as u16).to_be_bytes();
    let [c1, c0] = (columns as u16).to_be_bytes();
    out.extend([0xff, 0xc3, 0, 11, bits as u8, r1, r0, c1, c0, 1, 1, 0x11, 0]);
    out.extend([0xff, 0xda, 0, 8, 1, 1, 0, predictor, 0, point as u8]);
    let at = |x: usize, y: usize| image[y * columns + x] >> point;
    let mut writer = Writer::default();
    for y in 0..rows {
        let restarts = interval > 0 && y > 0 && y % interval == 0;
        if restarts {
            writer.flush();
            let n = (y / interval - 1) % 8;
            writer.bytes.extend([0xff, 0xd0 + n as u8]);
        }
        for x in 0..columns {
            let fresh = y == 0 || restarts;
            let predicted = match (fresh, x) {
                (true, 0) => 1 << (bits - point - 1),
                (true, _) => at(x - 1, y),
                (false, 0) => at(0, y - 1),
                (false, _) => {
                    let (a, b, c) = (at(x - 1, y), at(x, y - 1), at(x - 1, y - 1));
                    [
                        0,
                        a,
                        b,
                        c,
                        a + b - c,
                        a + ((b - c) >> 1),
                        b + ((a - c) >> 1),
                        (a + b) >> 1,
                    ][usize::from(predictor)]
                }
            };
            let difference = (at(x, y) - predicted) as i16;
            let size = 16 - difference.unsigned_abs().leading_zeros();
            match size {
                0..=13 => writer.put(size, 4),
                _ => writer.put(28 + size - 14, 5),
            }
            if size < 16 {
                let low = i32::from(difference) - i32::from(difference < 0);
                writer.put(low as u32, size);
            }
        }
    }
    writer.flush();
    out.extend(writer.bytes);
    out.extend([0xff, 0xd9]);
    out
}

/// Numbers of `bits` bits in which every difference occurs.
fn image(count: usize, bits: u32) -> Vec<i32> {
    let mix = |n: usize| (n as u32).wrapping_mul(2_654_435_761) >> 7;
    let value = |n: usize| match n % 5 {
        0 => 0,
        1 => (1 << bits) - 1,
        _ => mix(n) as i32 & ((1 << bits) - 1),
    };
    (0..count).map(value).collect()
}

fn layout(columns: usize, rows: usize, size: usize) -> FrameLayout {
    FrameLayout {
        columns,
        rows,
        size,
        bits: 8 * size as u32,
        signed: false,
    }
}

const LOSSLESS_JPEG: Compression = Compression::Jpeg(Process::Lossless);
const BASELINE_JPEG: Compression = Compression::Jpeg(Process::Baseline);

fn reason(bytes: &[u8], compression: Compression, layout: FrameLayout) -> String {
    match decoded(compression, bytes, layout) {
        Err(FrameError::Wrong(reason)) => reason,
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_predictor_width_point_transform_and_restart_gives_the_image() {
    for predictor in 1..=7 {
        for (bits, point) in [(2, 0), (8, 0), (8, 3), (12, 0), (16, 0), (16, 5)] {
            for interval in [0, 1, 2, 3, 7] {
                for (columns, rows) in [(1, 1), (1, 9), (9, 1), (8, 11), (5, 30)] {
                    let options = Options {
                        bits,
                        predictor,
                        point,
                        interval,
                    };
                    let image = image(columns * rows, bits);
                    let packed = encode(&image, columns, options);
                    let bytes = decoded(LOSSLESS_JPEG, &packed, layout(columns, rows, 2)).unwrap();
                    let (numbers, _) = bytes.as_chunks::<2>();
                    let numbers = numbers.iter().map(|n| i32::from(u16::from_le_bytes(*n)));
                    let expected = image.iter().map(|v| v >> point << point);
                    assert!(
                        numbers.eq(expected),
                        "{predictor} {bits} {point} {interval}"
                    );
                }
            }
        }
    }
}

#[test]
fn damaged_lossless_frames_are_refused() {
    let (columns, rows) = (6, 8);
    let image = image(columns * rows, 12);
    let options = Options {
        bits: 12,
        predictor: 4,
        point: 0,
        interval: 2,
    };
    let good = encode(&image, columns, options);
    let layout = layout(columns, rows, 2);
    let at = |bytes: [u8; 2]| good.windows(2).position(|two| two == bytes).unwrap();
    let changed = |place: usize, value: u8| {
        let mut frame = good.clone();
        frame[place] = value;
        frame
    };
    // Restarts out of order, missing or within a row.
    let order = changed(at([0xff, 0xd1]) + 1, 0xd2);
    assert!(reason(&order, LOSSLESS_JPEG, layout).contains("restart FF D1"));
    let none = changed(at([0xff, 0xdd]) + 5, 0);
    assert!(reason(&none, LOSSLESS_JPEG, layout).contains("cut off"));
    let within = changed(at([0xff, 0xdd]) + 5, 7);
    assert!(reason(&within, LOSSLESS_JPEG, layout).contains("no multiple"));
    let scan = at([0xff, 0xda]);
    for (place, value) in [(7, 0), (7, 8), (8, 1), (9, 12), (4, 2), (5, 9), (6, 0x30)] {
        decoded(LOSSLESS_JPEG, &changed(scan + place, value), layout).unwrap_err();
    }
    for length in 0..good.len() - 2 {
        decoded(LOSSLESS_JPEG, &good[..length], layout).unwrap_err();
    }
    // More numbers than the frame has, a second scan, another frame header.
    let more = encode(&[&image[..], &image[..]].concat(), columns, options);
    let mut more = more;
    let rows_at = more.windows(2).position(|two| two == [0xff, 0xc3]).unwrap() + 6;
    more[rows_at] = rows as u8;
    decoded(LOSSLESS_JPEG, &more, layout).unwrap_err();
    let again = [&good[..good.len() - 2], &good[scan..]].concat();
    assert!(reason(&again, LOSSLESS_JPEG, layout).contains("FF DA"));
    for (code, name) in [
        (0xc0, "baseline JPEG"),
        (0xc1, "extended sequential"),
        (0xc2, "progressive"),
        (0xc5, "hierarchical"),
        (0xc9, "arithmetic"),
        (0xf7, "JPEG-LS"),
    ] {
        let other = changed(at([0xff, 0xc3]) + 1, code);
        assert!(
            reason(&other, LOSSLESS_JPEG, layout).contains(name),
            "{name}"
        );
    }
    assert!(reason(&good, BASELINE_JPEG, layout).contains("baseline JPEG only"));
    // Padding to an even length, and a missing end, are read.
    decoded(LOSSLESS_JPEG, &[&good[..], &[0]].concat(), layout).unwrap();
    decoded(LOSSLESS_JPEG, &good[..good.len() - 2], layout).unwrap();
}

/// Two blocks with a restart between them, quality 90, by libjpeg-turbo; and its numbers.
const RESTARTED_JPEG: &str = "\
    ffd8ffe000104a46494600010100000100010000ffdb004300030202030202030303030403030405080505040405\
    0a070706080c0a0c0c0b0a0b0b0d0e12100d0e110e0b0b1016101113141515150c0f171816141812141514ffc000\
    0b080007000901011100ffc40014000100000000000000000000000000000008ffc40021100000050207000000000\
    00000000000000102030412000607081118216292ffdd00040001ffda0008010100003f002ee583078c9dc0dddcc4\
    e65d06ae06460d0b37029f15ffd05eedcfaa7e82bfffd9";
const RESTARTED_NUMBERS: [u8; 63] = [
    1, 0, 0, 3, 37, 58, 81, 115, 148, 2, 0, 0, 0, 42, 70, 86, 118, 160, 1, 1, 8, 2, 50, 83, 88,
    123, 173, 7, 22, 44, 23, 65, 99, 93, 138, 190, 11, 39, 71, 35, 75, 113, 95, 150, 205, 20, 51,
    87, 39, 85, 132, 103, 163, 225, 31, 65, 104, 48, 100, 155, 114, 177, 245,
];

#[test]
fn baseline_frames_are_those_of_libjpeg() {
    let good = super::super::tests::bytes(RESTARTED_JPEG);
    let layout = layout(9, 7, 1);
    assert_eq!(
        decoded(BASELINE_JPEG, &good, layout).unwrap(),
        RESTARTED_NUMBERS
    );
    for length in 0..good.len() - 2 {
        decoded(BASELINE_JPEG, &good[..length], layout).unwrap_err();
    }
    let frame = good.windows(2).position(|two| two == [0xff, 0xc0]).unwrap();
    let mut progressive = good.clone();
    progressive[frame + 1] = 0xc2;
    assert!(reason(&progressive, BASELINE_JPEG, layout).contains("progressive JPEG"));
    let scan = good.windows(2).position(|two| two == [0xff, 0xda]).unwrap();
    let again = [&good[..good.len() - 2], &good[scan..]].concat();
    assert!(reason(&again, BASELINE_JPEG, layout).contains("FF DA"));
}

#[test]
fn the_inverse_transform_is_the_cosine_transform() {
    use std::f64::consts::{FRAC_1_SQRT_2, PI};
    let mut seed = 1_u32;
    for round in 0..200 {
        let mut block = [0_i64; 64];
        for n in 0..1 + round % 64 {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            block[(seed >> 8) as usize % 64] = i64::from(seed >> 20) % 512 - 256 + n;
        }
        let scale = |k: usize| if k == 0 { FRAC_1_SQRT_2 } else { 1.0 };
        let wave = |x: usize, k: usize| ((2 * x + 1) as f64 * k as f64 * PI / 16.0).cos();
        let exact = |x: usize, y: usize| {
            let terms = (0..64).map(|n| {
                let (u, v) = (n % 8, n / 8);
                scale(u) * scale(v) * block[n] as f64 * wave(x, u) * wave(y, v) / 4.0
            });
            terms.sum::<f64>()
        };
        let mut found = block;
        baseline::transform(&mut found);
        for n in 0..64 {
            let off = found[n] as f64 - exact(n % 8, n / 8);
            assert!(off.abs() < 0.75, "{off}");
        }
    }
}
