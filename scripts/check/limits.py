#!/usr/bin/env python3
"""What is cheap to ask for is cheap to answer: attacks by one client on the built program, under a limit of memory.

    scripts/check/limits.py --program target/debug/ventriform

Each attack runs against a service of its own that may have 1 GiB of data (`prlimit --data`), and 60 s of
processor time. Meanwhile another client, told apart by a trusted proxy's header, asks for its lists, health and small
uploads; it must be answered within two seconds (more where `--patience` says so, for slow programs), and the
service must live and be what it was when the attack is over. Uses the standard library alone."""

import argparse
import http.server
import json
import os
import random
import selectors
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import zlib

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from lib.service import Service

GIB = 1 << 30
NM_CLASS, PET_CLASS = b"1.2.840.10008.5.1.4.1.1.20", b"1.2.840.10008.5.1.4.1.1.128"
EXPLICIT, IMPLICIT, DEFLATED = b"1.2.840.10008.1.2.1", b"1.2.840.10008.1.2", b"1.2.840.10008.1.2.1.99"
JSON = {"content-type": "application/json"}
ATTACKER = {"X-Forwarded-For": "192.0.2.66"}
HOST = b"Host: localhost\r\nX-Forwarded-For: 192.0.2.66\r\n"
HONEST = {"X-Forwarded-For": "192.0.2.7"}


def start(program, folder, *flags):
    """The service with a limit of memory, behind a proxy that says for whom a request is."""
    prefix = ["prlimit", f"--data={GIB}", "--cpu=60", "--nofile=16384"]
    return Service(
        program, folder, "--workers", "1", "--trusted-proxies", "127.0.0.1", *flags, prefix=prefix, dicom=True
    )


def connect(service):
    s = socket.create_connection(("127.0.0.1", service.port), 10)
    s.settimeout(10)
    return s


def stop(service):
    if service.process.poll() is None:
        try:
            service.stop(20)
        except subprocess.TimeoutExpired:
            pass  # killed


class Honest(threading.Thread):
    """Another client, which asks for little, all the time."""

    def __init__(self, service, scan):
        super().__init__(daemon=True)
        self.service, self.scan, self.over = service, scan, threading.Event()
        self.slowest, self.refused, self.asked = (0.0, ""), [], 0

    def run(self):
        number = 0
        while not self.over.is_set():
            number += 1
            upload = self.scan[:-8] + struct.pack("<d", number)
            for method, path, body in [
                ("GET", "/healthz", None),
                ("GET", "/v1/volumes?limit=5", None),
                ("GET", "/v1/jobs", None),
                ("POST", "/v1/volumes", upload),
            ]:
                began = time.time()
                headers = dict(HONEST, **({"content-type": "application/octet-stream"} if body else {}))
                try:
                    status, _ = self.service.ask(method, path, body, headers)
                except OSError as error:
                    status = repr(error)
                self.asked += 1
                self.slowest = max(self.slowest, (time.time() - began, f"{method} {path}"))
                if status not in (200, 201):
                    self.refused.append((method, path, status))
            time.sleep(0.05)


def nifti(side=16):
    """A scan of noise as NIfTI-1."""
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, side, side, side, 1, 1, 1, 1)
    struct.pack_into("<2h", header, 70, 64, 64)
    struct.pack_into("<8f", header, 76, 1, 4, 4, 4, 1, 1, 1, 1)
    struct.pack_into("<f", header, 108, 352)
    header[123] = 2
    struct.pack_into("<2h", header, 252, 0, 1)
    struct.pack_into("<12f", header, 280, 4, 0, 0, 0, 0, 4, 0, 0, 0, 0, 4, 0)
    header[344:348] = b"n+1\0"
    noise = random.Random(1)
    return bytes(header) + struct.pack(f"<{side**3}d", *(noise.random() for _ in range(side**3)))


def archive(entries, plain):
    """A zip archive whose zip64 record states `entries`, and whose plain record states `plain`."""
    local = b"PK\x03\x04" + struct.pack("<5H3I2H", 45, 0, 0, 0, 33, 0, 0, 0, 1, 0) + b"a"
    entry = struct.pack("<4s6H3I5H2I", b"PK\x01\x02", 45, 45, 0, 0, 0, 33, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0) + b"a"
    directory = entry * entries
    start, size = len(local), len(directory)
    record = struct.pack("<4sQ2H2I4Q", b"PK\x06\x06", 44, 45, 45, 0, 0, entries, entries, size, start)
    locator = struct.pack("<4sIQI", b"PK\x06\x07", 0, start + size, 1)
    end = struct.pack("<4s4H2IH", b"PK\x05\x06", 0, 0, plain, plain, 47 if plain == 1 else 0xFFFFFFFF, 0xFFFFFFFF, 0)
    return local + directory + record + locator + end


