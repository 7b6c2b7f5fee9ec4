"""What functions take: paths, bytes, open files, arrays, and images of nibabel, SimpleITK, MONAI, xarray and pydicom.

Images are recognised by what they can do, so that none of those packages is needed.
"""

from __future__ import annotations

import os
import struct
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from . import _native
from ._errors import InputError, file_error
from ._frames import Frame

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Native = _native.NativeVolume

#: Whole numbers beyond this are not told apart by the 32-bit floats that voxels are kept in.
MOST_EXACT_WHOLE = 1 << 24

#: Most voxels along an axis of a NIfTI-1 file.
MOST_NIFTI_VOXELS = 32767

#: Millimetres of NIfTI's units of length.
UNIT_MM = {"meter": 1000.0, "micron": 0.001}

#: Age from which the time of a file's last change tells the next one apart: file systems count in steps of up to 2 s.
SETTLED_NS = 3_000_000_000

#: Bytes of a file that are hashed at once.
HASHED_BYTES = 1 << 20

#: Most values of a first axis of four that are asked about: they may be channels or gates.
MOST_CHANNELS = 16

#: Most values of a first axis of four that no heart fits into.
FEWEST_VOXELS = 4

#: Greatest difference of two steps of a coordinate, as a share of a step.
EVEN_STEPS = 1e-3


def voxels(array: Any) -> NDArray[np.float32]:
    """An array (i, j, k) or (i, j, k, gate) as 32-bit floats in Fortran order; no copy where it is that already.

    Masked values become NaN.
    """
    import numpy as np

    refuse_fix = "Give an array of numbers (i, j, k), or (i, j, k, gate), without axes of channels or batches."
    masked = None
    try:
        if isinstance(array, (list, tuple)) and any(isinstance(one, np.ma.MaskedArray) for one in array):
            array = np.ma.array(array)
        if isinstance(array, np.ma.MaskedArray) and np.ma.is_masked(array):
            masked = np.ma.getmaskarray(array)
            # What is beneath the mask is not judged below.
            found = np.where(masked, np.zeros((), array.dtype), array.data)
        else:
            found = np.asarray(_on_host(array))
    except Exception as error:
        raise InputError("array", f"It is no array: {error}.", refuse_fix) from error
    if found.dtype.kind not in "buif":
        raise InputError("array", f"Its values are {found.dtype}.", "Give whole numbers or floats.")
    if found.ndim not in (3, 4) or 0 in found.shape:
        raise InputError("array", f"The array has the shape {found.shape}.", refuse_fix)
    if found.ndim == 4:
        _ask_about_first_axis(found.shape)
    if found.dtype.kind in "ui" and found.dtype.itemsize > 2:
        most = max(abs(int(found.max())), abs(int(found.min())))
        if most > MOST_EXACT_WHOLE:
            reason = f"It holds {most}: voxels are 32-bit floats, which do not tell all whole numbers that large apart."
            raise InputError("array", reason, "Number the labels anew, or scale the values.")
    with np.errstate(over="ignore"):
        single = np.asfortranarray(found, dtype=np.float32)
    if found.dtype.itemsize > 4 and np.isinf(single).any() and not np.isinf(found).any():
        raise InputError("array", "A value is beyond 32-bit floats.", "Scale the values.")
    if masked is not None:
        single[masked] = np.nan
    return single


def _on_host(array: Any) -> Any:
    """A tensor of PyTorch as an array in memory; anything else as it is."""
    return array.detach().cpu().numpy() if callable(getattr(array, "detach", None)) else array


def _ask_about_first_axis(shape: tuple[int, ...]) -> None:
    """Refuses four axes of which the first may be that of channels or gates: read as voxels they would be another
    volume."""
    first, *others, _ = shape
    if first <= FEWEST_VOXELS or first <= MOST_CHANNELS and 2 * first < min(others):
        raise InputError(
            "array",
            f"The array has the shape {shape}, and its first axis may be one of channels or gates; (i, j, k, gate) "
            f"is taken.",
            "Give array[0] for the only channel, or numpy.moveaxis(array, 0, -1) for gates. If it is an axis of "
            "voxels, exchange it "
            "with another, in the affine too.",
            "axis-order",
        )


