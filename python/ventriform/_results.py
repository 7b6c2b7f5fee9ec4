"""Volumes and results: arrays, reports and the files that the command would write."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from . import _checks, _html, _inputs, _native
from ._errors import InputError, MissingExtraError
from ._frames import Frame, affine_from_lps, checked, points_from_lps, points_to_lps

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from . import reports

    _Floats = NDArray[np.float64]
    _Path = str | os.PathLike[str]


def extra(package: str, name: str) -> Any:
    """An optional package, or an error that says how to install it."""
    import importlib

    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise MissingExtraError(package.partition(".")[0], name) from error


def unwrap(source: Any) -> _native.NativeVolume | None:
    """The native volume of a `Volume`, whose files are as they were when it was read."""
    return source._current() if isinstance(source, Volume) else None


def frame_of(source: Any, field: str = "scan") -> Frame:
    """The patient frame of a volume, or of the volumes of gates; RAS of anything else."""
    volumes = source if isinstance(source, (list, tuple)) else [source]
    frames: set[Frame] = {one.frame for one in volumes if isinstance(one, Volume)}
    if len(frames) > 1:
        raise InputError(
            field, "Its volumes are in RAS and in LPS.", "Bring them to one frame: volume.in_frame('RAS')."
        )
    return frames.pop() if frames else "RAS"


def simpleitk_image(array: Any, lps: Any) -> Any:
    """Voxels (i, j, k) and their affine to LPS as an image of SimpleITK."""
    import numpy as np

    package = extra("SimpleITK", "simpleitk")
    place = np.array(lps, dtype=np.float64)
    spacing = np.linalg.norm(place[:3, :3], axis=0)
    direction = place[:3, :3] / spacing
    if np.abs(direction.T @ direction - np.eye(3)).max() > OBLIQUE:
        fix = "Resample it to a grid with right angles, or use to_nibabel()."
        raise InputError("affine", "SimpleITK has no images of a grid without right angles.", fix)
    image = package.GetImageFromArray(np.ascontiguousarray(array.transpose()))
    image.SetSpacing(spacing.tolist())
    image.SetOrigin(place[:3, 3].tolist())
    image.SetDirection(direction.ravel().tolist())
    return image


OBLIQUE = 1e-4
"""Greatest cosine of two axes of a grid that has right angles."""


class Volume:
    """A scan, or the gates of a study: voxels and their place in the patient.

    Parameters
    ----------
    array : array_like, (i, j, k) or (i, j, k, gate)
        Voxel values; NaN, or the mask of a `numpy.ma.MaskedArray`, where one is missing. They are kept as 32-bit floats
        in Fortran order: such an array is copied once, any other is converted first. The last axis of a 4-D array of 6
        to 32 volumes are the gates of a heart beat.
    affine : array_like, (4, 4)
        From voxel indices to millimetres in the patient. Its numbers are rounded to 32 bits, as NIfTI files hold them.
    frame : {'RAS', 'LPS'}
        The patient frame of `affine`, and of this volume's own: RAS as nibabel has it, LPS as DICOM and SimpleITK.
    """

    __slots__ = ("_frame", "_native", "_source", "_stamps")

    def __init__(self, array: Any, affine: Any, *, frame: str = "RAS") -> None:
        kept = checked(frame)
        rows = _inputs.affine_rows(affine, to_lps=kept == "RAS")
        self._native = _native.NativeVolume.from_array(_inputs.voxels(array), rows)
        self._frame: Frame = kept
        self._source: tuple[str, Any] | None = None
        self._stamps: list[_inputs.Stamp] = []

    @classmethod
    def _of(
        cls,
        native: _native.NativeVolume,
        frame: Frame,
        source: tuple[str, Any] | None = None,
        stamps: Sequence[_inputs.Stamp] = (),
    ) -> Volume:
        made = cls.__new__(cls)
        made._native = native
        made._frame = frame
        made._source = source
        made._stamps = list(stamps)
        return made

    def _current(self) -> _native.NativeVolume:
        """The native volume, whose files have not changed since they were read."""
        for stamp in self._stamps:
            stamp.check()
        return self._native

    @property
    def frame(self) -> Frame:
        """The patient frame of `affine`: RAS or LPS."""
        return self._frame

    def in_frame(self, frame: str) -> Volume:
        """The same volume with its affine to another patient frame."""
        return Volume._of(self._native, checked(frame), self._source, self._stamps)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Voxels along i, j, k."""
        i, j, k = self._native.shape()
        return i, j, k

    @property
    def frames(self) -> int:
        """Number of volumes: 1, or that of the gates."""
        return self._native.frames()

    @property
    def affine(self) -> _Floats:
        """From voxel indices to millimetres in `frame`, (4, 4)."""
        return affine_from_lps(self._native.affine(), self._frame)

    @property
    def spacing_mm(self) -> tuple[float, float, float]:
        """Voxel size along i, j, k."""
        import numpy as np

        x, y, z = np.linalg.norm(self.affine[:3, :3], axis=0).tolist()
        return x, y, z

    @property
    def array(self) -> NDArray[np.float32]:
        """The voxels (i, j, k), scaled, in Fortran order: the volume, or the sum of its gates. Read anew each time."""
        return self.data()

    def data(self, frame: int | None = None) -> NDArray[np.float32]:
        """The voxels of one volume of several, counted from 0; without `frame` those of the only one, or of the sum of
        the gates."""
        if frame is not None:
            frame = _checks.whole("frame", frame, 0, self.frames - 1)
        native = self._current()
        with _inputs.asking(native):
            voxels, _ = native.voxels(frame)
        return voxels

    def _voxels(self) -> NDArray[np.float32]:
        """All voxels: (i, j, k), or (i, j, k, gate)."""
        import numpy as np

        if self.frames == 1:
            return self.array
        return np.stack([self.data(gate) for gate in range(self.frames)], axis=-1)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """All voxels as NumPy asks for them: (i, j, k), or (i, j, k, gate) of several volumes. Always a new array."""
        if copy is False:
            raise ValueError("the voxels are read anew each time: numpy.asarray(volume) makes an array of them")
        voxels = self._voxels()
        return voxels if dtype is None else voxels.astype(dtype, copy=False)

    @property
    def facts(self) -> dict[str, Any]:
        """Format, data type, place, intensities: what `ventriform inspect` tells."""
        facts: dict[str, Any] = json.loads(self._native.facts())
        return facts

    @property
    def warnings(self) -> list[str]:
        """Sentences about the file that a user should know."""
        return self._native.warnings()

    def to_nibabel(self) -> Any:
        """The volume as a `nibabel.Nifti1Image`; of a gated one the sum of its gates (`data(gate)` has each)."""
        return extra("nibabel", "nibabel").Nifti1Image(self.array, affine_from_lps(self._native.affine(), "RAS"))

    def to_simpleitk(self) -> Any:
        """The volume as a `SimpleITK.Image`; of a gated one the sum of its gates (`data(gate)` has each)."""
        return simpleitk_image(self.array, self._native.affine())

    def _repr_html_(self) -> str:
        facts = self.facts
        rows = [
            ("voxels", " × ".join(map(str, self.shape))),
            ("size", " × ".join(f"{mm:.4g}" for mm in self.spacing_mm) + " mm"),
            ("volumes", self.frames),
            ("frame", self.frame),
            ("format", facts.get("format")),
            ("values", facts.get("data_type")),
            *(("warning", warning) for warning in self.warnings),
        ]
        return _html.table("Volume", rows)

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.shape))
        gates = f", {self.frames} volumes" if self.frames > 1 else ""
        size = ", ".join(f"{mm:.3g}" for mm in self.spacing_mm)
        return f"Volume({shape}{gates}, voxels of {size} mm, {self._frame})"

    def __reduce__(self) -> tuple[Any, ...]:
        if self._source is not None:
            return _volume_again, (self._source, self._frame, [(stamp.path, stamp.digest) for stamp in self._stamps])
        array = self._voxels()
        if self.facts["affine_source"] == "pixdim":
            return _unplaced_again, (array, self.spacing_mm, self._frame)
        return _array_again, (array, affine_from_lps(self._native.affine(), "LPS"), self._frame)