def held(service, requests, count, seconds=2):
    """Sends `count` requests, one on each connection, that are not completed or whose answers are not read."""
    open_ones, refused = [], 0
    for number in range(count):
        try:
            s = connect(service)
            s.sendall(requests(number))
            open_ones.append(s)
        except OSError:
            refused += 1
    time.sleep(seconds)
    for s in open_ones:
        s.close()
    return f"{len(open_ones)} connections, {refused} broken"


def head(method, path, length=None, kind="application/octet-stream"):
    text = f"{method} {path} HTTP/1.1\r\n".encode() + HOST
    if length is not None:
        text += f"Content-Type: {kind}\r\nContent-Length: {length}\r\n".encode()
    return text + b"\r\n"


def zip64(service):
    said = []
    for plain in (1, 0xFFFF):
        status, body = service.ask(
            "POST",
            "/v1/volumes",
            archive(600_000, plain),
            {"content-type": "application/octet-stream", "X-Forwarded-For": "192.0.2.66"},
            60,
        )
        assert status in (413, 422), (status, body)
        said.append(status)
    return f"answers {said}"


def half_uploads(service):
    body = bytes((1 << 20) - 1)
    return held(service, lambda _: head("POST", "/v1/volumes", 2_000_000) + body, 900)


# Threads of few_threads for work that blocks, and those that the service may start beside them: for jobs and signals.
BLOCKING_THREADS, OTHER_THREADS = 4, 4


def few_threads(service):
    """Half uploads, of which each waits for a thread; without a bound there is one thread for each that writes."""
    most, over = [service.figure("Threads")], threading.Event()
    before = most[0]

    def watch():
        while not over.wait(0.002):
            most.append(service.figure("Threads"))

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    said = held(service, lambda _: head("POST", "/v1/volumes", 2_000_000) + bytes((1 << 20) - 1), 400)
    over.set()
    watcher.join()
    assert max(most) <= before + BLOCKING_THREADS + OTHER_THREADS, f"{max(most)} threads, {before} before"
    return f"{said}, {max(most)} threads, {before} before"


def half_json(service):
    body = b"[" + b" " * 230_000
    paths = ["/v1/jobs", "/v1/keys", "/v1/templates?name=t", "/v1/readers", "/dicom-web/workitems", "/v1/webhooks"]
    return held(service, lambda n: head("POST", paths[n % len(paths)], 250_000, "application/json") + body, 1000)


def dense_json(service):
    body = b'{"parameters":{"x":[' + b"0," * 120_000 + b"0]}}"
    return held(service, lambda _: head("POST", "/v1/jobs", len(body), "application/json") + body, 600)


def half_forms(service):
    start = b'--B\r\nContent-Disposition: form-data; name="f"; filename="a"\r\n\r\n' + bytes(400_000)
    kind = "multipart/form-data; boundary=B"
    return held(service, lambda _: head("POST", "/v1/volumes", 900_000, kind) + start, 800)


def half_objects(service):
    start = b"--B\r\nContent-Type: application/dicom\r\n\r\n" + bytes(400_000)
    kind = 'multipart/related; type="application/dicom"; boundary=B'
    return held(service, lambda _: head("POST", "/dicom-web/studies", 900_000, kind) + start, 800)


def labelled(service):
    """Lists whose entries are as large as a client can make them, asked for and not read."""
    _, body = service.ask("POST", "/v1/volumes", nifti(), {"content-type": "application/octet-stream"})
    volume = json.loads(body)["id"]
    labels = {f"n{number}": "\U0001f600" * 256 for number in range(16)}
    for seed in range(60):
        order = {
            "kind": "model",
            "volume": volume,
            "priority": "bulk",
            "labels": labels,
            "parameters": {"points": 67, "seed": seed},
        }
        status, body = service.ask("POST", "/v1/jobs", json.dumps(order).encode(), {"content-type": "application/json"})
        assert status == 202, (status, body)
    return held(service, lambda _: head("GET", "/v1/jobs?limit=100"), 800)


def work_items(service):
    item = [{"00741000": {"vr": "CS", "Value": ["SCHEDULED"]}, "00741204": {"vr": "LT", "Value": ["x" * 240_000]}}]
    for _ in range(100):
        status, body = service.ask(
            "POST", "/dicom-web/workitems", json.dumps(item).encode(), {"content-type": "application/json"}
        )
        assert status == 201, (status, body)
    queries = ["limit=1000", "limit=1000&PatientName=*a*b*c*", "ProcedureStepLabel=*x*x*x*x*y", "limit=1000&offset=90"]
    return held(service, lambda n: head("GET", "/dicom-web/workitems?" + queries[n % len(queries)]), 400, 5)


