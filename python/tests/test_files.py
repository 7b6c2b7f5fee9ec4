"""Files that changed, moved or are not there."""

from __future__ import annotations

import os
import pathlib
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import PROGRAM

import ventriform as vf

USES: dict[str, Callable[[Any], object]] = {
    "read": vf.read,
    "generate": vf.generate,
    "segment": vf.segment,
    "beat": vf.beat,
    "beat of gates": lambda path: vf.beat([path] * 8),
    "stress": lambda path: vf.compare(stress=path, rest=path),
    "measure": lambda path: vf.measure(path, path),
    "calibrate": vf.calibrate,
    "calibrate pairs": lambda path: vf.calibrate([(path, path)]),
    "build_normals": vf.build_normals,
    "evaluate": vf.evaluate,
    "series": lambda path: vf.read([path, path]),
}
OF_FITS = ("model", "reader", "normals", "expert")


@pytest.mark.parametrize("use", [*USES, *OF_FITS])
def test_a_missing_file_is_named_by_its_whole_path(
    use: str, scan: pathlib.Path, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    whole = str(tmp_path / "patient_017/spect.nii.gz")
    with pytest.raises(FileNotFoundError) as caught:
        if use in OF_FITS:
            vf.segment(scan, **{use: "patient_017/spect.nii.gz"})
        else:
            USES[use]("patient_017/spect.nii.gz")
    error = caught.value
    assert isinstance(error, vf.InputError) and isinstance(error, vf.FileMissingError)
    assert whole in str(error) and error.filename == whole and error.errno == 2, error
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error) and str(again) == str(error) and again.filename == whole


