"""DICOM objects: the flags of the commands, and the bytes of their files."""

from __future__ import annotations

import inspect
import pathlib
import re
from datetime import datetime, timedelta, timezone
from typing import Any

import pytest
from conftest import Command
from test_same_bytes import assert_same

import ventriform as vf

WHOSE = {
    "patient_id": "4711",
    "patient_name": "Doe^Jane",
    "patient_birth_date": "19500131",
    "patient_sex": "F",
    "study_uid": "1.2.3",
    "study_date": "20261123",
    "study_id": "17",
    "accession_number": "A1",
    "referring_physician": "Roe^Richard",
    "frame_of_reference_uid": "1.2.4",
}
AT = "2026-11-23T13:45:00Z"
ALONE = {
    "help",
    "output",
    "log",
    "verbose",
    "quiet",
    "print-config",
    "format",
    "part",
    "file-limit",
    "folder-limit",
    "mesh-limit",
}
"""Flags that have another form (`formats`, `parts`, what is returned), and the limits of what is read."""


def flags(given: dict[str, Any]) -> list[str]:
    words = []
    for name, value in given.items():
        words.append("--" + name.replace("_", "-"))
        words += [] if value is True else [value]
    return words


@pytest.mark.parametrize(
    "given",
    [
        {"dicom": True, **WHOSE},
        {"dicom": True, "patient_id": "1", "study_uid": "1.2"},
        {"dicom": True, **WHOSE, "deidentify": True, "deidentify_secret": "a secret"},
    ],
    ids=["all", "least", "de-identified"],
)
@pytest.mark.parametrize("kind", ["segment", "beat", "compare"])
def test_the_bytes_are_those_of_the_command(
    kind: str,
    given: dict[str, Any],
    scan: pathlib.Path,
    gated: pathlib.Path,
    folder: pathlib.Path,
    command: Command,
    tmp_path: pathlib.Path,
) -> None:
    words = [*flags(given), "--made-at", AT, "-o", tmp_path / "out"]
    at = datetime(2026, 11, 23, 14, 45, 0, 5, tzinfo=timezone(timedelta(hours=1))) if "deidentify" in given else AT
    if kind == "segment":
        command("segment", scan, "--model", "auto", *words)
        made: vf.Fit | vf.Beat | vf.Comparison = vf.segment(scan, **given, made_at=at)
    elif kind == "beat":
        command("beat", gated, *words)
        made = vf.beat(gated, **given, made_at=at)
    else:
        stress = folder / "stress/spect.nii.gz"
        command("compare", "--stress", stress, "--rest", scan, *words)
        made = vf.compare(stress=stress, rest=scan, **given, made_at=at)
    assert any(name.endswith(".dcm") for name in made.files)
    assert_same(made.files, tmp_path / "out")


def test_the_secret_of_the_environment_counts(scan: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[str, Any] = {"dicom": True, "patient_id": "1", "study_uid": "1.2", "deidentify": True, "made_at": AT}
    stated = vf.segment(scan, **given, deidentify_secret="of the site").files["mask.dcm"]
    assert vf.segment(scan, **given).files["mask.dcm"] != stated
    monkeypatch.setenv("VENTRIFORM_DEIDENTIFY_SECRET", "of the site")
    assert vf.segment(scan, **given).files["mask.dcm"] == stated


@pytest.mark.parametrize(
    "given, field",
    [
        ({"dicom": True}, "patient_id"),
        ({"dicom": True, "patient_id": "1"}, "study_uid"),
        ({"dicom": True, "patient_id": "1", "study_uid": "..", "made_at": AT}, "study_uid"),
        ({"dicom": True, "patient_id": 1, "study_uid": "1.2"}, "patient_id"),
        ({"dicom": True, "patient_id": "1", "study_uid": "1.2", "patient_sex": "X"}, "patient_sex"),
        ({"dicom": True, **WHOSE, "made_at": "yesterday"}, "made_at"),
        ({"dicom": True, **WHOSE, "made_at": datetime(2026, 11, 23)}, "made_at"),
        ({"dicom": True, **WHOSE, "made_at": "2026-11-23"}, "made_at"),
        ({"dicom": True, **WHOSE, "deidentify_secret": "x"}, "deidentify_secret"),
        ({"patient_id": "1"}, "patient_id"),
        ({"made_at": AT}, "made_at"),
        ({"dicom": "yes"}, "dicom"),
        ({"dicom": None}, "dicom"),
        ({"dicom": True, "patient": "x"}, "patient"),
    ],
)
def test_what_cannot_be_written_is_refused(given: dict[str, Any], field: str, scan: pathlib.Path) -> None:
    with pytest.raises(vf.InputError) as caught:
        vf.segment(scan, **given)
    assert field in str(caught.value)


@pytest.mark.parametrize("kind", ["segment", "beat", "compare", "generate", "measure", "calibrate", "evaluate"])
def test_every_flag_of_a_command_is_a_parameter(kind: str, command: Command) -> None:
    known = set(inspect.signature(getattr(vf, kind)).parameters)
    listed = set(re.findall(r"^\s+(?:-\w, )?--([a-z0-9-]+)", command(kind, "--help"), re.M))
    missing = {flag for flag in listed - ALONE if flag.replace("-", "_") not in known}
    # What `Model.save_report` takes.
    own = {"report", "deidentify"} if kind == "generate" else set()
    assert not missing - own, missing
