"""Times ventriform against other tools. Run by scripts/measure/compare_peers.sh."""

import argparse
import functools
import json
import math
import os
import pathlib
import subprocess
import sys
import time

import nibabel
import numpy

sys.path.insert(0, str(pathlib.Path(__file__).parent / "peers"))
import plot
from clock import Ours, in_turn, show, timed

POINTS = 150
# The scaling plots: sides of the volumes in voxels (each spans 256 mm) and numbers of points.
SIDES = [64, 96, 128, 192, 256, 384, 512]
COUNTS = [100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000]
COUNTS_SIDE = 256
# Of the comparison with CGAL: side of the volume in voxels, their size in mm, number of points.
SIZES = [(64, 4.0, 150), (256, 1.0, 150), (128, 2.0, 300), (128, 2.0, 1000), (128, 2.0, 5000), (128, 2.0, 20_000)]


def heart_alone(folder, spacing):
    """The voxels of a simulated scan, and the image without everything but the heart.

    The peers cannot find the heart. They get a volume in which everything else was set to 0, and that step is not
    timed. ventriform gets the whole volume."""
    import others

    voxels = numpy.asarray(nibabel.load(folder / "spect.nii.gz").dataobj, dtype=numpy.float32)
    near = numpy.asarray(nibabel.load(folder / "lv_truth.nii.gz").dataobj) > 0
    for _ in range(round(8 / spacing)):
        near = dilated(near)
    return voxels, others.image(numpy.where(near, voxels, 0).astype(numpy.float32), [spacing] * 3)


def edge_for(cgal, others, data, iso, points):
    """The edge length at which CGAL makes about so many points. The search is not timed."""
    if cgal is None:
        return None
    surface = others.flying_edges(data, iso)
    edge = math.sqrt(4 / math.sqrt(3) * others.area(surface) / (2 * points))
    for _ in range(8):
        edge *= math.sqrt(cgal(surface, edge) / points)
    return edge


