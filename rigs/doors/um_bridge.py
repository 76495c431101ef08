"""A door to a simulation that a UM-Bridge server offers over HTTP (protocol version 1.0).

A model maps vectors to vectors. A layout says which genes (or settings) the inputs hold, and which channels the outputs
are. What else a simulation needs is sent as configuration: ``recording`` (name), ``times`` ([T], s), ``settings``,
``inputs`` ([N] each) and ``input_times`` ([N], s), beside the user's own entries.

Protocol: docs of UM-Bridge (Seelinger et al. 2023, Journal of Open Source Software 8, 4748).
"""

from __future__ import annotations

import json
import os
import re
import threading
import time
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import httpx

from wingfit.records.array_types import Array
from wingfit.rigs.doors.door import DoorError, checked, short, value_of
from wingfit.rigs.run import Run, SimulationError

PROTOCOL = 1.0
TIMEOUT = 60.0  # s
CONNECT_S = 5.0
RETRIES = 5
FIRST_WAIT = 0.1  # s; doubles with each retry
LONGEST_WAIT = 5.0  # s
MOST_BYTES = 1 << 28  # of an answer
PASSING = (502, 503, 504)  # statuses of a proxy or load balancer whose server is away
MISUSED = ("ModelNotFound", "UnsupportedFeature", "InvalidInput", "InvalidOutput")  # errors of the protocol
NOT_JSON = re.compile(r"(?<![\w\"])-?(nan|inf(inity)?)(?![\w\"])", re.IGNORECASE)  # as servers in Python write them

Output = str | tuple[str, ...] | None


def um_bridge(
    url: str,
    model: str,
    inputs: Sequence[Sequence[str]],
    outputs: Sequence[str | Sequence[str] | None],
    *,
    config: Mapping[str, Any] | None = None,
    timeout: float = TIMEOUT,
    retries: int = RETRIES,
) -> UmBridge:
    """Return a ``simulate`` that evaluates ``model`` of the UM-Bridge server at ``url``.

    Args:
        url: http or https, host and port: "http://localhost:4242". Redirections and proxies are not followed.
        model: name of the model.
        inputs: for each input vector, the names of the genes or settings that it holds.
        outputs: for each output vector, the name of the channel that its T values are; several names: the channels
            follow each other, T values each; None: it is not used.
        config: entries of the configuration beside those that :mod:`wingfit.rigs.doors.um_bridge` lists.
        timeout: s, of one evaluation; after it the individual has failed.
        retries: how often a request is repeated when there is no connection, after 0.1 s, 0.2 s and so on.
    """
    address = httpx.URL(url)
    if address.scheme not in ("http", "https") or not address.host:
        raise DoorError(f"the address {url!r} is not usable; give http or https and a host: http://localhost:4242")
    if address.userinfo:
        raise DoorError("the address holds a user name or password; give it without: http://localhost:4242")
    if not timeout > 0.0 or retries < 0:
        raise DoorError(f"timeout is {timeout!r} and retries is {retries!r}; give positive numbers")
    if isinstance(inputs, str) or any(isinstance(one, str) for one in inputs):
        raise DoorError(f"inputs is {inputs!r}; give a list of names for each input vector: [['mass', 'damping']]")
    names = tuple(one if one is None or isinstance(one, str) else tuple(one) for one in outputs)
    vectors = tuple(tuple(one) for one in inputs)
    return UmBridge(str(address).rstrip("/"), model, vectors, names, dict(config or {}), timeout, retries)


