"""Ends one call of the package at many moments, and prints how much processor time it took until it ended.

python ended_calls.py CALL FOLDER MOMENTS prints a JSON list of seconds. FOLDER holds what `test_ended_calls.py` puts
there.

Moments and delays are processor time of this process: another program that has the processor meanwhile changes neither.
"""

from __future__ import annotations

import json
import os
import pathlib
import signal
import sys
import threading
import time
from collections.abc import Callable

# Before the package makes its threads: of one thread processor time is time.
os.environ["RAYON_NUM_THREADS"] = "1"

import numpy as np

import ventriform as vf


class Ended(Exception):
    """What the signal's handler raises."""


def volume(seed: int) -> vf.Volume:
    """Many pieces of a label."""
    side = 160
    random = np.random.default_rng(seed)
    coarse = random.integers(0, 2, (side // 4,) * 3).astype(np.float32)
    return vf.Volume(coarse.repeat(4, 0).repeat(4, 1).repeat(4, 2), np.diag([1.0, 1.0, 1.0, 1.0]))


def surface() -> bytes:
    """A sphere of many triangles, each with its own corners, as STL."""
    rings, around = 300, 600
    u, v = np.meshgrid(np.linspace(0.0, np.pi, rings + 1), np.arange(around) * 2.0 * np.pi / around, indexing="ij")
    points = 40.0 * np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], axis=-1).astype(np.float32)
    points[0], points[-1] = (0.0, 0.0, 40.0), (0.0, 0.0, -40.0)
    right = np.roll(points, -1, axis=1)
    upper = np.stack([points[:-1], points[1:], right[1:]], axis=-2).reshape(-1, 3, 3)
    lower = np.stack([points[:-1], right[1:], right[:-1]], axis=-2).reshape(-1, 3, 3)
    triangles = np.concatenate([upper, lower])
    a, b, c = (triangles[:, corner] for corner in range(3))
    triangles = triangles[~((a == b).all(1) | (b == c).all(1) | (c == a).all(1))]
    record = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    record["corners"] = triangles
    return bytes(80) + np.uint32(len(triangles)).tobytes() + record.tobytes()


def calls(folder: pathlib.Path) -> dict[str, Callable[[], Callable[[], object]]]:
    """For each name what prepares a call, and gives it."""
    scan, gated, cohort = folder / "rest/spect.nii.gz", folder / "gated.nii.gz", folder / "cohort"
    out = folder / f"evaluation{os.getpid()}"

    def of_volumes() -> Callable[[], object]:
        a, b = volume(1), volume(2)
        return lambda: vf.measure(a, b)

    def of_surfaces() -> Callable[[], object]:
        sphere = surface()
        return lambda: vf.measure(sphere, sphere)

    def of_noise() -> Callable[[], object]:
        random = np.random.default_rng(3)
        noise = vf.Volume(random.normal(size=(224,) * 3).astype(np.float32), np.diag([1.5, 1.5, 1.5, 1.0]))
        return lambda: vf.generate(noise)

    def of_file() -> Callable[[], object]:
        path = folder / "large.nii.gz"
        return lambda: vf.read(path)

    def fresh_evaluation() -> object:
        import shutil

        shutil.rmtree(out, ignore_errors=True)
        return vf.evaluate(cohort, out, points=[67], models=["reference", "optimised", "auto"], leave_one_out=True)

    return {
        "generate": lambda: lambda: vf.generate(scan, points=2000, starts=4),
        "generate from noise": of_noise,
        "segment": lambda: lambda: vf.segment(scan),
        "beat": lambda: lambda: vf.beat(gated),
        "compare": lambda: lambda: vf.compare(stress=folder / "stress/spect.nii.gz", rest=scan),
        "measure": of_volumes,
        "measure surfaces": of_surfaces,
        "calibrate": lambda: lambda: vf.calibrate(cohort),
        "evaluate": lambda: fresh_evaluation,
        "build_normals": lambda: lambda: vf.build_normals(folder / "healthy", mixed=True),
        "read": of_file,
        "phantom": lambda: lambda: vf.phantom(size=192, spacing_mm=2.0),
    }


def ended(call: Callable[[], object], after: float) -> float | None:
    """The seconds until `call` ended once the signal was sent, `after` seconds of processor time after its
    beginning."""
    begin, sent, armed = time.process_time(), [0.0], True

    def end(number: int, frame: object) -> None:
        # The call may have ended by itself meanwhile.
        if armed:
            raise Ended

    def send() -> None:
        while armed and time.process_time() < begin + after:
            time.sleep(0.002)
        if armed:
            sent[0] = time.process_time()
            signal.raise_signal(signal.SIGINT)

    signal.signal(signal.SIGINT, end)
    sender = threading.Thread(target=send)
    sender.start()
    try:
        call()
    except Ended:
        return time.process_time() - sent[0]
    finally:
        armed = False
        sender.join()
    return None


def main() -> None:
    name, folder, moments = sys.argv[1], pathlib.Path(sys.argv[2]), int(sys.argv[3])
    call = calls(folder)[name]()
    # What is made once a process is made before.
    vf.phantom(size=32, spacing_mm=8.0)
    begin = time.process_time()
    call()
    whole = time.process_time() - begin
    seconds = [ended(call, whole * (moment + 0.5) / moments) for moment in range(moments)]
    print(json.dumps([one for one in seconds if one is not None]))


if __name__ == "__main__":
    main()
