#!/usr/bin/env python3
"""Estimates the constants of crates/ventriform/src/heart/judge/calibration.rs from a table of features.

    calibrate.py --check                    compare an estimate from the table with the constants as committed
    calibrate.py --write [MODEL...]         write the file with the constants estimated from the table
    calibrate.py --reliability              how often fits are good, by the chance that constants from other scans give
                                            them
    calibrate.py --held-out --table TABLE   the same by the committed constants, of scans that those do not come from
    calibrate.py --layout                   write the file again with the constants as they are

The table (scripts/measure/calibration/features.csv, --table for another one) has one row for each scan. It is made by
calibrate_all.py, which lists the sets, or one set after the other by

    cargo run --release -p ventriform-evaluation --bin simulate -- cases --out CASES/SET --seed SET --n N [--kinds ...]
    cargo run --release -p ventriform-evaluation --bin calibration_features -- CASES/SET... > features.csv

Each model is a logistic regression by maximum likelihood, with a ridge of 1 on the standardised terms and none on the
intercept. Terms of the first four models are standardised by mean and standard deviation over the scans that the
model is estimated from, and kept within four standard deviations; those of the others enter as they are.

{reproduced}
"""

import argparse
import csv
import math
import pathlib
import re
import sys

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
OUTPUT = ROOT / "crates/ventriform/src/heart/judge/calibration.rs"
TABLE = ROOT / "scripts/measure/calibration/features.csv"
# Size of a cavity from which that of others is counted.
USUAL_CAVITY_ML = 55.0

REPRODUCED = """\
The committed table is of an older simulator with the same kinds of scans (docs/log/evaluation.md,
"The simulator"). It has its cohort, 316 scans of its seeds 2101, 701, 911, 2103 and 411 (42 scans each of
all kinds), 1101 with 28, 2104 with 14, 702 with 18 (motion,rv,infarct), 1102 with 18 (motion), 703 with 14 (rv), 704
with 14 (motion,apex), the first 111 of seed 5001 (all kinds), and 1000 of seed 9301 (all kinds; the simulator's draw()
with a matrix of 64 and a spacing of 6.0, 6.4 or 6.8 mm). The constants of GOOD_SET_* are estimated from all of it:
--check shows equal ones. The others are older. Seeds, models and terms are those of the committed constants, three
things are not: how many scans of a seed had been taken and of which kinds was not written down; the constants were
estimated one after the other, on fits of the versions of their time (the mean of ln thickness spread, 0.61 then, is
0.44 now); and the scans whose heart was erased, 59 with those of kind none in HEART_FITTED, are not in the table. So
the estimate is near, not equal. On this table the logarithms of the odds by committed and by estimated constants
correlate by 0.89 (BAD_FIT_ANATOMICAL) to 1.00, the chances differ by 0.01 (MOTION_BY_PROJECTIONS) to 0.10
(BAD_FIT_ANATOMICAL) in the mean, and the areas under the curve by -0.001 to 0.025. HEART_FITTED has the intercept 3.5
instead of 1.6, for want of scans without a heart: do not --write it from this table. --write MODEL... writes some."""

# Sets of the simulator, by the seed that they were made with. "cohort" is the cohort of 19 hearts.
ONE_FIT = ["cohort", "411", "701", "702"]
SHAPE = [*ONE_FIT, "703", "704"]
PROJECTIONS = ["911", "1101", "1102"]
SIZE = ["cohort", "2101", "2103", "2104"]
EVERY_SET = [*SHAPE, *PROJECTIONS, "2101", "2103", "2104", "5001", "9301"]


def good(wall):
    """1 for a good fit of the wall, None for a refused scan or one without a heart."""
    return lambda row: (
        None if row[f"jaccard_{wall}"] is None or not row["heart"] else float(row[f"jaccard_{wall}"] >= 0.75)
    )


def bad(wall):
    return lambda row: None if good(wall)(row) is None else 1.0 - good(wall)(row)


def moved(row):
    return None if row["jaccard_apparent"] is None or not row["heart"] else float(row["motion_mm"] > 0)


def is_heart(row):
    """1 for a fit that meets the wall, 0 for one beside it or in a scan without a heart.

    A refused scan with a heart is left out: the table does not say whether the search had found the heart."""
    if not row["heart"]:
        return 0.0
    return None if row["jaccard_anatomical"] is None else float(row["jaccard_anatomical"] >= 0.3)


def log(name, least):
    return lambda row: math.log(max(row[name], least))


def log_gain(row):
    return math.log(min(max(row["gain"], 0.0), 1.0) + 0.01)


def figure(name):
    return lambda row: row[name]


