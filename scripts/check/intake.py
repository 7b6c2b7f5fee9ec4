"""Sends DICOM objects to a service of its own in every way that docs/pacs.md names. See intake.sh."""

import os
import random
import socket
import subprocess
import sys
import time
from io import BytesIO
from pathlib import Path

import numpy as np
import pydicom
from dicomweb_client.api import DICOMwebClient
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.uid import (
    CTImageStorage,
    DeflatedExplicitVRLittleEndian,
    ExplicitVRLittleEndian,
    ImplicitVRLittleEndian,
    JPEGLSLossless,
    NuclearMedicineImageStorage,
    RLELossless,
    SecondaryCaptureImageStorage,
    generate_uid,
)
from pynetdicom import AE, build_context
from pynetdicom.sop_class import Verification

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from lib.service import Service

AE_TITLE = "VENTRIFORM"
# Long, for machines that do much else.
PATIENCE = 120


def check(condition, what):
    if not condition:
        sys.exit(f"FAILED: {what}")


def base(sop_class, study, series):
    data = Dataset()
    data.SOPClassUID, data.SOPInstanceUID = sop_class, generate_uid()
    data.StudyInstanceUID, data.SeriesInstanceUID = study, series
    data.PatientName, data.PatientID = "Canary^Patient", "CANARY-17"
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.Rows = data.Columns = 16
    data.PixelSpacing = [4, 4]
    data.BitsAllocated = data.BitsStored = 16
    data.HighBit, data.PixelRepresentation = 15, 0
    data.SliceThickness = 4
    return data


def nuclear(seed, image_type="RECON TOMO"):
    """A Nuclear Medicine Image of eight frames."""
    data = base(NuclearMedicineImageStorage, generate_uid(), generate_uid())
    data.Modality = "NM"
    data.ImageType = ["ORIGINAL", "PRIMARY", image_type, "EMISSION"]
    data.NumberOfFrames, data.SpacingBetweenSlices = 8, 4
    data.FrameIncrementPointer = 0x00540080
    data.SliceVector = list(range(1, 9))
    detector = Dataset()
    detector.ImagePositionPatient, detector.ImageOrientationPatient = [0, 0, 0], [1, 0, 0, 0, 1, 0]
    data.DetectorInformationSequence = [detector]
    pixels = np.random.default_rng(seed).integers(0, 4000, (8, 16, 16), dtype=np.uint16)
    data.PixelData = pixels.tobytes()
    return data


def slices(count, study=None, series=None, first=0):
    """Slices of a CT series."""
    study, series = study or generate_uid(), series or generate_uid()
    made = []
    for number in range(first, first + count):
        data = base(CTImageStorage, study, series)
        data.Modality, data.ImageType = "CT", ["ORIGINAL", "PRIMARY", "AXIAL"]
        data.ImagePositionPatient = [0, 0, 4 * number]
        data.ImageOrientationPatient = [1, 0, 0, 0, 1, 0]
        data.PixelData = np.full((16, 16), number, np.uint16).tobytes()
        made.append(data)
    return made


def as_file(data, syntax=ExplicitVRLittleEndian):
    """The object with File Meta Information, in that transfer syntax."""
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = data.SOPClassUID, data.SOPInstanceUID
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    file = FileDataset(None, data, file_meta=meta, preamble=b"\0" * 128)
    if syntax == RLELossless:
        file.compress(RLELossless, generate_instance_uid=False)
    else:
        file.file_meta.TransferSyntaxUID = syntax
    buffer = BytesIO()
    file.save_as(buffer, enforce_file_format=True)
    # Read back, so that pynetdicom sends it as it is encoded.
    buffer.seek(0)
    return pydicom.dcmread(buffer)


class Receiver(Service):
    """The service with a DICOM listener, and what it has received."""

    def __init__(self, program, folder, *flags):
        quick = ["--series-quiet", "500ms", "--series-patience", "4s", "--shutdown-grace", "5s"]
        super().__init__(program, folder / "data", *quick, *flags, log=folder / "log", dicom=True)

    def groups(self):
        return self.get("/v1/intake?limit=100")["intake"]

    def settled(self, number):
        """What was received, once `number` groups are stored or failed."""
        end = time.time() + PATIENCE
        while True:
            groups = self.groups()
            if len(groups) == number and all(g["state"] in ("stored", "failed") for g in groups):
                return {g["series"]: g for g in groups}
            check(time.time() < end, f"{number} groups expected, got {groups}")
            time.sleep(0.1)

    def shape(self, group):
        return self.get(group["links"]["volume"])["shape"]

    def echo(self):
        done = subprocess.run(["echoscu", "-aec", AE_TITLE, "127.0.0.1", str(self.dicom_port)], check=False)
        check(done.returncode == 0, "echoscu")

    def associate(self, *contexts):
        ae = AE("PYNETDICOM")
        ae.acse_timeout = ae.dimse_timeout = ae.network_timeout = PATIENCE
        ae.requested_contexts = [build_context(Verification), *contexts]
        association = ae.associate("127.0.0.1", self.dicom_port, ae_title=AE_TITLE)
        check(association.is_established, "pynetdicom: association")
        return association


