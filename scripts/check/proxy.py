#!/usr/bin/env python3
"""Asks services of its own through nginx: uploads, early refusals, waiting, events, paths, TLS, idle connections.

    scripts/check/proxy.py target/debug/ventriform FOLDER

See proxy.sh. nginx has its defaults unless a check is about another setting. What is right: every client gets the
service's own answer (nginx answers 502 or 504 where it got none), at once, with addresses that the client can use.
"""

import collections
import http.client
import json
import os
import re
import socket
import ssl
import subprocess
import sys
import threading
import time
import urllib.parse

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
from lib.service import Service, free_port, make_key

PROGRAM, FOLDER = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
# Long, for machines that do much else.
PATIENCE = 300
# Refusals during uploads through nginx, in all.
ROUNDS = 200
# What nginx cannot hold in the buffers of its sockets.
LARGE = bytes(12 << 20)
children, failures = [], 0


def check(condition, what):
    global failures
    print(f"{'ok' if condition else 'FAILED'}: {what}", flush=True)
    failures += not condition


def listening(port):
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        try:
            socket.create_connection(("127.0.0.1", port), 1).close()
            return
        except OSError:
            time.sleep(0.02)
    sys.exit(f"nothing listens on {port}")


def start(name, *flags, keys=()):
    """A service, with a key for each of these scopes."""
    data = f"{FOLDER}/{name}"
    os.makedirs(data, exist_ok=True)
    made = {scope: make_key(PROGRAM, data, scope) for scope in keys}
    service = Service(PROGRAM, data, "--workers", "1", *flags)
    service.keys = made
    children.append(service.process)
    return service