def of_shape(row):
    """Logarithm of the odds of motion by the shape of the wall, by the committed constants."""
    model = MODELS["MOTION_BY_SHAPE"]
    intercept, terms = committed()["MOTION_BY_SHAPE"]
    values = [value(row) for value in model["terms"].values()]
    z = [max(-4.0, min(4.0, (x - t["mean"]) / t["sd"])) * t["weight"] for x, t in zip(values, terms)]
    chance = 1 / (1 + math.exp(-intercept - sum(z)))
    return math.log((chance + 0.01) / (1.01 - chance))


def log_size(row):
    """Logarithm of the cavity's size over a usual one's."""
    return math.log(max(row["cavity_ml"], 1.0) / USUAL_CAVITY_ML)


def of_set(wall):
    """Terms of a good fit by several models. The wall of a small or a large heart agrees less with a fitted one that
    lies off by as much."""
    return {
        "mean log odds": figure(f"log_odds_{wall}"),
        f"ln cavity / {USUAL_CAVITY_ML:g} ml": log_size,
        "its square": lambda row: log_size(row) ** 2,
    }


OF_VIEWS = {"dark": figure("dark"), "ln gain": log_gain}
OF_FIT = {
    "active": figure("active"),
    "ln thickness spread / mm": log("thickness_spread_mm", 0.1),
    "strain": figure("strain"),
    "ln unroundness": log("unroundness", 1e-3),
    "hollowness": figure("hollowness"),
}

MODELS = {
    "BAD_FIT_APPARENT": dict(
        doc="A fit of the apparent wall with a Jaccard index below 0.75.",
        sets=ONE_FIT,
        target=bad("apparent"),
        terms=OF_FIT,
    ),
    "BAD_FIT_ANATOMICAL": dict(
        doc="A fit of the anatomical wall with a Jaccard index below 0.75.",
        sets=ONE_FIT,
        target=bad("anatomical"),
        terms=OF_FIT,
    ),
    "MOTION_BY_SHAPE": dict(
        doc="Motion, by the shape of the wall.",
        sets=SHAPE,
        target=moved,
        terms={
            "active": figure("active"),
            "ln thickness spread / mm": log("thickness_spread_mm", 0.1),
            "ln cavity / ml": log("cavity_ml", 0.1),
            "slenderness": figure("slenderness"),
            "ln unroundness": log("unroundness", 1e-3),
            "offset": figure("offset"),
            "dark": figure("dark"),
            "beside": figure("beside"),
        },
    ),
    "HEART_FITTED": dict(
        doc="A left ventricle where the model was fitted.",
        sets=SIZE,
        target=is_heart,
        terms={"hollowness": figure("hollowness"), "agreement": figure("agreement"), "search": figure("search")},
    ),
    "GOOD_SET_APPARENT": dict(
        doc="A good fit of the apparent wall, by the fits of several models, without projections.",
        sets=EVERY_SET,
        raw=True,
        target=good("apparent"),
        terms=of_set("apparent"),
    ),
    "GOOD_SET_ANATOMICAL": dict(
        doc="A good fit of the anatomical wall, likewise.",
        sets=EVERY_SET,
        raw=True,
        target=good("anatomical"),
        terms=of_set("anatomical"),
    ),
    "GOOD_SET_APPARENT_BY_PROJECTIONS": dict(
        doc="A good fit of the apparent wall, by the fits of several models and the projections.",
        sets=EVERY_SET,
        raw=True,
        target=good("apparent"),
        terms={**of_set("apparent"), **OF_VIEWS},
    ),
    "GOOD_SET_ANATOMICAL_BY_PROJECTIONS": dict(
        doc="A good fit of the anatomical wall, likewise.",
        sets=EVERY_SET,
        raw=True,
        target=good("anatomical"),
        terms={**of_set("anatomical"), **OF_VIEWS},
    ),
    "MOTION_BY_PROJECTIONS": dict(
        doc="Motion, by the projections and the shape of the wall.",
        sets=PROJECTIONS,
        raw=True,
        target=moved,
        terms={"ln gain": log_gain, "log odds by shape": of_shape},
    ),
}

HEADER = f"""\
//! Constants of the logistic models. Written by `scripts/measure/calibrate.py`: do not edit.
//!
//! In: figures of fits to simulated hearts. Out: for each model of `confidence.rs` the intercept, and
//! of each term the mean and the standard deviation over the calibration set and the weight.

use super::logistic::{{Logistic, Term}};

/// Size of a cavity, ml, from which that of others is counted.
pub const USUAL_CAVITY_ML: f64 = {USUAL_CAVITY_ML};

"""


