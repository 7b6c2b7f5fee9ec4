#!/usr/bin/env python3
"""Remakes every table and every constant that is estimated from simulated hearts.

    calibrate_all.py CASES                     all of it: some 2,000 scans; not run as a whole yet
    calibrate_all.py CASES --share 0.2         the same with a fifth of the cases, to see that it works, in a copy of
                                               the tree: rims cannot be estimated from fewer
    calibrate_all.py CASES --only volumes      one table, and the constants that come from it

CASES is a folder for the simulated scans, an estimated 25 GB; those that are there are kept. In: seeds and kinds, which
stand below. Out: the tables in scripts/measure/calibration, and by them

- heart/judge/calibration.rs (calibrate.py)
- heart/deform/calibration.rs and heart/judge/uncertainty_calibration.rs (calibrate_walls.py)
- heart/deform/thickness_calibration.rs (calibrate_thickness.py)
- heart/beat/calibration.rs and heart/judge/volume_calibration.rs (calibrate_intervals.py)
- heart/comparison/calibration.rs and heart/comparison/beat_calibration.rs (calibrate_comparison.py)
- heart/serial/calibration.rs (calibrate_serial.py)

of crates/ventriform/src. The same commit gives the same bytes on every machine of one kind. The fits are by the
constants as they stand: run it again until nothing changes, and judge the fits anew (docs/evaluation.md) before
anything is committed.
"""

import argparse
import math
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
TABLES = ROOT / "scripts/measure/calibration"
PROGRAMS = [
    "simulate",
    "calibration_features",
    "wall_features",
    "smoothness_features",
    "volumes",
    "beats",
    "comparisons",
    "beat_changes",
    "serials",
]
ALL = "in,motion,rv,basal,apex,infarct,large,small,noise,gut,liver,coarse,turned,none"
# Kinds with a heart in its place, for the ends of the signal.
SEEN = "in,basal,infarct,large,rv,liver,basal,noise,gut,small,coarse,infarct"
# Sets of single scans: the name of the folder, the seed, how many, kinds, and whether on 64 voxels along an axis. The
# scripts name the sets that each constant comes from.
SETS = {
    "cohort": (1000, 19, "in", False),
    "411": (411, 42, ALL, False),
    "701": (701, 42, ALL, False),
    "702": (702, 18, "motion,rv,infarct", False),
    "703": (703, 14, "rv", False),
    "704": (704, 14, "motion,apex", False),
    "911": (911, 42, ALL, False),
    "1101": (1101, 28, ALL, False),
    "1102": (1102, 18, "motion", False),
    "2101": (2101, 42, ALL, False),
    "2103": (2103, 42, ALL, False),
    "2104": (2104, 14, ALL, False),
    "5001": (5001, 118, ALL, False),
    "9001": (9001, 12, SEEN, True),
    "9101": (9101, 12, SEEN, True),
    "9111": (9111, 94, SEEN, True),
    "6003": (6003, 84, ALL, True),
    "6007": (6007, 48, "filter,camera,cut,few", True),
    "6009": (6009, 40, "filter", True),
    "9301": (9301, 1000, ALL, True),
}
OF_FEATURES = [name for name in SETS if name not in ("9001", "9101", "9111")]
OF_WALLS = ["cohort", "411", "701", "702", "703", "704", "2101", "2104", "9001", "9101", "9111"]
OF_SMOOTHNESS = ["cohort", "5001"]
OF_VOLUMES = ["6003", "6007", "6009"]
# Seeds and numbers of gated studies, and of pairs without gates.
BEATS = {"500": (500, 20), "501": (501, 20)}
PAIRS = {"610": (610, 20)}
# Of gated pairs.
GATED_PAIRS = {"620": (620, 16)}
KINDS_OF_GATED_PAIRS = "same,red40,red60,tid,fixed,tidred40,both60,red20"
# Of gated series.
SERIES = {"41": (41, 40)}
# Seed and number of hearts with walls of every thickness, and of gated ones.
OF_THICKNESS = {"6001": (6001, 120)}
BEATS_OF_THICKNESS = {"7103": (7103, 16)}


