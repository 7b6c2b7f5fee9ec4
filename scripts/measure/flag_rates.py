#!/usr/bin/env python3
"""How often each flag is raised on good fits and on bad ones, and which hearts are found.

    flag_rates.py TABLE... [--by set|kind]

TABLE is what `judgements` prints (crates/evaluation/src/bin/judgements.rs). Out: for each set or kind of case the
number of scans, of refused ones and of hearts found elsewhere, the median confidence, and each flag's rate; then each
flag's rate on all good fits (Jaccard index 0.75 and more) and on all bad ones (below 0.65).
"""

import argparse
import collections
import csv
import re
import statistics

GOOD, BAD = 0.75, 0.65
# Distance of the middles of the fitted and of the true wall from which on another structure was taken, mm.
ELSEWHERE_MM = 25.0


def number(row, name):
    return float(row[name]) if row[name] else None


def flags_of(row):
    return set(row["flags"].replace("+", " ").split())


def kind_of(row):
    """The kind in a case's name: `hotgut17001_014` is of the kind hotgut."""
    return re.sub(r"\d+_\d+$", "", row["case"])


def is_elsewhere(row):
    return (number(row, "off_mm") or 0.0) > ELSEWHERE_MM


def good_and_bad(rows):
    """The good fits of the rows, and the bad ones."""
    judged = [row for row in rows if row["jaccard"]]
    good = [row for row in judged if number(row, "jaccard") >= GOOD]
    return good, [row for row in judged if number(row, "jaccard") < BAD]


def grouped(rows, of):
    groups = collections.defaultdict(list)
    for row in rows:
        groups[of(row)].append(row)
    return groups


def rates(rows):
    counts = collections.Counter(flag for row in rows for flag in flags_of(row))
    return ", ".join(f"{flag} {count}" for flag, count in sorted(counts.items(), key=lambda c: (-c[1], c[0])))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="+")
    parser.add_argument("--by", choices=("set", "kind"), default="set")
    given = parser.parse_args()
    rows = [row for table in given.tables for row in csv.DictReader(open(table))]
    groups = grouped(rows, kind_of if given.by == "kind" else lambda row: row["set"])
    for name, group in sorted(groups.items()):
        found = [row for row in group if row["result"] == "found"]
        elsewhere = sum(map(is_elsewhere, found))
        confidence = statistics.median(float(row["confidence"]) for row in found) if found else float("nan")
        print(
            f"{name}: {len(group)} scans, {len(group) - len(found)} refused, {elsewhere} elsewhere, median confidence "
            f"{confidence:.2f}, without a flag {sum(not row['flags'] for row in found)}: {rates(found)}"
        )
    good, bad = good_and_bad(rows)
    print(f"good fits: {len(good)}, without a flag {sum(not row['flags'] for row in good)}: {rates(good)}")
    print(f"bad fits: {len(bad)}, without a flag {sum(not row['flags'] for row in bad)}: {rates(bad)}")


if __name__ == "__main__":
    main()
