"""Masked arrays."""

from __future__ import annotations

import nibabel
import numpy as np
import pytest

import ventriform as vf

AFFINE = np.diag([4.0, 4.0, 4.0, 1.0])


@pytest.mark.parametrize("dtype", [np.int16, np.int64, np.float32, np.float64, bool])
@pytest.mark.parametrize("order", ["C", "F"])
def test_masked_values_are_missing(dtype: type, order: str) -> None:
    data = np.array(np.arange(16**3).reshape(16, 16, 16), dtype=dtype, order=order)  # type: ignore[call-overload]
    masked = np.ma.masked_array(data, np.zeros(data.shape, bool))
    masked[2:5, 3, 4] = np.ma.masked
    before = data.copy()
    for volume in (vf.Volume(masked, AFFINE), vf.read(nibabel.Nifti1Image(masked.astype(np.float32), AFFINE))):
        assert np.array_equal(np.isnan(volume.array), masked.mask)
        assert np.array_equal(volume.array[~masked.mask], data[~masked.mask].astype(np.float32))
        assert volume.facts["intensity"]["missing_voxels"] == 3
    assert np.array_equal(data, before)


def test_a_mask_of_nothing_and_masked_slices() -> None:
    data = np.ones((16, 16, 16))
    assert np.array_equal(vf.Volume(np.ma.masked_array(data), AFFINE).array, data)
    slices = [np.ma.masked_equal(np.full((16, 16), n), 3) for n in range(16)]
    found = vf.Volume(slices, AFFINE).array
    assert np.isnan(found[3]).all() and not np.isnan(np.delete(found, 3, axis=0)).any()


def test_what_is_beneath_a_mask_is_not_judged() -> None:
    for beneath in (np.inf, 1e300):
        data = np.ones((16, 16, 16))
        data[0, 0, 0] = beneath
        assert np.isnan(vf.Volume(np.ma.masked_greater(data, 2.0), AFFINE).array[0, 0, 0])
