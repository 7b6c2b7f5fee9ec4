"""What the client checks by itself, and what it sends, against a server that keeps what it is sent."""

from __future__ import annotations

import http.server
import json
import pathlib
import threading
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import ventriform as vf
from ventriform.client import Client, ServiceError
from ventriform.reports import StoredVolume

JOB = {"id": "job_1", "state": "succeeded", "stage": "export", "progress": 1.0}


class Server(http.server.ThreadingHTTPServer):
    """Answers everything with a job."""

    got: list[tuple[str, str | None, bytes]]


class Answer(http.server.BaseHTTPRequestHandler):
    server: Server

    def answer(self) -> None:
        body = self.rfile.read(int(self.headers.get("content-length", 0)))
        self.server.got.append((self.path, self.headers.get("authorization"), body))
        text = json.dumps(JOB).encode()
        if self.path.endswith("/events"):
            text = b"data: " + text + b"\n\n"
        self.send_response(200)
        self.send_header("content-length", str(len(text)))
        self.end_headers()
        self.wfile.write(text)

    do_GET = do_POST = answer

    def log_message(self, format: str, *args: Any) -> None:
        pass


@pytest.fixture
def server() -> Iterator[Server]:
    made = Server(("127.0.0.1", 0), Answer)
    made.got = []
    threading.Thread(target=made.serve_forever, daemon=True).start()
    yield made
    made.shutdown()
    made.server_close()


def address(server: Server) -> str:
    return f"http://127.0.0.1:{server.server_address[1]}"


def refusal(call: Callable[[], object]) -> vf.InputError:
    with pytest.raises(vf.InputError) as raised:
        call()
    assert raised.value.reason and raised.value.fix
    return raised.value


def test_the_key_is_sent_to_the_clients_own_origin_alone(server: Server) -> None:
    other = Server(("127.0.0.1", 0), Answer)
    other.got = []
    threading.Thread(target=other.serve_forever, daemon=True).start()
    port = other.server_address[1]
    with Client(address(server), "secret") as client:
        foreign = [
            f"{address(other)}/mask",
            f"//127.0.0.1:{port}/mask",
            f"http://localhost:{server.server_address[1]}/mask",
            address(server).replace("http:", "https:") + "/mask",
            "http://127.0.0.1/mask",
            "file:///etc/hosts",
        ]
        for url in foreign:
            error = refusal(lambda url=url: client.download(url))  # type: ignore[misc]
            assert error.field == "url" and address(server) in error.reason and "secret" not in str(error)
            refusal(lambda url=url: client.request("POST", url))  # type: ignore[misc]
            refusal(lambda url=url: client.erase(url))  # type: ignore[misc]
        for path in ("/v1/mask?a=b", "v1/mask?a=b", f"{address(server)}/v1/mask?a=b"):
            client.download(path)
    other.shutdown()
    other.server_close()
    assert other.got == []
    assert [(path, key) for path, key, _ in server.got] == [("/v1/mask?a=b", "Bearer secret")] * 3


def test_an_address_with_a_path_is_kept_and_named() -> None:
    with Client("http://127.0.0.1:9/heart") as client, pytest.raises(ServiceError) as raised:
        client.download("/v1/x")
    assert "http://127.0.0.1:9/heart/v1/x" in raised.value.reason and raised.value.code == "unreachable"


@pytest.mark.parametrize(
    "url", [None, "", "127.0.0.1:8080", "http://256.1.1.1", "ftp://host", "http://host:99999", b"http://host"]
)
def test_an_address_that_is_none_is_refused_at_once(url: Any) -> None:
    assert refusal(lambda: Client(url)).field == "url"


@pytest.mark.parametrize("key", ["kéy", "key\n", b"key", 3])
def test_a_key_that_no_header_has_is_refused_and_not_told(key: Any) -> None:
    error = refusal(lambda: Client("http://127.0.0.1:9", key))
    assert error.field == "key" and "é" not in str(error)


def test_a_closed_client_says_so() -> None:
    client = Client("http://127.0.0.1:9")
    client.close()
    for call in (
        lambda: client.job("j"),
        lambda: client.wait("j"),
        lambda: client.upload(b"x"),
        lambda: next(client.events("j")),
    ):
        assert refusal(call).field == "client"


def test_other_arguments_are_checked(tmp_path: pathlib.Path) -> None:
    with Client("http://127.0.0.1:9") as client:
        assert refusal(lambda: client.upload(tmp_path)).field == "scan"
        assert refusal(lambda: client.upload("\0")).field == "scan"
        (tmp_path / "text").write_text("no bytes")
        with open(tmp_path / "text") as text:
            assert refusal(lambda: client.upload(text)).field == "scan"
        for nothing in (3, None, object(), {"a": 1}, [tmp_path / "text", b"x"]):
            assert refusal(lambda nothing=nothing: client.upload(nothing)).field == "scan"  # type: ignore[misc]
        assert refusal(lambda: client.upload(b"x", 3)).field == "name"  # type: ignore[arg-type]
        assert refusal(lambda: client.request("GET", "/v1", color="red")).field == "options"
        assert refusal(lambda: client.download("/\0")).field == "url"


