"""What functions take: paths, bytes, open files, arrays, and images of nibabel, SimpleITK and pydicom.

Images are recognised by what they can do, so that none of those packages is needed.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from . import _native
from ._errors import InputError

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


def voxels(array: Any) -> NDArray[np.float32]:
    """An array (i, j, k) or (i, j, k, gate) as 32-bit floats in Fortran order; no copy where it is that already.

    Masked values become NaN.
    """
    import numpy as np

    refuse_fix = "Give an array of numbers (i, j, k), or (i, j, k, gate)."
    masked = None
    try:
        if isinstance(array, (list, tuple)) and any(isinstance(one, np.ma.MaskedArray) for one in array):
            array = np.ma.array(array)
        if isinstance(array, np.ma.MaskedArray) and np.ma.is_masked(array):
            masked = np.ma.getmaskarray(array)
            # What is beneath the mask is not judged below.
            found = np.where(masked, np.zeros((), array.dtype), array.data)
        else:
            found = np.asarray(array)
    except Exception as error:
        raise InputError("array", f"It is no array: {error}.", refuse_fix) from error
    if found.dtype.kind not in "buif":
        raise InputError("array", f"Its values are {found.dtype}.", "Give whole numbers or floats.")
    if found.ndim not in (3, 4) or 0 in found.shape:
        raise InputError("array", f"The array has the shape {found.shape}.", refuse_fix)
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


def affine_rows(affine: Any, to_lps: bool) -> list[list[float]]:
    """The rows of a 4x4 affine, turned from RAS to LPS if `to_lps`."""
    import numpy as np

    try:
        matrix = np.array(affine, dtype=np.float64)
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


def is_nibabel(source: Any) -> bool:
    """Whether it is an image of nibabel."""
    return hasattr(source, "dataobj") and hasattr(source, "affine")


def is_simpleitk(source: Any) -> bool:
    """Whether it is an image of SimpleITK."""
    return all(hasattr(source, name) for name in ("GetSpacing", "GetOrigin", "GetDirection", "GetPixelID"))


def is_pydicom(source: Any) -> bool:
    """Whether it is a dataset of pydicom."""
    return hasattr(source, "save_as") and hasattr(source, "to_json_dict")


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
    """Voxels whose place in the patient no header states, as a NIfTI file that states none: they are read with its warning."""
    return _native.NativeVolume.from_bytes([("the image", nifti_bytes(array, sizes_mm, None))])


def nifti_bytes(array: NDArray[np.float32], sizes_mm: Sequence[float], ras: Sequence[Sequence[float]] | None) -> bytes:
    """A NIfTI-1 file of 32-bit floats (i, j, k) or (i, j, k, gate); `ras` is the affine to RAS mm, if the file states one."""
    if max(array.shape) > MOST_NIFTI_VOXELS:
        reason = f"The array has the shape {array.shape}, and a NIfTI-1 file holds at most {MOST_NIFTI_VOXELS} voxels along an axis."
        fix = "Give ventriform.Volume(array, affine)." if ras is None else "Write it as a file of another format, and give its path."
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


def native(source: Source, unwrap: Callable[[Any], Native | None]) -> Native:
    """The volume that `source` is, unread where it is files. `unwrap` knows the package's own volumes."""
    own = unwrap(source)
    if own is not None:
        return own
    if is_path(source):
        return Native.from_paths([os.fspath(source)])
    if is_bytes(source):
        return Native.from_bytes([("bytes", bytes(source))])
    if is_open_file(source):
        return Native.from_bytes([("the open file", content(source))])
    if is_nibabel(source):
        return of_nibabel(source)
    if is_simpleitk(source):
        return of_simpleitk(source)
    if is_pydicom(source):
        return Native.from_bytes([dicom_bytes(source)])
    if isinstance(source, Sequence) and len(source) > 0:
        if all(is_path(one) for one in source):
            return Native.from_paths([os.fspath(one) for one in source])
        if all(is_bytes(one) for one in source):
            return Native.from_bytes([(f"bytes{n}", bytes(one)) for n, one in enumerate(source, 1)])
        if all(is_open_file(one) for one in source):
            return Native.from_bytes([(f"file{n}", content(one)) for n, one in enumerate(source, 1)])
        if all(is_pydicom(one) for one in source):
            return Native.from_bytes([dicom_bytes(one, n) for n, one in enumerate(source, 1)])
        if len(source) == 1:
            return native(source[0], unwrap)
    raise InputError(
        "source",
        f"A value of type {type(source).__name__} is no volume.",
        "Give a path, paths, bytes, an open file, a ventriform.Volume, an image of nibabel or SimpleITK, or datasets of pydicom.",
    )


def gates(source: Source, unwrap: Callable[[Any], Native | None]) -> list[Native]:
    """The volumes of a gated study: one that holds all gates, or one for each."""
    apart = isinstance(source, Sequence) and not is_path(source) and not is_bytes(source) and len(source) > 1
    files_apart = (is_path, is_bytes, is_open_file, is_pydicom)
    if apart and not any(check(one) for one in source for check in files_apart):
        return [native(one, unwrap) for one in source]
    return [native(source, unwrap)]
