"""What the package raises: facts that the caller can act on."""

from __future__ import annotations


class VentriformError(Exception):
    """Any error of this package."""


class InputError(VentriformError, ValueError):
    """An input that cannot be used.

    Attributes
    ----------
    field : str or None
        The parameter, or the field of the file, that it is about.
    reason : str
        What is wrong, with the value.
    fix : str
        What to give instead.
    code : str
        A stable identifier, the same as the service's: ``no-surface``, ``frame-needed``.
    """

    def __init__(self, field: str | None, reason: str, fix: str = "", code: str = "unusable-input") -> None:
        super().__init__(field, reason, fix, code)
        self.field = field
        self.reason = reason
        self.fix = fix
        self.code = code

    def __str__(self) -> str:
        about = f"{self.field}: " if self.field and f"`{self.field}`" not in self.reason else ""
        end = "" if self.reason.endswith(".") else "."
        return f"{about}{self.reason}{end} {self.fix}".rstrip()


class TooLargeError(InputError):
    """An input beyond what is read or computed."""


class UnreadableError(InputError):
    """A file that vanished or cannot be read, or a result that cannot be made."""


class MissingExtraError(VentriformError, ImportError):
    """An optional package that a function needs is not installed."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(package, extra)
        self.package = package
        self.extra = extra

    def __str__(self) -> str:
        return f"this needs {self.package}: pip install 'ventriform[{self.extra}]'"


class InternalError(VentriformError, RuntimeError):
    """A fault of this package: please report it with the message."""