def test_numbers_of_numpy_and_uploads_are_sent(server: Server) -> None:
    volume = StoredVolume.from_dict({"id": "vol_1"})
    with Client(address(server)) as client:
        client.submit(
            "model", volume, points=np.int64(60), box=np.arange(6), mask_smoothing=np.float32(0.5), model=None
        )
        client.submit("segmentation", "vol_1", orbit=180, resample=np.bool_(True), expert=volume)
        list(zip(client.search("volumes", volume=volume, gated=np.bool_(True)), range(1), strict=False))
    first, second = (json.loads(body) for _, _, body in server.got[:2])
    assert first == {
        "kind": "model",
        "volume": "vol_1",
        "parameters": {"points": 60, "box": [0, 1, 2, 3, 4, 5], "mask_smoothing": 0.5},
    }
    assert second["parameters"] == {"orbit": "180", "resample": True, "expert": "vol_1"}
    assert server.got[2][0] == "/v1/volumes?volume=vol_1&gated=true"


def sent_files(body: bytes) -> dict[str, bytes]:
    """The files of an upload's zip archive."""
    import io
    import zipfile

    start = body.index(b"PK\3\4")
    with zipfile.ZipFile(io.BytesIO(body[start:])) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def test_several_files_are_sent_as_one_archive(server: Server, tmp_path: pathlib.Path) -> None:
    (tmp_path / "series/deep").mkdir(parents=True)
    for name in ("series/a.dcm", "series/deep/b.dcm", "series/.hidden", "a.dcm"):
        (tmp_path / name).write_bytes(name.encode())
    with Client(address(server)) as client:
        client.upload(tmp_path / "series")
        client.upload([tmp_path / "series/a.dcm", tmp_path / "a.dcm"], "two")
        client.upload([b"one", b"other"])
    folder, paths, contents = (body for _, _, body in server.got)
    assert sent_files(folder) == {"a.dcm": b"series/a.dcm", "deep/b.dcm": b"series/deep/b.dcm"}
    assert b'filename="series.zip"' in folder and b'filename="two"' in paths
    assert sorted(sent_files(paths).values()) == [b"a.dcm", b"series/a.dcm"]
    assert sorted(sent_files(contents).values()) == [b"one", b"other"]


def test_what_cannot_be_sent_is_refused_by_its_name() -> None:
    circle: list[Any] = []
    circle.append(circle)
    values = [
        object(),
        {1},
        float("nan"),
        np.array([np.inf]),
        np.array([1j]),
        "\ud800",
        circle,
        b"x",
        pathlib.Path("x"),
    ]
    with Client("http://127.0.0.1:9") as client:
        for value in values:
            assert refusal(lambda value=value: client.submit("model", "vol_1", label=value)).field == "label"  # type: ignore[misc]
        assert refusal(lambda: client.submit("segmentation", "vol_1", orbit=None)).field == "orbit"
        assert refusal(lambda: client.submit("model", None)).field == "volume"  # type: ignore[arg-type]
        assert refusal(lambda: client.submit(3, "vol_1")).field == "kind"  # type: ignore[arg-type]


def test_progress_is_told_to_functions_and_bars(server: Server) -> None:
    from tqdm import tqdm

    told: list[object] = []
    with Client(address(server)) as client, tqdm(total=50, file=open("/dev/null", "w")) as bar:
        client.wait("job_1", progress=bar)
        assert bar.n == pytest.approx(50)
        client.wait("job_1", progress=True)
        client.wait("job_1", progress=lambda stage, fraction: told.append((stage, fraction)))
        assert told == [("export", 1.0)]
        assert refusal(lambda: client.wait("job_1", progress=3)).field == "progress"


def test_a_job_is_taken_as_submit_returned_it(server: Server) -> None:
    with Client(address(server)) as client:
        job = client.submit("model", "v1")
        assert client.job(job).id == client.job(job.id).id == client.wait(job).id == "job_1"
        assert [told.id for told in client.events(job)] == ["job_1"]
        sent = len(server.got)
        for wrong in (None, 3, "", "../volumes/x", "a/b", "job 1", StoredVolume, {"id": "job_1"}):
            for use in (client.job, client.wait, lambda one: list(client.events(one))):
                with pytest.raises(vf.InputError, match="no job"):
                    use(wrong)  # type: ignore[operator]
        assert len(server.got) == sent, "nothing is sent"


def test_coordinates_are_sent_in_the_frame_of_the_service(server: Server) -> None:
    with Client(address(server)) as client:
        client.submit("segmentation", "v1", center=vf.Coordinates([1.0, 2.0, 3.0], frame="RAS"), axis=[0.0, 1.0, 0.0])
    assert json.loads(server.got[-1][2])["parameters"] == {"center": [-1.0, -2.0, 3.0], "axis": [0.0, 1.0, 0.0]}
