#!/usr/bin/env python3
"""Prints tables of docs/log/quality.md: the gain of the paper's flips, the figures of the refined
route, and the effect of curvature-adaptive density where the surface is strongly curved.

    python3 scripts/measure/quality_table.py [--binary PATH] [--seeds 5] [--points 67,110,150,200,300]

`ventriform generate` makes models of simulated scans (`ventriform phantom`). Fitness is read from
its reports. Distances and dihedral angles are measured here, against an iso-surface from VTK's
Flying Edges. Without --binary the script makes a release build. It installs missing packages
(numpy, nibabel, vtk; versions in scripts/requirements.txt) in a virtual environment under
target/quality/.
"""

import argparse
import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
WORK = ROOT / "target" / "quality"
NEEDED = ("numpy", "nibabel", "vtk")


def with_packages():
    """Restarts the script in a virtual environment with the packages if any is missing."""
    if all(importlib.util.find_spec(name) for name in NEEDED):
        return
    python = WORK / "venv" / "bin" / "python"
    if Path(sys.prefix) == WORK / "venv":
        sys.exit(f"could not install {', '.join(NEEDED)} in {WORK / 'venv'}")
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", WORK / "venv"], check=True)
    pinned = (ROOT / "scripts" / "requirements.txt").read_text().split()
    wanted = [line for line in pinned if line.split("==")[0] in NEEDED]
    subprocess.run([python, "-m", "pip", "install", "--quiet", *wanted], check=True)
    os.execv(python, [python, *sys.argv])


with_packages()

import nibabel
import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

# Voxel size in mm, noise, seed of shape and noise. Without a liver the scan has one surface only.
PHANTOMS = [(3.2, 0.03, 1), (3.2, 0.07, 2), (2.0, 0.03, 3), (2.0, 0.07, 4)]
SAMPLES = 20_000
PAPER = {"method": "paper"}
RAW = {"fitness": "raw", "gain": "local", "guard": "0"}


# --- meshes ---------------------------------------------------------------------------------


def poly_data(vertices, triangles):
    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(vertices, float), deep=True))
    cells = vtk.vtkCellArray()
    ids = np.ascontiguousarray(triangles, np.int64).ravel()
    cells.SetData(3, numpy_to_vtkIdTypeArray(ids, deep=True))
    data = vtk.vtkPolyData()
    data.SetPoints(points)
    data.SetPolys(cells)
    return data