@dataclass(frozen=True, eq=False)
class UmBridge:
    """Simulates with a UM-Bridge server; see :func:`um_bridge`, which checks the arguments."""

    url: str
    model: str
    inputs: tuple[tuple[str, ...], ...]
    outputs: tuple[Output, ...]
    config: dict[str, Any]
    timeout: float
    retries: int
    _own: _Connection = field(init=False, default_factory=lambda: _Connection())

    def __getstate__(self) -> dict[str, Any]:
        """Pickle everything but the connection: another process opens its own."""
        return {**self.__dict__, "_own": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _own=_Connection())

    def __call__(self, genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        """Return the channels [T] of ``run`` for ``genes``, as the server computes them."""
        vectors = [[value_of(name, genes, run) for name in names] for names in self.inputs]
        config = {**self.config, **_config(run)}
        self._check_once(config, len(run.times))
        found = self._post("Evaluate", {"name": self.model, "input": vectors, "config": config}).get("output")
        if not isinstance(found, list) or len(found) != len(self.outputs):
            count = len(found) if isinstance(found, list) else 0
            raise DoorError(
                f"{self._name} returned {count} output vectors, outputs names {len(self.outputs)}; correct it"
            )
        answer: dict[str, Any] = {}
        for k, names in enumerate(self.outputs):
            answer |= self._channels(k, names, found[k], len(run.times))
        return checked(answer, answer, len(run.times), self._name)

    @property
    def _name(self) -> str:
        return f"model {self.model!r} of {self.url}"

    def _channels(self, k: int, names: Output, values: Any, count: int) -> dict[str, Any]:
        if names is None:
            return {}
        if isinstance(names, str):
            return {names: values}
        if not isinstance(values, list) or len(values) != count * len(names):
            size = len(values) if isinstance(values, list) else 0
            raise DoorError(
                f"output vector {k} of {self._name} has {size} values; {', '.join(names)} need {count} each, one after "
                "the other"
            )
        return {name: values[count * j : count * (j + 1)] for j, name in enumerate(names)}

    def _check_once(self, config: Mapping[str, Any], count: int) -> None:
        """Check, once for each number of times in this process, that the server has this model, with these sizes."""
        known = self._own.checked()
        if count in known:
            return
        info = self._sent("GET", "Info", None)
        version, models = info.get("protocolVersion"), info.get("models", [])
        if version != PROTOCOL:
            raise DoorError(
                f"{self.url} speaks protocol {version!r}; a server of UM-Bridge protocol {PROTOCOL} is needed"
            )
        if self.model not in models:
            raise DoorError(f"{self.url} has no model {self.model!r}; it has {', '.join(map(str, models)) or 'none'}")
        if not self._post("ModelInfo", {"name": self.model}).get("support", {}).get("Evaluate"):
            raise DoorError(f"{self._name} cannot be evaluated (support of Evaluate); name a model that can")
        request = {"name": self.model, "config": config}
        expected = [len(one) for one in self.inputs]
        if (sizes := self._post("InputSizes", request).get("inputSizes")) != expected:
            raise DoorError(
                f"{self._name} takes input vectors of sizes {sizes}, inputs names {expected}; correct inputs"
            )
        wanted = [count * (1 if isinstance(one, str) else len(one)) if one else None for one in self.outputs]
        sizes = self._post("OutputSizes", request).get("outputSizes")
        returned = sizes if isinstance(sizes, list) else []
        wrong = any(b is not None and a != b for a, b in zip(returned, wanted, strict=False))
        if wrong or len(returned) != len(wanted):
            shown = ["any" if one is None else one for one in wanted]
            raise DoorError(
                f"{self._name} returns output vectors of sizes {sizes}, outputs needs {shown} for {count} times; "
                'correct outputs, or let the server compute its channels at the "times" of the configuration'
            )
        known.add(count)

    def _post(self, what: str, body: Mapping[str, Any]) -> dict[str, Any]:
        return self._sent("POST", what, body)

    def _sent(self, method: str, what: str, body: Mapping[str, Any] | None) -> dict[str, Any]:
        content = None if body is None else json.dumps(body).encode()
        for attempt in range(self.retries + 1):
            try:
                status, text = self._asked(method, what, content)
            except httpx.TimeoutException as error:
                if not isinstance(error, httpx.ConnectTimeout):
                    raise SimulationError(f"{self._name} did not answer within {self.timeout:g} s") from error
                problem = f"no connection within {CONNECT_S:g} s"
            except httpx.TransportError as error:
                problem = str(error)
            else:
                if status not in PASSING:
                    return self._read(what, status, text)
                problem = f"status {status}"
            if attempt < self.retries:
                time.sleep(min(FIRST_WAIT * 2**attempt, LONGEST_WAIT))
        raise DoorError(
            f"{self.url} does not answer, after {self.retries + 1} attempts ({short(problem)}); start the UM-Bridge "
            "server, or correct the address"
        )

    def _asked(self, method: str, what: str, content: bytes | None) -> tuple[int, str]:
        """Return the status and text of the answer to one request."""
        limits = httpx.Timeout(self.timeout, connect=CONNECT_S)
        headers = {"Content-Type": "application/json"}
        client = self._own.client()
        with client.stream(method, f"{self.url}/{what}", content=content, headers=headers, timeout=limits) as answer:
            text = bytearray()
            for part in answer.iter_bytes():
                text += part
                if len(text) > MOST_BYTES:
                    raise DoorError(f"{self._name} answers with more than {MOST_BYTES >> 20} MiB; return less")
            return answer.status_code, text.decode(errors="replace")

    def _read(self, what: str, status: int, text: str) -> dict[str, Any]:
        """Return the answer of the server; SimulationError if the model failed, DoorError if the use is wrong."""
        try:
            found = json.loads(text)
        except ValueError:
            found = None
        error = found.get("error") if isinstance(found, dict) else None
        if isinstance(error, dict):
            kind, words = str(error.get("type")), short(str(error.get("message")))
            if kind in MISUSED:
                raise DoorError(f"{self._name} refuses {what}: {kind}: {words}; correct the layout or the server")
            raise SimulationError(f"{kind}: {words}")
        if status >= 500 and what == "Evaluate":
            raise SimulationError(f"{self._name} failed with status {status}: {short(text)}")
        if status == 200 and found is None and what == "Evaluate" and NOT_JSON.search(text):
            raise SimulationError(f"the output of {self._name} is not finite")
        if status != 200 or not isinstance(found, dict):
            raise DoorError(
                f"{self.url}/{what} answered with status {status} and {short(text)!r}; give the address of a UM-Bridge "
                "server"
            )
        return found


class _Connection:
    """The connection of this process, and what it knows of the server."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._client: httpx.Client | None = None
        self._closing: weakref.finalize[[], _Connection] | None = None
        self._checked: set[int] = set()
        self._pid = 0

    def client(self) -> httpx.Client:
        """Return the client of this process."""
        with self._lock:
            if self._client is None or self._pid != os.getpid():
                if self._closing is not None:  # a forked process leaves the connection of its parent open
                    self._closing.detach()
                self._client, self._pid = httpx.Client(trust_env=False, follow_redirects=False), os.getpid()
                self._closing = weakref.finalize(self, self._client.close)
            return self._client

    def checked(self) -> set[int]:
        """Return the numbers of times for which the server was checked."""
        return self._checked


def _config(run: Run) -> dict[str, Any]:
    return {
        "recording": run.recording,
        "times": run.times.tolist(),
        "settings": {name: float(value) for name, value in run.settings.items()},
        "inputs": {name: values.tolist() for name, values in run.inputs.items()},
        "input_times": run.input_times.tolist(),
    }
