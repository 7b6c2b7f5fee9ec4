//! Small files that are costly to read, beside honest uploads.
//!
//! The program runs by itself, so that its processor time is its own: on a busy machine a test waits longer,
//! but no more is computed.

use crate::dicom::{JANE, element, file_in, nm};
use crate::helpers::Service;
use flate2::Compression;
use flate2::write::{DeflateEncoder, GzEncoder};
use std::io::Write;
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Columns and rows of a frame: the largest that are read.
const FRAME_SIDE: u16 = 1024;

/// Processor time that an honest upload may cost or wait for, seconds: two cores for two seconds, and the
/// upload itself in a build without optimisation.
const COST_BOUND_S: f64 = 6.0;

/// A Nuclear Medicine Image of `frames` frames, all `frame`, in that transfer syntax.
fn image(syntax: &str, bits: u16, frames: u16, frame: &[u8]) -> Vec<u8> {
    let short = |n: u16| n.to_le_bytes().to_vec();
    let text = |tag: (u16, u16), vr: &str, text: &str| element(tag.0, tag.1, vr, text.as_bytes());
    let place = [
        text((0x20, 0x32), "DS", "0\\0\\0"),
        text((0x20, 0x37), "DS", "1\\0\\0\\0\\1\\0"),
    ]
    .concat();
    let item = |content: &[u8]| {
        let mut item = vec![0xfe, 0xff, 0x00, 0xe0];
        item.extend((content.len().next_multiple_of(2) as u32).to_le_bytes());
        item.extend(content);
        item.resize(item.len().next_multiple_of(2), 0);
        item
    };
    let mut pixels = vec![
        0xe0, 0x7f, 0x10, 0, b'O', b'B', 0, 0, 0xff, 0xff, 0xff, 0xff,
    ];
    pixels.extend(item(&[]));
    for _ in 0..frames {
        pixels.extend(item(frame));
    }
    pixels.extend([0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]);
    let slices = (1..=frames).flat_map(u16::to_le_bytes);
    file_in(
        syntax,
        &[
            text(
                (0x08, 0x08),
                "CS",
                "ORIGINAL\\PRIMARY\\RECON TOMO\\EMISSION",
            ),
            text((0x08, 0x16), "UI", "1.2.840.10008.5.1.4.1.1.20"),
            text((0x08, 0x18), "UI", "1.2.3.4"),
            text((0x08, 0x60), "CS", "NM"),
            text((0x18, 0x50), "DS", "4"),
            text((0x18, 0x88), "DS", "4"),
            element(0x28, 0x02, "US", &short(1)),
            text((0x28, 0x08), "IS", &frames.to_string()),
            element(0x28, 0x09, "AT", &[0x54, 0, 0x80, 0]),
            element(0x28, 0x10, "US", &short(FRAME_SIDE)),
            element(0x28, 0x11, "US", &short(FRAME_SIDE)),
            text((0x28, 0x30), "DS", "4\\4"),
            element(0x28, 0x100, "US", &short(bits)),
            element(0x28, 0x101, "US", &short(bits)),
            element(0x28, 0x102, "US", &short(bits - 1)),
            element(0x28, 0x103, "US", &short(0)),
            element(0x54, 0x22, "SQ", &item(&place)),
            element(0x54, 0x80, "US", &slices.collect::<Vec<u8>>()),
            pixels,
        ],
    )
}

/// A lossless JPEG frame of equal numbers, one bit each.
fn lossless() -> Vec<u8> {
    let mut frame = vec![0xff, 0xd8, 0xff, 0xc4, 0, 20, 0, 1];
    frame.extend([0; 16]);
    frame.extend([0xff, 0xc3, 0, 11, 16, 4, 0, 4, 0, 1, 1, 0x11, 0]);
    frame.extend([0xff, 0xda, 0, 8, 1, 1, 0, 1, 0, 0]);
    frame.extend([0; 1 << 17]);
    frame.extend([0xff, 0xd9]);
    frame
}

/// A progressive JPEG frame that repeats an empty scan.
fn progressive() -> Vec<u8> {
    let mut frame = vec![0xff, 0xd8, 0xff, 0xdb, 0, 67, 0];
    frame.extend([1; 64]);
    frame.extend([0xff, 0xc2, 0, 11, 8, 4, 0, 4, 0, 1, 1, 0x11, 0]);
    frame.extend([0xff, 0xc4, 0, 20, 0x10, 1]);
    frame.extend([0; 16]);
    for _ in 0..20_000 {
        frame.extend([0xff, 0xda, 0, 8, 1, 1, 0, 1, 63, 0x10, 0, 0]);
    }
    frame.extend([0xff, 0xd9]);
    frame
}

