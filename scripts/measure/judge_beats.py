#!/usr/bin/env python3
"""Judges beats of simulated gated studies by their truth, beside the goals.

    judge_beats.py PROGRAM CASES...       CASES are folders of the simulator of gated hearts (`simulate gated`),
                                          each with
                                          spect.nii.gz's gates in gated.nii.gz and the truth in params.json

Printed are bias and deviation of EF, EDV and ESV; thickening and motion of the segments, pooled and within hearts; the
area under the curve of akinetic segments; the spread of phases of hearts without delay and akinesia; how late a delayed
wall is found; and for each study its own last gate with a quarter of the counts taken off (unless it lacks counts
already), and its gates in another order round the cycle. EF, EDV and ESV are also given without the studies that were
made with lost counts or rotated gates. Needs numpy and nibabel.
"""

import argparse
import json
import os
import pathlib
import subprocess
import tempfile

import nibabel
import numpy as np


def beat(program, gated, out):
    environment = {**os.environ, "RAYON_NUM_THREADS": "1"}
    run = subprocess.run(
        [program, "beat", gated, "-o", out, "--format", "json"], capture_output=True, text=True, env=environment
    )
    if run.returncode:
        return {"error": run.stderr.strip().split("\n")[-1]}
    return json.loads((out / "beat.json").read_text())


def variants(gated, folder):
    """The study with a quarter of the last gate's counts taken off, and with its gates rotated by three."""
    image = nibabel.load(gated)
    # The stored integers with their slope, so that a variant differs by nothing else.
    voxels = image.dataobj.get_unscaled()
    slope, intercept = image.dataobj.slope, image.dataobj.inter
    lost = voxels.copy()
    lost[..., -1] = np.round(0.75 * lost[..., -1])
    for name, made in ("lost", lost), ("rotated", np.roll(voxels, 3, axis=3)):
        path = folder / f"{name}.nii.gz"
        variant = nibabel.Nifti1Image(made.astype(np.int16), image.affine, image.header)
        variant.header.set_slope_inter(slope, intercept)
        nibabel.save(variant, path)
        yield name, path


def lag(late, early):
    """The lag of an angle behind another, degrees, -180 to 180."""
    return (late - early + 180) % 360 - 180


def mean_phase(segments, numbers):
    """Circular mean of the phases of these segments, degrees."""
    turns = [
        np.radians(s["phase_degrees"]) for s in segments if s["segment"] in numbers and s["phase_degrees"] is not None
    ]
    return np.degrees(np.angle(np.mean(np.exp(1j * np.array(turns))))) if turns else np.nan


def phase_error(found, true):
    """Deviation of the errors of the phases of segments that contract, about their median, degrees."""
    true = {s["segment"]: s["phase_degrees"] for s in true if s["contraction"] > 0.5}
    pairs = [
        (s["phase_degrees"], true[s["segment"]])
        for s in found
        if s["phase_degrees"] is not None and true.get(s["segment"]) is not None
    ]
    errors = np.array([lag(found, true) for found, true in pairs])
    return np.std(errors - np.median(errors))


def lateness(segments, delayed):
    """How much later these segments are than the others, degrees."""
    others = [s["segment"] for s in segments if s["segment"] not in delayed]
    return lag(mean_phase(segments, delayed), mean_phase(segments, others))


def area_under_curve(scores, truths):
    """Chance that an akinetic segment has less than another one, ties halved."""
    bad, good = scores[truths], scores[~truths]
    less = (bad[:, None] < good).mean() + 0.5 * (bad[:, None] == good).mean()
    return less


def line(name, text, goal=""):
    print(f"{name:44} {text:38} {goal}")


