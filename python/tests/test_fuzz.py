"""Whatever is given, the border answers with a result or with an error of the package.

FUZZ_EXAMPLES: examples of each test (default 60).
"""

from __future__ import annotations

import os
from typing import Any

import hypothesis.extra.numpy as arrays
import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import ventriform as vf

CHECKED = settings(
    max_examples=int(os.environ.get("FUZZ_EXAMPLES", "60")), deadline=None, suppress_health_check=list(HealthCheck)
)

SHAPES = arrays.array_shapes(min_dims=0, max_dims=5, min_side=0, max_side=6)
DTYPES = st.one_of(
    arrays.scalar_dtypes(),
    arrays.floating_dtypes(endianness="?"),
    arrays.integer_dtypes(endianness="?"),
    arrays.unicode_string_dtypes(max_len=3),
)
ARRAYS = DTYPES.flatmap(lambda dtype: arrays.arrays(dtype, SHAPES))
AFFINES = st.one_of(
    arrays.arrays(np.float64, (4, 4)),
    arrays.arrays(np.float64, (4,), elements=st.floats(-1e3, 1e3)).map(lambda d: np.diag([*d[:3], 1.0])),
    st.none(),
    st.text(max_size=3),
    arrays.arrays(np.float32, SHAPES),
)
SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
    st.binary(max_size=8),
    st.lists(st.one_of(st.integers(), st.floats(), st.text(max_size=2)), max_size=7),
    st.complex_numbers(),
)
SMALL = vf.phantom(size=16, spacing_mm=12.0).volume


def answered(call: Any) -> None:
    try:
        call()
    except vf.InternalError:
        raise
    except vf.VentriformError as error:
        assert str(error)


@CHECKED
@given(ARRAYS, AFFINES, st.sampled_from(["RAS", "LPS", "ras", ""]))
def test_any_array(array: Any, affine: Any, frame: str) -> None:
    def call() -> None:
        with np.errstate(all="ignore"):
            volume = vf.Volume(array, affine, frame=frame)
        assert volume.array.shape == volume.shape
        vf.generate(volume, points=12)

    answered(call)


@CHECKED
@given(st.binary(max_size=2000))
def test_any_bytes(content: bytes) -> None:
    answered(lambda: vf.read(content))


@CHECKED
@given(
    st.dictionaries(st.sampled_from([row["name"] for row in vf._tables.rows("generate")] + ["x"]), SCALARS, max_size=4)
)
def test_any_parameters_of_a_model(parameters: dict[str, Any]) -> None:
    parameters.setdefault("points", 20)
    if isinstance(parameters["points"], int) and parameters["points"] > 300:
        parameters["points"] = 20
    for heavy in ("starts", "repeats", "fit_rounds", "repulsion_iterations", "relaxation_iterations", "fit_samples"):
        parameters.pop(heavy, None)
    answered(lambda: vf.generate(SMALL, **parameters))


@CHECKED
@given(
    st.dictionaries(st.sampled_from([row["name"] for row in vf._tables.rows("segment")] + ["x"]), SCALARS, max_size=4)
)
def test_any_parameters_of_a_fit(parameters: dict[str, Any]) -> None:
    answered(lambda: vf.segment(SMALL, **parameters))


@CHECKED
@given(SCALARS, SCALARS, SCALARS)
def test_any_other_arguments(one: Any, two: Any, three: Any) -> None:
    answered(lambda: vf.read(one))
    answered(lambda: vf.segment(SMALL, model=one, reader=two, normals=three))
    answered(lambda: vf.measure(SMALL, one))
    answered(
        lambda: vf.phantom(seed=one if isinstance(one, int) else 1, size=16, spacing_mm=12.0, noise=two, heads=three)
    )
