"""Ctrl-C ends a call soon, wherever it is in its work: `ended_calls.py` ends each at many moments.

ENDED_MOMENTS: moments of each call (default 4).
"""

from __future__ import annotations

import json
import os
import pathlib
import shutil
import subprocess
import sys
from typing import Any

import nibabel
import numpy as np
import pytest
from conftest import Command

import ventriform as vf

#: Processor time within which a call ends. Up to 25 ms of it pass until the calling thread looks for signals.
MOST_SECONDS_TO_END = 0.2

MOMENTS = os.environ.get("ENDED_MOMENTS", "4")

CALLS = [
    "generate",
    "generate from noise",
    "segment",
    "beat",
    "compare",
    "measure",
    "measure surfaces",
    "calibrate",
    "evaluate",
    "build_normals",
    "read",
    "phantom",
]


@pytest.fixture(scope="module")
def inputs(
    folder: pathlib.Path, gated: pathlib.Path, command: Command, tmp_path_factory: pytest.TempPathFactory
) -> pathlib.Path:
    """The inputs of every call."""
    made = tmp_path_factory.mktemp("ended")
    shutil.copy(gated, made / "gated.nii.gz")
    for case in ("rest", "stress"):
        shutil.copytree(folder / case, made / case)
    for name, case in (("p0", "rest"), ("p1", "stress"), ("t0", "rest")):
        (made / "cohort" / name).mkdir(parents=True)
        for ours, theirs in (("spect", "spect"), ("lv_expert_img", "lv_truth"), ("lv_truth", "lv_truth")):
            shutil.copy(folder / case / f"{theirs}.nii.gz", made / "cohort" / name / f"{ours}.nii.gz")
    command("phantom", "--normal", "--cases", 12, "-o", made / "healthy")
    # Blocks, which pack and unpack quickly, of whole numbers, whose labels are counted.
    coarse = np.random.default_rng(1).integers(0, 4, (90, 90, 90)).astype(np.uint8)
    voxels = coarse.repeat(4, 0).repeat(4, 1).repeat(4, 2)
    nibabel.save(nibabel.Nifti1Image(voxels, np.eye(4)), made / "large.nii.gz")
    return made


@pytest.mark.parametrize("call", CALLS)
def test_a_call_ends_soon_at_any_moment(call: str, inputs: pathlib.Path) -> None:
    script = pathlib.Path(__file__).with_name("ended_calls.py")
    made = subprocess.run([sys.executable, script, call, inputs, MOMENTS], capture_output=True, text=True, timeout=600)
    assert made.returncode == 0, made.stderr
    seconds = json.loads(made.stdout)
    # At the last moments the work may have ended.
    assert len(seconds) >= int(MOMENTS) // 2, seconds
    assert max(seconds) < MOST_SECONDS_TO_END, seconds


def test_an_evaluation_goes_on_where_it_was_ended(inputs: pathlib.Path, tmp_path: pathlib.Path) -> None:
    chosen: dict[str, Any] = {"points": [67], "models": ["optimised", "auto"]}
    for last in (0.0, 0.3, 0.5):

        def end(step: str, fraction: float, last: float = last) -> None:
            if step != "models" and fraction > last:
                raise LookupError(step)

        with pytest.raises(LookupError):
            vf.evaluate(inputs / "cohort", tmp_path / "ended", progress=end, **chosen)
    again = vf.evaluate(inputs / "cohort", tmp_path / "ended", **chosen)
    # No fit is taken for lost because the caller ended it.
    assert again.problems == []
    assert again.to_dict() == vf.evaluate(inputs / "cohort", tmp_path / "whole", **chosen).to_dict()
