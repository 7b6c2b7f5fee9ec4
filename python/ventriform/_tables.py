"""The library's tables of parameters as signatures, docstrings and stubs."""

from __future__ import annotations

import functools
import inspect
import numbers
from collections.abc import Callable
from typing import Any, TypeVar, cast

from . import _native, _objects
from ._documents import are_points, is_place
from ._errors import InputError
from ._frames import Coordinates, Frame, turned

Row = dict[str, Any]
Function = TypeVar("Function", bound=Callable[..., Any])

_TABLES: dict[str, list[Row]] = {**_native.parameter_tables(), "dicom": _objects.ROWS}

#: How the tables say LPS, and what it is in Python.
IN_FRAME = (
    ("x,y,z in LPS millimetres, one point after the other", "x,y,z in millimetres of the scan's patient frame"),
    ("in the LPS frame of the volume", "in the scan's patient frame"),
    ("often 0,-1,0:", "often 0,1,0 in RAS and 0,-1,0 in LPS:"),
    ("in LPS millimetres", "in millimetres of the scan's patient frame"),
    ("x,y,z in LPS,", "x,y,z in the scan's patient frame,"),
    ("x,y,z in LPS.", "x,y,z in the scan's patient frame."),
)


def rows(command: str) -> list[Row]:
    """The rows of a command's parameters."""
    return _TABLES[command]


def default(row: Row) -> Any:
    """The default as a value; None where it depends on other parameters or there is none."""
    text = row["default"]
    if not text:
        return None
    kind = row["kind"]
    if kind == "integer":
        return int(text)
    if kind == "number":
        return float(text)
    if kind == "switch":
        return text == "true"
    return text


def annotation(row: Row) -> str:
    """The type of a parameter."""
    kind = row["kind"]
    if kind == "integer" or kind == "integers" and row["count"] == 1:
        made = "int"
    elif kind == "number":
        made = "float"
    elif kind == "switch":
        made = "bool"
    elif kind == "choice":
        made = f"Literal[{', '.join(map(repr, [*row['words'], *_numbers(row)]))}]"
    elif kind == "direction":
        words = f"Literal[{', '.join(map(repr, row['words']))}] | " if row["words"] else ""
        made = f"{words}Sequence[float]"
    elif kind == "integers":
        made = "Sequence[int]"
    elif kind == "numbers":
        made = "Sequence[float]"
    elif kind == "points":
        made = "Sequence[Sequence[float]]"
    elif kind == "string":
        made = "str"
    elif kind == "time":
        made = "str | datetime"
    else:
        made = "str | int"
    return made if default(row) is not None else f"{made} | None"


def values(row: Row) -> str:
    """Which values are taken, in words."""
    kind = row["kind"]
    if kind in ("integer", "number"):
        low, high = row["range"]
        word = "int" if kind == "integer" else "float"
        if high == 2**64 - 1:
            return f"{word}, from {low}"
        return f"{word}, {low:g} to {high:g}" if kind == "number" else f"{word}, {low} to {high}"
    if kind == "switch":
        return "bool"
    if kind == "choice":
        return "{" + ", ".join(map(repr, [*row["words"], *_numbers(row)])) + "}"
    if kind == "direction":
        words = ", ".join(map(repr, row["words"]))
        return f"{{{words}}} or 3 floats" if words else "3 floats"
    if kind in ("integers", "numbers"):
        word = "int" if kind == "integers" else "float"
        return word if row["count"] == 1 else f"{row['count']} {word}s"
    if kind == "points":
        return f"1 to {row['most']} points of 3 floats"
    if kind == "time":
        return f"str or datetime, such as {row['example']}"
    return f"str, such as {row['example']}"


def _numbers(row: Row) -> list[int]:
    """Those of the words of a choice that are numbers."""
    return [int(word) for word in row["words"] if word.isdigit()]


