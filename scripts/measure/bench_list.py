#!/usr/bin/env python3
"""Measures the list of scans over many.

    scripts/measure/bench_list.py [--program target/release/ventriform] [--scans 100000] [--postgres]

A service with a database of its own, SQLite or with --postgres PostgreSQL, in which that many scans are written as rows
beside one that was uploaded: names, dates and labels vary, every third has a result. Then pages, orders, searches and
filters of GET /v1/volumes, each asked 20 times: median and slowest. Fails if the first page or a search takes .3 s or
more at the median. Needs what scripts/check/chaos.py needs for --postgres, else Python alone.
"""

import argparse
import json
import os
import random
import shutil
import sqlite3
import statistics
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from lib.servers import Postgres, run
from lib.service import ROOT, Service

LIMIT_SECONDS = 0.3
ROUNDS = 20
# Statements are words of a command line.
BATCH_LETTERS = 90_000
FAMILY = ["Smith", "Doe", "Okafor", "Tanaka", "Novak", "Silva", "Jensen", "Haddad"]
GIVEN = ["Ada", "Bert", "Chen", "Dora", "Emil", "Fay", "Gus", "Hana"]
ASKED = [
    ("first page", "limit=30"),
    ("first page, largest first", "limit=30&order=largest"),
    ("first page, by patient", "limit=30&order=patient"),
    ("first page, by study date", "limit=30&order=study_date"),
    ("first page, by name", "limit=30&order=name"),
    ("search that finds many", "limit=30&search=smith"),
    ("search that finds one", "limit=30&search=4711-X"),
    ("search that finds none", "limit=30&search=nobody"),
    ("two words, by patient, none found", "limit=30&search=smith+nobody&order=patient"),
    ("with a model, by patient", "limit=30&made=model&order=patient"),
    ("without a result", "limit=30&made=nothing"),
    ("stress of one year", "limit=30&rest_or_stress=stress&study_date_from=2019-01-01&study_date_to=2019-12-31"),
    ("a failed job", "limit=30&job=failed"),
]


def rows(count):
    """For each scan: id, external id or None, labels, fields, the id of a model or None."""
    dice = random.Random(1)
    for n in range(count):
        volume = f"vol_{dice.getrandbits(128):032x}"
        model = f"mdl_{dice.getrandbits(128):032x}" if n % 3 == 0 else None
        found = {
            "patient_name": f"{dice.choice(FAMILY)}^{dice.choice(GIVEN)} {n}",
            "patient_id": "4711-X" if n == count // 2 else str(n),
            "study_date": f"{2000 + dice.randrange(26)}{1 + dice.randrange(12):02}{1 + dice.randrange(28):02}",
            "study_uid": f"1.2.840.99999.{n // 2}",
            "series_uid": f"1.2.840.99999.{n // 2}.{n}",
            "accession_number": f"ACC{n}",
            "study_description": "Myocardial perfusion",
            "series_description": f"SPECT {n % 9}",
            "modality": "NM",
            "rest_or_stress": "stress" if n % 2 else "rest",
            "radiopharmaceutical": "Tc-99m Sestamibi",
        }
        external = f"A{n}" if n % 4 == 0 else None
        yield volume, external, json.dumps({"ward": f"w{n % 40}"}), json.dumps(found), model


def statements(placeholder):
    """The rows of one scan, as another that was uploaded has them."""
    p = placeholder
    return {
        "volume": "INSERT INTO volumes (id, created_at, bytes, files, facts) "
        f"SELECT {p}, created_at, bytes, files, facts FROM volumes ORDER BY sequence LIMIT 1",
        "holding": "INSERT INTO holdings (tenant, id, kind, created_at, renewed_at, external_id, labels) "
        f"VALUES ('default', {p}, 'volume', 1700000000000, 1700000000000, {p}, {p})",
        "scan": f"INSERT INTO scans (tenant, volume, found) VALUES ('default', {p}, {p})",
        "model": "INSERT INTO holdings (tenant, id, kind, created_at, renewed_at) "
        f"VALUES ('default', {p}, 'model', 1700000000000, 1700000000000)",
        "source": f"INSERT INTO sources (tenant, id, volume) VALUES ('default', {p}, {p})",
    }


def fill_sqlite(path, count):
    database = sqlite3.connect(path)
    database.execute("PRAGMA foreign_keys = ON")
    text = statements("?")
    for volume, external, labels, found, model in rows(count):
        database.execute(text["volume"], (volume,))
        database.execute(text["holding"], (volume, external, labels))
        database.execute(text["scan"], (volume, found))
        if model:
            database.execute(text["model"], (model,))
            database.execute(text["source"], (model, volume))
    database.commit()
    database.close()


def quoted(value):
    return "NULL" if value is None else "'" + value.replace("'", "''") + "'"


def fill_postgres(server, count):
    text, batch = statements("%s"), []

    def send():
        server.query("; ".join(batch))
        batch.clear()

    def add(name, *values):
        batch.append(text[name] % tuple(quoted(value) for value in values))

    for volume, external, labels, found, model in rows(count):
        add("volume", volume)
        add("holding", volume, external, labels)
        add("scan", volume, found)
        if model:
            add("model", model)
            add("source", model, volume)
        if sum(map(len, batch)) > BATCH_LETTERS:
            send()
    send()
    server.query("VACUUM (ANALYZE)")


def measure(service, asked):
    failed = False
    for what, query in asked:
        times, found = [], 0
        for _ in range(ROUNDS):
            started = time.perf_counter()
            status, body = service.ask("GET", f"/v1/volumes?{query}")
            times.append(time.perf_counter() - started)
            assert status == 200, body
            found = len(json.loads(body)["volumes"])
        median = statistics.median(times)
        slow = median >= LIMIT_SECONDS and ("first page" in what or "search" in what)
        failed |= slow
        print(
            f"{what}: median {median * 1e3:.1f} ms, slowest {max(times) * 1e3:.1f} ms, {found} on the page"
            + (" TOO SLOW" if slow else ""),
            flush=True,
        )
    return failed


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=os.path.join(ROOT, "target/release/ventriform"))
    parser.add_argument("--scans", type=int, default=100_000)
    parser.add_argument("--postgres", action="store_true")
    options = parser.parse_args()
    folder = tempfile.mkdtemp(prefix="ventriform-list-")
    os.chmod(folder, 0o755)
    server = Postgres(folder, ["127.0.0.1"]) if options.postgres else None
    flags = ["--database", server.url("127.0.0.1")] if server else []
    service = Service(options.program, f"{folder}/data", "--quota-requests", "off", *flags)
    try:
        run(options.program, "phantom", "--size", "32", "--spacing", "6.4", "-o", folder)
        with open(f"{folder}/spect.nii.gz", "rb") as scan:
            assert service.ask("POST", "/v1/volumes", scan.read())[0] == 201
        service.stop()
        started = time.perf_counter()
        if server:
            fill_postgres(server, options.scans)
        else:
            fill_sqlite(f"{folder}/data/ventriform.db", options.scans)
        print(f"{options.scans} scans written in {time.perf_counter() - started:.0f} s", flush=True)
        service.start()
        page = json.loads(service.ask("GET", "/v1/volumes?limit=1&order=patient")[1])
        deep = [("page of an order, from a place on", f"limit=30&order=patient&cursor={page['next_cursor']}")]
        failed = measure(service, ASKED + deep)
    finally:
        service.kill()
        if server:
            server.process.kill()
            server.process.wait()
        shutil.rmtree(folder, ignore_errors=True)
    sys.exit(failed)


if __name__ == "__main__":
    main()
