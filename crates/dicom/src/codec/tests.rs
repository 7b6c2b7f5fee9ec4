//! Properties of every codec: sizes, kinds of code streams, stored bits, cost and cancelling.

use super::*;

/// Decodes without being cancelled.
pub(super) fn decoded(
    compression: Compression,
    bytes: &[u8],
    layout: FrameLayout,
) -> Result<Vec<u8>, FrameError> {
    decode(compression, bytes, layout, &mut || true)
}

/// The bytes of hexadecimal digits.
pub(super) fn bytes(hex: &str) -> Vec<u8> {
    let digits: Vec<u32> = hex.chars().map(|c| c.to_digit(16).unwrap()).collect();
    let (pairs, _) = digits.as_chunks::<2>();
    pairs.iter().map(|[a, b]| (16 * a + b) as u8).collect()
}

fn reason(compression: Compression, bytes: &[u8], layout: FrameLayout) -> String {
    match decoded(compression, bytes, layout) {
        Err(FrameError::Wrong(reason)) => reason,
        other => panic!("{other:?}"),
    }
}

const JPEG_2000: Compression = Compression::Jpeg2000 { irreversible: true };
const J2K_REVERSIBLE: Compression = Compression::Jpeg2000 {
    irreversible: false,
};
const LOSSLESS_JPEG: Compression = Compression::Jpeg(Process::Lossless);
const BASELINE_JPEG: Compression = Compression::Jpeg(Process::Baseline);
const JPEG_LS: Compression = Compression::JpegLs { near: true };

/// A chessboard of 0 and 65535, irreversible at a ratio of 12, by OpenJPEG 2.5.2.
const UNSIGNED_BOARD: &str = "\
    ff4fff5100290000000000200000002000000000000000000000002000000020000000000000000000010f0101ff\
    52000c00000001000504040000ff5c002342b720b6f0b6f0b6c0af00af00aee0a750a750a76890059005904797d3\
    97d39762ff640025000143726561746564206279204f70656e4a5045472076657273696f6e20322e352e32ff9000\
    0a0000000000310001ff938080a11004dacf80688a74501758514b13a301741a9e40f5a2dc3834c72628d7a84f80\
    ffd9";

/// A chessboard of -2048 and 2047 of 12 signed bits, irreversible at a ratio of 12, by OpenJPEG 2.5.2.
const SIGNED_BOARD: &str = "\
    ff4fff5100290000000000200000002000000000000000000000002000000020000000000000000000018b0101ff\
    52000c00000001000504040000ff5c002342972096f096f096c08f008f008ee087508750876870057005704777d3\
    77d37762ff640025000143726561746564206279204f70656e4a5045472076657273696f6e20322e352e32ff9000\
    0a0000000000260001ff93808080cf80688a74501758514b13a301741a9e40f5a28080ffd9";

fn square(side: usize) -> FrameLayout {
    FrameLayout {
        columns: side,
        rows: side,
        size: 2,
        bits: 16,
        signed: false,
    }
}

#[test]
fn a_code_stream_of_another_size_takes_no_memory() {
    let layout = FrameLayout {
        columns: 4,
        rows: 3,
        ..square(0)
    };
    let mut huge = vec![0xff, 0x4f, 0xff, 0x51, 0, 41, 0, 0];
    for number in [60_000_u32, 60_000, 0, 0, 1, 1, 0, 0] {
        huge.extend(number.to_be_bytes());
    }
    huge.extend([0, 1, 15, 1, 1]);
    assert!(reason(JPEG_2000, &huge, layout).contains("60000 columns"));
    // As many columns and rows as stated, but in 4096 million tiles.
    let mut tiles = huge.clone();
    tiles[8..16].copy_from_slice(&[0, 0, 0, 4, 0, 0, 0, 3]);
    tiles[16..24].copy_from_slice(&[0; 8]);
    decoded(JPEG_2000, &tiles, layout).unwrap_err();
    let jpeg = [
        0xff, 0xd8, 0xff, 0xc3, 0, 11, 16, 0xff, 0xff, 0xff, 0xff, 1, 1, 0x11, 0,
    ];
    assert!(reason(LOSSLESS_JPEG, &jpeg, layout).contains("65535 columns"));
    for compression in [
        Compression::Rle,
        LOSSLESS_JPEG,
        BASELINE_JPEG,
        JPEG_LS,
        JPEG_2000,
    ] {
        decoded(compression, &[], layout).unwrap_err();
    }
}

