#!/usr/bin/env python3
"""Estimates how far EF, EDV and ESV of beats may be off, from a table of simulated studies.

    calibrate_beats.py --check [TABLE]      how many true figures of TABLE lie within the committed intervals
    calibrate_beats.py --write              estimates the constants from scripts/calibration/beats.csv and writes
                                            crates/ventriform/src/beat/calibration.rs

A table is what the tool `beats` prints; the committed one has the studies of seeds 500 and 501, 20 each, and the set "dev" of the
simulator of gated hearts (no part of this project):

    gated.py --out CASES --seed 500 --n 20
    cargo run --release -p ventriform-tools --bin beats -- CASES/* > TABLE

An error is found minus true (EF, points) or found over true minus 1 (volumes). Its variance is usual^2 + (dark share)^2
+ (small 60 ml / EDV)^2, by maximum likelihood of a normal distribution.
"""
import argparse
import csv
import pathlib

import numpy as np
from scipy.optimize import minimize

ROOT = pathlib.Path(__file__).resolve().parent.parent
TABLE = ROOT / "scripts/calibration/beats.csv"
CONSTANTS = ROOT / "crates/ventriform/src/beat/calibration.rs"
SMALL_EDV_ML, HALF_WIDTH_SDS = 60.0, 1.645
HEADER = '''\
//! Constants of the intervals about the figures of a beat. Written by `scripts/calibrate_beats.py`: do not edit.
//!
//! In: figures of fits to simulated gated studies, and the true ones. Out: mean and deviation of the error.

use super::error_terms::ErrorTerms;
'''
FIGURES = {
    "EF_ERROR": "Error of the ejection fraction, points.",
    "EDV_ERROR": "Error of the end-diastolic volume, as a share of it.",
    "ESV_ERROR": "Error of the end-systolic volume, as a share of it.",
}


def errors(table):
    """-> error of each figure, EDV found, share of the wall that is dark."""
    with open(table, newline="") as file:
        lines = [line for line in file if line.count(",") > 8]
    rows = list(csv.DictReader(lines))
    column = lambda name: np.array([float(row[name]) for row in rows])
    of = {"EF_ERROR": column("ef") - column("true_ef")}
    for name in ("edv", "esv"):
        of[f"{name.upper()}_ERROR"] = column(name) / column(f"true_{name}") - 1
    return of, column("edv"), column("dark")


def deviation(terms, edv, dark):
    _, usual, of_dark, small = terms
    return np.sqrt(usual**2 + (of_dark * dark) ** 2 + (small * SMALL_EDV_ML / edv) ** 2)


def estimate(error, edv, dark):
    def cost(terms):
        sd = deviation(terms, edv, dark)
        return np.sum(np.log(sd) + 0.5 * ((error - terms[0]) / sd) ** 2)

    scale = error.std()
    starts = [(error.mean(), scale * a, scale * b, scale * c) for a in (0.5, 1) for b in (0.5, 3) for c in (0.3, 1)]
    found = min((minimize(cost, s, method="Nelder-Mead", options=dict(maxiter=4000, xatol=1e-6, fatol=1e-6)) for s in starts), key=lambda f: f.fun)
    return [found.x[0], *np.abs(found.x[1:])]


def committed():
    """-> terms of each figure as they stand in calibration.rs."""
    terms, name = {}, None
    for line in CONSTANTS.read_text().splitlines():
        if line.startswith("pub"):
            name = line.split()[2].rstrip(":")
            terms[name] = []
        elif name and ":" in line and not line.startswith("//"):
            terms[name].append(float(line.split(":")[1].strip(" ,")))
    return terms


def report(terms, table):
    of, edv, dark = errors(table)
    for name, error in of.items():
        off = np.abs(error - terms[name][0]) / deviation(terms[name], edv, dark)
        print(f"{name}: {np.mean(off < HALF_WIDTH_SDS):.0%} of {len(off)} within the interval of 90 %; standard deviation of error over deviation {np.sqrt(np.mean(off**2)):.2f}")


def write(terms):
    text = HEADER
    for name, doc in FIGURES.items():
        values = dict(zip(("bias", "usual", "dark", "small"), terms[name]))
        fields = "".join(f"    {key}: {float(f'{value:.3f}')},\n" for key, value in values.items())
        text += f"\n/// {doc}\npub(super) const {name}: ErrorTerms = ErrorTerms {{\n{fields}}};\n"
    CONSTANTS.write_text(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", nargs="?", const=TABLE, metavar="TABLE", help="a table as `beats` prints it")
    parser.add_argument("--write", action="store_true", help="write the constants")
    arguments = parser.parse_args()
    if arguments.write:
        of, edv, dark = errors(TABLE)
        write({name: estimate(error, edv, dark) for name, error in of.items()})
    report(committed(), arguments.check or TABLE)


if __name__ == "__main__":
    main()
