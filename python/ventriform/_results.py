"""Volumes and results: arrays, reports and the files that the command would write."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from . import _checks, _inputs, _native
from ._errors import InputError, MissingExtraError
from ._frames import Frame, affine_from_lps, checked, points_from_lps

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
        raise MissingExtraError(package, name) from error


def unwrap(source: Any) -> _native.NativeVolume | None:
    """The native volume of a `Volume`."""
    return source._native if isinstance(source, Volume) else None


class Volume:
    """A scan, or the gates of a study: voxels and their place in the patient.

    Parameters
    ----------
    array : array_like, (i, j, k) or (i, j, k, gate)
        Voxel values; NaN, or the mask of a `numpy.ma.MaskedArray`, where one is missing. They are kept as 32-bit floats in
        Fortran order: such an array is copied once, any other is converted first. The last axis of a 4-D array of 6 to 32
        volumes are the gates of a heart beat.
    affine : array_like, (4, 4)
        From voxel indices to millimetres in the patient. Its numbers are rounded to 32 bits, as NIfTI files hold them.
    frame : {'RAS', 'LPS'}
        The patient frame of `affine`, and of this volume's own: RAS as nibabel has it, LPS as DICOM and SimpleITK.
    """

    __slots__ = ("_frame", "_native", "_source")

    def __init__(self, array: Any, affine: Any, *, frame: str = "RAS") -> None:
        kept = checked(frame)
        rows = _inputs.affine_rows(affine, to_lps=kept == "RAS")
        self._native = _native.NativeVolume.from_array(_inputs.voxels(array), rows)
        self._frame: Frame = kept
        self._source: tuple[str, Any] | None = None

    @classmethod
    def _of(cls, native: _native.NativeVolume, frame: Frame, source: tuple[str, Any] | None = None) -> Volume:
        made = cls.__new__(cls)
        made._native = native
        made._frame = frame
        made._source = source
        return made

    @property
    def frame(self) -> Frame:
        """The patient frame of `affine`: RAS or LPS."""
        return self._frame

    def in_frame(self, frame: str) -> Volume:
        """The same volume with its affine to another patient frame."""
        return Volume._of(self._native, checked(frame), self._source)

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
        """The voxels of one volume of several, counted from 0; without `frame` those of the only one, or of the sum of the gates."""
        if frame is not None:
            frame = _checks.whole("frame", frame, 0, self.frames - 1)
        voxels, _ = self._native.voxels(frame)
        return voxels

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

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.shape))
        gates = f", {self.frames} volumes" if self.frames > 1 else ""
        size = ", ".join(f"{mm:.3g}" for mm in self.spacing_mm)
        return f"Volume({shape}{gates}, voxels of {size} mm, {self._frame})"

    def __reduce__(self) -> tuple[Any, ...]:
        if self._source is not None:
            return _volume_again, (self._source, self._frame)
        import numpy as np

        if self.frames == 1:
            array = self.array
        else:
            gates = [self.data(gate) for gate in range(self.frames)]
            array = np.stack(gates, axis=-1)
        if self.facts["affine_source"] == "pixdim":
            return _unplaced_again, (array, self.spacing_mm, self._frame)
        return _array_again, (array, affine_from_lps(self._native.affine(), "LPS"), self._frame)


def _volume_again(source: tuple[str, Any], frame: Frame) -> Volume:
    kind, content = source
    native = _native.NativeVolume.from_paths(content) if kind == "paths" else _native.NativeVolume.from_bytes(content)
    return Volume._of(native, frame, source)


def _array_again(array: Any, affine: Any, frame: Frame) -> Volume:
    return Volume(array, affine, frame="LPS").in_frame(frame)


def _unplaced_again(array: Any, sizes_mm: Sequence[float], frame: Frame) -> Volume:
    return Volume._of(_inputs.unplaced(array, sizes_mm), frame)


class Surface:
    """A triangle surface.

    Attributes
    ----------
    vertices : ndarray, (n, 3), float64
        Positions, mm, in `frame`.
    faces : ndarray, (m, 3), int32
        Vertices of each triangle, counter-clockwise seen from outside.
    frame : {'RAS', 'LPS'}
        The patient frame of the positions.
    """

    __slots__ = ("_lps", "faces", "frame", "vertices")

    def __init__(self, lps: _Floats, faces: NDArray[np.int32], frame: Frame) -> None:
        self._lps = lps
        self.vertices = points_from_lps(lps, frame)
        self.faces = faces
        self.frame: Frame = frame

    def in_frame(self, frame: str) -> Surface:
        """The surface in another patient frame."""
        return Surface(self._lps, self.faces, checked(frame))

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
        document = {"frame": "LPS", "unit": "mm", "vertices": self._lps.tolist(), "triangles": self.faces.tolist()}
        return json.dumps(document).encode()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self.vertices)} vertices, {len(self.faces)} faces, {self.frame})"


class Wall(Surface):
    """A wall of the ventricle: its surface, and the voxels inside it.

    Attributes
    ----------
    mask : ndarray, (i, j, k), bool
        Voxels of the scan's grid whose centre is inside, in Fortran order.
    """

    __slots__ = ("mask",)

    def __init__(self, lps: _Floats, faces: NDArray[np.int32], frame: Frame, mask: NDArray[np.bool_]) -> None:
        super().__init__(lps, faces, frame)
        self.mask = mask

    def in_frame(self, frame: str) -> Wall:
        """The wall in another patient frame."""
        return Wall(self._lps, self.faces, checked(frame), self.mask)


class Model(Surface):
    """A surface model of a volume: a closed surface of exactly as many points as asked for.

    Attributes
    ----------
    name : str
        Its name in reports of fits.
    """

    __slots__ = ("_native", "_report", "name")

    def __init__(self, native: _native.NativeModel, frame: Frame = "RAS", name: str = "model") -> None:
        lps, faces = native.mesh()
        super().__init__(lps, faces, frame)
        self._native = native
        self._report: reports.ModelReport | None = None
        self.name = name

    def in_frame(self, frame: str) -> Model:
        """The model with its positions in another patient frame. Its files are the same."""
        return Model(self._native, checked(frame), self.name)

    @property
    def report(self) -> reports.ModelReport:
        """Figures about the model and how it was made."""
        if self._report is None:
            from .reports import ModelReport

            self._report = ModelReport.from_json(self._native.report())
        return self._report

    @property
    def surface(self) -> Surface:
        """The iso-surface that the model approximates."""
        lps, faces = self._native.surface()
        return Surface(lps, faces, self.frame)

    @property
    def parts(self) -> NDArray[np.uint8]:
        """The part of a ventricle's wall that each triangle is of: 1 endocardium, 2 epicardium, 3 base; else empty."""
        import numpy as np

        return np.frombuffer(bytes(self._native.parts()), dtype=np.uint8)

    def to_bytes(self, format: str, part: str | None = None) -> bytes:
        """The bytes of the model's file: `glb`, `gltf`, `stl`, `ply`, `obj`, `vtp`, `vtk` or `json`; LPS.

        `part` (`endocardium`, `epicardium` or `base`) leaves only that part of a ventricle's wall.
        """
        return bytes(self._native.encode(format, part))

    def save(self, path: _Path, part: str | None = None) -> None:
        """Writes the model to a file, whose extension chooses the format, with the bytes of `ventriform generate`."""
        _, dot, extension = os.fspath(path).rpartition(".")
        if not dot:
            raise InputError("path", f"`{path}` has no extension.", "End it in .glb, .stl, .ply, .obj, .vtp or .json.")
        _write(path, self.to_bytes(extension.lower(), part))

    def save_report(self, path: _Path, *, deidentify: bool = False) -> None:
        """Writes the report: `.json`, or `.html` as a page, which names patient and study unless `deidentify`."""
        if os.fspath(path).lower().endswith(".html"):
            _write(path, self._native.page(deidentify).encode())
        elif os.fspath(path).lower().endswith(".json"):
            _write(path, self._native.report().encode())
        else:
            raise InputError("path", f"`{path}` is no name of a report.", "End it in .json or .html.")

    def __reduce__(self) -> tuple[Any, ...]:
        return _model_again, (self._native.state(), self.frame, self.name)


