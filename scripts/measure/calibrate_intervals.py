#!/usr/bin/env python3
"""Estimates how far volumes and ejection fraction may be off, from tables of simulated hearts.

    calibrate_intervals.py --check [NAME TABLE]  how many true figures lie within the committed intervals; of the TABLE
                                                 NAME, `beats` or `volumes`, or of the committed ones
    calibrate_intervals.py --write [NAME...]     estimates the constants from the committed tables (or from these) and
                                                 writes them

The tables are what the programs `beats` and `volumes` print; calibrate_all.py makes them. beats.csv of
scripts/measure/calibration, for crates/ventriform/src/heart/beat/calibration.rs, has 40 gated studies; volumes.csv, for
crates/ventriform/src/heart/judge/volume_calibration.rs, 118 scans. The committed tables are of an older simulator with
the same kinds of hearts. One table after the other:

    cargo run --release -p ventriform-evaluation --bin simulate -- gated --out CASES --seed 500 --n 20
    cargo run --release -p ventriform-evaluation --bin beats -- CASES/* > TABLE
    cargo run --release -p ventriform-evaluation --bin simulate -- cases --out CASES --seed 5001 --n 118
    cargo run --release -p ventriform-evaluation --bin volumes -- CASES > TABLE

An error is found minus true (EF, points) or found over true minus 1 (volumes). Its variance is usual^2 + (dark share)^2
+ (small 60 ml / cavity)^2, by maximum likelihood of a normal distribution.
"""

import argparse
import csv
import pathlib

import numpy as np
from scipy.optimize import minimize

ROOT = pathlib.Path(__file__).resolve().parents[2]
TABLES = ROOT / "scripts/measure/calibration"
SMALL_CAVITY_ML, HALF_WIDTH_SDS = 60.0, 1.645
TERMS = ("bias", "usual", "dark", "small")
# For each table: the file of the constants with their visibility and the head of its page, the columns of cavity and
# dark share, and for each constant the figure's column and what it is.
FILES = {
    "beats": (
        ROOT / "crates/ventriform/src/heart/beat/calibration.rs",
        "//! Constants of the intervals about the figures of a beat.",
        "//! In: figures of fits to simulated gated studies, and the true ones. Out: mean and deviation of the error.",
        "edv",
        {
            "EF_ERROR": ("ef", "Error of the ejection fraction, points."),
            "EDV_ERROR": ("edv", "Error of the end-diastolic volume, as a share of it."),
            "ESV_ERROR": ("esv", "Error of the end-systolic volume, as a share of it."),
        },
    ),
    "volumes": (
        ROOT / "crates/ventriform/src/heart/judge/volume_calibration.rs",
        "//! Constants of the intervals about the volumes of a fit.",
        "//! In: volumes of fits to simulated hearts, and the true ones. Out: mean and deviation of the error.",
        "cavity",
        {
            "WALL_ERROR": ("wall", "Error of the volume of the anatomical wall, as a share of it."),
            "CAVITY_ERROR": ("cavity", "Error of the volume of its cavity, as a share of it."),
        },
    ),
}


def errors(name, table):
    """-> error of each figure, size of the cavity that was found, share of the wall that is dark."""
    _, _, _, cavity, figures = FILES[name]
    with open(table, newline="") as file:
        lines = [line for line in file if line.count(",") > 5]
    rows = list(csv.DictReader(lines))

    def column(name):
        return np.array([float(row[name]) for row in rows])

    of = {}
    for constant, (figure, _) in figures.items():
        found, true = column(figure), column(f"true_{figure}")
        of[constant] = found - true if figure == "ef" else found / true - 1
    return of, column(cavity), np.clip(column("dark"), 0, 1)


def deviation(terms, cavity, dark):
    _, usual, of_dark, small = terms
    return np.sqrt(usual**2 + (of_dark * dark) ** 2 + (small * SMALL_CAVITY_ML / cavity) ** 2)


def estimate(error, cavity, dark):
    def cost(terms):
        sd = deviation(terms, cavity, dark)
        return np.sum(np.log(sd) + 0.5 * ((error - terms[0]) / sd) ** 2)

    scale = error.std()
    starts = [(error.mean(), scale * a, scale * b, scale * c) for a in (0.5, 1) for b in (0.5, 3) for c in (0.3, 1)]
    found = min(
        (minimize(cost, s, method="Nelder-Mead", options=dict(maxiter=4000, xatol=1e-6, fatol=1e-6)) for s in starts),
        key=lambda f: f.fun,
    )
    return [found.x[0], *np.abs(found.x[1:])]


def committed(name):
    """-> terms of each figure as they stand in the file of the constants."""
    terms, constant = {}, None
    for line in FILES[name][0].read_text().splitlines():
        if line.startswith("pub"):
            constant = line.split()[2].rstrip(":")
            terms[constant] = []
        elif constant and ":" in line and not line.startswith("//"):
            terms[constant].append(float(line.split(":")[1].strip(" ,")))
    return terms


def report(name, table):
    of, cavity, dark = errors(name, table)
    terms = committed(name)
    for constant, error in of.items():
        off = np.abs(error - terms[constant][0]) / deviation(terms[constant], cavity, dark)
        print(
            f"{constant}: {np.mean(off < HALF_WIDTH_SDS):.0%} of {len(off)} within the interval of 90 %; standard "
            f"deviation of error over deviation {np.sqrt(np.mean(off**2)):.2f}"
        )


def write(name):
    path, head, method, _, figures = FILES[name]
    of, cavity, dark = errors(name, TABLES / f"{name}.csv")
    text = (
        f"{head} Written by `scripts/measure/calibrate_intervals.py`: do not edit.\n//!\n{method}\n\nuse "
        f"crate::base::numeric::error_terms::ErrorTerms;\n"
    )
    for constant, (_, doc) in figures.items():
        terms = zip(TERMS, estimate(of[constant], cavity, dark))
        fields = "".join(f"    {key}: {float(f'{value:.3f}')},\n" for key, value in terms)
        text += f"\n/// {doc}\npub(super) const {constant}: ErrorTerms = ErrorTerms {{\n{fields}}};\n"
    path.write_text(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", nargs="*", metavar="NAME TABLE", help="a table as `beats` or `volumes` prints it")
    parser.add_argument("--write", nargs="*", choices=FILES, metavar="NAME", help="write the constants")
    arguments = parser.parse_args()
    if arguments.check and (len(arguments.check) != 2 or arguments.check[0] not in FILES):
        parser.error("--check: give `beats` or `volumes` and a table, or nothing")
    if arguments.write is not None:
        for name in arguments.write or FILES:
            write(name)
    if arguments.check:
        report(*arguments.check)
    else:
        for name in FILES:
            report(name, TABLES / f"{name}.csv")


if __name__ == "__main__":
    main()
