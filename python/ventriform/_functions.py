"""The commands as functions. What `**parameters` takes comes from the library's tables (`_tables`)."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from . import _checks, _inputs, _native, _objects
from ._errors import InputError, file_error
from ._frames import Frame, checked
from ._results import (
    Beat,
    Calibration,
    Comparison,
    Evaluation,
    Fit,
    Measured,
    Model,
    NormalLimits,
    Phantom,
    Profile,
    Serial,
    Surface,
    Volume,
    frame_of,
    teller,
    unwrap,
)
from ._tables import to_lps, with_table

Path = str | os.PathLike[str]


def _kept(source: Any) -> tuple[str, Any] | None:
    """How a pickle finds the volume again; None where it takes the voxels along."""
    sources = [source] if _inputs.is_path(source) or _inputs.is_bytes(source) else source
    if not isinstance(sources, Sequence) or not sources:
        return None
    if all(_inputs.is_path(one) for one in sources):
        return "paths", [_inputs.whole_path(one) for one in sources]
    if all(_inputs.is_bytes(one) for one in sources):
        return "bytes", [(f"bytes{n}", bytes(one)) for n, one in enumerate(sources, 1)]
    return None


def read(source: Any, *, frame: str = "RAS", threads: int | None = None) -> Volume:
    """Reads a scan, decoding every voxel once, so that an unusable file is refused here.

    Parameters
    ----------
    source : path, sequence of paths, bytes, open file, or image
        NIfTI or DICOM: a file, the files of a series, a folder or a zip archive; the bytes of a file; a file that is
        open in binary mode, from where it is to its end; a `Volume`; a pair (array, affine); an image of nibabel,
        SimpleITK, MONAI or xarray; a dataset of pydicom, or those of a series. Files named by paths are read again when
        they are used, so they must stay where and as they are: one with other bytes is refused.
    frame : {'RAS', 'LPS'}
        The patient frame of the volume's affine, of points and directions that are given for it, and of its results. A
        pair's affine is in it.
    threads : int, optional
        Threads to work on; by default as many as there are processors.
    """
    kept = checked(frame)
    if isinstance(source, Volume):
        return source.in_frame(kept)
    # Its bytes are given out once.
    if not _inputs.is_path(source) and _inputs.is_open_file(source):
        source = _inputs.content(source)
    native = _inputs.native(source, unwrap, kept)
    paths = [stored for _, stored in native.files() if isinstance(stored, str)]
    stamps = [_inputs.Stamp(path) for path in paths]
    native.inspect(_how(None, threads))
    for stamp in stamps:
        stamp.check()
    return Volume._of(native, kept, _kept(source), stamps)


@with_table("reconstruct")
def reconstruct(
    raw: Any, *, sum_gates: bool = False, progress: Any = None, threads: int | None = None, **parameters: Any
) -> Volume:
    """Reconstructs the projections of a gamma camera, as `ventriform reconstruct`.

    Parameters
    ----------
    raw : Volume, path, bytes or dataset
        A DICOM NM image of the Image Type TOMO or GATED TOMO, as `read` takes it.
    sum_gates : bool
        One volume of the counts of all gates.
    progress : callable or tqdm, optional
        Told stage and completed fraction of the whole. An exception in it ends the work.
    threads : int, optional
        Threads to work on; by default as many as there are processors.
    [parameters]

    Returns
    -------
    Volume
        With a volume for each gate, unless they are summed.

    Raises
    ------
    InputError
        If there are no projections, they contradict themselves, or a parameter cannot be used.
    """
    frame = frame_of(raw)
    native = _inputs.native(raw, unwrap)
    made = _native.reconstruct(native, parameters, sum_gates, _how(progress, threads))
    return Volume._of(made, frame, None, [])


@with_table("generate")
def generate(scan: Any, *, progress: Any = None, threads: int | None = None, **parameters: Any) -> Model:
    """Makes a surface model of a volume, as `ventriform generate`.

    Parameters
    ----------
    scan : Volume, path, bytes or image
        As `read` takes it.
    progress : callable or tqdm, optional
        Told stage and completed fraction of the whole. An exception in it ends the work.
    threads : int, optional
        Threads to work on; by default as many as there are processors.
    [parameters]

    Returns
    -------
    Model

    Raises
    ------
    InputError
        If the volume cannot be read, no model can be made of it, or a parameter cannot be used.
    """
    native = _inputs.native(scan, unwrap)
    with _inputs.asking(native):
        made = _native.generate(native, parameters, _how(progress, threads))
    return Model(made, frame_of(scan), _stem(scan, "model"))


@with_table("segment", "dicom")
def segment(
    scan: Any,
    *,
    model: Any = "auto",
    reader: Any = None,
    expert: Any = None,
    normals: Any = None,
    formats: Sequence[str] = ("glb", "stl", "json"),
    parts: Sequence[str] = (),
    deidentify: bool = False,
    progress: Any = None,
    threads: int | None = None,
    **parameters: Any,
) -> Fit:
    """Fits a model to the left ventricle, or another organ, in a volume, as `ventriform segment`.

    Parameters
    ----------
    scan : Volume, path, bytes or image
        As `read` takes it.
    model : 'auto', Model, path, or a sequence of these
        What to fit: the built-in hearts, models, or files of closed meshes. The fit with the greatest confidence is
        kept.
    reader : Profile or path, optional
        How a reader draws the wall (`calibrate`): the wall is drawn as that reader would.
    expert : Volume, path, bytes or image, optional
        An expert's mask to measure the result against: what `measure` takes.
    normals : NormalLimits, path or bytes, optional
        Normal limits to compare the wall's uptake with (`build_normals`).
    formats : sequence of str
        Formats of the meshes among the files.
    parts : sequence of {'endocardium', 'epicardium', 'base'}
        Parts of the wall that become files of their own.
    deidentify : bool
        Leave patient, study and series out of report.html, and the patient's identity out of DICOM objects (PS3.15,
        basic profile).
    progress : callable or tqdm, optional
        Told stage and completed fraction of the whole. An exception in it ends the work.
    threads : int, optional
        Threads to work on; by default as many as there are processors.
    [parameters]

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        If the volume or a model cannot be read, the organ is not found, or a parameter cannot be used.
    """
    frame = frame_of(scan)
    parameters, order = _ordered("segment", parameters, deidentify, lambda _: frame)
    order |= _order(model, formats, parts, (normals, parameters), deidentify)
    order["expert"] = None if expert is None else _inputs.native(_mask(expert), unwrap)
    order["reader"] = _profile(reader)
    native = _inputs.native(scan, unwrap)
    with _inputs.asking(native):
        return Fit(_native.segment(native, order, parameters, _how(progress, threads)), frame)


@with_table("beat", "dicom")
def beat(
    gates: Any,
    *,
    model: Any = "auto",
    normals: Any = None,
    formats: Sequence[str] = ("glb",),
    deidentify: bool = False,
    progress: Any = None,
    threads: int | None = None,
    **parameters: Any,
) -> Beat:
    """Fits one model in motion to the gates of a study, as `ventriform beat`.

    Parameters
    ----------
    gates : Volume, path, bytes or image, or a sequence of them
        A volume with all gates, or one for each gate in their order.
    model, normals, formats, deidentify, progress, threads
        As `segment` takes them.
    [parameters]

    Returns
    -------
    Beat

    Raises
    ------
    InputError
        If the gates cannot be read or are no beat, or a parameter cannot be used.
    """
    frame = frame_of(gates, "gates")
    parameters, order = _ordered("beat", parameters, deidentify, lambda _: frame)
    order |= _order(model, formats, (), (normals, parameters), deidentify)
    scans = _inputs.gates(gates, unwrap)
    with _inputs.asking(*scans):
        return Beat(_native.beat(scans, order, parameters, _how(progress, threads)), frame)


@with_table("compare", "dicom")
def compare(
    *,
    stress: Any,
    rest: Any,
    model: Any = "auto",
    normals: Any = None,
    formats: Sequence[str] = ("glb", "json"),
    deidentify: bool = False,
    progress: Any = None,
    threads: int | None = None,
    **parameters: Any,
) -> Comparison:
    """Compares rest and stress of one patient, as `ventriform compare`.

    Parameters
    ----------
    stress, rest : Volume, path, bytes or image, or a sequence of gates
        The scans, by these names alone. Where both are gated, a beat is fitted to each.
    model, normals, formats, deidentify, progress, threads
        As `segment` takes them.
    [parameters]

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        If a heart cannot be fitted, the scans are one scan or of two patients, or a parameter cannot be used.
    """
    frames = {"stress": frame_of(stress, "stress"), "rest": frame_of(rest, "rest")}

    def frame_for(name: str) -> Frame:
        scan = name.partition("_")[0]
        if scan in frames:
            return frames[scan]
        if frames["stress"] != frames["rest"]:
            reason = f"It is for both scans, of which stress is in {frames['stress']} and rest in {frames['rest']}."
            raise InputError(
                name, reason, "Give ventriform.Coordinates(numbers, frame=...), or bring both to one frame."
            )
        return frames["stress"]

    parameters, order = _ordered("compare", parameters, deidentify, frame_for)
    order |= _order(model, formats, (), (normals, parameters), deidentify)
    scans = [_inputs.gates(scan, unwrap) for scan in (stress, rest)]
    with _inputs.asking(*scans[0], *scans[1]):
        made = _native.compare(scans[0], scans[1], order, parameters, _how(progress, threads))
    return Comparison(made["files"], frames["stress"])


@with_table("serial", "dicom")
def serial(
    *scans: Any,
    model: Any = "auto",
    normals: Any = None,
    formats: Sequence[str] = ("glb", "json"),
    deidentify: bool = False,
    progress: Any = None,
    threads: int | None = None,
    **parameters: Any,
) -> Serial:
    """Compares scans of one patient over the years, as `ventriform serial`.

    Parameters
    ----------
    *scans : Volume, path, bytes or image, or a sequence of gates, each
        2 to 20 scans, all at rest or all at stress. Dates of their headers order them. Where all are gated, a beat is
        fitted to each.
    model, normals, formats, deidentify, progress, threads
        As `segment` takes them.
    [parameters]

    Returns
    -------
    Serial

    Raises
    ------
    InputError
        If a heart cannot be fitted, a scan is given twice, the scans are of two patients or of two kinds, or a
        parameter cannot be used.
    """
    frames = [frame_of(scan, f"scans[{place}]") for place, scan in enumerate(scans)]

    def frame_for(name: str) -> Frame:
        if len(set(frames)) > 1:
            raise InputError(
                name,
                "It is for all scans, and they are in several frames.",
                "Give ventriform.Coordinates(numbers, frame=...), or bring all to one frame.",
            )
        return frames[0] if frames else "RAS"

    parameters, order = _ordered("serial", parameters, deidentify, frame_for)
    order |= _order(model, formats, (), (normals, parameters), deidentify)
    given = [_inputs.gates(scan, unwrap) for scan in scans]
    with _inputs.asking(*(volume for scan in given for volume in scan)):
        return Serial(_native.serial(given, order, parameters, _how(progress, threads))["files"])


def measure(
    a: Any,
    b: Any,
    *,
    label: str | int | None = None,
    label_a: str | int | None = None,
    label_b: str | int | None = None,
    resample: bool = False,
    mesh_unit: str | None = None,
    mesh_frame: str | None = None,
    progress: Any = None,
    threads: int | None = None,
) -> Measured:
    """Compares two masks, as `ventriform measure`.

    Parameters
    ----------
    a, b : Fit, Wall, Model, Volume, path, bytes or image
        The mask to judge, and the reference: a volume of 0 and another value, a label map, a DICOM Segmentation,
        probabilities of which those above .5 count, or a closed surface: a `Wall`, a `Model` or the file of a mesh. A
        `Fit` is its mask.
    label : str or int, optional
        Structure to compare, of each that holds several: number of a label or segment, or name of a segment.
    label_a, label_b : str or int, optional
        Structure of one of them.
    resample : bool
        Bring `b` to the grid of `a` by the nearest voxel if they are different grids.
    mesh_unit : {'mm', 'cm', 'm'}, optional
        Unit of meshes that do not state theirs.
    mesh_frame : {'lps', 'ras'}, optional
        Frame of meshes that do not state theirs.
    progress : callable or tqdm, optional
        Told stage and completed fraction of the whole. An exception in it ends the work.
    threads : int, optional
        Threads to work on; by default as many as there are processors.

    Returns
    -------
    Measured

    Raises
    ------
    InputError
        If a mask cannot be read or is empty, or which structure is meant cannot be told.
    """
    _check_mesh(mesh_unit, mesh_frame)
    masks = [_inputs.native(_mask(mask), unwrap) for mask in (a, b)]
    labels = [None if one is None else str(one) for one in (label, label_a, label_b)]
    text, structures, resampled = _native.measure(
        masks[0], masks[1], labels, bool(resample), [mesh_unit, mesh_frame], _how(progress, threads)
    )
    return Measured(text, structures, resampled)


@with_table("calibrate")
def calibrate(
    cohort: Path | Mapping[str, tuple[Any, Any]] | Iterable[tuple[Any, Any]],
    *,
    mask: str = "lv_expert_img",
    name: str = "reader",
    progress: Any = None,
    threads: int | None = None,
    **parameters: Any,
) -> Calibration:
    """Learns how a reader draws the wall, as `ventriform calibrate`.

    Parameters
    ----------
    cohort : path, dict of str to (scan, mask), or iterable of (scan, mask)
        A folder with a folder for each case, which holds spect.nii.gz (or .nii, .dcm) and the reader's mask. Or the
        cases themselves: scans as `read` takes them, masks as `measure` does. Without names they are case1, case2 and
        so on. Files give the profile, byte for byte, that a folder of them gives in that order; the profile names a
        file by its hash, and an array by that of its values and place.
    mask : str
        Name of the masks' files in a folder, without .nii.gz.
    name : str
        The reader's name in reports.
    progress : callable or tqdm, optional
        Told 'fit' and the share of the cases that is done.
    threads : int, optional
        Threads to work on; by default as many as there are processors.
    [parameters]

    Points and directions are RAS, whatever the frame of a scan is.

    Returns
    -------
    Calibration

    Raises
    ------
    InputError
        If no mask can be learnt from, or a parameter cannot be used.
    """
    import json

    of_masks = _checks.text("mask", mask)
    _checks.text("name", name)
    parameters = to_lps("calibrate", parameters, lambda _: "RAS")
    text, figures = _native.calibrate(_cases(cohort), of_masks, parameters, _how(progress, threads))
    table = json.loads(figures)
    return Calibration(Profile(text.encode(), name), table["cases"], table["problems"])


@with_table("normals")
def build_normals(cohort: Path, *, progress: Any = None, threads: int | None = None, **parameters: Any) -> NormalLimits:
    """Builds normal limits from scans of healthy people, as `ventriform normals build`.

    Parameters
    ----------
    cohort : path
        A folder with scans and cohort.csv: case, file, sex, protocol, tracer, attenuation_corrected, healthy.
    progress : callable or tqdm, optional
        Told stage and completed fraction of the whole. An exception in it ends the work.
    threads : int, optional
        Threads to work on; by default as many as there are processors.
    [parameters]

    Points and directions are RAS.

    Returns
    -------
    NormalLimits

    Raises
    ------
    InputError
        If the table cannot be read, a group has too few usable cases, or a parameter cannot be used.
    """
    folder = _checks.folder("cohort", cohort)
    parameters = to_lps("normals", parameters, lambda _: "RAS")
    return NormalLimits(_native.build_normals(folder, parameters, _how(progress, threads)).encode())


def evaluate(
    cohort: Path,
    out: Path | None = None,
    *,
    points: Sequence[int] = (67, 110, 150, 200, 300),
    reference_points: Sequence[int] = (67,),
    models: Sequence[str] = ("reference", "retiled", "optimised", "auto"),
    method: str = "refined",
    manual: str | None = None,
    label: str | int | None = None,
    resample: bool = False,
    mesh_unit: str | None = None,
    mesh_frame: str | None = None,
    leave_one_out: bool = False,
    in_sample: str | Sequence[str] = (),
    support: float = 0.0,
    support_radius: float = 46.0,
    support_scaling: str = "fixed",
    no_align: bool = False,
    progress: Any = None,
    threads: int | None = None,
) -> Evaluation:
    """Makes models of a cohort's templates, fits them to every patient and writes tables, as `ventriform evaluate`.

    Existing fits in `out` are reused, those of a call that Ctrl-C ended too.

    Parameters
    ----------
    cohort : path
        A folder with a folder for each case: spect.nii.gz, lv_expert_img.nii.gz and lv_truth.nii.gz.
    out : path, optional
        Folder for the results, made if it is missing. Without it they are in a temporary one, for as long as what is
        returned is kept.
    points, reference_points : sequence of int
        Numbers of points of our models, and of the reference model.
    models : sequence of {'reference', 'retiled', 'optimised', 'auto'}
        Which models to fit.
    method : {'refined', 'paper'}
        How our models are made.
    manual : str, optional
        Template whose model is made from its expert's mask.
    label : str or int, optional
        Structure of the masks, where their files hold several.
    resample : bool
        Resample masks that lie on another grid than their scan; without it they are not used.
    mesh_unit, mesh_frame : str, optional
        As `measure` takes them.
    leave_one_out : bool
        Choose model, number of points and reader's profile for each case without that case.
    in_sample : sequence of str, or 'all'
        Cases that the program's constants were chosen on, or all: their figures are labelled in-sample.
    support : float, 0 to 1e6
        Stiffness of support springs between all nodes within a radius, to study their effect.
    support_radius : float, 0 to 1000
        Longest support spring, mm.
    support_scaling : {'fixed', 'per-node'}
        Whether a support spring's stiffness falls with the number of nodes.
    no_align : bool
        Skip the alignment of the model as a whole, as for models that are placed by hand.
    progress : callable or tqdm, optional
        Told step and its completed fraction.
    threads : int, optional
        Threads to work on; by default as many as there are processors.

    Returns
    -------
    Evaluation

    Raises
    ------
    InputError
        If the folder is no cohort, or no fit succeeded.
    """
    import tempfile

    _checks.one_of("method", method, ("refined", "paper"))
    _checks.one_of("support_scaling", support_scaling, ("fixed", "per-node"))
    _check_mesh(mesh_unit, mesh_frame)
    if out is not None:
        _checks.path("out", out)
    order = {
        "cohort": _checks.folder("cohort", cohort),
        "points": _checks.wholes("points", points, 0, _checks.MOST_POINTS),
        "reference_points": _checks.wholes("reference_points", reference_points, 0, _checks.MOST_POINTS),
        "models": _checks.words("models", models),
        "method": method,
        "manual": None if manual is None else _checks.text("manual", manual),
        "label": None if label is None else str(label),
        "resample": bool(resample),
        "mesh_unit": mesh_unit,
        "mesh_frame": mesh_frame,
        "leave_one_out": bool(leave_one_out),
        "in_sample": ["all"] if in_sample == "all" else _checks.words("in_sample", in_sample),
        "align": not no_align,
        "support": _checks.number("support", support),
        "support_radius": _checks.number("support_radius", support_radius),
        "support_scaling": support_scaling,
        "program": _program(),
    }
    how = _how(progress, threads)
    temporary = tempfile.TemporaryDirectory(prefix="ventriform-") if out is None else None
    folder = temporary.name if temporary is not None else _inputs.whole_path(out)
    return Evaluation(folder, _native.evaluate({**order, "out": folder}, how), temporary=temporary)


def phantom(
    *,
    seed: int = 1,
    size: int | Sequence[int] = 64,
    spacing_mm: float | Sequence[float] = 6.4,
    length_mm: float = 85.0,
    width_mm: float = 65.0,
    wall_mm: float = 11.0,
    noise: float = 0.05,
    liver: float = 0.5,
    right_ventricle: float = 0.3,
    motion_mm: float = 0.0,
    heads: int = 1,
    defects: Mapping[int, float] | None = None,
    frame: str = "RAS",
    progress: Any = None,
    threads: int | None = None,
) -> Phantom:
    """Simulates a scan with its true mask.

    Parameters
    ----------
    seed : int
        Of the random numbers for shape and noise.
    size : int or 3 ints, 16 to 1024
        Voxels along each axis.
    spacing_mm : float or 3 floats, 0.5 to 20
        Voxel size.
    length_mm, width_mm, wall_mm : float
        The ventricle's outer length (30 to 150) and width (20 to 150), and the thickness of its wall (2 to 25).
    noise : float, 0 to 1
        Standard deviation divided by the mean in healthy wall.
    liver, right_ventricle : float
        Uptake relative to healthy wall.
    motion_mm : float, -60 to 60
        How far the patient moves towards the head half-way through the scan.
    heads : {1, 2}
        Heads of the camera.
    defects : dict of int to float, optional
        Perfusion defects: AHA segment (1 to 17) and severity (0 to 1).
    frame : {'RAS', 'LPS'}
        The patient frame of the volumes' affine.
    progress : callable or tqdm, optional
        Told stage and completed fraction of the whole. An exception in it ends the work.
    threads : int, optional
        Threads to work on; by default as many as there are processors.

    Returns
    -------
    Phantom

    Raises
    ------
    InputError
        If a value is out of its range.
    """
    kept = checked(frame)
    figures = {
        "length_mm": length_mm,
        "width_mm": width_mm,
        "wall_mm": wall_mm,
        "noise": noise,
        "liver": liver,
        "right_ventricle": right_ventricle,
        "motion_mm": motion_mm,
    }
    if defects is not None and not isinstance(defects, Mapping):
        raise InputError("defects", f"A {type(defects).__name__} is no dictionary.", "Give {segment: severity}.")
    order = {
        "shape": [_checks.whole("size", one, 16, 1024) for one in _checks.each_axis("size", size)],
        "spacing_mm": [_checks.number("spacing_mm", one) for one in _checks.each_axis("spacing_mm", spacing_mm)],
        **{name: _checks.number(name, value) for name, value in figures.items()},
        "heads": _checks.whole("heads", heads, 1, 2),
        "defects": [
            (_checks.whole("defects", part, 1, 17), _checks.number("defects", severity))
            for part, severity in (defects or {}).items()
        ],
        "seed": _checks.whole("seed", seed, 0, 2**64 - 1),
    }
    voxels, truth, lps = _native.phantom(order, _how(progress, threads))
    made = [Volume(array, lps, frame="LPS").in_frame(kept) for array in (voxels, truth)]
    return Phantom(made[0], made[1])


def _how(progress: Any, threads: Any) -> tuple[Any, int | None]:
    """Whom a call tells of its progress, and on how many threads it works."""
    return teller(progress), _checks.threads(threads)


def _ordered(
    command: str, given: dict[str, Any], deidentify: bool, frame_for: Callable[[str], Frame]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Parameters with points and directions in LPS, and what is stated of DICOM objects, apart."""
    stated = {name: value for name, value in given.items() if name in _objects.NAMES}
    others = {name: value for name, value in given.items() if name not in stated}
    return to_lps(command, others, frame_for), {"dicom": _objects.order(stated, deidentify)}