def committed():
    """{model: (intercept, terms)} of the file as it is."""
    number = r"(-?[0-9.]+)"
    models = {}
    for name, intercept, body in re.findall(
        rf"const (\w+): Logistic = Logistic {{\s+intercept: {number},\s+terms: &\[(.*?)\],\n", OUTPUT.read_text(), re.S
    ):
        terms = re.findall(rf'Term::new\("([^"]+)", {number}, {number}, {number}\)', body)
        models[name] = (
            float(intercept),
            [dict(name=n, mean=float(m), sd=float(s), weight=float(w)) for n, m, s, w in terms],
        )
    return models


def literal(x, digits):
    text = f"{x:.{digits}f}".rstrip("0")
    return text + "0" if text.endswith(".") else text


def layout(models):
    text = HEADER
    for name, model in MODELS.items():
        intercept, terms = models[name]
        calls = [
            f'Term::new("{t["name"]}", {literal(t["mean"], 4)}, {literal(t["sd"], 4)}, {literal(t["weight"], 3)})'
            for t in terms
        ]
        array = (
            f"[{calls[0]}]" if len(calls) == 1 else "[\n" + "".join(f"        {call},\n" for call in calls) + "    ]"
        )
        text += (
            f"/// {model['doc']}\npub const {name}: Logistic = Logistic {{\n    intercept: "
            f"{literal(intercept, 3)},\n    terms: &{array},\n}};\n\n"
        )
    return text.rstrip("\n") + "\n"


def rows(path):
    with open(path, newline="") as file:
        for row in csv.DictReader(line for line in file if not line.startswith("#")):
            yield {k: v if k in ("set", "case") else (float(v) if v else None) for k, v in row.items()}


def logistic(x, y, ridge):
    """Intercept and weights that maximise the likelihood less half of ridge times their squares (Newton)."""
    design = np.column_stack([np.ones(len(y)), x])
    beta = np.zeros(design.shape[1])
    penalty = np.diag([0.0] + [ridge] * x.shape[1])
    for _ in range(100):
        p = 1 / (1 + np.exp(-design @ beta))
        step = np.linalg.solve(design.T * (p * (1 - p)) @ design + penalty, design.T @ (y - p) - penalty @ beta)
        beta += step
        if np.abs(step).max() < 1e-10:
            break
    return beta[0], beta[1:]


def auc(score, y):
    """Share of pairs of a 1 and a 0 of which the 1 has the greater score."""
    ones, zeros = score[y == 1], score[y == 0]
    return (
        float(np.mean(ones[:, None] > zeros) + 0.5 * np.mean(ones[:, None] == zeros))
        if len(ones) and len(zeros)
        else math.nan
    )


def selected(model, table):
    """Figures and targets of the scans that a model is estimated from."""
    figures, targets = [], []
    for row in table:
        target = model["target"](row)
        needed = row["set"] in model["sets"] and target is not None
        try:
            values = [value(row) for value in model["terms"].values()] if needed else [None]
        except TypeError:  # a figure that the scan does not have
            values = [None]
        if needed and None not in values:
            figures.append(values)
            targets.append(target)
    return np.array(figures), np.array(targets)


def estimate(model, table):
    x, y = selected(model, table)
    mean, sd = x.mean(axis=0), x.std(axis=0)
    z = (x - mean) / sd
    if not model.get("raw"):
        z = z.clip(-4, 4)
    intercept, weights = logistic(z, y, ridge=1.0)
    if model.get("raw"):
        weights = weights / sd
        intercept -= weights @ mean
        mean, sd = np.zeros(len(mean)), np.ones(len(sd))
    terms = [dict(name=n, mean=m, sd=s, weight=w) for n, m, s, w in zip(model["terms"], mean, sd, weights)]
    return (intercept, terms), (x, y)


def log_odds(model, constants, x):
    intercept, terms = constants
    z = (x - [t["mean"] for t in terms]) / [t["sd"] for t in terms]
    return intercept + (z if model.get("raw") else z.clip(-4, 4)) @ [t["weight"] for t in terms]


