#!/usr/bin/env python3
"""The service on PostgreSQL behind PgBouncer, each of which this script starts for itself.

    scripts/check/pgbouncer.py --program target/debug/ventriform          (scripts/check/pgbouncer.sh installs both)

In session mode with PgBouncer's defaults the service starts and computes, each session has its limits before it reads
or writes anything, a lock that somebody holds ends a request in time, and a PgBouncer that is started anew is found
again. In the other modes, and where PgBouncer refuses a connection, the service ends at once, and its message begins
with the cause. Uses the standard library alone; the last line counts the checks."""

import argparse
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from lib.servers import AS_POSTGRES, Postgres
from lib.service import Service, free_port

MOST_SECONDS = 60
passed = failed = 0


def check(fine, what, *more):
    global passed, failed
    passed, failed = passed + bool(fine), failed + (not fine)
    print(("ok: " if fine else "FAILED: ") + what, *([] if fine else more), flush=True)


def until(condition, what, seconds=MOST_SECONDS):
    end = time.time() + seconds
    while time.time() < end:
        if condition():
            return True
        time.sleep(0.05)
    print(f"waited in vain: {what}")
    return False


def answers(port):
    try:
        socket.create_connection(("127.0.0.1", port), 1).close()
        return True
    except OSError:
        return False


def statements(log):
    """For each process of the server the statements in order, each with the line of its values."""
    found, last = {}, None
    for line in open(log, errors="replace"):
        match = re.match(r"(\d+) (LOG|DETAIL):  (?:execute [^:]*: |statement: |parameters: )(.*)", line, re.I)
        if match and match[2] == "LOG":
            last = found.setdefault(match[1], [])
            last.append(match[3])
        elif match and last:
            last[-1] += " -- " + match[3]
    return found


class PgBouncer:
    def __init__(self, folder, postgres, mode, settings="", auth="trust"):
        self.port, self.folder = free_port(), folder
        users, ini = folder + "/users", folder + "/pgbouncer.ini"
        open(users, "w").write('"ventriform" "right"\n')
        open(ini, "w").write(f"""[databases]
ventriform = host=127.0.0.1 port={postgres.port} user=ventriform
[pgbouncer]
listen_addr = 127.0.0.1
listen_port = {self.port}
unix_socket_dir =
auth_type = {auth}
auth_file = {users}
pool_mode = {mode}
{settings}
""")
        self.command = [*AS_POSTGRES, shutil.which("pgbouncer", path=os.environ["PATH"] + ":/usr/sbin"), "-q", ini]
        self.start()

    def start(self):
        self.log = open(self.folder + "/pgbouncer.log", "ab")
        self.process = subprocess.Popen(self.command, cwd="/", stdout=self.log, stderr=self.log)
        until(lambda: answers(self.port), "PgBouncer")

    def end(self):
        # What ends it at once, clients or not, depends on its version.
        self.process.kill()
        self.process.wait(MOST_SECONDS)

    def url(self, user="ventriform", database="ventriform", more=""):
        return f"postgres://{user}@127.0.0.1:{self.port}/{database}?sslmode=disable{more}"


def start(program, folder, url):
    return Service(
        program,
        folder + "/data",
        "--workers",
        "1",
        "--database",
        url,
        "--database-wait",
        "60s",
        "--min-free",
        "0B",
        "--wait-limit",
        "10m",
        log=folder + "/service.log",
        wait=False,
    )


def ask(service, *request):
    try:
        return service.ask(*request, timeout=660)
    except OSError as error:
        return 0, str(error).encode()


def refusal(service):
    """What it says, once it has ended, and after how many seconds that was."""
    try:
        status = service.process.wait(40)
    except subprocess.TimeoutExpired:
        service.kill()
        return "it goes on: " + service.said()[-600:], 40
    said = service.said().strip().splitlines() or [""]
    return f"status {status}: {said[-1]}", time.perf_counter() - service.started


