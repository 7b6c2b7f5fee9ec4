#!/usr/bin/env python3
"""Estimates how the resolution of an image follows from its noise, from simulated hearts with walls of every thickness.

    calibrate_thickness.py --check [TABLE]   how near the resolutions of a table are to the committed constants
    calibrate_thickness.py --write           estimates the constants from the committed table and writes them

The constants are those of heart/deform/thickness_calibration.rs of crates/ventriform/src. The table
(scripts/measure/calibration/volumes.csv) is what the program `volumes` prints; calibrate_all.py makes it. Fits with a
confidence of .3 or less are left out, and from the resolution walls that look hardly wider than they are.

- MEAN_THICKNESS_SHIFT_MM: the mean of the true thickness less that which the calibration of walls leaves, over sets
  without a heart whose walls were drawn on purpose (all but WALL_SETS). It is in the column usual_mm already.
- SLAB_SHARE: that at which the resolution that explains a wall's width does not depend on its thickness.
- RESOLUTION: least squares of that resolution by the square of the noise length and the
  logarithm of the cavity.

The priors of heart/deform/wall_thickness.rs are chosen, not estimated.
"""

import argparse
import csv
import math
import pathlib

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
TABLE = ROOT / "scripts/measure/calibration/volumes.csv"
CONSTANTS = ROOT / "crates/ventriform/src/heart/deform/thickness_calibration.rs"
WALL_SETS = {"6001"}
LEAST_CONFIDENCE = 0.3
NOISE_LENGTH_MM, CAVITY_ML = 2.1, 50.0  # as in heart/deform/resolution_terms.rs
LEAST_RESOLUTION_MM = 5.0
RANGE_PERCENTILES = (1, 100)
SHARES = np.arange(0.70, 1.001, 0.01)


def width(thickness, resolution):
    """Full width at half maximum of a blurred slab, mm."""
    scale = 2.354820045 / (math.sqrt(2) * resolution)

    def value(x):
        return math.erf((x + thickness / 2) * scale) - math.erf((x - thickness / 2) * scale)

    level, low, high = value(0) / 2, 0.0, thickness / 2 + 2 * resolution
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if value(middle) > level else (low, middle)
    return low + high


def resolution_of(thickness, apparent):
    """The blur that makes a slab look so wide, mm; 0 if none does."""
    low, high = 0.0, apparent
    for _ in range(40):
        middle = (low + high) / 2
        wide = middle > 0 and width(thickness, middle) >= apparent
        low, high = (low, middle) if wide else (middle, high)
    return low


def table(path):
    with open(path, newline="") as file:
        rows = [row for row in csv.DictReader(file) if float(row["confidence"]) > LEAST_CONFIDENCE]
    numbers = {name: np.array([float(row[name]) for row in rows]) for name in rows[0] if name not in ("set", "case")}
    known = np.isfinite(numbers["noise_length_mm"]) & np.isfinite(numbers["true_thickness"])
    return {name: values[known] for name, values in numbers.items()}, np.array([row["set"] for row in rows])[known]


def terms(numbers, range_mm):
    length = np.clip(numbers["noise_length_mm"], *range_mm)
    cavity = np.maximum(numbers["apparent_cavity"], 1)
    return np.column_stack([np.ones(len(length)), length**2 - NOISE_LENGTH_MM**2, np.log(cavity / CAVITY_ML)])


def resolutions(numbers, share):
    pairs = zip(numbers["true_thickness"], numbers["apparent_mm"])
    return np.array([resolution_of(share * thickness, apparent) for thickness, apparent in pairs])


