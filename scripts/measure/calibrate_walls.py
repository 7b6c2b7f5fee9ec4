#!/usr/bin/env python3
"""Estimates the constants of rims, walls and nodes from tables of features.

    calibrate_walls.py --check              compare an estimate from the tables with the constants as committed
    calibrate_walls.py --write [NAME...]    write the files with the constants (of these names) estimated from the
                                            tables
    calibrate_walls.py --layout             write the files again with the constants as they are

The files are heart/deform/calibration.rs and heart/judge/uncertainty_calibration.rs of crates/ventriform/src.
The tables (scripts/measure/calibration/{rims,signal_ends,rays,nodes,smoothness}.csv, --tables for another folder) are
made by calibrate_all.py, which lists the sets, or one set after the other by

    cargo run --release -p ventriform-evaluation --bin simulate -- cases --out CASES/SET --seed SET --n N [--kinds ...]
    cargo run --release -p ventriform-evaluation --bin wall_features -- TABLES CASES/SET...
    cargo run --release -p ventriform-evaluation --bin smoothness_features -- TABLES/smoothness.csv CASES/SET...

- RIM_SHAPE: mean and inverse covariance of the harmonics of the true rims, each by least squares, over the heart's
  length.
- RIM_REGRESSION: ridge regression (a weight of {RIDGE:g} on standardised terms) of the coefficients of the distance
  from the sensed to the true rim, by the heart's length, the coefficients of what shape and correction make of the rim,
  and those of where the image's signal ends. signal_ends.csv has its own hearts.
- RIM_DEVIATION: weighted least squares of the squared errors of that regression, each tenth of the hearts left out, by
  the square of the scatter of the directions' own ends.
- RIM_CORRECTION: least squares of the distance from the sensed to the true rim, by the distance of the sensed rim from
  its shape. Bend and range are chosen, not estimated.
- INNER_SHIFT_MM, OUTER_SHIFT_MM: least squares of the distances from the apparent to the true surfaces, of the rays of
  fits in which no such distance has a median beyond 6 mm.
- NARROW_CAVITY_SHIFT, CAVITY_SIZE_SHIFT: least squares of what those leave in the mean of a heart, by the size of the
  cavity. The size from which a cavity is narrow is chosen.
- SMOOTHNESS_SHIFT: least squares of what all those leave in the mean of a fit, by the logarithm of the image's
  smoothness. Each heart has three fits: as it is and behind two further filters. The usual smoothness is the mean of
  the scans as they are, the range that of all fits.
- APPARENT_TERMS, ANATOMICAL_TERMS: quantile regression (68 %) of the logarithm of the distance of nodes from the wall.

{reproduced}
"""

import argparse
import collections
import csv
import pathlib
import re
import sys

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
WALLS = ROOT / "crates/ventriform/src/heart/deform/calibration.rs"
NODES = ROOT / "crates/ventriform/src/heart/judge/uncertainty_calibration.rs"
TABLES = ROOT / "scripts/measure/calibration"

REPRODUCED = """\
The committed tables are of an older simulator with the same kinds of scans (docs/log/evaluation.md,
"The simulator"): its cohort and the scans with a heart, not refused, of seeds 411 and 701 with
42 scans of all kinds, 702 with 18 (motion,rv,infarct), 703 with 14 (rv), 704 with 14 (motion,apex), 2101 with 42 and
2104 with 14 of all kinds. signal_ends.csv has the cohort, the first scans of seeds 9001 and 9101
(in,basal,infarct,large,rv,liver,basal,noise,gut,small,coarse,infarct) and 94 of seed 9111
(in,basal,infarct,large,rv,liver,basal,noise,gut,small,in,infarct,apex) on 64 x 64 pixels of 6.4, 6.0 and 6.8 mm in
turn. smoothness.csv has the cohort and every third scan of
the first 118 of seed 5001. docs/log/walls.md says how far the estimate is from the committed constants, and why: do
not --write it without judging the fits anew, since every result depends on them."""

# Sets of the simulator, by the seed that they were made with. "cohort" is the cohort of 19 hearts.
RIM_SETS = ["cohort", "411", "701"]
RAY_SETS = ["cohort", "411", "701"]
SIZE_SETS = ["2101", "2104"]
SMOOTHNESS_SETS = ["cohort", "5001"]
END_SETS = ["cohort", "9001", "9101", "9111"]
NODE_SETS = ["cohort", "411", "701", "702", "703", "704"]

