"""Arrays with their place: pairs, tensors that know theirs, named axes; and axes that are no axes of voxels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import ventriform as vf


class Tensor:
    """As `monai.data.MetaTensor`: a tensor of PyTorch with `affine` and `meta`, which NumPy takes from the processor's
    memory alone."""

    def __init__(self, array: Any, affine: Any = None, **meta: Any) -> None:
        self.own = np.asarray(array)
        self.shape = self.own.shape
        self.meta = meta
        if affine is not None:
            self.affine = Tensor(affine)

    def __array__(self, *given: Any, **named: Any) -> Any:
        raise TypeError("can't convert cuda:0 device type tensor to numpy")

    def detach(self) -> Tensor:
        return self

    def cpu(self) -> Tensor:
        return self

    def numpy(self) -> Any:
        return self.own


class Named:
    """As `xarray.DataArray`."""

    def __init__(
        self,
        values: Any,
        dims: tuple[str, ...],
        coords: dict[str, Any] | None = None,
        attrs: dict[str, Any] | None = None,
    ) -> None:
        self.values = np.asarray(values)
        self.dims = dims
        self.attrs = attrs or {}
        self.coords = {
            name: along if isinstance(along, Named) else Named(along, (name,)) for name, along in (coords or {}).items()
        }

    def transpose(self, *dims: str) -> Named:
        return Named(self.values.transpose([self.dims.index(dim) for dim in dims]), dims, self.coords, self.attrs)


@pytest.fixture(scope="module")
def volume() -> vf.Volume:
    """A scan with axes that are not alike."""
    return vf.phantom(size=(40, 36, 32), spacing_mm=(4.0, 4.5, 5.0), length_mm=70, width_mm=50, seed=4).volume


def coordinates(volume: vf.Volume, frame: str) -> dict[str, Any]:
    affine = volume.in_frame(frame).affine
    return {name: affine[n, 3] + affine[n, n] * np.arange(volume.shape[n]) for n, name in enumerate("xyz")}


def of_itk(volume: vf.Volume) -> Named:
    """As `itk.xarray_from_image` makes it: axes z, y, x; the rows and columns of the direction from the last axis
    on."""
    affine = volume.in_frame("LPS").affine
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    direction = affine[:3, :3] / spacing
    along = {name: affine[n, 3] + spacing[n] * np.arange(volume.shape[n]) for n, name in enumerate("xyz")}
    return Named(volume.array.transpose(), ("z", "y", "x"), along, {"direction": np.flip(direction)})


FORMS: dict[str, Callable[[vf.Volume], Any]] = {
    "pair": lambda v: (v.array, v.affine),
    "pair of lists": lambda v: [v.array, v.affine.tolist()],
    "tensor": lambda v: Tensor(v.array, v.affine),
    "tensor of LPS": lambda v: Tensor(v.array, v.in_frame("LPS").affine, space="LPS"),
    "tensor in a pair": lambda v: (Tensor(v.array), Tensor(v.affine)),
    "named axes": lambda v: Named(v.array, ("x", "y", "z"), coordinates(v, "RAS")),
    "named axes in another order": lambda v: Named(v.array.transpose(2, 1, 0), ("z", "y", "x"), coordinates(v, "RAS")),
    "named axes with an affine": lambda v: Named(
        v.array.transpose(2, 1, 0), ("k", "j", "i"), None, {"affine": v.affine}
    ),
    "of ITK": of_itk,
}


@pytest.mark.parametrize("form", FORMS)
def test_one_scan_in_every_form(form: str, volume: vf.Volume) -> None:
    given = FORMS[form](volume)
    read = vf.read(given)
    assert np.array_equal(read.array, volume.array) and np.allclose(read.affine, volume.affine, atol=1e-3)
    if form.startswith("pair"):
        in_lps = vf.read((volume.array, volume.in_frame("LPS").affine), frame="LPS")
        assert np.allclose(in_lps.in_frame("RAS").affine, volume.affine)
        assert (
            vf.generate(given, points=60).report.to_dict()["parameters"]
            == vf.generate(volume, points=60).report.to_dict()["parameters"]
        )


def test_xarray_itself(volume: vf.Volume) -> None:
    xarray = pytest.importorskip("xarray")
    given = xarray.DataArray(volume.array.transpose(2, 0, 1), dims=("z", "x", "y"), coords=coordinates(volume, "RAS"))
    assert np.array_equal(vf.read(given).array, volume.array)
    assert np.allclose(vf.read(given).affine, volume.affine, atol=1e-3)
    with pytest.raises(vf.InputError, match="channel"):
        vf.read(given.expand_dims("channel"))


@pytest.mark.parametrize(
    "dims, coords, attrs, told",
    [
        (("a", "b", "c"), {}, {}, "x, y and z"),
        (("x", "y", "z"), {}, {}, "no place"),
        (("i", "j", "k"), {}, {}, "no place"),
        (("x", "y", "z"), {"x": [0, 1, 3, 4], "y": range(4), "z": range(4)}, {}, "not even"),
        (("c", "x", "y", "z"), {}, {}, "`c`"),
    ],
)
def test_named_axes_that_say_too_little(
    dims: tuple[str, ...], coords: dict[str, Any], attrs: dict[str, Any], told: str
) -> None:
    with pytest.raises(vf.InputError, match=told):
        vf.read(Named(np.ones((4,) * len(dims)), dims, coords, attrs))


@pytest.mark.parametrize(
    "shape", [(1, 40, 36, 32), (2, 40, 36, 32), (3, 64, 64, 64), (8, 64, 64, 40), (16, 64, 64, 32), (1, 1, 40, 36, 32)]
)
@pytest.mark.parametrize(
    "form", [lambda a: (a, np.eye(4)), lambda a: Tensor(a, np.eye(4)), lambda a: vf.Volume(a, np.eye(4))]
)
def test_a_first_axis_of_channels_is_asked_about(shape: tuple[int, ...], form: Callable[[Any], Any]) -> None:
    with pytest.raises(vf.InputError) as caught:
        vf.read(form(np.ones(shape, dtype=np.float32)))
    assert "channel" in str(caught.value) and "`frame`" not in str(caught.value)


def test_a_last_axis_of_channels_is_asked_about(volume: vf.Volume) -> None:
    several = vf.Volume(np.stack([volume.array] * 3, axis=-1), volume.affine)
    for use in (lambda: vf.generate(several, points=60), lambda: vf.segment(several), lambda: several.array):
        with pytest.raises(vf.InputError, match="channels"):
            use()
    assert vf.generate(several, points=60, frame=1).vertices.shape == (60, 3)


def test_volumes_that_do_not_look_like_gates_are_asked_about(volume: vf.Volume) -> None:
    """Rest and stress by turns, as it were: eight volumes, but no beat."""
    moved = np.roll(volume.array, 6, axis=0)
    several = vf.Volume(np.stack([volume.array, moved] * 4, axis=-1), volume.affine)
    for use in (lambda: vf.generate(several, points=60), lambda: vf.segment(several), lambda: several.array):
        with pytest.raises(vf.InputError, match="no gates of one heart beat: ") as caught:
            use()
        assert caught.value.code == "frame-needed" and "6 to 32" not in caught.value.reason
    # As the command does: who asks for a beat says that they are gates, and the fit tells that they are not.
    beat = vf.beat(several)
    assert beat.ef_percent is None and "no_contraction" in [flag.code for flag in beat.flags]
    assert vf.generate(several, points=60, frame=7).vertices.shape == (60, 3)


@pytest.mark.parametrize("shape", [(40, 36, 32, 8), (64, 64, 20, 16), (20, 64, 64, 8)])
def test_gates_along_the_last_axis_are_taken(shape: tuple[int, ...]) -> None:
    assert vf.Volume(np.random.default_rng(1).random(shape), np.diag([5, 5, 5, 1])).frames == shape[-1]


def test_images_of_simpleitk(volume: vf.Volume, fit: vf.Fit) -> None:
    pytest.importorskip("SimpleITK")
    turn = np.array([[0.0, -1.0, 0.0], [0.8, 0.0, 0.6], [-0.6, 0.0, 0.8]])
    affine = volume.affine.copy()
    affine[:3, :3] = turn @ affine[:3, :3]
    for own in (volume, vf.Volume(volume.array, affine)):
        again = vf.read(own.to_simpleitk())
        assert np.array_equal(again.array, own.array) and np.allclose(again.affine, own.affine, atol=1e-4)
    image = fit.to_simpleitk("apparent")
    assert np.array_equal(vf.read(image).array > 0, fit.walls["apparent"].mask)
    sheared = affine.copy()
    sheared[1, 1] += 1.0
    with pytest.raises(vf.InputError, match="right angles"):
        vf.Volume(volume.array, sheared).to_simpleitk()
    with pytest.raises(vf.InputError, match="wall"):
        fit.to_simpleitk("none")