def _volume_again(source: tuple[str, Any], frame: Frame, stamps: Sequence[tuple[str, bytes]] = ()) -> Volume:
    kind, content = source
    if kind != "paths":
        return Volume._of(_native.NativeVolume.from_bytes(content), frame, source)
    native = _inputs.of_paths("source", content)
    if stamps and [path for path, _ in stamps] != [path for _, path in native.files()]:
        reason = f"{content[0]} holds other files than when it was read."
        raise InputError("source", reason, "Read it again: ventriform.read(path).", "file-changed")
    return Volume._of(native, frame, source, [_inputs.Stamp(path, digest) for path, digest in stamps])


def _array_again(array: Any, affine: Any, frame: Frame) -> Volume:
    return Volume(array, affine, frame="LPS").in_frame(frame)


def _unplaced_again(array: Any, sizes_mm: Sequence[float], frame: Frame) -> Volume:
    return Volume._of(_inputs.unplaced(array, sizes_mm), frame)


class Surface:
    """A triangle surface.

    Arrays are copies, made each time that one is asked for. Vertices that are assigned are this object's own: what it
    was made of stays as it was.

    Attributes
    ----------
    frame : {'RAS', 'LPS'}
        The patient frame of the positions.
    """

    __slots__ = ("_faces", "_lps", "frame")

    def __init__(self, lps: _Floats, faces: NDArray[np.int32], frame: Frame) -> None:
        self._lps = lps
        self._faces = faces
        self.frame: Frame = frame

    @property
    def vertices(self) -> _Floats:
        """Positions, mm, in `frame`, (n, 3)."""
        return points_from_lps(self._lps, self.frame)

    @vertices.setter
    def vertices(self, positions: Any) -> None:
        self._lps = points_to_lps(_checks.positions("vertices", positions, len(self._lps)), self.frame)

    @property
    def faces(self) -> NDArray[np.int32]:
        """Vertices of each triangle, counter-clockwise seen from outside, (m, 3)."""
        return self._faces.copy()

    def in_frame(self, frame: str) -> Surface:
        """The surface in another patient frame."""
        return Surface(self._lps, self._faces, checked(frame))

    def to_pyvista(self) -> Any:
        """The surface as a `pyvista.PolyData`."""
        import numpy as np

        sides = np.full((len(self.faces), 1), 3, dtype=np.int64)
        return extra("pyvista", "pyvista").PolyData(self.vertices, np.hstack([sides, self.faces]).ravel())

    def to_trimesh(self) -> Any:
        """The surface as a `trimesh.Trimesh`, its vertices as they are."""
        return extra("trimesh", "trimesh").Trimesh(vertices=self.vertices, faces=self.faces, process=False)

    def _mesh(self) -> bytes:
        """The bytes of the library's own file of a mesh, which states frame and unit, with every digit."""
        document = {"frame": "LPS", "unit": "mm", "vertices": self._lps.tolist(), "triangles": self._faces.tolist()}
        return json.dumps(document).encode()

    def _rows(self) -> list[_html.Row]:
        """What a notebook shows of it."""
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        size = " × ".join(f"{mm:.1f}" for mm in high - low)
        return [
            ("vertices", len(self._lps)),
            ("faces", len(self._faces)),
            ("size", f"{size} mm"),
            ("frame", self.frame),
        ]

    def _repr_html_(self) -> str:
        return _html.table(type(self).__name__, self._rows())

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self._lps)} vertices, {len(self._faces)} faces, {self.frame})"