class Bench:
    def __init__(self, arguments):
        self.a = arguments
        self.work = arguments.work
        self.ventriform = str(arguments.binaries / "ventriform")
        self.stopwatch = str(arguments.binaries / "stopwatch")

    def phantom(self, side, spacing):
        """The folder of a simulated scan, which is made on the first call."""
        folder = self.work / f"phantom-{side}-{spacing:g}"
        if not (folder / "params.json").exists():
            subprocess.run(
                [self.ventriform, "phantom", "--size", str(side), "--spacing", str(spacing), "-o", str(folder)],
                check=True,
                capture_output=True,
            )
        return folder

    def as_float(self, scan, name):
        """The path of the same scan as float32, written by nibabel."""
        path = scan.parent / name
        if not path.exists():
            loaded = nibabel.load(scan)
            voxels = numpy.asarray(loaded.dataobj, dtype=numpy.float32)
            nibabel.save(nibabel.Nifti1Image(voxels, loaded.affine), path)
        return path

    def pin(self):
        os.sched_setaffinity(0, {self.a.core})

    def unpin(self):
        os.sched_setaffinity(0, set(range(os.cpu_count())))

    def keep(self, part, result):
        about = {
            "measured": time.strftime("%Y-%m-%d"),
            "cores": os.cpu_count(),
            "load": os.getloadavg()[0],
            "results": result,
        }
        (self.work / f"{part}.json").write_text(json.dumps(about, indent=1) + "\n")

    # ------------------------------------------------------------------ parts
    def speed(self):
        """Marching Cubes alone, from voxels to 150 points, and from a surface in memory to 150 points."""
        import others

        self.pin()
        remeshers = {
            name: others.Remesher(str(self.work / f"{name}.so"))
            for name in ("geogram", "cgal")
            if (self.work / f"{name}.so").exists()
        }
        result = {}
        for spacing in (3.2, 2.0):
            folder = self.phantom(128, spacing)
            ours = Ours(self.stopwatch)
            ours.ask("read", folder / "spect.nii.gz")
            iso = ours.ask("model", POINTS, 1)["iso_value"]
            voxels, alone = heart_alone(folder, spacing)
            whole = others.image(voxels, [spacing] * 3)
            name = f"Marching Cubes, 128^3 voxels of {spacing} mm"
            result[name] = in_turn(
                {
                    "ventriform": ours.turn("surface", iso),
                    "vtkFlyingEdges3D": timed(lambda: others.flying_edges(whole, iso)),
                },
                3 * self.a.rounds,
            )
            show(name, result[name])
            edge = edge_for(remeshers.get("cgal"), others, alone, iso, POINTS)

            def then(remesh, target):
                return timed(lambda: remesh(others.flying_edges(alone, iso), target))

            # The peers do not measure their result, so the first line leaves the report out.
            contestants = {
                "ventriform": ours.turn("model", POINTS, lambda number: number, without=["report"]),
                "ventriform with its report": ours.turn("model", POINTS, lambda number: number),
                "vtkFlyingEdges3D + pyacvd": then(others.acvd, POINTS),
            }
            if "geogram" in remeshers:
                contestants["vtkFlyingEdges3D + Geogram"] = then(remeshers["geogram"], POINTS)
            if "cgal" in remeshers:
                contestants["vtkFlyingEdges3D + CGAL"] = then(remeshers["cgal"], edge)
            name = f"Volume in memory to {POINTS} points, 128^3 voxels of {spacing} mm"
            result[name] = in_turn(contestants, self.a.rounds)
            show(name, result[name])
            # The steps that both have: no search for the heart, no topology control, no noise filter.
            made = others.flying_edges(alone, iso)
            contestants = {
                "ventriform": ours.turn("model", POINTS, lambda number: number, without=["surface", "report"]),
                "pyacvd": timed(lambda: others.acvd(made, POINTS)),
            }
            for name, remesh in remeshers.items():
                target = edge if name == "cgal" else POINTS
                contestants[name] = timed(lambda remesh=remesh, target=target: remesh(made, target))
            name = f"Surface in memory to {POINTS} points, 128^3 voxels of {spacing} mm"
            result[name] = in_turn(contestants, self.a.rounds)
            show(name, result[name])
            ours.close()
        self.unpin()
        self.keep("speed", result)

    def sizes(self):
        """ventriform and CGAL against the number of points and the size of the volume."""
        import others

        library = self.work / "cgal.so"
        if not library.exists():
            print("skipped: CGAL does not build here")
            return
        self.pin()
        cgal = others.Remesher(str(library))
        result = {}
        for side, spacing, points in SIZES:
            folder = self.phantom(side, spacing)
            ours = Ours(self.stopwatch)
            ours.ask("read", folder / "spect.nii.gz")
            iso = ours.ask("model", points, 1)["iso_value"]
            alone = heart_alone(folder, spacing)[1]
            made = others.flying_edges(alone, iso)
            edge = edge_for(cgal, others, alone, iso, points)
            turn = functools.partial(ours.turn, "model", points, lambda number: number)
            name = f"{points} points, {side}^3 voxels of {spacing} mm"
            result[name] = in_turn(
                {
                    "ventriform with its report": turn(),
                    "ventriform": turn(without=["report"]),
                    "vtkFlyingEdges3D + CGAL": timed(lambda: cgal(others.flying_edges(alone, iso), edge)),
                    "ventriform from the surface": turn(without=["surface", "report"]),
                    "CGAL from the surface": timed(lambda: cgal(made, edge)),
                },
                self.a.rounds if points <= POINTS else max(3, self.a.rounds // 3),
            )
            show(name, result[name])
            ours.close()
        self.unpin()
        self.keep("sizes", result)

    def reading(self):
        """Reading a compressed volume from the page cache to float32 in memory."""
        self.pin()
        scan = self.phantom(128, 3.2) / "spect.nii.gz"
        result = {}
        for name, path in {"int16": scan, "float32": self.as_float(scan, "float.nii.gz")}.items():
            ours = Ours(self.stopwatch)
            title = f"Reading .nii.gz, 128^3 {name}"
            result[title] = in_turn(
                {
                    "ventriform": ours.turn("read", path),
                    "nibabel": timed(lambda: numpy.asarray(nibabel.load(path).dataobj, dtype=numpy.float32)),
                },
                2 * self.a.rounds,
            )
            show(title, result[title])
            ours.close()
        self.unpin()
        self.keep("reading", result)

    def threads(self):
        """Two threads against one, not pinned to a core. Needs an idle machine."""
        result = {}
        for side, points in ((128, 150), (256, 1000), (256, 10_000)):
            scan = self.phantom(side, 256 / side) / "spect.nii.gz"
            workers = {n: Ours(self.stopwatch, n) for n in (2, 1)}
            for worker in workers.values():
                worker.ask("read", scan)
            title = f"Volume in memory to {points} points, {side}^3"
            result[title] = in_turn(
                {f"{n} thread{'s' * (n > 1)}": worker.turn("model", points, 1) for n, worker in workers.items()},
                self.a.rounds,
            )
            show(title, result[title])
            for worker in workers.values():
                worker.close()
        self.keep("threads", result)

    def memory(self):
        """Peak memory from file to model, against the size of the volume as float32."""
        result = {}
        print(f"\n{'Peak memory, file to 150 points':34} {'MiB':>9} {'volume':>9} {'ratio':>7}")
        for side in (128, 256, 512):
            scan = self.phantom(side, 256 / side) / "spect.nii.gz"
            for path in (scan, self.as_float(scan, "float.nii")):
                ours = Ours(self.stopwatch, 2)
                ours.ask("read", path)
                ours.ask("model", POINTS, 1)
                peak, volume = ours.peak_mib(), 4 * side**3 / 2**20
                ours.close()
                title = f"{side}^3 {path.name}"
                result[title] = {"peak_mib": peak, "volume_mib": volume, "ratio": peak / volume}
                print(f"  {title:32} {peak:9.0f} {volume:9.0f} {peak / volume:7.2f}", flush=True)
        self.keep("memory", result)

    def scaling(self):
        """Cost against the size of the surface and the number of points."""
        self.pin()
        by_surface = [self.cost(side, POINTS) for side in SIDES]
        by_points = [self.cost(COUNTS_SIDE, points) for points in COUNTS]
        self.unpin()
        self.keep("scaling", {"by_surface": by_surface, "by_points": by_points})
        for rows, key, axis, name in (
            (by_surface, "triangles", "triangles of the iso-surface", "surface"),
            (by_points, "points", "points N", "points"),
        ):
            plot.loglog(
                self.a.docs / f"scaling-{name}.svg",
                title=f"Cost against {axis}",
                axes=(axis, "processor time, ms"),
                series={
                    stage: [(r[key], r["stages_cpu_ms"][stage]) for r in rows]
                    for stage in ("total", "surface", "retile", "optimise", "report")
                },
            )
            print(f"\nCost against {axis}: cpu ms, growth exponent from the row before")
            for before, row in zip([None, *rows], rows):
                exponent = "" if before is None else growth(before, row, key)
                stages = "  ".join(f"{s} {t:.0f}" for s, t in row["stages_cpu_ms"].items())
                print(f"  {row[key]:9} {exponent:>6}  {stages}")

    def cost(self, side, points):
        """Processor time of each stage in the median run, split by the stages' share of wall time."""
        seeds = (1, 2, 3) if points < 10_000 else (1,)
        ours = Ours(self.stopwatch)
        ours.ask("read", self.phantom(side, 256 / side) / "spect.nii.gz")
        runs = sorted((ours.ask("model", points, seed) for seed in seeds), key=lambda answer: answer["cpu_ms"])
        ours.close()
        median = runs[len(runs) // 2]
        walls = {stage: ms for stage, ms in median["stages_ms"].items() if stage != "read"}
        share = median["cpu_ms"] / walls["total"]
        print(f"  {side}^3, {points} points: {median['cpu_ms']:.0f} ms", flush=True)
        return {
            "side": side,
            "points": points,
            "triangles": median["triangles"],
            "stages_cpu_ms": {stage: ms * share for stage, ms in walls.items()},
        }


def dilated(mask):
    """The mask and the 6-neighbours of its voxels (wraps around at the border)."""
    out = mask.copy()
    for axis in range(3):
        out |= numpy.roll(mask, 1, axis) | numpy.roll(mask, -1, axis)
    return out


def growth(before, row, key):
    """The exponent of the cost between two rows: log of costs over log of sizes."""
    cost = row["stages_cpu_ms"]["total"] / before["stages_cpu_ms"]["total"]
    return f"{math.log(cost) / math.log(row[key] / before[key]):.2f}"


def main():
    parts = ["speed", "sizes", "reading", "threads", "memory", "scaling"]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=" ".join(parts))
    parser.add_argument("--work", type=pathlib.Path, required=True)
    parser.add_argument("--docs", type=pathlib.Path, required=True)
    parser.add_argument("--binaries", type=pathlib.Path, required=True)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--core", type=int, default=os.cpu_count() - 1)
    arguments = parser.parse_args()
    unknown = set(arguments.parts) - set(parts)
    if unknown:
        parser.error(f"no such part: {', '.join(sorted(unknown))}")
    bench = Bench(arguments)
    for part in arguments.parts or parts:
        getattr(bench, part)()


if __name__ == "__main__":
    main()
