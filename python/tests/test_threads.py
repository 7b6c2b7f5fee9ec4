"""Calls on a number of threads, and the extras that errors name."""

from __future__ import annotations

import importlib.metadata
import inspect
import pathlib
import re
import sys
from typing import Any

import pytest

import ventriform as vf

CALLS = (
    "read",
    "generate",
    "segment",
    "beat",
    "compare",
    "measure",
    "calibrate",
    "build_normals",
    "evaluate",
    "phantom",
)


@pytest.mark.parametrize("name", CALLS)
def test_every_call_takes_threads(name: str) -> None:
    assert "threads" in inspect.signature(getattr(vf, name)).parameters


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_the_bytes_are_the_same_on_any_number(threads: int, scan: pathlib.Path, fit: vf.Fit) -> None:
    assert dict(vf.segment(scan, threads=threads).files) == dict(fit.files)
    assert vf.read(scan, threads=threads).shape == fit.mask.shape
    assert vf.measure(fit, fit, threads=threads).jaccard == 1.0


@pytest.mark.parametrize("wrong", [0, -1, 1.5, True, "2", 10**9])
def test_what_is_no_number_of_threads_is_refused(wrong: Any, scan: pathlib.Path) -> None:
    with pytest.raises(vf.InputError, match="threads"):
        vf.generate(scan, points=60, threads=wrong)
    with pytest.raises(vf.InputError, match="threads"):
        vf.read(scan, threads=wrong)


def test_threads_that_work_are_those_asked_for(scan: pathlib.Path) -> None:
    before = set(pathlib.Path("/proc/self/task").iterdir()) if sys.platform == "linux" else set()
    if not before:
        pytest.skip("the kernel lists no threads")
    seen = 0

    def look(*_: object) -> None:
        nonlocal seen
        seen = max(seen, len(set(pathlib.Path("/proc/self/task").iterdir()) - before))

    vf.generate(scan, points=60, threads=5, progress=look)
    assert 5 <= seen <= 6, "five that work, and one that waits for them"


def test_extras_that_errors_name_exist() -> None:
    package = pathlib.Path(vf.__file__).parent
    named = {
        name for file in package.glob("*.py") for name in re.findall(r'extra\("[^"]+", "([^"]+)"\)', file.read_text())
    }
    assert {"nibabel", "tqdm", "simpleitk"} <= named
    assert named <= set(importlib.metadata.metadata("ventriform").get_all("Provides-Extra") or [])


def test_a_missing_extra_is_named(scan: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("tqdm", "tqdm.auto"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(vf.MissingExtraError, match=r"tqdm: pip install 'ventriform\[tqdm\]'"):
        vf.generate(scan, points=60, progress=True)
