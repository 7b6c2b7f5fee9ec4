#!/usr/bin/env python3
"""Estimates how much two scans of an unchanged heart differ, from tables of simulated pairs and of real halves.

    calibrate_comparison.py --check TABLE   figures of a table: TID, reversible wall, territories
    calibrate_comparison.py --check-beats TABLE
                                            figures of a table of changes of the beat
    calibrate_comparison.py --write         estimates the constants from comparisons.csv, halves.csv and
                                            beat_changes.csv of scripts/measure/calibration, and writes calibration.rs
                                            and beat_calibration.rs of crates/ventriform/src/heart/comparison

A table is what the program `comparisons` prints; calibrate_all.py makes that of the pairs. By itself:

    cargo run --release -p ventriform-evaluation --bin simulate -- pairs --out PAIRS --seed 610 --n 20 --gates 0
    cargo run --release -p ventriform-evaluation --bin comparisons -- PAIRS/* > TABLE

Halves are such a table too: the counts of one patient's projections divided in two at random (88 pairs of 2.0 M
counts each), or drawn twice from the projections of the patient's image (86 pairs of 6.4 M), both reconstructed and
compared as stress and rest, with a pair.json of the kind `half`. The scan is no part of the tree.

beat_changes.csv is of gated pairs, by the program `beat_changes`:

    cargo run --release -p ventriform-evaluation --bin simulate -- pairs --out PAIRS --seed 620 --n 16 \
        --kinds same,red40,red60,tid,fixed,tidred40,both60,red20
    cargo run --release -p ventriform-evaluation --bin beat_changes -- PAIRS/* > TABLE

- Noise of a usual pair: root mean square of the difference over the pairs without reversible wall; its rows' shares
  likewise, over these and the halves. What smoothing leaves for one point of what it takes away: the quotient of both
  root mean squares.
- Limit of a loss (halves): the deviations of noise that the greatest difference exceeds in four of a hundred pairs: so
  few that one of twenty others hardly does.
- TID, and the walls' volumes (halves): deviation of the logarithm of their quotient for a point of noise; what is not
  noise counts as OTHER_NOISE_POINTS of it.
- Error of a changed share: its root mean square over the pairs that lost 40 or 60 per cent and were found, as a
  share of it.
- Errors of changes of the beat: of every figure the change that was found less the true one, of volumes that of the
  logarithm, as calibrate_serial.py estimates them.
- Gain of a turn: a significant one is 2.5 times the largest of these pairs, whose turns are those of a patient who lies
  down again.
"""

import argparse
import csv
import pathlib

import calibrate_serial
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
TABLE = ROOT / "scripts/measure/calibration/comparisons.csv"
HALVES = ROOT / "scripts/measure/calibration/halves.csv"
CONSTANTS = ROOT / "crates/ventriform/src/heart/comparison/calibration.rs"
BEATS = ROOT / "scripts/measure/calibration/beat_changes.csv"
BEAT_CONSTANTS = ROOT / "crates/ventriform/src/heart/comparison/beat_calibration.rs"
BEAT_NAMES = [
    ("EF", "ef_percent", "Ejection fraction, points"),
    ("EDV", "edv_ml", "Logarithm of the end-diastolic volume"),
    ("ESV", "esv_ml", "Logarithm of the end-systolic volume"),
    ("SEGMENT_MOTION", "segment_motion_mm", "Inward motion of a segment, mm"),
    ("SEGMENT_THICKENING", "segment_thickening_percent", "Thickening of a segment, points"),
]
BEAT_HEADER = """\
//! Constants of changes of the beat from rest to stress. Written by `scripts/measure/calibrate_comparison.py`: do not
//! edit.
//!
//! In: simulated gated pairs. Out: how much the figures of both beats differ beyond what truly changed.

use super::figure_change::ChangeError;
"""
FOUND_PERCENT = 3
TURN_MARGIN = 2.5
LIMIT_SHARE, OTHER_NOISE_POINTS = 0.96, 4
HEADER = """\
//! Constants of comparisons. Written by `scripts/measure/calibrate_comparison.py`: do not edit.
//!
//! In: comparisons of simulated pairs of scans and of halves of a real one, and what truly changed. Out: how much
//! unchanged hearts differ.
"""


def rows_of(table):
    with open(table, newline="") as file:
        return [row for row in csv.DictReader(file) if row["comparable"] == "true"]


def column(rows, name):
    return np.array([float(row[name]) for row in rows])


def without_reversible(rows):
    return [row for row in rows if float(row["true_reversible"]) == 0]


def root_mean_square(values):
    return float(np.sqrt(np.mean(np.square(values))))


def of_halves(rows):
    """Limit; of TID and of the walls' volumes the deviation without noise, and for each point of noise."""
    noise = np.hypot(column(rows, "noise_points"), OTHER_NOISE_POINTS)
    tid, muscle = (root_mean_square(np.log(column(rows, name)) / noise) for name in ("tid", "muscle"))
    limit = np.quantile(column(rows, "largest_sds"), LIMIT_SHARE)
    return [limit, OTHER_NOISE_POINTS * tid, tid, OTHER_NOISE_POINTS * muscle, muscle]


