"""The service as a process of a script's own: started on ports that are free, asked over HTTP, killed and started
again.

Needs Python and nothing else. Its log is DATA.log unless another is named.
"""

import http.client
import json
import os
import re
import socket
import ssl
import subprocess
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
# States in which a job stays.
FINAL = ("succeeded", "failed", "cancelled")
# Long, for machines that do much else.
START_SECONDS = 120
GET_SECONDS = 120
STOP_SECONDS = 60
LOOK_SECONDS = 0.002
# What `ventriform serve` prints once it listens.
LISTENING = re.compile(r"Listening on (https?://127\.0\.0\.1:(\d+)) .*?(?:for DICOM on 127\.0\.0\.1:(\d+))?\n")


def free_port():
    """A port of this machine that nothing listens on, for programs that take no port 0."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def reader_profile():
    """A reader's profile as the service takes it, by distances from the apparent wall."""
    offset = {"value": 0.5, "mean": 0.7, "spread": 0.3}
    return {
        "format": "ventriform-reader-profile",
        "version": 2,
        "kind": "edge",
        "edge": "apparent",
        "masks": 1,
        "offsets_mm": {"endocardium": offset, "epicardium": offset, "rim": offset},
        "learnt_on": [{"scan": "a" * 64, "mask": "b" * 64}],
    }


class Service:
    """`ventriform serve` on a data folder.

    `prefix` are words before the program (`ip netns exec ...`), `environment` further variables. With `dicom` it
    receives C-STORE, too. With `wait=False` nothing is known of it but its process.
    """

    def __init__(self, program, data, *flags, log=None, prefix=(), environment=None, dicom=False, wait=True):
        self.program, self.data = str(program), str(data)
        self.log = str(log) if log else self.data + ".log"
        listen = ["--listen", "127.0.0.1:0", *(["--dicom-listen", "127.0.0.1:0"] if dicom else [])]
        self.command = [*prefix, self.program, "serve", *listen, "--data-dir", self.data, *map(str, flags)]
        self.environment = {**os.environ, **(environment or {})}
        self.start(wait)

    def start(self, wait=True):
        """Starts the program, again after `kill` or `stop`: on other ports."""
        self.url = self.port = self.dicom_port = None
        self.started = time.perf_counter()
        with open(self.log, "ab") as log:
            self.begin = log.tell()
            self.process = subprocess.Popen(self.command, stdout=log, stderr=log, env=self.environment)
        if wait:
            self.wait_until_ready()
            self.ready_ms = (time.perf_counter() - self.started) * 1e3

    def wait_until_ready(self):
        while not (self.listens() and self.is_ready()):
            if self.process.poll() is not None:
                raise SystemExit(f"the service ended: {self.said()[-600:]}")
            if time.perf_counter() - self.started > START_SECONDS:
                self.kill()
                raise SystemExit(f"not ready after {START_SECONDS} s: {self.said()[-600:]}")
            time.sleep(LOOK_SECONDS)

    def listens(self):
        """Whether it has printed its addresses, which are known then."""
        if self.url is None and (found := LISTENING.search(self.said())):
            self.url, self.port = found[1], int(found[2])
            self.dicom_port = int(found[3]) if found[3] else None
        return self.url is not None

    def said(self):
        """Its log since the last start."""
        with open(self.log, "rb") as log:
            log.seek(self.begin)
            return log.read().decode(errors="replace")

    def is_ready(self):
        try:
            return self.listens() and self.ask("GET", "/readyz", timeout=2)[0] == 200
        except OSError:
            return False

    def ask(self, method, path, body=None, headers=None, timeout=30):
        """Status and body of the answer. OSError if there was none."""
        if self.url.startswith("https:"):
            # Its certificate is for other names.
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
            context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
            connection = http.client.HTTPSConnection("127.0.0.1", self.port, timeout=timeout, context=context)
        else:
            connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=timeout)
        try:
            connection.request(method, path, body, headers or {})
            answer = connection.getresponse()
            return answer.status, answer.read()
        except http.client.HTTPException as error:
            raise OSError(str(error)) from error
        finally:
            connection.close()

    def json(self, *request, **options):
        """Status and document of the answer, None without a body."""
        status, body = self.ask(*request, **options)
        return status, json.loads(body) if body else None

    def get(self, path):
        """The document at a path."""
        status, body = self.ask("GET", path, timeout=GET_SECONDS)
        assert status == 200, f"GET {path}: {status} {body[:300]}"
        return json.loads(body)

    def figure(self, name):
        """What the system says of the process, such as `VmHWM` in KiB or `Threads`."""
        with open(f"/proc/{self.process.pid}/status") as status:
            return int(re.search(name + r":\s+(\d+)", status.read())[1])

    def processor_time(self):
        """Seconds that the process has computed."""
        with open(f"/proc/{self.process.pid}/stat") as stat:
            user, system = stat.read().rpartition(")")[2].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")

    def kill(self):
        self.process.kill()
        self.process.wait()

    def stop(self, seconds=STOP_SECONDS):
        """Ends it in order, or else kills it; its exit status."""
        self.process.terminate()
        try:
            return self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.kill()
            raise


def make_key(program, data, scope, *flags):
    """A new key of this scope for the service that has or will have this data folder."""
    command = [program, "keys", "create", "--name", scope, "--scope", scope, "--data-dir", data, *flags]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()[-1]