def nginx(server, outside="", tls=False):
    """Starts nginx with one server; returns its port."""
    port = free_port()
    home = f"{FOLDER}/nginx{port}"
    os.makedirs(home)
    temporary = "".join(
        f"{kind}_temp_path {home}/{kind}; " for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    listen = (
        f"{port} ssl; ssl_certificate {FOLDER}/cert.pem; ssl_certificate_key {FOLDER}/key.pem" if tls else str(port)
    )
    with open(f"{home}/conf", "w") as conf:
        conf.write(
            f"daemon off; pid {home}/pid; worker_processes 1; events {{}}\n"
            f"http {{ access_log off; {temporary}\n{outside}\n"
            f"server {{ listen 127.0.0.1:{listen}; server_name localhost; client_max_body_size 0;\n{server} }} }}\n"
        )
    log = open(f"{home}/log", "w")
    children.append(
        subprocess.Popen(["nginx", "-c", f"{home}/conf", "-p", home, "-e", f"{home}/error"], stdout=log, stderr=log)
    )
    listening(port)
    return port


def ask(port, method, path, body=None, tls=False, **headers):
    """Status, headers and body."""
    kind = http.client.HTTPSConnection if tls else http.client.HTTPConnection
    context = {"context": ssl.create_default_context(cafile=f"{FOLDER}/cert.pem")} if tls else {}
    connection = kind("localhost" if tls else "127.0.0.1", port, timeout=PATIENCE, **context)
    headers = {name.replace("_", "-"): value for name, value in headers.items()}
    try:
        connection.request(method, path, body, headers)
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read()
    finally:
        connection.close()


def proxied(service, rest=""):
    return f"location / {{ proxy_pass http://127.0.0.1:{service.port}; {rest} }}"


def scan():
    subprocess.run(
        [PROGRAM, "phantom", "-o", f"{FOLDER}/phantom", "--size", "32", "--spacing", "6"],
        check=True,
        capture_output=True,
    )
    with open(f"{FOLDER}/phantom/spect.nii.gz", "rb") as file:
        return file.read()


def early_refusals(plain, encrypted):
    """401 and 413 while a body is on its way, with and without nginx's buffer, and with TLS to the service."""
    unbuffered = "proxy_request_buffering off; proxy_http_version 1.1;"
    tls = f"location / {{ proxy_pass https://127.0.0.1:{encrypted.port}; "
    ways = {
        "nginx": (nginx(proxied(plain)), plain),
        "nginx without its buffer": (nginx(proxied(plain, unbuffered)), plain),
        "nginx with TLS to the service": (nginx(tls + "}"), encrypted),
        "nginx without its buffer, with TLS to the service": (nginx(tls + unbuffered + "}"), encrypted),
    }
    for way, (port, service) in ways.items():
        for status, header in ((401, {}), (413, {"authorization": f"Bearer {service.keys['submit']}"})):
            got = collections.Counter(
                ask(port, "POST", "/v1/volumes", LARGE, **header)[0] for _ in range(ROUNDS // len(ways) // 2)
            )
            check(set(got) == {status}, f"{way}: {status} of a large upload, got {dict(got)}")
    got = collections.Counter(ask(plain.port, "POST", "/v1/volumes", LARGE)[0] for _ in range(20))
    check(set(got) == {401}, f"without nginx: 401 of a large upload, got {dict(got)}")


def waiting(service, volume):
    port = nginx(proxied(service, "proxy_read_timeout 4s;"))
    status, headers, _ = ask(
        port, "POST", "/v1/models?points=9000", volume, Prefer="wait=60", Content_Type="application/zip"
    )
    applied = headers.get("preference-applied")
    check(status in (200, 202) and applied == "wait=3", f"a long wait ends before the proxy's: {status}, {applied}")
    printed = subprocess.run([PROGRAM, "serve", "--print-config"], check=True, capture_output=True, text=True).stdout
    seconds = {name: int(value) for name, value in re.findall(r'^(\w+) = "(\d+)s"', printed, re.M)}
    check(seconds["wait_limit"] < 50, f"wait_limit {seconds['wait_limit']} s is below HAProxy's 50 s and nginx's 60 s")
    check(
        seconds["keep_alive_timeout"] > 600,
        f"keep_alive_timeout {seconds['keep_alive_timeout']} s is above what proxies keep",
    )
    # It would keep the only worker.
    for job in json.loads(ask(port, "GET", "/v1/jobs?state=running")[2])["jobs"]:
        ask(port, "DELETE", job["links"]["self"])


def events(service, volume):
    """The first event comes before the last one, which nginx's buffer would join."""
    port = nginx(proxied(service))
    job = json.loads(ask(port, "POST", "/v1/models?points=700&seed=7", volume)[2])
    stream = socket.create_connection(("127.0.0.1", port), PATIENCE)
    begun, times, text = time.monotonic(), [], b""
    stream.sendall(
        f"GET {job['links']['events']} HTTP/1.1\r\nHost: localhost\r\nAccept: text/event-stream\r\n\r\n".encode()
    )
    while b'"state":"succeeded"' not in text and time.monotonic() < begun + PATIENCE:
        piece = stream.recv(65536)
        if not piece:
            break
        text += piece
        times.append(time.monotonic() - begun)
    stream.close()
    check(b'"state":"succeeded"' in text, "events until the end of the job")
    check(
        len(times) > 1 and times[0] < times[-1] / 2 + 0.05,
        f"events come one by one, at {[round(t, 2) for t in times][:6]} s",
    )


def usable(port, page_path, tls, prefix):
    """The page's files, links, commands and document, as a client behind the proxy uses them."""
    scheme = "https" if tls else "http"
    base = f"{scheme}://localhost:{port}"
    for path in (page_path, f"{prefix}/docs", f"{prefix}/docs/"):
        status, _, page = ask(port, "GET", path, tls=tls, accept="text/html")
        names = re.findall(r'(?:src|href)="([^"]+)"', page.decode())
        wanted = [urllib.parse.urlsplit(urllib.parse.urljoin(base + path, name)).path for name in names]
        got = {name: ask(port, "GET", name, tls=tls)[0] for name in wanted}
        check(status == 200 and names and set(got.values()) == {200}, f"files of the page at {path}: {got}")
    script = next(name for name in wanted if name.endswith(".js"))
    check(script.startswith(f"{prefix}/assets/"), f"programs lie under {prefix}: {script}")
    _, _, commands = ask(port, "GET", f"{prefix}/", tls=tls, host=f"localhost:{port}")
    found = re.findall(r"'?(https?://[^/\s']+[^\s']*/v1/jobs)'", commands.decode())
    check(found == [f"{base}{prefix}/v1/jobs"], f"commands: {found}")
    document = json.loads(ask(port, "GET", f"{prefix}/openapi.json", tls=tls)[2])
    servers = [server["url"] for server in document.get("servers", [{"url": ""}])]
    check(servers == [prefix], f"servers of the document: {servers}")
    job = json.loads(ask(port, "GET", f"{prefix}/v1/jobs", tls=tls)[2])["jobs"][0]
    links = [link for link in job["links"].values() if link and not link.endswith("/events")]
    got = {link: ask(port, "GET", link, tls=tls)[0] for link in links}
    check(links and set(got.values()) == {200}, f"links of a job: {got}")
    status, headers, body = ask(
        port,
        "POST",
        f"{prefix}/v1/jobs",
        json.dumps({"kind": "model", "volume": job["volume"], "parameters": {"points": 67}}),
        tls=tls,
        content_type="application/json",
    )
    location = headers.get("location")
    check(
        status in (200, 202) and ask(port, "GET", location, tls=tls)[0] == 200, f"Location of a filed job: {location}"
    )


def addresses(trusting, based, stranger):
    told = (
        "proxy_set_header X-Forwarded-Prefix /heart; proxy_set_header X-Forwarded-Proto $scheme; proxy_set_header "
        "X-Forwarded-Host $http_host;"
    )
    stripped = nginx(f"location /heart/ {{ proxy_pass http://127.0.0.1:{trusting.port}/; {told} }}")
    usable(stripped, "/heart/", False, "/heart")
    tls = nginx(f"location /heart/ {{ proxy_pass http://127.0.0.1:{trusting.port}/; {told} }}", tls=True)
    usable(tls, "/heart/", True, "/heart")
    root = nginx(
        proxied(trusting, "proxy_set_header X-Forwarded-Proto $scheme; proxy_set_header X-Forwarded-Host $http_host;"),
        tls=True,
    )
    usable(root, "/", True, "")
    whole = nginx(
        f"location /apps/heart {{ proxy_pass http://127.0.0.1:{based.port}; proxy_set_header Host $http_host; }}"
    )
    usable(whole, "/apps/heart", False, "/apps/heart")
    # Who is not trusted changes nothing, but the page still finds its files.
    other = nginx(f"location /heart/ {{ proxy_pass http://127.0.0.1:{stranger.port}/; {told} }}")
    status, _, page = ask(other, "GET", "/heart/", accept="text/html")
    names = re.findall(r'(?:src|href)="([^"]+)"', page.decode())
    got = {ask(other, "GET", urllib.parse.urljoin("/heart/", name))[0] for name in names}
    check(status == 200 and names and got == {200}, f"the page behind a proxy that is not trusted: {got}")
    commands = ask(other, "GET", "/heart/")[2].decode()
    check("/heart" not in commands and "localhost:" not in commands, "a proxy that is not trusted names no address")


def idle_connections(service):
    """Requests at the end of `header_timeout`, which is not the end of an idle connection."""
    upstream = f"upstream service {{ server 127.0.0.1:{service.port}; keepalive 32; }}"
    port = nginx(
        "location / { proxy_pass http://service; proxy_http_version 1.1; proxy_set_header Connection ''; }", upstream
    )
    got = collections.Counter()

    def one(number):
        for step in range(5):
            got[ask(port, "POST", "/v1/jobs", b"{}", content_type="application/json")[0]] += 1
            time.sleep(1 - 0.01 + (number + step) % 10 * 0.002)

    threads = [threading.Thread(target=one, args=(number,)) for number in range(8)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    check(set(got) == {422}, f"requests on connections that were idle for as long as a head may take: {dict(got)}")


def main():
    subject = ["-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost", "-days", "1"]
    new = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes"]
    subprocess.run(
        new + ["-keyout", f"{FOLDER}/key.pem", "-out", f"{FOLDER}/cert.pem"] + subject, check=True, capture_output=True
    )
    volume = scan()
    certificate = ("--tls-cert", f"{FOLDER}/cert.pem", "--tls-key", f"{FOLDER}/key.pem")
    early_refusals(
        start("keys", "--body-limit", "1MiB", keys=["submit"]),
        start("tls", "--body-limit", "1MiB", *certificate, keys=["submit"]),
    )
    trusting = start("trusting", "--trusted-proxies", "127.0.0.1", "--wait-limit", "3s")
    events(trusting, volume)
    waiting(trusting, volume)
    based = start("based", "--base-path", "/apps/heart")
    for one in (trusting, based):
        ask(one.port, "POST", "/v1/models?points=67", volume, Prefer="wait=3")
    addresses(trusting, based, start("stranger"))
    idle_connections(start("idle", "--header-timeout", "1s"))


try:
    main()
finally:
    for child in children:
        child.terminate()
    for child in children:
        child.wait()
sys.exit(failures > 0)
