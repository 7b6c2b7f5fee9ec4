"""Surface models of the left ventricle from cardiac SPECT: generated, fitted, measured.

>>> import ventriform as vf
>>> scan = vf.read("rest.dcm")
>>> fit = vf.segment(scan)
>>> fit.mask, fit.confidence, fit.polar

Functions: `read`, `reconstruct`, `generate`, `segment`, `beat`, `compare`, `serial`, `build_normals`, `measure`,
`calibrate`, `evaluate`, `phantom`. Their parameters are those of the commands of the same names (`normals build`).
Positions are millimetres in the patient frame of the scan, in and out: RAS, as nibabel has it, unless it was read with
`frame="LPS"`. `Coordinates` state theirs. Files are LPS, as the command writes them.

Modules: `ventriform.plot` draws (extra `plot`), `ventriform.reports` has the classes of reports, `ventriform.client` is
a client of the service (extra `client`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._errors import (
    FileDeniedError,
    FileError,
    FileIsFolderError,
    FileIsNoFolderError,
    FileMissingError,
    InputError,
    InternalError,
    MissingExtraError,
    TooLargeError,
    UnreadableError,
    VentriformError,
)
from ._frames import Coordinates
from ._functions import (
    beat,
    build_normals,
    calibrate,
    compare,
    evaluate,
    generate,
    measure,
    phantom,
    read,
    reconstruct,
    segment,
    serial,
)
from ._native import __version__
from ._results import (
    Beat,
    Calibration,
    Comparison,
    Evaluation,
    Files,
    Fit,
    Flag,
    Measured,
    Model,
    NormalLimits,
    Phantom,
    Profile,
    Serial,
    Surface,
    Volume,
    Wall,
)

if TYPE_CHECKING:
    from . import plot, reports
    from .client import Client

__all__ = [
    "Beat",
    "Calibration",
    "Client",
    "Comparison",
    "Coordinates",
    "Evaluation",
    "FileDeniedError",
    "FileError",
    "FileIsFolderError",
    "FileIsNoFolderError",
    "FileMissingError",
    "Files",
    "Fit",
    "Flag",
    "InputError",
    "InternalError",
    "Measured",
    "MissingExtraError",
    "Model",
    "NormalLimits",
    "Phantom",
    "Profile",
    "Serial",
    "Surface",
    "TooLargeError",
    "UnreadableError",
    "VentriformError",
    "Volume",
    "Wall",
    "__version__",
    "beat",
    "build_normals",
    "calibrate",
    "compare",
    "evaluate",
    "generate",
    "measure",
    "phantom",
    "plot",
    "read",
    "reconstruct",
    "reports",
    "segment",
    "serial",
]


def __getattr__(name: str) -> Any:
    # Modules that few programs need, and that take time to import.
    import importlib

    if name == "Client":
        return importlib.import_module(".client", __name__).Client
    if name in ("plot", "reports", "client"):
        return importlib.import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
