"""The web application: routes, guards, pages."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.resources import files
from pathlib import Path

from fastapi import Depends, FastAPI, Request
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, Response
from starlette.routing import Match
from starlette.staticfiles import StaticFiles

from wingfit.service.auth.authentication import Gate
from wingfit.service.container import MakeEvaluator, Service
from wingfit.service.diagnoses.diagnoser import Diagnoser
from wingfit.service.http import problems, threads
from wingfit.service.http import responses as http
from wingfit.service.http.error_boundary import Unforeseen
from wingfit.service.http.openapi_additions import describe
from wingfit.service.http.pieces import Pieces
from wingfit.service.http.quick import Quick
from wingfit.service.http.request_limits import Guard
from wingfit.service.http.shortcut import SHORTCUT, Shortcut
from wingfit.service.operations.metrics_and_log import METRICS, Metrics, Observer
from wingfit.service.operations.shutdown import StopLimits
from wingfit.service.routes import backup, datasets, diagnoses, effects, exports, forces, keys, outcomes, runs, system
from wingfit.service.runs.engine import Engine
from wingfit.service.settings import Settings
from wingfit.service.storage.database import Database
from wingfit.service.version import wingfit_version

LOG = logging.getLogger("wingfit")
WEB = Path(__file__).parent / "web"
ROUTERS = (
    system.router,
    datasets.router,
    runs.router,
    outcomes.router,
    forces.router,
    diagnoses.router,
    exports.router,
    effects.router,
    keys.router,
    backup.router,
)
METHODS = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE"]
DESCRIPTION = (
    "Calibrates flapping-wing simulations on recordings of tracked markers or of forces. Upload a dataset, submit a "
    "run, watch its events, fetch its result; submit a diagnosis to find the physics that the model left out. Errors "
    "are problem details (RFC 9457)."
)


def create_app(
    settings: Settings,
    *,
    database: Database | None = None,
    engine: Engine | None = None,
    make_evaluator: MakeEvaluator | None = None,
    diagnoser: Diagnoser | None = None,
    limits: StopLimits | None = None,
) -> FastAPI:
    """Build the application; it opens the data folder when it starts, unless ``database`` is open already."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[dict[str, Shortcut | Metrics]]:
        opened = Database(settings.data) if database is None else database
        service = Service(settings, opened, engine, make_evaluator, diagnoser)
        app.state.service = service
        await run_in_threadpool(service.start)
        yield {SHORTCUT: service.shortcut, METRICS: service.metrics}  # for the protocol
        # Not in a thread of the pool: requests that hang may hold them all.
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
    describe(app)
    _mount_pages(app)
    app.add_middleware(Quick)
    app.add_middleware(Pieces)
    if settings.keys:
        app.add_middleware(Gate)
    app.add_middleware(Guard, allowed_hosts=settings.allowed_hosts)
    app.add_middleware(Unforeseen)
    app.add_middleware(Observer)
    return app


async def _nothing_here(request: Request) -> Response:
    """Tell an unknown path from a method that the path does not have; the pages at / would hide both."""
    scope = dict(request.scope)
    found = set()
    for method in METHODS:
        scope["method"] = method
        if any(route.matches(scope)[0] is Match.FULL for router in ROUTERS for route in router.routes):
            found.add(method)
    if "GET" in found and not request.url.path.endswith("/events"):
        found.add("HEAD")
    if not found:
        raise HTTPException(404, f"there is nothing at {request.url.path[:200]}; /docs lists the calls")
    allow = ", ".join(sorted(found))
    raise HTTPException(405, f"{request.method} is not possible here; possible: {allow}", {"Allow": allow})


def _mount_pages(app: FastAPI) -> None:
    @app.get("/assets/plotly.min.js", include_in_schema=False)
    def plotly() -> FileResponse:
        # The package's own file: the page needs no other origin.
        path = files("plotly") / "package_data" / "plotly.min.js"
        return FileResponse(str(path), media_type="text/javascript", headers={"Cache-Control": "max-age=86400"})

    if WEB.is_dir():
        app.mount("/", StaticFiles(directory=WEB, html=True), name="pages")
    else:
        LOG.warning("the pages are missing: %s is no folder", WEB)
