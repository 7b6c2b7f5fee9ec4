#!/usr/bin/env python3
"""Measures what several replicas do on this machine; docs/scale.md says what it gave.

    scripts/measure/bench_scale.py [--program target/release/ventriform] [--jobs 120] [--rows 1000000]

One replica that answers requests, over PostgreSQL and an S3 store (moto).
1. Jobs per second (models of 67 points) with 1, 2 and 4 workers of one thread, in turn, three times.
2. Uploads of 8 MiB through the replica, beside PUTs of the same bytes to the store itself, in turn.
3. Lists, figures and jobs per second with few jobs and with ROWS ended ones in the table, and its size.
4. With ROWS ended jobs: 100 claims a second, and 1, 2 and 4 processes whose jobs sleep (benches/queue.rs).
Prints medians; quiet machines only. Needs what scripts/check/chaos.py needs.
"""

import argparse
import gzip
import http.client
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from lib.servers import Postgres, run, s3_server
from lib.service import ROOT, Service


class Bench:
    def __init__(self, options, folder):
        self.program, self.folder, self.options = options.program, folder, options
        run(options.program, "phantom", "--size", "64", "--spacing", "6.4", "-o", folder)
        with open(f"{folder}/spect.nii.gz", "rb") as file:
            self.scan = gzip.decompress(file.read())
        self.postgres = Postgres(folder, ["127.0.0.1"], ["shared_preload_libraries=pg_stat_statements"])
        self.postgres.query("CREATE EXTENSION pg_stat_statements")
        self.store, self.store_port = s3_server()
        os.environ |= {
            "AWS_ACCESS_KEY_ID": "bench",
            "AWS_SECRET_ACCESS_KEY": "bench",
            "AWS_REGION": "us-east-1",
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{self.store_port}",
        }
        self.count = 0
        self.api = self.start("api")

    def start(self, role):
        self.count += 1
        return Service(
            self.program,
            f"{self.folder}/{role}-{self.count}",
            "--role",
            role,
            "--workers",
            "1",
            "--database",
            self.postgres.url("127.0.0.1"),
            "--blobs",
            "s3://hearts/bench",
            "--queue-limit",
            "1000000",
        )

    def jobs_per_second(self, workers, seed):
        """All jobs are waiting when the workers start; the time is from the first start to the last end."""
        body = bytearray(self.scan)
        body[-4:] = seed.to_bytes(4, "little")
        volume = self.api.json("POST", "/v1/volumes", bytes(body))[1]["id"]
        for number in range(self.options.jobs):
            order = {"kind": "model", "volume": volume, "parameters": {"points": 67, "seed": 1000 * seed + number}}
            status, _ = self.api.json("POST", "/v1/jobs", json.dumps(order), {"content-type": "application/json"})
            assert status == 202, status
        services = [self.start("worker") for _ in range(workers)]
        while int(self.postgres.query("SELECT count(*) FROM jobs WHERE state IN ('queued', 'running')")[0][0]):
            time.sleep(0.05)
        for service in services:
            service.stop()
        # The first and the last tenth are left out: workers start and end one after the other.
        rows = self.postgres.query(
            f"SELECT finished_at FROM jobs WHERE volume = '{volume}' AND state = 'succeeded' ORDER BY 1"
        )
        ends = [int(row[0]) for row in rows]
        assert len(ends) == self.options.jobs, f"{len(ends)} succeeded"
        cut = len(ends) // 10
        ends = ends[cut:-cut]
        return (len(ends) - 1) / (ends[-1] - ends[0]) * 1e3

    def throughput(self):
        found = {1: [], 2: [], 4: []}
        for turn in range(3):
            for workers, rates in found.items():
                rates.append(self.jobs_per_second(workers, 10 * turn + workers))
        for workers, rates in found.items():
            print(
                f"{workers} workers: {statistics.median(rates):.2f} jobs/s, "
                f"{statistics.median(rates) / workers:.2f} each "
                f"({', '.join(f'{rate:.2f}' for rate in rates)})",
                flush=True,
            )

    def uploads(self):
        def put(number):
            connection = http.client.HTTPConnection("127.0.0.1", self.store_port)
            connection.request("PUT", f"/hearts/plain/{number}", self.large(number))
            assert connection.getresponse().read() is not None
            connection.close()

        def post(number):
            assert self.api.ask("POST", "/v1/volumes", self.large(number))[0] == 201

        times = {"store itself": [], "replica": []}
        for number in range(40):
            for name, act in (("store itself", put), ("replica", post)):
                started = time.perf_counter()
                act(number)
                times[name].append(time.perf_counter() - started)
        medians = {name: statistics.median(all) for name, all in times.items()}
        for name, median in medians.items():
            print(f"8 MiB to the {name}: median {median * 1e3:.0f} ms", flush=True)
        print(f"ratio {medians['store itself'] / medians['replica']:.2f}", flush=True)

    def large(self, number):
        """A volume of 128 x 128 x 256 voxels of 16 bits."""
        head = bytearray(self.scan[:352])
        head[40:56] = b"".join(n.to_bytes(2, "little") for n in (3, 128, 128, 256, 1, 1, 1, 1))
        head[70:74] = (4).to_bytes(2, "little") + (16).to_bytes(2, "little")
        body = bytearray(os.urandom(1 << 16) * 128)
        body[:4] = number.to_bytes(4, "little")
        return bytes(head + body)

    def lists(self, when):
        for path in ("/v1/jobs?limit=100", "/v1/jobs?state=queued&limit=100", "/metrics"):
            times = []
            for _ in range(100):
                started = time.perf_counter()
                assert self.api.ask("GET", path)[0] == 200
                times.append(time.perf_counter() - started)
            print(
                f"{when}, GET {path}: median {statistics.median(times) * 1e3:.1f} ms, p99 "
                f"{sorted(times)[98] * 1e3:.1f} ms",
                flush=True,
            )

    def copies(self, state, count):
        """Rows of jobs in the table, like one that succeeded."""
        columns = self.postgres.query(
            "SELECT column_name FROM information_schema.columns WHERE table_name = 'jobs' "
            "AND column_name NOT IN ('sequence', 'id', 'idempotency_key', 'state')"
        )
        rest = ", ".join(row[0] for row in columns)
        # Without triggers: a million notifications would keep the replicas busy for minutes.
        self.postgres.query(
            "SET session_replication_role = replica; "
            f"INSERT INTO jobs (id, state, {rest}) SELECT 'job_' || md5('{state}' || n), '{state}', {rest} "
            f"FROM (SELECT * FROM jobs WHERE state = 'succeeded' LIMIT 1) one, generate_series(1, {count}) n"
        )
        # What the server does after so many rows at once is no part of any figure.
        self.postgres.query("VACUUM (ANALYZE) jobs")
        self.postgres.query("CHECKPOINT")

    def full_tables(self):
        self.lists("few jobs")
        count = (
            "SELECT xact_commit, pg_current_wal_lsn() - '0/0', (SELECT sum(calls) FROM pg_stat_statements "
            "WHERE query LIKE '%pg_advisory_xact_lock%') FROM pg_stat_database WHERE datname = 'ventriform'"
        )
        time.sleep(1)
        start = [float(part) for part in self.postgres.query(count)[0]]
        before = self.jobs_per_second(2, 101)
        time.sleep(1)
        transactions, written, alone = (
            (float(end) - start) / self.options.jobs for end, start in zip(self.postgres.query(count)[0], start)
        )
        print(
            f"a job: {transactions:.1f} transactions (idle polls among them), {alone:.1f} of them one after the other, "
            f"{written / 1024:.1f} KiB of write-ahead log",
            flush=True,
        )
        self.copies("succeeded", self.options.rows)
        table, indexes, rows = map(
            int, self.postgres.query("SELECT pg_table_size('jobs'), pg_indexes_size('jobs'), count(*) FROM jobs")[0]
        )
        print(f"{rows} jobs: {table / rows:.0f} bytes a row, {indexes / rows:.0f} bytes of indexes", flush=True)
        self.lists(f"{rows} jobs")
        after = self.jobs_per_second(2, 102)
        print(f"2 workers: {before:.2f} jobs/s before, {after:.2f} with {rows} ended jobs in the table", flush=True)

    def sleepers(self):
        environment = {
            **os.environ,
            "VENTRIFORM_DATABASE": self.postgres.url("127.0.0.1"),
            "VENTRIFORM_BLOBS": "s3://hearts/bench",
        }
        subprocess.run(["cargo", "bench", "--quiet", "--bench", "queue"], cwd=ROOT, env=environment, check=True)

    def end(self):
        self.api.kill()
        self.store.kill()
        self.postgres.process.kill()
        self.postgres.process.wait()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=os.path.join(ROOT, "target/release/ventriform"))
    parser.add_argument("--jobs", type=int, default=120)
    parser.add_argument("--rows", type=int, default=1_000_000)
    options = parser.parse_args()
    folder = tempfile.mkdtemp(prefix="ventriform-scale-")
    os.chmod(folder, 0o755)
    bench = Bench(options, folder)
    try:
        bench.throughput()
        bench.uploads()
        bench.full_tables()
        bench.sleepers()
    finally:
        bench.end()
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