class Wall(Surface):
    """A wall of the ventricle: its surface, and the voxels inside it."""

    __slots__ = ("_mask",)

    def __init__(self, lps: _Floats, faces: NDArray[np.int32], frame: Frame, mask: NDArray[np.bool_]) -> None:
        super().__init__(lps, faces, frame)
        self._mask = mask

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Voxels of the scan's grid whose centre is inside the wall as it was fitted, (i, j, k), in Fortran order."""
        return self._mask.copy(order="F")

    def in_frame(self, frame: str) -> Wall:
        """The wall in another patient frame."""
        return Wall(self._lps, self._faces, checked(frame), self._mask)


class Model(Surface):
    """A surface model of a volume: a closed surface of exactly as many points as asked for.

    Its files, and fits of it, are of the model as it was made: they are refused once other vertices were assigned.

    Attributes
    ----------
    name : str
        Its name in reports of fits.
    """

    __slots__ = ("_made", "_native", "name")

    def __init__(self, native: _native.NativeModel, frame: Frame = "RAS", name: str = "model") -> None:
        lps, faces = native.mesh()
        super().__init__(lps, faces, frame)
        self._native = native
        self._made = lps
        self.name = name

    def in_frame(self, frame: str) -> Model:
        """The model with its positions in another patient frame. Its files are the same."""
        made = Model(self._native, checked(frame), self.name)
        made._lps, made._made = self._lps, self._made
        return made

    def _unchanged(self) -> _native.NativeModel:
        """The native model, if this is still it."""
        if self._lps is not self._made:
            reason = "Other vertices were assigned than those that were computed."
            fix = "Use the model that `generate` returned, or save this surface by to_trimesh() or to_pyvista()."
            raise InputError("vertices", reason, fix)
        return self._native

    @property
    def report(self) -> reports.ModelReport:
        """Figures about the model and how it was made."""
        from .reports import ModelReport

        return ModelReport.from_json(self._native.report(), frame=self.frame)

    def _rows(self) -> list[_html.Row]:
        figures = _native.headlines("ModelReport", self._native.report().encode())
        warnings = [("warning", one) for one in self.report.warnings]
        return [("name", self.name), *super()._rows(), *figures, *warnings]

    @property
    def surface(self) -> Surface:
        """The iso-surface that the model approximates."""
        lps, faces = self._native.surface()
        return Surface(lps, faces, self.frame)

    @property
    def parts(self) -> NDArray[np.uint8]:
        """The part of a ventricle's wall that each triangle is of: 1 endocardium, 2 epicardium, 3 base; else empty."""
        import numpy as np

        return np.frombuffer(bytearray(self._native.parts()), dtype=np.uint8)

    def to_bytes(self, format: str, part: str | None = None) -> bytes:
        """The bytes of the model's file: `glb`, `gltf`, `stl`, `ply`, `obj`, `vtp`, `vtk` or `json`; LPS.

        `part` (`endocardium`, `epicardium` or `base`) leaves only that part of a ventricle's wall.
        """
        return bytes(self._unchanged().encode(format, part))

    def save(self, path: _Path, part: str | None = None) -> None:
        """Writes the model to a file, whose extension chooses the format, with the bytes of `ventriform generate`."""
        _, dot, extension = os.fspath(path).rpartition(".")
        if not dot:
            raise InputError("path", f"`{path}` has no extension.", "End it in .glb, .stl, .ply, .obj, .vtp or .json.")
        _write(path, self.to_bytes(extension.lower(), part))

    def save_report(self, path: _Path, *, deidentify: bool = False) -> None:
        """Writes the report: `.json`, or `.html` as a page, which names patient and study unless `deidentify`."""
        if os.fspath(path).lower().endswith(".html"):
            _write(path, self._unchanged().page(deidentify).encode())
        elif os.fspath(path).lower().endswith(".json"):
            _write(path, self._native.report().encode())
        else:
            raise InputError("path", f"`{path}` is no name of a report.", "End it in .json or .html.")

    def __reduce__(self) -> tuple[Any, ...]:
        own = None if self._lps is self._made else self._lps
        return _model_again, (self._native.state(), self.frame, self.name, own)