def _stem(source: Any, otherwise: str) -> str:
    if not _inputs.is_path(source):
        return otherwise
    return os.path.basename(os.fspath(source)).split(".")[0] or otherwise


def _cases(cohort: Any) -> Any:
    """The folder of a cohort as it is, or name, scan and mask of each case."""
    if _inputs.is_path(cohort):
        return _checks.folder("cohort", cohort)
    fix = "Give a folder, pairs (scan, mask), or a dictionary of names and such pairs."
    if isinstance(cohort, Mapping):
        named = list(cohort.items())
    elif _inputs.is_bytes(cohort) or not isinstance(cohort, Iterable):
        raise InputError("cohort", f"A {type(cohort).__name__} is neither a folder nor cases.", fix)
    else:
        named = [(f"case{number}", pair) for number, pair in enumerate(cohort, 1)]
    cases = []
    for name, pair in named:
        if not isinstance(name, str):
            raise InputError("cohort", f"The name {name!r} is no text.", fix)
        if not isinstance(pair, (tuple, list)) or len(pair) != 2:
            raise InputError("cohort", f"{name} is no pair of a scan and a mask.", fix)
        try:
            scan, mask = (_inputs.native(one, unwrap) for one in (pair[0], _mask(pair[1])))
        except InputError as error:
            error._about("cohort", f"{name}: ")
            raise
        cases.append((name, scan, mask))
    return cases