def storescu(service, folder, files, *flags):
    """Sends files by dcmtk; returns its exit status."""
    paths = []
    for number, file in enumerate(files):
        paths.append(folder / f"{number}.dcm")
        file.save_as(paths[-1])
    command = ["storescu", "-aec", AE_TITLE, *flags, "127.0.0.1", str(service.dicom_port), *map(str, paths)]
    return subprocess.run(command, check=False, stderr=subprocess.DEVNULL).returncode


def send_by_other_programs(service, folder):
    """Series, multi-frame images, transfer syntaxes, resending. Returns the number of groups."""
    service.echo()
    ct = slices(6)
    files = [as_file(data, ImplicitVRLittleEndian) for data in ct]
    check(storescu(service, folder, files) == 0, "storescu: series")
    check(storescu(service, folder, [as_file(nuclear(1))]) == 0, "storescu: NM")
    received = service.settled(2)
    check(service.shape(received[ct[0].SeriesInstanceUID]) == [16, 16, 6], "shape of the series")
    check(storescu(service, folder, files) == 0, "storescu: the same again")
    volumes = len(service.get("/v1/volumes")["volumes"])
    check(volumes == 2, f"the same is stored once, not {volumes} times")

    contexts = [
        build_context(NuclearMedicineImageStorage, syntax)
        for syntax in (RLELossless, JPEGLSLossless, DeflatedExplicitVRLittleEndian)
    ]
    bad = build_context(SecondaryCaptureImageStorage, ImplicitVRLittleEndian)
    association = service.associate(*contexts, bad)
    accepted = len(association.accepted_contexts)
    check(accepted == 4, f"four contexts are accepted, not {accepted}")
    check(len(association.rejected_contexts) == 1, "Secondary Capture is rejected")
    check(association.send_c_echo().Status == 0, "pynetdicom: C-ECHO")
    number = 2
    sums = {}
    for seed, syntax in enumerate((RLELossless, DeflatedExplicitVRLittleEndian)):
        data = nuclear(10 + seed)
        mean = float(np.frombuffer(data.PixelData, np.uint16).mean())
        file = as_file(data, syntax)
        status = association.send_c_store(file).Status
        check(status == 0, f"pynetdicom: {syntax.name}: {status:04X}")
        sums[data.SeriesInstanceUID] = mean
        number += 1
    association.release()
    received = service.settled(number)
    for series, mean in sums.items():
        found = service.get(received[series]["links"]["volume"])["intensity"]["mean"]
        check(abs(found - mean) < 1e-3, f"mean {found} of {mean}")

    plain, jpeg_ls = folder / "plain.dcm", folder / "jpeg-ls.dcm"
    data = nuclear(12)
    as_file(data).save_as(plain)
    subprocess.run(["dcmcjpls", plain, jpeg_ls], check=True)
    send = ["storescu", "-xt", "-aec", AE_TITLE, "127.0.0.1", str(service.dicom_port), jpeg_ls]
    check(subprocess.run(send, check=False).returncode == 0, "storescu: JPEG-LS")
    number += 1
    found = service.get(service.settled(number)[data.SeriesInstanceUID]["links"]["volume"])
    mean = float(np.frombuffer(data.PixelData, np.uint16).mean())
    check(abs(found["intensity"]["mean"] - mean) < 1e-3, "mean of JPEG-LS")

    # A planar image is stored and shown with the reason; an object with another's UID is refused.
    association = service.associate(build_context(NuclearMedicineImageStorage, ExplicitVRLittleEndian))
    planar = nuclear(20, "STATIC")
    check(association.send_c_store(as_file(planar)).Status == 0, "pynetdicom: planar image")
    other = nuclear(21)
    check(association.send_c_store(as_file(other)).Status == 0, "pynetdicom: NM")
    number += 2
    received = service.settled(number)
    check(received[planar.SeriesInstanceUID]["state"] == "failed", "planar images are no volume")
    changed = as_file(other)
    changed.PixelData = bytes(len(changed.PixelData))
    answer = association.send_c_store(changed)
    check(answer.Status == 0x0111, f"another object with the same UID: {answer.Status:04X}")
    check("stored" in answer.ErrorComment, "the comment says why")
    association.release()
    return number


def stow(service, number):
    """STOW-RS by dicomweb-client. Returns the number of groups."""
    client = DICOMwebClient(f"{service.url}/dicom-web")
    ct = slices(4)
    answer = client.store_instances([as_file(data) for data in ct])
    stored = answer.ReferencedSOPSequence
    check(len(stored) == 4 and stored[0].ReferencedSOPClassUID == CTImageStorage, "STOW-RS: answer")
    nm = nuclear(30)
    client.store_instances([as_file(nm)], study_instance_uid=nm.StudyInstanceUID)
    received = service.settled(number + 2)
    check(service.shape(received[ct[0].SeriesInstanceUID]) == [16, 16, 4], "STOW-RS: series")
    return number + 2