def _model_again(state: tuple[Any, ...], frame: Frame, name: str, own: _Floats | None = None) -> Model:
    made = Model(_native.NativeModel.restored(state), frame, name)
    if own is not None:
        made._lps = own
    return made


class Flag:
    """A reason to look closer.

    Attributes
    ----------
    code : str
        Its stable name.
    reason : str
        The reason, in a sentence.
    """

    __slots__ = ("code", "reason")

    def __init__(self, code: str, reason: str) -> None:
        self.code = code
        self.reason = reason

    def __repr__(self) -> str:
        return f"Flag({self.code!r}, {self.reason!r})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Flag) and (self.code, self.reason) == (other.code, other.reason)

    def __hash__(self) -> int:
        return hash((self.code, self.reason))


class Files(Mapping[str, bytes]):
    """Files by name, as the command writes them."""

    __slots__ = ("_files",)

    def __init__(self, files: dict[str, bytes]) -> None:
        self._files = files

    def __getitem__(self, name: str) -> bytes:
        return self._files[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._files)

    def __len__(self) -> int:
        return len(self._files)

    def json(self, name: str) -> Any:
        """The content of a JSON file."""
        return json.loads(self._files[name])

    def save(self, path: _Path) -> None:
        """Writes all files into a folder, which is made if it is missing; or one of them, if `path` ends in its
        name."""
        name = os.path.basename(_checks.path("path", path))
        if name in self._files and not os.path.isdir(path):
            _write(path, self._files[name])
            return
        ending = next((end for end in FILE_ENDINGS if name.lower().endswith(end)), None)
        if ending is not None and not os.path.isdir(path):
            alike = [own for own in self._files if own.lower().endswith(ending)] or list(self._files)
            fix = (
                f"Give the path of a folder, or one that ends in {' or '.join(alike)}; `files[name]` are the bytes "
                f"of each."
            )
            raise InputError("path", f"`{name}` is none of the {len(self._files)} files of the result.", fix)
        os.makedirs(path, exist_ok=True)
        for own, content in self._files.items():
            _write(os.path.join(path, own), content)

    def _repr_html_(self) -> str:
        return _html.table("Files", [(name, f"{len(content)} bytes") for name, content in self._files.items()])

    def __repr__(self) -> str:
        return f"Files({', '.join(self._files)})"


FILE_ENDINGS = (
    ".nii",
    ".nii.gz",
    ".gz",
    ".hdr",
    ".img",
    ".nrrd",
    ".mha",
    ".mhd",
    ".npy",
    ".npz",
    ".dcm",
    ".zip",
    ".json",
    ".html",
    ".csv",
    ".png",
    ".svg",
    ".jpg",
    ".pdf",
    ".txt",
    ".xlsx",
    ".glb",
    ".gltf",
    ".stl",
    ".ply",
    ".obj",
    ".vtk",
    ".vtp",
    ".pkl",
    ".h5",
)
"""What names of files end in, and hardly one of a folder."""


def _write(path: _Path, content: bytes) -> None:
    with open(path, "wb") as file:
        file.write(content)


class Result:
    """What `segment`, `beat` and `compare` have in common.

    Attributes
    ----------
    files : Files
        What the command writes, by name.
    """

    files: Files

    def save(self, path: _Path) -> None:
        """Writes the files that the command would write into a folder; or one of them, if `path` ends in its name, such
        as mask.nii.gz."""
        self.files.save(path)


