"""Compares the codecs of compressed DICOM with other decoders. See dicom_codecs.sh.

A case is a file with one image in frames, and what its voxels must be: exactly the image, exactly what another
decoder gives, that within a tolerance, or a refusal whose message matches a pattern. Every lossless encoding is also
decoded by another program, so that a fault of the encoder is told from one of ours.
"""

import io
import pathlib
import re
import struct
import subprocess
import sys
import zlib

import gdcm
import imagecodecs
import numpy as np
from openjpeg.utils import encode_array
from PIL import Image
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.encaps import encapsulate
from pydicom.sequence import Sequence
from pydicom.uid import ExplicitVRLittleEndian

RLE = "1.2.840.10008.1.2.5"
BASELINE = "1.2.840.10008.1.2.4.50"
LOSSLESS = "1.2.840.10008.1.2.4.57"
LOSSLESS_SV1 = "1.2.840.10008.1.2.4.70"
LS = "1.2.840.10008.1.2.4.80"
LS_NEAR = "1.2.840.10008.1.2.4.81"
J2K_REVERSIBLE = "1.2.840.10008.1.2.4.90"
J2K = "1.2.840.10008.1.2.4.91"
DEFLATED = "1.2.840.10008.1.2.1.99"

program, folder = sys.argv[1], pathlib.Path(sys.argv[2])
random = np.random.default_rng(7)
cases = []


# --- images ------------------------------------------------------------------------------------------------------


def dtype(bits, signed):
    width = 8 if bits <= 8 else 16 if bits <= 16 else 32
    return np.dtype(f"{'int' if signed else 'uint'}{width}")


