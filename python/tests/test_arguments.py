"""What no table of parameters describes is refused with its field and a fix too."""

from __future__ import annotations

import pathlib
from typing import Any

import numpy as np
import pytest

import ventriform as vf

SCAN = vf.phantom(size=32, spacing_mm=8.0).volume

BAD: dict[str, tuple[str, Any]] = {
    "calibrate list": ("cohort", lambda: vf.calibrate(["a"])),  # type: ignore[arg-type]
    "calibrate mask": ("mask", lambda: vf.calibrate(".", mask=3)),  # type: ignore[arg-type]
    "calibrate name": ("name", lambda: vf.calibrate(".", name=None)),  # type: ignore[arg-type]
    "normals list": ("cohort", lambda: vf.build_normals(["a"])),  # type: ignore[arg-type]
    "evaluate None": ("cohort", lambda: vf.evaluate(None, "out")),  # type: ignore[arg-type]
    "evaluate out": ("out", lambda: vf.evaluate(".", 3)),  # type: ignore[arg-type]
    "evaluate points": ("points", lambda: vf.evaluate(".", "out", points=67)),  # type: ignore[arg-type]
    "evaluate a point": ("points", lambda: vf.evaluate(".", "out", points=[-1])),
    "evaluate words": ("points", lambda: vf.evaluate(".", "out", points="67")),  # type: ignore[arg-type]
    "evaluate models": ("models", lambda: vf.evaluate(".", "out", models="auto")),
    "evaluate method": ("method", lambda: vf.evaluate(".", "out", method="new")),
    "evaluate unit": ("mesh_unit", lambda: vf.evaluate(".", "out", mesh_unit="inch")),
    "evaluate in_sample": ("in_sample", lambda: vf.evaluate(".", "out", in_sample="case1")),
    "plot None": ("fit", lambda: vf.plot.polar(None)),  # type: ignore[arg-type]
    "plot volume": ("fit", lambda: vf.plot.polar(SCAN)),  # type: ignore[arg-type]
    "data -1": ("frame", lambda: SCAN.data(-1)),
    "data 1": ("frame", lambda: SCAN.data(1)),
    "data text": ("frame", lambda: SCAN.data("0")),  # type: ignore[arg-type]
    "profile of a path": ("text", lambda: vf.Profile("lev.json")),  # type: ignore[arg-type]
    "profile of no JSON": ("text", lambda: vf.Profile(b"xx")),
    "profile of other JSON": ("text", lambda: vf.Profile(b"{}")),
    "limits of a path": ("text", lambda: vf.NormalLimits("limits.json")),  # type: ignore[arg-type]
    "limits of no JSON": ("text", lambda: vf.NormalLimits(b"xx")),
    "formats": ("formats", lambda: vf.segment(SCAN, formats=None)),  # type: ignore[arg-type]
    "parts": ("parts", lambda: vf.segment(SCAN, parts="base")),
    "mesh_unit": ("mesh_unit", lambda: vf.measure(SCAN, SCAN, mesh_unit=1)),  # type: ignore[arg-type]
    "seed": ("seed", lambda: vf.phantom(seed=-1)),
    "large seed": ("seed", lambda: vf.phantom(seed=2**64)),
    "noise": ("noise", lambda: vf.phantom(noise="a")),  # type: ignore[arg-type]
    "size": ("size", lambda: vf.phantom(size=64.5)),  # type: ignore[arg-type]
    "sizes": ("size", lambda: vf.phantom(size=[64, 64])),
    "small": ("size", lambda: vf.phantom(size=4)),
    "spacing": ("spacing_mm", lambda: vf.phantom(spacing_mm="6")),  # type: ignore[arg-type]
    "heads": ("heads", lambda: vf.phantom(heads=3)),
    "defects": ("defects", lambda: vf.phantom(defects=[8])),  # type: ignore[arg-type]
    "a defect": ("defects", lambda: vf.phantom(defects={18: 0.5})),
    "severity": ("defects", lambda: vf.phantom(defects={8: "much"})),  # type: ignore[dict-item]
}


@pytest.mark.parametrize(("field", "call"), BAD.values(), ids=list(BAD))
def test_an_argument_that_cannot_be_used_is_refused(field: str, call: Any) -> None:
    with pytest.raises(vf.InputError) as raised:
        call()
    assert raised.value.field == field and raised.value.reason and raised.value.fix


def test_numbers_of_numpy_make_the_same_phantom() -> None:
    numbers: dict[str, Any] = {
        "size": np.int64(32),
        "spacing_mm": np.float32(8.0),
        "seed": np.uint8(1),
        "heads": np.int8(1),
    }
    made = vf.phantom(**numbers, defects={np.int64(8): np.float64(0)})  # type: ignore[dict-item]
    assert np.array_equal(made.volume.array, SCAN.array)
    each = vf.phantom(size=np.array([32, 32, 32]), spacing_mm=(8, 8, 8))  # type: ignore[arg-type]
    assert np.array_equal(each.volume.array, SCAN.array)


def test_an_error_of_the_callers_function_stays_one() -> None:
    def progress(stage: str, fraction: float) -> None:
        raise TypeError(stage)

    with pytest.raises(TypeError):
        vf.phantom(size=32, spacing_mm=8.0, progress=progress)


def test_every_function_describes_its_progress(tmp_path: pathlib.Path) -> None:
    for function in (vf.generate, vf.segment, vf.measure, vf.calibrate, vf.build_normals, vf.evaluate, vf.phantom):
        assert "\n    progress : " in (function.__doc__ or "") or "\nprogress : " in (function.__doc__ or ""), function
