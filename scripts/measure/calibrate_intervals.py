#!/usr/bin/env python3
"""Estimates how far volumes and ejection fraction may be off, from tables of simulated hearts.

    calibrate_intervals.py --check [NAME TABLE]  how many true figures lie within the committed intervals; of the TABLE
                                                 NAME, `beats` or `volumes`, or of the committed ones
    calibrate_intervals.py --write [NAME...]     estimates the constants from the committed tables (or from these) and
                                                 writes them

The tables are what the programs `beats` and `volumes` print; calibrate_all.py makes them. beats.csv of
scripts/measure/calibration, for crates/ventriform/src/heart/beat/calibration.rs, has 56 gated studies, of the sets
BEATS and BEATS_OF_THICKNESS of calibrate_all.py; volumes.csv, for
crates/ventriform/src/heart/judge/volume_calibration.rs, the 283 hearts of its sets OF_VOLUMES and OF_THICKNESS. One
table after the other:

    cargo run --release -p ventriform-evaluation --bin simulate -- gated --out CASES --seed 500 --n 20
    cargo run --release -p ventriform-evaluation --bin beats -- CASES/* > TABLE
    cargo run --release -p ventriform-evaluation --bin simulate -- walls --out CASES/6001 --seed 6001 --n 120
    cargo run --release -p ventriform-evaluation --bin volumes -- CASES/... > TABLE

An error is found minus true (EF, points) or found over true minus 1 (volumes). Its variance is usual^2 + (dark share)^2
+ (small 60 ml / cavity)^2 + (thickness cause)^2, by maximum likelihood of Student's t with 4 degrees of freedom, scaled
so that nine of ten errors of each set lie within the interval: lost fits leave the rest as it is. The cause is what one
standard deviation of the wall's mean thickness makes of the figure: the share of the wall, or as much of the cavity.
"""

import argparse
import csv
import pathlib

import numpy as np
from scipy.optimize import minimize

ROOT = pathlib.Path(__file__).resolve().parents[2]
TABLES = ROOT / "scripts/measure/calibration"
SMALL_CAVITY_ML, HALF_WIDTH_SDS, DEGREES = 60.0, 1.645, 4
TERMS = ("bias", "usual", "dark", "small", "thickness")
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


def rows_of(table):
    """The rows of a table as `beats` and `volumes` print it, without what follows it."""
    with open(table, newline="") as file:
        return list(csv.DictReader([line for line in file if line.count(",") > 5]))


def errors_of(name, rows):
    """-> error of each figure with its causes (size of the cavity, share of the wall that is dark, what one standard
    deviation of the thickness makes of the figure), and the set of each row."""
    _, _, _, cavity, figures = FILES[name]

    def column(name):
        return np.array([float(row[name]) for row in rows])

    of = {}
    for constant, (figure, _) in figures.items():
        found, true = column(figure), column(f"true_{figure}")
        error = found - true if figure == "ef" else found / true - 1
        thickness = column("thickness_sd") / column("thickness") if name == "volumes" else column("thickness_share")
        if figure != "wall":
            beside = "edv" if figure == "ef" else figure
            thickness = thickness * column("wall") / np.maximum(column(beside), 1)
        if figure == "ef":
            thickness = 100 * thickness
        of[constant] = error, (column(cavity), np.clip(column("dark"), 0, 1), thickness)
    return of, np.array([row.get("set", "") for row in rows])


def deviation(terms, causes):
    _, usual, of_dark, small, of_thickness = terms
    cavity, dark, thickness = causes
    of_size = small * SMALL_CAVITY_ML / np.maximum(cavity, 1)
    return np.sqrt(usual**2 + (of_dark * dark) ** 2 + of_size**2 + (of_thickness * thickness) ** 2)


def estimate(sets, error, causes):
    def cost(terms):
        sd = deviation(terms, causes)
        off = (error - terms[0]) / sd
        return np.sum(np.log(sd) + (DEGREES + 1) / 2 * np.log1p(off**2 / DEGREES))

    scale = error.std()
    starts = [
        (error.mean(), scale * a, scale * b, scale * c, 0.5) for a in (0.5, 1) for b in (0.5, 3) for c in (0.3, 1)
    ]
    found = min(
        (minimize(cost, s, method="Nelder-Mead", options=dict(maxiter=4000, xatol=1e-6, fatol=1e-6)) for s in starts),
        key=lambda f: f.fun,
    )
    terms = [found.x[0], *np.abs(found.x[1:])]
    off = np.abs(error - terms[0]) / deviation(terms, causes)
    scale = max(np.quantile(off[sets == name], 0.9) for name in set(sets)) / HALF_WIDTH_SDS
    return [terms[0], *(scale * term for term in terms[1:])]


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


def in_deviations(name, rows):
    """-> of each figure the errors of the rows, and their size in standard deviations by the committed constants."""
    terms = committed(name)
    return {
        constant: (error, np.abs(error - terms[constant][0]) / deviation(terms[constant], causes))
        for constant, (error, causes) in errors_of(name, rows)[0].items()
    }


def report(name, table):
    for constant, (_, off) in in_deviations(name, rows_of(table)).items():
        print(
            f"{constant}: {np.mean(off < HALF_WIDTH_SDS):.0%} of {len(off)} within the interval of 90 %; standard "
            f"deviation of error over deviation {np.sqrt(np.mean(off**2)):.2f}"
        )


def write(name):
    path, head, method, _, figures = FILES[name]
    of, sets = errors_of(name, rows_of(TABLES / f"{name}.csv"))
    text = (
        f"{head} Written by `scripts/measure/calibrate_intervals.py`: do not edit.\n//!\n{method}\n\nuse "
        f"crate::base::numeric::error_terms::ErrorTerms;\n"
    )
    for constant, (_, doc) in figures.items():
        terms = zip(TERMS, estimate(sets, *of[constant]))
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
