#!/usr/bin/env python3
"""Measures whether what a service does costs more, the more it stores.

    scripts/measure/stored_cost.py [--program target/release/ventriform] [--few 1000] [--many 100000] [--engine sqlite]

Starts two services side by side, one with FEW studies and one with MANY: a scan with identity, labels and external
id, a model of it, the job that made it, and their rows of the audit trail. One study of each goes through the service;
its rows are then multiplied in the database, in which the service's own triggers do what they do for the service. A
quota is set, so that everything stored counts. Then both are asked in turn, TURNS times:

- job: file a job. It fails at once, and its end is waited for;
- list: first pages of volumes, models and jobs;
- search: by accession number, study, label and external id, for one study of many;
- scrape: /metrics;
- claim: the statement that takes a job, as the service's own log says how long it took;
- sweep: likewise the statements of a round of the upkeep (leases, retention), with a retention that erases nothing.

Prints ms: what the least fifth of them takes, since another program's turn of the processor doubles the median. Ends
with status 1 if a ratio is above 1.1 and the difference above what is resolved (0.1 ms). Other statements that take
longer with many studies are printed for information. Quiet machines only; needs Python 3, and PostgreSQL for that
engine.
"""

import argparse
import hashlib
import http.client
import json
import os
import random
import re
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from lib.nifti import nifti
from lib.servers import Postgres
from lib.service import FINAL, Service

# The most that a median with many studies may be of one with few.
MOST_RATIO = 1.1
# Such times repeat within this.
RESOLUTION_MS = 0.1
# Studies multiplied in one transaction: a total that changes in it has as many versions (0002_totals.sql).
BATCH_STUDIES = 200
# Stands for the number of a study in the rows that are multiplied.
NUMBER = "424242424"
ROUND_SECONDS = 30
FLAGS = ["--workers", "1", "--quota-bytes", "4096GiB", "--quota-requests", "off", "--retention", "3650d"]
FLAGS += ["--scrub-rate", "0B", "--log", "info,sqlx::query=debug", "--log-format", "json"]
JSON = {"content-type": "application/json"}

# What tells the statements of the log apart.
CLAIM = re.compile(r"attempts = attempts \+ 1, lease_token")
SWEEP = re.compile(r"AS since, x\.sequence FROM|interruptions = interruptions \+ 1")

# The tables of a study, each with the column that names the items of its rows.
STUDY_TABLES = [
    ("volumes", "id"),
    ("products", "id"),
    ("holdings", "id"),
    ("sources", "id"),
    ("scans", "volume"),
    ("jobs", "id"),
]
WRONG_TOTALS = """SELECT count(*) FROM (SELECT tenant, sum(bytes) AS bytes FROM stored GROUP BY tenant) AS s
    WHERE bytes != coalesce((SELECT bytes FROM stored_bytes AS b WHERE b.tenant = s.tenant), 0)"""


class OnSqlite:
    """The database in a data folder."""

    numbers = "WITH RECURSIVE numbers (n) AS (SELECT {} UNION ALL SELECT n + 1 FROM numbers WHERE n < {}) "
    hexadecimal = "printf('%032x', n)"

    def __init__(self, data):
        self.flags = []
        self.path = os.path.join(data, "ventriform.db")

    def open(self):
        self.database = sqlite3.connect(self.path, isolation_level=None)
        pragmas = ("synchronous = OFF", "foreign_keys = ON", "cache_size = -500000", "wal_autocheckpoint = 50000")
        self.database.executescript(";".join(f"PRAGMA {pragma}" for pragma in pragmas))

    def rows(self, text):
        return [[None if v is None else str(v) for v in row] for row in self.database.execute(text)]

    def columns(self, table):
        return [name for _, name, *_ in self.database.execute(f"PRAGMA table_info({table})") if name != "sequence"]

    def run(self, statements):
        self.database.executescript("BEGIN;" + ";".join(statements) + ";COMMIT")

    def close(self):
        self.database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        self.database.close()