def _model_again(state: tuple[Any, ...], frame: Frame, name: str) -> Model:
    return Model(_native.NativeModel.restored(state), frame, name)


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

    def save(self, folder: _Path) -> None:
        """Writes all files into a folder, which is made if it is missing."""
        os.makedirs(folder, exist_ok=True)
        for name, content in self._files.items():
            _write(os.path.join(folder, name), content)

    def __repr__(self) -> str:
        return f"Files({', '.join(self._files)})"


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

    def save(self, folder: _Path) -> None:
        """Writes the files that the command would write."""
        self.files.save(folder)


class Fit(Result):
    """A model fitted to a patient.

    Attributes
    ----------
    mask : ndarray, (i, j, k), bool
        Voxels of the scan's grid inside the wall that is shown.
    walls : dict of str to Wall
        `apparent`: the wall as the blurred image shows it; `anatomical`: without what blur, beating and breathing add.
        Other organs have the one that is shown.
    surface : Wall
        The wall that is shown: the one that `edge` asks for, as the reader draws it if one was given.
    frame : {'RAS', 'LPS'}
        The patient frame of `affine` and of the surfaces.
    """

    def __init__(self, made: dict[str, Any], frame: Frame = "RAS") -> None:
        self._made = made
        self.files = Files(made["files"])
        self.frame: Frame = frame
        lps, faces = made["mesh"]
        self.surface = Wall(lps, faces, frame, made["mask"])
        self.walls: dict[str, Wall] = {made["shown"]: self.surface}
        if "other" in made:
            lps, faces = made["other_mesh"]
            self.walls[made["other"]] = Wall(lps, faces, frame, made["other_mask"])

    def __reduce__(self) -> tuple[Any, ...]:
        return Fit, (self._made, self.frame)

    def in_frame(self, frame: str) -> Fit:
        """The fit with its affine and surfaces in another patient frame. Its files are the same."""
        return Fit(self._made, checked(frame))

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Voxels of the scan's grid inside the wall that is shown."""
        return self.surface.mask

    @property
    def affine(self) -> _Floats:
        """From voxel indices to millimetres in `frame`, (4, 4)."""
        return affine_from_lps(self._made["affine"], self.frame)

    @cached_property
    def report(self) -> reports.SegmentationReport:
        """The figures of `report.json`."""
        from .reports import SegmentationReport

        return SegmentationReport.from_json(self.files["report.json"])

    @property
    def confidence(self) -> float:
        """The chance that a reader who draws the visible edge agrees (Jaccard index 0.75 or more), calibrated on simulated
        scans, 0 to 1."""
        return self.report.fit.confidence

    @property
    def flags(self) -> list[Flag]:
        """Reasons to look closer."""
        return [Flag(flag.code, flag.reason) for flag in self.report.flags]

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

        if wall is not None and wall not in self.walls:
            raise InputError("wall", f"There is no wall `{wall}`.", f"Give one of {', '.join(self.walls)}.")
        mask = self.mask if wall is None else self.walls[wall].mask
        place = affine_from_lps(self._made["affine"], "RAS")
        image = extra("nibabel", "nibabel").Nifti1Image(mask.astype(np.uint8), place)
        image.header.set_xyzt_units("mm")
        return image

    def to_pyvista(self) -> Any:
        """The wall that is shown as a `pyvista.PolyData`."""
        return self.surface.to_pyvista()

    def to_trimesh(self) -> Any:
        """The wall that is shown as a `trimesh.Trimesh`."""
        return self.surface.to_trimesh()

    def __repr__(self) -> str:
        return f"Fit(confidence={self.confidence:.2f}, wall={self.report.volumes_ml.wall:.1f} ml, flags={len(self.flags)})"


