"""Documents of the library as objects with typed fields."""

from __future__ import annotations

import copy
import dataclasses
import json
from typing import Any, ClassVar, TypeVar

from . import _html
from ._frames import Coordinates, Frame

Own = TypeVar("Own", bound="Document")

_CLASSES: dict[str, type[Document]] = {}

PLACES = {
    "LongAxis": ("apex", "base"),
    "Localisation": ("axis", "centre"),
    "MeshFacts": ("max_mm", "min_mm"),
    "Posture": ("superior",),
}
"""The fields of each class that are points or directions. The documents have them in LPS."""

BOUNDS = ("max_mm", "min_mm")
"""Those that stay in LPS, as their descriptions say: in another frame the largest would not be the largest."""

GIVEN_PLACES = ("center", "axis", "superior", "anterior", "segments_from", "base")
"""The parameters that are points or directions; those of one of two scans have its name before."""

GIVEN_POINTS = ("inner_through", "outer_through")
"""Those that are several points; the documents have their numbers one after the other."""


def register(*classes: type[Document]) -> None:
    """Makes classes known by their names."""
    _CLASSES.update((one.__name__, one) for one in classes)


def is_place(parameter: str) -> bool:
    """Whether a parameter is a point or a direction in the patient."""
    return _of_any_scan(parameter) in GIVEN_PLACES


def are_points(parameter: str) -> bool:
    """Whether a parameter is several points in the patient."""
    return _of_any_scan(parameter) in GIVEN_POINTS


def _of_any_scan(parameter: str) -> str:
    return parameter.removeprefix("stress_").removeprefix("rest_")


class Document:
    """A JSON document whose fields are attributes. Points and directions among them are `Coordinates`, which have a
    frame."""

    _built: ClassVar[dict[str, str]] = {}
    _source: dict[str, Any]

    @classmethod
    def from_dict(cls: type[Own], document: dict[str, Any], *, frame: Frame = "LPS") -> Own:
        """The document as an object. Fields that this version does not know are kept in `to_dict` alone.

        `frame` is the patient frame of its points and directions, which the document itself has in LPS.
        """
        fields = {}
        for name in _names(cls):
            plain = name.removesuffix("_")
            value = document.get(plain)
            if plain in PLACES.get(cls.__name__, ()):
                fields[name] = _placed(value, "LPS" if plain in BOUNDS else frame)
            elif plain == "parameters" and isinstance(value, dict):
                fields[name] = {key: _given(key, one, frame) for key, one in value.items()}
            else:
                fields[name] = _build(cls._built.get(plain, ""), value, frame)
        made = cls(**fields)
        object.__setattr__(made, "_source", document)
        return made

    @classmethod
    def from_json(cls: type[Own], text: str | bytes, *, frame: Frame = "LPS") -> Own:
        """The document that a JSON text is."""
        return cls.from_dict(json.loads(text), frame=frame)

    def to_dict(self) -> dict[str, Any]:
        """The document as the command writes it: dictionaries, lists, numbers and texts; positions are LPS."""
        return copy.deepcopy(self._source)

    def _shown(self) -> list[tuple[str, Any]]:
        """Its figures and short texts by name."""
        values = [(name, getattr(self, name)) for name in _names(type(self))]
        short = (int, float, bool, Coordinates)
        return [
            (name, value)
            for name, value in values
            if isinstance(value, short) or isinstance(value, str) and len(value) < 40
        ]

    def _repr_html_(self) -> str:
        return _html.table(type(self).__name__, self._shown())

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self._shown())})"


def _build(built: str, value: Any, frame: Frame) -> Any:
    if not built or value is None:
        return value
    if built.endswith("[]"):
        return [_build(built[:-2], one, frame) for one in value]
    if built.endswith("{}"):
        return {name: _build(built[:-2], one, frame) for name, one in value.items()}
    return _CLASSES[built].from_dict(value, frame=frame)


def _given(parameter: str, value: Any, frame: Frame) -> Any:
    """A parameter's value, points and directions in `frame`."""
    if are_points(parameter) and isinstance(value, list):
        return [_placed(value[at : at + 3], frame) for at in range(0, len(value), 3)]
    return _placed(value, frame) if is_place(parameter) else value


def _placed(value: Any, frame: Frame) -> Any:
    """A point or direction of a document in `frame`; words and what is absent as they are."""
    if not isinstance(value, list) or len(value) != 3:
        return value
    return Coordinates(value, frame="LPS").in_frame(frame)


def _names(of: type[Document]) -> list[str]:
    return [field.name for field in dataclasses.fields(of)]  # type: ignore[arg-type]
