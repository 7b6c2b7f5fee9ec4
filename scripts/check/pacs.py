"""Fetching from and delivering to Orthanc.

usage: pacs.py VENTRIFORM DIR

DIR/phantom/spect.nii.gz is the scan. The NM files of dicom.py (both signs of Spacing Between Slices,
oblique, gated) are stored in Orthanc by C-STORE and STOW-RS. For each, a job fetches the series, segments it and
delivers every object, by STOW-RS or C-STORE; a further job makes a model. Meanwhile Orthanc and the service are
killed and started again. Then:

- the archive has each source and each object once, under the same study, and nothing else;
- what it returns is what the service offers, byte by byte (by C-STORE: data set by data set);
- the objects' geometry is as dicom.py computes it from the NM file;
- a wrong password and a series that does not exist fail the job and say so;
- a work item with the code of a procedure is performed and names its output, which the archive has;
- Orthanc sends to the service, by C-STORE and by STOW-RS: every voxel comes as it was stored there.
"""

import base64
import io
import json
import os
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path

import nibabel
import numpy as np
import pydicom
from dicom import NAMES, cases, check_object, check_results

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from lib.nm import LPS, nm
from lib.service import FINAL, Service, free_port

MODEL_NAMES = ["mesh", "surface"]
PATIENCE = 300


def until(what, found, limit=PATIENCE):
    end = time.monotonic() + limit
    while True:
        value = found()
        if value:
            return value
        assert time.monotonic() < end, f"{what}: not within {limit} s"
        time.sleep(0.1)


def fetch(url, data=None, headers=None):
    request = urllib.request.Request(url, data, headers or {})
    with urllib.request.urlopen(request, timeout=60) as answer:
        return answer.read(), answer.headers


class Archive:
    """Orthanc on loopback."""

    def __init__(self, folder):
        self.folder, self.web, self.dicom = folder, free_port(), free_port()
        self.user, self.password = "service", base64.b16encode(os.urandom(8)).decode()
        self.base = f"http://127.0.0.1:{self.web}/dicom-web"
        token = base64.b64encode(f"{self.user}:{self.password}".encode()).decode()
        self.headers = {"Authorization": f"Basic {token}"}
        (folder / "db").mkdir(parents=True)
        (folder / "orthanc.json").write_text(
            json.dumps(
                {
                    "Name": "check",
                    "StorageDirectory": str(folder / "db"),
                    "IndexDirectory": str(folder / "db"),
                    "Plugins": ["/usr/share/orthanc/plugins/libOrthancDicomWeb.so"],
                    "RemoteAccessAllowed": False,
                    "AuthenticationEnabled": True,
                    "RegisteredUsers": {self.user: self.password},
                    "HttpPort": self.web,
                    "DicomPort": self.dicom,
                    "DicomAet": "ORTHANC",
                    "DicomCheckCalledAet": True,
                    "UnknownSopClassAccepted": True,
                    "OverwriteInstances": False,
                    "SyncStorageArea": True,
                    "DicomWeb": {"Enable": True, "Root": "/dicom-web/", "EnableWado": False},
                }
            )
        )
        self.start()

    def start(self):
        log = open(self.folder / "log", "ab")
        self.process = subprocess.Popen(["Orthanc", self.folder / "orthanc.json"], stdout=log, stderr=log)
        until("Orthanc", self.answers)

    def answers(self):
        try:
            return fetch(f"http://127.0.0.1:{self.web}/system", headers=self.headers)
        except (urllib.error.URLError, OSError):
            return None

    def kill(self):
        self.process.kill()
        self.process.wait()

    def count(self):
        answer, _ = fetch(f"http://127.0.0.1:{self.web}/statistics", headers=self.headers)
        return json.loads(answer)["CountInstances"]

    def instances(self, study):
        """The instances of a study: UID to series."""
        answer, _ = fetch(
            f"{self.base}/studies/{study}/instances", headers={**self.headers, "Accept": "application/dicom+json"}
        )
        found = json.loads(answer) if answer else []
        return {i["00080018"]["Value"][0]: i["0020000D"]["Value"][0] + " " + i["0020000E"]["Value"][0] for i in found}

    def retrieve(self, study, series, instance):
        accept = 'multipart/related; type="application/dicom"; transfer-syntax=*'
        body, headers = fetch(
            f"{self.base}/studies/{study}/series/{series}/instances/{instance}",
            headers={**self.headers, "Accept": accept},
        )
        boundary = headers["Content-Type"].split("boundary=")[1].split(";")[0].strip('"').encode()
        (part,) = [p for p in body.split(b"--" + boundary)[1:-1]]
        head, content = part.split(b"\r\n\r\n", 1)
        return content[:-2]

    def ask(self, method, path, content):
        """A request to Orthanc's own interface."""
        request = urllib.request.Request(
            f"http://127.0.0.1:{self.web}{path}", json.dumps(content).encode(), self.headers, method=method
        )
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.loads(answer.read() or "null")

    def store(self, path):
        boundary = "check"
        body = (
            f"--{boundary}\r\nContent-Type: application/dicom\r\n\r\n".encode()
            + path.read_bytes()
            + f"\r\n--{boundary}--\r\n".encode()
        )
        kind = f'multipart/related; type="application/dicom"; boundary={boundary}'
        fetch(f"{self.base}/studies", body, {**self.headers, "Content-Type": kind, "Accept": "application/dicom+json"})


