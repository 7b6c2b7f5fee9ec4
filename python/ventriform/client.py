"""A client of the service (extra `client`): upload, submit, wait, download, search."""

from __future__ import annotations

import io
import json
import os
import re
import shutil
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar

from . import _tables
from ._errors import InputError, VentriformError, file_error
from ._frames import Coordinates
from ._inputs import content, files, is_bytes, is_open_file, is_path, native
from ._results import extra, teller, unwrap
from .reports import Job, StoredVolume

if TYPE_CHECKING:
    from types import TracebackType

    import httpx


Made = TypeVar("Made")

#: Bytes of a file that are copied to an archive at once.
COPIED_BYTES = 1 << 20

#: Time between two questions for a job whose stream of events has ended.
POLL_SECONDS = 0.2

#: The function of each kind of job, whose table has its parameters.
FUNCTIONS = {
    "model": "generate",
    "segmentation": "segment",
    "beat": "beat",
    "comparison": "compare",
    "serial": "serial",
}

MOST_PORT = 65535

_ADDRESS = "Give an address such as http://127.0.0.1:8080."


class ServiceError(VentriformError):
    """The service is away, or refuses what was asked.

    Attributes
    ----------
    status : int
        HTTP status; 0 if there was no answer.
    code : str
        A stable identifier: ``no-surface``, ``unauthenticated``; ``unreachable`` if there was no answer.
    reason, fix : str
        What is wrong, and what to do instead.
    field : str or None
        The parameter that it is about.
    """

    def __init__(self, status: int, code: str, reason: str, fix: str = "", field: str | None = None) -> None:
        super().__init__(status, code, reason, fix, field)
        self.status = status
        self.code = code
        self.reason = reason
        self.fix = fix
        self.field = field

    def __str__(self) -> str:
        return f"{self.reason} {self.fix} ({self.status} {self.code})".replace("  ", " ")


