"""A client of the service (extra `client`): upload, submit, wait, download, search."""

from __future__ import annotations

import io
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from ._errors import InputError, VentriformError
from ._inputs import is_bytes, is_path
from ._results import extra, teller
from .reports import Job, StoredVolume

if TYPE_CHECKING:
    from types import TracebackType

    import httpx


#: Time between two questions for a job whose stream of events has ended.
POLL_SECONDS = 0.2


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
        The API key, sent as ``Authorization: Bearer``.
    timeout : float
        Seconds to wait for an answer.

    Examples
    --------
    >>> with vf.Client("http://127.0.0.1:8080", key) as service:
    ...     volume = service.upload("rest.dcm")
    ...     job = service.submit("segmentation", volume.id, model="auto")
    ...     done = service.wait(job.id)
    ...     mask = service.download(f"/v1/segmentations/{done.segmentation}/mask.nii.gz")
    """

    def __init__(self, url: str, key: str | None = None, *, timeout: float = 60.0) -> None:
        package = extra("httpx", "client")
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        self._http: httpx.Client = package.Client(base_url=url, headers=headers, timeout=timeout)

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
        """Any request. An answer of 400 and above is raised."""
        import httpx

        try:
            answer = self._http.request(method, path, **options)
        except httpx.HTTPError as error:
            fix = "Check the address, and that the service runs."
            raise ServiceError(0, "unreachable", f"{self._http.base_url}: {error}.", fix) from error
        except (ValueError, TypeError, httpx.InvalidURL) as error:
            raise InputError("url", f"{error}.", "Give an address such as http://127.0.0.1:8080.") from error
        if answer.status_code >= 400:
            raise _refusal(answer)
        return answer

    def upload(self, scan: Any, name: str | None = None) -> StoredVolume:
        """Stores a volume. Takes a path or bytes: a file, or a zip archive of a series."""
        if is_path(scan):
            name = name or os.path.basename(os.fspath(scan))
            try:
                with open(scan, "rb") as file:
                    return self._store(file, name)
            except OSError as error:
                raise InputError("scan", f"{error}.", "Give the path of a file that can be read.") from error
        if not is_bytes(scan):
            raise InputError("scan", f"A {type(scan).__name__} cannot be sent.", "Give a path or bytes.")
        return self._store(io.BytesIO(bytes(scan)), name or "scan")

    def _store(self, file: Any, name: str) -> StoredVolume:
        files = {"file": (name, file, "application/octet-stream")}
        return StoredVolume.from_dict(_object(self.request("POST", "/v1/volumes", files=files)))

    def submit(self, kind: str, volume: str, **parameters: Any) -> Job:
        """Files a job on a stored volume.

        Parameters
        ----------
        kind : {'model', 'segmentation', 'beat', 'comparison'}
            What is made.
        volume : str
            The id of an upload.
        **parameters
            Those of the function of this kind; `model` and `expert` are ids of what is stored, or 'auto'.
        """
        given = {name: value for name, value in parameters.items() if value is not None}
        body = {"kind": kind, "volume": volume, "parameters": given}
        return Job.from_dict(_object(self.request("POST", "/v1/jobs", json=body)))

    def job(self, id: str) -> Job:
        """A job as it is now."""
        return Job.from_dict(_object(self.request("GET", f"/v1/jobs/{id}")))

    def wait(
        self,
        id: str,
        *,
        timeout: float = 600.0,
        progress: Any = None,
    ) -> Job:
        """The job once it has ended well, following its events.

        Raises
        ------
        ServiceError
            If the job failed or was cancelled, or has not ended within `timeout` seconds (code ``timeout``).
        """
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
            job = self.job(id)
            if job.state == "succeeded":
                return job
            if job.state in ("failed", "cancelled"):
                raise _problem(job.to_dict().get("error") or {}, 200, f"The job was {job.state}.", job.state)
            if time.monotonic() > end:
                raise ServiceError(0, "timeout", f"The job {id} is {job.state} after {timeout:g} seconds.", "Wait longer.")
            time.sleep(POLL_SECONDS)

    def events(self, id: str) -> Iterator[Job]:
        """The job each time that something changes, until it has ended."""
        import httpx

        try:
            headers = {"Accept": "text/event-stream"}
            with self._http.stream("GET", f"/v1/jobs/{id}/events", headers=headers) as answer:
                if answer.status_code >= 400:
                    answer.read()
                    raise _refusal(answer)
                for line in answer.iter_lines():
                    if line.startswith("data:"):
                        told = json.loads(line.removeprefix("data:"))
                        if isinstance(told, dict) and "state" in told:
                            yield Job.from_dict(told)
        except httpx.HTTPError as error:
            fix = "Check the address, and that the service runs."
            raise ServiceError(0, "unreachable", f"{self._http.base_url}: {error}.", fix) from error

    def download(self, path: str, *, accept: str | None = None) -> bytes:
        """The bytes of a file: a link of a job or of a result."""
        headers = {"Accept": accept} if accept else {}
        return self.request("GET", path, headers=headers).content

    def search(self, kind: str, **filters: Any) -> Iterator[dict[str, Any]]:
        """What is stored, newest first: `volumes`, `models`, `segmentations`, `beats`, `templates`, `readers` or `jobs`."""
        query = {name: _text(value) for name, value in filters.items() if value is not None}
        while True:
            page = _object(self.request("GET", f"/v1/{kind}", params=query or None))
            yield from page.get(kind, [])
            if not page.get("next_cursor"):
        Parameters
        ----------
        id : str
            The job's id.
        timeout : float
            Seconds to wait at most.
        progress : callable or tqdm, optional
            Told stage and completed fraction, as with `segment`; True makes a bar.

                return
            query = {**query, "cursor": str(page["next_cursor"])}

    def erase(self, path: str) -> None:
        """Erases a stored item: `/v1/volumes/ID`."""
        tell = teller(progress)
        self.request("DELETE", path)


def _text(value: Any) -> str:
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
    return _problem(problem, answer.status_code, f"The service answered {answer.status_code}.", f"http-{answer.status_code}")


def _problem(problem: Mapping[str, Any], status: int, reason: str, code: str) -> ServiceError:
    reason = problem.get("detail") or problem.get("title") or reason
    code = str(problem.get("type") or code).removeprefix("urn:ventriform:problem:")
    return ServiceError(status, code, reason, str(problem.get("fix") or ""), problem.get("field"))