class Exchange(Service):
    """The service with three archives that are all the same one."""

    def __init__(self, program, folder, archive):
        folder.mkdir()
        (folder / "ventriform.toml").write_text(f'''
archive_backoff = "500ms"
workers = 2
[[archives]]
name = "pacs"
dicomweb = "{archive.base}"
username_env = "CHECK_USER"
password_env = "CHECK_PASSWORD"
[[archives]]
name = "old"
dicom = "127.0.0.1:{archive.dicom}"
ae_title = "ORTHANC"
[[archives]]
name = "locked"
dicomweb = "http://localhost:{archive.web}/dicom-web"
username_env = "CHECK_USER"
password_env = "CHECK_WRONG"
[[procedures]]
code = "LVMODEL"
scheme = "99CHECK"
archive = "pacs"
kind = "model"
send = ["mesh.dcm"]
[[senders]]
ae_title = "ORTHANC"
addresses = ["127.0.0.1"]
''')
        passwords = {"CHECK_USER": archive.user, "CHECK_PASSWORD": archive.password, "CHECK_WRONG": "wrong"}
        super().__init__(
            program,
            folder / "data",
            "--config",
            folder / "ventriform.toml",
            log=folder / "log",
            environment=passwords,
            dicom=True,
        )

    def file(self, **job):
        body = json.dumps(job).encode()
        return json.loads(fetch(self.url + "/v1/jobs", body, {"Content-Type": "application/json"})[0])

    def ended(self, job):
        job = self.get(f"/v1/jobs/{job['id']}")
        return job if job["state"] in FINAL else None


def source(archive, data):
    return {"archive": archive, "study": data.StudyInstanceUID, "series": data.SeriesInstanceUID}


def delivered(service, jobs):
    return [
        d
        for job in jobs
        for d in service.get(f"/v1/jobs/{job['id']}").get("deliveries", [])
        if d["state"] == "delivered"
    ]