class Beat(Result):
    """One wall in motion of a gated study.

    Attributes
    ----------
    faces : ndarray, (m, 3), int32
        The triangles of all gates.
    vertices : ndarray, (gates, n, 3), float64
        Positions of the wall's nodes at every gate, mm, in `frame`.
    """

    def __init__(self, made: dict[str, Any], frame: Frame = "RAS") -> None:
        import numpy as np

        self._made = made
        self.files = Files(made["files"])
        self.frame: Frame = frame
        self.faces: NDArray[np.int32] = made["faces"]
        self.vertices = points_from_lps(np.stack(made["vertices"]), frame)

    def __reduce__(self) -> tuple[Any, ...]:
        return Beat, (self._made, self.frame)

    def in_frame(self, frame: str) -> Beat:
        """The beat with its positions in another patient frame. Its files are the same."""
        return Beat(self._made, checked(frame))

    @property
    def surfaces(self) -> list[Surface]:
        """The wall at every gate."""
        return [Surface(lps, self.faces, self.frame) for lps in self._made["vertices"]]

    @cached_property
    def report(self) -> reports.BeatReport:
        """The figures of `beat.json`."""
        from .reports import BeatReport

        return BeatReport.from_json(self.files["beat.json"])

    @property
    def ef_percent(self) -> float | None:
        """Ejection fraction; None if the gates are no beat."""
        return self.report.ef_percent

    @property
    def flags(self) -> list[Flag]:
        """Reasons to look closer."""
        return [Flag(flag.code, flag.reason) for flag in self.report.flags]

    def __repr__(self) -> str:
        report = self.report
        ef = "None" if report.ef_percent is None else f"{report.ef_percent:.0f} %"
        return f"Beat(EDV {report.edv_ml:.0f} ml, ESV {report.esv_ml:.0f} ml, EF {ef})"


