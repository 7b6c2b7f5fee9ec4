"""What the package raises: facts that the caller can act on."""

from __future__ import annotations

import os
from typing import Any


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

    def _about(self, field: str, before: str = "") -> InputError:
        """The error, of another parameter, with words before its reason."""
        self.field = field
        self.reason = before + self.reason
        self.args = (field, self.reason, *self.args[2:])
        return self


class TooLargeError(InputError):
    """An input beyond what is read or computed."""


class UnreadableError(InputError):
    """A file that vanished or cannot be read, or a result that cannot be made."""


class FileError(UnreadableError, OSError):
    """A file or folder that cannot be opened. Also the `OSError` that says why: `FileNotFoundError`, `PermissionError`,
    `IsADirectoryError` or `NotADirectoryError`.

    Attributes
    ----------
    filename : str
        Its whole path.
    errno : int
        The number of the operating system's error.
    """

    def __new__(cls, *given: Any) -> FileError:
        # OSError would take the arguments of InputError for number, message and name.
        made: FileError = OSError.__new__(cls)
        return made

    def __init__(self, field: str | None, reason: str, fix: str, code: str, number: int | None, name: str) -> None:
        InputError.__init__(self, field, reason, fix, code)
        self.errno = number
        self.strerror = reason
        self.filename = name

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.field, self.reason, self.fix, self.code, self.errno, self.filename)

    __str__ = InputError.__str__


class FileMissingError(FileError, FileNotFoundError):
    """A file or folder that does not exist. A `FileNotFoundError`."""


class FileDeniedError(FileError, PermissionError):
    """A file or folder that may not be read. A `PermissionError`."""


class FileIsFolderError(FileError, IsADirectoryError):
    """A folder where a file is needed. An `IsADirectoryError`."""


class FileIsNoFolderError(FileError, NotADirectoryError):
    """A file where a folder is needed. A `NotADirectoryError`."""


_KINDS: tuple[tuple[type[OSError], type[FileError]], ...] = (
    (FileNotFoundError, FileMissingError),
    (PermissionError, FileDeniedError),
    (IsADirectoryError, FileIsFolderError),
    (NotADirectoryError, FileIsNoFolderError),
)


def file_error(field: str, path: Any, error: OSError) -> FileError:
    """The error of the parameter `field` for a file that the system does not open."""
    kind = next((ours for theirs, ours in _KINDS if isinstance(error, theirs)), FileError)
    name = os.path.abspath(os.fsdecode(path))
    why = error.strerror or str(error)
    fix = "Give the path of a folder." if kind is FileIsNoFolderError else "Check that it exists and can be read."
    if kind is FileIsFolderError:
        fix = "Give the path of a file."
    return kind(field, f"{name}: {why}", fix, "unreadable", error.errno, name)


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