class OnPostgres:
    """A database of its own on a server."""

    numbers = "WITH numbers AS (SELECT generate_series({}, {}) AS n) "
    hexadecimal = "lpad(to_hex(n), 32, '0')"

    def __init__(self, server, name):
        self.server, self.name = server, name
        server.query(f"CREATE DATABASE {name}", "postgres")
        self.flags = ["--database", server.url().replace("/ventriform?", f"/{name}?")]

    def open(self):
        pass

    def rows(self, text):
        rows = self.psql(f"SELECT row_to_json(one_row)::text FROM ({text}) AS one_row").splitlines()
        return [[None if v is None else str(v) for v in json.loads(row).values()] for row in rows]

    def columns(self, table):
        found = self.rows(
            f"""SELECT column_name FROM information_schema.columns WHERE table_name = '{table}' AND is_identity = 'NO'
                AND is_generated = 'NEVER' AND table_schema = 'public' ORDER BY ordinal_position"""
        )
        return [name for (name,) in found]

    def run(self, statements):
        self.psql("BEGIN;" + ";".join(statements) + ";COMMIT")

    def psql(self, text):
        command = [self.server.bin + "psql", *self.server.place(), "-Atq", "-v", "ON_ERROR_STOP=1", self.name]
        done = subprocess.run(command, input=text, capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"psql: {done.stderr[-600:]}")
        return done.stdout

    def close(self):
        self.psql("VACUUM ANALYZE")


def quoted(value):
    return "NULL" if value is None else "'" + value.replace("'", "''") + "'"