/// A frame of runs of one byte, in RLE.
fn run_lengths() -> Vec<u8> {
    let mut frame = vec![0; 64];
    frame[0] = 2;
    frame[4] = 64;
    let plane = [0x81_u8, 0].repeat((1 << 20) / 128);
    frame[8..12].copy_from_slice(&(64 + plane.len() as u32).to_le_bytes());
    frame.extend(&plane);
    frame.extend(&plane);
    frame
}

/// A JPEG-LS frame of zeros: each line is a run.
fn jpeg_ls() -> Vec<u8> {
    let mut frame = vec![0xff, 0xd8, 0xff, 0xf7, 0, 11, 16, 4, 0, 4, 0, 1, 1, 0x11, 0];
    frame.extend([0xff, 0xda, 0, 8, 1, 1, 0, 0, 0, 0]);
    // Ones: whole runs. After 0xFF a byte has seven bits.
    frame.extend([0xff_u8, 0x7f].repeat(20_000));
    frame.extend([0xff, 0xd9]);
    frame
}

/// The bits of a packet header: a byte after 0xFF has seven.
fn stuffed(bits: &str) -> Vec<u8> {
    let mut bytes: Vec<u8> = Vec::new();
    let mut left = bits;
    while !left.is_empty() {
        let width = if bytes.last() == Some(&0xff) { 7 } else { 8 };
        let (next, rest) = left.split_at(width.min(left.len()));
        bytes.push(u8::from_str_radix(&format!("{next:0<width$}"), 2).unwrap());
        left = rest;
    }
    bytes
}

/// A JPEG 2000 frame whose code blocks have as many coding passes as there can be, without any data.
fn jpeg_2000() -> Vec<u8> {
    let mut frame = vec![0xff, 0x4f, 0xff, 0x51, 0, 41, 0, 0];
    let side = u32::from(FRAME_SIDE);
    for n in [side, side, 0, 0, side, side, 0, 0] {
        frame.extend(n.to_be_bytes());
    }
    frame.extend([0, 1, 15, 1, 1]);
    // No levels, blocks of 64 x 64, reversible; 31 bit-planes.
    frame.extend([0xff, 0x52, 0, 12, 0, 0, 0, 1, 0, 0, 4, 4, 0, 1]);
    frame.extend([0xff, 0x5c, 0, 4, 0x20, 31 << 3]);
    // One packet: every block is included, has no empty bit-plane, and 91 passes of no bytes.
    let mut bits = String::from("1");
    let blocks = u32::from(FRAME_SIDE) / 64;
    for y in 0..blocks {
        for x in 0..blocks {
            // A node of a tag tree is met for the first time at its first leaf.
            let first = |level: &u32| (x | y).is_multiple_of(1 << level);
            let new = (0..=blocks.ilog2()).filter(first).count();
            bits.push_str(&"1".repeat(2 * new));
            bits.push_str(&format!("111111111{:07b}0{}", 91 - 37, "0".repeat(3 + 6)));
        }
    }
    let packet = stuffed(&bits);
    let [a, b, c, d] = (14 + packet.len() as u32).to_be_bytes();
    frame.extend([0xff, 0x90, 0, 10, 0, 0, a, b, c, d, 0, 1, 0xff, 0x93]);
    frame.extend(packet);
    frame.extend([0xff, 0xd9]);
    frame
}

/// A NIfTI file of 512 MiB of zeros, gzipped.
fn gzip() -> Vec<u8> {
    let mut header = vec![0_u8; 352];
    header[0] = 92;
    header[1] = 1;
    for (n, value) in [3_u16, 512, 512, 1024, 1, 1, 1, 1].into_iter().enumerate() {
        header[40 + 2 * n..42 + 2 * n].copy_from_slice(&value.to_le_bytes());
    }
    header[70] = 4;
    header[72] = 16;
    for n in 1..4 {
        header[76 + 4 * n..80 + 4 * n].copy_from_slice(&4_f32.to_le_bytes());
    }
    header[108..112].copy_from_slice(&352_f32.to_le_bytes());
    header[252] = 1;
    header[344..348].copy_from_slice(b"n+1\0");
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(&header).unwrap();
    zeros(&mut packed);
    packed.finish().unwrap()
}

/// A deflated data set with 512 MiB of zeros before its first known element.
fn deflated() -> Vec<u8> {
    let mut packed = DeflateEncoder::new(Vec::new(), Compression::fast());
    packed
        .write_all(&[0x08, 0, 0x01, 0, b'U', b'N', 0, 0, 0, 0, 0, 0x20])
        .unwrap();
    zeros(&mut packed);
    let packed = packed.finish().unwrap();
    file_in("1.2.840.10008.1.2.1.99", &[packed])
}

fn zeros(to: &mut impl Write) {
    let zeros = vec![0; 1 << 20];
    for _ in 0..512 {
        to.write_all(&zeros).unwrap();
    }
}