@contextmanager
def asking(*natives: Native) -> Iterator[None]:
    """Where one volume of several in an array is needed, asks what its last axis is."""
    try:
        yield
    except InputError as error:
        if error.code != "frame-needed" or any(native.files() for native in natives):
            raise
        why = error.reason.partition(" heart beat: ")[2]
        reason = "The array holds several volumes along its last axis, and they are no gates of one heart beat"
        reason += f": {why}" if why else " (6 to 32)."
        fix = f"Give array[..., n] if that axis is one of channels. {error.fix}"
        raise InputError("array", reason, fix, error.code) from error


def affine_rows(affine: Any, to_lps: bool) -> list[list[float]]:
    """The rows of a 4x4 affine, turned from RAS to LPS if `to_lps`."""
    import numpy as np

    try:
        matrix = np.array(_on_host(affine), dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError("affine", f"It is no matrix of numbers: {error}.", "Give a 4x4 matrix.") from error
    if matrix.shape != (4, 4):
        raise InputError("affine", f"It has the shape {matrix.shape}.", "Give a 4x4 matrix.")
    if to_lps:
        matrix[:2] *= -1.0
        matrix += 0.0
    rows: list[list[float]] = matrix.tolist()
    return rows


def is_path(source: Any) -> bool:
    """Whether it names a file."""
    return isinstance(source, (str, os.PathLike))


def is_bytes(source: Any) -> bool:
    """Whether it is the content of a file."""
    return isinstance(source, (bytes, bytearray, memoryview))


def is_open_file(source: Any) -> bool:
    """Whether it is a file that is open for reading, or what reads like one."""
    return callable(getattr(source, "read", None))


def content(file: Any) -> bytes:
    """The bytes that an open file still has to give."""
    fix = "Open the file for reading in binary mode: open(path, 'rb')."
    try:
        found = file.read()
    except (OSError, ValueError) as error:
        raise InputError("source", f"The open file cannot be read: {error}.", fix) from error
    if not is_bytes(found):
        raise InputError("source", f"The open file gives {type(found).__name__}, not bytes.", fix)
    return bytes(found)


def whole_path(path: Any) -> str:
    """The path from the root, which names the same file after a change of the working folder, and in another
    process."""
    given = os.fsdecode(path)
    return given if os.path.isabs(given) else os.path.join(os.getcwd(), given)


def of_paths(field: str, paths: Iterable[Any]) -> Native:
    """The volume in files, all of which the system opens."""
    given = [whole_path(path) for path in paths]
    open_each(field, given)
    native = Native.from_paths(given)
    open_each(field, (stored for _, stored in native.files() if stored not in given))
    return native


def open_each(field: str, paths: Iterable[Any]) -> None:
    """Refuses files and folders that the system does not open."""
    for path in paths:
        try:
            if os.path.isdir(path):
                os.scandir(path).close()
            else:
                with open(path, "rb"):
                    pass
        except OSError as error:
            raise file_error(field, path, error) from error
        except ValueError as error:
            raise InputError(field, f"{path!r} is no path: {error}.", "Give the path of a file.") from error


class Stamp:
    """What a file was when it was read.

    Size, times and number of the file tell at once that it is the same; where they differ, the hash of its bytes
    decides.
    """

    __slots__ = ("_seen", "digest", "path")

    def __init__(self, path: str, digest: bytes | None = None) -> None:
        self.path = path
        self._seen: tuple[int, ...] | None = None
        if digest is None:
            self._seen = _seen(path)
            digest = _digest(path)
        self.digest = digest

    def check(self) -> None:
        """Refuses a file with other bytes."""
        now = _seen(self.path)
        if now is not None and now == self._seen:
            return
        if _digest(self.path) != self.digest:
            raise InputError(
                "source",
                f"{self.path} has changed since it was read.",
                "Read it again: ventriform.read(path).",
                "file-changed",
            )
        self._seen = now


def _seen(path: str) -> tuple[int, ...] | None:
    """What tells a file from one with other bytes; None for one that was written just now."""
    try:
        found = os.stat(path)
    except OSError as error:
        raise file_error("source", path, error) from error
    if time.time_ns() - max(found.st_mtime_ns, found.st_ctime_ns) < SETTLED_NS:
        return None
    return found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino, found.st_dev


def _digest(path: str) -> bytes:
    import hashlib

    made = hashlib.sha256()
    try:
        with open(path, "rb") as file:
            while portion := file.read(HASHED_BYTES):
                made.update(portion)
    except OSError as error:
        raise file_error("source", path, error) from error
    return made.digest()


def is_nibabel(source: Any) -> bool:
    """Whether it is an image of nibabel."""
    return hasattr(source, "dataobj") and hasattr(source, "affine")


def is_simpleitk(source: Any) -> bool:
    """Whether it is an image of SimpleITK."""
    return all(hasattr(source, name) for name in ("GetSpacing", "GetOrigin", "GetDirection", "GetPixelID"))


def is_pydicom(source: Any) -> bool:
    """Whether it is a dataset of pydicom."""
    return hasattr(source, "save_as") and hasattr(source, "to_json_dict")


def is_monai(source: Any) -> bool:
    """Whether it is a tensor that knows its place, as MONAI's MetaTensor."""
    return callable(getattr(source, "detach", None)) and hasattr(source, "affine")


def is_xarray(source: Any) -> bool:
    """Whether it is a DataArray of xarray."""
    return all(hasattr(source, name) for name in ("dims", "coords", "attrs", "transpose", "values"))


def is_placed_array(source: Any) -> bool:
    """Whether it is a pair of an array and its affine."""
    if not isinstance(source, (tuple, list)) or len(source) != 2:
        return False
    shapes = [tuple(getattr(one, "shape", ())) for one in source]
    if not shapes[1] and isinstance(source[1], (tuple, list)):
        rows = source[1]
        shapes[1] = (len(rows), *{len(row) for row in rows if isinstance(row, (tuple, list))})
    return len(shapes[0]) >= 3 and shapes[1] == (4, 4)


def of_monai(image: Any) -> _native.NativeVolume:
    """The voxels of a tensor with its affine, which is RAS unless its `meta` says LPS."""
    meta = getattr(image, "meta", None)
    space = str(meta.get("space", "")) if isinstance(meta, Mapping) else ""
    return _native.NativeVolume.from_array(voxels(image), affine_rows(image.affine, to_lps="LPS" not in space.upper()))


def of_xarray(image: Any, frame: Frame) -> _native.NativeVolume:
    """The voxels of a DataArray: axes by their names, their place by `affine` of its attributes or by its coordinates.

    An attribute `direction`, as ITK writes it, says that the place is LPS; otherwise it is in `frame`.
    """
    import numpy as np

    names = [str(name) for name in image.dims]
    fix = "Give ventriform.Volume(array, affine), with the axes in the order i, j, k."
    spatial = next((axes for axes in ("xyz", "ijk") if set(axes) <= {name.lower() for name in names}), None)
    if spatial is None or len(names) > 4:
        reason = f"The axes are {names}, and which of them are x, y and z is not said."
        raise InputError("dims", reason, "Name them x, y and z, and take the one that is meant of channels. " + fix)
    known = {name.lower(): name for name in names}
    rest = [name for name in names if name.lower() not in spatial]
    if rest and rest[0].lower() not in ("t", "time", "gate", "gates", "frame", "phase"):
        reason = f"The axis `{rest[0]}` is neither x, y, z nor one of time."
        raise InputError("dims", reason, f"Take one of it: image.isel({rest[0]}=0).")
    array = voxels(image.transpose(*[known[axis] for axis in spatial], *rest).values)
    if "affine" in image.attrs:
        return _native.NativeVolume.from_array(array, affine_rows(image.attrs["affine"], to_lps=frame == "RAS"))
    if spatial == "ijk" or not all(known[axis] in image.coords for axis in spatial):
        reason = "The DataArray states no place in the patient."
        raise InputError(
            "affine", reason, "Set attrs['affine'] (4x4), or coordinates x, y and z in millimetres. " + fix
        )
    place = np.eye(4)
    for axis, letter in enumerate(spatial):
        along = np.asarray(image.coords[known[letter]].values, dtype=np.float64)
        steps = np.diff(along)
        if len(along) < 2 or not np.ptp(steps) <= EVEN_STEPS * abs(steps[0]):
            raise InputError(known[letter], "Its steps are not even.", "Give a volume on a regular grid.")
        place[axis, axis] = steps.mean()
        place[axis, 3] = along[0]
    direction = image.attrs.get("direction")
    if direction is None:
        return _native.NativeVolume.from_array(array, affine_rows(place, to_lps=frame == "RAS"))
    # ITK has rows and columns from the last axis to the first.
    turn = np.asarray(direction, dtype=np.float64)[::-1, ::-1][:3, :3]
    place[:3, :3] = turn @ place[:3, :3]
    return _native.NativeVolume.from_array(array, affine_rows(place, to_lps=False))


def of_nibabel(image: Any) -> _native.NativeVolume:
    """The voxels of an image of nibabel."""
    import numpy as np

    if image.affine is None:
        raise InputError("affine", "The image has no affine.", "Give an image with its place in the patient.")
    affine = np.array(image.affine, dtype=np.float64)
    header = getattr(image, "header", None)
    units = getattr(header, "get_xyzt_units", None)
    scale = UNIT_MM.get(units()[0], 1.0) if units else 1.0
    affine[:3] *= scale
    array = np.asanyarray(image.dataobj)
    while array.ndim > 3 and array.shape[-1] == 1:
        array = array[..., 0]
    coded = [getattr(header, name, None) for name in ("get_sform", "get_qform")]
    if all(coded) and not any(get(coded=True)[1] for get in coded if get):
        sizes = [float(mm) * scale for mm in image.header.get_zooms()[:3]]
        return unplaced(voxels(array), sizes)
    return _native.NativeVolume.from_array(voxels(array), affine_rows(affine, to_lps=True))


def of_simpleitk(image: Any) -> _native.NativeVolume:
    """The voxels of an image of SimpleITK."""
    import numpy as np
    import SimpleITK

    dimension = image.GetDimension()
    if dimension not in (3, 4):
        raise InputError("image", f"The image has {dimension} dimensions.", "Give an image of 3, or of 4 with gates.")
    # SimpleITK ends the process where it is asked for the array of one.
    if image.GetPixelIDTypeAsString().startswith("label of"):
        raise InputError("image", "It is a label map.", "Give SimpleITK.LabelMapToLabel(image).")
    if image.GetNumberOfComponentsPerPixel() != 1:
        raise InputError("image", "A voxel has several components.", "Give an image of one number a voxel.")
    direction = np.array(image.GetDirection(), dtype=np.float64).reshape(dimension, dimension)[:3, :3]
    affine = np.eye(4)
    affine[:3, :3] = direction * np.array(image.GetSpacing()[:3])
    affine[:3, 3] = image.GetOrigin()[:3]
    array = SimpleITK.GetArrayViewFromImage(image).transpose()
    codes = [image.GetMetaData(key) if image.HasMetaDataKey(key) else "" for key in ("sform_code", "qform_code")]
    # SimpleITK reads such a file as the identity. An image that has another place now was given it since.
    if codes == ["0", "0"] and not np.any(affine[:3, 3]) and np.array_equal(direction, np.eye(3)):
        return unplaced(voxels(array), [float(mm) for mm in image.GetSpacing()[:3]])
    return _native.NativeVolume.from_array(voxels(array), affine_rows(affine, to_lps=False))


def unplaced(array: NDArray[np.float32], sizes_mm: Sequence[float]) -> _native.NativeVolume:
    """Voxels whose place in the patient no header states, as a NIfTI file that states none: they are read with its
    warning."""
    return _native.NativeVolume.from_bytes([("the image", nifti_bytes(array, sizes_mm, None))])


def nifti_bytes(array: NDArray[np.float32], sizes_mm: Sequence[float], ras: Sequence[Sequence[float]] | None) -> bytes:
    """A NIfTI-1 file of 32-bit floats (i, j, k) or (i, j, k, gate); `ras` is the affine to RAS mm, if the file states
    one."""
    if max(array.shape) > MOST_NIFTI_VOXELS:
        reason = (
            f"The array has the shape {array.shape}, and a NIfTI-1 file holds at most {MOST_NIFTI_VOXELS} "
            f"voxels along an axis."
        )
        fix = (
            "Give ventriform.Volume(array, affine)."
            if ras is None
            else "Write it as a file of another format, and give its path."
        )
        raise InputError("array", reason, fix)
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, array.ndim, *array.shape, *[1] * (7 - array.ndim))
    struct.pack_into("<2h", header, 70, 16, 32)
    struct.pack_into("<8f", header, 76, 1.0, *sizes_mm, *[1.0] * 4)
    struct.pack_into("<3f", header, 108, 352.0, 1.0, 0.0)
    header[123] = 2
    if ras is not None:
        struct.pack_into("<h", header, 254, 1)
        struct.pack_into("<12f", header, 280, *[number for row in ras[:3] for number in row])
    header[344:348] = b"n+1\0"
    return bytes(header) + array.astype("<f4", copy=False).tobytes(order="F")