def test_other_errors_of_the_system(
    scan: pathlib.Path, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(IsADirectoryError, match=str(tmp_path)):
        vf.segment(scan, model=tmp_path, reader=tmp_path)
    with pytest.raises(NotADirectoryError, match="spect"):
        vf.read(scan / "inside")
    with pytest.raises(NotADirectoryError, match="spect"):
        vf.build_normals(scan)
    real = open

    def denied(path: Any, *given: Any, **named: Any) -> Any:
        if os.fspath(path) == str(scan):
            raise PermissionError(13, "Permission denied", path)
        return real(path, *given, **named)

    monkeypatch.setattr("builtins.open", denied)
    with pytest.raises(PermissionError, match=str(scan)) as caught:
        vf.segment(scan)
    assert isinstance(caught.value, vf.FileDeniedError)


@pytest.mark.parametrize("content", [b"", b"no volume", b"\x1f\x8b\x08\x00cut"])
def test_a_file_that_cannot_be_used_is_named_by_its_whole_path(content: bytes, tmp_path: pathlib.Path) -> None:
    file = tmp_path / "patient_017/spect.nii.gz"
    file.parent.mkdir()
    file.write_bytes(content)
    for source in (file, [file], file.parent):
        with pytest.raises(vf.InputError) as caught:
            vf.read(source)
        assert "patient_017" in str(caught.value), caught.value
    told = subprocess.run(
        [PROGRAM, "segment", file, "--model", "auto", "-o", tmp_path / "out"], capture_output=True, text=True
    )
    assert told.returncode != 0 and str(file) in told.stderr, told.stderr


def test_the_command_names_a_missing_file_by_its_path(tmp_path: pathlib.Path) -> None:
    missing = tmp_path / "patient_017/spect.nii.gz"
    for words in (
        ["segment", missing, "--model", "auto"],
        ["generate", missing],
        ["beat", missing],
        ["measure", missing, missing],
    ):
        out = [] if words[0] == "measure" else ["-o", tmp_path / "out.glb"]
        told = subprocess.run([PROGRAM, *words, *out], capture_output=True, text=True)
        assert told.returncode != 0 and str(missing) in told.stderr, told.stderr


def changed(file: pathlib.Path, way: str) -> None:
    other = file.with_name("other")
    shutil.copy2(file, other)
    content = bytearray(other.read_bytes())
    content[-40] ^= 0xFF
    if way == "overwritten":
        file.write_bytes(content)
    elif way == "replaced with its times":
        times = os.stat(file)
        other.write_bytes(content)
        os.utime(other, ns=(times.st_atime_ns, times.st_mtime_ns))
        os.replace(other, file)
    elif way == "longer":
        file.write_bytes(bytes(content) + b"\0")
    other.unlink(missing_ok=True)


@pytest.mark.parametrize("way", ["overwritten", "replaced with its times", "longer"])
def test_a_file_that_changed_is_refused(way: str, tmp_path: pathlib.Path) -> None:
    phantom = vf.phantom(size=32, length_mm=60, width_mm=45)
    file = tmp_path / "scan.nii"
    pytest.importorskip("nibabel").save(phantom.volume.to_nibabel(), file)
    volume = vf.read(file)
    packed = pickle.dumps(volume)
    changed(file, way)
    uses = (
        lambda: volume.array,
        lambda: np.asarray(volume),
        lambda: vf.generate(volume, points=60),
        lambda: vf.segment(volume),
        lambda: vf.measure(phantom.truth, volume),
        lambda: vf.beat(volume),
        volume.to_nibabel,
        lambda: volume.in_frame("LPS").data(),
        lambda: pickle.loads(packed).array,
    )
    for use in uses:
        with pytest.raises(vf.InputError, match="has changed") as caught:
            use()
        assert caught.value.code == "file-changed" and str(file) in str(caught.value)
    assert vf.read(file).shape == volume.shape


def test_a_file_that_was_only_touched_is_read(tmp_path: pathlib.Path) -> None:
    file = tmp_path / "scan.nii"
    pytest.importorskip("nibabel").save(vf.phantom(size=32, length_mm=60, width_mm=45).volume.to_nibabel(), file)
    volume = vf.read(file)
    before = volume.array
    os.utime(file, (1, 1))
    assert np.array_equal(volume.array, before)
    shutil.copy(file, tmp_path / "copy")
    os.replace(tmp_path / "copy", file)
    assert np.array_equal(pickle.loads(pickle.dumps(volume)).array, before)


def test_another_file_in_a_folder_is_refused_after_a_pickle(tmp_path: pathlib.Path) -> None:
    folder = tmp_path / "scan"
    folder.mkdir()
    pytest.importorskip("nibabel").save(
        vf.phantom(size=32, length_mm=60, width_mm=45).volume.to_nibabel(), folder / "a.nii"
    )
    volume = vf.read(folder)
    packed = pickle.dumps(volume)
    assert np.array_equal(pickle.loads(packed).array, volume.array)
    shutil.copy(folder / "a.nii", folder / "b.nii")
    with pytest.raises(vf.InputError, match="other files"):
        pickle.loads(packed)


def test_paths_name_the_same_file_after_a_change_of_the_folder(
    scan: pathlib.Path, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(scan.parent)
    volume = vf.read(scan.name)
    packed = pickle.dumps(volume)
    (tmp_path / scan.name).write_bytes(b"another")
    monkeypatch.chdir(tmp_path)
    assert np.array_equal(volume.array, pickle.loads(packed).array)
    code = "import pickle, sys; print(float(pickle.load(sys.stdin.buffer).array.sum()))"
    told = subprocess.run([sys.executable, "-c", code], input=packed, capture_output=True, cwd="/")
    assert float(told.stdout) == pytest.approx(float(volume.array.sum())), told.stderr


def test_save_takes_a_folder_or_the_name_of_one_of_the_files(fit: vf.Fit, tmp_path: pathlib.Path) -> None:
    fit.save(tmp_path / "mask.nii.gz")
    assert (tmp_path / "mask.nii.gz").read_bytes() == fit.files["mask.nii.gz"]
    fit.save(str(tmp_path / "report.html"))
    assert (tmp_path / "report.html").is_file()
    for name in ("heart.nii.gz", "lv.glb", "heart.mha", "fit.json", "REPORT.PDF"):
        with pytest.raises(vf.InputError, match="mask.nii.gz|mesh.glb|report.json"):
            fit.save(tmp_path / name)
        assert not (tmp_path / name).exists()
    for name in ("out", "out.v1", "patient.2026-11-29", "out.nii.gz"):
        if name.endswith(".gz"):
            (tmp_path / name).mkdir()
        fit.save(tmp_path / name)
        assert (tmp_path / name / "mask.nii.gz").is_file()
    with pytest.raises(vf.InputError, match="path"):
        fit.save(3)  # type: ignore[arg-type]
