"""Whatever holds a scan gives the same results, and what holds none is refused with the field and a fix."""

from __future__ import annotations

import io
import pathlib
import pickle
import shutil
from typing import Any

import nibabel
import numpy as np
import pytest
from conftest import DATA

import ventriform as vf


@pytest.fixture(scope="module")
def image(scan: pathlib.Path) -> Any:
    return nibabel.load(scan)


def figures(fit: vf.Fit) -> dict[str, bytes]:
    """The files that depend on voxels and place alone: the header of a mask repeats its scan's."""
    return {name: content for name, content in fit.files.items() if name.startswith(("mesh", "polar", "labels.seg"))}


def test_arrays_images_bytes_and_files_give_equal_fits(scan: pathlib.Path, fit: vf.Fit, image: Any) -> None:
    sitk = pytest.importorskip("SimpleITK")
    data = np.asarray(image.dataobj)
    lps = np.diag([-1.0, -1.0, 1.0, 1.0]) @ image.affine
    sources: dict[str, Any] = {
        "bytes": scan.read_bytes(),
        "nibabel": image,
        "SimpleITK": sitk.ReadImage(str(scan)),
        "array": vf.Volume(data, image.affine),
        "C order": vf.Volume(np.ascontiguousarray(data), image.affine),
        "strided": vf.Volume(np.repeat(data, 2, axis=0)[::2], image.affine),
        "big-endian": vf.Volume(data.astype(">f8"), image.affine),
        "LPS": vf.Volume(data, lps, frame="LPS"),
        "list": [str(scan)],
        "open file": io.BytesIO(scan.read_bytes()),
        "open files": [io.BytesIO(scan.read_bytes())],
    }
    for name, source in sources.items():
        made = vf.segment(source)
        assert np.array_equal(made.mask, fit.mask), name
        assert figures(made) == figures(fit), name
        assert np.array_equal(made.in_frame(fit.frame).affine, fit.affine), name


def test_an_open_file_is_read_once_and_kept(scan: pathlib.Path, tmp_path: pathlib.Path) -> None:
    with open(scan, "rb") as opened:
        volume = vf.read(opened)
    assert np.array_equal(pickle.loads(pickle.dumps(volume)).array, vf.read(scan).array)
    (tmp_path / "text.nii").write_text("no bytes")
    with open(tmp_path / "text.nii") as text, pytest.raises(vf.InputError) as raised:
        vf.read(text)
    assert raised.value.field == "source" and "'rb'" in raised.value.fix
    with pytest.raises(vf.InputError) as raised:
        vf.read(text)
    assert "closed" in raised.value.reason


def test_datasets_of_pydicom_are_their_files() -> None:
    pydicom = pytest.importorskip("pydicom")
    files = sorted([*(DATA / "dicom").rglob("*.dcm"), *(DATA / "clinical").glob("*.dcm")])
    if not files:
        pytest.skip("../shared/data/dicom is absent")
    read = 0
    for file in files[:40]:
        try:
            dataset = pydicom.dcmread(file)
        except Exception:
            continue
        try:
            theirs = vf.read(file)
        except vf.InputError as refused:
            with pytest.raises(vf.InputError) as raised:
                vf.read(dataset)
            assert "PixelData" in (refused.field, raised.value.field) or raised.value.code == refused.code
            continue
        ours = vf.read(dataset)
        assert np.array_equal(theirs.data(0), ours.data(0), equal_nan=True), file
        assert np.array_equal(theirs.affine, ours.affine)
        read += 1
        with pytest.raises(vf.InputError) as raised:
            vf.read(pydicom.dcmread(file, stop_before_pixels=True))
        assert raised.value.field == "PixelData" and raised.value.fix
    assert read > 0


def test_gates_in_one_array_and_in_one_each(gated: pathlib.Path) -> None:
    image = nibabel.load(gated)
    data = np.asarray(image.dataobj)
    together = vf.Volume(data, image.affine)
    assert together.frames == 8
    apart = [vf.Volume(data[..., gate], image.affine) for gate in range(8)]
    of_file = vf.beat(gated)
    for made in (vf.beat(together), vf.beat(apart), vf.beat(image)):
        assert np.array_equal(made.vertices, of_file.vertices)
        assert made.ef_percent == of_file.ef_percent


def test_voxels_and_place_are_those_of_the_file(scan: pathlib.Path, image: Any) -> None:
    volume = vf.read(scan)
    assert volume.shape == image.shape
    assert np.array_equal(volume.array, np.asarray(image.dataobj, dtype=np.float32))
    assert volume.array.flags.f_contiguous and volume.array.dtype == np.float32
    assert np.allclose(volume.affine, image.affine, atol=1e-4)
    turned = volume.in_frame("LPS")
    assert np.array_equal(turned.affine[:2], -volume.affine[:2])
    assert turned.frame == "LPS" and volume.facts["format"] == "NIfTI-1"
    assert np.array_equal(volume.to_nibabel().get_fdata(), volume.array)