def checked(command: str, parameters: dict[str, Any]) -> dict[str, Any]:
    """Parameters with choices as words. None is refused where it would be taken as a default that is something else."""
    made = dict(parameters)
    for row in rows(command):
        name = row["name"]
        if name not in made:
            continue
        value = made[name]
        if value is None and default(row) is not None:
            fix = f"Leave it out for {default(row)!r}"
            if row["kind"] == "choice":
                fix += f", or give one of {', '.join(map(repr, row['words']))}"
            raise InputError(name, f"`{name}` is None.", f"{fix}.")
        if row["kind"] == "choice" and isinstance(value, numbers.Real) and not isinstance(value, bool):
            made[name] = next((word for word in row["words"] if word.isdigit() and int(word) == value), value)
    return made


def to_lps(command: str, parameters: dict[str, Any], frame_for: Callable[[str], Frame]) -> dict[str, Any]:
    """Parameters with points and directions in LPS. Plain numbers are in the frame that `frame_for` a parameter's name
    gives; `Coordinates` have their own."""
    made = dict(parameters)
    for row in rows(command):
        name = row["name"]
        if is_place(name) and made.get(name) is not None:
            made[name] = _placed(name, made[name], frame_for)
        if are_points(name) and made.get(name) is not None:
            made[name] = _flat(name, made[name], frame_for)
    return made


def _flat(name: str, points: Any, frame_for: Callable[[str], Frame]) -> list[float]:
    """The numbers of points, one after the other."""
    fix = "Give a list of points, each of 3 numbers x, y, z."
    try:
        placed = [_placed(name, point, frame_for) for point in points]
        lengths = [len(point) for point in placed]
    except TypeError as error:
        raise InputError(name, f"It is no list of points: {error}.", fix) from error
    if isinstance(points, str) or any(length != 3 for length in lengths):
        raise InputError(name, "Its points have not 3 numbers each.", fix)
    return [number for point in placed for number in point]


def _placed(name: str, value: Any, frame_for: Callable[[str], Frame]) -> Any:
    if isinstance(value, Coordinates):
        return list(value.in_frame("LPS"))
    if isinstance(value, str):
        if "," in value:
            raise InputError(name, f"`{value}` is a text.", "Give 3 numbers x, y, z.")
        return value
    try:
        numbers = [float(number) for number in value]
    except (TypeError, ValueError, OverflowError):
        # Refused by the table.
        return value
    return turned(numbers) if len(numbers) == 3 and frame_for(name) == "RAS" else value


def summary(row: Row) -> str:
    """What a parameter is, in a sentence, with places in the frame that they are given in."""
    text: str = row["summary"]
    for lps, own in IN_FRAME:
        text = text.replace(lps, own)
    return text


def _described(row: Row) -> str:
    known = default(row)
    told = f", default {known!r}" if known is not None else ", optional"
    return f"    {row['name']} : {values(row)}{told}\n        {summary(row)}."


def with_table(*commands: str) -> Callable[[Function], Function]:
    """Gives a function with `**parameters` the signature and the docstring of its tables, and checks what it is
    given."""

    def decorate(function: Function) -> Function:
        own = inspect.signature(function)
        before = [p for p in own.parameters.values() if p.kind is not p.VAR_KEYWORD]
        taken = {p.name for p in before}
        listed = [row for command in commands for row in rows(command) if row["name"] not in taken]
        added = [
            inspect.Parameter(
                row["name"], inspect.Parameter.KEYWORD_ONLY, default=default(row), annotation=annotation(row)
            )
            for row in listed
        ]

        @functools.wraps(function)
        def with_checks(*given: Any, **parameters: Any) -> Any:
            ours = {name: value for name, value in parameters.items() if name not in taken}
            for command in commands:
                ours = checked(command, ours)
            return function(*given, **{**parameters, **ours})

        with_checks.__signature__ = own.replace(parameters=[*before, *added])  # type: ignore[attr-defined]
        head = inspect.cleandoc(function.__doc__ or "")
        table = "\n".join(inspect.cleandoc("\n" + _described(row)) for row in listed)
        with_checks.__doc__ = head.replace("[parameters]", table)
        return cast(Function, with_checks)

    return decorate
