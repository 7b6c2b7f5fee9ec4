"""Raw projections in; volumes, fits and the motion of the heart out."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest
from conftest import Command

import ventriform as vf


def test_a_reconstruction_is_what_the_command_writes(
    raw: pathlib.Path, command: Command, tmp_path: pathlib.Path
) -> None:
    own = vf.reconstruct(raw, filter="gaussian", filter_fwhm_mm=11)
    written = tmp_path / "volume.nii.gz"
    command("reconstruct", raw, "-o", written, "--filter", "gaussian", "--filter-fwhm-mm", 11)
    known = vf.read(written)
    assert own.shape == known.shape
    assert np.allclose(own.affine, known.affine)
    assert np.array_equal(np.asarray(own), np.asarray(known))
    assert not np.array_equal(np.asarray(own), np.asarray(vf.reconstruct(raw)))


def test_projections_are_scans(raw: pathlib.Path) -> None:
    fit = vf.segment(raw)
    told = fit.report.projections
    assert told is not None
    assert len(told.views) == 30
    assert told.counts == pytest.approx(sum(view.counts for view in told.views))
    assert told.moved is False
    assert "projections.png" in fit.files
    assert fit.confidence == pytest.approx(vf.segment(vf.reconstruct(raw)).confidence)


def test_slices_are_no_projections(scan: pathlib.Path) -> None:
    with pytest.raises(vf.InputError, match="projections"):
        vf.reconstruct(scan)
    assert vf.segment(scan).report.projections is None
