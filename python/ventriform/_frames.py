"""Patient frames: RAS (nibabel, NIfTI) and LPS (DICOM, ITK)."""

from __future__ import annotations

from collections.abc import Iterable
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
    """Positions in `frame` of positions in LPS, always as a new array."""
    turned = points.copy()
    if frame == "RAS":
        turned[..., :2] *= -1.0
        turned += 0.0
    return turned


points_to_lps = points_from_lps
"""Positions in LPS of positions in `frame`: turning twice is turning back."""


class Coordinates(list[float]):
    """A point, mm, or a direction in the patient, with the frame that its numbers are in.

    What reports give, and what parameters such as `center`, `base` and `axis` take: it is turned into the frame that is
    needed. Three plain numbers are in the frame of the scan instead.

    Parameters
    ----------
    numbers : sequence of 3 floats
        x, y, z.
    frame : {'RAS', 'LPS'}
        The patient frame that they are in.

    Attributes
    ----------
    frame : {'RAS', 'LPS'}
        The patient frame that the numbers are in.
    """

    def __init__(self, numbers: Iterable[float], *, frame: str = "RAS") -> None:
        self.frame: Frame = checked(frame)
        fix = "Give 3 finite numbers x, y, z."
        try:
            made = [float(number) for number in numbers]
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError("numbers", f"They are no numbers: {error}.", fix) from error
        if len(made) != 3 or not all(abs(number) < float("inf") for number in made):
            raise InputError("numbers", f"They are {made}.", fix)
        super().__init__(made)

    def in_frame(self, frame: str) -> Coordinates:
        """The same point or direction in another patient frame."""
        numbers = self if checked(frame) == self.frame else turned(self)
        return Coordinates(numbers, frame=frame)

    def __reduce__(self) -> tuple[Any, ...]:
        return _coordinates_again, (list(self), self.frame)

    def __repr__(self) -> str:
        return f"Coordinates({list(self)!r}, frame={self.frame!r})"


def _coordinates_again(numbers: list[float], frame: Frame) -> Coordinates:
    return Coordinates(numbers, frame=frame)


def turned(numbers: Iterable[float]) -> list[float]:
    """x, y, z of RAS in LPS, or of LPS in RAS."""
    x, y, z = numbers
    return [0.0 - x, 0.0 - y, z]
