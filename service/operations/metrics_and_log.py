"""Metrics for Prometheus, and the log: every request is counted, logged and gets an id."""

from __future__ import annotations

import json
import logging
import re
import secrets
import time
from collections.abc import Callable, Iterable
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Any

from prometheus_client import CollectorRegistry, Counter, Histogram, ProcessCollector, generate_latest
from prometheus_client.core import Metric
from prometheus_client.registry import Collector
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from wingfit.service.auth import audit
from wingfit.service.settings import LogFormat
from wingfit.service.storage import fail_points

LOG = logging.getLogger("wingfit.access")
SECONDS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0, 60.0)
REQUEST_ID = "X-Request-ID"
METRICS = "metrics"  # name of the metrics in the state that the lifespan yields
VALID_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
METHODS = ("GET", "HEAD", "POST", "PUT", "DELETE")

# The id of the request being answered; None outside requests.
REQUEST: ContextVar[str | None] = ContextVar("request", default=None)


class Metrics:
    """The metrics of the service: counters of requests; and ``gauges``, a function called whenever metrics are read."""

    def __init__(self, gauges: Callable[[], Iterable[Metric]]) -> None:
        self._registry = CollectorRegistry()
        ProcessCollector(registry=self._registry)
        self._registry.register(_Gauges(gauges))
        self.requests = Counter(
            "wingfit_http_requests", "Requests answered.", ["method", "path", "status"], registry=self._registry
        )
        self.seconds = Histogram(
            "wingfit_http_request_seconds",
            "Time to answer, without event streams.",
            ["method", "path"],
            buckets=SECONDS,
            registry=self._registry,
        )
        self.slow_clients = Counter(
            "wingfit_slow_clients", "Connections closed because the client read too slowly.", registry=self._registry
        )

    def count(self, scope: Scope, status: int, seconds: float) -> None:
        """Count a request by method, route and HTTP ``status``; ``seconds``: time to answer.

        Unknown methods and paths count as "other", so that callers cannot create any number of Prometheus series.
        """
        path = getattr(scope.get("route"), "path", "") or "other"
        method = scope["method"] if scope["method"] in METHODS else "other"
        self.requests.labels(method, path, str(status)).inc()
        if not path.endswith("/events"):
            self.seconds.labels(method, path).observe(seconds)

    def text(self) -> bytes:
        """Return all metrics in the text format of Prometheus."""
        return generate_latest(self._registry)


class _Gauges(Collector):
    def __init__(self, gauges: Callable[[], Iterable[Metric]]) -> None:
        self._gauges = gauges

    def describe(self) -> list[Metric]:
        """Return an empty list, so that registering this collector does not read the gauges."""
        return []

    def collect(self) -> Iterable[Metric]:
        """Return the present state of the service as Prometheus gauges."""
        return self._gauges()


class MetricsAndLog:
    """Middleware that counts and logs every request, and gives it an id, which the log and the answer contain."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request; a connection of another type is passed on."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        start, status = time.perf_counter(), 500
        given = Headers(scope=scope).get(REQUEST_ID, "")
        request_id = given if VALID_ID.fullmatch(given) else secrets.token_hex(8)

        async def with_id(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                fail_points.passing("answer")
                message["headers"] = [*message["headers"], (REQUEST_ID.lower().encode(), request_id.encode())]
            await send(message)

        token = REQUEST.set(request_id)
        try:
            await self.app(scope, receive, with_id)
        finally:
            seconds = time.perf_counter() - start
            scope["app"].state.service.metrics.count(scope, status, seconds)
            client = (scope.get("client") or ("",))[0]
            extra = {"ms": round(1e3 * seconds, 2), "client": client}
            LOG.info("%s %s %d", scope["method"], scope["path"], status, extra=extra)
            audit.record(scope, status, request_id)
            REQUEST.reset(token)


class JsonFormatter(logging.Formatter):
    """Formats a log record as one JSON object on one line."""

    # The attributes of every record; all others were given in ``extra``.
    STANDARD = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "taskName"}

    def format(self, record: logging.LogRecord) -> str:
        """Return ``record`` as JSON."""
        line: dict[str, Any] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname,
            "logger": record.name,
            "message": record.getMessage(),
        }
        if REQUEST.get():
            line["request"] = REQUEST.get()
        line |= {key: value for key, value in vars(record).items() if key not in self.STANDARD}
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str)


def set_up_log(log_format: LogFormat) -> None:
    """Log to standard error, as text or JSON.

    Only the JSON log contains every request: in a text log the requests would hide other messages.
    """
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    logging.getLogger("alembic").setLevel(logging.WARNING)
    if log_format == "json":
        for handler in logging.getLogger().handlers:
            handler.setFormatter(JsonFormatter())
    else:
        LOG.setLevel(logging.WARNING)
