"""Sends HTTP requests: repeats failed ones, reads server-sent events, raises errors of the server, zips folders."""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from urllib.parse import quote

import httpx

from wingfit.client import answers as a
from wingfit.client.export_answers import Format
from wingfit.client.private_files import open_new

DEFAULT_URL = "http://127.0.0.1:8321"
KEY_VARIABLE = "WINGFIT_API_KEY"
LOOPBACK = {"127.0.0.1", "localhost", "::1"}
# A fixed time stamp makes the archive of an unchanged folder the same bytes, hence the same digest.
ZIP_TIME = (1980, 1, 1, 0, 0, 0)
SENT_TWICE_IS_HARMLESS = {"GET", "DELETE", "PATCH"}

OnBytes = Callable[[int, int], None]
ENDINGS: dict[Format, str] = {"json": ".json", "csv": ".csv", "netcdf": ".nc"}


class WingfitError(Exception):
    """An error that the server reported, or that occurred on the way to it.

    Attributes:
        status: HTTP status, or None when no answer came.
        title: short name of the problem.
        detail: explanation, of the server or of the client.
        errors: for invalid input, one dict for each fault: ``where`` it is, the ``value`` there, and a ``message``.

    """

    def __init__(
        self, title: str, detail: str = "", *, status: int | None = None, errors: list[dict[str, Any]] | None = None
    ) -> None:
        self.title, self.detail, self.status, self.errors = title, detail, status, errors or []
        super().__init__(title, detail)

    def __str__(self) -> str:
        # The server's titles are names of HTTP statuses, which its details make redundant.
        titled = self.status is None and self.detail
        head = f"{self.title}: {self.detail}" if titled else self.detail or self.title
        return "\n".join([head, *(f"  {_described(error)}" for error in self.errors)])


class ServerAwayError(WingfitError):
    """No server answered at the address ``base_url``, or the connection broke; ``cause``: the error of httpx."""

    def __init__(self, base_url: str, cause: Exception) -> None:
        self.base_url = base_url
        super().__init__(
            f"no wingfit server answers at {base_url}",
            f"{_reason(cause)}. Start one with 'wingfit serve', or name another with --url or WINGFIT_URL.",
        )


