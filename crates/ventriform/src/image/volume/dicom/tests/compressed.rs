//! Compressed pixels, written by other programs from one image that a formula gives.

use super::super::super::{ReadLimits, VolumeFile};
use super::*;

/// JPEG-LS, lossless, by CharLS 2.4.3.
const JPEG_LS: &str = "\
    ffd8ffe800205350494646000200000100000007000000090a1006010000012c0000012cffe8000800000001\
    ffd8fff7000b100007000901011100fff8000d01ffff0012004301140040ffda0008010100000000f127f4cf\
    2bf7a89fb342c34189a161b2825ba89d412dc13a735ef7da34e2f7515a6df54b4da310d6bd9b10d6bd910e5c\
    dcb653ad7ca651ad3c924ec63c4507b3f84a0765f01400ffd9";

/// JPEG-LS, at most 2 off, by CharLS 2.4.3.
const NEAR_LOSSLESS: &str = "\
    ffd8ffe800205350494646000200000100000007000000090a1006010000012c0000012cffe8000800000001\
    ffd8fff7000b100007000901011100fff8000d01ffff0018004d01220040ffda0008010100020000f3d785d0\
    afdb7b2aa7434aa9d96958874d36096ded2f8f9f5926f7dc549916da4e45ae8e8dd95ca577a3a97be4a97b78\
    5aff63ad7fe2ac2000ffd9";

/// JPEG 2000, reversible, by OpenJPEG 2.5.
const JPEG_2000: &str = "\
    ff4fff5100290000000000090000000700000000000000000000000900000007000000000000000000010b01\
    01ff52000c00000001000004040001ff5c00044060ff640025000143726561746564206279204f70656e4a50\
    45472076657273696f6e20322e352e34ff90000a00000000006a0001ff93dfe164111df62479fd1b32775125\
    b50b562195515f88f2d362bc588be51732ce2b6a0286c0c3712d678334be10852cbaaa2a9fde568f0e5df2c5\
    823a9c9ea09749ceff0cc6c571b21e92674e776eb56158ed6297956d67093f31582dffd9";

/// JPEG 2000 of the image less 2048, signed, by OpenJPEG 2.5.
const JPEG_2000_SIGNED: &str = "\
    ff4fff5100290000000000090000000700000000000000000000000900000007000000000000000000018f01\
    01ff52000c00000001000004040001ff5c00044080ff640025000143726561746564206279204f70656e4a50\
    45472076657273696f6e20322e352e34ff90000a00000000006b0001ff93c1fe1640111df62479fd1b327751\
    25b50b562195515f88f2d362bc588be51732ce2b6a0286c0c3712d678334be10852cbaaa2a9fde568f0e5df2\
    c5823a9c9ea09749ceff0cc6c571b21e92674e776eb56158ed6297956d67093f31582dffd9";

/// Lossless JPEG, first-order prediction, by liblj92.
const JPEG_LOSSLESS: &str = "\
    ffd8ffc4001b000101000203010000000000000000000008000706090a050cffc3000b0c0007000901001100\
    ffda0008010000060000f9ff00eaeca1ca6f32fcf0f62baacd08fc579891f54824e638cde9ccebcb8f656db7\
    1d2a745cf8a9cb6895b6a4895b6a4895b6754b30f5f4b30f5f4b30d1ea368798a368798a3680ffd9";

const FRAME_COLUMNS: usize = 9;
const FRAME_ROWS: usize = 7;

/// The image: 12 bits, with a flat part, edges and gradients.
fn image() -> Vec<f32> {
    let value = |x: usize, y: usize| {
        if x < 4 && y < 3 {
            0
        } else {
            (37 * x * x + 91 * y * (x % 3) + 13 * y * y) % 4096
        }
    };
    let pixels =
        (0..FRAME_COLUMNS * FRAME_ROWS).map(|n| value(n % FRAME_COLUMNS, n / FRAME_COLUMNS) as f32);
    pixels.collect()
}

fn bytes(hex: &str) -> Vec<u8> {
    let digits: Vec<u32> = hex.chars().map(|c| c.to_digit(16).unwrap()).collect();
    let (pairs, _) = digits.as_chunks::<2>();
    pairs.iter().map(|[a, b]| (16 * a + b) as u8).collect()
}

/// An item of encapsulated pixels.
fn item(content: &[u8]) -> Vec<u8> {
    let mut item = vec![0xfe, 0xff, 0x00, 0xe0];
    let padded = content.len().next_multiple_of(2);
    item.extend((padded as u32).to_le_bytes());
    item.extend(content);
    item.resize(8 + padded, 0);
    item
}