class Client:
    """A connection to a service.

    Parameters
    ----------
    url : str
        Where the service is, such as ``http://127.0.0.1:8080``.
    key : str, optional
        The API key, sent as ``Authorization: Bearer``, and to no other scheme, host or port than those of `url`.
    timeout : float
        Seconds to wait for an answer.

    Examples
    --------
    >>> with vf.Client("http://127.0.0.1:8080", key) as service:
    ...     volume = service.upload("rest.dcm")
    ...     job = service.submit("segmentation", volume.id, model="auto")
    ...     done = service.wait(job)
    ...     mask = service.download(f"/v1/segmentations/{done.segmentation}/mask.nii.gz")
    """

    def __init__(self, url: str, key: str | None = None, *, timeout: float = 60.0) -> None:
        package = extra("httpx", "client")
        base = _url(url, _ADDRESS)
        if base.scheme not in ("http", "https") or not base.host or (base.port or 0) > MOST_PORT:
            raise InputError("url", f"`{url}` is no address of a service.", _ADDRESS)
        if key is not None and not (isinstance(key, str) and key.isascii() and key.isprintable()):
            raise InputError(
                "key", "It is no text of printable ASCII characters.", "Give the key as `keys create` printed it."
            )
        if timeout is not None and (not isinstance(timeout, (int, float)) or not timeout > 0):
            raise InputError("timeout", f"It is {timeout!r}.", "Give seconds above 0.")
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        self._http: httpx.Client = package.Client(base_url=base, headers=headers, timeout=timeout)

    def __repr__(self) -> str:
        state = ", closed" if self._http.is_closed else ""
        return f"Client({str(self._http.base_url)!r}{state})"

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connection."""
        self._http.close()

    def request(self, method: str, path: str, **options: Any) -> httpx.Response:
        """Any request to the service, with options of httpx. An answer of 400 and above is raised.

        `path` is a path, or an address of the client's scheme, host and port: another would be sent the API key.
        """
        target = self._target(path)
        with self._sending(target):
            try:
                answer = self._http.request(method, target, **options)
            except (ValueError, TypeError, AttributeError) as error:
                raise InputError(
                    "options", f"{error}.", "Give a method and options as httpx.Client.request takes them."
                ) from error
        if answer.status_code >= 400:
            raise _refusal(answer)
        return answer

    def _target(self, path: str) -> httpx.URL:
        """The address of a path, if the key may be sent there."""
        if self._http.is_closed:
            raise InputError("client", "The client is closed.", "Make a new one.")
        fix = "Give a path such as /v1/volumes; fetch another address without this client, whose key it must not get."
        given, base = _url(path, fix), self._http.base_url
        if given.scheme or given.host:
            if (given.scheme, given.host, given.port) != (base.scheme, base.host, base.port):
                raise InputError("url", f"`{path}` is not at {base}, the client's address.", fix)
            return given
        return base.copy_with(raw_path=base.raw_path.rstrip(b"/") + b"/" + given.raw_path.lstrip(b"/"))

    @contextmanager
    def _sending(self, target: httpx.URL) -> Iterator[None]:
        """Turns what httpx raises into errors of this package."""
        import httpx

        try:
            yield
        except httpx.HTTPError as error:
            fix = "Check the address, and that the service runs."
            raise ServiceError(0, "unreachable", f"{target}: {error}.", fix) from error
        except httpx.InvalidURL as error:
            raise InputError("url", f"{target}: {error}.", _ADDRESS) from error

    def upload(self, scan: Any, name: str | None = None) -> StoredVolume:
        """Stores a volume.

        Parameters
        ----------
        scan : path, sequence of paths, bytes, open file, Volume or image
            What `ventriform.read` takes. One file is sent as it is. The files of a series, a pair or a folder are sent
            as one zip archive: of a folder those that `read` would look at. An array or an image is sent as a NIfTI
            file of 32-bit floats.
        name : str, optional
            The file's name at the service, where there is another than its own.

        Raises
        ------
        InputError
            If it cannot be read or sent.
        ServiceError
            If the service refuses it, or is away.
        """
        if name is not None and not isinstance(name, str):
            raise InputError("name", f"It is a {type(name).__name__}.", "Give the name of a file.")
        if is_bytes(scan):
            return self._store(io.BytesIO(bytes(scan)), name or "scan")
        if is_open_file(scan):
            own = getattr(scan, "name", None)
            known = os.path.basename(own) if isinstance(own, str) else "scan"
            return self._store(io.BytesIO(_named(content, scan)), name or known or "scan")
        found = _named(lambda: files(native(scan, unwrap)))
        if len(found) > 1:
            folder = os.fsdecode(os.path.basename(os.path.normpath(scan))) if is_path(scan) else "scan"
            with tempfile.TemporaryFile() as archive:
                _pack(found, archive)
                return self._store(archive, name or f"{folder}.zip")
        own, stored = found[0]
        if is_bytes(stored):
            return self._store(io.BytesIO(stored), name or own)
        with _open(stored) as file:
            return self._store(file, name or own)

    def _store(self, file: Any, name: str) -> StoredVolume:
        sent = {"file": (name, file, "application/octet-stream")}
        return StoredVolume.from_dict(_object(self.request("POST", "/v1/volumes", files=sent)))

    def submit(self, kind: str, volume: str | StoredVolume, **parameters: Any) -> Job:
        """Files a job on a stored volume.

        Parameters
        ----------
        kind : {'model', 'segmentation', 'beat', 'comparison', 'normals'}
            What is made.
        volume : str or StoredVolume
            An upload, or its id.
        **parameters
            Those of the function of this kind: numbers and arrays of NumPy are sent as numbers. `model`, `expert` and
            `normals` are ids of what is stored; `model` may be 'auto'. Points and directions are LPS, as the service's
            results; `Coordinates` are turned into it.

        Raises
        ------
        InputError
            If a parameter cannot be sent.
        ServiceError
            If the service refuses one.
        """
        own = {"kind": kind, "volume": getattr(volume, "id", volume)}
        for name, value in own.items():
            if not isinstance(value, str):
                raise InputError(name, f"It is a {type(value).__name__}.", f"Give {_OWN[name]}.")
        if kind in FUNCTIONS:
            parameters = _tables.checked(FUNCTIONS[kind], parameters)
        given = {name: _plain(name, value) for name, value in parameters.items() if value is not None}
        body = {**{name: _plain(name, value) for name, value in own.items()}, "parameters": given}
        return Job.from_dict(_object(self.request("POST", "/v1/jobs", json=body)))

    def job(self, job: str | Job) -> Job:
        """A job as it is now, by its id or as `submit` returned it."""
        return Job.from_dict(_object(self.request("GET", f"/v1/jobs/{_job_id(job)}")))

    def wait(
        self,
        job: str | Job,
        *,
        timeout: float = 600.0,
        progress: Any = None,
    ) -> Job:
        """The job once it has ended well, following its events.

        Parameters
        ----------
        job : str or Job
            What `submit` returned, or its id.
        timeout : float
            Seconds to wait at most.
        progress : callable or tqdm, optional
            Told stage and completed fraction, as with `segment`; True makes a bar.

        Raises
        ------
        ServiceError
            If the job failed or was cancelled, or has not ended within `timeout` seconds (code ``timeout``).
        """
        id = _job_id(job)
        tell = teller(progress)
        end = time.monotonic() + timeout
        while True:
            try:
                for told in self.events(id):
                    if tell is not None:
                        tell(told.stage or "", told.progress)
                    if time.monotonic() > end:
                        break
            except ServiceError as error:
                # A stream may break; the job is asked for itself below.
                if error.code != "unreachable":
                    raise
            now = self.job(id)
            if now.state == "succeeded":
                return now
            if now.state in ("failed", "cancelled"):
                raise _problem(now.to_dict().get("error") or {}, 200, f"The job was {now.state}.", now.state)
            if time.monotonic() > end:
                raise ServiceError(
                    0, "timeout", f"The job {id} is {now.state} after {timeout:g} seconds.", "Wait longer."
                )
            time.sleep(POLL_SECONDS)

    def events(self, job: str | Job) -> Iterator[Job]:
        """The job each time that something changes, until it has ended."""
        target = self._target(f"/v1/jobs/{_job_id(job)}/events")
        headers = {"Accept": "text/event-stream"}
        with self._sending(target), self._http.stream("GET", target, headers=headers) as answer:
            if answer.status_code >= 400:
                answer.read()
                raise _refusal(answer)
            for line in answer.iter_lines():
                if line.startswith("data:"):
                    told = json.loads(line.removeprefix("data:"))
                    if isinstance(told, dict) and "state" in told:
                        yield Job.from_dict(told)

    def download(self, path: str, *, accept: str | None = None) -> bytes:
        """The bytes of a file: a link of a job or of a result, which is a path of the service."""
        headers = {"Accept": accept} if accept else {}
        return self.request("GET", path, headers=headers).content

    def search(self, kind: str, **filters: Any) -> Iterator[dict[str, Any]]:
        """What is stored, newest first: `volumes`, `models`, `segmentations`, `beats`, `comparisons`, `normals`,
        `templates`, `readers` or `jobs`."""
        query = {name: _text(value) for name, value in filters.items() if value is not None}
        while True:
            page = _object(self.request("GET", f"/v1/{kind}", params=query or None))
            yield from page.get(kind, [])
            if not page.get("next_cursor"):
                return
            query = {**query, "cursor": str(page["next_cursor"])}

    def erase(self, path: str) -> None:
        """Erases a stored item: `/v1/volumes/ID`."""
        self.request("DELETE", path)


_OWN = {
    "kind": "one of 'model', 'segmentation', 'beat', 'comparison', 'normals'",
    "volume": "what `upload` returned, or its id",
}
"""What the values of a job beside its parameters are."""


def _named(make: Callable[..., Made], *given: Any) -> Made:
    """What `make` makes of the parameter `scan`, by whose name it is refused."""
    try:
        return make(*given)
    except InputError as error:
        if error.field in (None, "source"):
            error._about("scan")
        raise


def _open(path: Any) -> BinaryIO:
    try:
        return open(path, "rb")
    except OSError as error:
        raise file_error("scan", path, error) from error
    except ValueError as error:
        raise InputError("scan", f"{error}.", "Give the path of a file that can be read.") from error


def _pack(found: list[tuple[str, Any]], archive: BinaryIO) -> None:
    """Writes files to a zip archive, unpacked: volumes are packed already, or are not worth it on the way."""
    taken: set[str] = set()
    with zipfile.ZipFile(archive, "w", strict_timestamps=False) as packed:
        for number, (own, stored) in enumerate(found, 1):
            # Files of several folders may have one name.
            named = own if own not in taken else f"{number}/{own}"
            taken.add(named)
            if is_bytes(stored):
                packed.writestr(named, stored)
                continue
            with _open(stored) as file, packed.open(named, "w", force_zip64=True) as into:
                shutil.copyfileobj(file, into, COPIED_BYTES)
    archive.seek(0)


def _url(address: Any, fix: str) -> httpx.URL:
    import httpx

    if not isinstance(address, (str, httpx.URL)):
        raise InputError("url", f"A {type(address).__name__} is no address.", fix)
    try:
        made = httpx.URL(address)
        str(made).encode("ascii")
    except (httpx.InvalidURL, ValueError) as error:
        raise InputError("url", f"{str(address)!r} is no address: {str(error).rstrip('.')}.", fix) from error
    return made


def _plain(name: str, value: Any) -> Any:
    """A parameter's value of what JSON has."""
    if isinstance(value, Coordinates):
        value = value.in_frame("LPS")
    try:
        plain: Any = json.loads(json.dumps(value, allow_nan=False, default=_numbers))
        json.dumps(plain, ensure_ascii=False).encode()
    except (TypeError, ValueError, RecursionError) as error:
        fix = "Give a number, a word, true or false, or a sequence of numbers."
        raise InputError(name, f"It cannot be sent: {error}.", fix) from error
    return plain