class Lab:
    """The programs, and where the cases lie."""

    def __init__(self, cases, share, programs):
        self.cases, self.share, self.programs = cases, share, programs

    def run(self, program, *arguments, into=None):
        command = [str(self.programs / program), *map(str, arguments)]
        print("+", " ".join(command[:6]), "..." if len(command) > 6 else "", file=sys.stderr, flush=True)
        made = subprocess.run(command, check=True, stdout=subprocess.PIPE if into else None)
        if into:
            into.write_bytes(made.stdout)

    def number(self, whole):
        return math.ceil(self.share * whole)

    def scans(self, names):
        """The folders of the sets, made if they are not there."""
        folders = []
        for name in names:
            seed, whole, kinds, coarse = SETS[name]
            number, kinds = self.number(whole), kinds.split(",")
            # A few cases of many sets still have kinds from all over the list.
            if number < len(kinds):
                kinds = [kinds[(seed + k * len(kinds) // number) % len(kinds)] for k in range(number)]
            more = ["--coarse"] if coarse else []
            out = self.cases / name
            self.run(
                "simulate",
                *("cases", "--seed", seed, "--n", number, "--kinds", ",".join(kinds), "--out", out),
                *more,
            )
            folders.append(out)
        return folders

    def walls(self, sets):
        """The folders of hearts with walls of every thickness, made if they are not there."""
        for name, (seed, whole) in sets.items():
            self.run("simulate", "walls", "--seed", seed, "--n", self.number(whole), "--out", self.cases / name)
        return [self.cases / name for name in sets]

    def studies(self, kind, sets, *more):
        folders = []
        for name, (seed, whole) in sets.items():
            out = self.cases / f"{kind}{name}"
            self.run("simulate", kind, "--seed", seed, "--n", self.number(whole), "--out", out, *more)
            folders += sorted(path for path in out.iterdir() if path.is_dir())
        return folders


def features(lab):
    lab.run("calibration_features", *lab.scans(OF_FEATURES), into=TABLES / "features.csv")
    script("calibrate.py", "--write")


def walls(lab):
    lab.run("wall_features", TABLES, *lab.scans(OF_WALLS))
    lab.run("smoothness_features", TABLES / "smoothness.csv", *lab.scans(OF_SMOOTHNESS))
    script("calibrate_walls.py", "--write")


def volumes(lab):
    folders = lab.walls(OF_THICKNESS) + lab.scans(OF_VOLUMES)
    lab.run("volumes", *folders, into=TABLES / "volumes.csv")
    script("calibrate_thickness.py", "--write")
    script("calibrate_intervals.py", "--write", "volumes")


def beats(lab):
    studies = lab.studies("gated", BEATS) + lab.studies("walls", BEATS_OF_THICKNESS, "--gates", 8)
    lab.run("beats", *studies, into=TABLES / "beats.csv")
    script("calibrate_intervals.py", "--write", "beats")


def comparisons(lab):
    lab.run("comparisons", *lab.studies("pairs", PAIRS, "--gates", 0), into=TABLES / "comparisons.csv")
    gated = lab.studies("pairs", GATED_PAIRS, "--gates", 8, "--kinds", KINDS_OF_GATED_PAIRS)
    lab.run("beat_changes", *gated, into=TABLES / "beat_changes.csv")
    script("calibrate_comparison.py", "--write")


def serials(lab):
    table = TABLES / "serials.csv"
    lab.run("serials", *lab.studies("serial", SERIES, "--gates", 8), into=table)
    script("calibrate_serial.py", "--write")


PARTS = {part.__name__: part for part in (features, walls, volumes, beats, comparisons, serials)}


def script(name, *arguments):
    print("+", name, *arguments, file=sys.stderr, flush=True)
    subprocess.run([sys.executable, ROOT / "scripts/measure" / name, *arguments], check=True)


def build(programs):
    """Builds programs in release from this tree; the folder that they are in."""
    bins = [flag for program in programs for flag in ("--bin", program)]
    command = ["cargo", "build", "--release", "--quiet", "--package", "ventriform-evaluation", *bins]
    subprocess.run(command, cwd=ROOT, check=True)
    return pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=pathlib.Path)
    parser.add_argument("--share", type=float, default=1.0, help="share of the cases, 0 to 1")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), help="some of the tables")
    parser.add_argument("--programs", type=pathlib.Path, help="the folder of the programs, instead of building them")
    given = parser.parse_args()
    lab = Lab(given.cases, given.share, given.programs or build(PROGRAMS))
    for part in given.only:
        PARTS[part](lab)


if __name__ == "__main__":
    main()