def compare(table):
    """Prints committed and estimated constants, and what the difference does to the chances of the same scans."""
    before = committed()
    for name, model in MODELS.items():
        after, (x, y) = estimate(model, table)
        old, new = (log_odds(model, constants, x) for constants in (before[name], after))
        chance = [1 / (1 + np.exp(-o)) for o in (old, new)]
        print(f"{name}: {len(y)} scans, {int(y.sum())} of them 1 (sets {', '.join(model['sets'])})")
        print(f"  {'':26}{'committed':>27}{'estimated':>27}{'weight differs by':>20}")
        print(f"  {'intercept':26}{before[name][0]:27.3f}{after[0]:27.3f}{after[0] - before[name][0]:+20.3f}")
        for a, b in zip(before[name][1], after[1]):
            cells = [f"{t['mean']:9.4f} {t['sd']:8.4f} {t['weight']:8.3f}" for t in (a, b)]
            print(f"  {a['name']:26}{cells[0]:>27}{cells[1]:>27}{b['weight'] - a['weight']:+20.3f}")
        print(
            f"  area under the curve {auc(old, y):.3f} committed, {auc(new, y):.3f} estimated (in-sample); chances "
            f"differ by "
            f"{np.mean(np.abs(chance[0] - chance[1])):.3f} in the mean, {np.abs(chance[0] - chance[1]).max():.3f} "
            f"at most, "
            f"correlation of the log odds {np.corrcoef(old, new)[0, 1]:.3f}\n"
        )


FOLDS = 10


def chances(model, constants, table):
    """Chance of each scan by `constants`; its target; whether the patient moved."""
    for row in table:
        x, y = selected(model, [row])
        if len(y):
            yield 1 / (1 + math.exp(-log_odds(model, constants, x)[0])), y[0], row["motion_mm"] > 0


def left_out(name, table):
    """`chances` by constants estimated from the other scans, a tenth of them left out at a time."""
    for fold in range(FOLDS):
        constants, _ = estimate(MODELS[name], [row for n, row in enumerate(table) if n % FOLDS != fold])
        yield from chances(MODELS[name], constants, table[fold::FOLDS])


def held_out(name, table):
    """`chances` by the committed constants, of scans of any set: none of them may be in the table that those come
    from."""
    return chances({**MODELS[name], "sets": {row["set"] for row in table}}, committed()[name], table)


def reliability(table, chances_of):
    """Prints how often fits are good, by the tenth of the chance that `chances_of` gives them."""
    for name in ("GOOD_SET_APPARENT_BY_PROJECTIONS", "GOOD_SET_ANATOMICAL_BY_PROJECTIONS"):
        p, y, moved = (np.array(column) for column in zip(*chances_of(name, table)))
        print(
            f"{name}: {len(y)} scans, {int((1 - y).sum())} of them bad; area under the curve {auc(p, y):.3f}, of the "
            f"{int((~moved).sum())} without motion ({int((1 - y[~moved]).sum())} bad) {auc(p[~moved], y[~moved]):.3f}; "
            f"Brier score {np.mean((p - y) ** 2):.3f}"
        )
        for tenth in range(10):
            inside = (10 * p).astype(int).clip(0, 9) == tenth
            if inside.any():
                error = math.sqrt(max(p[inside].mean() * (1 - p[inside].mean()), 1e-9) / inside.sum())
                print(
                    f"  {tenth / 10:.1f} to {(tenth + 1) / 10:.1f}: {int(inside.sum()):4} scans, mean chance "
                    f"{p[inside].mean():.2f}, "
                    f"good {y[inside].mean():.2f} (standard error {error:.2f})"
                )


def main():
    doc = __doc__.replace("{reproduced}", REPRODUCED)
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--table", type=pathlib.Path, default=TABLE, help="table of features (CSV)")
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument(
        "--check",
        action="store_true",
        help="compare the estimate with the constants as committed; 1 if the file is not laid out as --layout would",
    )
    action.add_argument(
        "--write",
        nargs="*",
        choices=MODELS,
        metavar="MODEL",
        help="write the estimated constants of all models or of these",
    )
    action.add_argument(
        "--reliability",
        action="store_true",
        help="how often fits are good that have a chance, each tenth of the scans left out in turn",
    )
    action.add_argument(
        "--held-out",
        action="store_true",
        help="the same by the committed constants, of scans (--table) that those do not come from",
    )
    action.add_argument("--layout", action="store_true", help="write the committed constants again")
    a = parser.parse_args()
    if a.layout:
        OUTPUT.write_text(layout(committed()))
        return 0
    table = list(rows(a.table))
    if a.reliability or a.held_out:
        reliability(table, left_out if a.reliability else held_out)
        return 0
    if a.write is not None:
        chosen, before = a.write or MODELS, committed()
        OUTPUT.write_text(
            layout(
                {name: estimate(model, table)[0] if name in chosen else before[name] for name, model in MODELS.items()}
            )
        )
        return 0
    compare(table)
    if OUTPUT.read_text() != layout(committed()):
        print(f"{OUTPUT.relative_to(ROOT)} was edited by hand: run calibrate.py --layout", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
