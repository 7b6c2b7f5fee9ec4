#!/usr/bin/env python3
"""Prints the tables of docs/quality.md: what the paper's flips gain, what the refined route
reaches, and what curvature-adaptive density does where the surface bends.

    python3 scripts/quality_table.py [--binary PATH] [--seeds 5] [--points 67,110,150,200,300]

Simulated scans (`ventriform phantom`) go through `ventriform generate`; fitness is read from
the reports. Distances and dihedral angles are measured anew here, against an iso-surface by
VTK's Flying Edges. Without --binary a release build is made. Packages that are missing
(numpy, nibabel, vtk; versions in scripts/requirements.txt) are installed in a virtual
environment under target/quality/.
"""

import argparse
import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / "target" / "quality"
NEEDED = ("numpy", "nibabel", "vtk")


def with_packages():
    """Starts this script again in an environment that has the packages, if this one lacks any."""
    if all(importlib.util.find_spec(name) for name in NEEDED):
        return
    python = WORK / "venv" / "bin" / "python"
    if Path(sys.prefix) == WORK / "venv":
        sys.exit("the packages could not be installed")
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

# Voxel in mm, noise, seed of shape and noise; no liver, so that only one surface is there.
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
    """Points at equal shares of the area, and the triangle of each."""
    random = np.random.default_rng(seed)
    areas = np.linalg.norm(area_normals(vertices, triangles), axis=1).cumsum()
    shares = (np.arange(SAMPLES) + random.random(SAMPLES)) / SAMPLES * areas[-1]
    owner = np.minimum(np.searchsorted(areas, shares), len(triangles) - 1)
    root, v = np.sqrt(random.random(SAMPLES)), random.random(SAMPLES)
    weights = np.stack([1 - root, root * (1 - v), root * v], axis=1)
    return np.einsum("ik,ikx->ix", weights, vertices[triangles[owner]]), owner


def distances(points, data):
    """Distance of every point to the surface."""
    implicit = vtk.vtkImplicitPolyDataDistance()
    implicit.SetInput(data)
    found = vtk.vtkDoubleArray()
    implicit.FunctionValue(numpy_to_vtk(np.ascontiguousarray(points), deep=True), found)
    return np.abs(vtk_to_numpy(found))


# --- the surface that models are held against -----------------------------------------------


class Reference:
    """The iso-surface of a scan, in the models' frame (LPS), and where it bends most."""

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
        self.bent = self.most_bent_fifth()
        self.bent_points = self.points[self.bent[owner]]
        self.locator = vtk.vtkStaticCellLocator()
        self.locator.SetDataSet(self.data)
        self.locator.BuildLocator()

    @staticmethod
    def enclosed(vertices, triangles):
        a, b, c = (vertices[triangles[:, k]] for k in range(3))
        return abs(np.einsum("ix,ix->", a, np.cross(b, c)) / 6)

    def most_bent_fifth(self):
        """For every triangle whether it lies in the fifth of the area of largest curvedness."""
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
        bent = np.zeros(len(order), bool)
        bent[order[areas[order].cumsum() <= areas.sum() / 5]] = True
        return bent

    def near_bent(self, points):
        """Which points lie nearest to the most bent fifth."""
        cell, part, square = vtk.reference(0), vtk.reference(0), vtk.reference(0.0)
        foot, found = [0.0] * 3, []
        for point in points:
            self.locator.FindClosestPoint(point, foot, cell, part, square)
            found.append(self.bent[int(cell)])
        return np.array(found)


# --- what is measured -----------------------------------------------------------------------


def judge(mesh, reference):
    vertices, triangles = mesh
    normals = area_normals(vertices, triangles)
    areas = np.linalg.norm(normals, axis=1)
    sides = [
        np.linalg.norm(vertices[triangles[:, k]] - vertices[triangles[:, k - 1]], axis=1)
        for k in range(3)
    ]
    # 2r/R = 16 area^2 / (perimeter/2 * abc) / 2
    ratio = 16 * areas**2 / (sum(sides) * np.prod(sides, axis=0))
    half = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    _, edge = np.unique(np.sort(half, axis=1), axis=0, return_inverse=True)
    order = np.argsort(edge.ravel(), kind="stable").reshape(-1, 2)
    n, m = (normals[order[:, k] % len(triangles)] for k in range(2))
    bends = np.degrees(
        np.arctan2(np.linalg.norm(np.cross(n, m), axis=1), np.einsum("ix,ix->i", n, m))
    )
    middles = vertices[half[order[:, 0]]].mean(axis=1)
    bent = reference.near_bent(middles)
    data = poly_data(vertices, triangles)
    there = distances(sampled(vertices, triangles, 2)[0], reference.data)
    back = distances(reference.points, data)
    corners = distances(reference.vertices, data)
    volume = reference.enclosed(vertices, triangles)
    return {
        "ratio": ratio.mean(),
        "least_ratio": ratio.min(),
        "bend": bends.mean(),
        "distance": (there.mean() + back.mean()) / 2,
        "hausdorff": max(there.max(), back.max(), corners.max()),
        "volume": abs(100 * (volume / reference.volume - 1)),
        "bent_bend": bends[bent].mean(),
        "bent_most": bends[bent].max(),
        "bent_distance": distances(reference.bent_points, data).mean(),
    }


