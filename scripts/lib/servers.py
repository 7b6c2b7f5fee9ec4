"""Servers of other programs as processes of a script's own: PostgreSQL, and S3 by moto."""

import glob
import os
import shutil
import subprocess
import sys
import time

from .service import free_port

START_SECONDS = 60
STOP_SECONDS = 60
# Neither PostgreSQL nor PgBouncer runs as root.
AS_POSTGRES = ["setpriv", "--reuid=postgres", "--regid=postgres", "--clear-groups"] if os.getuid() == 0 else []


def run(*command, **options):
    """What a command prints; an error if it fails."""
    return subprocess.run(command, check=True, capture_output=True, text=True, **options).stdout


def s3_server():
    """Starts moto with the bucket `hearts`; the process and its port."""
    port = free_port()
    process = subprocess.Popen(
        [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    bucket = ["curl", "-fs", "-X", "PUT", f"http://127.0.0.1:{port}/hearts"]
    for _ in range(300):
        if subprocess.run(bucket, capture_output=True).returncode == 0:
            return process, port
        time.sleep(0.1)
    process.kill()
    raise SystemExit("moto does not start")


class Postgres:
    """A database server with the database `ventriform`, on the given addresses of this machine.

    `settings` are its own (`fsync=off`), `others` are addresses from which it may be reached, too. Its log is
    FOLDER/postgres.log.
    """

    def __init__(self, folder, addresses=("127.0.0.1",), settings=(), others=()):
        self.bin = sorted(glob.glob("/usr/lib/postgresql/*/bin"))[-1] + "/"
        self.data, self.log, self.port = folder + "/postgres", folder + "/postgres.log", None
        settings = ["listen_addresses=" + ",".join(addresses), "unix_socket_directories=", *settings]
        self.settings = [word for setting in settings for word in ("-c", setting)]
        os.makedirs(self.data)
        if AS_POSTGRES:
            shutil.chown(self.data, "postgres", "postgres")
        run(
            *AS_POSTGRES,
            self.bin + "initdb",
            "-A",
            "trust",
            "-U",
            "ventriform",
            "-E",
            "UTF8",
            "--no-locale",
            "-N",
            self.data,
            cwd="/",
        )
        with open(self.data + "/pg_hba.conf", "a") as file:
            file.writelines(f"host all all {address}/32 trust\n" for address in others)
        self.start()
        self.query("CREATE DATABASE ventriform", "postgres")

    def start(self):
        """Starts the server; again as long as something is left of one that was killed, or has taken the port."""
        deadline = time.time() + START_SECONDS
        self.process, keeps_port = None, self.port is not None
        while time.time() < deadline:
            if self.process is None or self.process.poll() is not None:
                if not keeps_port:
                    self.port = free_port()
                command = [*AS_POSTGRES, self.bin + "postgres", "-D", self.data, "-p", str(self.port), *self.settings]
                with open(self.log, "ab") as log:
                    self.process = subprocess.Popen(command, cwd="/", stdout=log, stderr=log)
            if subprocess.run([self.bin + "pg_isready", "-q", *self.place()]).returncode == 0:
                return
            time.sleep(0.05)
        raise SystemExit(f"PostgreSQL does not start; see {self.log}")

    def place(self):
        """The flags by which its own programs reach it."""
        return ["-h", "127.0.0.1", "-p", str(self.port), "-U", "ventriform"]

    def query(self, text, database="ventriform"):
        """The rows, each a list of texts."""
        out = run(self.bin + "psql", *self.place(), "-Atqc", text, database)
        return [line.split("|") for line in out.splitlines()]

    def url(self, address="127.0.0.1"):
        return f"postgres://ventriform@{address}:{self.port}/ventriform?sslmode=disable"

    def end(self, how):
        """Ends it by a signal."""
        self.process.send_signal(how)
        self.process.wait(STOP_SECONDS)