def _job_id(job: Any) -> str:
    """The id of a job, which is part of a path."""
    id = job.id if isinstance(job, Job) else job
    if not isinstance(id, str) or not _ID.fullmatch(id):
        raise InputError("job", f"{job!r} is no job.", "Give what `submit` returned, or its id.")
    return id


_ID = re.compile(r"[A-Za-z0-9_-]+")


def _numbers(value: Any) -> Any:
    """Numbers and arrays of NumPy as those of Python, and an upload as its id."""
    if isinstance(value, StoredVolume):
        return value.id
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} is no value of JSON")


def _text(value: Any) -> str:
    if isinstance(value, StoredVolume):
        return value.id
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return ",".join(map(_text, value))
    return str(value)


def _object(answer: httpx.Response) -> dict[str, Any]:
    try:
        told = answer.json()
    except ValueError as error:
        reason = f"The answer is {answer.headers.get('content-type', 'nothing')} and no JSON."
        raise ServiceError(answer.status_code, "unexpected-answer", reason, "Check the address.") from error
    if not isinstance(told, Mapping):
        raise ServiceError(answer.status_code, "unexpected-answer", "The answer is no object.", "Check the address.")
    return dict(told)


def _refusal(answer: httpx.Response) -> ServiceError:
    try:
        problem = answer.json()
    except ValueError:
        problem = {}
    if not isinstance(problem, Mapping):
        problem = {}
    return _problem(
        problem, answer.status_code, f"The service answered {answer.status_code}.", f"http-{answer.status_code}"
    )


def _problem(problem: Mapping[str, Any], status: int, reason: str, code: str) -> ServiceError:
    reason = problem.get("detail") or problem.get("title") or reason
    code = str(problem.get("type") or code).removeprefix("urn:ventriform:problem:")
    return ServiceError(status, code, reason, str(problem.get("fix") or ""), problem.get("field"))