class Fit(Result):
    """A model fitted to a patient.

    Arrays and surfaces are copies, made each time that one is asked for: keep what you use more than once.

    Attributes
    ----------
    frame : {'RAS', 'LPS'}
        The patient frame of `affine`, of the surfaces and of the positions in `report`: that of the scan.
    """

    def __init__(self, made: dict[str, Any], frame: Frame = "RAS") -> None:
        self._made = made
        self.files = Files(made["files"])
        self.frame: Frame = frame

    def __reduce__(self) -> tuple[Any, ...]:
        return Fit, (self._made, self.frame)

    def in_frame(self, frame: str) -> Fit:
        """The fit with its affine and surfaces in another patient frame. Its files are the same."""
        return Fit(self._made, checked(frame))

    @property
    def surface(self) -> Wall:
        """The wall that is shown: the one that `edge` asks for, as the reader draws it if one was given."""
        lps, faces = self._made["mesh"]
        return Wall(lps, faces, self.frame, self._made["mask"])

    @property
    def walls(self) -> dict[str, Wall]:
        """`apparent`: the wall as the blurred image shows it; `anatomical`: without what blur, beating and breathing
        add. Other organs have the one that is shown."""
        walls = {self._made["shown"]: self.surface}
        if "other" in self._made:
            lps, faces = self._made["other_mesh"]
            walls[self._made["other"]] = Wall(lps, faces, self.frame, self._made["other_mask"])
        return walls

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Voxels of the scan's grid inside the wall that is shown, (i, j, k), in Fortran order."""
        return self.surface.mask

    @property
    def affine(self) -> _Floats:
        """From voxel indices to millimetres in `frame`, (4, 4)."""
        return affine_from_lps(self._made["affine"], self.frame)

    @property
    def report(self) -> reports.SegmentationReport:
        """The figures of `report.json`; points and directions are `Coordinates` in `frame`."""
        from .reports import SegmentationReport

        return SegmentationReport.from_json(self.files["report.json"], frame=self.frame)

    @cached_property
    def _report(self) -> reports.SegmentationReport:
        return self.report

    @property
    def confidence(self) -> float:
        """The chance that a reader who draws the visible edge agrees (Jaccard index 0.75 or more), calibrated on
        simulated scans, 0 to 1."""
        return self._report.fit.confidence

    @property
    def flags(self) -> list[Flag]:
        """Reasons to look closer."""
        return [Flag(flag.code, flag.reason) for flag in self._report.flags]

    @property
    def polar_map(self) -> reports.PolarMap | None:
        """The polar map with its segments and territories; None for other organs."""
        from .reports import PolarMap

        text = self.files.get("polar.json")
        return PolarMap.from_json(text) if text is not None else None

    @property
    def polar(self) -> _Floats:
        """Uptake of the wall, per cent of its reference, (32, 60), apex first; NaN where there is no muscle."""
        import numpy as np

        found = self.polar_map
        if found is None:
            raise InputError("organ", "Only left ventricles have a polar map.", "Leave `organ` out.")
        return np.array(found.values_percent, dtype=np.float64)

    @property
    def segments(self) -> _Floats:
        """Mean uptake of the 17 segments of the AHA, per cent; NaN where a segment has no wall."""
        import numpy as np

        found = self.polar_map
        if found is None:
            raise InputError("organ", "Only left ventricles have segments.", "Leave `organ` out.")
        return np.array([segment.mean_percent for segment in found.segments], dtype=np.float64)

    def mask_image(self, wall: str | None = None) -> Any:
        """The mask of a wall, by default of the one that is shown, as a `nibabel.Nifti1Image` of 0 and 1."""
        import numpy as np

        place = affine_from_lps(self._made["affine"], "RAS")
        image = extra("nibabel", "nibabel").Nifti1Image(self._mask_of(wall).astype(np.uint8), place)
        image.header.set_xyzt_units("mm")
        return image

    def to_nibabel(self, wall: str | None = None) -> Any:
        """As `mask_image`."""
        return self.mask_image(wall)

    def to_simpleitk(self, wall: str | None = None) -> Any:
        """The mask of a wall, by default of the one that is shown, as a `SimpleITK.Image` of 0 and 1."""
        import numpy as np

        return simpleitk_image(self._mask_of(wall).astype(np.uint8), self._made["affine"])

    def _mask_of(self, wall: str | None) -> NDArray[np.bool_]:
        walls = self.walls
        if wall is not None and wall not in walls:
            raise InputError("wall", f"There is no wall `{wall}`.", f"Give one of {', '.join(walls)}.")
        return self.mask if wall is None else walls[wall].mask

    def to_pyvista(self) -> Any:
        """The wall that is shown as a `pyvista.PolyData`."""
        return self.surface.to_pyvista()

    def to_trimesh(self) -> Any:
        """The wall that is shown as a `trimesh.Trimesh`."""
        return self.surface.to_trimesh()

    def _repr_html_(self) -> str:
        report = self._report
        rows = [
            ("confidence", f"{self.confidence:.2f}"),
            *_native.headlines("SegmentationReport", self.files["report.json"]),
            ("model", report.template),
            ("frame", self.frame),
            *(("flag", f"{flag.code}: {flag.reason}") for flag in self.flags),
        ]
        return _html.table("Fit", rows, self.files.get("polar.png"))

    def __repr__(self) -> str:
        wall = self._report.volumes_ml.wall
        return f"Fit(confidence={self.confidence:.2f}, wall={wall:.1f} ml, flags={len(self.flags)})"