/// A file whose pixels are the items of `fragments`, the first of which is the offset table.
fn file(uid: &'static str, elements: &Elements, fragments: &[Vec<u8>]) -> Vec<u8> {
    let mut elements = elements.clone();
    elements.remove(&(0x7fe0, 0x10));
    let mut data_set = Encoding::Explicit.elements(&elements);
    data_set.extend([0xe0, 0x7f, 0x10, 0x00]);
    data_set.extend(b"OB\0\0\xff\xff\xff\xff");
    fragments.iter().for_each(|f| data_set.extend(item(f)));
    data_set.extend([0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]);
    with_meta(uid, data_set)
}

/// A data set of `frames` slices of the image's size.
fn layout(frames: usize, signed: bool) -> Elements {
    let mut elements = slices();
    let number: &'static str = ["0", "1", "2", "3"][frames];
    elements.extend([
        ((0x28, 0x08), ("IS", Text(number))),
        ((0x28, 0x10), ("US", Shorts(vec![FRAME_ROWS as u16]))),
        ((0x28, 0x11), ("US", Shorts(vec![FRAME_COLUMNS as u16]))),
        ((0x28, 0x103), ("US", Shorts(vec![signed.into()]))),
        ((0x54, 0x80), ("US", Shorts((1..=frames as u16).collect()))),
    ]);
    elements
}

/// The image packed after PS3.5 G, each byte plane in literal runs.
fn run_lengths() -> Vec<u8> {
    let mut segments = Vec::new();
    for shift in [8, 0] {
        let plane: Vec<u8> = image().iter().map(|v| (*v as u16 >> shift) as u8).collect();
        let mut packed = Vec::new();
        for run in plane.chunks(100) {
            packed.push(run.len() as u8 - 1);
            packed.extend(run);
        }
        segments.push(packed);
    }
    let mut frame = vec![0; 64];
    frame[0] = 2;
    frame[4] = 64;
    frame[8] = 64 + segments[0].len() as u8;
    frame.extend(segments.concat());
    frame
}

const RLE_UID: &str = "1.2.840.10008.1.2.5";
const JPEG_LOSSLESS_UID: &str = "1.2.840.10008.1.2.4.70";
const JPEG_LS_UID: &str = "1.2.840.10008.1.2.4.80";
const JPEG_LS_NEAR_UID: &str = "1.2.840.10008.1.2.4.81";
const JPEG_2000_UID: &str = "1.2.840.10008.1.2.4.90";

#[test]
fn every_codec_gives_the_image_of_the_encoder() {
    for (uid, packed) in [
        (RLE_UID, run_lengths()),
        (JPEG_LOSSLESS_UID, bytes(JPEG_LOSSLESS)),
        (JPEG_LS_UID, bytes(JPEG_LS)),
        (JPEG_2000_UID, bytes(JPEG_2000)),
    ] {
        let made = file(uid, &layout(1, false), &[vec![], packed]);
        let reading = read_frame(made, None).unwrap();
        assert_eq!(reading.volume.shape, [FRAME_COLUMNS, FRAME_ROWS, 1]);
        assert_eq!(reading.volume.voxels, image(), "{uid}");
    }
    let near = file(
        JPEG_LS_NEAR_UID,
        &layout(1, false),
        &[vec![], bytes(NEAR_LOSSLESS)],
    );
    let near = read_frame(near, None).unwrap().volume.voxels;
    assert_eq!(near[4..8], [590.0, 925.0, 1331.0, 1813.0]);
    assert!(near.iter().zip(image()).all(|(a, b)| (a - b).abs() <= 2.0));
    let signed = file(
        JPEG_2000_UID,
        &layout(1, true),
        &[vec![], bytes(JPEG_2000_SIGNED)],
    );
    let signed = read_frame(signed, None).unwrap().volume.voxels;
    assert!(signed.iter().zip(image()).all(|(a, b)| *a == b - 2048.0));
}

#[test]
fn frames_are_found_by_fragments_or_by_their_table() {
    let (ls, elements) = (bytes(JPEG_LS), layout(2, false));
    let halves = |f: &[u8]| [f[..60].to_vec(), f[60..].to_vec()];
    let [a, b] = halves(&ls);
    let mut table = 0_u32.to_le_bytes().to_vec();
    table.extend(((8 + 60 + 8 + (ls.len() - 60).next_multiple_of(2)) as u32).to_le_bytes());
    let apart = file(
        JPEG_LS_UID,
        &elements,
        &[table, a.clone(), b.clone(), a.clone(), b.clone()],
    );
    let whole = file(JPEG_LS_UID, &elements, &[vec![], ls.clone(), ls]);
    for made in [apart, whole] {
        let voxels = read_frame(made, None).unwrap().volume.voxels;
        assert_eq!(voxels, [image(), image()].concat());
    }
    let lost = file(
        JPEG_LS_UID,
        &elements,
        &[vec![], a.clone(), b.clone(), a, b],
    );
    assert_eq!(
        complaint(read_frame(lost, None)).0,
        "Pixel Data (7FE0,0010)"
    );
}