class Ward:
    """A service that stores so many studies."""

    def __init__(self, options, folder, studies, database, scan):
        self.studies, self.database = studies, database
        data = os.path.join(folder, f"data-{studies}")
        self.database = database(data, studies)
        self.service = Service(options.program, data, *FLAGS, *self.database.flags)
        self.connection = None
        try:
            self.fill(scan)
            self.service.start()
            self.volume = self.asked("POST", "/v1/volumes", nifti(8, [0] * 512))["id"]
        except BaseException:
            self.service.kill()
            raise

    def asked(self, method, path, body=None):
        """The document of an answer, over one connection that stays."""
        if self.connection is None:
            self.connection = http.client.HTTPConnection("127.0.0.1", self.service.port, timeout=120)
        self.connection.request(method, path, body, JSON if isinstance(body, str) else {})
        answer = self.connection.getresponse()
        content = answer.read()
        assert answer.status < 300, f"{method} {path}: {answer.status} {content[:300]}"
        is_json = answer.headers.get("content-type", "").startswith("application/json")
        return json.loads(content) if is_json else content

    def ended(self, job):
        while (job := self.asked("GET", f"/v1/jobs/{job['id']}"))["state"] not in FINAL:
            time.sleep(0.01)
        return job

    def fill(self, scan):
        """One study through the service, the others from its rows."""
        tags = f"external_id=X{NUMBER}&labels=study:{NUMBER}"
        volume = self.asked("POST", f"/v1/volumes?{tags}", scan)["id"]
        stated = {"study_uid": f"1.2.826.{NUMBER}", "accession_number": f"A{NUMBER}", "patient_id": f"P{NUMBER}"}
        self.asked("PUT", f"/v1/volumes/{volume}/identity", json.dumps(stated))
        order = {"kind": "model", "volume": volume, "parameters": {"points": 67}}
        order |= {"external_id": f"X{NUMBER}", "labels": {"study": NUMBER}}
        job = self.ended(self.asked("POST", "/v1/jobs", json.dumps(order)))
        assert job["state"] == "succeeded", job
        self.connection.close()
        self.connection = None
        self.service.stop()
        model = job["links"]["model"].rsplit("/", 1)[1]
        self.multiply([volume, model, job["id"]])

    def multiply(self, ids):
        database = self.database
        database.open()
        inserts = [self.insert(table, key, ids) for table, key in STUDY_TABLES]
        # The study with the number 0 is the one that is there.
        for first in range(1, self.studies, BATCH_STUDIES):
            last = min(first + BATCH_STUDIES, self.studies) - 1
            numbers = database.numbers.format(first, last)
            database.run([of_table.replace("NUMBERS", numbers) for of_table in inserts])
        self.record(ids[2])
        ((wrong,),) = database.rows(WRONG_TOTALS)
        assert wrong == "0", "the totals are not the sums"
        database.close()

    def insert(self, table, key, ids):
        """A statement that inserts rows like those of the items for each of the numbers."""
        database = self.database
        columns = database.columns(table)
        among = ", ".join(map(quoted, ids))
        found = database.rows(f"SELECT {', '.join(columns)} FROM {table} WHERE {key} IN ({among})")
        assert found, table

        def of_number(value):
            text = quoted(value)
            for item in ids:
                if item in text:
                    text = f"replace({text}, '{item}', '{item.split('_')[0]}_' || {database.hexadecimal})"
            return f"replace({text}, '{NUMBER}', CAST(n AS TEXT))" if NUMBER in text else text

        def typed(name, text):
            # PostgreSQL takes the text of a number only where nothing was done to it.
            return text if "replace" in text else f"CAST({text} AS {self.type_of(table, name)})"

        rows = []
        for row in found:
            values = [typed(name, of_number(value)) for name, value in zip(columns, row)]
            rows.append(f"SELECT {', '.join(values)} FROM numbers")
        return f"INSERT INTO {table} ({', '.join(columns)}) NUMBERS {' UNION ALL '.join(rows)}"

    def type_of(self, table, column):
        if isinstance(self.database, OnSqlite):
            found = self.database.database.execute(f"PRAGMA table_info({table})")
            return next(kind for _, name, kind, *_ in found if name == column)
        of_column = f"table_name = '{table}' AND column_name = '{column}'"
        return self.database.rows(f"SELECT data_type FROM information_schema.columns WHERE {of_column}")[0][0]

    def record(self, job):
        """The audit trail of as many studies: rows like those of the first, in one chain."""
        events = [event for (event,) in self.database.rows("SELECT event FROM audit ORDER BY sequence")]
        ((end, hash),) = self.database.rows("SELECT sequence, hash FROM audit ORDER BY sequence DESC LIMIT 1")
        sequence, values = int(end), []
        for number in range(1, self.studies):
            for event in events:
                sequence += 1
                event = event.replace(job, f"job_{number:032x}")
                hash = hashlib.sha256(hash.encode() + sequence.to_bytes(8, "big") + event.encode()).hexdigest()
                values.append(f"({sequence}, {quoted(event)}, {quoted(hash)})")
        for first in range(0, len(values), 1000):
            rows = ", ".join(values[first : first + 1000])
            self.database.run([f"INSERT INTO audit (sequence, event, hash) VALUES {rows}"])

    def file(self, _):
        order = {"kind": "model", "volume": self.volume, "parameters": {"points": 67}}
        return self.asked("POST", "/v1/jobs", json.dumps(order))

    def list(self, _):
        for kind in ("volumes", "models", "jobs"):
            page = self.asked("GET", f"/v1/{kind}?limit=20")
            assert len(page[kind]) == 20, (kind, page)

    def search(self, number):
        for kind, query in (
            ("volumes", f"accession=A{number}"),
            ("models", f"study=1.2.826.{number}"),
            ("volumes", f"labels=study:{number}"),
            ("jobs", f"external_id=X{number}"),
        ):
            found = self.asked("GET", f"/v1/{kind}?{query}")[kind]
            assert len(found) == 1, (kind, query, found)

    def scrape(self, _):
        assert f'kind="volume"}} {self.studies + 1}' in self.asked("GET", "/metrics").decode()

    def statements(self):
        """The times of each statement that its log tells of, in ms, by the text."""
        times = {}
        for line in self.service.said().splitlines():
            if '"sqlx::query"' not in line:
                continue
            fields = json.loads(line)["fields"]
            text = fields.get("db.statement") or fields["summary"]
            times.setdefault(" ".join(text.split()), []).append(float(fields["elapsed_secs"]) * 1e3)
        return times


def timed(work, argument):
    begun = time.perf_counter()
    done = work(argument)
    return (time.perf_counter() - begun) * 1e3, done