class Beat(Result):
    """One wall in motion of a gated study. Arrays and surfaces are copies, made each time that one is asked for.

    Attributes
    ----------
    frame : {'RAS', 'LPS'}
        The patient frame of the positions, those in `report` included: that of the scan.
    """

    def __init__(self, made: dict[str, Any], frame: Frame = "RAS") -> None:
        self._made = made
        self.files = Files(made["files"])
        self.frame: Frame = frame

    @property
    def faces(self) -> NDArray[np.int32]:
        """The triangles of all gates, (m, 3)."""
        return _triangles(self._made)

    @property
    def vertices(self) -> _Floats:
        """Positions of the wall's nodes at every gate, mm, in `frame`, (gates, n, 3)."""
        import numpy as np

        return points_from_lps(np.stack(self._made["vertices"]), self.frame)

    def __reduce__(self) -> tuple[Any, ...]:
        return Beat, (self._made, self.frame)

    def in_frame(self, frame: str) -> Beat:
        """The beat with its positions in another patient frame. Its files are the same."""
        return Beat(self._made, checked(frame))

    @property
    def surfaces(self) -> list[Surface]:
        """The wall at every gate."""
        faces = self.faces
        return [Surface(lps, faces, self.frame) for lps in self._made["vertices"]]

    @property
    def report(self) -> reports.BeatReport:
        """The figures of `beat.json`; points and directions are `Coordinates` in `frame`."""
        from .reports import BeatReport

        return BeatReport.from_json(self.files["beat.json"], frame=self.frame)

    @cached_property
    def _report(self) -> reports.BeatReport:
        return self.report

    @property
    def ef_percent(self) -> float | None:
        """Ejection fraction; None if the gates are no beat."""
        return self._report.ef_percent

    @property
    def flags(self) -> list[Flag]:
        """Reasons to look closer."""
        return [Flag(flag.code, flag.reason) for flag in self._report.flags]

    def _repr_html_(self) -> str:
        rows = [
            *_native.headlines("BeatReport", self.files["beat.json"]),
            ("gates", len(self._made["vertices"])),
            ("frame", self.frame),
            *(("flag", f"{flag.code}: {flag.reason}") for flag in self.flags),
        ]
        return _html.table("Beat", rows)

    def __repr__(self) -> str:
        report = self._report
        ef = "None" if report.ef_percent is None else f"{report.ef_percent:.0f} %"
        return f"Beat(EDV {report.edv_ml:.0f} ml, ESV {report.esv_ml:.0f} ml, EF {ef})"


def _triangles(made: dict[str, Any]) -> NDArray[np.int32]:
    faces: NDArray[np.int32] = made["faces"].copy()
    return faces


def _map_of(files: Files, name: str) -> _Floats:
    """The values of a polar map, of uptake or of another figure."""
    import numpy as np

    document = files.json(name)
    return np.array(document.get("values_percent", document.get("values")), dtype=np.float64)


class Serial(Result):
    """Scans of one patient over the years, compared."""

    def __init__(self, files: dict[str, bytes]) -> None:
        self.files = Files(files)

    def __reduce__(self) -> tuple[Any, ...]:
        return Serial, (dict(self.files),)

    @property
    def report(self) -> reports.SerialReport:
        """The figures of `serial.json`: those of every scan, and what changed from scan to scan."""
        from .reports import SerialReport

        return SerialReport.from_json(self.files["serial.json"])

    @cached_property
    def _report(self) -> reports.SerialReport:
        return self.report

    @property
    def flags(self) -> list[Flag]:
        """Reasons to look closer."""
        return [Flag(flag.code, flag.reason) for flag in self._report.flags]

    def change(self, figure: str, earlier: int = 1, later: int | None = None) -> reports.FigureChange:
        """The change of a figure, by its name in `report.scans`: from the first to the last scan, or between others."""
        later = len(self._report.scans) if later is None else later
        for own in self._report.changes:
            if (own.figure, own.earlier, own.later) == (figure, earlier, later):
                return own
        known = sorted({own.figure for own in self._report.changes})
        raise InputError(
            "figure",
            f"There is no change of `{figure}` from scan {earlier} to {later}.",
            f"Give one of {', '.join(known)}, and scans that are compared: each with the first and the one before.",
        )

    def _rows(self) -> list[_html.Row]:
        last = len(self._report.scans)
        rows: list[_html.Row] = [("scans", str(last))]
        for own in self._report.changes:
            if (own.earlier, own.later) == (1, last):
                low, high = own.interval
                text = f"{own.change:+.1f} ({low:.1f} to {high:.1f}), changed: {own.verdict.replace('_', ' ')}"
                rows.append((own.figure, text))
        return [*rows, *(("flag", f"{flag.code}: {flag.reason}") for flag in self.flags)]

    def _repr_html_(self) -> str:
        return _html.table("Serial comparison", self._rows())

    def __repr__(self) -> str:
        report = self._report
        pair = report.pairs[0] if len(report.scans) == 2 else report.pairs[len(report.scans) - 2]
        return (
            f"Serial({len(report.scans)} scans, worse {pair.worse_percent:.0f} % ({pair.worse_verdict}), better "
            f"{pair.better_percent:.0f} % ({pair.better_verdict}))"
        )

    def polar(self, scan: int) -> _Floats:
        """The polar map of a scan, counted from 1, (32, 60); NaN where there is none."""
        return self._map(f"polar_scan{scan:02}.json")

    def polar_change(self, earlier: int, later: int) -> _Floats:
        """The map of the change between two scans, earlier less later, points, (32, 60); NaN where there is none."""
        return self._map(f"polar_change_{earlier:02}_{later:02}.json")

    def _map(self, name: str) -> _Floats:
        if name not in self.files:
            raise InputError("scan", f"There is no {name}.", "Scans are counted from 1, in the order of the report.")
        return _map_of(self.files, name)


