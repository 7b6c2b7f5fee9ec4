"""Images that do not state their place in the patient, and label maps."""

from __future__ import annotations

import pathlib
import pickle
from typing import Any

import nibabel
import numpy as np
import pytest

import ventriform as vf


def stored(path: pathlib.Path, data: Any, unit: str = "mm", zooms: tuple[float, ...] = (8.0, 7.0, 6.0)) -> pathlib.Path:
    """A file with both codes 0, and numbers in the fields that they switch off."""
    image = nibabel.Nifti1Image(data, None)
    image.header.set_zooms(zooms[: data.ndim])
    image.header.set_xyzt_units(unit, "sec")
    image.header["qoffset_x"] = 5.0
    image.header["srow_x"] = [8.0, 0.0, 0.0, 7.0]
    nibabel.save(image, path)
    return path


def same(one: vf.Volume, other: vf.Volume) -> None:
    assert np.array_equal(one.affine, other.affine) and one.frames == other.frames
    assert np.array_equal(one.array, other.array, equal_nan=True)
    assert one.warnings == other.warnings
    assert one.facts["affine_source"] == other.facts["affine_source"] == "pixdim"


# Equal volumes: others are asked about, unless they show a beat or a time in the header calls them gates.
DATA = np.repeat(np.random.default_rng(1).integers(0, 900, (17, 18, 19, 1)).astype(np.int16), 8, axis=3)


@pytest.mark.parametrize("data", [DATA[..., 0], DATA[..., 0].astype(np.float64) / 7.0, DATA])
@pytest.mark.parametrize("ending", ["nii", "nii.gz"])
def test_an_image_without_a_place_is_its_file(data: Any, ending: str, tmp_path: pathlib.Path) -> None:
    zooms = (8.0, 7.0, 6.0, 0.1)
    path = stored(tmp_path / f"scan.{ending}", data, zooms=zooms)
    file = vf.read(path)
    assert any("orientation" in warning for warning in file.warnings)
    same(vf.read(nibabel.load(path)), file)
    same(pickle.loads(pickle.dumps(vf.read(nibabel.load(path)))), file)
    sitk = pytest.importorskip("SimpleITK")
    same(vf.read(sitk.ReadImage(str(path))), file)


def test_metres_are_metres(tmp_path: pathlib.Path) -> None:
    path = stored(tmp_path / "scan.nii", DATA[..., 0], "meter", (0.008, 0.007, 0.006))
    assert np.allclose(vf.read(nibabel.load(path)).spacing_mm, (8.0, 7.0, 6.0))


def test_an_image_that_was_given_a_place_keeps_it(tmp_path: pathlib.Path) -> None:
    path = stored(tmp_path / "scan.nii", DATA[..., 0])
    affine = np.diag([8.0, 7.0, 6.0, 1.0])
    affine[:3, 3] = 3.0
    loaded = nibabel.load(path)
    placed = vf.read(nibabel.Nifti1Image(loaded.dataobj, affine, loaded.header))
    assert np.array_equal(placed.affine, affine) and placed.warnings == []
    sitk = pytest.importorskip("SimpleITK")
    image = sitk.ReadImage(str(path))
    image.SetOrigin((1.0, 2.0, 3.0))
    assert np.array_equal(vf.read(image).in_frame("LPS").affine[:3, 3], (1.0, 2.0, 3.0))


def test_a_label_map_of_simpleitk_is_refused_with_a_way_out() -> None:
    sitk = pytest.importorskip("SimpleITK")
    labels = sitk.GetImageFromArray(np.pad(np.ones((8, 8, 8), np.uint8), 4))
    label_map = sitk.LabelImageToLabelMap(labels)
    with pytest.raises(vf.InputError) as raised:
        vf.read(label_map)
    assert raised.value.field == "image" and "LabelMapToLabel" in raised.value.fix
    assert vf.read(sitk.LabelMapToLabel(label_map)).array.sum() == 8**3