UNUSABLE: list[tuple[str, str, Any, Any]] = [
    ("two dimensions", "array", np.zeros((4, 4)), np.eye(4)),
    ("five dimensions", "array", np.zeros((4, 4, 4, 2, 2)), np.eye(4)),
    ("empty", "array", np.zeros((0, 4, 4)), np.eye(4)),
    ("complex", "array", np.zeros((4, 4, 4), complex), np.eye(4)),
    ("objects", "array", np.full((4, 4, 4), None), np.eye(4)),
    ("ragged", "array", [[[1.0], [2.0, 3.0]]], np.eye(4)),
    ("infinite", "array", np.full((4, 4, 4), np.inf), np.eye(4)),
    ("beyond 32 bits", "array", np.full((4, 4, 4), 1e300), np.eye(4)),
    ("labels beyond 2^24", "array", np.full((4, 4, 4), 2**24 + 1), np.eye(4)),
    ("singular", "affine", np.zeros((4, 4, 4)), np.diag([1.0, 1.0, 0.0, 1.0])),
    ("3x3", "affine", np.zeros((4, 4, 4)), np.eye(3)),
    ("last row", "affine", np.zeros((4, 4, 4)), np.ones((4, 4))),
    ("NaN in the affine", "affine", np.zeros((4, 4, 4)), np.full((4, 4), np.nan)),
    ("no affine", "affine", np.zeros((4, 4, 4)), None),
]


@pytest.mark.parametrize(
    ("field", "array", "affine"), [case[1:] for case in UNUSABLE], ids=[case[0] for case in UNUSABLE]
)
def test_an_unusable_array_is_refused(field: str, array: Any, affine: Any) -> None:
    with pytest.raises(vf.InputError) as raised:
        vf.Volume(array, affine)
    error = raised.value
    assert error.field == field and error.reason and error.fix


def test_arrays_without_a_value_and_without_a_heart_are_refused() -> None:
    for voxels in (np.full((16, 16, 16), np.nan), np.zeros((16, 16, 16))):
        volume = vf.Volume(voxels, np.diag([4.0, 4.0, 4.0, 1.0]))
        for work in (vf.generate, vf.segment):
            with pytest.raises(vf.InputError) as raised:
                work(volume)
            assert raised.value.reason and raised.value.code


def test_files_that_are_absent_or_vanish_are_refused(scan: pathlib.Path, tmp_path: pathlib.Path) -> None:
    with pytest.raises(vf.InputError):
        vf.read(tmp_path / "nothing.nii.gz")
    path = shutil.copy(scan, tmp_path / "scan.nii.gz")
    volume = vf.read(path)
    pathlib.Path(path).unlink()
    with pytest.raises(vf.UnreadableError):
        vf.generate(volume)


@pytest.mark.parametrize("source", [3, None, [], object(), ["a", b"b"], {"a": 1}, 4.5, [1, 2]])
def test_what_is_no_scan_is_refused(source: Any) -> None:
    with pytest.raises(vf.InputError) as raised:
        vf.read(source)
    assert raised.value.fix


def test_parameters_are_checked_by_the_tables(scan: pathlib.Path) -> None:
    cases: list[tuple[dict[str, Any], str, str]] = [
        ({"pointz": 5}, "pointz", "points"),
        ({"points": 3}, "points", "12 to 50000"),
        ({"points": "150"}, "points", "whole number"),
        ({"points": 150.5}, "points", "whole number"),
        ({"seed": -1}, "seed", "whole number"),
        ({"seed": 2**70}, "seed", "whole number"),
        ({"mask_smoothing": float("nan")}, "mask_smoothing", "0 to 3"),
        ({"method": "new"}, "method", "paper"),
        ({"box": [1, 2]}, "box", "6"),
        ({"box": range(100)}, "box", "numbers"),
        ({"box": {"a": 1}}, "box", "number"),
        ({"label": object()}, "label", "number"),
    ]
    for parameters, field, word in cases:
        with pytest.raises(vf.InputError) as raised:
            vf.generate(scan, **parameters)
        assert raised.value.field == field and word in str(raised.value), parameters


def test_numbers_of_numpy_are_numbers(scan: pathlib.Path, model: vf.Model) -> None:
    made = vf.generate(scan, points=np.int32(100), mask_smoothing=np.float32(0.5), seed=np.uint8(1))
    assert np.array_equal(made.vertices, model.vertices)
    vf.segment(scan, resample=np.bool_(False), seed_point=None)


def test_other_arguments_are_checked(scan: pathlib.Path, tmp_path: pathlib.Path) -> None:
    work: list[tuple[str, Any]] = [
        ("model", lambda: vf.segment(scan, model=tmp_path / "none.json")),
        ("formats", lambda: vf.segment(scan, formats=["dwg"])),
        ("parts", lambda: vf.segment(scan, parts=["lid"])),
        ("reader", lambda: vf.segment(scan, reader=3)),
        ("normals", lambda: vf.segment(scan, sex="F")),
        ("frame", lambda: vf.read(scan, frame="XYZ")),
        ("progress", lambda: vf.generate(scan, progress=3)),
        ("mesh_unit", lambda: vf.measure(scan, scan, mesh_unit="inch")),
        ("cohort", lambda: vf.calibrate(tmp_path / "none")),
        ("cohort", lambda: vf.build_normals(tmp_path / "none")),
        ("size", lambda: vf.phantom(size=4)),
    ]
    for field, call in work:
        with pytest.raises(vf.InputError) as raised:
            call()
        assert raised.value.field == field and raised.value.fix, field
