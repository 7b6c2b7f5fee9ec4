"""What a caller holds is the caller's: editing it changes nothing that the package holds."""

from __future__ import annotations

import pathlib
import pickle
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import ventriform as vf


def arrays(thing: Any, path: str = "", depth: int = 0) -> Iterator[tuple[str, Callable[[Any], Any]]]:
    """Every array that public attributes and methods without arguments give, and of the package's objects among them
    again: where it is, and how to get it from `thing`."""
    for name in dir(thing):
        if name.startswith("_") or name.startswith(("to_", "save", "mask_image", "plot", "from_")):
            continue
        try:
            value = getattr(thing, name)
            value = value() if callable(value) and not isinstance(value, type) else value
        except (TypeError, vf.InputError):
            continue

        def get(own: Any, name: str = name) -> Any:
            found = getattr(own, name)
            return found() if callable(found) else found

        yield from _within(value, f"{path}.{name}", get, depth)


def _within(value: Any, path: str, get: Callable[[Any], Any], depth: int) -> Iterator[tuple[str, Callable[[Any], Any]]]:
    if isinstance(value, np.ndarray):
        yield path, get
    elif isinstance(value, dict) and depth < 2:
        for key, one in value.items():
            yield from _within(one, f"{path}[{key}]", lambda own, key=key, get=get: get(own)[key], depth + 1)
    elif isinstance(value, list) and value and depth < 2:
        yield from _within(value[0], f"{path}[0]", lambda own, get=get: get(own)[0], depth + 1)
    elif type(value).__module__.startswith("ventriform._results") and depth < 2:
        for inner, more in arrays(value, path, depth + 1):
            yield inner, lambda own, get=get, more=more: more(get(own))


def made(kind: str, request: pytest.FixtureRequest, scan: pathlib.Path) -> Any:
    if kind == "volume":
        return vf.read(scan)
    if kind == "beat":
        return vf.beat(request.getfixturevalue("gated"))
    if kind == "comparison":
        return vf.compare(stress=scan.parent.parent / "stress/spect.nii.gz", rest=scan)
    if kind == "phantom":
        return vf.phantom(size=32, length_mm=60, width_mm=45)
    return request.getfixturevalue(kind)


@pytest.mark.parametrize("kind", ["volume", "fit", "model", "beat", "phantom"])
@pytest.mark.parametrize("frame", ["RAS", "LPS"])
def test_no_array_is_the_packages_memory(
    kind: str, frame: str, request: pytest.FixtureRequest, scan: pathlib.Path
) -> None:
    thing = made(kind, request, scan)
    thing = thing.in_frame(frame) if hasattr(thing, "in_frame") else thing
    before = pickle.dumps(thing)
    found = list(arrays(thing))
    assert found, kind
    for path, get in found:
        kept = get(thing).copy()
        edited = get(thing)
        if edited.size == 0:
            continue
        try:
            edited[...] = 1 - edited if edited.dtype != bool else ~edited
        except ValueError:
            assert not edited.flags.writeable
        assert np.array_equal(get(thing), kept, equal_nan=kept.dtype.kind == "f"), path
    assert pickle.dumps(thing) == before


def test_vertices_that_are_assigned_are_the_surfaces_own(fit: vf.Fit, model: vf.Model, tmp_path: pathlib.Path) -> None:
    truth = vf.measure(fit, model).jaccard
    moved = model.in_frame("LPS")
    moved.vertices += 5.0
    assert vf.measure(fit, model).jaccard == truth != vf.measure(fit, moved).jaccard
    again = pickle.loads(pickle.dumps(moved))
    assert np.array_equal(again.vertices, moved.vertices)
    assert np.array_equal(again.in_frame("RAS").vertices, moved.in_frame("RAS").vertices)
    for use in (
        lambda: moved.save(tmp_path / "lv.stl"),
        lambda: moved.to_bytes("glb"),
        lambda: vf.segment(fit.mask_image(), model=moved),
    ):
        with pytest.raises(vf.InputError, match="assigned"):
            use()
    for wrong in ([1.0, 2.0], moved.vertices[1:], np.full_like(moved.vertices, np.nan), "no"):
        with pytest.raises(vf.InputError, match="vertices"):
            moved.vertices = wrong
    wall = fit.surface
    wall.vertices = wall.vertices + 8.0
    assert vf.measure(fit, wall).jaccard < vf.measure(fit, fit.surface).jaccard


def test_reports_are_the_callers(fit: vf.Fit) -> None:
    fit.report.flags.append(vf.Flag("own", "edited"))  # type: ignore[arg-type]
    fit.report.to_dict()["fit"]["confidence"] = 0.0
    assert "own" not in [flag.code for flag in fit.flags] and fit.confidence > 0
    fit.walls.clear()
    assert fit.walls


def test_numpy_sees_the_voxels_of_a_volume(scan: pathlib.Path, gated: pathlib.Path) -> None:
    volume = vf.read(scan)
    assert np.array_equal(np.asarray(volume), volume.array)
    assert np.asarray(volume, dtype=np.float64).dtype == np.float64
    assert np.mean(volume) == volume.array.mean()
    beat = vf.read(gated)
    assert np.asarray(beat).shape == (*beat.shape, beat.frames)
    assert np.array_equal(np.asarray(vf.Volume(np.asarray(beat), beat.affine)), np.asarray(beat))
