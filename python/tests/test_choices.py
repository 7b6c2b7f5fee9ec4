"""Choices that are numbers, and None."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ventriform as vf
from ventriform import _tables

SMALL = np.zeros((16, 16, 16), np.float32)


@pytest.mark.parametrize("number", [180, 180.0, np.int64(180), np.float32(180)])
def test_a_choice_that_is_a_number_may_be_given_as_one(number: Any) -> None:
    assert _tables.checked("segment", {"orbit": number}) == {"orbit": "180"}
    with pytest.raises(vf.InputError) as raised:
        vf.segment(SMALL_VOLUME, orbit=number)
    assert raised.value.field != "orbit"


@pytest.mark.parametrize("other", [90, 1, True, 180.5, float("nan"), "18"])
def test_another_number_is_none_of_the_choices(other: Any) -> None:
    with pytest.raises(vf.InputError) as raised:
        vf.segment(SMALL_VOLUME, orbit=other)
    assert raised.value.field == "orbit"


@pytest.mark.parametrize(
    ("function", "command"),
    [(vf.generate, "generate"), (vf.segment, "segment"), (vf.beat, "beat"), (vf.calibrate, "calibrate")],
)
def test_none_is_refused_where_the_default_is_another_value(function: Any, command: str) -> None:
    for row in _tables.rows(command):
        if _tables.default(row) is None:
            continue
        with pytest.raises(vf.InputError) as raised:
            function(SMALL_VOLUME, **{row["name"]: None})
        error = raised.value
        assert error.field == row["name"] and "Leave it out" in error.fix
        if row["kind"] == "choice":
            assert all(repr(word) in error.fix for word in row["words"])


SMALL_VOLUME = vf.Volume(SMALL, np.diag([4.0, 4.0, 4.0, 1.0]))
