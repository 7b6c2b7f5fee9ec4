#!/usr/bin/env python3
"""Estimates how much two scans of an unchanged heart differ, from a table of simulated pairs.

    calibrate_comparison.py --check TABLE   figures of a table: TID, reversible wall, territories
    calibrate_comparison.py --write         estimates the constants from scripts/measure/calibration/comparisons.csv and
                                            writes
                                            crates/ventriform/src/heart/comparison/calibration.rs

A table is what the program `comparisons` prints; calibrate_all.py makes it. The committed one has 20 pairs of an older
simulator with the same kinds. By itself:

    cargo run --release -p ventriform-evaluation --bin simulate -- pairs --out PAIRS --seed 610 --n 20 --gates 0
    cargo run --release -p ventriform-evaluation --bin comparisons -- PAIRS/* > TABLE

- Deviation of the difference: root mean square over the pairs without reversible wall.
- Gain of a turn: a significant one is 2.5 times the largest of these pairs, whose turns are those of a patient who lies
  down again.
- Quotient of the walls: four deviations of its logarithm.
"""

import argparse
import csv
import pathlib

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
TABLE = ROOT / "scripts/measure/calibration/comparisons.csv"
CONSTANTS = ROOT / "crates/ventriform/src/heart/comparison/calibration.rs"
FOUND_PERCENT = 3
TURN_MARGIN, MUSCLE_SDS = 2.5, 4
HEADER = """\
//! Constants of comparisons. Written by `scripts/measure/calibrate_comparison.py`: do not edit.
//!
//! In: comparisons of simulated pairs of scans, and what truly changed. Out: how much unchanged hearts differ.
"""


def rows_of(table):
    with open(table, newline="") as file:
        return [row for row in csv.DictReader(file) if row["comparable"] == "true"]


def column(rows, name):
    return np.array([float(row[name]) for row in rows])


def without_reversible(rows):
    return [row for row in rows if float(row["true_reversible"]) == 0]


def write():
    rows = rows_of(TABLE)
    unchanged = without_reversible(rows)
    sd = np.sqrt(np.mean(column(unchanged, "sd_points") ** 2))
    gain = TURN_MARGIN * column(unchanged, "turn_gain").max()
    muscle = np.exp(MUSCLE_SDS * np.sqrt(np.mean(np.log(column(rows, "muscle")) ** 2)))
    constants = [
        (
            "pub const DIFFERENCE_SD_POINTS",
            sd,
            1,
            "Standard deviation of the smoothed difference where nothing changed, per cent of the rest map's "
            "reference.",
        ),
        (
            "pub(super) const SIGNIFICANT_TURN_GAIN",
            gain,
            2,
            "Share by which a turn must lower the mean squared difference.",
        ),
        (
            "pub const MOST_MUSCLE_QUOTIENT",
            muscle,
            2,
            "Quotient of the walls' volumes beyond which they are hardly of one heart.",
        ),
    ]
    text = HEADER
    for name, value, places, says in constants:
        text += f"\n/// {says}\n{name}: f64 = {round(float(value), places)};\n"
        print(name.split()[-1], f"{value:.3f}")
    CONSTANTS.write_text(text)


def check(table):
    rows = rows_of(table)
    error = column(rows, "tid") - column(rows, "true_tid")
    print(f"TID: {len(rows)} pairs, bias {error.mean():+.3f}, SD {error.std(ddof=1):.3f}, worst {abs(error).max():.3f}")
    sure = [row for row in rows if "tid_uncertain" not in row["flags"]]
    error = column(sure, "tid") - column(sure, "true_tid")
    print(
        f"TID where it is not flagged: {len(sure)} pairs, bias {error.mean():+.3f}, SD {error.std(ddof=1):.3f}, "
        f"worst {abs(error).max():.3f}"
    )
    unchanged = without_reversible(rows)
    print(
        f"unchanged: {len(unchanged)} pairs, largest reversible share {column(unchanged, 'reversible').max():.1f} "
        f"per cent"
    )
    for strength in (20, 40, 60):
        own = [row for row in rows if row["kind"].endswith(str(strength))]
        found = [row for row in own if float(row["reversible"]) > FOUND_PERCENT]
        right = [row for row in found if row["territory"] == row["true_territory"]]
        print(f"reversible {strength} per cent: {len(own)}, found {len(found)}, territory right {len(right)}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--check", metavar="TABLE", nargs="?", const=TABLE)
    what.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    write() if arguments.write else check(arguments.check)


if __name__ == "__main__":
    main()