def _check_mesh(unit: str | None, frame: str | None) -> None:
    if unit is not None:
        _checks.one_of("mesh_unit", unit, ("mm", "cm", "m"))
    if frame is not None:
        _checks.one_of("mesh_frame", frame, ("lps", "ras"))


def _mask(source: Any) -> Any:
    if isinstance(source, Fit):
        import numpy as np

        return Volume(source.mask.astype(np.float32, order="F"), source.in_frame("LPS").affine, frame="LPS")
    return source._mesh() if isinstance(source, Surface) else source


_OF_LIMITS = ("sex", "protocol", "stress_protocol", "rest_protocol", "tracer", "attenuation_corrected")
"""Parameters that choose a group of normal limits."""


def _order(
    model: Any, formats: Sequence[str], parts: Sequence[str], limits: tuple[Any, dict[str, Any]], deidentify: bool
) -> dict[str, Any]:
    given = list(model) if isinstance(model, (list, tuple)) else [model]
    if not given:
        raise InputError("model", "No model was given.", "Give 'auto', a Model or a path.")
    models: list[Any] = []
    for one in given:
        if isinstance(one, Model):
            models.append((one.name, one._unchanged()))
        elif _inputs.is_path(one):
            models.append(one if one == "auto" else _opened("model", one))
        else:
            raise InputError("model", f"A {type(one).__name__} is no model.", "Give 'auto', a Model or a path.")
    normals, parameters = limits
    if normals is None and any(parameters.get(name) is not None for name in _OF_LIMITS):
        raise InputError("normals", "A scan's kind was stated without limits.", "Give `normals` too.")
    return {
        "model": models,
        "formats": _checks.words("formats", formats),
        "parts": _checks.words("parts", parts),
        "normals": _limits(normals),
        "expert": None,
        "reader": None,
        "deidentify": deidentify,
    }


def _profile(reader: Any) -> tuple[str, bytes] | None:
    if reader is None:
        return None
    if isinstance(reader, Profile):
        return reader.name, reader.to_bytes()
    return _stem(reader, "reader"), _content("reader", reader)


def _limits(normals: Any) -> bytes | None:
    if normals is None:
        return None
    return normals.to_bytes() if isinstance(normals, NormalLimits) else _content("normals", normals)


def _content(field: str, source: Any) -> bytes:
    if _inputs.is_bytes(source):
        return bytes(source)
    if not _inputs.is_path(source):
        raise InputError(field, f"A {type(source).__name__} is no file.", "Give a path or bytes.")
    try:
        with open(source, "rb") as file:
            return file.read()
    except OSError as error:
        raise file_error(field, source, error) from error
    except ValueError as error:
        raise InputError(field, f"{source!r} is no path: {error}.", "Give the path of a file.") from error


def _opened(field: str, path: Any) -> str:
    """The whole path of a file that the system opens."""
    whole = _inputs.whole_path(path)
    _inputs.open_each(field, [whole])
    return whole


def _program() -> bytes:
    """The compiled part, by which stored fits of another build are known."""
    with open(_native.__file__, "rb") as file:
        return file.read()
