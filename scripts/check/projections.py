"""Compares `ventriform reconstruct` with a reconstruction in numpy.

    python scripts/check/projections.py PROGRAM             projections of a simulated scan
    python scripts/check/projections.py PROGRAM RAW.dcm     of a scan (one detector, one rotation)

In numpy: OSEM, 3 iterations over the greatest number of subsets up to 10 that divides the views, with linear
interpolation between voxels and between pixels, then a Butterworth filter of 0.5 cycles per cm and order 5 by the
spectrum of the whole volume. Of angles and directions it knows the words of PS3.3 C.8.4.11 alone. Out: the difference
over the scan's size, and where the brightest spot lies in both. Needs nibabel and pydicom. Exits with 1 if it is more
than 2 %, or more than a voxel apart; if the slices as DICOM differ from those as NIfTI; or if a step of the patient is
not told and corrected.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import nibabel
import numpy as np
import pydicom

ITERATIONS, MOST_SUBSETS, CUT_OFF_PER_CM, ORDER = 3, 10, 0.5, 5
MOST_DIFFERENCE = 0.02


def acquisition(path):
    """Counts [view, row, column], angles in radians, mm of a pixel."""
    data = pydicom.dcmread(path)
    rotation = data.RotationInformationSequence[0]
    views = int(rotation.NumberOfFramesInRotation)
    counts = data.pixel_array.astype(float)
    counts = counts.reshape(-1, views, *counts.shape[1:]).sum(0)
    sign = 1 if rotation.RotationDirection == "CC" else -1
    angles = float(rotation.StartAngle) + sign * float(rotation.AngularStep) * np.arange(views)
    return counts, np.deg2rad(angles), float(data.PixelSpacing[0])


def osem(counts, angles):
    """The image [z from the head, y to the back, x to the left]."""
    views, rows, n = counts.shape
    middle = (n - 1) / 2
    offsets = np.arange(n) - middle
    y, x = np.meshgrid(offsets, offsets, indexing="ij")

    def corners(angle):
        plane, column = np.meshgrid(offsets, offsets, indexing="ij")
        px = np.sin(angle) * plane - np.cos(angle) * column + middle
        py = np.cos(angle) * plane + np.sin(angle) * column + middle
        i, j = np.floor(px).astype(int), np.floor(py).astype(int)
        seen = (i >= 0) & (j >= 0) & (i < n - 1) & (j < n - 1)
        f, g = (px - i)[seen], (py - j)[seen]
        at = (j * n + i)[seen]
        places = np.stack([at, at + 1, at + n, at + n + 1])
        weights = np.stack([(1 - f) * (1 - g), f * (1 - g), (1 - f) * g, f * g])
        return places, weights, np.broadcast_to(np.arange(n), (n, n))[seen]

    def forward(image, angle):
        places, weights, column = corners(angle)
        values = sum(image[:, place] * weight for place, weight in zip(places, weights))
        return np.stack([np.bincount(column, row, n) for row in values])

    def back(pixels, angle):
        at = -np.cos(angle) * x + np.sin(angle) * y + middle
        first = np.clip(np.floor(at).astype(int), 0, n - 2)
        f = at - first
        spread = (1 - f) * pixels[:, first] + f * pixels[:, first + 1]
        return np.where((at >= 0) & (at < n - 1), spread, 0).reshape(len(pixels), n * n)

    image = np.tile(((x**2 + y**2) < middle**2).ravel().astype(float), (rows, 1))
    subsets = max(s for s in range(1, MOST_SUBSETS + 1) if views % s == 0)
    for _ in range(ITERATIONS):
        for first in range(subsets):
            change, seen = np.zeros_like(image), np.zeros((1, n * n))
            for view in range(first, views, subsets):
                expected = forward(image, angles[view])
                told = expected > 4e-6 * counts.max()
                quotients = np.where(told, counts[view] / np.where(told, expected, 1), 0)
                change += back(quotients, angles[view])
                seen += back(np.ones((1, n)), angles[view])
            image *= np.where(seen > 1e-3, change / np.where(seen > 1e-3, seen, 1), 0)
    return image.reshape(rows, n, n)


def butterworth(image, mm):
    squares = np.meshgrid(*[np.fft.fftfreq(n, mm / 10) ** 2 for n in image.shape], indexing="ij")
    gain = 1 / np.sqrt(1 + (sum(squares) / CUT_OFF_PER_CM**2) ** ORDER)
    return np.maximum(np.fft.ifftn(np.fft.fftn(image) * gain).real, 0)


def simulated(folder, program):
    """Projections of a simulated scan."""
    flags = ["--size", "64", "--spacing", "6.4", "--projections"]
    subprocess.run([program, "phantom", "-o", folder / "scan", *flags], check=True)
    return folder / "scan/raw.dcm"


def two_heads(folder, program):
    """Two heads count what one does, and a step is told of both at its time."""
    flags = ["--size", "64", "--spacing", "6.4", "--projections", "--heads", "2", "--motion", "-10"]
    subprocess.run([program, "phantom", "-o", folder / "two", *flags], check=True)
    subprocess.run([program, "segment", folder / "two/raw.dcm", "-o", folder / "two/out"], check=True)
    moves = json.loads((folder / "two/out/report.json").read_text())["projections"]["moves"]
    print(f"two heads: {moves}")
    return len(moves) == 1 and moves[0]["from_time"] in (15, 16, 17) and abs(moves[0]["head_mm"] + 10) < 3


def moved(folder, program, raw, mm=12.0):
    """A step of `mm` towards the head half-way through the scan is told, and goes by `--correct-motion`."""
    data = pydicom.dcmread(raw)
    frames = data.pixel_array.astype(float)
    away, size = len(frames) // 2, float(data.PixelSpacing[0])
    rows = np.arange(frames.shape[1]) + mm / size
    for frame in frames[away:]:
        for column in frame.T:
            column[:] = np.interp(rows, np.arange(len(column)), column.copy())
    data.PixelData = np.round(frames).astype(np.uint16).tobytes()
    path = folder / "moved.dcm"
    data.save_as(path)
    reports = {}
    for name, flags in (("as it is", []), ("corrected", ["--correct-motion"])):
        out = folder / name
        subprocess.run([program, "segment", path, "-o", out, *flags], check=True)
        reports[name] = json.loads((out / "report.json").read_text())
    told = reports["as it is"]["projections"]
    steps = [own for own in told["moves"] if abs(own["from_time"] - 1 - away) <= 1 and abs(own["head_mm"] - mm) < 3]
    after = reports["corrected"]["projections"]["uncorrected"]
    print(f"moves {told['moves']}, before the correction: {after and after['confidence']}")
    return len(steps) == 1 and after is not None and len(after["segments_change"]) == 17


def slices(folder, program, raw):
    """The slices as DICOM have the voxels, place and patient of those as NIfTI."""
    paths = [folder / "slices.dcm", folder / "slices.nii.gz"]
    for path in paths:
        subprocess.run([program, "reconstruct", raw, "-o", path, "--sum"], check=True)
    image, known = pydicom.dcmread(paths[0]), nibabel.as_closest_canonical(nibabel.load(paths[1]))
    known = known.get_fdata()[::-1, ::-1].transpose(2, 1, 0)
    scale = image.RealWorldValueMappingSequence[0].RealWorldValueSlope
    position = image.DetectorInformationSequence[0].ImagePositionPatient
    difference = np.abs(image.pixel_array * scale - known).max() / known.max()
    same = image.StudyInstanceUID == pydicom.dcmread(raw).StudyInstanceUID
    print(f"slices as DICOM differ by {difference:.1e}, first voxel at {position}")
    return difference < 1e-4 and same and image.ImageType[2] == "RECON TOMO"


def main(program, raw=None):
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        raw = raw or simulated(folder, program)
        out = folder / "volume.nii.gz"
        subprocess.run([program, "reconstruct", raw, "-o", out, "--sum"], check=True)
        # From x to the right, y to the front, z to the head.
        made = nibabel.as_closest_canonical(nibabel.load(out)).get_fdata()[::-1, ::-1, ::-1].transpose(2, 1, 0)
        counts, angles, mm = acquisition(raw)
        known = butterworth(osem(counts, angles), mm)
        difference = np.sqrt(((made - known) ** 2).sum() / (known**2).sum())
        spots = [np.unravel_index(volume.argmax(), volume.shape) for volume in (made, known)]
        apart = np.abs(np.subtract(*spots)).max()
        print(f"difference {100 * difference:.2f} %, brightest voxels {apart} apart")
        close = difference <= MOST_DIFFERENCE and apart <= 1
        checks = [close, slices(folder, program, raw), moved(folder, program, raw), two_heads(folder, program)]
        return int(not all(checks))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
