"""Patient frames: RAS (nibabel, NIfTI) and LPS (DICOM, ITK)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, cast

from ._errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    _Floats = NDArray[np.float64]

Frame = Literal["RAS", "LPS"]


def checked(frame: str) -> Frame:
    """The frame, if it is one."""
    if frame not in ("RAS", "LPS"):
        raise InputError("frame", f"`{frame}` is no patient frame.", "Give RAS or LPS.")
    return cast(Frame, frame)


def affine_from_lps(rows: Any, frame: Frame) -> _Floats:
    """The affine to `frame` of one to LPS."""
    import numpy as np

    affine = np.array(rows, dtype=np.float64)
    if frame == "RAS":
        affine[:2] *= -1.0
        affine += 0.0
    return affine


def points_from_lps(points: _Floats, frame: Frame) -> _Floats:
    """Positions in `frame` of positions in LPS: the same array for LPS."""
    if frame == "LPS":
        return points
    turned = points.copy()
    turned[..., :2] *= -1.0
    return turned
