"""What operators see: counters for Prometheus, and a log that machines read.

Plain ASGI like :mod:`wingfit.service.http.request_limits`; the outermost layer, so that refusals count as well.
"""

from __future__ import annotations

import json
import logging
import re
import secrets
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Any

from prometheus_client import CollectorRegistry, Counter, Histogram, ProcessCollector, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from wingfit.service.auth import audit
from wingfit.service.settings import LogFormat
from wingfit.service.storage import fail_points

LOG = logging.getLogger("wingfit.access")
SECONDS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0, 60.0)
REQUEST_ID = "X-Request-ID"
METRICS = "metrics"  # where they are in the state of the server
GIVEN_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")

# Of the request being answered; None elsewhere.
REQUEST: ContextVar[str | None] = ContextVar("request", default=None)

Gauges = dict[str, tuple[str, dict[tuple[tuple[str, str], ...], float]]]


class Metrics:
    """Counters of one service; ``gauges`` reads its standing when it is asked for."""

    def __init__(self, gauges: Callable[[], Gauges]) -> None:
        self._registry = CollectorRegistry()
        ProcessCollector(registry=self._registry)
        self._registry.register(_Standing(gauges))
        self.requests = Counter(
            "wingfit_http_requests", "Requests answered.", ["method", "path", "status"], registry=self._registry
        )
        self.seconds = Histogram(
            "wingfit_http_request_seconds",
            "Time to answer; of event streams none.",
            ["method", "path"],
            buckets=SECONDS,
            registry=self._registry,
        )

        self.slow_clients = Counter(
            "wingfit_slow_clients", "Connections ended because the client read too slowly.", registry=self._registry
        )
        # Finding the series of a request by its labels takes longer than counting it.
        self._series: dict[tuple[str, str, int], tuple[Counter, Histogram | None]] = {}

    def count(self, method: str, path: str, status: int, seconds: float) -> None:
        """One request more. ``method`` and ``path`` are nothing that a caller can make up."""
        series = self._series.get((method, path, status))
        if series is None:
            timed = None if path.endswith("/events") else self.seconds.labels(method, path)
            series = self.requests.labels(method, path, str(status)), timed
            self._series[method, path, status] = series
        series[0].inc()
        if series[1] is not None:
            series[1].observe(seconds)

    def text(self) -> bytes:
        """In the text format of Prometheus."""
        return generate_latest(self._registry)


class _Standing(Collector):
    def __init__(self, gauges: Callable[[], Gauges]) -> None:
        self._gauges = gauges

    def describe(self) -> list[Metric]:
        """Nothing: it is read only when it is asked for."""
        return []

    def collect(self) -> Iterator[Metric]:
        """The gauges as they are now."""
        for name, (told, values) in self._gauges().items():
            names = [label for label, _ in next(iter(values), ())]
            kind = CounterMetricFamily if name.endswith("_total") else GaugeMetricFamily
            family = kind(name, told, labels=names)
            for labels, value in values.items():
                family.add_metric([text for _, text in labels], value)
            yield family


class Observer:
    """Counts and logs every request, and gives it an id that is answered and logged."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one connection."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        began, status = time.perf_counter(), 500
        given = Headers(scope=scope).get(REQUEST_ID, "")
        request = given if GIVEN_ID.fullmatch(given) else new_request()

        async def noted(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                fail_points.passing("answer")
                message["headers"] = [*message["headers"], (REQUEST_ID.lower().encode(), request.encode())]
            await send(message)

        token = REQUEST.set(request)
        try:
            await self.app(scope, receive, noted)
        finally:
            _count(scope, status, time.perf_counter() - began)
            audit.record(scope, status, request)
            REQUEST.reset(token)


def new_request() -> str:
    """The id of a request whose sender gave it none."""
    return secrets.token_hex(8)


def told(scope: Scope, status: int, seconds: float) -> None:
    """Log a request that was answered, of which ``scope`` has method, path and client."""
    if LOG.isEnabledFor(logging.INFO):
        client = (scope.get("client") or ("",))[0]
        LOG.info(
            "%s %s %d", scope["method"], scope["path"], status, extra={"ms": round(1e3 * seconds, 2), "client": client}
        )


def _count(scope: Scope, status: int, seconds: float) -> None:
    # The template of the path, and nothing that a caller can make up: every label is a series of its own.
    path = getattr(scope.get("route"), "path", "") or "other"
    known = scope["method"] if scope["method"] in ("GET", "HEAD", "POST", "DELETE") else "other"
    service = getattr(scope["app"].state, "service", None)
    if service is not None:
        service.metrics.count(known, path, status, seconds)
    told(scope, status, seconds)


class JsonFormatter(logging.Formatter):
    """One JSON object a line."""

    # What every record has; anything else was given by who logged.
    OWN = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "taskName"}

    def format(self, record: logging.LogRecord) -> str:
        """``record`` as JSON."""
        line: dict[str, Any] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname,
            "logger": record.name,
            "message": record.getMessage(),
        }
        if REQUEST.get():
            line["request"] = REQUEST.get()
        line |= {key: value for key, value in vars(record).items() if key not in self.OWN}
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str)


def set_up_log(form: LogFormat) -> None:
    """Log to standard error; requests are logged where machines read, else they would bury the rest."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    logging.getLogger("alembic").setLevel(logging.WARNING)
    if form == "json":
        for handler in logging.getLogger().handlers:
            handler.setFormatter(JsonFormatter())
    else:
        LOG.setLevel(logging.WARNING)