def run(archive, service, folder):
    image = nibabel.load(folder / "phantom/spect.nii.gz")
    voxels = np.asarray(image.dataobj).clip(0)
    scans = []
    for number, (name, stored, affine, gates) in enumerate(cases(voxels, LPS @ image.affine)):
        here = folder / name
        (here / "out").mkdir(parents=True)
        path = here / "nm.dcm"
        nm(path, stored, affine, number, gates)
        if number % 2 == 0:
            archive.store(path)
        else:
            subprocess.run(["storescu", "-aec", "ORTHANC", "127.0.0.1", str(archive.dicom), path], check=True)
        parameters = {"model": "auto", **({"frame": 1} if gates > 1 else {})}
        to = "old" if name == "oblique" else "pacs"
        job = service.file(
            kind="segmentation",
            source=source("pacs", pydicom.dcmread(path)),
            parameters=parameters,
            send=[f"{n}.dcm" for n in NAMES],
            to=to,
        )
        scans.append((name, here, affine, to, NAMES, job))
    plain = scans[0]
    model = service.file(
        kind="model",
        source=source("pacs", pydicom.dcmread(plain[1] / "nm.dcm")),
        send=[f"{n}.dcm" for n in MODEL_NAMES],
        to="pacs",
    )
    jobs = [scan[5] for scan in scans] + [model]

    # Killed in the middle of delivery: first the archive, then both.
    until("the first delivery", lambda: len(delivered(service, jobs)) >= 2)
    archive.kill()
    time.sleep(1.5)
    archive.start()
    until("more deliveries", lambda: len(delivered(service, jobs)) >= 6)
    service.kill()
    archive.kill()
    service.start()
    archive.start()
    wanted = len(NAMES) * len(scans) + len(MODEL_NAMES)
    for job in jobs:
        ended = until("a job", lambda: service.ended(job))
        assert ended["state"] == "succeeded", ended["error"]
    until("all deliveries", lambda: len(delivered(service, jobs)) == wanted)
    assert archive.count() == len(scans) + wanted, archive.count()

    for name, here, affine, to, names, job in scans:
        job = service.get(f"/v1/jobs/{job['id']}")
        nm_file = pydicom.dcmread(here / "nm.dcm")
        held = archive.instances(nm_file.StudyInstanceUID)
        extra = len(MODEL_NAMES) if name == "plain" else 0
        assert len(held) == 1 + len(names) + extra, (name, len(held))
        result = f"/v1/segmentations/{job['segmentation']}"
        for kind in names:
            offered = fetch(f"{service.url}{result}/{kind}.dcm")[0]
            data = pydicom.dcmread(io.BytesIO(offered))
            found = held[data.SOPInstanceUID]
            assert found == f"{nm_file.StudyInstanceUID} {data.SeriesInstanceUID}"
            back = archive.retrieve(data.StudyInstanceUID, data.SeriesInstanceUID, data.SOPInstanceUID)
            same = back == offered if to == "pacs" else pydicom.dcmread(io.BytesIO(back)) == data
            assert same, f"{name}/{kind}: the archive returns other bytes"
            (here / "out" / f"{kind}.dcm").write_bytes(back)
            check_object(data)
        out = here / "out"
        for file in ("mask.nii.gz", "mesh.json", "mesh.glb", "report.json"):
            (out / file).write_bytes(fetch(f"{service.url}{result}/{file}")[0])
        mask = np.asarray(nibabel.load(out / "mask.nii.gz").dataobj) > 0
        check_results(out, mask, affine)
        print(f"{name}: fetched, delivered to {to}, {mask.sum()} voxels, 7 objects as they must be")

    known = pydicom.dcmread(plain[1] / "nm.dcm")
    for order, code in [
        (source("locked", known), "archive-credentials"),
        ({**source("pacs", known), "series": "1.2.3.4"}, "no-such-series"),
    ]:
        job = service.file(kind="model", source=order)
        job = until("a refusal", lambda: service.ended(job))
        assert job["state"] == "failed" and job["error"]["type"].endswith(f":{code}"), job
        print(f"{code}: {job['error']['detail']}")
    # Everything is held: nothing is fetched again.
    job = service.file(kind="model", source=source("pacs", known), send=["mesh.dcm"], to="pacs")
    job = until("a repetition", lambda: service.ended(job))
    until("its delivery", lambda: len(delivered(service, [job])) == 1)
    (again,) = delivered(service, [job])
    assert again["last_outcome"] == "present", again
    assert archive.count() == len(scans) + wanted, "something is stored twice"
    print(f"{wanted} objects and {len(scans)} sources in the archive, each once")
    perform(archive, service, known, again)
    assert archive.count() == len(scans) + wanted, "something is stored twice"
    receive(archive, service, scans)