def images(rows, columns, bits, signed=False):
    """Images of full range: noise, a smooth object on a dark ground, a flat one, a chessboard of the extremes."""
    low = -(1 << (bits - 1)) if signed else 0
    high = low + (1 << bits) - 1
    y, x = np.mgrid[:rows, :columns]
    bump = np.exp(-(((y - rows / 2) / (rows / 5 + 1)) ** 2 + ((x - columns / 3) / (columns / 5 + 1)) ** 2))
    smooth = low + bump * (high - low) * 0.9
    smooth = smooth + random.poisson(5, (rows, columns)) * (bump > 0.05)
    board = np.where((x // 3 + y // 2) % 2 == 0, low, high)
    given = {
        "noise": random.integers(low, high + 1, (rows, columns)),
        "object": np.clip(smooth, low, high),
        "flat": np.full((rows, columns), high),
        "board": board,
    }
    return {name: np.rint(image).astype(dtype(bits, signed)) for name, image in given.items()}


def dataset(image, frames, bits, signed, photometric="MONOCHROME2"):
    d = Dataset()
    d.SOPClassUID, d.SOPInstanceUID = "1.2.840.10008.5.1.4.1.1.20", "1.2.3.4"
    d.StudyInstanceUID, d.SeriesInstanceUID, d.FrameOfReferenceUID = "1.2.3", "1.2.4", "1.2.5"
    d.Modality, d.ImageType = "NM", ["ORIGINAL", "PRIMARY", "RECON TOMO", "EMISSION"]
    d.SamplesPerPixel, d.PhotometricInterpretation = 1, photometric
    d.Rows, d.Columns = image.shape
    d.NumberOfFrames = d.NumberOfSlices = frames
    d.FrameIncrementPointer, d.SliceVector = 0x00540080, list(range(1, frames + 1))
    d.PixelSpacing, d.SliceThickness, d.SpacingBetweenSlices = ["4", "4"], "4", "4"
    d.BitsAllocated = 8 * image.dtype.itemsize
    d.BitsStored, d.HighBit, d.PixelRepresentation = bits, bits - 1, int(signed)
    place = Dataset()
    place.ImageOrientationPatient, place.ImagePositionPatient = ["1", "0", "0", "0", "1", "0"], ["0", "0", "0"]
    d.DetectorInformationSequence = Sequence([place])
    return d


def write(d, path, uid):
    d.file_meta = FileMetaDataset()
    d.file_meta.TransferSyntaxUID, d.file_meta.MediaStorageSOPClassUID = uid, d.SOPClassUID
    d.file_meta.MediaStorageSOPInstanceUID = d.SOPInstanceUID
    d.save_as(path, enforce_file_format=True)


def case(name, uid, streams, layout, expected=None, tolerance=0, refused=None):
    """Adds a file whose frames are `streams`; `layout` is (image, bits, signed[, photometric])."""
    image, bits, signed, *rest = layout
    d = dataset(image, len(streams), bits, signed, *rest)
    d.PixelData = encapsulate([bytes(s) for s in streams])
    d["PixelData"].VR, d["PixelData"].is_undefined_length = "OB", True
    path = folder / f"{len(cases):04}.dcm"
    write(d, path, uid)
    cases.append((name, path, expected, tolerance, refused))
    return path


def by_gdcm(path, shape, kind):
    """The numbers that GDCM reads."""
    reader = gdcm.ImageReader()
    reader.SetFileName(str(path))
    if not reader.Read():
        raise AssertionError(f"GDCM cannot read {path}")
    buffer = reader.GetImage().GetBuffer()
    return np.frombuffer(buffer.encode("utf-8", errors="surrogateescape"), kind).reshape(shape)


# --- encoders ----------------------------------------------------------------------------------------------------


def jpeg_lossless(image, bits, predictor=1, restart_rows=0, point=0):
    """ISO 10918-1, process 14, one component, the difference categories in codes of 4 and 5 bits."""
    rows, columns = image.shape
    lengths = [4] * 14 + [5] * 3
    codes, code = [], 0
    for n, length in enumerate(lengths):
        code <<= length - lengths[max(n - 1, 0)]
        codes.append((code, length))
        code += 1
    out = bytearray(b"\xff\xd8")
    if restart_rows:
        out += b"\xff\xdd\x00\x04" + struct.pack(">H", restart_rows * columns)
    out += b"\xff\xc3" + struct.pack(">HBHHBBBB", 11, bits, rows, columns, 1, 1, 0x11, 0)
    out += b"\xff\xc4" + struct.pack(">HB", 36, 0) + bytes([0, 0, 0, 14, 3] + [0] * 11) + bytes(range(17))
    out += b"\xff\xda" + struct.pack(">HBBBBBB", 8, 1, 1, 0, predictor, 0, point)
    x = image.astype(int) >> point
    texts = []

    def flush():
        text = "".join(texts)
        texts.clear()
        text += "1" * (-len(text) % 8)
        packed = int(text or "0", 2).to_bytes(len(text) // 8, "big")
        out.extend(packed.replace(b"\xff", b"\xff\x00"))

    for r in range(rows):
        fresh = r == 0 or (restart_rows and r % restart_rows == 0)
        if r and fresh:
            flush()
            out.extend([0xFF, 0xD0 + (r // restart_rows - 1) % 8])
        for c in range(columns):
            if c == 0:
                p = 1 << (bits - point - 1) if fresh else x[r - 1, 0]
            elif fresh:
                p = x[r, c - 1]
            else:
                a, b, d = int(x[r, c - 1]), int(x[r - 1, c]), int(x[r - 1, c - 1])
                p = [0, a, b, d, a + b - d, a + ((b - d) >> 1), b + ((a - d) >> 1), (a + b) >> 1][predictor]
            e = (int(x[r, c]) - int(p)) & 0xFFFF
            e -= 65536 if e > 32768 else 0
            size = 16 if e == 32768 else abs(e).bit_length()
            code, length = codes[size]
            texts.append(f"{code:0{length}b}")
            if 0 < size < 16:
                texts.append(f"{e if e > 0 else e + (1 << size) - 1:0{size}b}")
    flush()
    return bytes(out) + b"\xff\xd9"


def pillow(image, kind, **options):
    file = io.BytesIO()
    Image.fromarray(image).save(file, kind, **options)
    return file.getvalue()


def j2k(image, **options):
    """By OpenJPEG in Pillow: tiles, offsets, layers, code blocks, precincts, progressions."""
    return pillow(image, "JPEG2000", no_jp2=True, **options)


def jpegls(image, near=0):
    """By CharLS, which asks for room beyond the image's size for small noise."""
    return bytes(imagecodecs.jpegls_encode(image, level=near, out=4 * image.nbytes + 4096))


def segment(marker, content):
    return struct.pack(">HH", marker, len(content) + 2) + content


# --- the cases ---------------------------------------------------------------------------------------------------

SIZES = [(1, 1), (1, 17), (19, 1), (7, 9), (33, 50), (64, 64)]


def run_lengths():
    for bits, signed in [(8, False), (8, True), (12, False), (16, False), (16, True), (32, False), (32, True)]:
        for size in SIZES:
            for name, image in images(*size, bits, signed).items():
                case(f"RLE {size} {bits} {signed} {name}", RLE, [rle(image)], (image, bits, signed), image)


def rle(image):
    """PS3.5 annex G: the bytes of each row by themselves, the most significant first."""
    size = image.dtype.itemsize
    planes = image.astype(image.dtype.newbyteorder(">")).view(np.uint8).reshape(*image.shape, size)
    segments = []
    for n in range(size):
        packed = b"".join(imagecodecs.packbits_encode(row.tobytes()) for row in planes[:, :, n])
        segments.append(packed + b"\0" * (len(packed) % 2))
    offsets = np.cumsum([64] + [len(s) for s in segments[:-1]])
    return struct.pack("<16I", size, *[int(o) for o in offsets], *[0] * (15 - size)) + b"".join(segments)


def lossless():
    for predictor in range(1, 8):
        for bits, signed in [(8, False), (12, False), (16, False)]:
            for restart in (0, 1, 3):
                size = SIZES[(predictor + restart + bits) % len(SIZES)]
                for name, image in images(*size, bits, signed).items():
                    stream = jpeg_lossless(image, bits, predictor, restart)
                    uid = LOSSLESS_SV1 if predictor == 1 else LOSSLESS
                    label = f"JPEG lossless {size} {bits} bits, predictor {predictor}, restart {restart}, {name}"
                    path = case(label, uid, [stream, stream], (image, bits, signed), np.stack([image] * 2))
                    if predictor == 1 and name == "noise":
                        same = by_gdcm(path, (2, *image.shape), image.dtype)
                        assert (same == image).all(), f"the encoder is wrong: {label}"
        image = images(40, 31, 16)["object"]
        for point in (1, 5):
            stream = jpeg_lossless(image, 16, predictor, 2, point)
            case(
                f"JPEG lossless, point transform {point}, predictor {predictor}",
                LOSSLESS,
                [stream],
                (image, 16, False),
                image >> point << point,
            )
    for bits in range(2, 17):
        image = images(12, 21, bits)["noise"]
        case(f"JPEG lossless of {bits} bits", LOSSLESS, [jpeg_lossless(image, bits, 4, 2)], (image, bits, False), image)
    # libjpeg-turbo's encoder.
    for predictor in range(1, 8):
        for bits in (8, 16):
            image = images(37, 53, bits)["object"]
            stream = imagecodecs.jpeg_encode(image, lossless=True, predictor=predictor, bitspersample=bits)
            case(
                f"JPEG lossless by libjpeg-turbo, predictor {predictor}",
                LOSSLESS,
                [stream],
                (image, bits, False),
                image,
            )
    # Signed numbers as the bits of unsigned ones: of the stored width, and extended to 16.
    for bits in (12, 16):
        image = images(20, 20, bits, True)["noise"]
        for width in (bits, 16):
            raw = (image.astype(int) & ((1 << width) - 1)).astype(np.uint16)
            case(
                f"signed JPEG lossless, {bits} bits stored, {width} coded",
                LOSSLESS,
                [jpeg_lossless(raw, width, 1)],
                (image, bits, True),
                image,
            )
    image = images(20, 20, 12)["object"]
    case("JPEG lossless of 12 bits in 16 stored", LOSSLESS, [jpeg_lossless(image, 12, 1)], (image, 16, False), image)
    # The bits above Bits Stored are an overlay, or nothing, as in native data.
    wide = images(20, 20, 16)["noise"]
    case(
        "JPEG lossless of 16 bits in 12 stored", LOSSLESS, [jpeg_lossless(wide, 16, 1)], (wide, 12, False), wide & 0xFFF
    )
    stream = jpeg_lossless(image, 12, 1)
    for name, changed in {
        "predictor 8": stream.replace(b"\xff\xda\x00\x08\x01\x01\x00\x01", b"\xff\xda\x00\x08\x01\x01\x00\x08"),
        "a restart within a row": stream.replace(b"\xff\xc3", b"\xff\xdd\x00\x04\x00\x07\xff\xc3"),
        "restarts that are not there": stream.replace(b"\xff\xc3", b"\xff\xdd\x00\x04\x00\x14\xff\xc3"),
        "a second scan": stream[:-2] + stream[stream.index(b"\xff\xda") :],
        "a cut": stream[: len(stream) // 2] + b"\xff\xd9",
    }.items():
        case(f"JPEG lossless with {name}", LOSSLESS, [changed], (image, 12, False), refused="JPEG|restart|marker")
    restarts = jpeg_lossless(image, 12, 1, 2)
    case(
        "JPEG lossless with restarts out of order",
        LOSSLESS,
        [restarts.replace(b"\xff\xd1", b"\xff\xd3")],
        (image, 12, False),
        refused="restart FF D1",
    )


def baseline():
    for size in SIZES:
        for name, image in images(*size, 8).items():
            for quality in (30, 75, 100):
                for options in ({}, {"restart_marker_blocks": 1}, {"restart_marker_rows": 1}, {"optimize": True}):
                    stream = pillow(image, "JPEG", quality=quality, **options)
                    same = np.asarray(Image.open(io.BytesIO(stream)))
                    label = f"JPEG baseline {size} {name} quality {quality} {options}"
                    path = case(label, BASELINE, [stream], (image, 8, False), same)
                    if quality == 75 and not options:
                        assert (by_gdcm(path, image.shape, np.uint8) == same).all(), f"decoders differ: {label}"
    image = images(40, 40, 8)["object"]
    stream = pillow(image, "JPEG", quality=75)
    inverse = np.asarray(Image.open(io.BytesIO(stream)))
    case("JPEG baseline, MONOCHROME1", BASELINE, [stream], (image, 8, False, "MONOCHROME1"), inverse)
    padded = stream[:-2] + b"\xff\xd9\0\0"
    case("JPEG baseline, padded", BASELINE, [padded], (image, 8, False), inverse)
    progressive = pillow(image, "JPEG", quality=75, progressive=True)
    case("progressive JPEG", BASELINE, [progressive], (image, 8, False), refused="progressive JPEG")
    extended = stream.replace(b"\xff\xc0", b"\xff\xc1", 1)
    case("extended JPEG", BASELINE, [extended], (image, 8, False), refused="extended sequential JPEG")
    arithmetic = stream.replace(b"\xff\xc0", b"\xff\xc9", 1)
    case("arithmetic JPEG", BASELINE, [arithmetic], (image, 8, False), refused="arithmetic JPEG")
    cut = stream[: -len(stream) // 3] + b"\xff\xd9"
    case("JPEG baseline, cut", BASELINE, [cut], (image, 8, False), refused="cut off|baseline JPEG does not allow")
    scan = stream[stream.index(b"\xff\xda") : -2]
    case(
        "JPEG baseline, two scans",
        BASELINE,
        [stream[:-2] + scan + b"\xff\xd9"],
        (image, 8, False),
        refused="follows the scan",
    )
    colour = pillow(np.stack([image] * 3, -1), "JPEG", quality=75)
    case("JPEG baseline in colour", BASELINE, [colour], (image, 8, False), refused="3 component")


def jpeg_ls():
    for bits, signed in [(8, False), (10, False), (12, False), (16, False)]:
        for size in SIZES[1:] + [(130, 257)]:
            for name, image in images(*size, bits, signed).items():
                for near in (0, 1, 3, 10):
                    stream = jpegls(image, near)
                    same = imagecodecs.jpegls_decode(stream)
                    if near == 0:
                        assert (same == image).all()
                        case(f"JPEG-LS {size} {bits} bits {name}", LS, [stream], (image, bits, signed), image)
                    else:
                        high = bits if near == 0 else image.dtype.itemsize * 8
                        case(
                            f"JPEG-LS {size} {bits} bits {name} near {near}",
                            LS_NEAR,
                            [stream],
                            (image, high, signed),
                            same,
                        )
    image = images(30, 30, 8)["object"]
    near = jpegls(image, 2)
    case("near-lossless JPEG-LS as lossless", LS, [near], (image, 8, False), refused="lossless only")
    stream = jpegls(image)
    case("JPEG-LS, cut", LS, [stream[: len(stream) // 2]], (image, 8, False), refused="JPEG-LS")
    restart = stream.replace(b"\xff\xda", segment(0xFFDD, b"\0\4") + b"\xff\xda", 1)
    case("JPEG-LS with restarts", LS, [restart], (image, 8, False), refused="restart")


def irreversible_tolerance(bits):
    """How far two decoders may be apart: both compute in 32-bit floats, through up to six levels of filters."""
    return max(1, 2 ** (bits - 14))


def jpeg_2000():
    options = [{}]
    options += [{"tile_size": t} for t in ((16, 16), (25, 13), (64, 64))]
    options += [
        {"tile_size": (20, 20), "offset": (5, 3), "tile_offset": (2, 1)},
        {"offset": (3, 7), "tile_offset": (0, 0)},
    ]
    options += [
        {"progression": p, "num_resolutions": 4, "tile_size": (32, 32)}
        for p in ("LRCP", "RLCP", "RPCL", "PCRL", "CPRL")
    ]
    options += [
        {"progression": p, "precinct_size": (32, 32), "codeblock_size": (16, 16)} for p in ("LRCP", "RPCL", "PCRL")
    ]
    options += [{"num_resolutions": n} for n in (1, 2, 8)]
    options += [{"codeblock_size": c} for c in ((4, 4), (64, 16), (8, 64))]
    options += [{"plt": True, "comment": "plt"}]
    for bits, signed in [(8, False), (16, False)]:
        for size in [(7, 9), (33, 50), (64, 64), (100, 77)]:
            for name, image in images(*size, bits, signed).items():
                for n, option in enumerate(options):
                    if size != (64, 64) and (n + size[0]) % 3:
                        continue
                    try:
                        stream = j2k(image, **option)
                    except (OSError, ValueError):
                        continue  # OpenJPEG writes no such image.
                    label = f"JPEG 2000 {size} {bits} bits {name} {option}"
                    # Pillow 13.0 puts pixels of 16 bits into wrong tiles: what OpenJPEG reads of its stream counts.
                    same = imagecodecs.jpeg2k_decode(stream) if bits == 16 and "tile_size" in option else image
                    case(label, J2K_REVERSIBLE, [stream], (image, bits, signed), same)
    # Layers: all of them, and irreversible at rates at which edges overshoot.
    for bits in (8, 16):
        for name, image in images(64, 50, bits).items():
            for option in (
                {"quality_layers": [20, 10, 1]},
                {"quality_layers": [40, 20, 10, 5, 2, 1], "progression": "RPCL"},
            ):
                stream = j2k(image, quality_mode="rates", **option)
                case(f"JPEG 2000 {bits} bits {name} {option}", J2K_REVERSIBLE, [stream], (image, bits, False), image)
            for rate in (2, 4, 10, 30):
                for option in ({}, {"tile_size": (32, 32)}, {"progression": "PCRL"}):
                    for irreversible in (True, False):
                        stream = j2k(
                            image, quality_mode="rates", quality_layers=[rate], irreversible=irreversible, **option
                        )
                        same = imagecodecs.jpeg2k_decode(stream)
                        case(
                            f"JPEG 2000 {bits} bits {name} rate {rate} {option} {irreversible}",
                            J2K,
                            [stream],
                            (image, bits, False),
                            same,
                            irreversible_tolerance(bits),
                        )
    # 12 bits and signed numbers, by another binding of OpenJPEG.
    for bits, signed in [(8, True), (10, False), (12, False), (12, True), (16, True)]:
        for name, image in images(48, 61, bits, signed).items():
            exact = encode_array(image, bits_stored=bits, photometric_interpretation=2)
            case(f"JPEG 2000 {bits} bits {signed} {name}", J2K_REVERSIBLE, [exact], (image, bits, signed), image)
            for ratio in (2, 4, 10):
                stream = encode_array(image, bits_stored=bits, photometric_interpretation=2, compression_ratios=[ratio])
                same = imagecodecs.jpeg2k_decode(stream)
                case(
                    f"JPEG 2000 {bits} bits {signed} {name} ratio {ratio}",
                    J2K,
                    [stream],
                    (image, bits, signed),
                    same,
                    irreversible_tolerance(bits),
                )
    image = images(40, 40, 16)["noise"].astype(np.uint32) << 4
    stream = imagecodecs.jpeg2k_encode(image, reversible=True, level=0, bitspersample=20, codecformat="j2k")
    case("JPEG 2000 of 20 bits", J2K_REVERSIBLE, [stream], (image, 20, False), image)
    stream = imagecodecs.jpeg2k_encode(image, reversible=True, level=0, bitspersample=24, codecformat="j2k")
    case("JPEG 2000 of 24 bits", J2K_REVERSIBLE, [stream], (image, 24, False), refused="24 bits")
    image = images(40, 40, 8)["object"]
    wrapped = pillow(image, "JPEG2000")
    case("JPEG 2000 in a JP2 file", J2K_REVERSIBLE, [wrapped], (image, 8, False), image)
    stream = j2k(image)
    lossy = j2k(image, irreversible=True)
    case("irreversible JPEG 2000 as reversible", J2K_REVERSIBLE, [lossy], (image, 8, False), refused="irreversible")
    sot = stream.index(b"\xff\x90")
    for name, changed, pattern in [
        ("a region of interest", stream[:sot] + segment(0xFF5E, b"\0\0\5") + stream[sot:], "RGN"),
        ("a change of progression", stream[:sot] + segment(0xFF5F, b"\0\0\0\1\6\1\0") + stream[sot:], "POC"),
        ("capabilities", stream[:sot] + segment(0xFF50, b"\0\2\0\0\0\0") + stream[sot:], "CAP"),
        ("a cut", stream[: len(stream) // 2], "cut off"),
        (
            "33 layers",
            stream.replace(b"\xff\x52\x00\x0c\x00\x00\x00\x01", b"\xff\x52\x00\x0c\x00\x00\x00\x21"),
            "33 layers",
        ),
        ("subsampling", stream[:43] + b"\2\2" + stream[45:], "subsampled"),
    ]:
        case(f"JPEG 2000 with {name}", J2K, [changed], (image, 8, False), refused=pattern)
    tiled = j2k(image, tile_size=(16, 16))
    first = tiled.index(b"\xff\x90")
    length = struct.unpack_from(">I", tiled, first + 6)[0]
    case(
        "JPEG 2000 without its first tile",
        J2K,
        [tiled[:first] + tiled[first + length :]],
        (image, 8, False),
        refused="tile 0",
    )
    open_end = bytearray(stream)
    struct.pack_into(">I", open_end, sot + 6, 0)
    case("JPEG 2000 whose last tile-part states no length", J2K_REVERSIBLE, [bytes(open_end)], (image, 8, False), image)


def another_codec():
    """Each code stream under the transfer syntaxes of the others."""
    image = images(20, 24, 8)["object"]
    streams = {
        RLE: rle(image),
        BASELINE: pillow(image, "JPEG", quality=90),
        LOSSLESS_SV1: jpeg_lossless(image, 8),
        LS: jpegls(image),
        J2K_REVERSIBLE: j2k(image),
    }
    same = {LOSSLESS_SV1: (LOSSLESS,), LS: (LS_NEAR,), J2K_REVERSIBLE: (J2K,)}
    for own, stream in streams.items():
        for uid in (RLE, BASELINE, LOSSLESS, LOSSLESS_SV1, LS, LS_NEAR, J2K_REVERSIBLE, J2K):
            if uid == own or uid in same.get(own, ()):
                continue
            case(f"a stream of {own} as {uid}", uid, [stream], (image, 8, False), refused=".")


def deflated():
    for bits, signed in [(8, False), (12, True), (16, False)]:
        for name, image in images(30, 41, bits, signed).items():
            d = dataset(image, 1, bits, signed)
            d.PixelData = image.tobytes() + b"\0" * (image.nbytes % 2)
            d["PixelData"].VR = "OW"
            path = folder / f"{len(cases):04}.dcm"
            write(d, path, ExplicitVRLittleEndian)
            raw = path.read_bytes()
            end = 144 + struct.unpack_from("<I", raw, 140)[0]
            packer = zlib.compressobj(wbits=-15)
            body = packer.compress(raw[end:]) + packer.flush()
            uid = raw[132:end].replace(b"UI\x14\x001.2.840.10008.1.2.1\0", b"UI\x16\x00" + DEFLATED.encode())
            path.write_bytes(raw[:140] + struct.pack("<I", len(uid) - 12) + uid[12:] + body)
            cases.append((f"deflated {bits} {signed} {name}", path, image, 0, None))


for group in (run_lengths, lossless, baseline, jpeg_ls, jpeg_2000, another_codec, deflated):
    before = len(cases)
    group()
    print(f"{group.__name__}: {len(cases) - before} files")
paths = [str(path) for _, path, *_ in cases]
for first in range(0, len(paths), 500):
    subprocess.run([program, *paths[first : first + 500]], check=True)
wrong = 0
for name, path, expected, tolerance, refused in cases:
    error = path.with_name(path.name + ".error")
    message = error.read_text() if error.exists() else None
    if refused is not None:
        fault = "was read" if message is None else "" if re.search(refused, message) else f"says {message}"
    elif message is not None:
        fault = f"was refused: {message}"
    else:
        voxels = np.fromfile(path.with_name(path.name + ".f32"), "<f4")
        other = np.asarray(expected).astype(np.float32).ravel()
        off = np.abs(voxels - other).max() if voxels.shape == other.shape else np.inf
        fault = f"is up to {off} off" if off > tolerance else ""
    if fault:
        wrong += 1
        print(f"WRONG: {name} ({path.name}) {fault}")
print(f"{len(cases) - wrong} of {len(cases)} files are right")
sys.exit(wrong > 0 or not cases)