def slow_downloads(service):
    _, body = service.ask("POST", "/v1/volumes", nifti(64), {"content-type": "application/octet-stream"})
    volume = json.loads(body)["id"]
    return held(service, lambda _: head("GET", f"/v1/volumes/{volume}/content"), 800)


def wavelet_frame(side):
    """A JPEG 2000 frame whose code blocks have as many coding passes as there can be, without any data: the costliest
    for its size, and not to be interrupted (tests/api/bombs.rs)."""
    out = (
        b"\xff\x4f\xff\x51" + struct.pack(">HH8I", 41, 0, side, side, 0, 0, side, side, 0, 0) + bytes([0, 1, 15, 1, 1])
    )
    # No levels, blocks of 64 x 64, reversible; 31 bit-planes.
    out += bytes([0xFF, 0x52, 0, 12, 0, 0, 0, 1, 0, 0, 4, 4, 0, 1, 0xFF, 0x5C, 0, 4, 0x20, 31 << 3])
    blocks = side // 64
    bits = "1"
    for y in range(blocks):
        for x in range(blocks):
            new = sum((x | y) % (1 << level) == 0 for level in range(blocks.bit_length()))
            bits += "1" * (2 * new) + f"111111111{91 - 37:07b}0" + "0" * 9
    packet = bytearray()
    while bits:
        width = 7 if packet and packet[-1] == 0xFF else 8
        packet.append(int(bits[:width].ljust(width, "0"), 2))
        bits = bits[width:]
    return (
        out + struct.pack(">HHHIBB", 0xFF90, 10, 0, 14 + len(packet), 0, 1) + b"\xff\x93" + bytes(packet) + b"\xff\xd9"
    )


def element(group, number, vr, value):
    """An element of a data set in Explicit VR Little Endian."""
    value += (b"\0" if vr in (b"UI", b"SQ", b"AT", b"US") else b" ") * (len(value) % 2)
    length = struct.pack("<HI", 0, len(value)) if vr == b"SQ" else struct.pack("<H", len(value))
    return struct.pack("<HH", group, number) + vr + length + value


def file_start(syntax, sop_class=NM_CLASS, instance=b"1.2.3.4"):
    """The beginning of a file in the form of PS3.10."""
    meta = b"".join([element(2, 2, b"UI", sop_class), element(2, 3, b"UI", instance), element(2, 0x10, b"UI", syntax)])
    return bytes(128) + b"DICM" + element(2, 0, b"UL", struct.pack("<I", len(meta))) + meta


def dicom_image(syntax, side, frames, frame):
    """A Nuclear Medicine Image whose frames are all `frame`, of 16 bits."""

    def item(content):
        content += b"\0" * (len(content) % 2)
        return b"\xfe\xff\x00\xe0" + struct.pack("<I", len(content)) + content

    def us(*numbers):
        return struct.pack(f"<{len(numbers)}H", *numbers)

    place = element(0x20, 0x32, b"DS", b"0\\0\\0") + element(0x20, 0x37, b"DS", b"1\\0\\0\\0\\1\\0")
    data = [
        element(8, 8, b"CS", b"ORIGINAL\\PRIMARY\\RECON TOMO\\EMISSION"),
        element(8, 0x16, b"UI", NM_CLASS),
        element(8, 0x18, b"UI", b"1.2.3.4"),
        element(8, 0x60, b"CS", b"NM"),
        element(0x18, 0x50, b"DS", b"4"),
        element(0x18, 0x88, b"DS", b"4"),
        element(0x28, 2, b"US", us(1)),
        element(0x28, 8, b"IS", str(frames).encode()),
        element(0x28, 9, b"AT", b"\x54\0\x80\0"),
        element(0x28, 0x10, b"US", us(side)),
        element(0x28, 0x11, b"US", us(side)),
        element(0x28, 0x30, b"DS", b"4\\4"),
        element(0x28, 0x100, b"US", us(16)),
        element(0x28, 0x101, b"US", us(16)),
        element(0x28, 0x102, b"US", us(15)),
        element(0x28, 0x103, b"US", us(0)),
        element(0x54, 0x22, b"SQ", item(place)),
        element(0x54, 0x80, b"US", us(*range(1, frames + 1))),
    ]
    pixels = (
        struct.pack("<HH", 0x7FE0, 0x10)
        + b"OB\0\0\xff\xff\xff\xff"
        + item(b"")
        + item(frame) * frames
        + b"\xfe\xff\xdd\xe0"
        + bytes(4)
    )
    return file_start(syntax) + b"".join(data) + pixels


