#!/usr/bin/env python3
"""Every figure, interval and flag by kind of scan: what holds on scans that no constant has seen, and what does not.

    by_kind.py CASES                  makes what is missing of the scans and tables in CASES, and prints the tables of
                                      docs/kinds.md
    by_kind.py CASES --write          writes them into docs/kinds.md, below its mark
    by_kind.py CASES --only held-out  without the in-sample sets, which take as long again
    by_kind.py CASES --programs DIR   by programs that are built already

Held-out sets have seeds that nothing was estimated from or chosen on; in-sample ones are sets of calibrate_all.py. The
tables of real scans are halves.csv and serial_halves.csv of scripts/measure/calibration, and those that are given by
--real: what `judgements` prints of real scans, which are no part of the tree.

A good fit has a Jaccard index of 0.75 and more with the wall as it looks, a bad one of less than 0.65. A scan without
a heart (kind `none`) is right if it is refused.
"""

import argparse
import collections
import pathlib
import re
import statistics

import calibrate_all
import calibrate_serial
import flag_rates
import numpy as np
from calibrate_comparison import BEAT_NAMES
from calibrate_intervals import HALF_WIDTH_SDS, in_deviations, rows_of
from flag_rates import GOOD, flags_of, good_and_bad, grouped, is_elsewhere, number

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/kinds.md"
MARK = "<!-- Written by scripts/measure/by_kind.py from here on. -->"
WIDE = (
    "in,motion,rv,basal,apex,infarct,large,small,noise,gut,liver,coarse,turned,none,hotgut,filter,drift,cut,camera,few,"
    "halfapex,oneapex,apexplus"
)
# Name: program of the simulator, seed, number, further flags. All held out.
HELD_OUT = {
    "17001": ("cases", 17001, 230, ["--coarse", "--kinds", WIDE]),
    "17002": ("cases", 17002, 23, ["--kinds", WIDE]),
    "17003": ("walls", 17003, 48, []),
    "variants": ("variants", None, None, []),
}
HELD_OUT_BEATS = {"17500": ("gated", 17500, 16, []), "17103": ("walls", 17103, 8, ["--gates", "8"])}
HELD_OUT_PAIRS = {"17610": ("pairs", 17610, 20, ["--gates", "0"])}
HELD_OUT_GATED_PAIRS = {"17620": ("pairs", 17620, 8, ["--gates", "8", "--kinds", calibrate_all.KINDS_OF_GATED_PAIRS])}
IN_SAMPLE = ["6003", "6007"]


class Lab(calibrate_all.Lab):
    """The programs, and the folder of the scans and their tables."""

    def made(self, name, order):
        what, seed, number, more = order
        out = self.cases / name
        chosen = ["--seed", seed, "--n", number] if seed else []
        self.run("simulate", what, *chosen, "--out", out, *more)
        return out

    def table(self, program, names, folders):
        """The rows that a program prints of folders; kept in CASES."""
        path = self.cases / f"{program}-{'-'.join(names)}.csv"
        if not path.exists() or not path.stat().st_size:
            self.run(program, *folders, into=path)
        return path


def kind_of(row):
    """The kind in a case's name: `hotgut17001_014` is of the kind hotgut, `lvh_A` the variant lvh of the heart A."""
    if row["set"] == "variants":
        return f"variant {row['case'].rsplit('_', 1)[0]}"
    kind = flag_rates.kind_of(row)
    return "walls" if kind == "w" else kind


def share(part, whole):
    return f"{100 * part / whole:.0f} %" if whole else ""


def spread(errors):
    """Mean and deviation of relative errors, per cent."""
    if len(errors) < 2:
        return ""
    percent = 100 * np.asarray(errors)
    return f"{percent.mean():+.0f} ± {percent.std(ddof=1):.0f}"


def is_right(row):
    """Whether a fit is good, or a scan without a heart is refused."""
    if kind_of(row).startswith("none"):
        return row["result"] == "refused"
    return row["result"] == "found" and (number(row, "jaccard") or 0) >= GOOD


