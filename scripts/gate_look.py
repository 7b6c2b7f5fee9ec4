"""Measures what tells gates of a beat from other volumes: the figures behind the bounds of crates/ventriform/src/volume/gate_look.rs.

usage: gate_look.py GATED.nii.gz...

Each file holds the gates of a study, all on one grid. Prints for each: the least correlation of a gate with the mean of the others,
the distance between groups over that within (0: no groups), the least distance of a volume from the mean of the others over the usual one, and the
least distance of two volumes over the usual step. Then the same of what is no beat: the studies' sums as scans of several people, two of
them with three and four filters each as reconstructions of two scans, and the gates with their mean as one more.
"""
import sys

import nibabel
import numpy as np

BLOCK_MM = 18
FILTERS_VOXELS = (0, 0.3, 0.5, 0.8)


def blurred(image, sigma):
    """The image after a Gaussian filter."""
    if sigma == 0:
        return image
    frequencies = np.meshgrid(*[np.fft.fftfreq(n) for n in image.shape], indexing="ij")
    square = sum(f**2 for f in frequencies)
    return np.fft.ifftn(np.fft.fftn(image) * np.exp(-2 * (np.pi * sigma) ** 2 * square)).real


def blocks(image, spacing):
    """Means over blocks, scaled to a sum of 1."""
    edges = [max(1, round(BLOCK_MM / mm)) for mm in spacing]
    starts = [np.arange(0, n, edge) for n, edge in zip(image.shape, edges)]
    for axis, start in enumerate(starts):
        image = np.add.reduceat(image, start, axis)
    return image.ravel() / image.sum()


def groups(distances):
    """The largest distance between groups over that within them, of groups of two or more volumes; 0 if there are none."""
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


def figures(volumes, spacing):
    images = np.array([blocks(volume, spacing) for volume in volumes])
    count = len(images)
    others = (images.sum(0) - images) / (count - 1)
    correlation = min(np.corrcoef(a, b)[0, 1] for a, b in zip(images, others))
    from_others = ((images - others) ** 2).sum(1)
    distances = ((images[:, None] - images) ** 2).sum(2)
    steps = [distances[n, (n + 1) % count] for n in range(count)]
    apart = distances[distances > 0]
    least = apart.min() / max(np.median(steps), 1e-30) if len(apart) else 0
    lone = from_others.min() / max(np.median(from_others), 1e-30)
    return correlation, groups(distances), lone, least


def show(name, volumes, spacing):
    values = figures(volumes, spacing)
    print(f"{name:40s} {len(volumes):2d} volumes" + "".join(f"{value:9.4f}" for value in values))


def main():
    print(" " * 52 + "  correl.   groups     lone    least")
    sums = []
    for path in sys.argv[1:]:
        image = nibabel.load(path)
        gates = np.moveaxis(np.asarray(image.dataobj, float), 3, 0)
        spacing = image.header.get_zooms()[:3]
        show(path[-40:], gates, spacing)
        show("  with their mean", [*gates, gates.mean(0).round()], spacing)
        sums.append((gates.sum(0), spacing))
    shape = sums[0][0].shape
    alike = [scan for scan, _ in sums if scan.shape == shape]
    show("several people", alike, sums[0][1])
    for one, other in zip(alike, alike[1:]):
        for many in (3, 4):
            filters = FILTERS_VOXELS[:many]
            scans = [blurred(scan, sigma) for scan in (one, other) for sigma in filters]
            show("  two scans reconstructed", scans, sums[0][1])


if __name__ == "__main__":
    main()