def ask_in_turn(few, many, turns):
    """The times of requests in ms: for each operation a list of pairs."""
    pairs = {name: [] for name in ("job", "list", "search", "scrape")}
    numbers = random.Random(1)
    for turn in range(turns):
        number = numbers.randrange(1, few.studies)
        for name, times in pairs.items():
            pair = {}
            for ward in (few, many) if turn % 2 else (many, few):
                work = {"job": ward.file, "list": ward.list, "search": ward.search, "scrape": ward.scrape}[name]
                pair[ward], done = timed(work, number)
                if name == "job":
                    ward.ended(done)
            times.append((pair[few], pair[many]))
    # The first of each make plans and fill caches.
    return {name: times[turns // 10 :] for name, times in pairs.items()}


def undisturbed(times):
    """What the least fifth of the times takes: a busy processor doubles the median of a short one."""
    return sorted(times)[(len(times) - 1) // 5]


def of_statements(times, pattern):
    """The time of the statements that match, together."""
    found = [undisturbed(of_one) for text, of_one in times.items() if pattern.search(text)]
    assert found, f"the log tells of no statement {pattern.pattern}"
    return sum(found)


def compare(few, many, options):
    """Prints what each operation takes. Returns those that take too long."""
    begun = time.monotonic()
    pairs = ask_in_turn(few, many, options.turns)
    # A few rounds of the upkeep.
    time.sleep(max(0, options.rounds * ROUND_SECONDS - (time.monotonic() - begun)))
    rows = []
    for name, times in pairs.items():
        with_few, with_many = (undisturbed(of_ward) for of_ward in zip(*times))
        rows.append((name, with_few, with_many - with_few))
    by_few, by_many = few.statements(), many.statements()
    for name, pattern in (("claim", CLAIM), ("sweep", SWEEP)):
        with_few = of_statements(by_few, pattern)
        rows.append((name, with_few, of_statements(by_many, pattern) - with_few))
    slow = []
    for name, with_few, more in rows:
        ratio = 1 + more / with_few
        bad = ratio > MOST_RATIO and more > RESOLUTION_MS
        slow += [name] * bad
        print(f"  {name:7} {with_few:8.2f} -> {with_few + more:8.2f} ms  {ratio:5.2f} x{'  TOO SLOW' if bad else ''}")
    for text in sorted(by_few.keys() & by_many.keys()):
        a, b = undisturbed(by_few[text]), undisturbed(by_many[text])
        enough = min(len(by_few[text]), len(by_many[text])) >= 5
        if enough and b > MOST_RATIO * a and b - a > RESOLUTION_MS:
            print(f"  grows: {a:.2f} -> {b:.2f} ms ({len(by_many[text])} times): {text[:140]}")
    return slow


def measure(options, engine, folder, scan):
    server = Postgres(folder, settings=["fsync=off"]) if engine == "postgres" else None
    wards = []
    try:

        def database(data, studies):
            return OnPostgres(server, f"studies_{studies}") if server else OnSqlite(data)

        for studies in (options.few, options.many):
            begun = time.monotonic()
            wards.append(Ward(options, folder, studies, database, scan))
            print(f"{engine}: {studies} studies, made in {time.monotonic() - begun:.0f} s", flush=True)
        return compare(*wards, options)
    finally:
        for ward in wards:
            ward.service.stop()
        if server:
            server.process.terminate()
            server.process.wait()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/ventriform")
    parser.add_argument("--few", type=int, default=1000)
    parser.add_argument("--many", type=int, default=100_000)
    parser.add_argument("--turns", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=10, help="rounds of the upkeep that are waited for, of 30 s each")
    parser.add_argument("--engine", choices=["sqlite", "postgres"], help="one of them alone")
    options = parser.parse_args()
    options.program = os.path.abspath(options.program)
    slow = []
    for engine in [options.engine] if options.engine else ["sqlite", "postgres"]:
        folder = tempfile.mkdtemp(prefix="ventriform-stored-")
        # PostgreSQL runs as another user.
        os.chmod(folder, 0o755)
        try:
            made = [options.program, "phantom", "--size", "64", "--spacing", "6.4", "-o", folder]
            subprocess.run(made, check=True, capture_output=True)
            with open(f"{folder}/spect.nii.gz", "rb") as file:
                scan = file.read()
            slow += [f"{name} ({engine})" for name in measure(options, engine, folder, scan)]
        finally:
            shutil.rmtree(folder)
    if slow:
        sys.exit(f"more than {MOST_RATIO} times as long with {options.many} studies: {', '.join(slow)}")


if __name__ == "__main__":
    main()
