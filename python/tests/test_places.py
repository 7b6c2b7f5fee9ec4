"""Points and directions go in by the frame that they come out in."""

from __future__ import annotations

import copy
import json
import pathlib
import pickle

import numpy as np
import pytest

import ventriform as vf
from ventriform import _documents, _tables, reports


def test_every_place_of_the_tables_is_known() -> None:
    for command in ("generate", "segment", "beat", "compare", "calibrate", "normals"):
        for row in _tables.rows(command):
            assert ("LPS" in row["summary"] and row["kind"] in ("numbers", "direction")) == _documents.is_place(
                row["name"]
            ), row
            assert (row["kind"] == "points") == _documents.are_points(row["name"]), row
    for function in (vf.segment, vf.beat, vf.compare):
        text = (function.__doc__ or "").partition("Parameters")[2].replace("in RAS and 0,-1,0 in LPS", "")
        of_meshes = [line for line in text.splitlines() if "LPS" in line and "SPACE" not in line and "mesh" not in line]
        assert not of_meshes, of_meshes


def test_every_place_of_the_reports_is_known() -> None:
    for name, fields in _documents.PLACES.items():
        assert set(fields) <= set(getattr(reports, name).__annotations__), name


@pytest.mark.parametrize("frame", ["RAS", "LPS"])
def test_what_a_report_says_can_be_given_back(scan: pathlib.Path, fit: vf.Fit, frame: str) -> None:
    volume = vf.read(scan, frame=frame)
    first = vf.segment(volume)
    assert first.frame == frame and dict(first.files) == dict(fit.files)
    axis = first.report.fit.long_axis
    assert axis is not None and isinstance(axis.base, vf.Coordinates) and axis.base.frame == frame
    nearest = np.linalg.norm(first.surface.vertices - axis.apex, axis=1).min()
    assert nearest < 15, "the report's apex lies at the surface's"
    plain = vf.segment(volume, base=np.array(axis.base), center=list(first.report.localisation.centre))
    typed = vf.segment(scan, base=axis.base, center=first.report.localisation.centre)
    in_lps = vf.segment(volume.in_frame("LPS"), base=axis.base.in_frame("LPS"), center=first.report.localisation.centre)
    assert dict(plain.files) == dict(typed.files) == dict(in_lps.files)
    given = json.loads(plain.files["report.json"])["parameters"]["base"]
    assert np.allclose(given, axis.base.in_frame("LPS"))
    assert np.linalg.norm(np.array(plain.report.fit.long_axis.base) - axis.base) < 15  # type: ignore[union-attr]
    again = plain.report.parameters
    assert again["base"].frame == frame
    repeated = vf.segment(volume, **{name: again[name] for name in ("base", "center")})
    assert dict(repeated.files) == dict(plain.files)


def test_points_of_the_wall_go_in_by_the_frame_that_they_come_out_in(scan: pathlib.Path) -> None:
    volume = vf.read(scan, frame="RAS")
    plain = vf.segment(volume)
    apex = np.array(plain.report.fit.long_axis.apex)  # type: ignore[union-attr]
    base = np.array(plain.report.fit.long_axis.base)  # type: ignore[union-attr]
    beyond = apex + 4 * (apex - base) / np.linalg.norm(apex - base)
    pulled = vf.segment(volume, outer_through=[beyond])
    assert np.linalg.norm(pulled.surface.vertices - beyond, axis=1).min() < 6
    in_lps = vf.segment(volume.in_frame("LPS"), outer_through=beyond[None] * [-1, -1, 1])
    assert dict(in_lps.files) == dict(pulled.files)
    (stated,) = pulled.report.parameters["outer_through"]
    assert stated.frame == "RAS" and np.allclose(stated, beyond)
    again = vf.segment(volume, outer_through=pulled.report.parameters["outer_through"])
    assert dict(again.files) == dict(pulled.files)
    for wrong in (5, "1,2,3", [1, 2, 3], [[1, 2]]):
        with pytest.raises(vf.InputError) as refused:
            vf.segment(volume, outer_through=wrong)  # type: ignore[arg-type]
        assert refused.value.field == "outer_through"


def test_each_scan_of_a_comparison_has_its_frame(folder: pathlib.Path) -> None:
    stress, rest = (folder / name / "spect.nii.gz" for name in ("stress", "rest"))
    base = vf.segment(stress).report.localisation.centre
    by_name = vf.compare(stress=vf.read(stress, frame="LPS"), rest=rest, stress_center=list(base.in_frame("LPS")))
    typed = vf.compare(stress=stress, rest=rest, stress_center=base)
    assert dict(by_name.files) == dict(typed.files) and by_name.frame == "LPS" and typed.frame == "RAS"
    with pytest.raises(vf.InputError, match="rest in RAS"):
        vf.compare(stress=vf.read(stress, frame="LPS"), rest=rest, superior=[0.0, 0.0, 1.0])
    with pytest.raises(TypeError):
        vf.compare(stress, rest)  # type: ignore[misc]


def test_coordinates() -> None:
    point = vf.Coordinates([1, 2, 3], frame="LPS")
    assert point.in_frame("RAS") == [-1.0, -2.0, 3.0] and point.in_frame("LPS") == [1.0, 2.0, 3.0]
    for other in (copy.copy(point), copy.deepcopy(point), pickle.loads(pickle.dumps(point))):
        assert other == point and other.frame == "LPS"
    assert repr(point) == "Coordinates([1.0, 2.0, 3.0], frame='LPS')"
    for wrong in ([1, 2], [1, 2, float("nan")], "abc", None, [1, 2, "x"]):
        with pytest.raises(vf.InputError):
            vf.Coordinates(wrong)  # type: ignore[arg-type]
    with pytest.raises(vf.InputError):
        vf.Coordinates([1, 2, 3], frame="ITK")


@pytest.mark.parametrize("wrong", ["1,2,3", [1, 2], [1, 2, 3, 4], [1, None, 3], 5, [[1, 2, 3]], np.zeros((3, 3))])
def test_what_is_no_point_is_refused(scan: pathlib.Path, wrong: object) -> None:
    with pytest.raises(vf.InputError, match="center"):
        vf.segment(scan, center=wrong)
