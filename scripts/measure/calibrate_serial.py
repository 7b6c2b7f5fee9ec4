#!/usr/bin/env python3
"""Estimates how much the figures of two scans of one heart differ by themselves, from a table of serial comparisons.

    calibrate_serial.py --check TABLE   each figure of a table: error, share of changes told, share of true ones within
                                        the interval
    calibrate_serial.py --write         estimates the constants from scripts/measure/calibration/serials.csv and
                                        serial_halves.csv beside it, and writes
                                        crates/ventriform/src/heart/serial/calibration.rs

A table is what the program `serials` prints; calibrate_all.py makes that of the series. By itself:

    cargo run --release -p ventriform-evaluation --bin simulate -- serial --out SERIES --seed 41 --n 40
    cargo run --release -p ventriform-evaluation --bin serials -- SERIES/* > TABLE

Halves are such a table too, of 6 pairs of halves of one real scan, of kind `half`: the counts of its projections
divided in two at random, the second half reconstructed with a lower cut-off, moved by up to 10 mm and 10 degrees and
put on a finer grid. The scan is no part of the tree.

- The error of a figure is the change that was found less the true one. Figures whose truth is not known are taken from
  series in which nothing changed.
- It is as much by the usual noise as without noise: variance = least^2 (1 + (noise / usual noise)^2).
"""

import argparse
import csv
import math
import pathlib
from collections import defaultdict

ROOT = pathlib.Path(__file__).resolve().parents[2]
TABLE = ROOT / "scripts/measure/calibration/serials.csv"
HALVES = ROOT / "scripts/measure/calibration/serial_halves.csv"
CONSTANTS = ROOT / "crates/ventriform/src/heart/serial/calibration.rs"
UNCHANGED = {"same", "filter", "grid", "half"}
BY_SHARE = {"edv_ml", "esv_ml", "cavity_ml", "mass_g"}
# In the order of the file: name, figure, what it is.
NAMES = [
    ("EF", "ef_percent", "Ejection fraction, points"),
    ("EDV", "edv_ml", "Logarithm of the end-diastolic volume"),
    ("ESV", "esv_ml", "Logarithm of the end-systolic volume"),
    ("CAVITY", "cavity_ml", "Logarithm of the cavity in the image of all gates"),
    ("MASS", "mass_g", "Logarithm of the muscle's mass, each scan's own"),
    ("DARK", "dark_percent", "Share of the wall below the threshold, points"),
    ("MOTION", "motion_mm", "Mean inward motion, mm"),
    ("THICKENING", "thickening_percent", "Mean thickening, points"),
    ("PHASE_SD", "phase_sd_degrees", "Standard deviation of the phases, degrees"),
    ("PHASE_BANDWIDTH", "phase_bandwidth_degrees", "Bandwidth of the phases, degrees"),
    ("SEGMENT_UPTAKE", "segment", "Mean uptake of a segment, points"),
]
HEADER = """\
//! Constants of changes over the years. Written by `scripts/measure/calibrate_serial.py`: do not edit.
//!
//! In: simulated hearts, and halves of a real one, that were scanned again. Out: how much their figures differ beyond
//! what truly changed.

use crate::heart::comparison::ChangeError;
"""


def number(row, name):
    return float(row[name]) if row[name] else None


def is_unchanged(row):
    """Whether the figure is truly the same in both scans."""
    known = row["true_later"] != ""
    return row["true_earlier"] == row["true_later"] if known else row["kind"] in UNCHANGED


def errors(rows, figure):
    """The errors of a figure, each with the noise of its pair and its row."""
    found = []
    for row in rows:
        if row["figure"] != figure:
            continue
        known = number(row, "true_later") is not None and figure != "segment"
        if not known and row["kind"] not in UNCHANGED:
            continue
        values = [number(row, name) for name in ("earlier", "later")]
        truth = [number(row, name) for name in ("true_earlier", "true_later")] if known else [1.0, 1.0]
        if figure == "segment":
            error = number(row, "change")
        elif figure in BY_SHARE:
            error = math.log(values[1] / values[0]) - math.log(truth[1] / truth[0])
        else:
            error = values[1] - values[0] - (truth[1] - truth[0])
        found.append((error, number(row, "noise_points"), row))
    return found


def root_mean_square(values):
    values = list(values)
    return math.sqrt(sum(value * value for value in values) / len(values))


def constants(rows, names):
    """The lines of the constants of these figures."""
    noises = {row["series"]: number(row, "noise_points") for row in rows}
    usual = root_mean_square(noises.values())
    text = ""
    for name, figure, what in names:
        own = errors(rows, figure)
        least = root_mean_square(error / math.hypot(1, noise / usual) for error, noise, _ in own)
        text += f"\n/// {what}.\npub(super) const {name}: ChangeError = ChangeError {{\n"
        text += f"    least: {least:.3g},\n    per_point: {least / usual:.3g},\n}};\n"
        print(f"{figure:24} {len(own):4} errors, {root_mean_square(error for error, _, _ in own):.3f}")
    return text


def write():
    rows = [row for table in (TABLE, HALVES) for row in csv.DictReader(open(table))]
    CONSTANTS.write_text(HEADER + constants(rows, NAMES))


def judged(rows, figure):
    """The errors of a figure; of how many pairs that did not change it is told that they did, and how many there are;
    how many intervals hold the true change."""
    own = errors(rows, figure)
    unchanged = [row for _, _, row in own if is_unchanged(row)]
    told = sum(row["verdict"] == "yes" for row in unchanged)
    true_changes = [(number(row, "change") - shift(row, error), row) for error, _, row in own]
    held = sum(number(row, "low") <= change <= number(row, "high") for change, row in true_changes)
    return [error for error, _, _ in own], told, len(unchanged), held


def check_figures(rows, names):
    """Prints of every figure the errors, and how often verdicts and intervals are right."""
    for _, figure, _ in names:
        own, told, unchanged, held = judged(rows, figure)
        if own:
            print(
                f"{figure:24} {len(own):4}: error {sum(own) / len(own):+.3f}, rms {root_mean_square(own):.3f}; told "
                f"changed {told} of {unchanged} unchanged; interval holds the true change in {held} of {len(own)}"
            )


def check(table):
    rows = list(csv.DictReader(open(table)))
    check_figures(rows, NAMES)
    by_kind = defaultdict(list)
    for row in rows:
        if row["figure"] in ("worse_percent", "better_percent"):
            by_kind[row["kind"], row["figure"]].append(row["verdict"])
    for (kind, figure), verdicts in sorted(by_kind.items()):
        print(f"{kind:10} {figure:15} {', '.join(f'{verdicts.count(v)} {v}' for v in ('yes', 'no', 'cannot_tell'))}")
    for kind in ("ef5", "ef10", "edv20"):
        figure = "edv_ml" if kind == "edv20" else "ef_percent"
        own = [row for row in rows if row["kind"] == kind and row["figure"] == figure]
        down = sum((number(row, "change") < 0) == (kind != "edv20") for row in own)
        told = sum(row["verdict"] == "yes" for row in own)
        print(f"{kind:10} {figure}: {down} of {len(own)} to the right side, {told} told")


def shift(row, error):
    """How far the change that was found lies beyond the true one, in the figure's unit."""
    if row["figure"] in BY_SHARE:
        return number(row, "later") * (1 - math.exp(-error))
    return error


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", metavar="TABLE")
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    if given.write:
        write()
    if given.check:
        check(given.check)
    if not given.write and not given.check:
        parser.error("give --check TABLE or --write")


if __name__ == "__main__":
    main()
