"""Compares exact geodesics with pygeodesic (MMP, Kirsanov's implementation) on random surfaces.

usage: geodesics.py PROGRAM [SURFACES]

PROGRAM is the example `geodesics`: it reads a mesh with points on it as JSON and prints the distances
between all points. pygeodesic measures between vertices only, so the points become vertices of the
mesh that it gets: a point inside a triangle splits it into three, which changes no distance.
"""

import json
import subprocess
import sys

import numpy as np
from pygeodesic import geodesic

TOLERANCE = 1e-9  # relative


def sphere(rng, rows):
    """A triangulated unit sphere: rings of latitude between two poles."""
    around = 2 * rows
    vertices = [[0, 0, 1]]
    for i in range(1, rows):
        for j in range(around):
            a, b = np.pi * i / rows, 2 * np.pi * (j + 0.5 * (i % 2)) / around
            vertices.append([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])
    vertices.append([0, 0, -1])
    triangles, last = [], len(vertices) - 1
    for j in range(around):
        k = (j + 1) % around
        triangles.append([0, 1 + j, 1 + k])
        triangles.append([last, last - around + k, last - around + j])
        for i in range(rows - 2):
            p, q = 1 + i * around + j, 1 + i * around + k
            triangles += [[p, p + around, q], [q, p + around, q + around]]
    return np.array(vertices, float), np.array(triangles)


def torus(rng, around, across, minor):
    vertices, triangles = [], []
    for i in range(around):
        for j in range(across):
            a, b = 2 * np.pi * i / around, 2 * np.pi * j / across
            r = 1 + minor * np.cos(b)
            vertices.append([r * np.cos(a), r * np.sin(a), minor * np.sin(b)])
            p, q = i * across + j, (i + 1) % around * across + j
            r, s = (i + 1) % around * across + (j + 1) % across, i * across + (j + 1) % across
            triangles += [[p, q, r], [p, r, s]]
    return np.array(vertices, float), np.array(triangles)


def surface(rng, kind):
    """A random blob, spiky ball, thin sheet or ring of up to a few thousand triangles."""
    if kind == "ring":
        vertices, triangles = torus(rng, int(rng.integers(8, 40)), int(rng.integers(5, 20)), rng.uniform(0.2, 0.8))
        vertices *= 1 + 0.03 * rng.standard_normal((len(vertices), 1))
    else:
        vertices, triangles = sphere(rng, int(rng.integers(4, 24)))
        waves = rng.standard_normal((6, 3)) * 2
        bumps = 1 + 0.08 * np.sin(vertices @ waves.T + rng.uniform(0, 6, 6)).sum(axis=1)
        rough = {"blob": 0.0, "spikes": 0.15, "sheet": 0.01}[kind]
        vertices *= (bumps * (1 + rough * rng.standard_normal(len(vertices))))[:, None]
        if kind == "sheet":
            vertices[:, 2] *= 0.02
    return 30 * vertices * rng.uniform(0.5, 1.5, 3), triangles


def random_points(rng, vertices, triangles, count):
    """Rows of (triangle, barycentric coordinates): corners and interior points, at most one per triangle."""
    rows = []
    for n, t in enumerate(rng.choice(len(triangles), count, replace=False)):
        weights = np.eye(3)[rng.integers(3)] if n % 3 == 0 else rng.dirichlet([1, 1, 1])
        rows.append([int(t), *map(float, weights)])
    return rows


def with_points(vertices, triangles, points):
    """The mesh with the points inserted as vertices, and the indices of those."""
    vertices, triangles, indices = list(vertices), [list(t) for t in triangles], []
    for t, *weights in points:
        corners = triangles[t]
        if max(weights) == 1:
            indices.append(corners[int(np.argmax(weights))])
            continue
        a, b, c = corners
        new = len(vertices)
        vertices.append(sum(w * np.asarray(vertices[v]) for w, v in zip(weights, corners)))
        triangles[t] = [a, b, new]
        triangles += [[b, c, new], [c, a, new]]
        indices.append(new)
    return np.array(vertices), np.array(triangles), indices


def compare(program, vertices, triangles, points):
    """The largest relative difference between the distances of the two programs."""
    document = {"vertices": vertices.tolist(), "triangles": triangles.tolist(), "points": points}
    answer = subprocess.run([program], input=json.dumps(document), text=True, capture_output=True, check=True)
    ours = np.array(json.loads(answer.stdout))
    cut_vertices, cut_triangles, indices = with_points(vertices, triangles, points)
    algorithm = geodesic.PyGeodesicAlgorithmExact(cut_vertices, cut_triangles)
    worst = 0.0
    for i, source in enumerate(indices):
        theirs, _ = algorithm.geodesicDistances(np.array([source]), np.array(indices))
        scale = np.where(theirs > 0, theirs, 1)
        worst = max(worst, np.max(np.abs(ours[i] - theirs) / scale))
    return worst


def main(program, surfaces=48):
    rng = np.random.default_rng(1)
    failed, worst = 0, 0.0
    for n in range(int(surfaces)):
        kind = ["blob", "spikes", "sheet", "ring"][n % 4]
        vertices, triangles = surface(rng, kind)
        points = random_points(rng, vertices, triangles, 12)
        difference = compare(program, vertices, triangles, points)
        worst = max(worst, difference)
        if not difference <= TOLERANCE:
            failed += 1
            print(f"surface {n} ({kind}, {len(triangles)} triangles): differs by {difference:.2e}")
    print(f"geodesics: {surfaces} surfaces, {failed} differ, worst relative difference {worst:.1e}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
