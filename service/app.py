"""The web application: routes, middleware and the web page.

Middleware, from the outside to the inside; :func:`create_app` adds them in the reverse order:

1. :class:`MetricsAndLog` counts and logs every request, also refused ones, and gives it an id.
2. :class:`ErrorBoundary` answers errors that nothing else answers, also errors of the middleware inside it.
3. :class:`RequestLimits` checks host, origin and size, adds the security headers and sends large bodies in chunks.
4. :class:`Authentication` requires an API key, where keys are required, and sets the caller.

Inside them FastAPI validates a request and calls its route. Outside them :class:`header_limits.Protocol` parses HTTP
and limits headers and slow clients.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.resources import files
from pathlib import Path
from typing import Unpack

from fastapi import Depends, FastAPI, Request
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, Response
from starlette.routing import Match
from starlette.staticfiles import StaticFiles

from wingfit.service.auth.authentication import Authentication
from wingfit.service.container import Parts, Service
from wingfit.service.http import problems, threads
from wingfit.service.http import responses as http
from wingfit.service.http.error_boundary import ErrorBoundary
from wingfit.service.http.openapi_additions import extend_openapi
from wingfit.service.http.request_limits import RequestLimits
from wingfit.service.operations.metrics_and_log import METRICS, Metrics, MetricsAndLog
from wingfit.service.operations.shutdown import StopLimits
from wingfit.service.planning import routes as plans
from wingfit.service.routes import (
    backup,
    datasets,
    diagnoses,
    drive,
    effects,
    exports,
    films,
    forces,
    imports,
    keys,
    outcomes,
    recorded,
    runs,
    system,
    trackings,
)
from wingfit.service.settings import Settings
from wingfit.service.storage.database import Database
from wingfit.service.version import wingfit_version

LOG = logging.getLogger("wingfit")
WEB = Path(__file__).parent / "web"
# Routes are tried in this order, so the routers with the most requests come first.
ROUTERS = (
    runs.router,
    outcomes.router,
    plans.router,
    system.router,
    datasets.router,
    recorded.router,
    forces.router,
    diagnoses.router,
    drive.router,
    exports.router,
    imports.router,
    films.router,
    trackings.router,
    effects.router,
    keys.router,
    backup.router,
)
METHODS = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE"]
DESCRIPTION = (
    "Calibrates flapping-wing simulations against recordings of tracked markers or of forces. Upload a dataset, submit "
    "a run, watch its events, fetch its result; submit a diagnosis to find the missing physics of the model. Errors "
    "are problem details (RFC 9457)."
)


def create_app(
    settings: Settings, *, database: Database | None = None, limits: StopLimits | None = None, **parts: Unpack[Parts]
) -> FastAPI:
    """Build the web application; ``parts`` replace parts of the service, for tests.

    When it starts, the application opens the data folder of ``settings``, unless an open ``database`` is given.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[dict[str, Metrics]]:
        opened = Database(settings.data) if database is None else database
        service = Service(settings, opened, **parts)
        app.state.service = service
        await run_in_threadpool(service.start)
        yield {METRICS: service.metrics}  # for header_limits.Protocol
        # In a thread of its own, because hanging requests may hold all threads of the pool.
        app.state.stopped = await asyncio.wrap_future(threads.call("stop", lambda: service.stop(limits)))

    app = FastAPI(
        title="wingfit",
        version=wingfit_version(),
        description=DESCRIPTION,
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        dependencies=[Depends(http.refuse_unknown_query)],
    )
    problems.install(app)
    for router in ROUTERS:
        app.include_router(router)
    app.add_api_route("/v1/{rest:path}", _nothing_here, methods=METHODS, include_in_schema=False)
    extend_openapi(app)
    _mount_pages(app)
    if settings.keys:
        app.add_middleware(Authentication)
    app.add_middleware(RequestLimits, allowed_hosts=settings.allowed_hosts, film_mib=settings.max_film_mib)
    app.add_middleware(ErrorBoundary)
    app.add_middleware(MetricsAndLog)
    return app


async def _nothing_here(request: Request) -> Response:
    """Answer 404 for an unknown path and 405 for a method that the path does not have."""
    # The static files mounted at / would answer 404 for both.
    allowed = {
        method
        for method in METHODS
        for router in ROUTERS
        for route in router.routes
        if route.matches({**request.scope, "method": method})[0] is Match.FULL
    }
    if "GET" in allowed and not request.url.path.endswith("/events"):
        allowed.add("HEAD")
    if not allowed:
        raise HTTPException(404, f"there is nothing at {request.url.path[:200]}; /docs lists the API")
    allow = ", ".join(sorted(allowed))
    raise HTTPException(405, f"{request.method} is not allowed here; allowed: {allow}", {"Allow": allow})


def _mount_pages(app: FastAPI) -> None:
    @app.get("/assets/plotly.min.js", include_in_schema=False)
    def plotly() -> FileResponse:
        # The file of the plotly package, so that the page needs no other origin.
        path = files("plotly") / "package_data" / "plotly.min.js"
        return FileResponse(str(path), media_type="text/javascript", headers={"Cache-Control": "max-age=86400"})

    if WEB.is_dir():
        app.mount("/", StaticFiles(directory=WEB, html=True), name="pages")
    else:
        LOG.warning("the web page is not served: %s is not a folder", WEB)
