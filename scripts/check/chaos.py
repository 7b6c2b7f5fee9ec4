#!/usr/bin/env python3
"""Breaks a service of several replicas in every way that this machine allows, and checks all it has promised.

    scripts/check/chaos.py [--program target/release/ventriform] [--rounds 200] [--seed 1] [--only FAULT]

Two replicas answer requests, two compute (one of them in a network namespace of its own), over PostgreSQL and an
S3 store (moto) behind a proxy. Every round, under mixed load, one of these happens: a replica of either role is
killed (-9); PostgreSQL is restarted, or killed; the store answers 500 or 503, is slow, or breaks connections in the
middle; the second namespace is cut off; a replica that computes is stopped for longer than its lease. Every ten
rounds the load ends, and everything acknowledged is read back from both replicas: volumes and results byte by byte,
every job ended, and ended once (a trigger in the database writes down every end).

Loopback, and two addresses of its own namespace; stops by itself. Needs PostgreSQL's programs, moto
(scripts/requirements.txt), and root for PostgreSQL's user and the namespace. About 5 s a round on two cores.
The last line is a JSON object; the exit status is 0 if nothing was lost, corrupt or made twice.
"""

import argparse
import gzip
import hashlib
import json
import os
import random
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from lib.servers import Postgres, run, s3_server
from lib.service import FINAL, ROOT, Service

LEASE = 3
# Jobs of a round; the checks wait for all of them.
JOBS = 8
# Of this process alone: another run may go on beside it.
NEAR, FAR = (f"10.213.{os.getpid() % 256}.{host}" for host in (1, 2))
LINE = [f"vt{os.getpid()}{end}" for end in "ab"]


