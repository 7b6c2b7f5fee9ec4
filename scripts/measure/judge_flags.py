"""Flags judged on simulated hearts: dark apices, images that were cut and resliced, and files whose sides are
exchanged.

    python scripts/measure/judge_flags.py OUT --apices SEED                makes hearts whose apex is dark, in whole or
                                                                           in part, and healthy ones
    python scripts/measure/judge_flags.py OUT --cuts SEED --cases CASE...  cuts images of cases at four sides, and
                                                                           reslices them obliquely
    python scripts/measure/judge_flags.py OUT --mirrored --cases CASE...   exchanges left and right of cases
    python scripts/measure/judge_flags.py OUT --judge [--programs target/release]

--apices takes the program `simulate`. --judge segments every OUT/*/spect.nii.gz and prints flags, and, against the
truth beside it, the error of the cavity and, against OUT/NAME_whole, the change of the wall. The images are made in
OUT; what is there already is kept.
"""

import argparse
import glob
import json
import os
import subprocess
import tempfile

import numpy as np

APICES = "apex,halfapex,oneapex,apexplus,healthy"
NUMBER = 22
CUT_DEPTH_MM, CONSTANT = 8, 17


def make_apices(programs, out, seed):
    command = [f"{programs}/simulate", "cases", "--seed", str(seed), "--n", str(NUMBER), "--kinds", APICES]
    subprocess.run([*command, "--out", out], check=True)


def turn(rng):
    """A turn by 10 to 40 degrees about any axis."""
    axis = rng.normal(size=3)
    x, y, z = axis / np.linalg.norm(axis)
    angle = np.radians(rng.uniform(10, 40))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def read(path):
    import nibabel

    image = nibabel.load(path)
    return np.asarray(image.dataobj, dtype=np.float32), image.affine


def write(values, affine, folder):
    import nibabel

    os.makedirs(folder, exist_ok=True)
    nibabel.save(nibabel.Nifti1Image(values, affine), f"{folder}/spect.nii.gz")


def resliced(values, affine, rng):
    from scipy import ndimage

    spacing = float(np.linalg.norm(affine[:3, 0]))
    new = spacing * rng.choice([1.0, 1.0, 0.85, 1.25])
    count = int(min(128, np.ceil(values.shape[0] * spacing / new)))
    linear = turn(rng) @ affine[:3, :3] * (new / spacing)
    to = np.eye(4)
    to[:3, :3] = linear
    to[:3, 3] = (
        affine[:3, :3] @ ((np.array(values.shape) - 1) / 2) + affine[:3, 3] - linear @ np.full(3, (count - 1) / 2)
    )
    step = np.linalg.inv(affine) @ to
    made = ndimage.affine_transform(
        values, step[:3, :3], step[:3, 3], output_shape=(count,) * 3, order=1, mode="constant", cval=0
    )
    return made.astype(np.float32), to


def make_cuts(out, seed, cases):
    rng = np.random.default_rng(seed)
    for case in cases:
        name = os.path.basename(case)
        values, affine = read(f"{case}/spect.nii.gz")
        wall = np.argwhere(read(f"{case}/lv_truth.nii.gz")[0] > 0.5)
        depth = int(round(CUT_DEPTH_MM / np.linalg.norm(affine[:3, 0])))
        write(*resliced(values, affine, rng), f"{out}/{name}_whole")
        for axis, side in ((2, 0), (0, 0), (1, 1), (2, 1)):
            away = [slice(None)] * 3
            away[axis] = (
                slice(0, wall.min(0)[axis] + depth) if side == 0 else slice(wall.max(0)[axis] - depth + 1, None)
            )
            for what, value in (("zero", 0), ("const", CONSTANT)) if (axis, side) == (2, 0) else (("zero", 0),):
                cut = values.copy()
                cut[tuple(away)] = value
                write(*resliced(cut, affine, rng), f"{out}/{name}_{axis}{side}{what}")


def make_mirrored(out, cases):
    for case in cases:
        values, affine = read(f"{case}/spect.nii.gz")
        affine = affine.copy()
        affine[0] *= -1
        write(values, affine, f"{out}/{os.path.basename(case)}_mirrored")


def judge(out, program):
    reports = {}
    for case in sorted(glob.glob(f"{out}/*/spect.nii.gz")):
        with tempfile.TemporaryDirectory() as made:
            command = [program, "segment", case, "--model", "auto", "--format", "json", "-o", made]
            ran = subprocess.run(command, capture_output=True, text=True)
            name = os.path.basename(os.path.dirname(case))
            reports[name] = None if ran.returncode else json.load(open(f"{made}/report.json"))
    for name, report in reports.items():
        if report is None:
            print(name, "refused")
            continue
        words = [flag["code"] for flag in report["flags"]]
        whole = reports.get(f"{name.rsplit('_', 1)[0]}_whole")
        truth = f"{out}/{name}/params.json"
        if os.path.exists(truth):
            cavity = json.load(open(truth))["result"]["cavity_ml"]
            words.append(f"cavity {100 * (report['volumes_ml']['anatomical']['cavity'] / cavity - 1):+.0f} %")
        if whole:
            walls = [of["volumes_ml"]["apparent"]["wall"] for of in (report, whole)]
            words.append(f"wall {100 * (walls[0] / walls[1] - 1):+.0f} %")
        words += [flag["reason"] for flag in report["flags"] if flag["code"] == "dark_apex"]
        print(name, *words)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("--cases", nargs="*", default=[])
    parser.add_argument("--apices", type=int)
    parser.add_argument("--cuts", type=int)
    parser.add_argument("--mirrored", action="store_true")
    parser.add_argument("--judge", action="store_true")
    parser.add_argument("--programs", default="target/release", help="folder of simulate and ventriform")
    given = parser.parse_args()
    if given.apices is not None:
        make_apices(given.programs, given.out, given.apices)
    if given.cuts is not None:
        make_cuts(given.out, given.cuts, given.cases)
    if given.mirrored:
        make_mirrored(given.out, given.cases)
    if given.judge:
        judge(given.out, f"{given.programs}/ventriform")


if __name__ == "__main__":
    main()