class Comparison(Result):
    """Rest and stress of one patient, compared."""

    def __init__(self, files: dict[str, bytes]) -> None:
        self.files = Files(files)

    def __reduce__(self) -> tuple[Any, ...]:
        return Comparison, (dict(self.files),)

    @cached_property
    def report(self) -> reports.ComparisonReport:
        """The figures of `comparison.json`: TID, reversible and fixed share of the wall, segments, territories, flags."""
        from .reports import ComparisonReport

        return ComparisonReport.from_json(self.files["comparison.json"])

    @property
    def flags(self) -> list[Flag]:
        """Reasons to look closer."""
        return [Flag(flag.code, flag.reason) for flag in self.report.flags]

    def polar(self, scan: str) -> _Floats:
        """The polar map of `stress`, `rest` or their `difference`, (32, 60); NaN where there is none."""
        import numpy as np

        name = f"polar_{scan}.json"
        if name not in self.files:
            raise InputError("scan", f"There is no map of `{scan}`.", "Give stress, rest or difference.")
        document = self.files.json(name)
        values = document.get("values_percent", document.get("values"))
        return np.array(values, dtype=np.float64)


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


class NormalLimits:
    """Normal limits of healthy people, as `build_normals` makes them: `normals` of `segment`, `beat` and `compare`."""

    def __init__(self, text: bytes) -> None:
        self._text = _checks.document("text", text, "ventriform-normal-limits", "normals build")

    def __reduce__(self) -> tuple[Any, ...]:
        return NormalLimits, (self._text,)

    @cached_property
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


class Evaluation:
    """Tables and pictures of a cohort, in a folder.

    Attributes
    ----------
    folder : str
        Where the files are: evaluation.html, evaluation.json, table1.csv, figure3.csv, fits.csv, models/ and fits/. Of an
        evaluation without `out` it is removed with this object.
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
    raise InputError("progress", f"A {type(progress).__name__} cannot be told anything.", "Give a function(stage, fraction).")


def _bar_teller(bar: Any) -> Progress:
    total = float(bar.total or 1.0)

    def tell(stage: str, fraction: float) -> None:
        bar.set_description_str(stage, refresh=False)
        bar.update(fraction * total - bar.n)

    return tell
