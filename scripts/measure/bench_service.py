#!/usr/bin/env python3
"""Uploads and small requests per second, beside Orthanc and an earlier version in the same run.

    target/test-tools/python/bin/python scripts/measure/bench_service.py
        [--program target/release/ventriform] [--rounds 4] [--before PROGRAM]

All listen on loopback, keep their files under the same temporary folder, sync them (Orthanc:
SyncStorageArea) and check credentials. They get the same DICOM NM files of 8 MiB and take turns, round by
round, so that what else the machine does meets all. Prints the median of each and of the ratios.

Needs the Debian packages orthanc and wrk, and the Python packages of scripts/requirements.txt.
"""

import argparse
import base64
import http.client
import json
import queue
import re
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from lib.nm import nm
from lib.service import Service, free_port, make_key

USER, PASSWORD = "bench", "bench"


class Server:
    """A program that listens, and what its requests need."""

    def __init__(self, name, process, port, authorization, upload):
        self.name, self.process, self.port = name, process, port
        self.headers, self.upload_path = {"Authorization": authorization}, upload

    def ask(self, method, path, body=None):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=120)
        try:
            connection.request(method, path, body, self.headers)
            answer = connection.getresponse()
            return answer.status, answer.read()
        finally:
            connection.close()

    def json(self, method, path, body=None):
        status, text = self.ask(method, path, body)
        if status >= 300:
            raise SystemExit(f"{self.name}: {method} {path}: {status} {text[:300]}")
        return json.loads(text)

    def upload(self, files, clients):
        """MiB per second."""
        waiting = queue.Queue()
        for file in files:
            waiting.put(file)
        failures = []

        def run():
            connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=120)
            while True:
                try:
                    body = waiting.get_nowait().read_bytes()
                except queue.Empty:
                    return
                connection.request("POST", self.upload_path, body, self.headers | {"Content-Type": "application/dicom"})
                answer = connection.getresponse()
                answer.read()
                if answer.status not in (200, 201):
                    failures.append(answer.status)

        threads = [threading.Thread(target=run) for _ in range(clients)]
        started = time.perf_counter()
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        if failures:
            raise SystemExit(f"{self.name}: uploads were answered {failures}")
        return len(files) * 8 / (time.perf_counter() - started)

    def requests(self, path):
        """Requests per second over 8 connections."""
        header = f"Authorization: {self.headers['Authorization']}"
        command = ["wrk", "-t1", "-c8", "-d2s", "-H", header, f"http://127.0.0.1:{self.port}{path}"]
        printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        if "Non-2xx" in printed:
            raise SystemExit(f"{self.name}: {path}: {printed}")
        return float(re.search(r"Requests/sec:\s+([\d.]+)", printed).group(1))


def compare(what, unit, rounds, sides):
    """`sides`: by name, the measurement of a round; the first is compared with each of the others."""
    taken = {name: [] for name in sides}
    for i in range(rounds):
        for name, measure in sides.items():
            taken[name].append(measure(i))
    ours, *others = taken
    text = f"{what}: {statistics.median(taken[ours]):.0f} {unit}"
    for other in others:
        ratio = statistics.median(a / b for a, b in zip(taken[ours], taken[other]))
        text += f", {other} {statistics.median(taken[other]):.0f}, ratio {ratio:.2f}"
    print(text, flush=True)


def ventriform(name, program, folder):
    data = folder / name
    data.mkdir(parents=True, exist_ok=True)
    key = make_key(program, str(data), "submit", "--requests-per-minute", "1000000000")
    service = Service(program, data)
    return Server(name, service.process, service.port, f"Bearer {key}", "/v1/volumes")


