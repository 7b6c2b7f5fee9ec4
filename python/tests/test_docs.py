"""What docs/python.md and the README show in Python runs as it stands."""

from __future__ import annotations

import pathlib
import re
import shutil

import pytest
from conftest import ROOT


@pytest.mark.parametrize("page", ["docs/python.md", "README.md"])
def test_the_code_of_a_page_runs(
    page: str,
    folder: pathlib.Path,
    gated: pathlib.Path,
    raw: pathlib.Path,
    tmp_path: pathlib.Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for case in ("rest", "stress"):
        shutil.copy(folder / case / "spect.nii.gz", tmp_path / f"{case}.nii.gz")
    shutil.copy(folder / "rest/lv_truth.nii.gz", tmp_path / "truth.nii.gz")
    shutil.copy(tmp_path / "rest.nii.gz", tmp_path / "scan.nii.gz")
    shutil.copy(gated, tmp_path / "gated.nii.gz")
    shutil.copy(raw, tmp_path / "raw.dcm")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    assert blocks
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, page, "exec"), names)
