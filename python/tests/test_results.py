"""Results: frames, arrays, pickles, pictures and other packages' objects."""

from __future__ import annotations

import copy
import pathlib
import pickle

import numpy as np
import pytest

import ventriform as vf


def test_a_model_is_what_was_asked_for(model: vf.Model) -> None:
    assert model.vertices.shape == (100, 3) and model.vertices.dtype == np.float64
    assert model.faces.shape == (196, 3) and model.faces.dtype == np.int32
    assert model.frame == "RAS" and model.report.mesh.vertices == 100
    assert model.report.distance.mean_mm < 2.0 and len(model.surface.vertices) > 100
    assert set(model.parts) <= {1, 2, 3}


def test_ras_and_lps_differ_by_two_signs(model: vf.Model, fit: vf.Fit) -> None:
    for result in (model, fit.surface):
        turned = result.in_frame("LPS")
        assert np.array_equal(turned.vertices * [-1, -1, 1], result.vertices)
        assert np.array_equal(turned.faces, result.faces)
    assert np.array_equal(fit.in_frame("LPS").affine[:2], -fit.affine[:2])


def test_walls_lie_where_their_masks_are(fit: vf.Fit) -> None:
    for wall in fit.walls.values():
        inside = np.argwhere(wall.mask) @ fit.affine[:3, :3].T + fit.affine[:3, 3]
        low, high = wall.vertices.min(axis=0), wall.vertices.max(axis=0)
        assert ((inside >= low) & (inside <= high)).all()
        voxel_ml = abs(np.linalg.det(fit.affine[:3, :3])) / 1000.0
        mesh = wall.to_trimesh()
        assert (
            mesh.is_watertight and abs(mesh.volume / 1000.0 - wall.mask.sum() * voxel_ml) < 0.15 * mesh.volume / 1000.0
        )


def test_a_fit_tells_what_its_report_tells(fit: vf.Fit) -> None:
    report = fit.report
    assert report.to_dict() == fit.files.json("report.json")
    assert fit.confidence == report.fit.confidence and 0.0 <= fit.confidence <= 1.0
    assert [flag.code for flag in fit.flags] == [flag["code"] for flag in report.to_dict()["flags"]]
    assert fit.polar.shape == (32, 60) and fit.segments.shape == (17,)
    assert np.nanmax(fit.polar) <= 140.0
    document = fit.files.json("polar.json")
    assert fit.segments[7] == document["segments"][7]["mean_percent"]


def test_masks_are_views_of_what_the_library_made(fit: vf.Fit) -> None:
    assert fit.mask.dtype == np.bool_ and fit.mask.flags.f_contiguous
    image = fit.mask_image()
    assert np.array_equal(np.asarray(image.dataobj) > 0, fit.mask)
    assert np.array_equal(np.asarray(fit.mask_image("anatomical").dataobj) > 0, fit.walls["anatomical"].mask)
    with pytest.raises(vf.InputError):
        fit.mask_image("left")


def test_everything_pickles(scan: pathlib.Path, model: vf.Model, fit: vf.Fit, gated: pathlib.Path) -> None:
    for again in (pickle.loads(pickle.dumps(fit)), copy.deepcopy(fit)):
        assert dict(again.files) == dict(fit.files) and np.array_equal(again.mask, fit.mask)
        assert np.array_equal(
            again.vertices if hasattr(again, "vertices") else again.surface.vertices, fit.surface.vertices
        )
    again_model = pickle.loads(pickle.dumps(model.in_frame("LPS")))
    assert again_model.frame == "LPS"
    assert (
        again_model.to_bytes("glb") == model.to_bytes("glb") and again_model.report.to_dict() == model.report.to_dict()
    )
    for volume in (vf.read(scan), vf.read(scan.read_bytes()), vf.read(gated), vf.phantom(size=32).volume):
        again_volume = pickle.loads(pickle.dumps(volume))
        assert np.array_equal(again_volume.array, volume.array) and np.array_equal(again_volume.affine, volume.affine)
    beat = vf.beat(gated)
    assert dict(pickle.loads(pickle.dumps(beat)).files) == dict(beat.files)
    error = vf.InputError("points", "3 is out of range.", "Give more.", "invalid-parameter")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_an_edited_pickle_is_refused(model: vf.Model) -> None:
    restored, (state, frame, name, *_) = model.__reduce__()
    (mesh, reference), *rest = state
    broken = ([(mesh[0], [[0, 1, 10_000]]), reference], *rest)
    with pytest.raises(vf.InputError):
        restored(broken, frame, name)
    with pytest.raises(vf.InputError):
        restored(([mesh, reference], rest[0], "{}", *rest[2:]), frame, name)


def test_a_model_fits_other_scans(model: vf.Model, folder: pathlib.Path) -> None:
    fit = vf.segment(folder / "stress/spect.nii.gz", model=model)
    assert fit.report.template == model.name == "spect"
    assert len(fit.surface.vertices) == 100


def test_a_beat_has_figures_and_motion(gated: pathlib.Path) -> None:
    beat = vf.beat(gated)
    report = beat.report
    assert report.ef_percent == beat.ef_percent and beat.ef_percent is not None
    assert report.edv_ml > report.esv_ml and len(report.segments) == 17
    largest, smallest = report.end_diastole_gate - 1, report.end_systole_gate - 1
    widths = [np.linalg.norm(surface.vertices.std(axis=0)) for surface in beat.surfaces]
    assert widths[largest] > widths[smallest]


def test_other_packages_get_the_same_surface(model: vf.Model) -> None:
    assert np.array_equal(np.asarray(model.to_trimesh().vertices), model.vertices)
    mesh = model.to_pyvista()
    assert np.array_equal(np.asarray(mesh.points, dtype=np.float64), model.vertices)
    assert np.array_equal(mesh.faces.reshape(-1, 4)[:, 1:], model.faces)


def test_a_polar_map_is_drawn_with_its_segments(fit: vf.Fit) -> None:
    import matplotlib

    matplotlib.use("agg")
    axes = vf.plot.polar(fit)
    texts = [text.get_text().split("\n")[0] for text in axes.texts]
    assert sorted(map(int, texts)) == list(range(1, 18))
    assert vf.plot.polar(fit, ax=axes, numbers=False, colorbar=False) is axes
    flat = matplotlib.pyplot.figure().add_subplot()
    with pytest.raises(vf.InputError):
        vf.plot.polar(fit, ax=flat)
    axes.figure.canvas.draw()
    matplotlib.pyplot.close("all")


def test_reports_can_be_saved(model: vf.Model, tmp_path: pathlib.Path) -> None:
    model.save_report(tmp_path / "report.html")
    model.save_report(tmp_path / "report.json")
    assert "<html" in (tmp_path / "report.html").read_text()
    assert vf.reports.ModelReport.from_json((tmp_path / "report.json").read_bytes()).mesh == model.report.mesh
    for wrong in ("report.txt", "report"):
        with pytest.raises(vf.InputError):
            model.save_report(tmp_path / wrong)
        with pytest.raises(vf.InputError):
            model.save(tmp_path / wrong)


def test_phantoms_have_the_defects_that_were_asked_for() -> None:
    healthy, ill = (vf.segment(vf.phantom(seed=4, defects=defects).volume) for defects in (None, {8: 0.8}))
    assert ill.segments[7] < healthy.segments[7] - 15.0
    assert abs(ill.segments[10] - healthy.segments[10]) < 10.0
