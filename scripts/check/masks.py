"""Segments scans whose headers state their place in every way, and asks SimpleITK, nibabel and pynrrd where masks are.

usage: masks.py PROGRAM DIR

For each header the program writes mask.nii.gz, labels.nii.gz and labels.seg.nrrd; ITK and nibabel must find them
exactly where they find the scan, and the labels must be the mask (1) and, outside of it, the cavity (2). Of a sheared
grid, which ITK does not read, the masks on an orthogonal grid must lie where nibabel finds the scan.
"""

import subprocess
import sys
from pathlib import Path

import nibabel as nib
import nrrd
import numpy as np
import SimpleITK as sitk
from scipy.ndimage import map_coordinates


def header(scan, data, qform, sform):
    """A copy of `scan` with these forms (matrix and code; None leaves it out)."""
    image = nib.Nifti1Image(data, None, scan.header.copy())
    image.header.set_data_shape(data.shape)
    image.set_qform(*(qform or (None, 0)))
    image.set_sform(*(sform or (None, 0)))
    return image


def cases(scan):
    a = scan.affine
    moved = a.copy()
    moved[:3, 3] += [10, -5, 3]
    c, s = np.cos(0.3), np.sin(0.3)
    turned = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]) @ a
    mirrored = a @ np.diag([-1.0, 1, 1, 1])
    mirrored[:3, 3] = a[:3, 3] + a[:3, 0] * (scan.shape[0] - 1)
    data = np.asanyarray(scan.dataobj).astype(np.float32)
    yield "both", header(scan, data, (a, 1), (a, 1)), []
    yield "disagreeing", header(scan, data, (a, 1), (moved, 2)), []
    yield "qform", header(scan, data, (turned, 1), None), []
    yield "sform", header(scan, data, None, (turned, 1)), []
    yield "mirrored", header(scan, data[::-1].copy(), (mirrored, 1), (mirrored, 4)), []
    yield "trailing", header(scan, data[..., None], (a, 1), (a, 1)), []
    yield "volumes", header(scan, np.stack([0 * data + 1, data], -1), (a, 1), (a, 1)), ["--frame", "1"]


def same_place(scan, mask):
    """The first difference of two files' places to ITK, as text; None if there is none."""
    a, b = sitk.ReadImage(str(scan)), sitk.ReadImage(str(mask))
    n = min(a.GetDimension(), b.GetDimension(), 3)

    def grid(image):
        return np.array(image.GetDirection()).reshape(image.GetDimension(), -1)[:n, :n]

    pairs = (
        (a.GetSize()[:n], b.GetSize()[:n]),
        (a.GetOrigin()[:n], b.GetOrigin()[:n]),
        (a.GetSpacing()[:n], b.GetSpacing()[:n]),
        (grid(a), grid(b)),
    )
    for what, (x, y) in zip(("size", "origin", "spacing", "direction"), pairs):
        if not np.array_equal(np.array(x), np.array(y)):
            return f"ITK's {what} {y} instead of {x}"
    return None


def check(name, program, folder, image, flags):
    scan, out = folder / f"{name}.nii.gz", folder / name
    nib.save(image, scan)
    subprocess.run([program, "segment", scan, "--model", "auto", "-o", out, *flags], check=True, capture_output=True)
    mask, labels = nib.load(out / "mask.nii.gz"), nib.load(out / "labels.nii.gz")
    wall, both = np.asarray(mask.dataobj), np.asarray(labels.dataobj)
    values, fields = nrrd.read(str(out / "labels.seg.nrrd"))
    problems = []
    stated = nib.load(scan)
    for file in (mask, labels):
        problems.append(same_place(scan, file.get_filename()))
        if not np.array_equal(file.affine, stated.affine):
            problems.append("nibabel's affine differs")
        for key in ("qform_code", "sform_code", "xyzt_units"):
            if file.header[key] != stated.header[key]:
                problems.append(f"{key} {file.header[key]} instead of {stated.header[key]}")
    if not np.array_equal(both == 1, wall > 0) or not 0.05 < (both == 2).sum() / (both == 1).sum() < 5:
        problems.append("the labels are not wall and cavity")
    if not np.array_equal(values, both.reshape(values.shape, order="A")):
        problems.append("the labels of both files differ")
    affine = np.column_stack([fields["space directions"].T, fields["space origin"]])
    if not np.allclose(np.diag([-1, -1, 1]) @ affine, stated.affine[:3], atol=1e-4):
        problems.append("pynrrd's affine differs")
    if len(labels.header.extensions) != 1 or b"Cavity" not in labels.header.extensions[0].content:
        problems.append("labels.nii.gz names no labels")
    return [problem for problem in problems if problem]


def check_sheared(program, folder, scan):
    shear = np.eye(4)
    shear[1, 2] = -0.2
    image = header(scan, np.asanyarray(scan.dataobj).astype(np.float32), None, (shear @ scan.affine, 1))
    nib.save(image, folder / "sheared.nii.gz")
    command = [program, "segment", folder / "sheared.nii.gz", "--model", "auto", "-o"]
    made = [
        subprocess.run([*command, folder / name, *flags], capture_output=True, text=True)
        for name, flags in (("sheared", []), ("orthogonal", ["--mask-grid", "orthogonal"]))
    ]
    if any(run.returncode for run in made):
        return [run.stderr for run in made if run.returncode]
    problems = [] if "right angles" in made[0].stderr else ["no warning of the shear"]
    own, square = (nib.load(folder / name / "mask.nii.gz") for name in ("sheared", "orthogonal"))
    directions = square.affine[:3, :3] / np.linalg.norm(square.affine[:3, :3], axis=0)
    if not np.allclose(directions.T @ directions, np.eye(3), atol=1e-5) or int(square.header["qform_code"]) == 0:
        problems.append("the orthogonal grid is not orthogonal")
    sitk.ReadImage(square.get_filename())
    # Voxels of the one looked up in the other by nibabel's places.
    voxels = np.argwhere(np.asarray(own.dataobj) > 0)
    places = np.linalg.inv(square.affine) @ own.affine @ np.column_stack([voxels, np.ones(len(voxels))]).T
    share = map_coordinates(np.asarray(square.dataobj, float), places[:3], order=1).mean()
    return problems + ([] if share > 0.8 else [f"only {share:.0%} of the mask lie where the scan is"])


def main(program, folder):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    subprocess.run(
        [program, "phantom", "-o", folder, "--size", "64", "--spacing", "5"], check=True, capture_output=True
    )
    scan = nib.load(folder / "spect.nii.gz")
    failed = 0
    results = [(name, check(name, program, folder, image, flags)) for name, image, flags in cases(scan)]
    for name, problems in [*results, ("sheared", check_sheared(program, folder, scan))]:
        print(f"masks: {name}: {'; '.join(problems) or 'in place'}")
        failed += bool(problems)
    print(f"masks: {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))
