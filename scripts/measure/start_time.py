#!/usr/bin/env python3
"""Measures how soon the service is ready on a data folder with many volumes.

    scripts/measure/start_time.py [--program target/release/ventriform] [--volumes 100000] [--starts 20]

Uploads one small volume, then writes the others beside it as the service would have: a folder with the
file and its record, and rows in the database, under the id that the content has. Starts the service again
and again, each time after SIGKILL, and measures the time from the start of the process to the first 200
of `/readyz`; then reads some of the volumes back and compares every byte. Loopback only; stops by itself;
needs Python 3 and about 1 GB of disk for 100,000 volumes. The last line is a JSON object.
"""

import argparse
import hashlib
import json
import os
import random
import shutil
import sqlite3
import statistics
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from lib.nifti import FLOAT32, nifti
from lib.service import Service


def numbered(number):
    """A volume that holds `number`; all are equally long."""
    return nifti(4, (float(number + i) for i in range(64)), FLOAT32)


def fill(data, first, count):
    """Writes `count` further volumes like the stored one of id `first`."""
    shelf = os.path.join(data, "volumes")
    record = open(os.path.join(shelf, first, "record.json")).read()
    (name,) = [name for name in os.listdir(os.path.join(shelf, first)) if name != "record.json"]
    digest = hashlib.sha256(open(os.path.join(shelf, first, name), "rb").read()).hexdigest()
    database = sqlite3.connect(os.path.join(data, "ventriform.db"))
    rows = {}
    for table, column in (("volumes", "id"), ("holdings", "id"), ("scans", "volume")):
        # Without the columns that the database computes.
        stored = [n for _, n, *_ in database.execute(f"PRAGMA table_info({table})") if n != "sequence"]
        row = f"SELECT {', '.join(stored)} FROM {table} WHERE {column} = ?"
        rows[table] = list(zip(stored, database.execute(row, (first,)).fetchone()))
    written = {}
    for number in range(count):
        body = numbered(number + 1)
        sha = hashlib.sha256(body).hexdigest()
        folder = os.path.join(shelf, "vol_" + sha[:32])
        os.mkdir(folder)
        written[os.path.basename(folder)] = body

        def of_this(text):
            if not isinstance(text, str):
                return text
            return text.replace(first, os.path.basename(folder)).replace(digest, sha)

        with open(os.path.join(folder, name), "wb") as file:
            file.write(body)
        with open(os.path.join(folder, "record.json"), "w") as file:
            file.write(of_this(record))
        for table, values in rows.items():
            columns = ", ".join(n for n, _ in values)
            marks = ", ".join("?" for _ in values)
            values = [of_this(v) for _, v in values]
            database.execute(f"INSERT INTO {table} ({columns}) VALUES ({marks})", values)
    database.commit()
    database.close()
    return written


def compare(service, written):
    """Reads some of the volumes back, byte by byte."""
    for name in random.Random(1).sample(sorted(written), min(200, len(written))):
        status, answer = service.json("GET", f"/v1/volumes/{name}")
        assert status == 200, (name, status, answer)
        status, body = service.ask("GET", answer["originals"][0]["href"])
        assert status == 200 and body == written[name], (name, status, body[:300])
    status, page = service.json("GET", "/v1/volumes?limit=100")
    assert status == 200 and len(page["volumes"]) == min(100, len(written) + 1), status


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/ventriform")
    parser.add_argument("--volumes", type=int, default=100_000)
    parser.add_argument("--starts", type=int, default=20)
    options = parser.parse_args()
    work = tempfile.mkdtemp(prefix="ventriform-start-")
    data = os.path.join(work, "data")
    try:
        service = Service(options.program, data)
        status, volume = service.json("POST", "/v1/volumes", numbered(0))
        assert status == 201, (status, volume)
        # Stopped in order: what follows changes the database from outside.
        service.stop()
        written = fill(data, volume["id"], options.volumes - 1)
        ready = []
        for _ in range(options.starts):
            service = Service(options.program, data)
            ready.append(service.ready_ms)
            service.kill()
        service = Service(options.program, data)
        try:
            compare(service, written)
        finally:
            service.kill()
        print(
            json.dumps(
                {
                    "volumes": options.volumes,
                    "starts": len(ready),
                    "ready_ms": {"median": round(statistics.median(ready)), "max": round(max(ready))},
                }
            )
        )
    finally:
        shutil.rmtree(work)


if __name__ == "__main__":
    main()