/// Every kind of bomb.
fn bombs() -> Vec<(&'static str, Vec<u8>)> {
    let frames = 60;
    vec![
        (
            "progressive JPEG",
            image("1.2.840.10008.1.2.4.50", 8, 1, &progressive()),
        ),
        (
            "lossless JPEG",
            image("1.2.840.10008.1.2.4.70", 16, frames, &lossless()),
        ),
        (
            "JPEG-LS",
            image("1.2.840.10008.1.2.4.80", 16, frames, &jpeg_ls()),
        ),
        (
            "JPEG 2000",
            image("1.2.840.10008.1.2.4.90", 16, frames, &jpeg_2000()),
        ),
        (
            "RLE",
            image("1.2.840.10008.1.2.5", 16, frames, &run_lengths()),
        ),
        ("gzip", gzip()),
        ("deflated", deflated()),
    ]
}

/// Sends an upload without waiting for its answer.
fn send(service: &Service, body: &[u8]) -> TcpStream {
    let address = service.url.strip_prefix("http://").unwrap();
    let mut stream = TcpStream::connect(address).unwrap();
    let head = format!(
        "POST /v1/volumes HTTP/1.1\r\nhost: {address}\r\ncontent-length: {}\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes()).unwrap();
    stream.write_all(body).unwrap();
    stream
}

/// A scan that was not sent before.
fn honest(n: usize) -> Vec<u8> {
    let mut scan = nm(&JANE, 1);
    let last = scan.len() - 2;
    scan[last..].copy_from_slice(&(n as u16 + 1).to_le_bytes());
    scan
}

#[tokio::test(flavor = "multi_thread")]
async fn bombs_whose_clients_hang_up_keep_no_upload_waiting() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    for (n, (kind, bomb)) in bombs().into_iter().enumerate() {
        let held: Vec<TcpStream> = (0..3).map(|_| send(&service, &bomb)).collect();
        tokio::time::sleep(Duration::from_millis(300)).await;
        drop(held);
        let before = service.processor_seconds();
        let answer = service
            .post("/v1/volumes")
            .body(honest(n))
            .send()
            .await
            .unwrap();
        assert_eq!(answer.status(), 201, "{kind}");
        let cost = service.processor_seconds() - before;
        assert!(
            cost < COST_BOUND_S,
            "{kind}: {cost} s of processor time until the answer"
        );
        // What is left of the bombs ends by itself.
        let begun = Instant::now();
        loop {
            let before = service.processor_seconds();
            tokio::time::sleep(Duration::from_millis(500)).await;
            if service.processor_seconds() - before < 0.1 {
                break;
            }
            assert!(begun.elapsed() < Duration::from_secs(60), "{kind} goes on");
        }
        let cost = service.processor_seconds() - before;
        assert!(
            cost < 2.0 * COST_BOUND_S,
            "{kind}: {cost} s of processor time in all"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn bombs_whose_clients_wait_are_ended_and_keep_no_upload_waiting() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &["--decoding-time", "3s"]).await;
    for (n, (kind, bomb)) in bombs().into_iter().enumerate() {
        let started = service.processor_seconds();
        let mut held = Vec::new();
        for _ in 0..3 {
            let answer = service.post("/v1/volumes").body(bomb.clone()).send();
            held.push(tokio::spawn(answer));
        }
        tokio::time::sleep(Duration::from_millis(300)).await;
        let before = service.processor_seconds();
        let answer = service
            .post("/v1/volumes")
            .body(honest(n))
            .send()
            .await
            .unwrap();
        assert_eq!(answer.status(), 201, "{kind}");
        let cost = service.processor_seconds() - before;
        assert!(
            cost < COST_BOUND_S,
            "{kind}: {cost} s of processor time until the answer"
        );
        for answer in held {
            let status = answer.await.unwrap().unwrap().status().as_u16();
            assert!(
                [200, 201, 422, 413, 503].contains(&status),
                "{kind}: {status}"
            );
        }
        // Each has its time, and a second for every mebibyte.
        let most = 3.0 * (3.0 + bomb.len() as f64 / f64::from(1 << 20)) + 2.0 * COST_BOUND_S;
        let cost = service.processor_seconds() - started;
        assert!(
            cost < most,
            "{kind}: {cost} s of processor time in all, of {most}"
        );
    }
    // A file that costs more than its size warrants is told so.
    let bomb = image("1.2.840.10008.1.2.4.90", 16, 200, &jpeg_2000());
    let answer = service.post("/v1/volumes").body(bomb).send().await.unwrap();
    assert_eq!(answer.status(), 422);
    let problem: serde_json::Value = answer.json().await.unwrap();
    assert_eq!(
        problem["type"], "urn:ventriform:problem:decoding-time",
        "{problem}"
    );
}