def orthanc(folder):
    port = free_port()
    settings = {
        "StorageDirectory": str(folder / "orthanc"),
        "IndexDirectory": str(folder / "orthanc"),
        "HttpPort": port,
        "DicomServerEnabled": False,
        "RemoteAccessAllowed": False,
        "AuthenticationEnabled": True,
        "RegisteredUsers": {USER: PASSWORD},
        "SyncStorageArea": True,
        "KeepAlive": True,
        "TcpNoDelay": True,
    }
    (folder / "orthanc.json").write_text(json.dumps(settings))
    basic = base64.b64encode(f"{USER}:{PASSWORD}".encode()).decode()
    process = subprocess.Popen(
        ["Orthanc", str(folder / "orthanc.json")], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    server = Server("Orthanc", process, port, f"Basic {basic}", "/instances")
    for _ in range(500):
        try:
            if server.ask("GET", "/system")[0] == 200:
                return server
        except OSError:
            time.sleep(0.02)
    raise SystemExit("Orthanc does not answer")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/ventriform")
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--before", metavar="PROGRAM", help="an earlier version, to compare with as well")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        subprocess.run([options.program, "phantom", "-o", str(folder)], check=True, stdout=subprocess.DEVNULL)
        scan = (folder / "spect.nii.gz").read_bytes()
        files = []
        for number in range(2 * 10 * options.rounds):
            voxels = np.full((256, 256, 64), number, np.uint16)
            files.append(folder / f"{number}.dcm")
            nm(files[-1], voxels, np.diag([2.0, 2.0, 2.0, 1.0]), number)
        servers = [ventriform("ventriform", options.program, folder)]
        try:
            if options.before:
                servers.append(ventriform("before", options.before, folder))
            servers.append(orthanc(folder))
            bench(servers, files, scan, options.rounds)
        finally:
            for server in servers:
                server.process.kill()
                server.process.wait()


def sides(servers, measure):
    return {server.name: lambda i, server=server: measure(server, i) for server in servers}


class Stored:
    """A volume, a job and a model in a ventriform, and the work that keeps it busy."""

    def __init__(self, server, scan):
        self.server, self.scan = server, scan
        self.volume = server.json("GET", "/v1/volumes?limit=1")["volumes"][0]["id"]
        self.job = server.json("POST", "/v1/models?points=150", scan)["id"]
        while (shown := server.json("GET", f"/v1/jobs/{self.job}"))["state"] != "succeeded":
            time.sleep(0.1)
        self.model = shown["model"]

    def paths(self):
        return [
            "/healthz",
            f"/v1/volumes/{self.volume}",
            f"/v1/jobs/{self.job}",
            f"/v1/models/{self.model}",
            f"/v1/models/{self.model}/mesh.stl",
        ]

    def beside_its_work(self, measure):
        """A measurement while all workers compute."""
        for seed in range(20):
            self.server.ask("POST", f"/v1/models?points=300&seed={time.time_ns() + seed}", self.scan)
        taken = measure()
        for state in ("queued", "running"):
            for waiting in self.server.json("GET", f"/v1/jobs?state={state}&limit=100")["jobs"]:
                self.server.ask("DELETE", f"/v1/jobs/{waiting['id']}")
        while self.server.json("GET", "/v1/jobs?state=running&limit=1")["jobs"]:
            time.sleep(0.02)
        return taken


def bench(servers, files, scan, rounds):
    for turn, clients in enumerate((1, 4)):

        def part(i):
            return files[10 * (turn * rounds + i) :][:10]

        compare(
            f"uploads of 8 MiB, {clients} at a time",
            "MiB/s",
            rounds,
            sides(servers, lambda server, i: server.upload(part(i), clients)),
        )
    *versions, theirs = servers
    stored = [Stored(server, scan) for server in versions]
    instance = theirs.json("GET", "/instances")[0]
    of_orthanc = ["/system", *[f"/instances/{instance}"] * 3, f"/instances/{instance}/simplified-tags"]

    def idle(each, measure):
        return measure()

    for state, beside in (("idle", idle), ("all workers busy", Stored.beside_its_work)):
        for number, other in enumerate(of_orthanc):
            measured = {
                each.server.name: lambda i, each=each: beside(each, lambda: each.server.requests(each.paths()[number]))
                for each in stored
            }
            # Orthanc computes nothing: today's workers compete with it as with their own service.
            measured[theirs.name] = lambda i: beside(stored[0], lambda: theirs.requests(other))
            name = re.sub(r"/[a-z]{3}_\w+", "/ID", stored[0].paths()[number])
            compare(f"GET {name}, {state}", "1/s", rounds, measured)


if __name__ == "__main__":
    main()
