"""Estimates the scores below which axes of an image count as exchanged (AxisPair::flag_score of
heart/judge/exchanged_axes.rs).

    cargo build --release --bin ventriform && cargo build --release --package ventriform-evaluation --bin exchanged_axes
    python scripts/measure/calibrate_axes.py OUT [--cases 120] [--seed 1] [--also FOLDER...]

Makes simulated scans of many sizes, spacings, livers and right ventricles in OUT (kept if they are there), and takes
other folders with spect.nii.gz and lv_truth.nii.gz from --also. Each is scored as it is, as three cut-outs about the
heart with random margins, and with two axes exchanged. Every second scan takes part in the estimate; the others are
held out and judged by it.

The estimate is 0.1 below the lowest score of the estimating scans as they are and cut out, and at most -0.15.
"""

import argparse
import csv
import glob
import os
import random
import subprocess

MARGIN, HIGHEST = 0.1, -0.15


def make(program, out, seed, cases):
    rng = random.Random(seed)
    for number in range(cases):
        spacing = rng.choice([3.2, 4.0, 4.8, 6.4, 6.4, 6.8])
        size = rng.choice([64, 64, 72, 80]) if spacing >= 4.8 else rng.choice([80, 96])
        flags = [
            "--size",
            size,
            "--spacing",
            spacing,
            "--seed",
            rng.randrange(10_000),
            "--noise",
            rng.choice([0.02, 0.05, 0.08]),
            "--liver",
            rng.choice([0, 0.2, 0.3, 0.5, 0.7, 1.2]),
            "--right-ventricle",
            rng.choice([0, 0.2, 0.3, 0.5]),
        ]
        for _ in range(rng.choice([0, 0, 1, 2])):
            flags += ["--defect", f"{rng.randint(1, 17)}:{rng.choice([0.4, 0.7, 0.9])}"]
        folder = f"{out}/{number:03d}"
        if not os.path.exists(f"{folder}/spect.nii.gz"):
            subprocess.run([program, "phantom", "-o", folder, *map(str, flags)], check=True, stdout=subprocess.DEVNULL)


def lowest(rows, pair):
    """The lowest score of right images, and the highest of those whose axes were exchanged."""

    def total(row):
        return float(row[f"{pair}_ends"]) + float(row[f"{pair}_side"])

    right = [total(row) for row in rows if row["kind"] in ("whole", "cut-out")]
    exchanged = [total(row) for row in rows if row["kind"] == pair]
    return right, exchanged


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("--cases", type=int, default=120)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--also", nargs="*", default=[])
    parser.add_argument("--program", default="target/release/ventriform")
    parser.add_argument("--tool", default="target/release/exchanged_axes")
    args = parser.parse_args()
    make(args.program, args.out, args.seed, args.cases)
    folders = sorted(glob.glob(f"{args.out}/*/")) + args.also
    text = subprocess.run([args.tool, str(args.seed), *folders], check=True, capture_output=True, text=True).stdout
    rows = list(csv.DictReader(text.splitlines()))
    names = list(dict.fromkeys(row["scan"] for row in rows))
    halves = {name: number % 2 for number, name in enumerate(names)}
    for pair in ("sides", "depth"):
        estimating, held_out = ([row for row in rows if halves[row["scan"]] == half] for half in (0, 1))
        right, _ = lowest(estimating, pair)
        limit = min(HIGHEST, min(right) - MARGIN)
        print(f"{pair}: estimate {limit:.2f}, lowest right score {min(right):.2f} of {len(right)}")
        for name, half in (("in-sample", estimating), ("held-out", held_out)):
            right, exchanged = lowest(half, pair)
            flagged = sum(score < limit for score in exchanged)
            wrong = sum(score < limit for score in right)
            print(
                f"  {name}: {flagged} of {len(exchanged)} exchanged flagged (highest score {max(exchanged):.2f}), "
                f"{wrong} of {len(right)} right ones and cut-outs (lowest {min(right):.2f})"
            )


if __name__ == "__main__":
    main()
