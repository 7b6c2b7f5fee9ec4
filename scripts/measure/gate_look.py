"""Estimates the bounds of image/volume/gate_look.rs and beat_evidence.rs (crates/ventriform/src), counts what passes.

usage: gate_look.py --people SCAN.nii.gz... --gated GATED.nii.gz...

Each file of --gated holds the gates of a study, each of --people one scan; people of one grid are compared. Of both
lists every other file estimates, and the rest is held out. From them it makes what is no beat: people in chance orders,
one heart in chance sizes, scans under a ladder of filters (in order and not), one scan with more and more of its detail
(iterations), two scans with several filters each, and noise. Prints for the estimating half the range of every figure
and the bounds that follow, then for both halves how many beats are summed and how many others are refused with the
constants that stand in the sources.
"""

import argparse
import ast
import re
from collections import defaultdict
from pathlib import Path

import nibabel
import numpy as np

SOURCES = Path(__file__).resolve().parents[2] / "crates/ventriform/src/image/volume"
BLOCK_MM, FINE_BLOCK_MM = 18, 9
NARROW_MM, WIDE_MM, CUT, BRIGHT_SHARE, REACH_MM = 15, 30, 3, 0.25, 20
COUNTS = (6, 7, 8, 12, 16)
ORDERS = 400
KEPT_SHARE = 1
MANY_GATES = 10
SEED = 57


def constants():
    """The constants of the sources by name."""
    found = {}
    for name in ("gate_look.rs", "beat_evidence.rs"):
        for line in (SOURCES / name).read_text().splitlines():
            match = re.match(r"const (\w+): (f64|\[f64; 2\]) = (.+);", line)
            if match:
                found[match[1]] = ast.literal_eval(match[3])
    return found


def blocks(image, spacing, block_mm):
    """Sums over blocks as shares of the whole, and the size of a block."""
    edges = [max(1, round(block_mm / mm)) for mm in spacing]
    for axis, edge in enumerate(edges):
        image = np.add.reduceat(image, np.arange(0, image.shape[axis], edge), axis)
    return image / image.sum(), [edge * mm for edge, mm in zip(edges, spacing)]


def blurred(image, sigmas):
    """The image under a Gaussian of so many voxels along each axis; the border continues."""
    for axis, sigma in enumerate(sigmas):
        if sigma == 0:
            continue
        count, reach = image.shape[axis], int(np.ceil(CUT * sigma))
        offsets = np.arange(-reach, reach + 1)
        weights = np.exp(-0.5 * (offsets / sigma) ** 2)
        matrix = np.zeros((count, count))
        for offset, weight in zip(offsets, weights / weights.sum()):
            np.add.at(matrix, (np.arange(count), np.clip(np.arange(count) + offset, 0, count - 1)), weight)
        image = np.moveaxis(np.tensordot(matrix, image, (1, axis)), 0, axis)
    return image


def products(volumes, spacing):
    """The products of the volumes' changes, each with each, about the place that changes most."""
    fine = [blocks(volume, spacing, FINE_BLOCK_MM) for volume in volumes]
    size = np.array(fine[0][1])
    near = np.array([blurred(image, NARROW_MM / size) for image, _ in fine])
    about = np.array([blurred(image, WIDE_MM / size) for image, _ in fine])
    mean = about.mean(0)
    bright = mean > BRIGHT_SHARE * mean.max()
    contrast = np.where(bright, (near - about) / np.sqrt(np.where(bright, mean, 1) * mean.max()), 0)
    changes = contrast - contrast.mean(0)
    places = np.argwhere(np.ones(mean.shape, bool)) * size
    changes = changes.reshape(len(volumes), -1)
    peak = places[(changes**2).sum(0).argmax()]
    changes = changes[:, ((places - peak) ** 2).sum(1) <= REACH_MM**2]
    return changes @ changes.T


def course(product, orders):
    """The shares that come and go once, and once or twice, and the largest step, for each of the orders."""
    count = len(product)
    turns = 2 * np.pi * np.argsort(orders, 1) / count
    shares = []
    for times in (1, 2):
        waves = np.exp(1j * times * turns)
        shares.append(
            2 / count * np.einsum("oa,ab,ob->o", waves, product, waves.conj()).real / max(np.trace(product), 1e-300)
        )
    main = np.linalg.eigh(product)[1][:, -1]
    steps = np.abs(np.roll(main[orders], -1, 1) - main[orders]).max(1) / max(np.ptp(main), 1e-300)
    return np.array([shares[0], shares[0] + shares[1], steps]).T