def files(volume: Native) -> list[tuple[str, Any]]:
    """Name and path, or name and bytes, of the files that a volume is in; of arrays one file is made."""
    import numpy as np

    stored = volume.files()
    if stored:
        return stored
    gates = [volume.voxels(gate)[0] for gate in range(volume.frames())]
    array = gates[0] if len(gates) == 1 else np.stack(gates, axis=-1)
    ras = np.array(volume.affine(), dtype=np.float64)
    ras[:2] *= -1.0
    ras += 0.0
    sizes_mm = np.linalg.norm(ras[:3, :3], axis=0).tolist()
    return [("array.nii", nifti_bytes(array, sizes_mm, ras.tolist()))]


def dicom_bytes(dataset: Any, index: int = 0) -> tuple[str, bytes]:
    """Name and bytes of the file of a dataset of pydicom."""
    import io

    # A file of pixels without pixels is refused here, because its absence is not seen in the file's bytes.
    if not any(name in dataset for name in ("PixelData", "FloatPixelData", "DoubleFloatPixelData")):
        raise InputError("PixelData", "The dataset has no pixels.", "Read it without stop_before_pixels.")
    buffer = io.BytesIO()
    try:
        dataset.save_as(buffer, enforce_file_format=True)
    except Exception as error:
        fix = "Give a dataset as pydicom.dcmread returns it, with its file_meta."
        raise InputError("dataset", f"It cannot be written as a file: {error}.", fix) from error
    return f"dataset{index}.dcm", buffer.getvalue()