def write():
    rows, halves = rows_of(TABLE), rows_of(HALVES)
    unchanged = without_reversible(rows)
    like = unchanged + halves
    usual = root_mean_square(column(unchanged, "sd_points"))
    overall = root_mean_square(column(like, "sd_points"))
    thirds = [root_mean_square(column(like, f"sd_{part}")) / overall for part in ("apical", "middle", "basal")]
    fine = root_mean_square(column(like, "smooth_points")) / root_mean_square(column(like, "fine_points"))
    limit, tid_sd, tid_per_point, muscle_sd, muscle_per_point = of_halves(halves)
    found = [row for row in rows if row["kind"].endswith(("40", "60")) and float(row["reversible"]) > FOUND_PERCENT]
    border = root_mean_square(1 - column(found, "true_reversible") / column(found, "reversible"))
    gain = TURN_MARGIN * column(unchanged, "turn_gain").max()
    constants = [
        (
            "pub(super) const USUAL_NOISE_POINTS",
            usual,
            1,
            "Standard deviation of the smoothed difference of a usual pair where nothing changed, per cent of the rest "
            "map's reference.",
        ),
        (
            "pub(super) const SMOOTH_PER_FINE_NOISE",
            fine,
            2,
            "Noise of the smoothed difference for one point of what smoothing takes away.",
        ),
        (
            "pub(super) const ROW_NOISE_SHARES",
            thirds,
            2,
            "Noise in the apical, the middle and the basal rows of a map, as shares of that of the wall.",
        ),
        (
            "pub(super) const LIMIT_SDS",
            limit,
            1,
            "Standard deviations of noise that the greatest difference of an unchanged heart exceeds in four of a "
            "hundred pairs.",
        ),
        (
            "pub(super) const BORDER_SD_SHARE",
            border,
            2,
            "Standard deviation of the share of the wall that is found to have changed, as a share of it.",
        ),
        (
            "pub(super) const TID_SD",
            tid_sd,
            3,
            "Standard deviation of the logarithm of TID without noise.",
        ),
        (
            "pub(super) const TID_SD_PER_POINT",
            tid_per_point,
            4,
            "Standard deviation of the logarithm of TID for each point of noise.",
        ),
        (
            "pub(super) const SIGNIFICANT_TURN_GAIN",
            gain,
            2,
            "Share by which a turn must lower the mean squared difference.",
        ),
        (
            "pub(super) const MUSCLE_SD",
            muscle_sd,
            3,
            "Standard deviation of the logarithm of the quotient of the walls' volumes without noise.",
        ),
        (
            "pub(super) const MUSCLE_SD_PER_POINT",
            muscle_per_point,
            4,
            "Standard deviation of the logarithm of the quotient of the walls' volumes for each point of noise.",
        ),
    ]
    text = HEADER
    for name, value, places, says in constants:
        rounded = np.round(np.asarray(value, float), places).tolist()
        kind = "f64" if np.isscalar(rounded) else f"[f64; {len(rounded)}]"
        text += f"\n/// {says}\n{name}: {kind} = {rounded};\n"
        print(name.split()[-1], rounded)
    CONSTANTS.write_text(text)
    text = BEAT_HEADER + calibrate_serial.constants(list(csv.DictReader(open(BEATS))), BEAT_NAMES)
    BEAT_CONSTANTS.write_text(text)


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
    low, high = (column(rows, f"reversible_{end}") for end in ("low", "high"))
    truth = column(rows, "true_reversible")
    print(f"interval of the reversible share holds the truth in {np.mean((low <= truth) & (truth <= high)):.0%}")
    for verdict in ("yes", "no", "cannot_tell"):
        own = [row for row in rows if row["verdict"] == verdict]
        changed = len(own) - len(without_reversible(own))
        print(f"{verdict}: {len(own)} pairs, changed {changed}")
    for strength in (20, 40, 60):
        own = [row for row in rows if row["kind"].endswith(str(strength))]
        if not own:
            continue
        found = [row for row in own if float(row["reversible"]) > FOUND_PERCENT]
        right = [row for row in found if row["territory"] == row["true_territory"]]
        error = column(own, "reversible") - column(own, "true_reversible")
        print(
            f"reversible {strength} per cent: {len(own)}, found {len(found)}, territory right {len(right)}, "
            f"share less truth {error.mean():+.1f}, worst {abs(error).max(initial=0):.1f}"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--check-beats", metavar="TABLE", nargs="?", const=BEATS)
    what.add_argument("--check", metavar="TABLE", nargs="?", const=TABLE)
    what.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    if arguments.write:
        write()
    elif arguments.check_beats:
        calibrate_serial.check_figures(list(csv.DictReader(open(arguments.check_beats))), BEAT_NAMES)
    else:
        check(arguments.check)


if __name__ == "__main__":
    main()