def perform(archive, service, source, delivery):
    """A work item on the series is performed; its output is the object that is in the archive already."""

    def text(vr, value):
        return {"vr": vr, "Value": [value]}

    code = {"00080100": text("SH", "LVMODEL"), "00080102": text("SH", "99CHECK"), "00080104": text("LO", "Model")}
    series = {"0020000D": text("UI", source.StudyInstanceUID), "0020000E": text("UI", source.SeriesInstanceUID)}
    item = {
        "00741000": text("CS", "SCHEDULED"),
        "00404041": text("CS", "READY"),
        "00404018": {"vr": "SQ", "Value": [code]},
        "00404021": {"vr": "SQ", "Value": [series]},
    }
    _, headers = fetch(
        f"{service.url}/dicom-web/workitems", json.dumps([item]).encode(), {"Content-Type": "application/dicom+json"}
    )
    path = headers["Location"]

    def completed():
        state = service.get(path)[0]
        assert state["00741000"]["Value"][0] != "CANCELED", state
        return state if state["00741000"]["Value"][0] == "COMPLETED" else None

    done = until("a work item", completed)
    (output,) = done["00741216"]["Value"][0]["00404033"]["Value"]
    instance = output["00081199"]["Value"][0]["00081155"]["Value"][0]
    assert instance in archive.instances(source.StudyInstanceUID), delivery
    print("work item: performed, its output is in the archive")


def receive(archive, service, scans):
    """Orthanc sends one scan by C-STORE and another by STOW-RS."""
    archive.ask("PUT", "/modalities/ventriform", {"AET": "VENTRIFORM", "Host": "127.0.0.1", "Port": service.dicom_port})
    archive.ask("PUT", "/dicom-web/servers/ventriform", {"Url": f"{service.url}/dicom-web/"})
    ways = [
        ("c-store", "/modalities/ventriform/store", {"Synchronous": True}),
        ("stow-rs", "/dicom-web/servers/ventriform/stow", {"Synchronous": True}),
    ]
    for (protocol, path, order), (name, here, *_) in zip(ways, scans[1:]):
        source = pydicom.dcmread(here / "nm.dcm")
        (found,) = archive.ask(
            "POST", "/tools/find", {"Level": "Instance", "Query": {"SOPInstanceUID": source.SOPInstanceUID}}
        )
        archive.ask("POST", path, {"Resources": [found], **order})

        def stored():
            groups = service.get("/v1/intake")["intake"]
            groups = [g for g in groups if g["series"] == source.SeriesInstanceUID]
            return groups[0] if groups and groups[0]["state"] == "stored" else None

        group = until(protocol, stored)
        assert group["protocol"] == protocol and group["sender"], group
        volume = service.get(group["links"]["volume"])
        frames = source.pixel_array.reshape(-1, source.Rows, source.Columns)
        # Of a gated scan the gates are summed.
        gates = len(frames) // volume["shape"][2]
        mean = frames.mean() * gates
        assert abs(volume["intensity"]["mean"] / mean - 1) < 1e-6, (volume["intensity"], mean)
        assert volume["dicom"]["study_uid"] == source.StudyInstanceUID
        print(f"{protocol}: Orthanc has sent {name}")


def main():
    program, folder = Path(sys.argv[1]).resolve(), Path(sys.argv[2])
    archive = Archive(folder / "orthanc")
    service = None
    try:
        service = Exchange(program, folder / "service", archive)
        run(archive, service, folder)
    except BaseException:
        for log in ("orthanc/log", "service/log"):
            path = folder / log
            if path.exists():
                print(f"--- {log}\n{path.read_text()[-3000:]}")
        raise
    finally:
        for process in [service, archive]:
            if process and process.process.poll() is None:
                process.process.send_signal(signal.SIGTERM)
                try:
                    process.process.wait(20)
                except subprocess.TimeoutExpired:
                    process.kill()


main()