def arrays(data):
    triangles = vtk_to_numpy(data.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return vtk_to_numpy(data.GetPoints().GetData()).astype(float), triangles


def area_normals(vertices, triangles):
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2


def sampled(vertices, triangles, seed):
    """Random points, one in each equal share of the area, and the triangle of each."""
    random = np.random.default_rng(seed)
    areas = np.linalg.norm(area_normals(vertices, triangles), axis=1).cumsum()
    shares = (np.arange(SAMPLES) + random.random(SAMPLES)) / SAMPLES * areas[-1]
    owner = np.minimum(np.searchsorted(areas, shares), len(triangles) - 1)
    root, v = np.sqrt(random.random(SAMPLES)), random.random(SAMPLES)
    weights = np.stack([1 - root, root * (1 - v), root * v], axis=1)
    return np.einsum("ik,ikx->ix", weights, vertices[triangles[owner]]), owner


def distances(points, data):
    """The distance of every point to the surface."""
    implicit = vtk.vtkImplicitPolyDataDistance()
    implicit.SetInput(data)
    found = vtk.vtkDoubleArray()
    implicit.FunctionValue(numpy_to_vtk(np.ascontiguousarray(points), deep=True), found)
    return np.abs(vtk_to_numpy(found))


# --- the reference surface ------------------------------------------------------------------


class Reference:
    """The iso-surface of a scan in the models' frame (LPS), and its most curved fifth."""

    def __init__(self, scan, iso):
        image = nibabel.load(scan)
        values = np.asarray(image.dataobj, np.float32)
        grid = vtk.vtkImageData()
        grid.SetDimensions(values.shape)
        grid.GetPointData().SetScalars(numpy_to_vtk(values.ravel(order="F"), deep=True))
        edges = vtk.vtkFlyingEdges3D()
        edges.SetInputData(grid)
        edges.SetValue(0, iso)
        edges.ComputeNormalsOff()
        largest = vtk.vtkPolyDataConnectivityFilter()
        largest.SetInputConnection(edges.GetOutputPort())
        largest.SetExtractionModeToLargestRegion()
        clean = vtk.vtkCleanPolyData()
        clean.SetInputConnection(largest.GetOutputPort())
        clean.Update()
        indices, self.triangles = arrays(clean.GetOutput())
        world = nibabel.affines.apply_affine(image.affine, indices)
        self.vertices = world * [-1, -1, 1]
        self.data = poly_data(self.vertices, self.triangles)
        self.volume = self.enclosed(self.vertices, self.triangles)
        self.points, owner = sampled(self.vertices, self.triangles, 1)
        self.curved = self.most_curved_fifth()
        self.curved_points = self.points[self.curved[owner]]
        self.locator = vtk.vtkStaticCellLocator()
        self.locator.SetDataSet(self.data)
        self.locator.BuildLocator()

    @staticmethod
    def enclosed(vertices, triangles):
        a, b, c = (vertices[triangles[:, k]] for k in range(3))
        return abs(np.einsum("ix,ix->", a, np.cross(b, c)) / 6)

    def most_curved_fifth(self):
        """For every triangle: whether it belongs to the fifth of the area with the largest curvedness."""
        smooth = vtk.vtkWindowedSincPolyDataFilter()
        smooth.SetInputData(self.data)
        smooth.SetNumberOfIterations(40)
        smooth.SetPassBand(0.02)
        smooth.NormalizeCoordinatesOn()
        values = []
        for kind in ("SetCurvatureTypeToMean", "SetCurvatureTypeToGaussian"):
            curvature = vtk.vtkCurvatures()
            curvature.SetInputConnection(smooth.GetOutputPort())
            getattr(curvature, kind)()
            curvature.Update()
            values.append(vtk_to_numpy(curvature.GetOutput().GetPointData().GetScalars()))
        mean, gauss = values
        curvedness = np.sqrt(np.maximum(2 * mean**2 - gauss, 0))[self.triangles].mean(axis=1)
        areas = np.linalg.norm(area_normals(self.vertices, self.triangles), axis=1)
        order = np.argsort(-curvedness, kind="stable")
        curved = np.zeros(len(order), bool)
        curved[order[areas[order].cumsum() <= areas.sum() / 5]] = True
        return curved

    def near_curved(self, points):
        """For every point: whether the closest triangle belongs to the most curved fifth."""
        cell, part, square = vtk.reference(0), vtk.reference(0), vtk.reference(0.0)
        foot, found = [0.0] * 3, []
        for point in points:
            self.locator.FindClosestPoint(point, foot, cell, part, square)
            found.append(self.curved[int(cell)])
        return np.array(found)


# --- measures -------------------------------------------------------------------------------


def judge(mesh, reference):
    vertices, triangles = mesh
    normals = area_normals(vertices, triangles)
    areas = np.linalg.norm(normals, axis=1)
    sides = [np.linalg.norm(vertices[triangles[:, k]] - vertices[triangles[:, k - 1]], axis=1) for k in range(3)]
    # 2r/R = 16 area^2 / (perimeter/2 * abc) / 2
    ratio = 16 * areas**2 / (sum(sides) * np.prod(sides, axis=0))
    half = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    _, edge = np.unique(np.sort(half, axis=1), axis=0, return_inverse=True)
    order = np.argsort(edge.ravel(), kind="stable").reshape(-1, 2)
    n, m = (normals[order[:, k] % len(triangles)] for k in range(2))
    angles = np.degrees(np.arctan2(np.linalg.norm(np.cross(n, m), axis=1), np.einsum("ix,ix->i", n, m)))
    middles = vertices[half[order[:, 0]]].mean(axis=1)
    curved = reference.near_curved(middles)
    data = poly_data(vertices, triangles)
    there = distances(sampled(vertices, triangles, 2)[0], reference.data)
    back = distances(reference.points, data)
    corners = distances(reference.vertices, data)
    volume = reference.enclosed(vertices, triangles)
    return {
        "ratio": ratio.mean(),
        "least_ratio": ratio.min(),
        "dihedral": angles.mean(),
        "distance": (there.mean() + back.mean()) / 2,
        "hausdorff": max(there.max(), back.max(), corners.max()),
        "volume": abs(100 * (volume / reference.volume - 1)),
        "curved_dihedral": angles[curved].mean(),
        "curved_most": angles[curved].max(),
        "curved_distance": distances(reference.curved_points, data).mean(),
    }


class Bench:
    """Makes the scans and the models and measures them."""

    def __init__(self, binary, seeds):
        self.binary, self.seeds = str(binary), seeds
        self.scans = []
        for spacing, noise, seed in PHANTOMS:
            folder = WORK / f"phantom-{seed}"
            self.run("phantom", "-o", folder, "--spacing", spacing, "--noise", noise, "--seed", seed, "--liver", 0)
            scan = folder / "spect.nii.gz"
            _, report = self.model(scan, 150, 1, {})
            self.scans.append((scan, Reference(scan, report["surface"]["iso_value"])))

    def run(self, *words):
        subprocess.run(
            [self.binary, *map(str, words)], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )

    def model(self, scan, points, seed, parameters):
        mesh, report = WORK / "model.ply", WORK / "report.json"
        words = [f"--{name.replace('_', '-')}={value}" for name, value in parameters.items()]
        self.run("generate", scan, "-o", mesh, "--report", report, "--points", points, "--seed", seed, *words)
        reader = vtk.vtkPLYReader()
        reader.SetFileName(str(mesh))
        reader.Update()
        return arrays(reader.GetOutput()), json.loads(report.read_text())

    def each(self, points, parameters):
        for scan, reference in self.scans:
            for seed in range(1, self.seeds + 1):
                yield *self.model(scan, points, seed, parameters), reference

    def judged(self, points, parameters):
        """The mean of every measure over all scans and seeds."""
        rows = [judge(mesh, reference) for mesh, _, reference in self.each(points, parameters)]
        return {name: np.mean([row[name] for row in rows]) for name in rows[0]}


# --- tables ---------------------------------------------------------------------------------


def row(*cells):
    print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


def head(title, *cells):
    print(f"\n{title}\n")
    row(*cells)
    row(*["---"] * len(cells))


def flips_table(bench, title, form, parameters, sizes):
    head(title, "N", "F re-tiled", "F after flips", "gain % (least..most)", "mean 2r/R", "worst 2r/R")
    for points in sizes:
        before, after, gains, shapes = [], [], [], []
        for _, report, _ in bench.each(points, parameters):
            forms = report["fitness"]["forms"]
            start, end = forms["retiled"][form], forms["optimised"][form]
            before.append(start)
            after.append(end)
            gains.append(100 * (end / start - 1))
            ratios = [report["retile"]["shape"], report["shape"]]
            shapes.append([[r["radius_ratio"][k] for r in ratios] for k in ("mean", "min")])
        (mean0, mean1), (least0, least1) = np.mean(shapes, axis=0)
        row(
            points,
            f"{np.mean(before):.3f}",
            f"{np.mean(after):.3f}",
            f"{np.mean(gains):+.1f} ({min(gains):+.1f}..{max(gains):+.1f})",
            f"{mean0:.3f} -> {mean1:.3f}",
            f"{least0:.3f} -> {least1:.3f}",
        )


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--binary", type=Path)
    options.add_argument("--seeds", type=int, default=5)
    options.add_argument("--points", default="67,110,150,200,300")
    given = options.parse_args()
    sizes = [int(n) for n in given.points.split(",")]
    binary = given.binary
    if binary is None:
        subprocess.run(["cargo", "build", "--release", "--quiet"], cwd=ROOT, check=True)
        binary = ROOT / "target" / "release" / "ventriform"
    WORK.mkdir(parents=True, exist_ok=True)
    bench = Bench(binary, given.seeds)
    print(f"Means over {len(PHANTOMS)} phantoms, {given.seeds} seeds each.")

    flips_table(bench, "Paper's route, raw fitness, local gain, no guard", "raw", PAPER | RAW, sizes)
    flips_table(bench, "Paper's route, normalised fitness, total gain, guard", "normalised", PAPER, sizes)
    flips_table(bench, "Refined route (fit and flips), raw fitness", "raw", {}, sizes)
    flips_table(bench, "Refined route (fit and flips), normalised fitness", "normalised", {}, sizes)

    head(
        "Refined route, measured by VTK",
        "N",
        "mean 2r/R",
        "worst 2r/R",
        "mean dihedral angle °",
        "mean distance mm",
        "Hausdorff mm",
        "volume %",
    )
    for points in sizes:
        m = bench.judged(points, {})
        row(
            points,
            f"{m['ratio']:.4f}",
            f"{m['least_ratio']:.3f}",
            f"{m['dihedral']:.1f}",
            f"{m['distance']:.3f}",
            f"{m['hausdorff']:.2f}",
            f"{m['volume']:.2f}",
        )

    head(
        "Curvature-adaptive density in the most curved fifth of the surface",
        "N",
        "adaptive",
        "mean dihedral angle °",
        "largest dihedral angle °",
        "mean distance mm",
        "Hausdorff mm, whole surface",
        "mean distance mm, whole surface",
        "mean 2r/R, whole model",
    )
    for points in [n for n in sizes if n <= 110]:
        for adaptive in ("0", "0.25", "0.5"):
            m = bench.judged(points, {"adaptive": adaptive, "adaptive_from": "0"})
            row(
                points,
                adaptive,
                f"{m['curved_dihedral']:.1f}",
                f"{m['curved_most']:.0f}",
                f"{m['curved_distance']:.3f}",
                f"{m['hausdorff']:.2f}",
                f"{m['distance']:.3f}",
                f"{m['ratio']:.4f}",
            )


if __name__ == "__main__":
    main()