def spread(errors):
    return f"{np.mean(errors):+.1f}, SD {np.std(errors, ddof=1):.1f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("cases", nargs="+", type=pathlib.Path)
    parser.add_argument(
        "--no-variants", action="store_true", help="leave out lost counts and rotated gates, two thirds of the time"
    )
    options = parser.parse_args()
    program = options.program.resolve()
    rows, segments, hearts, changes = [], [], [], {"lost": [], "rotated": []}
    for case in options.cases:
        truth = json.loads((case / "params.json").read_text())
        result = truth["result"]
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            found = beat(program, case / "gated.nii.gz", folder / "out")
            if found.get("ef_percent") is None:
                print(f"{case.name}: no EF: {found.get('error') or [f['code'] for f in found['flags']]}")
                continue
            if not options.no_variants:
                for name, path in variants(case / "gated.nii.gz", folder):
                    # Together with what it lacks already, the last gate would lack so much that it is left out of the
                    # curve.
                    if name == "lost" and 0.75 / found["gates"][-1]["counts_factor"] < 0.7:
                        continue
                    other = beat(program, path, folder / name)
                    if other.get("ef_percent") is None:
                        print(f"{case.name}, {name}: no EF")
                        continue
                    changes[name].append(other["ef_percent"] - found["ef_percent"])
        true = {s["segment"]: s for s in result["segments"]}
        for own in found["segments"]:
            of = true[own["segment"]]
            segments.append(
                (
                    case.name,
                    own["thickening_percent"],
                    of["thickening_percent"],
                    own["motion_mm"],
                    of.get("motion_mm", np.nan),
                    of["state"] != "normal",
                )
            )
        akinetic = any(s["state"] != "normal" for s in result["segments"])
        made = truth.get("made", "")
        delayed = [s["segment"] for s in result["segments"] if s["delay_degrees"] > 0]
        late = [lateness(of, delayed) for of in (result["segments"], found["segments"])] if delayed else [0, 0]
        hearts.append(
            (
                case.name,
                found["phase"]["sd_degrees"],
                found["phase"]["reliable"],
                akinetic,
                *late,
                found["phase"]["noise_degrees"],
                phase_error(found["segments"], result["segments"]),
            )
        )
        walls = [g["wall_ml"] for g in found["gates"]]
        swing = 100 * (max(walls) - min(walls)) / np.mean(walls)
        rows.append(
            (
                case.name,
                made,
                found["ef_percent"],
                100 * result["ef"],
                found["edv_ml"],
                result["edv_ml"],
                found["esv_ml"],
                result["esv_ml"],
                swing,
                [f["code"] for f in found["flags"]],
            )
        )
        print(
            f"{case.name:24} EF {found['ef_percent']:5.1f} of {100 * result['ef']:5.1f}  EDV {found['edv_ml']:6.1f} of "
            f"{result['edv_ml']:6.1f}  ESV {found['esv_ml']:6.1f} of {result['esv_ml']:6.1f}  {' '.join(rows[-1][-1])}",
            flush=True,
        )

    def number(column):
        return np.array([row[column] for row in rows])

    ef = number(2) - number(3)
    line(f"EF of {len(rows)}: bias, SD, points", spread(ef), "<= 1.5, <= 4")
    line("EF within 5 points; worst", f"{100 * np.mean(abs(ef) <= 5):.0f} %; {abs(ef).max():.1f}", ">= 85 %, <= 10")
    for name, at in ("EDV", 4), ("ESV", 6):
        error = 100 * (number(at) / number(at + 1) - 1)
        r = np.corrcoef(number(at), number(at + 1))[0, 1]
        line(f"{name}: bias, SD, per cent; r", f"{spread(error)}; {r:.3f}", "<= 5, <= 8 (ESV 10); >= .98")
    small = number(5) < 95
    if small.any():
        line("EF of hearts below 95 ml: worst", f"{abs(ef[small]).max():.1f} of {small.sum()}", "<= 6")
    line("muscle over the beat: worst swing", f"{number(8).max():.1f} %", "<= 3 %")

    def of(column):
        return np.array([segment[column] for segment in segments])

    for name, at, goal in ("thickening", 1, "r >= .85, SD <= 8"), ("motion", 3, "r >= .85, SD <= 1.3"):
        known = np.isfinite(of(at + 1))
        if known.any():
            found, true = of(at)[known], of(at + 1)[known]
            text = f"r {np.corrcoef(found, true)[0, 1]:.3f}, {spread(found - true)}"
            line(f"{name} by segment, pooled", text, goal)
    akinetic = of(5)
    if akinetic.any():
        line("akinetic segments by thickening: AUC", f"{area_under_curve(of(1), akinetic):.3f}", ">= .9")
        within = [
            np.corrcoef(of(1)[own], of(2)[own])[0, 1]
            for name in {h[0] for h in hearts if h[3]}
            for own in [of(0) == name]
        ]
        line(
            "thickening within hearts with akinesia: r", f"mean {np.mean(within):.2f}, least {min(within):.2f}", ">= .7"
        )
    for kind, which in ("", True), (", reliable", False):
        still = [h[1] for h in hearts if not h[3] and abs(h[4]) < 10 and (which or h[2])]
        if still:
            line(
                f"phase SD without delay and akinesia{kind}",
                f"mean {np.mean(still):.1f}, greatest {max(still):.1f}, of {len(still)}",
                "<= 8",
            )
    noise, error = (np.array([h[at] for h in hearts]) for at in (6, 7))
    r = np.corrcoef(np.log(noise), np.log(error))[0, 1]
    line("error of phases over their noise: median", f"{np.median(error / noise):.2f}; r of the logarithms {r:.2f}")
    reliable = np.array([h[2] for h in hearts])
    for kind, own in ("reliable", reliable), ("not", ~reliable):
        if own.any():
            line(
                f"error of phases, {kind}, degrees",
                f"mean {error[own].mean():.1f}, greatest {error[own].max():.1f}, of {own.sum()}",
            )
    for name, _, reliable, _, delay, late, *_ in hearts:
        if abs(delay) >= 10:
            line(f"delayed wall, {name}", f"{late:.0f} of {delay:.0f} degrees, reliable {reliable}", "within 30 %")
    for name, goal in ("lost", "within 2"), ("rotated", "within .5"):
        if changes[name]:
            line(f"EF, {name}: greatest change", f"{max(map(abs, changes[name])):.2f}", goal)


if __name__ == "__main__":
    main()