#[test]
fn wavelets_that_overshoot_end_at_the_range() {
    let numbers = decoded(JPEG_2000, &bytes(UNSIGNED_BOARD), square(32)).unwrap();
    let (numbers, _) = numbers.as_chunks::<2>();
    let numbers: Vec<u16> = numbers.iter().map(|n| u16::from_le_bytes(*n)).collect();
    // By OpenJPEG: 86 numbers are 0, 82 are 65535, and this is how the first row begins.
    assert_eq!(numbers.iter().filter(|v| **v == 0).count(), 86);
    assert_eq!(numbers.iter().filter(|v| **v == 65535).count(), 82);
    let row = [
        8754, 9524, 11367, 13433, 17097, 25022, 33307, 41449, 44055, 30336, 12566, 0, 0, 2819,
    ];
    assert!(numbers.iter().zip(row).all(|(a, b)| a.abs_diff(b) <= 1));
    let sum: u64 = numbers.iter().map(|v| u64::from(*v)).sum();
    assert!(sum.abs_diff(33_268_870) < 500, "{sum}");
    let layout = FrameLayout {
        bits: 12,
        signed: true,
        ..square(32)
    };
    let numbers = decoded(JPEG_2000, &bytes(SIGNED_BOARD), layout).unwrap();
    let (numbers, _) = numbers.as_chunks::<2>();
    let numbers: Vec<i16> = numbers.iter().map(|n| i16::from_le_bytes(*n)).collect();
    assert_eq!(numbers.iter().filter(|v| **v == -2048).count(), 67);
    assert_eq!(numbers.iter().filter(|v| **v == 2047).count(), 57);
    assert!(numbers.iter().all(|v| (-2048..=2047).contains(v)));
}

#[test]
fn what_the_syntax_does_not_allow_is_refused_by_name() {
    let board = bytes(UNSIGNED_BOARD);
    let layout = square(32);
    assert!(reason(J2K_REVERSIBLE, &board, layout).contains("irreversible"));
    for other in [Compression::Rle, LOSSLESS_JPEG, BASELINE_JPEG, JPEG_LS] {
        decoded(other, &board, layout).unwrap_err();
    }
    let sot = board
        .windows(2)
        .position(|two| two == [0xff, 0x90])
        .unwrap();
    let with = |segment: &[u8]| [&board[..sot], segment, &board[sot..]].concat();
    for (segment, name) in [
        (&[0xff, 0x5e, 0, 5, 0, 0, 5][..], "RGN"),
        (&[0xff, 0x5f, 0, 9, 0, 0, 0, 1, 6, 1, 0], "POC"),
        (&[0xff, 0x60, 0, 3, 0], "PPM"),
        (&[0xff, 0x50, 0, 8, 0, 2, 0, 0, 0, 0], "CAP"),
        (&[0xff, 0x74, 0, 2], "FF74"),
    ] {
        assert!(
            reason(JPEG_2000, &with(segment), layout).contains(name),
            "{name}"
        );
    }
    let cod = board
        .windows(2)
        .position(|two| two == [0xff, 0x52])
        .unwrap();
    let changed = |place: usize, value: u8| {
        let mut frame = board.clone();
        frame[place] = value;
        frame
    };
    assert!(reason(JPEG_2000, &changed(cod + 12, 0x40), layout).contains("High-Throughput"));
    assert!(reason(JPEG_2000, &changed(6, 0x40), layout).contains("Rsiz"));
    assert!(reason(JPEG_2000, &changed(43, 2), layout).contains("subsampled"));
    assert!(reason(JPEG_2000, &changed(cod + 7, 33), layout).contains("33 layers"));
    decoded(JPEG_2000, &changed(cod + 13, 1), layout).unwrap_err();
    for length in 0..board.len() - 2 {
        decoded(JPEG_2000, &board[..length], layout).unwrap_err();
    }
}