class Proxy:
    """Between the replicas and the S3 store: passes everything, or fails as networks and stores do."""

    def __init__(self, port, near):
        self.target, self.mode = port, "pass"
        self.listeners = []
        for own in ["127.0.0.1", *near]:
            listener = socket.create_server((own, self.listeners[0].getsockname()[1] if self.listeners else 0))
            self.listeners.append(listener)
            threading.Thread(target=self.accept, args=(listener,), daemon=True).start()
        self.port = self.listeners[0].getsockname()[1]

    def accept(self, listener):
        while True:
            client, _ = listener.accept()
            threading.Thread(target=self.serve, args=(client,), daemon=True).start()

    def serve(self, client):
        try:
            server = socket.create_connection(("127.0.0.1", self.target))
        except OSError:
            return client.close()
        left = [random.randrange(200, 200_000)]
        back = threading.Thread(target=self.pipe, args=(server, client, left, False), daemon=True)
        back.start()
        self.pipe(client, server, left, True)
        back.join()
        client.close()
        server.close()

    def pipe(self, source, target, left, is_request):
        try:
            while data := source.recv(65536):
                if self.mode in ("500", "503") and is_request and random.random() < 0.5:
                    source.sendall(
                        f"HTTP/1.1 {self.mode} Chaos\r\ncontent-length: 0\r\nconnection: close\r\n\r\n".encode()
                    )
                    break
                if self.mode == "slow":
                    time.sleep(random.uniform(0, 0.3))
                if self.mode == "cut":
                    left[0] -= len(data)
                    if left[0] < 0:
                        target.sendall(data[: len(data) // 2])
                        break
                target.sendall(data)
        except OSError:
            pass
        for end in (source, target):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass


class Chaos:
    """The replicas, what they acknowledged, and the figures."""

    def __init__(self, options, folder, scan):
        self.program, self.folder, self.scan = options.program, folder, scan
        self.random = random.Random(options.seed)
        self.figures = dict.fromkeys(
            (
                "rounds",
                "acknowledged",
                "jobs",
                "cancelled",
                "erased",
                "lost",
                "corrupt",
                "failed",
                "twice",
                "differs",
                "files_checked",
                "refused",
            ),
            0,
        )
        self.faults, self.count = {}, 0
        self.lock = threading.Lock()
        self.volumes, self.erased, self.unsure, self.jobs, self.cancelled = {}, set(), set(), {}, set()
        self.space = f"ventriform-chaos-{os.getpid()}"
        self.services = {}
        self.kinds = [options.only] if options.only else list(self.KINDS)

    def note(self, figure, what):
        self.figures[figure] += 1
        print(figure.upper(), what, flush=True)

    def build(self):
        try:
            self.separate()
        except (subprocess.CalledProcessError, FileNotFoundError) as error:
            print(
                f"no partition: this machine gives no network namespace ({getattr(error, 'stderr', error)})", flush=True
            )
            self.kinds = [kind for kind in self.kinds if kind != "partition"]
        near = self.far_address()
        self.postgres = Postgres(self.folder, ["127.0.0.1", *near], others=[FAR])
        self.store, port = s3_server()
        self.proxy = Proxy(port, near)
        os.environ |= {"AWS_ACCESS_KEY_ID": "chaos", "AWS_SECRET_ACCESS_KEY": "chaos", "AWS_REGION": "us-east-1"}
        for name in ("api-0", "api-1", "worker-0", "worker-1"):
            self.start(name)
        self.postgres.query("""
            CREATE SCHEMA chaos;
            CREATE TABLE chaos.ends (job TEXT, state TEXT, at TIMESTAMPTZ DEFAULT clock_timestamp());
            CREATE FUNCTION chaos.note() RETURNS trigger LANGUAGE plpgsql AS
              $$ BEGIN INSERT INTO chaos.ends (job, state) VALUES (NEW.id, NEW.state); RETURN NEW; END $$;
            CREATE TRIGGER note AFTER UPDATE ON jobs FOR EACH ROW
              WHEN (OLD.state IS DISTINCT FROM NEW.state AND NEW.state IN ('succeeded', 'failed', 'cancelled'))
              EXECUTE FUNCTION chaos.note();""")

    def far_address(self):
        """The address by which the other namespace reaches this one, if there is one."""
        return [NEAR] if "partition" in self.kinds else []

    def separate(self):
        """Makes the other namespace and the line to it."""
        run("ip", "netns", "add", self.space)
        run("ip", "link", "add", LINE[0], "type", "veth", "peer", "name", LINE[1], "netns", self.space)
        run("ip", "addr", "add", NEAR + "/30", "dev", LINE[0])
        run("ip", "link", "set", LINE[0], "up")
        run("ip", "-n", self.space, "addr", "add", FAR + "/30", "dev", LINE[1])
        run("ip", "-n", self.space, "link", "set", LINE[1], "up")
        run("ip", "-n", self.space, "link", "set", "lo", "up")

    def start(self, name):
        far = name == "worker-1" and bool(self.far_address())
        address = NEAR if far else "127.0.0.1"
        os.environ["AWS_ENDPOINT_URL"] = f"http://{address}:{self.proxy.port}"
        arguments = [
            "--role",
            name.split("-")[0],
            "--database",
            self.postgres.url(address),
            "--blobs",
            "s3://hearts/chaos",
            "--lease",
            f"{LEASE}s",
            "--workers",
            "2",
        ]
        prefix = ["ip", "netns", "exec", self.space] if far else []
        self.services[name] = Service(self.program, f"{self.folder}/{name}", *arguments, wait=not far, prefix=prefix)

    # --- the load -------------------------------------------------------------------------

    def volume(self):
        """A volume that was never sent before."""
        with self.lock:
            self.count += 1
            number = self.count
        body = bytearray(self.scan)
        struct.pack_into("<hh", body, len(body) - 4, number // 30000 + 1, number % 30000 + 1)
        body = bytes(body)
        return number, body, hashlib.sha256(body).hexdigest()

    def ask(self, method, path, body=None, headers=None):
        """The answer of either replica; None if it could not serve the request."""
        service = self.services[random.choice(("api-0", "api-1"))]
        try:
            status, content = service.ask(method, path, body, headers, timeout=60)
        except OSError:
            time.sleep(0.05)
            return None, None
        if status in (503, 507, 429):
            self.figures["refused"] += 1
            time.sleep(0.1)
            return None, None
        if status >= 500:
            self.note("failed", f"{method} {path.split('?')[0]}: {status} {content[:300]}")
            return None, None
        return status, content

    def upload(self):
        _, body, digest = self.volume()
        status, _ = self.ask("POST", "/v1/volumes", body)
        if status in (200, 201):
            self.volumes["vol_" + digest[:32]] = digest

    def file(self):
        if len(self.jobs) >= self.most:
            return time.sleep(0.1)
        number, body, digest = self.volume()
        path = f"/v1/models?points=67&seed={number}" if number % 3 else f"/v1/segmentations?roll={number % 90}"
        key = {"idempotency-key": f"key-{number}"}
        ids = set()
        # As a careful client does: the same request until it is answered, and once more.
        for _ in range(20):
            status, content = self.ask("POST", path, body, key)
            if status == 202:
                ids.add(json.loads(content)["id"])
                if len(ids) > 1 or self.random.random() < 0.7:
                    break
            if self.ending.is_set() and ids:
                break
        if len(ids) > 1:
            self.note("twice", f"{key} filed {ids}")
        if not ids:
            return
        job = ids.pop()
        self.volumes["vol_" + digest[:32]] = digest
        self.jobs[job] = (path, body, key)
        if number % 7 == 0:
            self.cancelled.add(job)
            self.ask("DELETE", "/v1/jobs/" + job)

    def erase(self):
        known = [v for v in list(self.volumes) if v not in self.erased and v not in self.unsure]
        if not known:
            return time.sleep(0.1)
        volume = random.choice(known)
        self.unsure.add(volume)
        status, _ = self.ask("DELETE", "/v1/volumes/" + volume)
        if status == 204:
            self.erased.add(volume)
        if status in (204, 409):
            self.unsure.discard(volume)
        time.sleep(random.uniform(0, 0.3))

    def watch(self):
        """Waits for a job at one replica that another was asked for."""
        if not self.jobs:
            return time.sleep(0.1)
        job = random.choice(list(self.jobs))
        self.ask("GET", "/v1/jobs/" + job, headers={"prefer": "wait=1"})

    def under_load(self, act):
        self.ending = threading.Event()
        self.most = len(self.jobs) + JOBS

        def client(action):
            while not self.ending.is_set():
                action()

        clients = [
            threading.Thread(target=client, args=(a,))
            for a in (self.upload, self.file, self.file, self.erase, self.watch)
        ]
        for thread in clients:
            thread.start()
        time.sleep(self.random.uniform(0.3, 1))
        act()
        time.sleep(self.random.uniform(0.3, 1))
        self.ending.set()
        for thread in clients:
            thread.join()

    # --- what goes wrong ------------------------------------------------------------------

    def again(self, name):
        self.services[name].kill()
        time.sleep(self.random.uniform(0, 1))
        self.start(name)

    def kill_worker(self):
        self.again(self.random.choice(("worker-0", "worker-1")))

    def kill_api(self):
        self.again(self.random.choice(("api-0", "api-1")))

    def restart_postgres(self):
        self.postgres.end(signal.SIGINT)
        time.sleep(self.random.uniform(0, 2))
        self.postgres.start()

    def kill_postgres(self):
        self.postgres.end(signal.SIGKILL)
        time.sleep(self.random.uniform(0, 1))
        self.postgres.start()

    def fail_store(self, mode):
        self.proxy.mode = mode
        time.sleep(self.random.uniform(0.5, 2))
        self.proxy.mode = "pass"

    def partition(self):
        run("ip", "link", "set", LINE[0], "down")
        time.sleep(self.random.uniform(0.5, 2 * LEASE))
        run("ip", "link", "set", LINE[0], "up")

    def stop_worker(self):
        process = self.services["worker-0"].process
        process.send_signal(signal.SIGSTOP)
        time.sleep(LEASE * self.random.uniform(1.1, 1.6))
        process.send_signal(signal.SIGCONT)

    KINDS = {
        "kill-worker": kill_worker,
        "kill-api": kill_api,
        "restart-postgres": restart_postgres,
        "kill-postgres": kill_postgres,
        "store-500": lambda self: self.fail_store("500"),
        "store-503": lambda self: self.fail_store("503"),
        "store-slow": lambda self: self.fail_store("slow"),
        "store-cut": lambda self: self.fail_store("cut"),
        "partition": partition,
        "stop-worker": stop_worker,
    }

    def round(self, kind):
        self.under_load(lambda: self.KINDS[kind](self))
        self.faults[kind] = self.faults.get(kind, 0) + 1
        self.figures["rounds"] += 1
        for name, service in self.services.items():
            if service.process.poll() is not None:
                self.note("failed", f"{name} ended by itself after {kind}; see its log")
                self.start(name)

    # --- the checks -----------------------------------------------------------------------

    def surely(self, service, path, patience=60):
        """The answer of one replica that may still be catching its breath."""
        deadline = time.time() + patience
        while True:
            try:
                status, content = service.ask("GET", path, timeout=60)
                if status not in (503, 429):
                    return status, content
            except OSError:
                pass
            if time.time() > deadline:
                return None, b"{}"
            time.sleep(0.1)

    def check(self):
        """Every acknowledged thing of the last rounds, at both replicas."""
        replicas = [self.services["api-0"], self.services["api-1"]]
        for volume, digest in self.volumes.items():
            if volume in self.unsure:
                continue
            self.figures["acknowledged"] += 1
            answers = [self.surely(replica, f"/v1/volumes/{volume}")[0] for replica in replicas]
            if volume in self.erased:
                self.figures["erased"] += 1
                if answers != [410, 410]:
                    self.note("differs", f"{volume} was erased: {answers}")
                continue
            if answers != [200, 200]:
                self.note("lost", f"{volume}: {answers}")
                continue
            status, content = self.surely(random.choice(replicas), f"/v1/volumes/{volume}/content")
            if status != 200 or hashlib.sha256(content).hexdigest() != digest:
                self.note("corrupt", f"{volume}: {status}, {len(content)} bytes")
        results = {}
        deadline = time.time() + 300
        for job in self.jobs:
            self.figures["acknowledged"] += 1
            self.figures["jobs"] += 1
            while True:
                status, content = self.surely(replicas[0], "/v1/jobs/" + job)
                now = json.loads(content) if status == 200 else {}
                if status != 200 or now["state"] in FINAL or time.time() > deadline:
                    break
                time.sleep(0.1)
            if status != 200:
                self.note("lost", f"{job}: {status}")
                continue
            other = json.loads(self.surely(replicas[1], "/v1/jobs/" + job)[1])
            if other != now:
                self.note("differs", f"{now} and {other}")
            if now["state"] == "cancelled" and job in self.cancelled:
                self.figures["cancelled"] += 1
                continue
            if now["state"] != "succeeded":
                self.note("failed", f"{job} is {now['state']}: {now.get('error')}")
                continue
            made = now["links"].get("model") or now["links"]["segmentation"]
            results.setdefault(made, set()).add(job)
            status, content = self.surely(replicas[1], made)
            if status != 200:
                self.note("lost", f"{made} of {job}: {status}")
                continue
            for file in random.sample(json.loads(content)["files"], 4):
                status, content = self.surely(random.choice(replicas), file["href"])
                self.figures["files_checked"] += 1
                if status != 200 or (
                    not file["name"].endswith(".html") and hashlib.sha256(content).hexdigest() != file["sha256"]
                ):
                    self.note("corrupt", f"{made} {file['name']}: {status}")
        for made, jobs in results.items():
            if len(jobs) > 1:
                self.note("twice", f"{made} by {jobs}")
        for job, count in self.postgres.query("SELECT job, count(*) FROM chaos.ends GROUP BY job HAVING count(*) > 1"):
            self.note("twice", f"{job} ended {count} times")
        self.postgres.query("DELETE FROM chaos.ends")
        self.volumes, self.erased, self.unsure, self.jobs, self.cancelled = {}, set(), set(), {}, set()

    def tear_down(self):
        for service in self.services.values():
            service.process.send_signal(signal.SIGCONT)
            service.process.kill()
            service.process.wait()
        if hasattr(self, "store"):
            self.store.kill()
        if hasattr(self, "postgres"):
            self.postgres.end(signal.SIGQUIT)
        subprocess.run(["ip", "link", "del", LINE[0]], capture_output=True)
        subprocess.run(["ip", "netns", "del", self.space], capture_output=True)


def simulated_scan(program, folder):
    """A simulated scan, as the bytes of a NIfTI file."""
    run(program, "phantom", "--size", "64", "--spacing", "6.4", "-o", folder)
    with open(f"{folder}/spect.nii.gz", "rb") as file:
        return gzip.decompress(file.read())


def status(figures, folder):
    """The exit status: 1 if a promise was broken, which keeps the folder to look at."""
    found = any(figures[fault] for fault in ("lost", "corrupt", "failed", "twice", "differs"))
    if not found:
        shutil.rmtree(folder, ignore_errors=True)
    return int(found)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=os.path.join(ROOT, "target/release/ventriform"))
    parser.add_argument("--rounds", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=Chaos.KINDS)
    options = parser.parse_args()
    random.seed(options.seed)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("stopped"))
    folder = tempfile.mkdtemp(prefix="ventriform-chaos-")
    os.chmod(folder, 0o755)
    scan = simulated_scan(options.program, folder)
    chaos = Chaos(options, folder, scan)
    started = time.time()
    try:
        chaos.build()
        kinds = []
        for number in range(options.rounds):
            if not kinds:
                kinds = chaos.random.sample(chaos.kinds, len(chaos.kinds))
            chaos.round(kinds.pop())
            if number % 10 == 9 or number == options.rounds - 1:
                chaos.check()
                print(f"{number + 1} rounds, {time.time() - started:.0f} s", flush=True)
    finally:
        chaos.tear_down()
    print(json.dumps(chaos.figures | {"faults": chaos.faults}))
    return status(chaos.figures, folder)


if __name__ == "__main__":
    sys.exit(main())