#[test]
fn damaged_frames_are_errors() {
    for (uid, packed) in [
        (RLE_UID, run_lengths()),
        (JPEG_LOSSLESS_UID, bytes(JPEG_LOSSLESS)),
        (JPEG_LS_UID, bytes(JPEG_LS)),
        (JPEG_2000_UID, bytes(JPEG_2000)),
    ] {
        let cut = packed[..packed.len() / 3].to_vec();
        let made = file(uid, &layout(1, false), &[vec![], cut]);
        let error = read_frame(made, None).unwrap_err();
        assert!(
            matches!(error, VolumeError::Corrupt { .. }),
            "{uid} {error}"
        );
        let mut wide = layout(1, false);
        wide.insert((0x28, 0x11), ("US", Shorts(vec![10_000])));
        wide.insert((0x28, 0x10), ("US", Shorts(vec![100])));
        let error = read_frame(file(uid, &wide, &[vec![], packed]), None).unwrap_err();
        assert!(
            matches!(error, VolumeError::Corrupt { .. }),
            "{uid} {error}"
        );
    }
    let mut vast = layout(1, false);
    vast.insert((0x28, 0x10), ("US", Shorts(vec![60_000])));
    let error = read_frame(file(RLE_UID, &vast, &[vec![], run_lengths()]), None).unwrap_err();
    assert!(matches!(error, VolumeError::Corrupt { .. }), "{error}");
    vast.insert((0x28, 0x11), ("US", Shorts(vec![60_000])));
    let error = read_frame(file(RLE_UID, &vast, &[vec![], run_lengths()]), None).unwrap_err();
    assert!(matches!(error, VolumeError::TooLarge { .. }), "{error}");
}

#[test]
fn deflated_data_sets_are_read_and_bounded() {
    let deflate = |bytes: &[u8]| {
        let packed = Vec::new();
        let mut packed = flate2::write::DeflateEncoder::new(packed, flate2::Compression::best());
        std::io::Write::write_all(&mut packed, bytes).unwrap();
        packed.finish().unwrap()
    };
    let uid = "1.2.840.10008.1.2.1.99";
    let plain = Encoding::Explicit.elements(&slices());
    let made = with_meta(uid, deflate(&plain));
    let ramp: Vec<f32> = (0..24).map(|n| n as f32).collect();
    assert_eq!(read_frame(made.clone(), None).unwrap().volume.voxels, ramp);
    let cut = made[..made.len() - 20].to_vec();
    assert!(read_frame(cut, None).is_err());
    // An attribute before the pixels of 16 MiB of zeros, packed into a few KiB.
    let mut bomb = vec![0x08, 0, 0x01, 0, b'U', b'N', 0, 0, 0, 0, 0, 1];
    bomb.resize(bomb.len() + (1 << 24), 0);
    bomb.extend(&plain);
    let bomb = with_meta(uid, deflate(&bomb));
    let limits = ReadLimits {
        unpacked_bytes: 1 << 20,
        ..ReadLimits::default()
    };
    let files = [VolumeFile::in_memory("bomb", bomb)];
    let error = inspect_volume(&files, &limits, &Monitor::silent()).unwrap_err();
    assert!(
        matches!(
            error,
            VolumeError::Corrupt { .. } | VolumeError::TooLarge { .. }
        ),
        "{error}"
    );
    // The header of a received object has a bound of its own, whatever else may be unpacked.
    let mut bomb = vec![0x08, 0, 0x01, 0, b'U', b'N', 0, 0];
    bomb.extend((65_u32 << 20).to_le_bytes());
    bomb.resize(bomb.len() + (65 << 20), 0);
    bomb.extend(&plain);
    let bomb = VolumeFile::in_memory("bomb", with_meta(uid, deflate(&bomb)));
    let read = super::super::read_header(&bomb, &ReadLimits::default(), &Monitor::silent());
    let error = read.unwrap_err();
    assert!(
        matches!(
            error,
            VolumeError::Corrupt { .. } | VolumeError::TooLarge { .. }
        ),
        "{error}"
    );
}

#[test]
fn what_is_not_decoded_is_named() {
    for (uid, name) in [
        ("1.2.840.10008.1.2.4.51", "JPEG Extended"),
        ("1.2.840.10008.1.2.4.201", "High-Throughput JPEG 2000"),
        ("1.2.3.4", "unknown transfer syntax"),
    ] {
        let bytes = with_meta(uid, Encoding::Explicit.elements(&slices()));
        let error = read_frame(bytes, None).unwrap_err();
        assert!(matches!(error, VolumeError::Unsupported { .. }), "{error}");
        assert!(error.to_string().contains(name), "{error}");
    }
    let whole = with_meta(RLE_UID, Encoding::Explicit.elements(&slices()));
    assert_eq!(complaint(read_frame(whole, None)).1, "in one piece");
    let pieces = file(
        Encoding::Explicit.uid(),
        &layout(1, false),
        &[vec![], vec![0; 8]],
    );
    assert_eq!(complaint(read_frame(pieces, None)).1, "in fragments");
}
