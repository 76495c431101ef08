"""Routes about the service: health, metrics, the schemas of datasets and findings, and a page that shows the API."""

from __future__ import annotations

from html import escape
from typing import Any

from fastapi import APIRouter, Request
from prometheus_client import CONTENT_TYPE_LATEST
from starlette.responses import HTMLResponse, PlainTextResponse

from wingfit.client.answers import Health
from wingfit.service.container import ServiceDep
from wingfit.service.http import responses as http
from wingfit.service.http.problems import ProblemError

router = APIRouter(tags=["service"])


@router.get("/v1/health", responses=http.errors(), summary="Health")
async def health(service: ServiceDep) -> Health:
    """Return whether the service answers, and whether it can compute."""
    return await service.health.now()


@router.get("/v1/ready", responses=http.errors(503), summary="Readiness")
async def ready(service: ServiceDep) -> Health:
    """Return 200 once jobs can be computed (the evaluator is ready and the database answers), else 503."""
    health = await service.health.now()
    if health["status"] != "ok":
        detail = health["detail"] or "the evaluator is starting; jobs are accepted, and wait"
        raise ProblemError(503, "not-ready", detail)
    return health


@router.get(
    "/v1/metrics",
    response_class=PlainTextResponse,
    responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}, **http.errors(503)},
    summary="Metrics",
)
async def metrics(service: ServiceDep) -> PlainTextResponse:
    """Return the counters and gauges of the service in the text format of Prometheus."""
    try:
        return PlainTextResponse(await service.metrics_text(), media_type=CONTENT_TYPE_LATEST)
    except TimeoutError:
        raise ProblemError(503, "busy", "the metrics are not ready in time; try again in some seconds") from None


@router.get("/v1/schemas/dataset", responses=http.errors(), summary="Schema of dataset.yaml")
def dataset_schema() -> dict[str, Any]:
    """Return the JSON Schema of ``dataset.yaml``."""
    from wingfit.records.description.schema import dataset_schema as schema

    return schema()


@router.get("/v1/schemas/finding", responses=http.errors(), summary="Schema of a finding")
def finding_schema() -> dict[str, Any]:
    """Return the JSON Schema of a finding, the result of a diagnosis."""
    from wingfit.report.schema import finding_schema as schema

    return schema()


@router.get("/docs", include_in_schema=False)
def docs(request: Request) -> HTMLResponse:
    """Show the calls of the API as plain HTML, because the usual viewers load scripts from other sites."""
    specification: dict[str, Any] = request.app.openapi()
    sections = [
        _operation(method, path, operation)
        for path, methods in specification["paths"].items()
        for method, operation in methods.items()
    ]
    return HTMLResponse(_PAGE.format(version=escape(specification["info"]["version"]), sections="\n".join(sections)))


def _operation(method: str, path: str, operation: dict[str, Any]) -> str:
    parameters = "".join(
        f"<li><code>{escape(p['name'])}</code> ({escape(p['in'])}) {escape(p.get('description', ''))}</li>"
        for p in operation.get("parameters", ())
    )
    answers = ", ".join(
        f"{escape(status)} {escape(answer.get('description', ''))}"
        for status, answer in operation["responses"].items()
        if status != "default"
    )
    return (
        f"<section><h2><code>{method.upper()} {escape(path)}</code></h2>"
        f"<p>{escape(operation.get('description', ''))}</p>"
        f"<ul>{parameters}</ul><p>Answers: {answers}</p></section>"
    )


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>wingfit API</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><meta name="color-scheme" content="light dark">
<link rel="icon" href="/icon.svg" type="image/svg+xml">
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem }}
h2 {{ font-size: 1.1rem; margin: 2rem 0 0.3rem }}
</style></head><body>
<h1>wingfit API {version}</h1>
<p>Machine-readable, with all shapes and examples:
<a href="/openapi.json">openapi.json</a>.</p>
{sections}
</body></html>
"""
