#!/usr/bin/env python3
"""Kills the service with SIGKILL at random moments, starts it again, and checks all it has promised.

    scripts/check/crash_rounds.py [--program target/release/ventriform] [--rounds 1000] [--seed 1]

Of every ten rounds, eight are kills under mixed load (uploads, models, segmentations, deletions,
cancellations, repeated requests), one is a kill while items are erased by age, and one a kill while the data of
a released version is opened (tests/data). Loopback only; stops by itself; needs Python 3 and nothing else. Takes about
1.5 s a round on two cores. After each kill under load, every stored volume, filed job, cancellation and erasure
has its row of the audit trail. The last line is a JSON object; the exit status is 0 if nothing was lost,
corrupt, orphaned, made twice or without its row.
"""

import argparse
import glob
import gzip
import hashlib
import json
import os
import random
import shutil
import sqlite3
import struct
import subprocess
import sys
import tempfile
import threading
import time
import zipfile

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from lib.service import FINAL, ROOT, Service

SHELVES = ("volumes", "models", "segmentations", "beats", "comparisons", "normals", "templates", "readers")
# What released versions had stored.
RELEASED = os.path.join(ROOT, "tests/data")


class Rounds:
    """One data folder, what the service has acknowledged about it, and the figures."""

    def __init__(self, options, scan):
        self.program, self.scan = options.program, scan
        self.random = random.Random(options.seed)
        self.folder = tempfile.mkdtemp(prefix="ventriform-crash-")
        self.figures = dict.fromkeys(
            (
                "rounds",
                "acknowledged",
                "lost",
                "corrupt",
                "undeleted",
                "changed",
                "failed",
                "twice",
                "orphans",
                "dangling",
                "unrecorded",
                "recorded",
                "files_checked",
                "erased_by_age",
                "upgrades",
            ),
            0,
        )
        self.ready, self.number, self.lock = [], 0, threading.Lock()
        self.fresh()

    def fresh(self):
        self.data = os.path.join(self.folder, f"data{self.number}")
        self.volumes, self.deleted, self.unsure = {}, set(), set()
        self.jobs, self.ended, self.cancelled = {}, {}, set()
        self.service = None

    def note(self, figure, what):
        self.figures[figure] += 1
        print(figure.upper(), what, flush=True)

    def volume(self):
        """A volume that was never sent before."""
        with self.lock:
            self.number += 1
            number = self.number
        body = bytearray(self.scan)
        struct.pack_into("<h", body, len(body) - 2, number % 30000 + 1)
        struct.pack_into("<h", body, len(body) - 4, number // 30000 + 1)
        body = bytes(body)
        return number, body, hashlib.sha256(body).hexdigest()

    def start(self, *arguments):
        self.service = Service(self.program, self.data, "--workers", "2", *arguments)
        self.ready.append(self.service.ready_ms)

    # --- the load -------------------------------------------------------------------------

    def upload(self):
        _, body, digest = self.volume()
        status, _ = self.service.ask("POST", "/v1/volumes", body)
        if status == 201:
            self.volumes["vol_" + digest[:32]] = digest

    def file(self):
        number, body, digest = self.volume()
        path = f"/v1/models?points=67&seed={number}" if number % 3 else f"/v1/segmentations?roll={number % 90}"
        key = {"idempotency-key": f"key-{number}"}
        status, job = self.service.json("POST", path, body, key)
        if status != 202:
            return time.sleep(0.05)
        self.volumes["vol_" + digest[:32]] = digest
        self.jobs[job["id"]] = (path, body, key)
        if number % 5 == 0:
            status, again = self.service.json("POST", path, body, key)
            if status == 202 and again["id"] != job["id"]:
                self.note("twice", f"{key} filed {job['id']} and {again['id']}")
        if number % 7 == 0:
            self.cancelled.add(job["id"])
            self.service.ask("DELETE", "/v1/jobs/" + job["id"])

    def delete(self):
        known = [v for v in list(self.volumes) if v not in self.deleted and v not in self.unsure]
        if not known:
            return
        volume = random.choice(known)
        self.unsure.add(volume)
        status, _ = self.service.ask("DELETE", "/v1/volumes/" + volume)
        if status == 204:
            self.deleted.add(volume)
        if status in (204, 409):
            self.unsure.discard(volume)
        time.sleep(random.uniform(0, 0.1))

    def look(self):
        for job in random.sample(list(self.jobs), min(3, len(self.jobs))):
            status, now = self.service.json("GET", "/v1/jobs/" + job)
            if status == 200 and now["state"] in FINAL:
                self.ended[job] = now
        time.sleep(0.02)

    def load(self):
        stop = threading.Event()

        def client(action):
            while not stop.is_set():
                try:
                    action()
                except (OSError, ValueError):
                    return  # killed

        actions = (self.upload, self.upload, self.file, self.file, self.delete, self.look)
        clients = [threading.Thread(target=client, args=(action,)) for action in actions]
        for thread in clients:
            thread.start()
        time.sleep(self.random.uniform(0.02, 1.2))
        self.service.kill()
        stop.set()
        for thread in clients:
            thread.join()

    # --- the checks -----------------------------------------------------------------------

    def differences(self):
        """Files without a record, and records without files."""
        database = sqlite3.connect(f"file:{self.data}/ventriform.db?mode=ro", uri=True, timeout=30)
        rows = {row[0] for row in database.execute("SELECT id FROM volumes UNION SELECT id FROM products")}
        database.close()
        files = {name for shelf in SHELVES for name in os.listdir(f"{self.data}/{shelf}")}
        return files - rows, rows - files

    def check_trail(self):
        """A change and its row of the audit trail are there both, whether it was acknowledged or not."""
        changes = {
            "create": "SELECT id FROM holdings WHERE kind = 'volume'",
            "execute": "SELECT id FROM jobs",
            "delete": "SELECT id FROM jobs WHERE cancel_requested UNION SELECT id FROM erased WHERE id LIKE 'vol_%'",
        }
        database = sqlite3.connect(f"file:{self.data}/ventriform.db?mode=ro", uri=True, timeout=30)
        for activity, ids in changes.items():
            rows = database.execute(
                f"""SELECT id, EXISTS (SELECT 1 FROM audit WHERE object = id
                AND json_extract(event, '$.activity') = ?) FROM ({ids})""",
                (activity,),
            ).fetchall()
            self.figures["recorded"] += sum(known for _, known in rows)
            for item, known in rows:
                if not known:
                    self.note("unrecorded", f"{activity} {item}")
        database.close()

    def check_volumes(self, ids):
        for volume in ids:
            self.figures["acknowledged"] += 1
            status, _ = self.service.ask("GET", "/v1/volumes/" + volume)
            if status != 200:
                self.note("lost", f"{volume}: {status}")
                continue
            (name,) = set(os.listdir(f"{self.data}/volumes/{volume}")) - {"record.json"}
            with open(f"{self.data}/volumes/{volume}/{name}", "rb") as file:
                if hashlib.sha256(file.read()).hexdigest() != self.volumes[volume]:
                    self.note("corrupt", volume)

    def check(self):
        kept = [v for v in self.volumes if v not in self.deleted and v not in self.unsure]
        self.check_volumes(kept[-20:] + self.random.sample(kept, min(10, len(kept))))
        for volume in self.random.sample(sorted(self.deleted), min(5, len(self.deleted))):
            if self.service.ask("GET", "/v1/volumes/" + volume)[0] != 410:
                self.note("undeleted", volume)
        for job in list(self.jobs)[-20:]:
            self.figures["acknowledged"] += 1
            if self.service.ask("GET", "/v1/jobs/" + job)[0] != 200:
                self.note("lost", job)
        for job, then in self.random.sample(sorted(self.ended.items()), min(10, len(self.ended))):
            now = self.service.json("GET", "/v1/jobs/" + job)[1]
            if now != then:
                self.note("changed", f"{then} -> {now}")

    def check_results(self):
        """Every accepted job ends as it should, once, and each file of its result is whole."""
        deadline = time.time() + 300
        results = {}
        for job, request in self.jobs.items():
            while (now := self.service.json("GET", "/v1/jobs/" + job)[1])["state"] not in FINAL:
                if time.time() > deadline:
                    self.note("failed", f"{job} does not end: {now}")
                    break
                time.sleep(0.05)
            if now["state"] == "cancelled" and job in self.cancelled:
                continue
            if now["state"] != "succeeded":
                self.note("failed", f"{job}: {now.get('error')}")
                continue
            status, again = self.service.json("POST", *request)
            if (status, again.get("id")) != (202, job):
                self.note("twice", f"{job}: its request again gives {status} {again}")
            made = now["links"].get("model") or now["links"]["segmentation"]
            results.setdefault(made, set()).add(job)
            for file in self.service.json("GET", made)[1]["files"]:
                if file["name"].endswith(".html"):
                    continue
                self.figures["files_checked"] += 1
                status, content = self.service.ask("GET", file["href"])
                if status != 200 or hashlib.sha256(content).hexdigest() != file["sha256"]:
                    self.note("corrupt", f"{made} {file['name']}")
        for made, jobs in results.items():
            if len(jobs) > 1:
                self.note("twice", f"{made} by {jobs}")
        stored, cursor = 0, ""
        while cursor is not None:
            page = self.service.json("GET", "/v1/jobs?limit=100" + cursor)[1]
            stored += len({(j["kind"], json.dumps(j["parameters"]), j["volume"]) for j in page["jobs"]})
            stored -= len(page["jobs"])
            cursor = "&cursor=" + page["next_cursor"] if "next_cursor" in page else None
        if stored < 0:
            self.note("twice", f"{-stored} jobs stand in the list for requests that stand there already")

    def finish(self):
        """After the last round on a folder."""
        self.check_results()
        self.end()

    def end(self):
        """Stops the service, and looks for files without a record, records without files and defects."""
        self.service.stop()
        self.start()
        deadline = time.time() + 60
        while (left := self.differences())[0] and time.time() < deadline:
            time.sleep(0.5)
        self.figures["orphans"] += len(left[0])
        self.figures["dangling"] += len(left[1])
        self.service.stop()
        database = sqlite3.connect(f"{self.data}/ventriform.db")
        if database.execute("PRAGMA integrity_check").fetchone()[0] != "ok":
            self.note("corrupt", "the database")
        database.close()
        shutil.rmtree(self.data)
        self.fresh()

    # --- the kinds of rounds ----------------------------------------------------------------

    def mixed(self, count):
        self.start()
        for _ in range(count):
            self.load()
            self.start()
            self.check()
            self.check_trail()
            self.figures["rounds"] += 1
        self.finish()

    def retention(self):
        """Killed while everything is erased by age: an item is there as a whole, or is erased."""
        self.start()
        for _ in range(12):
            self.upload()
        self.service.stop()
        service = Service(self.program, self.data, "--retention", "1ms", wait=False)
        time.sleep(self.random.uniform(0.02, 0.3))
        service.kill()
        self.start()
        for volume in list(self.volumes):
            status = self.service.ask("GET", "/v1/volumes/" + volume)[0]
            if status == 410:
                self.figures["erased_by_age"] += 1
                del self.volumes[volume]
            elif status != 200:
                self.note("lost", f"{volume}: {status}")
        self.check_volumes(self.volumes)
        self.figures["rounds"] += 1
        self.finish()

    def upgrade(self):
        """Killed while the tables of a released version are brought up to date, in a copy of what it had stored."""
        version = self.random.choice(sorted(os.listdir(RELEASED)))
        with zipfile.ZipFile(f"{RELEASED}/{version}/folder.zip") as archive:
            archive.extractall(self.data)
        items, jobs = self.stored()
        service = Service(self.program, self.data, wait=False)
        time.sleep(self.random.uniform(0, 0.12))
        service.kill()
        self.start()
        deadline = time.time() + 60
        while time.time() < deadline and not set(self.stored()[1].values()) <= set(FINAL):
            time.sleep(0.05)
        items_now, jobs_now = self.stored()
        for job, state in jobs.items():
            self.figures["acknowledged"] += 1
            expected = state if state in FINAL else "succeeded"
            if jobs_now.get(job) != expected:
                self.note("lost", f"{job} of {version}: {jobs_now.get(job)}, not {expected}")
        for item, files in items.items():
            self.figures["acknowledged"] += 1
            if items_now.get(item) != files:
                self.note("lost", f"{item} of {version}")
                continue
            for file in json.loads(files):
                self.figures["files_checked"] += 1
                (path,) = glob.glob(f"{self.data}/*/{item}/{file['name']}")
                with open(path, "rb") as content:
                    if hashlib.sha256(content.read()).hexdigest() != file["sha256"]:
                        self.note("corrupt", f"{item} {file['name']} of {version}")
        self.figures["upgrades"] += 1
        self.figures["rounds"] += 1
        self.end()

    def stored(self):
        """The files of each item, and the state of each job."""
        database = sqlite3.connect(f"file:{self.data}/ventriform.db?mode=ro", uri=True, timeout=30)
        items = dict(database.execute("SELECT id, files FROM volumes UNION ALL SELECT id, files FROM products"))
        jobs = dict(database.execute("SELECT id, state FROM jobs"))
        database.close()
        return items, jobs


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=os.path.join(ROOT, "target/release/ventriform"))
    parser.add_argument("--rounds", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    random.seed(options.seed)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [options.program, "phantom", "--size", "64", "--spacing", "6.4", "-o", folder],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        with open(f"{folder}/spect.nii.gz", "rb") as file:
            scan = gzip.decompress(file.read())
    rounds = Rounds(options, scan)
    try:
        while (left := options.rounds - rounds.figures["rounds"]) > 0:
            rounds.mixed(min(max(left - 2, 1), 8))
            if left > 2:
                rounds.retention()
                rounds.upgrade()
            print(rounds.figures["rounds"], "rounds, ready after", round(rounds.ready[-1]), "ms", flush=True)
    finally:
        if rounds.service is not None and rounds.service.process.poll() is None:
            rounds.service.kill()
        shutil.rmtree(rounds.folder, ignore_errors=True)
    ready = sorted(rounds.ready)
    rounds.figures |= {
        "ready_ms_median": round(ready[len(ready) // 2]),
        "ready_ms_p99": round(ready[min(len(ready) * 99 // 100, len(ready) - 1)]),
    }
    print(json.dumps(rounds.figures))
    faults = ("lost", "corrupt", "undeleted", "changed", "failed", "twice", "orphans", "dangling", "unrecorded")
    return int(any(rounds.figures[fault] for fault in faults))


if __name__ == "__main__":
    sys.exit(main())