def estimate(numbers, sets):
    range_mm = np.round(np.percentile(numbers["noise_length_mm"], RANGE_PERCENTILES), 1)
    values = terms(numbers, range_mm)

    def explained(share, columns):
        found = resolutions(numbers, share)
        blurred = found > LEAST_RESOLUTION_MM
        terms, found = values[blurred][:, columns], found[blurred]
        coefficients = np.linalg.lstsq(terms, found, rcond=None)[0]
        return coefficients, found - terms @ coefficients, numbers["true_thickness"][blurred]

    def dependence(share):
        _, left, thickness = explained(share, [0, 1, 2])
        return abs(np.corrcoef(left, thickness)[0, 1])

    share = min(SHARES, key=dependence)
    coefficients, left, _ = explained(share, [0, 1, 2])
    _, without, _ = explained(share, [0, 2])
    usual = ~np.isin(sets, list(WALL_SETS))
    shift = np.mean((numbers["true_thickness"] - numbers["usual_mm"])[usual])
    return share, coefficients, np.std(left), np.std(without), range_mm, shift


def committed():
    values = {}
    for line in CONSTANTS.read_text().splitlines():
        line = line.strip().rstrip(",;")
        if line.startswith("pub(super) const") and "f64" in line:
            values[line.split()[2].rstrip(":")] = float(line.split("=")[1])
        elif line.count(":") == 1 and not line.startswith("/") and line.split(":")[1].strip()[:1] in "-[0123456789":
            name, value = line.split(":")
            values[name] = [float(x) for x in value.strip(" []").split(",")]
    return values


def check(path):
    numbers, sets = table(path)
    known = committed()
    values = terms(numbers, known["range_mm"])
    found = resolutions(numbers, known["SLAB_SHARE"])
    mean = values @ [known[name][0] for name in ("usual_mm", "per_squared_noise_length", "per_log_cavity")]
    off, thickness = found - mean, numbers["true_thickness"]
    blurred = found > LEAST_RESOLUTION_MM
    off = off[blurred]
    print(
        f"{len(off)} hearts: resolution off by {off.mean():+.2f} +- {off.std():.2f} mm (constant {known['sd_mm'][0]}), "
        f"correlation with the thickness {np.corrcoef(off, thickness[blurred])[0, 1]:.2f}"
    )
    error = numbers["thickness"] - thickness
    within = (thickness >= numbers["least_thickness"]) & (thickness <= numbers["greatest_thickness"])
    for name in sorted(set(sets)):
        of = sets == name
        slope = np.polyfit(thickness[of], numbers["thickness"][of], 1)[0]
        print(
            f"set {name}: {of.sum()} hearts of {thickness[of].mean():.1f} +- {thickness[of].std():.1f} mm, found "
            f"{error[of].mean():+.2f} +- {error[of].std():.2f} mm, slope {slope:.2f}, {np.mean(within[of]):.0%} within "
            f"the interval of 90 %"
        )


def write():
    share, coefficients, sd, without, (least, greatest), shift = estimate(*table(TABLE))
    known = committed()["MEAN_THICKNESS_SHIFT_MM"]
    CONSTANTS.write_text(f"""\
//! Constants of the mean thickness of walls. Written by `scripts/measure/calibrate_thickness.py`: do not edit.
//!
//! In: widths of walls of simulated hearts, and their true thickness. Out: the image's resolution by its noise.

use super::resolution_terms::ResolutionTerms;

/// True mean thickness of usual walls less the mean over the rays of what the calibration of walls leaves, mm.
pub(super) const MEAN_THICKNESS_SHIFT_MM: f64 = {known + shift:.2f};

/// The part of a wall's mean thickness that a slab has which looks as wide.
pub(super) const SLAB_SHARE: f64 = {share:.2f};

/// The resolution of an image.
pub(super) const RESOLUTION: ResolutionTerms = ResolutionTerms {{
    usual_mm: {coefficients[0]:.2f},
    per_squared_noise_length: {coefficients[1]:.3f},
    per_log_cavity: {coefficients[2]:.2f},
    sd_mm: {sd:.2f},
    sd_without_noise_mm: {without:.2f},
    range_mm: [{least:.1f}, {greatest:.1f}],
}};
""")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", nargs="?", const=TABLE, type=pathlib.Path, help="as `volumes` prints")
    parser.add_argument("--write", action="store_true", help="write the constants")
    arguments = parser.parse_args()
    if arguments.write:
        write()
    check(arguments.check or TABLE)


if __name__ == "__main__":
    main()