class Bench:
    """Makes scans and models, each once."""

    def __init__(self, binary, seeds):
        self.binary, self.seeds = str(binary), seeds
        self.scans = []
        for spacing, noise, seed in PHANTOMS:
            folder = WORK / f"phantom-{seed}"
            self.run("phantom", "-o", folder, "--spacing", spacing, "--noise", noise,
                     "--seed", seed, "--liver", 0)
            scan = folder / "spect.nii.gz"
            _, report = self.model(scan, 150, 1, {})
            self.scans.append((scan, Reference(scan, report["surface"]["iso_value"])))

    def run(self, *words):
        subprocess.run([self.binary, *map(str, words)], check=True, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)

    def model(self, scan, points, seed, parameters):
        mesh, report = WORK / "model.ply", WORK / "report.json"
        words = [f"--{name.replace('_', '-')}={value}" for name, value in parameters.items()]
        self.run("generate", scan, "-o", mesh, "--report", report, "--points", points,
                 "--seed", seed, *words)
        reader = vtk.vtkPLYReader()
        reader.SetFileName(str(mesh))
        reader.Update()
        return arrays(reader.GetOutput()), json.loads(report.read_text())

    def each(self, points, parameters):
        for scan, reference in self.scans:
            for seed in range(1, self.seeds + 1):
                yield *self.model(scan, points, seed, parameters), reference

    def judged(self, points, parameters):
        """The mean of every measure."""
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
    head(title, "N", "F re-tiled", "F after flips", "gain % (least..most)", "mean 2r/R",
         "least 2r/R")
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
        row(points, f"{np.mean(before):.3f}", f"{np.mean(after):.3f}",
            f"{np.mean(gains):+.1f} ({min(gains):+.1f}..{max(gains):+.1f})",
            f"{mean0:.3f} -> {mean1:.3f}", f"{least0:.3f} -> {least1:.3f}")


def main():
    options = argparse.ArgumentParser(description=__doc__,
                                      formatter_class=argparse.RawDescriptionHelpFormatter)
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

    flips_table(bench, "Paper's route, raw fitness, local gain, no guard", "raw",
                PAPER | RAW, sizes)
    flips_table(bench, "Paper's route, normalised fitness, total gain, guard", "normalised",
                PAPER, sizes)
    flips_table(bench, "Refined route (fit and flips), raw fitness", "raw", {}, sizes)
    flips_table(bench, "Refined route (fit and flips), normalised fitness", "normalised", {},
                sizes)

    head("Refined route, measured by VTK", "N", "mean 2r/R", "least 2r/R", "mean bend °",
         "mean distance mm", "Hausdorff mm", "volume %")
    for points in sizes:
        m = bench.judged(points, {})
        row(points, f"{m['ratio']:.4f}", f"{m['least_ratio']:.3f}", f"{m['bend']:.1f}",
            f"{m['distance']:.3f}", f"{m['hausdorff']:.2f}", f"{m['volume']:.2f}")

    head("Curvature-adaptive density in the most bent fifth of the surface", "N", "adaptive",
         "mean bend °", "largest bend °", "distance mm", "Hausdorff mm, whole",
         "distance mm, whole", "mean 2r/R, whole")
    for points in [n for n in sizes if n <= 110]:
        for adaptive in ("0", "0.25", "0.5"):
            m = bench.judged(points, {"adaptive": adaptive, "adaptive_from": "0"})
            row(points, adaptive, f"{m['bent_bend']:.1f}", f"{m['bent_most']:.0f}",
                f"{m['bent_distance']:.3f}", f"{m['hausdorff']:.2f}", f"{m['distance']:.3f}",
                f"{m['ratio']:.4f}")


if __name__ == "__main__":
    main()
