"""What `measure` takes of the package's own results."""

from __future__ import annotations

import pytest

import ventriform as vf

PHANTOM = vf.phantom(size=64, seed=2)


@pytest.fixture(scope="module")
def own() -> vf.Fit:
    return vf.segment(PHANTOM.volume)


@pytest.mark.parametrize("frame", ["RAS", "LPS"])
def test_walls_are_their_masks(own: vf.Fit, frame: str) -> None:
    for name, wall in own.walls.items():
        made = vf.measure(wall.in_frame(frame), PHANTOM.truth).to_dict()
        mask = vf.Volume(wall.mask.astype("f4"), own.affine)
        assert made == vf.measure(mask, PHANTOM.truth).to_dict(), name
    assert vf.measure(own.surface, PHANTOM.truth).to_dict() == vf.measure(own, PHANTOM.truth).to_dict()


def test_models_are_their_files() -> None:
    model = vf.generate(PHANTOM.volume, points=200)
    made = vf.measure(model, PHANTOM.truth).to_dict()
    assert made == vf.measure(model.to_bytes("json"), PHANTOM.truth).to_dict()
    assert made["jaccard"] > 0.5
    swapped = vf.measure(PHANTOM.truth, model.in_frame("LPS"))
    assert swapped.jaccard == made["jaccard"]


def test_a_wall_may_be_an_experts(own: vf.Fit) -> None:
    again = vf.segment(PHANTOM.volume, expert=own.surface)
    assert again.report.measures is not None and again.report.measures.jaccard == 1.0


def test_two_surfaces_are_compared(own: vf.Fit) -> None:
    assert vf.measure(own.surface, own.walls["apparent"]).jaccard == 1.0