DIRECTIONS = 30
FILTERS = 3  # fits of each heart in smoothness.csv
OUTLIER_MM, CORRELATED, ROUNDS = 4.0, 3.0, 30  # as in heart/deform/base_plane.rs
LOST_MM = 6.0
LOST_MEAN_MM = 3.0  # of a whole surface, from where it is expected
SPREAD_OFFSET_MM = 0.3
SHARE = 0.68
LEAST_DISTANCE_MM = 0.01

RAY_FIELDS = [
    "constant",
    "thickness",
    "ln_radius",
    "ln_radius_squared",
    "thickness_here",
    "narrowness_here",
    "missing_uptake",
    "missing_uptake_squared",
    "way",
    "way_squared",
    "nearness_to_apex",
]
NODE_FIELDS = ["constant", "seen", "ln_spread", "log_odds", "way", "way_squared"]
WAVES = 7  # mean, cosine and sine of one to three times the angle
RIDGE = 60.0
REGRESSION_FIELDS = ["by_shape", "of_heart", "of_direction"]
REGRESSION_RANGE_MM = [-12.0, 20.0]
DARK_ENDS_MM = [-9.0, -3.0]  # as in rim_model.rs; chosen
CORRECTION_FIELDS = ["intercept_mm", "slope", "bend_mm", "short_slope", "long_slope"]