def single_scans(judged, measured):
    """A row of each kind: found, how good, how sure, and the volumes with the share that their intervals hold."""
    held = intervals(measured)
    volumes = grouped(zip(measured, *held), lambda both: kind_of(both[0]))
    lines = [
        "| kind | scans | refused | elsewhere | E_J median, worst | good | confidence | flagged | muscle, % (held) | "
        "cavity, % (held) |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for kind, group in sorted(grouped(judged, kind_of).items()):
        found = [row for row in group if row["result"] == "found"]
        elsewhere = sum(map(is_elsewhere, found))
        jaccards = sorted(number(row, "jaccard") for row in found if row["jaccard"])
        best = f"{statistics.median(jaccards):.2f}, {jaccards[0]:.2f}" if jaccards else ""
        sure = f"{statistics.median(number(row, 'confidence') for row in found):.2f}" if found else ""
        own = volumes.get(kind, [])
        told = []
        for at, figure in ((1, "wall"), (2, "cavity")):
            errors = [number(row[0], figure) / number(row[0], f"true_{figure}") - 1 for row in own]
            held_share = share(sum(bool(row[at]) for row in own), len(own))
            told.append(f"{spread(errors)} ({held_share})" if spread(errors) else "")
        lines.append(
            f"| {kind} | {len(group)} | {len(group) - len(found)} | {elsewhere or ''} | {best} | "
            f"{sum(map(is_right, group))} | {sure} | {sum(bool(flags_of(row)) for row in found)} | {told[0]} | "
            f"{told[1]} |"
        )
    return lines


def intervals(measured):
    """Of each row whether the intervals of wall and cavity hold the true ones."""
    return [off < HALF_WIDTH_SDS for _, off in in_deviations("volumes", measured).values()]


def rates_of_flags(sets):
    """A row of each flag: its rate on good and on bad fits of each set."""
    heads = [f"{name}: {which}" for name in sets for which in ("good", "bad")]
    parts = [part for judged in sets.values() for part in good_and_bad(judged)]
    codes = sorted({code for part in parts for row in part for code in flags_of(row)})
    lines = ["| flag | " + " | ".join(heads) + " |", "|---" * (len(heads) + 1) + "|"]
    lines.append("| fits | " + " | ".join(str(len(part)) for part in parts) + " |")
    any_flag = [share(sum(bool(flags_of(row)) for row in part), len(part)) for part in parts]
    lines.append("| any | " + " | ".join(any_flag) + " |")
    for code in codes:
        rates = [share(sum(code in flags_of(row) for row in part), len(part)) for part in parts]
        lines.append(f"| `{code}` | " + " | ".join(rates) + " |")
    return lines


def beats_by_kind(rows):
    figures = in_deviations("beats", rows)
    lines = ["| kind | studies | EF, points (held) | EDV, % (held) | ESV, % (held) |", "|---|---|---|---|---|"]
    kinds = np.array([re.sub(r"[_\d]+$", "", row["study"]) for row in rows])
    for kind in [*sorted(set(kinds)), "all"]:
        own = kinds == kind if kind != "all" else np.ones(len(kinds), bool)
        cells = []
        for constant, (error, off) in figures.items():
            held = share((off[own] < HALF_WIDTH_SDS).sum(), own.sum())
            scale = 0.01 if constant.startswith("EF") else 1
            cells.append(f"{spread(scale * error[own])} ({held})" if own.sum() > 1 else "")
        lines.append(f"| {kind} | {own.sum()} | " + " | ".join(cells) + " |")
    return lines


def pairs_by_kind(rows):
    lines = [
        "| kind | pairs | reversible, true % | found % | interval holds | yes, no, cannot tell | TID error | flagged |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for kind, group in sorted(grouped(rows, lambda row: row["kind"]).items()):
        known = [row for row in group if row["true_reversible"]]
        found, true = ([number(row, name) for row in known] for name in ("reversible", "true_reversible"))
        held = sum(
            number(row, "reversible_low") <= number(row, "true_reversible") <= number(row, "reversible_high")
            for row in known
        )
        verdicts = collections.Counter(row["verdict"] for row in group)
        tid = [number(row, "tid") - number(row, "true_tid") for row in group if row["true_tid"]]
        error = f"{np.mean(tid):+.2f} ± {np.std(tid, ddof=1):.2f}" if len(tid) > 1 else ""
        lines.append(
            f"| {kind} | {len(group)} | {np.mean(true):.0f} | {np.mean(found):.0f} | {share(held, len(known))} | "
            f"{verdicts['yes']}, {verdicts['no']}, {verdicts['cannot_tell']} | {error} | "
            f"{sum(bool(row['flags']) for row in group)} |"
        )
    return lines


def changes(rows, names):
    lines = ["| figure | pairs | error, rms | told of unchanged | interval holds |", "|---|---|---|---|---|"]
    for _, figure, what in names:
        own, told, unchanged, held = calibrate_serial.judged(rows, figure)
        if own:
            size = calibrate_serial.root_mean_square(own)
            lines.append(f"| {what} | {len(own)} | {size:.3g} | {told} of {unchanged} | {share(held, len(own))} |")
    return lines


def page(lab, only, real):
    held = [lab.made(*item) for item in HELD_OUT.items()]
    hearts = [folder for folder in held if folder.name != "variants"]
    judged = rows_of(lab.table("judgements", HELD_OUT, held))
    measured = rows_of(lab.table("volumes", [folder.name for folder in hearts], hearts))
    sets = {"held-out": judged}
    if only != "held-out":
        folders = lab.scans(IN_SAMPLE)
        sets["in-sample"] = rows_of(lab.table("judgements", IN_SAMPLE, folders))
    if real:
        sets["real"] = [row for table in real for row in rows_of(table)]
    lines = ["", "## Single scans by kind", "", "Held-out.", "", *single_scans(judged, measured)]
    if "in-sample" in sets:
        seen = rows_of(ROOT / "scripts/measure/calibration/volumes.csv")
        lines += ["", "In-sample:", "", *single_scans(sets["in-sample"], seen)]
    lines += ["", "## Flags", "", "Rates on good and on bad fits.", "", *rates_of_flags(sets)]
    for title, orders, program, told in (
        ("Beats", HELD_OUT_BEATS, "beats", beats_by_kind),
        ("Stress and rest", HELD_OUT_PAIRS, "comparisons", pairs_by_kind),
    ):
        studies = [case for item in orders.items() for case in sorted(lab.made(*item).iterdir()) if case.is_dir()]
        own = rows_of(lab.table(program, orders, studies))
        lines += ["", f"## {title} by kind", "", "Held-out.", "", *told(own)]
        lines += ["", "In-sample:", "", *told(rows_of(ROOT / f"scripts/measure/calibration/{program}.csv"))]
    halves = rows_of(ROOT / "scripts/measure/calibration/halves.csv")
    lines += ["", "Real, halves of one patient's scan, in which nothing changed (in-sample):", ""]
    lines += pairs_by_kind(halves)
    orders = HELD_OUT_GATED_PAIRS
    studies = [case for item in orders.items() for case in sorted(lab.made(*item).iterdir()) if case.is_dir()]
    own = rows_of(lab.table("beat_changes", orders, studies))
    lines += ["", "## Changes of the beat from rest to stress", "", "Held-out.", "", *changes(own, BEAT_NAMES)]
    seen = rows_of(ROOT / "scripts/measure/calibration/beat_changes.csv")
    lines += ["", "In-sample:", "", *changes(seen, BEAT_NAMES)]
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=pathlib.Path)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--only", choices=["held-out"])
    parser.add_argument("--real", nargs="*", default=[], metavar="TABLE")
    parser.add_argument("--programs", type=pathlib.Path, help="the folder of the programs, instead of building them")
    given = parser.parse_args()
    lab = Lab(given.cases, 1.0, given.programs or calibrate_all.build([*calibrate_all.PROGRAMS, "judgements"]))
    text = "\n".join(page(lab, given.only, given.real)) + "\n"
    if given.write:
        before = PAGE.read_text().split(MARK)[0]
        PAGE.write_text(f"{before}{MARK}\n{text}")
    else:
        print(text)


if __name__ == "__main__":
    main()