class Transport:
    """Sends requests to the server at ``base_url``; base class of the client.

    ``retries``: how often a request is repeated if the connection fails or the server answers 502, 503 or 504, first
    after ``retry_wait_s``, then each time after twice the wait. Only GET, DELETE and requests with an Idempotency-Key
    (with which the server acts once) are repeated; others, only if no connection was made.
    ``timeout_s``: time limit of an answer; ``simulating_s``: that of an answer that requires a simulation.
    ``api_key``: by default that of the environment variable ``WINGFIT_API_KEY``.
    """

    def __init__(
        self,
        base_url: str = DEFAULT_URL,
        *,
        api_key: str | None = None,
        timeout_s: float = 60.0,
        simulating_s: float = 600.0,
        retries: int = 2,
        retry_wait_s: float = 0.3,
    ) -> None:
        self.base_url = base_url.rstrip("/")
        self.retries, self.retry_wait_s = retries, retry_wait_s
        self.simulating = httpx.Timeout(timeout_s, read=simulating_s)
        try:
            url = httpx.URL(self.base_url)
        except httpx.InvalidURL as error:
            raise WingfitError("bad server address", f"{base_url!r}: {error}") from error
        if url.scheme not in ("http", "https") or not url.host:
            raise WingfitError("bad server address", f"{base_url!r}; it must look like {DEFAULT_URL}")
        # A proxy of the environment must not be used for a server on this machine.
        self._http = httpx.Client(
            base_url=self.base_url,
            timeout=timeout_s,
            trust_env=url.host not in LOOPBACK,
            headers=_authorization(api_key or os.environ.get(KEY_VARIABLE, "").strip()),
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def _json(self, method: str, path: str, **options: Any) -> Any:
        return self._call(method, path, **options).json()

    def _call(self, method: str, path: str, *, key: str | None = None, **options: Any) -> httpx.Response:
        headers = {"Idempotency-Key": key} if key else {}
        if "json" in options:
            _refuse_what_json_lacks(options["json"])
        safe = key is not None or method in SENT_TWICE_IS_HARMLESS
        return self._repeat(lambda: self._http.request(method, path, headers=headers, **options), safe=safe)

    def _repeat(self, send: Callable[[], httpx.Response], *, safe: bool = True) -> httpx.Response:
        """Call ``send``, again after temporary failures; if not ``safe``, only if no connection was made."""
        for attempt in range(self.retries + 1):
            last = attempt == self.retries
            try:
                response = send()
            except httpx.TransportError as error:
                if last or not (safe or isinstance(error, httpx.ConnectError)):
                    raise ServerAwayError(self.base_url, error) from error
            else:
                if last or not safe or response.status_code not in (502, 503, 504):
                    return _checked(response)
            time.sleep(self.retry_wait_s * 2**attempt)
        raise AssertionError("unreachable")

    def _all(self, path: str, **filters: str | None) -> list[Any]:
        items: list[Any] = []
        cursor: str | None = None
        while True:
            page = self._json("GET", path, params=given(cursor=cursor, **filters))
            items += page["items"]
            cursor = page["next_cursor"]
            if not cursor:
                return items

    @contextlib.contextmanager
    def _stream(self, method: str, path: str, **options: Any) -> Iterator[httpx.Response]:
        """Yield a response to be read in pieces; ServerAwayError if no server answers or the connection breaks."""
        try:
            with self._http.stream(method, path, **options) as response:
                if response.is_error:
                    response.read()
                yield _checked(response)
        except httpx.TransportError as error:
            raise ServerAwayError(self.base_url, error) from error

    def _file(
        self, path: str, target: Path, name: str, on_bytes: OnBytes | None, *, private: bool = False, **options: Any
    ) -> Path:
        """Download the URL path ``path`` to the file ``target``, and return the path of the file.

        If ``target`` is a folder, the file gets the name that the server gives, or ``name``. The file appears only when
        it is complete. Other users cannot read a ``private`` file. ``on_bytes(received, total)`` reports the progress.
        """
        with self._stream("GET", path, **options) as response:
            if target.is_dir():
                target = target / _attachment_name(response, name)
            partial = target.with_name(target.name + ".part")
            try:
                with open_new(partial) if private else partial.open("wb") as stream:
                    for block in response.iter_bytes():
                        stream.write(block)
                        if on_bytes:
                            on_bytes(stream.tell(), int(response.headers.get("content-length", 0)))
            except BaseException:
                partial.unlink(missing_ok=True)
                raise
        partial.replace(target)
        return target

    def _export(self, path: str, format: Format, target: Path, name: str, on_bytes: OnBytes | None) -> Path:  # noqa: A002
        params, name = {"format": format}, f"{name}{ENDINGS[format]}"
        return self._file(f"{path}/export", target, name, on_bytes, params=params, timeout=self.simulating)

    def _events_once(self, path: str, last_event_id: str | None) -> Iterator[a.Event]:
        headers = {"Accept": "text/event-stream"} | given(**{"Last-Event-ID": last_event_id})
        with self._stream("GET", path, headers=headers) as response:
            yield from parse_events(response.iter_lines())


def _refuse_what_json_lacks(body: Any, where: str = "") -> None:
    """Raise WingfitError if ``body``, the value at ``where`` in a request, is or holds what JSON has no form for."""
    if isinstance(body, dict):
        for name, value in body.items():
            _refuse_what_json_lacks(value, f"{where}.{name}" if where else str(name))
    elif isinstance(body, list | tuple):
        for place, value in enumerate(body):
            _refuse_what_json_lacks(value, f"{where}[{place}]")
    elif isinstance(body, float) and not math.isfinite(body):
        raise WingfitError("not sent", f"{where} is {body}; it must be a finite number")
    elif not isinstance(body, str | int | float | None):
        declared = "; give wingfit.declaration(rig), or its name on the server" if where == "rig" else ""
        raise WingfitError(
            "not sent", f"{where} is of type {type(body).__name__}; it must be a number, text, list or dict{declared}"
        )


def _attachment_name(response: httpx.Response, fallback: str) -> str:
    """Return the file name in the header Content-Disposition, without folders; ``fallback`` if there is none."""
    disposition = response.headers.get("content-disposition", "")
    _, found, rest = disposition.partition('filename="')
    name = Path(rest.partition('"')[0].replace("\\", "/")).name if found else ""
    return name if name and not name.startswith(".") else fallback


class CountedFile(io.FileIO):
    """A file opened for reading that calls ``on_bytes(read so far, size of the file)`` after each read."""

    def __init__(self, path: Path, on_bytes: OnBytes | None) -> None:
        super().__init__(path)
        self._on_bytes, self._total = on_bytes, path.stat().st_size

    def read(self, size: int | None = -1, /) -> bytes:
        """Read and return up to ``size`` bytes (all if negative or None), and report the progress."""
        block = super().read(-1 if size is None else size) or b""
        if self._on_bytes:
            self._on_bytes(self.tell(), self._total)
        return block


def parse_events(lines: Iterator[str]) -> Iterator[a.Event]:
    """Yield the server-sent events in the ``lines`` of a stream; an incomplete event at the end is dropped."""
    fields: dict[str, str] = {}
    for line in lines:
        if line:
            name, _, value = line.partition(":")
            value = value.removeprefix(" ")
            # A line that starts with a colon is a comment that keeps the connection alive.
            if name:
                fields[name] = f"{fields['data']}\n{value}" if name == "data" and "data" in fields else value
        else:
            if "data" in fields:
                data = json.loads(fields["data"])
                yield {"id": fields.get("id"), "event": fields.get("event", "message"), "data": data}
            fields = {}


def zip_folder(folder: Path, target: Path) -> Path:
    """Zip a dataset's ``folder`` without hidden files into ``target``, which is returned; same files, same bytes."""
    files = sorted(p for p in folder.rglob("*") if p.is_file() and not _hidden(p.relative_to(folder)))
    if not any(p.relative_to(folder).as_posix() == "dataset.yaml" for p in files):
        raise WingfitError("not a dataset", f"{folder} holds no dataset.yaml; give the folder that holds it")
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in files:
            entry = zipfile.ZipInfo(path.relative_to(folder).as_posix(), ZIP_TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, path.read_bytes())
    return target


def _hidden(path: Path) -> bool:
    return any(part.startswith((".", "__MACOSX")) for part in path.parts)


def _checked(response: httpx.Response) -> httpx.Response:
    """Return ``response``, or raise a WingfitError with the server's explanation if it reports an error."""
    if not response.is_error:
        return response
    try:
        problem = response.json()
    except ValueError:
        problem = None
    if not isinstance(problem, dict):
        problem = {"title": response.reason_phrase, "detail": response.text[:500]}
    raise WingfitError(
        str(problem.get("title") or response.reason_phrase),
        str(problem.get("detail") or ""),
        status=response.status_code,
        errors=problem.get("errors"),
    )


def is_passing(error: WingfitError) -> bool:
    """Return whether ``error`` is temporary, so that the same request may succeed if it is repeated."""
    return isinstance(error, ServerAwayError) or error.status in (502, 503, 504)


def _authorization(api_key: str) -> dict[str, str]:
    if not api_key:
        return {}
    if not (api_key.isascii() and api_key.isprintable() and " " not in api_key):
        raise WingfitError("bad API key", f"{KEY_VARIABLE} must be a key as 'wingfit keys create' prints it")
    return {"Authorization": f"Bearer {api_key}"}


def _reason(cause: Exception) -> str:
    if isinstance(cause, httpx.ConnectError):
        return "the connection was refused"
    if isinstance(cause, httpx.TimeoutException):
        return "it did not answer in time"
    return f"the connection broke ({cause or type(cause).__name__})"


def _described(error: dict[str, Any]) -> str:
    """Return one entry of :attr:`WingfitError.errors` as text: where it is, what is wrong, and the value."""
    where = f"{error['where']}: " if error.get("where") else ""
    value = error.get("value")
    return f"{where}{error.get('message', '')}" + ("" if value is None else f" (given: {value!r})")


def given(**values: Any) -> dict[str, Any]:
    """Return the keyword arguments that are not None, as a dict."""
    return {key: value for key, value in values.items() if value is not None}


def part(identifier: str) -> str:
    """Return ``identifier`` percent-encoded as one segment of a URL path; raise WingfitError if it is empty."""
    if not identifier:
        raise WingfitError("no id given", "list the ids with 'wingfit runs list' or 'wingfit datasets list'")
    return quote(identifier, safe="").replace(".", "%2E")