ANGLES = 2 * np.pi * (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
BASIS = np.column_stack([np.ones(DIRECTIONS), *(f(n * ANGLES) for n in (1, 2, 3) for f in (np.cos, np.sin))])

# Name, type and description of the constants with one number for each field.
TERMS = {
    "RIM_DEVIATION": (WALLS, "RimDeviation", "Standard deviation of the height of a rim."),
    "INNER_SHIFT_MM": (WALLS, "RayTerms", "Distance by which the inner surface moves outward, mm."),
    "OUTER_SHIFT_MM": (WALLS, "RayTerms", "Distance by which the outer surface moves outward, mm."),
    "NARROW_CAVITY_SHIFT": (
        WALLS,
        "SizeShift",
        "Distance by which the inner surface moves inward of that, where the cavity looks smaller: one as narrow as "
        "the blur\n"
        "/// hardly moves its edge any more when it shrinks.",
    ),
    "CAVITY_SIZE_SHIFT": (
        WALLS,
        "SizeShift",
        "Distance by which the outer surface moves outward of that, the more, the smaller the cavity looks.",
    ),
    "SMOOTHNESS_SHIFT": (
        WALLS,
        "SmoothnessShift",
        "Distances by which both surfaces move outward of that, where the image is smoother than usual.",
    ),
    "APPARENT_TERMS": (NODES, "NodeTerms", "Distance from an expert's mask."),
    "ANATOMICAL_TERMS": (NODES, "NodeTerms", "Distance from the true wall."),
}

WALLS_HEADER = """\
//! Constants of the models of rim and wall. Written by `scripts/measure/calibrate_walls.py`: do not edit.
//!
//! In: rims and walls of fits to simulated hearts, and the true ones. Out: the shape of the rim with its correction,
//! and the distances from the apparent to the anatomical wall.

use super::ray_terms::{RayTerms, SizeShift, SmoothnessShift};
use super::rim_model::{
    RimCorrection, RimDeviation, RimHarmonic, RimRegression, RimShape, RimTerms,
};
"""
NODES_HEADER = """\
//! Constants of the uncertainty of nodes. Written by `scripts/measure/calibrate_walls.py`: do not edit.
//!
//! In: nodes of fits to simulated hearts, and their distances from the walls. Out: the logarithm of the distance within
//! which 68 % of the nodes lie, mm.

use super::node_terms::NodeTerms;
"""

NUMBER = r"(-?[0-9.]+)"


def committed():
    """The constants of the files as they are: a dictionary of fields for each, and arrays for RIM_SHAPE."""
    found = {}
    for file in (WALLS, NODES):
        text = file.read_text()
        for name, body in re.findall(r"pub const (\w+): \w+ = \w+ \{\n(.*?)\n\};", text, re.S):
            found[name] = {field: float(value) for field, value in re.findall(rf"(\w+): {NUMBER}", body)}
        if file == WALLS:
            shape = re.search(r"RimShape \{\n(.*?)\n\};", text, re.S)[1]
            mean = re.findall(rf"cosine: {NUMBER},\s+sine: {NUMBER}", shape)
            rows = re.findall(r"\[(-?[0-9][^\[\]]*)\]", shape)
            found["RIM_SHAPE"] = dict(
                mean=np.array(mean, float).ravel(), precision=np.array([row.split(", ") for row in rows], float)
            )
            for name in ("RIM_CORRECTION", "SMOOTHNESS_SHIFT"):
                values = re.search(rf"const {name}:.*?range_mm: \[{NUMBER}, {NUMBER}\]", text, re.S)
                found[name]["range_mm"] = [float(x) for x in values.groups()]
            found["RIM_REGRESSION"] = committed_regression(re.search(r"RimRegression \{\n(.*?)\n\};", text, re.S)[1])
        else:
            found["MEDIAN_SPREAD_MM"] = float(re.search(rf"MEDIAN_SPREAD_MM: f64 = {NUMBER};", text)[1])
    return found


def committed_regression(text):
    """The regression of the rim: a row of numbers for each coefficient of the distance."""
    numbers = [
        np.array(re.findall(NUMBER, re.sub(r"\w+:", "", terms)), float)
        for terms in re.findall(r"RimTerms \{(.*?)\}", text, re.S)
    ]
    ranges = [[float(x) for x in values] for values in re.findall(rf"range_mm: \[{NUMBER}, {NUMBER}\]", text)]
    return dict(terms=np.array(numbers), length_range_mm=ranges[0], range_mm=ranges[1])


def literal(x, digits=3):
    if isinstance(x, list):
        return f"[{', '.join(literal(value, digits) for value in x)}]"
    text = f"{x:.{digits}f}".rstrip("0")
    text = text + "0" if text.endswith(".") else text
    return "0.0" if text == "-0.0" else text


def layout(constants):
    """{file: text} with these constants."""
    shape, correction = constants["RIM_SHAPE"], constants["RIM_CORRECTION"]
    harmonics = "".join(
        f"        RimHarmonic {{\n            cosine: {literal(c, 4)},\n            sine: {literal(s, 4)},\n     "
        f"   }},\n"
        for c, s in zip(shape["mean"][::2], shape["mean"][1::2])
    )
    rows = "".join("        [" + ", ".join(literal(round(x), 1) for x in row) + "],\n" for row in shape["precision"])
    text = {WALLS: WALLS_HEADER, NODES: NODES_HEADER}
    text[WALLS] += (
        "\n/// Shape of the rims of hearts.\npub const RIM_SHAPE: RimShape = RimShape {\n"
        f"    mean: [\n{harmonics}    ],\n    precision: [\n{rows}    ],\n}};\n"
        "\n/// The share of a rim's distance from its shape that is taken back.\npub const RIM_CORRECTION: "
        "RimCorrection = RimCorrection {\n"
        + "".join(f"    {field}: {literal(correction[field])},\n" for field in [*CORRECTION_FIELDS, "range_mm"])
        + "};\n"
    )
    regression = constants["RIM_REGRESSION"]
    text[WALLS] += (
        "\n/// The rim's distance from where the sensors left it, by its shape and the ends of the signal.\n"
        "pub const RIM_REGRESSION: RimRegression = RimRegression {\n    terms: [\n"
        + "".join(rim_terms(row) for row in regression["terms"])
        + "    ],\n"
        + "".join(f"    {field}: {literal(regression[field])},\n" for field in ("length_range_mm", "range_mm"))
        + "};\n"
    )
    for name, (file, kind, doc) in TERMS.items():
        fields = "".join(f"    {field}: {literal(value)},\n" for field, value in constants[name].items())
        text[file] += f"\n/// {doc}\npub const {name}: {kind} = {kind} {{\n{fields}}};\n"
    text[NODES] += (
        "\n/// The distance that stands for that from other fits where there are none: its median, mm.\n"
        f"pub const MEDIAN_SPREAD_MM: f64 = {literal(constants['MEDIAN_SPREAD_MM'])};\n"
    )
    return text


def rim_terms(row):
    """One RimTerms of the regression."""
    parts = dict(zip(REGRESSION_FIELDS, np.split(row[2:], len(REGRESSION_FIELDS))))
    lines = [f"constant: {literal(row[0])},", f"length: {literal(row[1], 4)},"]
    for field, values in parts.items():
        line = f"{field}: {literal(values.tolist())},"
        if len(line) + 12 > 100:
            line = f"{field}: [\n                {literal(values.tolist())[1:-1]},\n            ],"
        lines.append(line)
    return "        RimTerms {\n" + "".join(f"            {line}\n" for line in lines) + "        },\n"


def table(path, sets):
    with open(path, newline="") as file:
        return [
            {k: v if k in ("set", "case") else float(v) for k, v in row.items()}
            for row in csv.DictReader(file)
            if row["set"] in sets
        ]


def column(rows, name):
    return np.array([row[name] for row in rows])


def heights(rows, name):
    return np.array([[row[f"{name}_{n}"] for n in range(DIRECTIONS)] for row in rows])


def expected(rim, length, shape):
    """The shape of a rim, as heart/deform/base_plane.rs fits it."""
    mean = np.concatenate([[0.0], shape["mean"] * length])
    prior = np.zeros((7, 7))
    prior[1:, 1:] = shape["precision"] / length**2
    usual = BASIS @ mean
    fitted = usual + np.median(rim - usual)
    for _ in range(ROUNDS):
        weights = 1 / (1 + ((rim - fitted) / OUTLIER_MM) ** 2) / (OUTLIER_MM**2 * CORRELATED)
        weighted = BASIS.T * weights
        fitted = BASIS @ np.linalg.solve(weighted @ BASIS + prior, weighted @ rim + prior @ mean)
    return fitted


def from_shape(rows, shape):
    return np.array([rim - expected(rim, row["length_mm"], shape) for row, rim in zip(rows, heights(rows, "sensed"))])


def bent(distance, bend):
    return np.column_stack(
        [np.ones(distance.size), distance, np.maximum(distance - bend, 0), np.maximum(-distance - bend, 0)]
    )


def corrected(distance, correction):
    slopes = [correction[field] for field in ("intercept_mm", "slope", "short_slope", "long_slope")]
    shift = bent(distance.ravel(), correction["bend_mm"]) @ slopes
    return shift.clip(*correction["range_mm"]).reshape(distance.shape)


def waves(distances):
    """Coefficients of the waves of distances in every direction."""
    return least_squares(BASIS, np.atleast_2d(distances).T).T


def rim_evidence(tables, constants):
    """Rows of signal_ends.csv, what tells where their rims are, the distances from the sensed to the true rims, and
    what limits their moves: the shifts by shape and the ends of the signal."""
    rows = [row for row in table(tables / "signal_ends.csv", END_SETS) if not row["case"].startswith("motion")]
    by_shape = corrected(from_shape(rows, constants["RIM_SHAPE"]), constants["RIM_CORRECTION"])
    x = np.column_stack(
        [column(rows, "length_mm"), *(waves(d) for d in (by_shape, heights(rows, "heart"), heights(rows, "direction")))]
    )
    return rows, x, heights(rows, "sensed") - heights(rows, "true"), (by_shape, heights(rows, "heart"))


def ridge(x, y):
    """Coefficients of 1 and of the terms, whose weight counts once they are standardised."""
    mean, spread = x.mean(axis=0), x.std(axis=0)
    z = (x - mean) / spread
    slopes = np.linalg.solve(z.T @ z + RIDGE * np.eye(z.shape[1]), z.T @ (y - y.mean(axis=0))) / spread[:, None]
    return np.vstack([y.mean(axis=0) - mean @ slopes, slopes])


def regressed(x, regression, limits):
    """Distances by which the rims move: not towards the apex of where the shape puts them where the base is dark."""
    low, high = regression["length_range_mm"]
    x = np.column_stack([np.ones(len(x)), x[:, 0].clip(low, high), x[:, 1:]])
    moved = (x @ regression["terms"].T @ BASIS.T).clip(*regression["range_mm"])
    (by_shape, ends), (dark, bright) = limits, DARK_ENDS_MM
    return np.where(
        moved < by_shape, by_shape + (moved - by_shape) * ((ends - dark) / (bright - dark)).clip(0, 1), moved
    )


def rim_regression(x, distance):
    lengths = [float(x[:, 0].min()), float(x[:, 0].max())]
    return dict(terms=ridge(x, waves(distance)).T, length_range_mm=lengths, range_mm=REGRESSION_RANGE_MM)


def left_out(x, distance, limits, parts=10):
    """Distances of each tenth of the hearts, by the regression of the others."""
    made = np.zeros_like(distance)
    for part in range(parts):
        out = np.arange(len(x)) % parts == part
        made[out] = regressed(x[out], rim_regression(x[~out], distance[~out]), [of[out] for of in limits])
    return made


def scatter(rows):
    """By how much the directions' own ends of the signal scatter in each heart, mm."""
    return heights(rows, "direction").std(axis=1)


def rim_deviation(rows, error):
    """Of the errors of hearts left out. The weights make each heart count by the share of its variance that is off."""
    squares, scattered = np.mean(error**2, axis=1), scatter(rows) ** 2
    x = np.column_stack([np.ones(len(rows)), scattered])
    variance = np.full(len(rows), squares.mean())
    for _ in range(30):
        terms = least_squares(x / variance[:, None], squares / variance)
        variance = x @ terms
    return dict(zip(("least_mm", "per_scatter"), np.sqrt(terms)))


def of_rims(error):
    """Root mean square of the error of rims' heights, and mean and deviation of their level."""
    level = error.mean(axis=1)
    return f"{rms(error):.2f} mm, level {level.mean():+.2f} +- {level.std():.2f}"


def rays(tables, sets):
    """Rows of the fits that found the wall, their numbers in the order of RAY_FIELDS, and the shifts of both
    surfaces."""
    rows = table(tables / "rays.csv", sets)
    of_case = {}
    for row in rows:
        of_case.setdefault((row["set"], row["case"]), []).append((row["inner_mm"], row["outer_mm"]))
    met = {case for case, shifts in of_case.items() if np.abs(np.median(shifts, axis=0)).max() < LOST_MM}
    rows = [row for row in rows if (row["set"], row["case"]) in met]
    value = {
        name: column(rows, name)
        for name in ("thickness", "ln_radius", "thickness_here", "narrowness_here", "missing_uptake", "way")
    }
    value |= {"constant": np.ones(len(rows)), "nearness_to_apex": np.exp(-(value["way"] + 0.5) / 0.12)}
    value |= {f"{name}_squared": value[name] ** 2 for name in ("ln_radius", "missing_uptake", "way")}
    return (
        rows,
        np.column_stack([value[field] for field in RAY_FIELDS]),
        [column(rows, name) for name in ("inner_mm", "outer_mm")],
    )


def of_hearts(rows, values):
    """Logarithm of the cavity's size, and the mean value, of each heart."""
    hearts = {}
    for row, value in zip(rows, values):
        hearts.setdefault((row["set"], row["case"]), (np.log(max(row["cavity_ml"], 1.0)), []))[1].append(value)
    return np.array([size for size, _ in hearts.values()]), np.array([np.mean(values) for _, values in hearts.values()])


def linear(terms, x):
    return x @ np.array(list(terms.values()))


def least_squares(x, y):
    return np.linalg.lstsq(x, y, rcond=None)[0]


def quantile_regression(x, y, share):
    """Coefficients by majorisation (Hunter and Lange 2000)."""
    beta = least_squares(x, y)
    for _ in range(3000):
        weights = 1 / (1e-5 + np.abs(y - x @ beta))
        new = np.linalg.solve((x.T * weights) @ x, x.T @ (weights * y) + (2 * share - 1) * x.sum(axis=0))
        if np.abs(new - beta).max() < 1e-8:
            break
        beta = new
    return beta


def of_size(rows, constants, surface):
    """The distances of a surface that the size of the cavity adds."""
    size = np.log(np.maximum(column(rows, "cavity_ml"), 1.0))
    narrow, any_size = constants["NARROW_CAVITY_SHIFT"], constants["CAVITY_SIZE_SHIFT"]
    if surface == "inner":
        return -narrow["per_log_mm"] * np.maximum(np.log(narrow["cavity_ml"]) - size, 0)
    return any_size["per_log_mm"] * (np.log(any_size["cavity_ml"]) - size)


def filtered(tables, constants):
    """Rows of smoothness.csv of the hearts whose fits all found the wall. `constants` tell where the true surfaces are
    expected."""
    rows = table(tables / "smoothness.csv", SMOOTHNESS_SETS)
    rest = [left(rows, constants, surface) for surface in ("inner", "outer")]
    lost = {
        (row["set"], row["case"]) for row, distances in zip(rows, zip(*rest)) if max(np.abs(distances)) > LOST_MEAN_MM
    }
    fits = collections.Counter((row["set"], row["case"]) for row in rows)
    return [row for row in rows if (row["set"], row["case"]) not in lost and fits[row["set"], row["case"]] == FILTERS]


def left(rows, constants, surface):
    """What the constants but SMOOTHNESS_SHIFT leave of the distances of a surface."""
    x = np.column_stack([np.ones(len(rows)), *(column(rows, field) for field in RAY_FIELDS[1:])])
    return (
        column(rows, f"{surface}_mm")
        - linear(constants[f"{surface.upper()}_SHIFT_MM"], x)
        - of_size(rows, constants, surface)
    )


def smoothness_shift(tables, constants):
    rows = filtered(tables, constants)
    smoothness = np.log(column(rows, "smoothness_mm"))
    usual = smoothness[column(rows, "added_mm") == 0].mean()
    terms = np.column_stack([np.ones(len(rows)), smoothness - usual])
    inner, outer = (least_squares(terms, left(rows, constants, surface))[1] for surface in ("inner", "outer"))
    bounds = np.exp([smoothness.min(), smoothness.max()]).tolist()
    return dict(usual_mm=np.exp(usual), inner_per_log_mm=inner, outer_per_log_mm=outer, range_mm=bounds)


def by_added_filter(rows, values):
    """Deviation among the scans as they are, and mean change behind each further filter."""
    added = column(rows, "added_mm")
    as_is = values[added == 0]
    changes = [
        f"{(values[added == filter] - as_is).mean():+.2f} behind {filter:g} mm"
        for filter in sorted(set(added))
        if filter
    ]
    return f"deviation {as_is.std():.3f} mm as it is, mean change {', '.join(changes)}"


def nodes(tables, wall):
    """Numbers of the nodes in the order of NODE_FIELDS, and the distances from that wall, mm."""
    rows = table(tables / "nodes.csv", NODE_SETS)
    rows = [row for row in rows if np.isfinite(row["spread_mm"])]
    way = column(rows, "way").clip(0, 1) - 0.5
    x = np.column_stack(
        [
            np.ones(len(rows)),
            column(rows, "seen"),
            np.log(column(rows, "spread_mm") + SPREAD_OFFSET_MM),
            column(rows, f"log_odds_{wall}"),
            way,
            way**2,
        ]
    )
    return rows, x, np.abs(column(rows, f"{wall}_mm")).clip(LEAST_DISTANCE_MM)


def estimate(tables, chosen, names=()):
    """Constants (of these `names`; all, if there are none) from the tables. What is no estimate is as in `chosen`."""
    made = {}
    rows = table(tables / "rims.csv", RIM_SETS)
    of_true = [least_squares(BASIS, rim)[1:] / row["true_length_mm"] for row, rim in zip(rows, heights(rows, "true"))]
    made["RIM_SHAPE"] = dict(mean=np.mean(of_true, axis=0), precision=np.linalg.inv(np.cov(np.array(of_true).T)))
    distance = from_shape(rows, made["RIM_SHAPE"]).ravel()
    bend = chosen["RIM_CORRECTION"]["bend_mm"]
    intercept, slope, short, long = least_squares(
        bent(distance, bend), (heights(rows, "sensed") - heights(rows, "true")).ravel()
    )
    made["RIM_CORRECTION"] = dict(
        intercept_mm=intercept,
        slope=slope,
        bend_mm=bend,
        short_slope=short,
        long_slope=long,
        range_mm=chosen["RIM_CORRECTION"]["range_mm"],
    )
    _, x, both = rays(tables, RAY_SETS)
    for name, y in zip(("INNER_SHIFT_MM", "OUTER_SHIFT_MM"), both):
        made[name] = dict(zip(RAY_FIELDS, least_squares(x, y)))
    rows, x, (inner, outer) = rays(tables, SIZE_SETS)
    size, rest = of_hearts(rows, inner - linear(made["INNER_SHIFT_MM"], x))
    narrow = chosen["NARROW_CAVITY_SHIFT"]["cavity_ml"]
    below = np.maximum(np.log(narrow) - size, 0)
    made["NARROW_CAVITY_SHIFT"] = dict(cavity_ml=narrow, per_log_mm=-(below @ rest) / (below @ below))
    size, rest = of_hearts(rows, outer - linear(made["OUTER_SHIFT_MM"], x))
    level, slope = least_squares(np.column_stack([np.ones(len(size)), size]), rest)
    made["CAVITY_SIZE_SHIFT"] = dict(cavity_ml=np.exp(-level / slope), per_log_mm=-slope)
    for name, wall in (("APPARENT_TERMS", "apparent"), ("ANATOMICAL_TERMS", "anatomical")):
        rows, x, distance = nodes(tables, wall)
        made[name] = dict(zip(NODE_FIELDS, quantile_regression(x, np.log(distance), SHARE)))
    made["MEDIAN_SPREAD_MM"] = float(np.median(column(rows, "spread_mm")))
    used = chosen if names else made  # the regression stands on the other two
    rows, x, distance, limits = rim_evidence(
        tables, chosen | {name: used[name] for name in ("RIM_SHAPE", "RIM_CORRECTION")}
    )
    made["RIM_REGRESSION"] = rim_regression(x, distance)
    made["RIM_DEVIATION"] = rim_deviation(rows, distance - left_out(x, distance, limits))
    if names:
        made = chosen | {name: made[name] for name in names if name in made}
    # Of what the others leave, as they will stand beside it.
    if not names or "SMOOTHNESS_SHIFT" in names:
        made["SMOOTHNESS_SHIFT"] = smoothness_shift(tables, made)
    return made


def rms(x):
    return float(np.sqrt(np.mean(np.square(x))))


def show(name, before, after):
    print(name)
    for field in before:
        if field != "range_mm":
            print(f"  {field:26}{before[field]:12.3f}{after[field]:12.3f}")


def compare(tables, before, after):
    """Prints both constants, and what the difference does on the tables."""
    print(f"{'':28}{'committed':>12}{'estimated':>12}")
    rows = table(tables / "rims.csv", RIM_SETS)
    names = [f"{f} of {n} x angle" for n in (1, 2, 3) for f in ("cosine", "sine")]
    show("RIM_SHAPE", dict(zip(names, before["RIM_SHAPE"]["mean"])), dict(zip(names, after["RIM_SHAPE"]["mean"])))
    deviations = [np.sqrt(np.diag(np.linalg.inv(c["RIM_SHAPE"]["precision"]))) for c in (before, after)]
    show("  standard deviations", *(dict(zip(names, d)) for d in deviations))
    show("RIM_CORRECTION", before["RIM_CORRECTION"], after["RIM_CORRECTION"])
    error = heights(rows, "sensed") - heights(rows, "true")
    shift = [corrected(from_shape(rows, c["RIM_SHAPE"]), c["RIM_CORRECTION"]) for c in (before, after)]
    print(
        f"  {len(rows)} rims: rms error {rms(error):.2f} mm as sensed, {rms(error - shift[0]):.2f} committed, "
        f"{rms(error - shift[1]):.2f} estimated; "
        f"corrections differ by {rms(shift[0] - shift[1]):.2f} mm (rms), correlation "
        f"{np.corrcoef(shift[0].ravel(), shift[1].ravel())[0, 1]:.3f}\n"
    )
    for sets in (RAY_SETS, SIZE_SETS):
        rows, x, both = rays(tables, sets)
        for surface, y in zip(("inner", "outer"), both):
            name = f"{surface.upper()}_SHIFT_MM"
            if sets is RAY_SETS:
                show(name, before[name], after[name])
            shift = [linear(c[name], x) + of_size(rows, c, surface) for c in (before, after)]
            print(
                f"  sets {', '.join(sets)}, {len(y)} rays: rms distance {rms(y):.2f} mm, {rms(y - shift[0]):.2f} "
                f"left by committed, "
                f"{rms(y - shift[1]):.2f} by estimated constants; they differ by {rms(shift[0] - shift[1]):.2f} mm "
                f"(rms), mean {np.mean(shift[1] - shift[0]):+.2f}, "
                f"correlation {np.corrcoef(*shift)[0, 1]:.3f}\n"
            )
    rows, x, distance, limits = rim_evidence(tables, before)
    error = distance - left_out(x, distance, limits)
    print(
        f"RIM_REGRESSION\n  {len(rows)} rims: as sensed {of_rims(distance)}; by shape alone "
        f"{of_rims(distance - limits[0])}; "
        f"committed {of_rims(distance - regressed(x, before['RIM_REGRESSION'], limits))}; each tenth left out "
        f"{of_rims(error)}\n"
    )
    show("RIM_DEVIATION", before["RIM_DEVIATION"], after["RIM_DEVIATION"])
    share = (
        np.abs(error)
        / np.hypot(before["RIM_DEVIATION"]["least_mm"], before["RIM_DEVIATION"]["per_scatter"] * scatter(rows))[:, None]
    )
    quarters = np.array_split(share[np.argsort(scatter(rows))], 4)
    print(
        "  left out, within one / two standard deviations: "
        + ", ".join(f"{np.mean(part <= 1):.0%} / {np.mean(part <= 2):.0%}" for part in [share, *quarters])
        + " (all; quarters by scatter)\n"
    )
    for name in ("NARROW_CAVITY_SHIFT", "CAVITY_SIZE_SHIFT"):
        show(name, before[name], after[name])
    show("SMOOTHNESS_SHIFT", before["SMOOTHNESS_SHIFT"], after["SMOOTHNESS_SHIFT"])
    rows = filtered(tables, before)
    smoothness = np.log(column(rows, "smoothness_mm"))
    for surface in ("inner", "outer"):
        print(
            f"  {len(rows)} fits, {surface} surface, without it: {by_added_filter(rows, left(rows, before, surface))}"
        )
        for which, c in (("committed", before), ("estimated", after)):
            shift = c["SMOOTHNESS_SHIFT"]
            rest = left(rows, c, surface) - shift[f"{surface}_per_log_mm"] * (smoothness - np.log(shift["usual_mm"]))
            print(f"    {which}: {by_added_filter(rows, rest)}")
    print()
    for name, wall in (("APPARENT_TERMS", "apparent"), ("ANATOMICAL_TERMS", "anatomical")):
        show(name, before[name], after[name])
        _, x, distance = nodes(tables, wall)
        sd = [np.exp(linear(c[name], x)).clip(0.5, 15.0) for c in (before, after)]
        within = [f"{np.mean(distance <= s):.0%} / {np.mean(distance <= 2 * s):.0%}" for s in sd]
        print(
            f"  {len(distance)} nodes within one / two standard deviations: {within[0]} committed, {within[1]} "
            f"estimated; "
            f"they differ by a factor of {np.exp(rms(np.log(sd[0] / sd[1]))):.2f} (rms), correlation of the "
            f"logarithms {np.corrcoef(*np.log(sd))[0, 1]:.3f}\n"
        )
    print(f"MEDIAN_SPREAD_MM{before['MEDIAN_SPREAD_MM']:24.3f}{after['MEDIAN_SPREAD_MM']:12.3f}")


def write(texts):
    for file, text in texts.items():
        file.write_text(text)


def main():
    doc = __doc__.replace("{reproduced}", REPRODUCED).replace("{RIDGE:g}", f"{RIDGE:g}")
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tables", type=pathlib.Path, default=TABLES, help="folder of the tables of features (CSV)")
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument(
        "--check",
        action="store_true",
        help="compare the estimate with the constants as committed; 1 if a file is not laid out as --layout would",
    )
    action.add_argument(
        "--write", nargs="*", metavar="NAME", help="write the estimated constants: those of these names, or all"
    )
    action.add_argument("--layout", action="store_true", help="write the committed constants again")
    a = parser.parse_args()
    before = committed()
    if a.layout:
        write(layout(before))
        return 0
    unknown = set(a.write or ()) - before.keys()
    if unknown:
        parser.error(f"no constant is called {', '.join(sorted(unknown))}; there are {', '.join(before)}")
    after = estimate(a.tables, before, a.write or ())
    if a.write is not None:
        write(layout(after))
        return 0
    compare(a.tables, before, after)
    edited = [file for file, text in layout(before).items() if file.read_text() != text]
    for file in edited:
        print(f"{file.relative_to(ROOT)} was edited by hand: run calibrate_walls.py --layout", file=sys.stderr)
    return min(len(edited), 1)


if __name__ == "__main__":
    sys.exit(main())