def groups(distances):
    """The largest distance between groups over that within them, of groups of two or more volumes; 0 if there are
    none."""
    count = len(distances)
    inside, links = [0], []
    while len(inside) < count:
        outside = [n for n in range(count) if n not in inside]
        link = min((distances[a, b], a, b) for a in inside for b in outside)
        links.append(link)
        inside.append(link[2])
    links.sort(reverse=True)
    best = 0
    for cuts in range(1, count // 2):
        group = np.arange(count)
        for _, a, b in links[cuts:]:
            group[group == group[b]] = group[a]
        names = np.unique(group)
        stretches = all(((group == name) & (np.roll(group, -1) != name)).sum() == 1 for name in names)
        if min((group == name).sum() for name in names) < 2 or (cuts > 1 and not stretches):
            continue
        within = max(distances[a, b] for a in range(count) for b in range(count) if group[a] == group[b])
        best = max(best, links[cuts - 1][0] / max(within, 1e-12))
    return best


def coarse(volumes, spacing):
    """The figures on blocks of 18 mm: least correlation, groups, lone mean, least distance, distance over contrast,
    counts."""
    images = np.array([blocks(volume, spacing, BLOCK_MM)[0].ravel() for volume in volumes])
    count = len(images)
    others = (images.sum(0) - images) / (count - 1)
    from_others = ((images - others) ** 2).sum(1)
    distances = ((images[:, None] - images) ** 2).sum(2)
    steps = [distances[n, (n + 1) % count] for n in range(count)]
    apart = distances[distances > 0]
    totals = np.array([volume.sum() for volume in volumes])
    usual = np.median(np.sort(totals)[count // 2 :])
    contrast = ((images.mean(0) - images.mean()) ** 2).sum()
    return {
        "LEAST_CORRELATION": min(np.corrcoef(a, b)[0, 1] for a, b in zip(images, others)),
        "GROUPS_APART": groups(distances),
        "MEAN_DISTANCE": from_others.min() / max(np.median(from_others), 1e-30),
        "NOISE_STEP": apart.min() / max(np.median(steps), 1e-30) if len(apart) else 0,
        "EQUAL_DISTANCE": distances.sum() / (count * (count - 1)) / contrast,
        "MOST_COUNTS": totals.max() / usual,
        "COUNT_LOSS_SHARE": 1 - totals.min() / usual,
    }


def with_mean(gates):
    return [*gates, np.mean(gates, 0).round()]


def zoomed(image, scale):
    """The image with every length about its brightest blurred place times `scale`, by linear interpolation."""
    centre = np.unravel_index(blurred(image, (3, 3, 3)).argmax(), image.shape)
    for axis, middle in enumerate(centre):
        count = image.shape[axis]
        at = np.clip(middle + (np.arange(count) - middle) / scale, 0, count - 1)
        weights = np.clip(1 - np.abs(at[:, None] - np.arange(count)), 0, None)
        image = np.moveaxis(np.tensordot(weights, image, (1, axis)), 0, axis)
    return image


def others(people, rng):
    """What is no beat, of people on one grid: kind, volumes, and whether any order of them is none."""
    for count in COUNTS:

        def picked():
            return people[rng.integers(len(people))]

        if len(people) >= count:
            for _ in range(2):
                yield "people", [people[n] for n in rng.choice(len(people), count, False)], True
        one = picked()
        yield "sizes", [rng.poisson(zoomed(one, scale).clip(0)) for scale in rng.uniform(0.85, 1.1, count)], True
        yield "noise", [rng.poisson(one.clip(0) * 200 / one.max()) for _ in range(count)], True
        for widths in (np.linspace(0, 1.5, count), np.geomspace(0.2, 2, count)):
            filtered = [blurred(one, (width,) * 3) for width in widths]
            yield "ladder", filtered, False
            yield "ladder in no order", filtered, True
        detail = one - blurred(one, (1.5,) * 3)
        yield "iterations", [(one - detail * 0.6**step).clip(0) for step in range(count)], False
        first, second = (people[n] for n in rng.choice(len(people), 2, False))
        half = np.linspace(0, 1, (count + 1) // 2)
        yield "two scans", [blurred(scan, (width,) * 3) for scan in (first, second) for width in half][:count], False


def measured(gated, people, rng):
    """For each kind the course in every order tried, and for beats the other figures."""
    courses, figures = defaultdict(list), defaultdict(list)
    for path in gated:
        image = nibabel.load(path)
        gates = np.moveaxis(np.asarray(image.dataobj, float), 3, 0)
        spacing = image.header.get_zooms()[:3]
        own = course(products(gates, spacing), np.arange(len(gates))[None])
        print(
            f"{'/'.join(Path(path).parts[-3:-1]):32s} {len(gates):2d} gates, once {own[0, 0]:.3f}, twice "
            f"{own[0, 1]:.3f}, step {own[0, 2]:.3f}"
        )
        courses["beat"].append((len(gates), own))
        figures["beat"].append(coarse(gates, spacing))
        figures["with its mean"].append(coarse(with_mean(gates), spacing))
    images = [nibabel.load(path) for path in people]
    spacing = images[0].header.get_zooms()[:3]
    scans = [np.asarray(image.dataobj, float).clip(0) for image in images]
    for kind, volumes, shuffled in others(scans, rng):
        count = len(volumes)
        orders = np.array([rng.permutation(count) for _ in range(ORDERS)]) if shuffled else np.arange(count)[None]
        courses[kind].append((count, course(products(volumes, spacing), orders)))
        figures[kind].append(coarse(volumes, spacing))
    return courses, figures


def passes(values, bounds):
    """Whether courses of one number of volumes are those of beats."""
    once, twice, step = bounds
    return (values[:, 0] >= once) & (values[:, 1] >= twice) & (values[:, 2] <= step)


def estimated(courses, many):
    """The bounds on the course, of few or of many volumes, that let the fewest others pass and keep KEPT_SHARE of the
    beats that any bounds keep; with the share of the others that pass."""
    own = {
        kind: [value for count, value in values if (count >= MANY_GATES) == many] for kind, values in courses.items()
    }
    beats = np.concatenate(own["beat"])
    rest = [np.concatenate(values) for kind, values in own.items() if kind != "beat"]
    most = passes(beats, (0.5, 0.7, 0.9)).mean()
    best = None
    for once in np.arange(0.5, 0.9, 0.05):
        for twice in np.arange(0.7, 1, 0.05):
            for step in np.arange(0.55, 0.9, 0.05):
                bounds = once, twice, step
                if passes(beats, bounds).mean() < KEPT_SHARE * most:
                    continue
                passed = np.mean([passes(values, bounds).mean() for values in rest])
                if best is None or passed < best[0] - 1e-9:
                    best = passed, bounds
    return best


def report(name, courses, figures, known):
    bounds = [(known["LEAST_ONCE"][many], known["LEAST_TWICE"][many], known["LARGEST_STEP"]) for many in (0, 1)]
    print(f"\n{name}")
    for kind, values in courses.items():
        passed = [passes(own, bounds[count >= MANY_GATES]).mean() for count, own in values]
        apart = [
            own["GROUPS_APART"] < known["GROUPS_APART"] and own["LEAST_CORRELATION"] >= known["LEAST_CORRELATION"]
            for own in figures[kind]
        ]
        summed = sum(p * a for p, a in zip(passed, apart))
        orders = sum(len(own) for _, own in values)
        print(
            f"  {kind:20s} {summed:7.2f} of {len(values)} summed ({orders} orders; by the course alone "
            f"{sum(passed):.2f})"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--people", nargs="+", required=True)
    parser.add_argument("--gated", nargs="+", required=True)
    args = parser.parse_args()
    known, rng = constants(), np.random.default_rng(SEED)
    halves = [measured(args.gated[half::2], args.people[half::2], rng) for half in (0, 1)]
    courses, figures = halves[0]
    print("\nestimating half: range of each figure, and the bound in the sources")
    for figure in figures["beat"][0]:
        ranges = [
            f"{kind} {min(own[figure] for own in values):.4g} to {max(own[figure] for own in values):.4g}"
            for kind, values in figures.items()
        ]
        print(f"  {figure} {known.get(figure)}: " + "; ".join(ranges))
    for many, what in ((False, "fewer than"), (True, "from")):
        passed, bounds = estimated(courses, many)
        print(
            f"  course, {what} {MANY_GATES} volumes: once {bounds[0]:.2f}, twice {bounds[1]:.2f}, step "
            f"{bounds[2]:.2f}; {100 * passed:.2f} % of the others pass"
        )
    for name, half in zip(("in-sample", "held-out"), halves):
        report(name, *half, known)


if __name__ == "__main__":
    main()
