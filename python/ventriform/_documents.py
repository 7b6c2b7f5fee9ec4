"""Documents of the library as objects with typed fields."""

from __future__ import annotations

import copy
import dataclasses
import json
from typing import Any, ClassVar, TypeVar

Own = TypeVar("Own", bound="Document")

_CLASSES: dict[str, type[Document]] = {}


def register(*classes: type[Document]) -> None:
    """Makes classes known by their names."""
    _CLASSES.update((one.__name__, one) for one in classes)


class Document:
    """A JSON document whose fields are attributes."""

    _built: ClassVar[dict[str, str]] = {}
    _source: dict[str, Any]

    @classmethod
    def from_dict(cls: type[Own], document: dict[str, Any]) -> Own:
        """The document as an object. Fields that this version does not know are kept in `to_dict` alone."""
        fields = {}
        for name in _names(cls):
            plain = name.removesuffix("_")
            built = cls._built.get(plain, "")
            fields[name] = _build(built, document.get(plain))
        made = cls(**fields)
        object.__setattr__(made, "_source", document)
        return made

    @classmethod
    def from_json(cls: type[Own], text: str | bytes) -> Own:
        """The document that a JSON text is."""
        return cls.from_dict(json.loads(text))

    def to_dict(self) -> dict[str, Any]:
        """The document as the command writes it: dictionaries, lists, numbers and texts."""
        return copy.deepcopy(self._source)

    def __repr__(self) -> str:
        shown = []
        for name in _names(type(self)):
            value = getattr(self, name)
            if isinstance(value, (int, float, bool)) or isinstance(value, str) and len(value) < 40:
                shown.append(f"{name}={value!r}")
        return f"{type(self).__name__}({', '.join(shown)})"


def _build(built: str, value: Any) -> Any:
    if not built or value is None:
        return value
    if built.endswith("[]"):
        return [_build(built[:-2], one) for one in value]
    if built.endswith("{}"):
        return {name: _build(built[:-2], one) for name, one in value.items()}
    return _CLASSES[built].from_dict(value)


def _names(of: type[Document]) -> list[str]:
    return [field.name for field in dataclasses.fields(of)]  # type: ignore[arg-type]