Source = Any


def native(source: Source, unwrap: Callable[[Any], Native | None], frame: Frame = "RAS") -> Native:
    """The volume that `source` is, unread where it is files. `unwrap` knows the package's own volumes; `frame` is that
    of an affine beside an array."""
    own = unwrap(source)
    if own is not None:
        return own
    if is_path(source):
        return of_paths("source", [source])
    if is_bytes(source):
        return Native.from_bytes([("bytes", bytes(source))])
    if is_open_file(source):
        return Native.from_bytes([("the open file", content(source))])
    if is_placed_array(source):
        return Native.from_array(voxels(source[0]), affine_rows(source[1], to_lps=frame == "RAS"))
    if is_nibabel(source):
        return of_nibabel(source)
    if is_monai(source):
        return of_monai(source)
    if is_xarray(source):
        return of_xarray(source, frame)
    if is_simpleitk(source):
        return of_simpleitk(source)
    if is_pydicom(source):
        return Native.from_bytes([dicom_bytes(source)])
    if isinstance(source, Sequence) and len(source) > 0:
        if all(is_path(one) for one in source):
            return of_paths("source", source)
        if all(is_bytes(one) for one in source):
            return Native.from_bytes([(f"bytes{n}", bytes(one)) for n, one in enumerate(source, 1)])
        if all(is_open_file(one) for one in source):
            return Native.from_bytes([(f"file{n}", content(one)) for n, one in enumerate(source, 1)])
        if all(is_pydicom(one) for one in source):
            return Native.from_bytes([dicom_bytes(one, n) for n, one in enumerate(source, 1)])
        if len(source) == 1:
            return native(source[0], unwrap, frame)
    raise InputError(
        "source",
        f"A value of type {type(source).__name__} is no volume.",
        "Give a path, paths, bytes, an open file, a ventriform.Volume, (array, affine), an image of nibabel, "
        "SimpleITK, MONAI or "
        "xarray, or datasets of pydicom.",
    )


def gates(source: Source, unwrap: Callable[[Any], Native | None]) -> list[Native]:
    """The volumes of a gated study: one that holds all gates, or one for each."""
    apart = isinstance(source, Sequence) and not is_path(source) and not is_bytes(source) and len(source) > 1
    apart = apart and not is_placed_array(source)
    files_apart = (is_path, is_bytes, is_open_file, is_pydicom)
    if apart and not any(check(one) for one in source for check in files_apart):
        return [native(one, unwrap) for one in source]
    return [native(source, unwrap)]