class Comparison(Result):
    """Rest and stress of one patient, compared.

    Attributes
    ----------
    frame : {'RAS', 'LPS'}
        The patient frame of the positions in `report`: that of the scan at stress.
    """

    def __init__(self, files: dict[str, bytes], frame: Frame = "RAS") -> None:
        self.files = Files(files)
        self.frame: Frame = frame

    def __reduce__(self) -> tuple[Any, ...]:
        return Comparison, (dict(self.files), self.frame)

    def in_frame(self, frame: str) -> Comparison:
        """The comparison with the positions in its report in another patient frame. Its files are the same."""
        return Comparison(dict(self.files), checked(frame))

    @property
    def report(self) -> reports.ComparisonReport:
        """The figures of `comparison.json`: TID, reversible and fixed share of the wall, segments, territories,
        flags."""
        from .reports import ComparisonReport

        return ComparisonReport.from_json(self.files["comparison.json"], frame=self.frame)

    @cached_property
    def _report(self) -> reports.ComparisonReport:
        return self.report

    @property
    def flags(self) -> list[Flag]:
        """Reasons to look closer."""
        return [Flag(flag.code, flag.reason) for flag in self._report.flags]

    def _rows(self) -> list[_html.Row]:
        return [
            *_native.headlines("ComparisonReport", self.files["comparison.json"]),
            ("frame", self.frame),
            *(("flag", f"{flag.code}: {flag.reason}") for flag in self.flags),
        ]

    def _repr_html_(self) -> str:
        return _html.table("Comparison", self._rows(), self.files.get("slices.png"))

    def __repr__(self) -> str:
        report = self._report
        return (
            f"Comparison(TID {report.tid:.2f}, reversible {report.reversible_percent:.0f} %, fixed "
            f"{report.fixed_percent:.0f} %)"
        )

    def polar(self, scan: str) -> _Floats:
        """The polar map of `stress`, `rest` or their `difference`, (32, 60); NaN where there is none."""
        name = f"polar_{scan}.json"
        if name not in self.files:
            raise InputError("scan", f"There is no map of `{scan}`.", "Give stress, rest or difference.")
        return _map_of(self.files, name)


class Measured:
    """The agreement of two masks.

    Attributes
    ----------
    jaccard, dice : float
        0 to 1.
    contour_distance_voxels, contour_distance_mm : float or None
        Mean distance of the contours.
    hausdorff_mm, hausdorff95_mm : float or None
        Largest distance, and its 95th percentile.
    volume_ml, expert_volume_ml : float
        Volumes of the mask and of the reference.
    volume_difference_ml, volume_difference_percent : float, float or None
        How much larger the mask is.
    structures : list of str or None
        Which structure of each was compared; None where there is one.
    resampled : bool
        Whether the reference was resampled.
    """

    jaccard: float
    dice: float
    contour_distance_voxels: float | None
    contour_distance_mm: float | None
    hausdorff_mm: float | None
    hausdorff95_mm: float | None
    volume_ml: float
    expert_volume_ml: float
    volume_difference_ml: float
    volume_difference_percent: float | None

    def __init__(self, text: str, structures: list[str | None], resampled: bool) -> None:
        self._figures: dict[str, Any] = json.loads(text)
        for name, value in self._figures.items():
            setattr(self, name, value)
        self.structures = structures
        self.resampled = resampled

    def to_dict(self) -> dict[str, Any]:
        """The figures as `ventriform measure` prints them."""
        return dict(self._figures)

    def _repr_html_(self) -> str:
        shown = [(name, value) for name, value in self._figures.items() if isinstance(value, (int, float))]
        return _html.table("Measured", [(name.replace("_", " "), f"{value:.4g}") for name, value in shown])

    def __repr__(self) -> str:
        return f"Measured(jaccard={self.jaccard:.3f}, dice={self.dice:.3f})"


class Profile:
    """How a reader draws the wall, as `calibrate` learns it.

    Attributes
    ----------
    name : str
        The reader's name in reports.

    Parameters
    ----------
    text : bytes
        The content of its file.
    name : str
        The reader's name.
    """

    __slots__ = ("_text", "name")

    def __init__(self, text: bytes, name: str = "reader") -> None:
        self._text = _checks.document("text", text, "ventriform-reader-profile", "calibrate")
        self.name = _checks.text("name", name)

    def __reduce__(self) -> tuple[Any, ...]:
        return Profile, (self._text, self.name)

    def to_dict(self) -> dict[str, Any]:
        """The profile as a dictionary: its `kind` is 'edge' with `offsets_mm`, or 'level' with `level`."""
        document: dict[str, Any] = json.loads(self._text)
        return document

    def to_bytes(self) -> bytes:
        """The bytes of its file."""
        return self._text

    def save(self, path: _Path) -> None:
        """Writes the file that `ventriform calibrate` would write."""
        _write(path, self._text)

    def _rows(self) -> list[_html.Row]:
        document = self.to_dict()
        return [("name", self.name), *((key, document[key]) for key in ("kind", "edge") if key in document)]

    def _repr_html_(self) -> str:
        return _html.table("Profile", self._rows())

    def __repr__(self) -> str:
        return f"Profile({self.name!r}, kind={self.to_dict().get('kind')!r})"


