"""Checks of arguments that no table of parameters describes."""

from __future__ import annotations

import json
import numbers
import operator
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ._errors import InputError, file_error

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

#: Most threads that a call works on.
MOST_THREADS = 1024

#: Beyond any number of points; the library has limits of its own.
MOST_POINTS = 2**32 - 1


def path(field: str, value: Any) -> str:
    """The path that `value` is."""
    if not isinstance(value, (str, os.PathLike)):
        raise InputError(field, f"A {type(value).__name__} is no path.", "Give the path of a folder.")
    return os.fsdecode(value)


def folder(field: str, value: Any) -> str:
    """The whole path of the folder that `value` names."""
    given = path(field, value)
    whole = given if os.path.isabs(given) else os.path.join(os.getcwd(), given)
    try:
        os.scandir(whole).close()
    except OSError as error:
        raise file_error(field, whole, error) from error
    except ValueError as error:
        raise InputError(field, f"{given!r} is no path: {error}.", "Give the path of a folder.") from error
    return whole


def threads(value: Any) -> int | None:
    """The number of threads to work on; None for as many as there are processors."""
    return None if value is None else whole("threads", value, 1, MOST_THREADS)


def positions(field: str, value: Any, count: int) -> NDArray[np.float64]:
    """The positions that `value` is, one for each of `count` vertices."""
    import numpy as np

    fix = f"Give an array of finite numbers of the shape ({count}, 3)."
    try:
        found = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(field, f"They are no positions: {error}.", fix) from error
    if found.shape != (count, 3) or not np.isfinite(found).all():
        raise InputError(field, f"They have the shape {found.shape}, or are not all finite.", fix)
    return found


def text(field: str, value: Any) -> str:
    """The text that `value` is."""
    if not isinstance(value, str):
        raise InputError(field, f"A {type(value).__name__} is no text.", "Give a text.")
    return value


def words(field: str, value: Any) -> list[str]:
    """The words that `value` is a sequence of."""
    found = None if isinstance(value, (str, bytes)) else _items(value)
    if found is None or not all(isinstance(word, str) for word in found):
        raise InputError(field, f"{value!r} is no sequence of words.", "Give a list of words.")
    return found


def whole(field: str, value: Any, low: int, high: int) -> int:
    """The whole number that `value` is, also one of NumPy."""
    fix = f"Give a whole number from {low} to {high}."
    try:
        found = None if isinstance(value, bool) else operator.index(value)
    except TypeError:
        found = None
    if found is None:
        raise InputError(field, f"{value!r} is no whole number.", fix)
    if not low <= found <= high:
        raise InputError(field, f"It is {found}.", fix)
    return found


def number(field: str, value: Any) -> float:
    """The number that `value` is, also one of NumPy."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise InputError(field, f"{value!r} is no number.", "Give a number.")
    try:
        return float(value)
    except OverflowError as error:
        raise InputError(field, "It is beyond 64-bit floats.", "Give a smaller number.") from error


def wholes(field: str, value: Any, low: int, high: int) -> list[int]:
    """The whole numbers that `value` is a sequence of."""
    found = None if isinstance(value, (str, bytes)) else _items(value)
    if found is None:
        raise InputError(field, f"{value!r} is no sequence.", "Give a list of whole numbers.")
    return [whole(field, one, low, high) for one in found]


def each_axis(field: str, value: Any) -> list[Any]:
    """A value for each axis: three, or one for all."""
    found = None if isinstance(value, (str, bytes)) else _items(value)
    if found is None:
        return [value] * 3
    if len(found) != 3:
        raise InputError(field, f"It has {len(found)} values.", "Give one value, or 3.")
    return found


def document(field: str, content: Any, format: str, maker: str) -> bytes:
    """The bytes of a JSON document of this format."""
    fix = f"Give the bytes of a file that `{maker}` made, or the file's path to the function that uses it."
    if not isinstance(content, (bytes, bytearray, memoryview)):
        raise InputError(field, f"A {type(content).__name__} is no content of a file.", fix)
    kept = bytes(content)
    try:
        found = json.loads(kept)
    except (ValueError, RecursionError) as error:
        raise InputError(field, f"It is no JSON: {error}.", fix) from error
    if not isinstance(found, dict) or found.get("format") != format:
        raise InputError(field, f"Its `format` is not {format}.", fix)
    return kept


def one_of(field: str, value: Any, choices: Sequence[str]) -> None:
    """Refuses what is none of the words."""
    if not isinstance(value, str) or value not in choices:
        raise InputError(field, f"`{value}` is not one of the choices.", f"Give one of {', '.join(choices)}.")


def _items(value: Any) -> list[Any] | None:
    try:
        return list(value)
    except TypeError:
        return None