def wavelets(service, count=24, seconds=8):
    """As many costly images as one client may send, each sent again when it is answered."""
    body = dicom_image(b"1.2.840.10008.1.2.4.90", 1024, 200, wavelet_frame(1024))
    end, answers = time.time() + seconds, {}

    def send():
        while time.time() < end:
            headers = {"content-type": "application/dicom", "X-Forwarded-For": "192.0.2.66"}
            try:
                status = service.ask("POST", "/v1/volumes", body, headers, 60)[0]
            except OSError as error:
                status = type(error).__name__
            answers[status] = answers.get(status, 0) + 1
            time.sleep(0.05)

    senders = [threading.Thread(target=send, daemon=True) for _ in range(count)]
    for sender in senders:
        sender.start()
    time.sleep(seconds)
    return f"{len(body) >> 10} KiB each, answers so far {answers}"


def wavelet_voxels(service, count=40, seconds=8):
    """Voxels of a costly image, asked for again and again."""
    body = dicom_image(b"1.2.840.10008.1.2.4.90", 1024, 4, wavelet_frame(1024))
    headers = {"content-type": "application/dicom", "X-Forwarded-For": "192.0.2.66"}
    status, answer = service.ask("POST", "/v1/volumes", body, headers, 60)
    assert status == 201, (status, answer[:300])
    volume = json.loads(answer)["id"]
    requests = [head("GET", f"/v1/volumes/{volume}/voxels.nii.gz"), head("GET", f"/v1/volumes/{volume}/preview.png")]
    return held(service, lambda number: requests[number % 2], count, seconds)


def together(count, ask):
    """The statuses of `count` requests that are sent at the same time."""
    answers = []

    def send(number):
        try:
            answers.append(ask(number)[0])
        except OSError as error:
            answers.append(type(error).__name__)

    senders = [threading.Thread(target=send, args=(number,), daemon=True) for number in range(count)]
    for sender in senders:
        sender.start()
    for sender in senders:
        sender.join(60)
    return {status: answers.count(status) for status in sorted(set(answers), key=str)}


