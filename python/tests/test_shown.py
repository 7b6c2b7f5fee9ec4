"""What notebooks and consoles show of every public object."""

from __future__ import annotations

import inspect
import pathlib
from html.parser import HTMLParser
from typing import Any

import pytest

import ventriform as vf
from ventriform.client import Client


class Checked(HTMLParser):
    """Fails on elements that are not closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag != "img":
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def objects(
    fit: vf.Fit, model: vf.Model, scan: pathlib.Path, folder: pathlib.Path, gated: pathlib.Path
) -> dict[str, Any]:
    volume = vf.read(scan)
    return {
        "Volume": volume,
        "Fit": fit,
        "Model": model,
        "Surface": model.surface,
        "Wall": fit.surface,
        "Files": fit.files,
        "Flag": vf.Flag("a", "b"),
        "Beat": vf.beat(gated),
        "Phantom": vf.Phantom(volume, volume),
        "Comparison": vf.compare(stress=folder / "stress/spect.nii.gz", rest=scan),
        "Serial": vf.serial(folder / "stress/spect.nii.gz", scan),
        "Measured": vf.measure(fit, fit),
        "Profile": vf.Profile(b'{"format": "ventriform-reader-profile", "kind": "level"}', "<b>Eve</b>"),
        "Calibration": vf.Calibration(vf.Profile(b'{"format": "ventriform-reader-profile"}'), [], [("a<", "b")]),
        "Evaluation": vf.Evaluation("/tmp/<x>", []),
        "Coordinates": vf.Coordinates([1, 2, 3]),
        "Client": Client("http://127.0.0.1:1"),
        "report": fit.report,
    }


def test_nothing_is_an_object_at_an_address(objects: dict[str, Any]) -> None:
    classes = {
        name
        for name in vf.__all__
        if inspect.isclass(getattr(vf, name)) and not issubclass(getattr(vf, name), Exception)
    }
    # It takes a cohort of normal scans; its text is tested with it.
    assert classes - set(objects) == {"NormalLimits"}
    for name, one in objects.items():
        assert " at 0x" not in repr(one) and type(one).__name__ in repr(one), (name, repr(one))
    for cls in (vf.NormalLimits, *map(type, objects.values())):
        assert cls.__repr__ is not object.__repr__


def test_notebooks_show_a_table(objects: dict[str, Any]) -> None:
    for name, one in objects.items():
        if name in ("Flag", "Coordinates", "Client"):
            continue
        page = Checked()
        text = one._repr_html_()
        page.feed(text)
        assert not page.open and "<table" in text and "<b>Eve" not in text and "b</x>" not in text, name
    assert f"{objects['Fit'].confidence:.2f}" in objects["Fit"]._repr_html_()
    assert "&lt;b&gt;Eve" in objects["Profile"]._repr_html_()
