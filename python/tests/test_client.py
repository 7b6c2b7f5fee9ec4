"""The client against a running service."""

from __future__ import annotations

import pathlib
import socket

import pytest
from conftest import Command

import ventriform as vf
from ventriform.client import Client, ServiceError


def test_upload_submit_wait_download_search(
    service: str, scan: pathlib.Path, fit: vf.Fit, tmp_path: pathlib.Path
) -> None:
    told: list[float] = []
    with vf.Client(service) as client:
        volume = client.upload(scan)
        assert client.upload(scan.read_bytes()).id == volume.id
        job = client.submit("segmentation", volume.id, model="auto")
        done = client.wait(job, progress=lambda stage, fraction: told.append(fraction))
        assert done.state == "succeeded"
        assert next(iter(client.search("segmentations")))["id"] == done.segmentation
        mask = client.download(f"/v1/segmentations/{done.segmentation}/mask.nii.gz")
        assert mask == fit.files["mask.nii.gz"]
        assert [found["id"] for found in client.search("volumes")] == [volume.id]
        client.erase(f"/v1/volumes/{volume.id}")
        assert list(client.search("volumes")) == []


def test_whatever_holds_a_scan_is_uploaded(
    service: str, scan: pathlib.Path, gated: pathlib.Path, tmp_path: pathlib.Path
) -> None:
    import nibabel
    import numpy as np

    sitk = pytest.importorskip("SimpleITK")
    image = nibabel.load(scan)
    (tmp_path / "folder/deep").mkdir(parents=True)
    (tmp_path / "folder/deep/scan.nii.gz").write_bytes(scan.read_bytes())
    # A pair of files is one volume.
    nibabel.save(nibabel.Nifti1Pair(np.asarray(image.dataobj), image.affine), tmp_path / "pair.img")
    with Client(service) as client, open(scan, "rb") as opened:
        sources = {
            "path": scan,
            "text": str(scan),
            "list": [scan],
            "folder": tmp_path / "folder",
            "pair": tmp_path / "pair.hdr",
            "paths": [tmp_path / "pair.hdr", tmp_path / "pair.img"],
            "bytes": scan.read_bytes(),
            "open file": opened,
            "Volume of a file": vf.read(scan),
            "Volume of arrays": vf.Volume(np.asarray(image.dataobj), image.affine),
            "nibabel": image,
            "SimpleITK": sitk.ReadImage(str(scan)),
        }
        surfaces = set()
        for name, source in sources.items():
            stored = client.upload(source)
            assert stored.shape == list(image.shape), name
            done = client.wait(client.submit("segmentation", stored, model="auto").id)
            # Its header names the volume.
            surfaces.add(client.download(f"/v1/segmentations/{done.segmentation}/mesh.stl")[80:])
        # The same voxels at the same place are the same result.
        assert len(surfaces) == 1
        whole = nibabel.load(gated)
        beats = client.upload(vf.Volume(np.asarray(whole.dataobj), whole.affine), "beat.nii")
        assert beats.frames == 8


def test_a_refusal_has_field_reason_and_fix(service: str, scan: pathlib.Path) -> None:
    with Client(service) as client:
        volume = client.upload(scan)
        with pytest.raises(ServiceError) as raised:
            client.submit("model", volume.id, points=3)
        error = raised.value
        assert error.status == 400 or error.status == 422
        assert error.field == "points" and error.fix and error.code == "invalid-parameter"
        with pytest.raises(ServiceError) as raised:
            client.job("j-none")
        assert raised.value.status in (400, 404)


def test_a_job_that_fails_is_raised_with_its_reason(service: str) -> None:
    import gzip

    import nibabel
    import numpy as np

    empty = nibabel.Nifti1Image(
        np.zeros((32, 32, 32), np.int16) + np.eye(32, dtype=np.int16)[..., None], np.diag([4, 4, 4, 1])
    )
    with Client(service) as client:
        volume = client.upload(gzip.compress(empty.to_bytes()), "empty.nii.gz")
        job = client.submit("segmentation", volume.id, model="auto")
        with pytest.raises(ServiceError) as raised:
            client.wait(job.id)
        assert raised.value.reason and raised.value.code


def test_a_service_that_is_away_and_one_that_is_none(scan: pathlib.Path) -> None:
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{closed.getsockname()[1]}"
        with Client(address, timeout=2.0) as client, pytest.raises(ServiceError) as raised:
            client.upload(scan)
    assert raised.value.code == "unreachable" and raised.value.fix


def test_a_wrong_key_is_refused(command: Command, tmp_path: pathlib.Path, scan: pathlib.Path) -> None:
    import re
    import subprocess
    import time

    from conftest import PROGRAM

    # The operator's: `keys` makes no folder.
    (tmp_path / "data").mkdir()
    key = command("keys", "create", "--name", "n", "--scope", "submit", "--data-dir", tmp_path / "data").split()[-1]
    with (tmp_path / "log").open("wb") as log:
        arguments = ["serve", "--listen", "127.0.0.1:0", "--data-dir", str(tmp_path / "data")]
        process = subprocess.Popen([PROGRAM, *arguments], stdout=log, stderr=log)
    try:
        for _ in range(600):
            found = re.search(r"http://127[0-9.:]*", (tmp_path / "log").read_text())
            if found:
                break
            time.sleep(0.1)
        assert found
        with Client(found[0], "wrong") as client, pytest.raises(ServiceError) as raised:
            client.upload(scan)
        assert raised.value.status == 401
        with Client(found[0], key) as client:
            assert client.upload(scan).id
    finally:
        process.terminate()
        process.wait(30)