def little_objects(size, head):
    """A JSON document whose text of `size` bytes takes much memory as a tree of values."""
    return head + b",".join([b'{"":0}'] * ((size - len(head)) // 7)) + b"]}"


def stored_scan(service, scan=None):
    status, body = service.ask("POST", "/v1/volumes", scan or nifti(), {"content-type": "application/octet-stream"})
    assert status in (200, 201), (status, body)
    return json.loads(body)["id"]


def cohort(volume, number, cases=1000):
    """A job as large as a client can make it."""
    case = {
        "volume": volume,
        "sex": "F",
        "protocol": "r" * 40,
        "tracer": "t" * 40,
        "attenuation_corrected": True,
        "healthy": True,
    }
    body = {"name": f"n{number}", "priority": "bulk", "cases": [dict(case, case=str(row)) for row in range(cases)]}
    return json.dumps(body, separators=(",", ":")).encode()


def hostile_archive(service, seconds=5):
    """Fetches from an archive that answers each search with 16 MiB of `{"":0},`."""
    answer = b"[" + b",".join([b'{"":0}'] * ((16 << 20) // 7)) + b"]"
    asked = []

    class Handler(http.server.BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self):
            asked.append(self.path)
            try:
                self.send_response(200)
                self.send_header("content-type", "application/dicom+json")
                self.send_header("content-length", str(len(answer)))
                self.end_headers()
                self.wfile.write(answer)
            except OSError:
                self.close_connection = True

        def log_message(self, *_):
            pass

    server = http.server.ThreadingHTTPServer(("0.0.0.0", 0), Handler)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    for number in range(8):
        # Each is an archive of its own.
        source = {
            "dicomweb": f"http://127.1.1.{number + 1}:{server.server_port}/dw",
            "study": "1.2.3",
            "series": f"1.2.3.{number + 1}",
        }
        order = {"kind": "model", "source": source, "parameters": {"points": 67}}
        status, body = service.ask("POST", "/v1/jobs", json.dumps(order).encode(), JSON)
        assert status == 202, (status, body)
    time.sleep(seconds)
    server.shutdown()
    assert asked, "the archive was not asked"
    return f"{len(asked)} answers of {len(answer) >> 20} MiB"


def huge_normals(service):
    """Documents of normal limits, as large as they may be."""
    body = little_objects(15 << 20, b'{"format":"ventriform-normals","groups":[')
    said = together(
        4, lambda number: service.ask("POST", f"/v1/normals?name=n{number}", body, dict(JSON, **ATTACKER), 60)
    )
    return f"answers {said}"


def profiles(service):
    """Readers' profiles, as large as they may be."""
    body = little_objects((1 << 20) - 100, b'{"format":"ventriform-reader","a":[')
    said = together(
        64, lambda number: service.ask("POST", f"/v1/readers?name=r{number}", body, dict(JSON, **ATTACKER), 60)
    )
    return f"answers {said}"


def large_jobs(service):
    """Lists of jobs of a thousand cases each, asked for and not read."""
    volume = stored_scan(service)
    for number in range(60):
        status, body = service.ask("POST", "/v1/normals", cohort(volume, number), JSON)
        assert status == 202, (status, body[:300])
    return held(service, lambda number: head("GET", f"/v1/jobs?limit={(100, 20)[number % 2]}"), 20, 4)


def half_patches(service):
    """Patches of the names of a large job, and of others', that do not come."""
    volume = stored_scan(service)
    status, body = service.ask("POST", "/v1/normals", cohort(volume, 0), JSON)
    assert status == 202, (status, body[:300])
    paths = [f"/v1/jobs/{json.loads(body)['id']}", f"/v1/volumes/{volume}"]
    return held(service, lambda number: head("PATCH", paths[number % 2], 20, "application/json"), 900, 4)


def pet_slice(number):
    """One of many slices of a PET scan."""

    def us(value):
        return struct.pack("<H", value)

    instance = f"1.2.9.{number + 1}".encode()
    data = [
        element(8, 8, b"CS", b"ORIGINAL\\PRIMARY"),
        element(8, 0x16, b"UI", PET_CLASS),
        element(8, 0x18, b"UI", instance),
        element(8, 0x60, b"CS", b"PT"),
        element(0x18, 0x50, b"DS", b"1"),
        element(0x20, 0xD, b"UI", b"1.2.9"),
        element(0x20, 0xE, b"UI", b"1.2.9.9"),
        element(0x20, 0x13, b"IS", str(number + 1).encode()),
        element(0x20, 0x32, b"DS", f"0\\0\\{number}".encode()),
        element(0x20, 0x37, b"DS", b"1\\0\\0\\0\\1\\0"),
        element(0x20, 0x52, b"UI", b"1.2.9.2"),
        element(0x28, 2, b"US", us(1)),
        element(0x28, 4, b"CS", b"MONOCHROME2"),
        element(0x28, 0x10, b"US", us(8)),
        element(0x28, 0x11, b"US", us(8)),
        element(0x28, 0x30, b"DS", b"4\\4"),
        element(0x28, 0x100, b"US", us(16)),
        element(0x28, 0x101, b"US", us(16)),
        element(0x28, 0x102, b"US", us(15)),
        element(0x28, 0x103, b"US", us(0)),
        element(0x28, 0x1052, b"DS", b"0"),
        element(0x28, 0x1053, b"DS", b"1"),
        struct.pack("<HH2sHI", 0x7FE0, 0x10, b"OW", 0, 128) + struct.pack("<64H", *range(number, number + 64)),
    ]
    return file_start(EXPLICIT, PET_CLASS, instance) + b"".join(data)


def late_bodies(service, slices=1500):
    """Bodies of identities and names of a volume of many slices, of which the last byte is missing."""
    parts = []
    for number in range(slices):
        disposition = f'Content-Disposition: form-data; name="f"; filename="{number}.dcm"'.encode()
        parts.append(b"--B\r\n" + disposition + b"\r\n\r\n" + pet_slice(number) + b"\r\n")
    form = b"".join(parts) + b"--B--\r\n"
    status, body = service.ask("POST", "/v1/volumes", form, {"content-type": "multipart/form-data; boundary=B"}, 60)
    assert status == 201, (status, body[:300])
    volume = json.loads(body)["id"]
    bodies = [
        ("PUT", f"/v1/volumes/{volume}/identity", b'{"patient_id":"1"}'),
        ("PATCH", f"/v1/volumes/{volume}", b'{"external_id":"e"}'),
    ]

    def request(number):
        method, path, whole = bodies[number % 2]
        return head(method, path, len(whole), "application/json") + whole[:-1]

    return held(service, request, 1500, 3)


def work_item_changes(service):
    """Changes of one large work item, a hundred at the same time."""
    values = ",".join(['{"":0}'] * 30_000)
    item = f'[{{"00741000":{{"vr":"CS","Value":["SCHEDULED"]}},"00741204":{{"vr":"IS","Value":[{values}]}}}}]'
    status, body = service.ask("POST", "/dicom-web/workitems?workitem=1.2.3", item.encode(), JSON)
    assert status == 201, (status, body)
    claim = [{"00741000": {"vr": "CS", "Value": ["IN PROGRESS"]}, "00081195": {"vr": "UI", "Value": ["9.9"]}}]
    status, body = service.ask("PUT", "/dicom-web/workitems/1.2.3/state", json.dumps(claim).encode(), JSON)
    assert status == 200, (status, body)
    requests = [
        ("POST", "/dicom-web/workitems/1.2.3/cancelrequest", b"[{}]"),
        (
            "POST",
            "/dicom-web/workitems/1.2.3",
            b'[{"00741202":{"vr":"LO","Value":["x"]},"00081195":{"vr":"UI","Value":["9.9"]}}]',
        ),
    ]

    def send(number):
        method, path, body = requests[number % 2]
        return service.ask(method, path, body, dict(JSON, **ATTACKER), 60)

    said = together(100, send)
    assert not {500, 502} & set(said), said
    return f"answers {said}"


def associations(service, count=500):
    """Requests for associations as long as they may be, of presentation contexts without content, held open."""

    def item(kind, content):
        return bytes([kind, 0]) + struct.pack(">H", len(content)) + content

    start = struct.pack(">H", 1) + bytes(2) + b"VENTRIFORM".ljust(16) + b"ATTACKER".ljust(16) + bytes(32)
    start += item(0x10, b"1.2.840.10008.3.1.1.1")
    start += item(0x20, bytes([1, 0, 0, 0]) + item(0x30, b"1.2.840.10008.1.1") + item(0x40, IMPLICIT))
    end = item(0x50, item(0x51, struct.pack(">I", 16384)))
    room = (512 << 10) - len(start) - len(end) - 100
    little = item(0x20, bytes([3, 0, 0, 0]) + item(0x30, b"") + item(0x40, b""))
    large = item(0x20, bytes([3, 0, 0, 0]) + item(0x30, b"1.2") + item(0x40, b"") * 16370)
    requests = []
    for context in (little, large):
        content = start + context * (room // len(context)) + end
        requests.append(bytes([1, 0]) + struct.pack(">I", len(content)) + content)
    open_ones, broken = [], 0
    for number in range(count):
        s = socket.socket()
        # As many machines.
        s.bind((f"127.0.{number // 200}.{number % 200 + 2}", 0))
        s.settimeout(5)
        open_ones.append(s)
        try:
            s.connect(("127.0.0.1", service.dicom_port))
            s.sendall(requests[number % 2])
        except OSError:
            broken += 1
    time.sleep(3)
    for s in open_ones:
        s.close()
    return f"{count} requests of {len(requests[0]) >> 10} KiB, {broken} broken"


def header_bomb(size):
    """A deflated image whose header has `size` bytes of empty items."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    start = (
        element(8, 8, b"CS", b"ORIGINAL\\PRIMARY\\RECON TOMO\\EMISSION")
        + element(8, 0x16, b"UI", NM_CLASS)
        + element(8, 0x18, b"UI", b"1.2.3.4")
    )
    out = packer.compress(start + b"\x08\0\x40\x11SQ\0\0\xff\xff\xff\xff")
    items = b"\xfe\xff\x00\xe0\0\0\0\0" * (1 << 17)
    for _ in range(size // len(items)):
        out += packer.compress(items)
    out += packer.compress(
        b"\xfe\xff\xdd\xe0\0\0\0\0" + element(0x20, 0xD, b"UI", b"1.2.9") + element(0x20, 0xE, b"UI", b"1.2.9.1")
    )
    return out + packer.flush()


def header_bombs(service, seconds=4):
    """Objects whose headers take long to read, by STOW-RS from clients that hang up, and by C-STORE."""
    data_set = header_bomb(512 << 20)
    whole = file_start(DEFLATED) + data_set
    end, sent = time.time() + seconds, {"STOW-RS": 0, "C-STORE": 0}

    def stow():
        while time.time() < end:
            try:
                with connect(service) as s:
                    s.sendall(head("POST", "/dicom-web/studies", len(whole), "application/dicom") + whole)
                    sent["STOW-RS"] += 1
                    time.sleep(0.3)
            except OSError:
                time.sleep(0.1)

    def store():
        while time.time() < end:
            try:
                c_store(service, data_set)
                sent["C-STORE"] += 1
            except OSError:
                time.sleep(0.1)

    senders = [threading.Thread(target=work, daemon=True) for work in [stow] * 6 + [store] * 2]
    for sender in senders:
        sender.start()
    time.sleep(seconds)
    assert all(sent.values()), sent
    return f"{len(whole) >> 10} KiB that hold 512 MiB, sent {sent}"


def c_store(service, data_set):
    """Sends a deflated image by C-STORE and waits a second for the answer."""

    def item(kind, content):
        return bytes([kind, 0]) + struct.pack(">H", len(content)) + content

    def pdu(kind, content):
        return bytes([kind, 0]) + struct.pack(">I", len(content)) + content

    def values(control, content):
        return pdu(4, struct.pack(">I", len(content) + 2) + bytes([1, control]) + content)

    def command(number, value):
        value += b"\0" * (len(value) % 2)
        return struct.pack("<HHI", 0, number, len(value)) + value

    request = (
        struct.pack(">H", 1)
        + bytes(2)
        + b"VENTRIFORM".ljust(16)
        + b"ATTACKER".ljust(16)
        + bytes(32)
        + item(0x10, b"1.2.840.10008.3.1.1.1")
    )
    request += item(0x20, bytes([1, 0, 0, 0]) + item(0x30, NM_CLASS) + item(0x40, DEFLATED)) + item(
        0x50, item(0x51, struct.pack(">I", 1 << 20))
    )

    def short(number):
        return struct.pack("<H", number)

    elements = (
        command(2, NM_CLASS)
        + command(0x100, short(1))
        + command(0x110, short(1))
        + command(0x700, short(0))
        + command(0x800, short(0))
    )
    elements += command(0x1000, b"1.2.3.4")
    with socket.create_connection(("127.0.0.1", service.dicom_port), 5) as s:
        s.settimeout(5)
        s.sendall(pdu(1, request))
        if s.recv(1) != b"\2":
            raise ConnectionError("the association was refused")
        s.sendall(values(3, command(0, struct.pack("<I", len(elements))) + elements))
        for place in range(0, len(data_set), 16000):
            piece = data_set[place : place + 16000]
            s.sendall(values(2 if place + 16000 >= len(data_set) else 0, piece))
        time.sleep(1)


def packed_volume(side):
    """A gzipped scan of side^3 voxels of one byte: noise that repeats, of which a megabyte holds 100 million voxels."""
    header = bytearray(nifti(1)[:352])
    struct.pack_into("<8h", header, 40, 3, side, side, side, 1, 1, 1, 1)
    struct.pack_into("<2h", header, 70, 2, 8)
    packer = zlib.compressobj(6, zlib.DEFLATED, 31)
    out, left = [packer.compress(bytes(header))], side**3
    noise = random.Random(2).randbytes(1 << 10) * 1024
    while left:
        out.append(packer.compress(noise[:left]))
        left -= min(left, len(noise))
    return b"".join(out) + packer.flush()


def large_volumes(service, seconds=20):
    """Voxels and jobs of volumes that take little when they are uploaded, and all memory as numbers."""
    said = []
    for side in (300, 500, 610):
        status, body = service.ask(
            "POST",
            "/v1/volumes",
            packed_volume(side),
            dict(ATTACKER, **{"content-type": "application/octet-stream"}),
            60,
        )
        assert status == 201, (status, body[:300])
        volume = json.loads(body)["id"]
        for path in ("preview.png", "voxels.nii.gz", "voxels.nii.gz?mask=true"):
            said.append(service.ask("GET", f"/v1/volumes/{volume}/{path}", None, ATTACKER, 60)[0])
        for kind in ("segmentation", "model"):
            order = json.dumps({"kind": kind, "volume": volume}).encode()
            status, body = service.ask("POST", "/v1/jobs", order, dict(JSON, **ATTACKER))
            assert status == 202, (status, body[:300])
    time.sleep(seconds)
    return f"answers {said}"


def repeated(service, request, connections=2000, seconds=8):
    """The same kind of request on many connections at the same time, sent again on each when it is answered."""
    waiting, said, end = selectors.DefaultSelector(), {}, time.time() + seconds
    for number in range(connections):
        try:
            s = connect(service)
            s.sendall(request(number, 0))
            waiting.register(s, selectors.EVENT_READ, [number, 0])
        except OSError:
            said["broken"] = said.get("broken", 0) + 1
        if time.time() > end:
            break
    while time.time() < end:
        for key, _ in waiting.select(0.2):
            s, state = key.fileobj, key.data
            try:
                answer = s.recv(1 << 16)
                state[1] += 1
                status = answer[9:12].decode("latin-1")
                said[status] = said.get(status, 0) + 1
                s.sendall(request(*state))
            except OSError:
                answer = b""
            if not answer:
                waiting.unregister(s)
                s.close()
    still = list(waiting.get_map().values())
    for key in still:
        key.fileobj.close()
    return f"{len(still)} connections, answers {said}"


def many_writes(service):
    """Small changes, each of which waits for the connection to the database that writes."""
    volume, scan = stored_scan(service), nifti(4)

    def request(number, again):
        if number % 2:
            body, target, kind = (
                json.dumps({"external_id": f"{number}-{again}"}).encode(),
                ("PATCH", f"/v1/volumes/{volume}"),
                "application/json",
            )
        else:
            body, target, kind = (
                scan[:-8] + struct.pack("<2i", number, again),
                ("POST", "/v1/volumes"),
                "application/octet-stream",
            )
        return head(*target, len(body), kind) + body

    return repeated(service, request)


def many_bodies(service):
    """Bodies that take long to parse for their size."""
    body = b'{"parameters":{"x":[' + b"0," * 60_000 + b"0]}}"
    whole = head("POST", "/v1/jobs", len(body), "application/json") + body
    return repeated(service, lambda *_: whole)


# Settings of the service under an attack. Where a large job runs at the end, the service is not to wait for it.
FLAGS = {
    few_threads: ["--blocking-threads", str(BLOCKING_THREADS)],
    hostile_archive: ["--dicomweb-allow", "127.0.0.0/8"],
    large_jobs: ["--shutdown-grace", "1s"],
    large_volumes: ["--shutdown-grace", "1s"],
    half_patches: ["--shutdown-grace", "1s"],
}


ATTACKS = [
    wavelets,
    wavelet_voxels,
    zip64,
    half_uploads,
    few_threads,
    half_json,
    dense_json,
    half_forms,
    half_objects,
    labelled,
    work_items,
    slow_downloads,
    hostile_archive,
    huge_normals,
    profiles,
    large_jobs,
    half_patches,
    late_bodies,
    work_item_changes,
    associations,
    header_bombs,
    large_volumes,
    many_writes,
    many_bodies,
]


# Memory of the service: a third of the limit is left for attacks that come together.
MOST_MEBIBYTES = 640


LATE = "an honest request took too long"


def withstood(attack, program, patience):
    """Whether the service withstands the attack. Another program may have taken the processors while a client
    waited: what is late alone is tried once more."""
    wrong = attempt(attack, program, patience)
    if wrong == [LATE]:
        wrong = attempt(attack, program, patience)
    return not wrong


def attempt(attack, program, patience):
    """What is wrong under the attack."""
    began = time.time()
    with tempfile.TemporaryDirectory() as folder:
        service = start(program, folder + "/data", "--queue-limit", "1000", *FLAGS.get(attack, []))
        honest = Honest(service, nifti())
        honest.start()
        said, wrong = "", []
        try:
            said = attack(service)
        except (AssertionError, OSError) as error:
            wrong.append(repr(error)[:300])
        honest.over.set()
        honest.join(60)
        if service.process.poll() is not None:
            wrong.append(f"the service died: {service.process.poll()}")
        else:
            most = service.figure("VmHWM") >> 10
            said += f", at most {most} MiB, {service.processor_time():.0f} s of processor time"
            if most > MOST_MEBIBYTES:
                wrong.append("the budgets do not bound the memory")
            status, _ = service.ask("GET", "/readyz")
            if status != 200:
                wrong.append(f"/readyz {status}")
        if honest.refused:
            wrong.append(f"refused: {honest.refused[:3]}")
        if honest.slowest[0] > patience:
            wrong.append(LATE)
        stop(service)
        slowest = f"slowest of {honest.asked} honest requests {honest.slowest[0]:.2f} s ({honest.slowest[1]})"
        took = time.time() - began
        print(
            f"{'FAILED' if wrong else 'ok'}: {attack.__name__}: {said}; {took:.0f} s; {slowest} {'; '.join(wrong)}",
            flush=True,
        )
        return wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", default="target/debug/ventriform")
    parser.add_argument("--patience", type=float, default=2.0)
    parser.add_argument("attacks", nargs="*")
    given = parser.parse_args()
    chosen = [attack for attack in ATTACKS if not given.attacks or attack.__name__ in given.attacks]
    done = [withstood(attack, os.path.abspath(given.program), given.patience) for attack in chosen]
    sys.exit(not all(done))


if __name__ == "__main__":
    main()