class NormalLimits:
    """Normal limits of healthy people, as `build_normals` makes them: `normals` of `segment`, `beat` and `compare`."""

    def __init__(self, text: bytes) -> None:
        self._text = _checks.document("text", text, "ventriform-normal-limits", "normals build")

    def __reduce__(self) -> tuple[Any, ...]:
        return NormalLimits, (self._text,)

    @property
    def document(self) -> reports.LimitsDocument:
        """Their file: groups with cases, maps of mean and standard deviation, and how they were made."""
        from .reports import LimitsDocument

        return LimitsDocument.from_json(self._text)

    @property
    def groups(self) -> list[reports.NormalGroup]:
        """The limits of each sex, protocol, tracer and correction."""
        return self.document.groups

    @property
    def excluded(self) -> list[tuple[str, str]]:
        """Cases that were left out, and why."""
        return [(case.case, case.reason) for case in self.document.excluded]

    def to_bytes(self) -> bytes:
        """The bytes of their file."""
        return self._text

    def save(self, path: _Path) -> None:
        """Writes the file that `ventriform normals build` would write."""
        _write(path, self._text)

    def _repr_html_(self) -> str:
        document = self.document
        rows = [("people", document.people), *(("group", repr(group)) for group in document.groups)]
        return _html.table("NormalLimits", [*rows, ("left out", len(document.excluded))])

    def __repr__(self) -> str:
        return f"NormalLimits({len(self.groups)} groups, {len(self.excluded)} cases left out)"


class Calibration:
    """A reader's profile with figures that say what it is worth.

    Attributes
    ----------
    profile : Profile
        The profile.
    cases : list of dict
        For every case the agreement with its mask without a profile, by one learnt without the case (`held_out`) and by
        one that has seen it (`in_sample`).
    problems : list of (str, str)
        Cases that taught nothing, and why.
    """

    __slots__ = ("cases", "problems", "profile")

    def __init__(self, profile: Profile, cases: list[dict[str, Any]], problems: Sequence[Sequence[str]]) -> None:
        self.profile = profile
        self.cases = cases
        self.problems = [(case, why) for case, why in problems]

    def _repr_html_(self) -> str:
        rows = [("profile", self.profile.name), ("cases", len(self.cases))]
        return _html.table("Calibration", [*rows, *(("problem", f"{case}: {why}") for case, why in self.problems)])

    def __repr__(self) -> str:
        return f"Calibration({self.profile!r}, {len(self.cases)} cases, {len(self.problems)} problems)"


class Evaluation:
    """Tables and pictures of a cohort, in a folder.

    Attributes
    ----------
    folder : str
        Where the files are: evaluation.html, evaluation.json, table1.csv, figure3.csv, fits.csv, models/ and fits/. Of
        an evaluation without `out` it is removed with this object.
    problems : list of (str, str)
        Cases or models that could not be used, and why.
    """

    __slots__ = ("_temporary", "folder", "problems")

    def __init__(self, folder: str, problems: list[tuple[str, str]], *, temporary: Any = None) -> None:
        self.folder = folder
        self.problems = problems
        self._temporary = temporary

    def __reduce__(self) -> tuple[Any, ...]:
        return Evaluation, (self.folder, self.problems)

    def _repr_html_(self) -> str:
        rows = [("folder", self.folder), *(("problem", f"{case}: {why}") for case, why in self.problems)]
        return _html.table("Evaluation", rows)

    def __repr__(self) -> str:
        return f"Evaluation({self.folder!r}, {len(self.problems)} problems)"

    def table(self, name: str) -> list[dict[str, str]]:
        """The rows of `table1`, `figure3` or `fits`."""
        import csv

        path = os.path.join(self.folder, f"{name}.csv")
        if not os.path.isfile(path):
            raise InputError("name", f"There is no table `{name}`.", "Give table1, figure3 or fits.")
        with open(path, newline="") as file:
            return list(csv.DictReader(file))

    def to_dict(self) -> dict[str, Any]:
        """The content of evaluation.json."""
        with open(os.path.join(self.folder, "evaluation.json"), "rb") as file:
            document: dict[str, Any] = json.load(file)
        return document


class Phantom:
    """A simulated scan.

    Attributes
    ----------
    volume : Volume
        The scan.
    truth : Volume
        The wall: 1 inside, 0 outside.
    """

    __slots__ = ("truth", "volume")

    def __init__(self, volume: Volume, truth: Volume) -> None:
        self.volume = volume
        self.truth = truth

    def _repr_html_(self) -> str:
        return _html.table("Phantom", [("volume", self.volume), ("truth", self.truth)])

    def __repr__(self) -> str:
        return f"Phantom({self.volume!r})"


Progress = Callable[[str, float], object]


def teller(progress: Any) -> Progress | None:
    """The function that is told stage and completed fraction: a function, a bar of tqdm, or True for a new one."""
    if progress is None or progress is False:
        return None
    if progress is True:
        bar = extra("tqdm.auto", "tqdm").tqdm(total=1.0, bar_format="{desc:<9} {percentage:3.0f} % |{bar}| {elapsed}")
        return _bar_teller(bar)
    if hasattr(progress, "update") and hasattr(progress, "n"):
        return _bar_teller(progress)
    if callable(progress):
        told: Progress = progress
        return told
    raise InputError(
        "progress", f"A {type(progress).__name__} cannot be told anything.", "Give a function(stage, fraction)."
    )


def _bar_teller(bar: Any) -> Progress:
    total = float(bar.total or 1.0)

    def tell(stage: str, fraction: float) -> None:
        bar.set_description_str(stage, refresh=False)
        bar.update(fraction * total - bar.n)

    return tell
