"""Mixed load on a service of its own, to see whether memory, handles and disk stay flat.

usage: mixed_load.py PROGRAM [MINUTES] [CLIENTS]

Starts PROGRAM on a free port of 127.0.0.1 with an empty data folder, and runs CLIENTS (4) threads
for MINUTES (60, at most 240). Each thread repeats: upload a volume, file a job on it, follow the
job's events, download the mesh and the report, look at lists, preview and health, now and then hang
up in the middle or read slowly, and delete everything it made. Once a minute the resident memory,
the open files, the threads and the size of the data folder are printed; at the end the slope of
each over the second half. Ends with status 1 if a request failed that should not, or if memory
(2 MiB), open files (5) or disk (20 MiB) rose by more than that from the middle of the run to its end.

Needs Python 3 alone.
"""

import http.client
import json
import os
import random
import socket
import statistics
import struct
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from lib.nifti import nifti
from lib.service import Service

# Rises that are allowed from the middle of the run to its end.
ALLOWED = {"memory_mib": 2, "files": 5, "disk_mib": 20}


def volume(seed, side=64):
    """A NIfTI-1 file of 16-bit voxels: a noisy hollow half-ellipsoid, different for each seed."""
    numbers = random.Random(seed)
    middle = side / 2
    voxels = []
    for k in range(side):
        for j in range(side):
            for i in range(side):
                r = (i - middle) ** 2 + (j - middle) ** 2 + ((k - middle) / 1.3) ** 2
                wall = 25 < r < 81 and k < middle + 5
                voxels.append(200 if wall else 0)
    at = numbers.randrange(len(voxels))
    voxels[at] = numbers.randrange(1, 5)
    voxels[:3] = seed % 30, seed // 30 % 30, seed // 900 % 30
    return nifti(side, voxels)


def figures(service):
    """What the system says about its process and its files."""
    bytes_on_disk = 0
    for path in Path(service.data).rglob("*"):
        try:
            bytes_on_disk += path.stat().st_blocks * 512
        except FileNotFoundError:
            pass
    return {
        "memory_mib": service.figure("VmRSS") / 1024,
        "files": len(os.listdir(f"/proc/{service.process.pid}/fd")),
        "threads": service.figure("Threads"),
        "disk_mib": bytes_on_disk / 2**20,
    }


class Client:
    """One thread's work; counts what was done and what failed."""

    def __init__(self, port, number, end, shape):
        self.port, self.number, self.end, self.shape = port, number, end, shape
        self.random = random.Random(number)
        self.done, self.failures = 0, []

    def ask(self, method, path, body=None, headers=None, expect=(200,)):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=120)
        try:
            connection.request(method, path, body, headers or {})
            answer = connection.getresponse()
            content = answer.read()
        finally:
            connection.close()
        if answer.status not in expect:
            self.failures.append((method, path.split("?")[0][:14], answer.status, content[:200]))
            return None
        if answer.headers.get("content-type", "").startswith("application/json"):
            return json.loads(content)
        return content

    def hang_up(self, body):
        """Breaks off in the middle of an upload, or before reading an answer."""
        with socket.create_connection(("127.0.0.1", self.port)) as stream:
            head = f"POST /v1/volumes HTTP/1.1\r\nhost: x\r\ncontent-length: {len(body)}\r\n\r\n"
            stream.sendall(head.encode())
            stream.sendall(body[: self.random.randrange(len(body))])

    def read_slowly(self, path):
        with socket.create_connection(("127.0.0.1", self.port)) as stream:
            stream.sendall(f"GET {path} HTTP/1.1\r\nhost: x\r\nconnection: close\r\n\r\n".encode())
            for _ in range(5):
                stream.recv(1000)
                time.sleep(0.1)

    def one_round(self, n):
        body = bytearray(self.shape)
        struct.pack_into("<hhh", body, 352, self.number, n % 30000, n // 30000)
        body = bytes(body)
        if self.random.random() < 0.2:
            self.hang_up(body)
        made = self.ask("POST", "/v1/volumes", body, expect=(200, 201))
        if made is None:
            return
        path = f"/v1/volumes/{made['id']}"
        self.ask("GET", path)
        self.ask("GET", f"{path}/preview.png")
        order = {"kind": "model", "volume": made["id"], "parameters": {"points": 67, "seed": n}}
        kind = {"content-type": "application/json"}
        job = self.ask("POST", "/v1/jobs", json.dumps(order), kind, expect=(202, 429))
        if job and "links" in job:
            self.ask("GET", job["links"]["self"] + "/events")
            job = self.ask("GET", job["links"]["self"]) or {}
            if job.get("state") != "succeeded":
                self.failures.append(("job", job.get("state"), job.get("error")))
            model = job.get("links", {}).get("model")
            if model:
                self.ask("GET", f"{model}/mesh.stl")
                self.ask("GET", f"{model}/mesh.glb", headers={"range": "bytes=0-99"}, expect=(206,))
                self.ask("GET", f"{model}/report.html")
                self.read_slowly(f"{model}/mesh.vtp")
                self.ask("DELETE", model, expect=(204, 404, 410))
            self.ask("DELETE", job["links"]["self"], expect=(200, 202, 204, 404, 410))
        self.ask("GET", "/v1/jobs?limit=20")
        self.ask("GET", "/readyz")
        self.ask("DELETE", path, expect=(204, 404, 409, 410))
        self.done += 1

    def run(self):
        n = 0
        while time.monotonic() < self.end:
            try:
                self.one_round(n)
            except (OSError, http.client.HTTPException) as error:
                self.failures.append(("connection", type(error).__name__, str(error)))
            n += 1


def slope_per_hour(values):
    """The least-squares slope of one value per minute."""
    if len(values) < 3:
        return 0.0
    return statistics.linear_regression(range(len(values)), values).slope * 60


def main():
    program = os.path.abspath(sys.argv[1])
    minutes = min(float(sys.argv[2]) if len(sys.argv) > 2 else 60, 240)
    clients = min(int(sys.argv[3]) if len(sys.argv) > 3 else 4, 64)
    with tempfile.TemporaryDirectory() as folder:
        service = Service(program, Path(folder) / "data")
        try:
            end = time.monotonic() + 60 * minutes
            shape = volume(0)
            work = [Client(service.port, n, end, shape) for n in range(clients)]
            threads = [threading.Thread(target=client.run) for client in work]
            for thread in threads:
                thread.start()
            rows = []
            while time.monotonic() < end:
                time.sleep(max(0, min(60, end - time.monotonic())))
                row = figures(service)
                rows.append(row)
                shown = "  ".join(f"{name} {value:.1f}" for name, value in row.items())
                rounds = sum(client.done for client in work)
                print(f"minute {len(rows)}: {shown}  rounds {rounds}", flush=True)
            for thread in threads:
                thread.join()
        finally:
            service.stop()
    failures = [failure for client in work for failure in client.failures]
    print(f"rounds {sum(client.done for client in work)}, failures {len(failures)}")
    for failure in failures[:10]:
        print("  ", failure)
    half = rows[len(rows) // 2 :]
    steady = True
    for name in rows[0]:
        values = [row[name] for row in half]
        third = max(1, len(values) // 3)
        rise = statistics.median(values[-third:]) - statistics.median(values[:third])
        print(f"{name}: {slope_per_hour(values):+.2f} per hour, {rise:+.2f} from middle to end")
        steady &= rise <= ALLOWED.get(name, float("inf"))
    sys.exit(0 if steady and not failures else 1)


if __name__ == "__main__":
    main()