#[test]
fn code_blocks_and_layers_are_counted_before_decoding() {
    // 1024 x 1024 numbers in blocks of 4 x 4, 32 layers: 2 million parts in 120 bytes.
    let mut frame = bytes(UNSIGNED_BOARD);
    frame[8..16].copy_from_slice(&[0, 0, 4, 0, 0, 0, 4, 0]);
    frame[24..32].copy_from_slice(&[0, 0, 4, 0, 0, 0, 4, 0]);
    let cod = frame
        .windows(2)
        .position(|two| two == [0xff, 0x52])
        .unwrap();
    frame[cod + 7] = 32;
    frame[cod + 10..cod + 12].copy_from_slice(&[0, 0]);
    assert!(reason(JPEG_2000, &frame, square(1024)).contains("more than 262144 code blocks"));
    // The same in tiles of one number.
    let mut frame = bytes(UNSIGNED_BOARD);
    frame[24..32].copy_from_slice(&[0, 0, 0, 1, 0, 0, 0, 1]);
    let error = reason(JPEG_2000, &frame, square(32));
    assert!(error.contains("has 0 of 1 parts"), "{error}");
}

#[test]
fn the_lowest_stored_bits_of_a_lossless_number_count() {
    let layout = |bits, signed| FrameLayout {
        columns: 1,
        rows: 1,
        size: 2,
        bits,
        signed,
    };
    // The number that a reader of the stored bits finds.
    let read = |stored: (u32, bool), coded: (u32, bool), lossless, value| {
        let numbers = Numbers {
            values: vec![value],
            bits: coded.0,
            lossless,
        };
        let packed = layout(stored.0, stored.1).pack(&numbers).ok()?;
        let unused = 16 - stored.0;
        Some(if stored.1 {
            i32::from(i16::from_le_bytes([packed[0], packed[1]]) << unused >> unused)
        } else {
            i32::from(u16::from_le_bytes([packed[0], packed[1]]) << unused >> unused)
        })
    };
    let (u12, s12, u16, s16) = ((12, false), (12, true), (16, false), (16, true));
    for (stored, coded, value, lossless, lossy) in [
        (u12, u16, 4095, Some(4095), Some(4095)),
        // An overlay or anything else above the stored bits.
        (u12, u16, 0x8123, Some(0x123), None),
        (u12, u16, 0xf000, Some(0), None),
        (u12, s16, -0x7edd, Some(0x123), None),
        (s12, u16, 0x8fff, Some(-1), None),
        (s12, s16, -2049, Some(2047), None),
        (s12, s16, -2048, Some(-2048), Some(-2048)),
        // Signed, extended to the width of the code stream or not.
        (s12, u16, 0xf800, Some(-2048), Some(-2048)),
        (s12, u16, 0x0800, Some(-2048), Some(-2048)),
        (s12, s16, 0x0fff, Some(-1), Some(-1)),
        // As many bits as are stored, or fewer.
        (s12, u12, 0x0fff, Some(-1), Some(-1)),
        (u12, s12, -1, Some(4095), Some(4095)),
        (s16, u12, 4095, Some(4095), Some(4095)),
        (u16, u12, 4095, Some(4095), Some(4095)),
        (u16, s12, -1, None, None),
    ] {
        for (exact, expected) in [(true, lossless), (false, lossy)] {
            let found = read(stored, coded, exact, value);
            assert_eq!(found, expected, "{stored:?} {coded:?} {value} {exact}");
        }
    }
}

#[test]
fn decoding_stops_when_it_is_told_to() {
    // A lossless frame of 2^20 equal numbers: one bit each.
    let mut frame = vec![0xff, 0xd8, 0xff, 0xc4, 0, 20, 0, 1];
    frame.extend([0; 15]);
    frame.push(0);
    frame.extend([0xff, 0xc3, 0, 11, 16, 4, 0, 4, 0, 1, 1, 0x11, 0]);
    frame.extend([0xff, 0xda, 0, 8, 1, 1, 0, 1, 0, 0]);
    frame.extend([0; 1 << 17]);
    frame.extend([0xff, 0xd9]);
    let layout = square(1024);
    let (mut calls, mut most) = (0, usize::MAX);
    let mut run = |most: &mut usize| {
        calls = 0;
        decode(LOSSLESS_JPEG, &frame, layout, &mut || {
            calls += 1;
            calls <= *most
        })
        .map(|_| calls)
    };
    let all = run(&mut most).unwrap();
    assert!(all >= (1 << 20) / (2 * PIXELS_PER_REPORT), "{all} reports");
    most = 3;
    assert_eq!(run(&mut most), Err(FrameError::Stopped));
}