def kills(service, number, rounds=5):
    """Kills the service between objects; nothing that was acknowledged is lost."""
    study, series = generate_uid(), generate_uid()
    acknowledged = 0
    for kill in range(rounds):
        association = service.associate(build_context(CTImageStorage, ImplicitVRLittleEndian))
        for data in slices(4, study, series, 4 * kill):
            check(association.send_c_store(as_file(data, ImplicitVRLittleEndian)).Status == 0, "C-STORE")
            acknowledged += 1
        service.kill()
        association.abort()
        service.start()
    group = service.settled(number + 1)[series]
    check(group["objects"] == acknowledged, f"{group['objects']} of {acknowledged} objects")
    check(service.shape(group) == [16, 16, acknowledged], "shape after the kills")
    left = os.listdir(f"{service.data}/received")
    end = time.time() + PATIENCE
    while len(left) > 1 and time.time() < end:
        time.sleep(0.1)
        left = os.listdir(f"{service.data}/received")
    check(len(left) == 1, f"only the projection's file is left, not {left}")
    return acknowledged


def garbage(service):
    """Connections that are none; then the service still answers."""
    rng = random.Random(1)
    silent = [socket.create_connection(("127.0.0.1", service.dicom_port)) for _ in range(500)]
    for number in range(500):
        with socket.create_connection(("127.0.0.1", service.dicom_port)) as stream:
            kind = bytes([rng.randrange(256) if number % 2 else rng.randrange(1, 8)])
            length = rng.choice([0, 4, 70, 0xFFFF, 0xFFFFFFFF]).to_bytes(4, "big")
            try:
                stream.sendall(kind + b"\0" + length + rng.randbytes(rng.randrange(2000)))
            except OSError:
                pass  # closed already
    service.echo()
    for stream in silent:
        stream.close()
    memory_kib = service.figure("VmHWM")
    check(memory_kib < 400_000, f"at most {memory_kib} KiB of memory")
    service.echo()


def encrypted(program, folder):
    """dcmtk sends over TLS, with a certificate; without one, and without TLS, it is refused."""
    folder.mkdir()

    def openssl(*words):
        subprocess.run(["openssl", *words], check=True, cwd=folder, stderr=subprocess.DEVNULL)

    new = ["-newkey", "rsa:2048", "-nodes"]
    openssl("req", "-x509", *new, "-subj", "/CN=Hospital", "-keyout", "ca.key", "-out", "ca.pem")
    (folder / "leaf").write_text("subjectAltName=IP:127.0.0.1\nbasicConstraints=CA:FALSE\n")
    for name in ("service", "camera"):
        openssl("req", *new, "-subj", f"/CN={name}", "-keyout", f"{name}.key", "-out", f"{name}.csr")
        openssl(
            "x509",
            "-req",
            "-in",
            f"{name}.csr",
            "-CA",
            "ca.pem",
            "-CAkey",
            "ca.key",
            "-CAcreateserial",
            "-extfile",
            "leaf",
            "-out",
            f"{name}.pem",
        )
    service = Receiver(
        program,
        folder,
        "--dicom-tls-cert",
        str(folder / "service.pem"),
        "--dicom-tls-key",
        str(folder / "service.key"),
        "--dicom-tls-client-ca",
        str(folder / "ca.pem"),
    )
    try:
        trusted = ["+cf", str(folder / "ca.pem")]
        own = ["+tls", str(folder / "camera.key"), str(folder / "camera.pem")]
        file = [as_file(nuclear(40))]
        check(storescu(service, folder, file) != 0, "without TLS")
        check(storescu(service, folder, file, "+tla", *trusted) != 0, "without a certificate")
        check(not service.groups(), "nothing is stored")
        check(storescu(service, folder, file, *own, *trusted) == 0, "storescu: TLS")
        service.settled(1)
        log = (folder / "log").read_text()
        check("panic" not in log, log[-1000:])
    finally:
        service.process.kill()


def main():
    program, folder = sys.argv[1], Path(sys.argv[2])
    service = Receiver(program, folder)
    try:
        number = send_by_other_programs(service, folder)
        number = stow(service, number)
        acknowledged = kills(service, number)
        garbage(service)
        log = (folder / "log").read_text()
        check("CANARY" not in log and "Canary" not in log, "the log names no patient")
        check(service.stop(30) == 0, "the service ends in order")
    finally:
        service.process.kill()
    encrypted(program, folder / "tls")
    print(f"intake: {number + 1} groups received, {acknowledged} objects kept over 5 kills, 1000 bad connections, TLS")


main()