def session_mode(program, folder, postgres, scan):
    # Few connections to the server, so that each has several clients one after the other.
    pooler = PgBouncer(folder, postgres, "session", "default_pool_size = 18")
    service = start(program, folder, pooler.url())
    try:
        check(until(service.is_ready, "the service"), "session mode: the service starts", service.said()[-600:])
        made = ask(service, "POST", "/v1/models?points=100", scan, {"Prefer": "wait=600"})[0]
        check(made in (200, 201, 303), "session mode: a model is made", made)
        statuses = {ask(service, "GET", "/v1/jobs")[0] for _ in range(100)}
        check(statuses == {200}, "session mode: a hundred lists", statuses)

        # Somebody holds a lock: the session's limit ends the wait.
        command = [
            postgres.bin + "psql",
            *postgres.place(),
            "-qc",
            "BEGIN; LOCK TABLE jobs; SELECT pg_sleep(60)",
            "ventriform",
        ]
        holder = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        until(lambda: ["AccessExclusiveLock"] in postgres.query("SELECT mode FROM pg_locks"), "the lock")
        since = time.time()
        status = ask(service, "GET", "/v1/jobs?limit=3")[0]
        took = time.time() - since
        check(status == 503 and took < 30, "session mode: a lock ends a request by lock_timeout", status, took)
        holder.kill()
        holder.wait()
        postgres.query(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE query LIKE '%pg_sleep%' AND pid != "
            "pg_backend_pid()"
        )
        check(until(service.is_ready, "readiness"), "session mode: ready again after the lock")

        pooler.end()
        away = until(lambda: ask(service, "GET", "/readyz")[0] == 503, "the loss")
        check(away, "PgBouncer is away: not ready")
        pooler.start()
        check(until(service.is_ready, "readiness"), "PgBouncer is back: ready again")
        check(ask(service, "GET", "/v1/models")[0] == 200, "PgBouncer is back: lists are read")
        # The sessions of the pool, one after the other in each process of the server: limits first.
        sessions = unlimited = 0
        for session in statements(postgres.log).values():
            limited = None
            for text in session:
                if "DISCARD ALL" in text:
                    limited = None
                elif "set_config(name, value" in text:
                    names = [
                        "lock_timeout",
                        "statement_timeout",
                        "idle_in_transaction_session_timeout",
                        "ventriform.run",
                    ]
                    limited = all(name in text for name in names)
                    sessions += limited
                elif (
                    re.search(r"\b(FROM|INTO|UPDATE) (jobs|volumes|holdings|products)\b", text)
                    and "LOCK TABLE" not in text
                ):
                    # The start, which makes the tables, has no limit of time; nor has what this script asks.
                    unlimited += limited is False and "FROM jobs" in text
        check(sessions > 1, "session mode: sessions with all limits", sessions)
        check(unlimited == 0, "session mode: nothing is read before the limits are set", unlimited)
    finally:
        service.stop()
        pooler.end()


def refused(program, folder, postgres):
    for mode in ["transaction", "statement"]:
        pooler = PgBouncer(folder, postgres, mode)
        said, seconds = refusal(start(program, folder, pooler.url()))
        pooler.end()
        check(
            "status 0" not in said and "pool_mode = session" in said and seconds < 20,
            f"{mode} mode is refused: {said}",
            seconds,
        )
    for what, auth, more, begins in [
        (
            "a parameter that it does not know",
            "trust",
            dict(more="&options=-c%20statement_timeout%3D5000"),
            "unsupported startup parameter",
        ),
        ("a database that it does not have", "trust", dict(database="elsewhere"), "no such database"),
        (
            "a user whom it does not know",
            "scram-sha-256",
            dict(user="stranger:x"),
            "(no such user|.*authentication failed)",
        ),
        ("a wrong password", "scram-sha-256", dict(user="ventriform:wrong"), "(password|SASL) authentication failed"),
    ]:
        pooler = PgBouncer(folder, postgres, "session", auth=auth)
        said, seconds = refusal(start(program, folder, pooler.url(**more)))
        pooler.end()
        quoted = re.match(r"status [^0]\d*: ([Ee]rror: |ventriform: )?(data folder [^:]*: |database: )?" + begins, said)
        check(quoted and seconds < 20, f"{what} is refused: {said}", seconds)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True)
    program = os.path.abspath(parser.parse_args().program)
    folder = tempfile.mkdtemp(prefix="ventriform-pgbouncer-", dir="/tmp")
    if AS_POSTGRES:
        shutil.chown(folder, "postgres", "postgres")
    postgres = Postgres(folder, settings=["fsync=off", "log_statement=all", "log_line_prefix=%p "])
    try:
        subprocess.run([program, "phantom", "-o", folder + "/scan"], check=True, capture_output=True)
        scan = open(folder + "/scan/spect.nii.gz", "rb").read()
        refused(program, folder, postgres)
        session_mode(program, folder, postgres, scan)
    finally:
        postgres.end(signal.SIGINT)
    if failed:
        print("logs:", folder)
    else:
        shutil.rmtree(folder)
    print(json.dumps({"passed": passed, "failed": failed}))
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
