"""The published description (OpenAPI), beyond what the framework writes: problems, and where an answer leads."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI

from service.schemas import ProblemOut

Json = dict[str, Any]
# What makes a thing, the parameter of paths by which it is named, and how bodies name it.
MADE = (
    ("/v1/datasets", "201", "dataset_id"),
    ("/v1/runs", "202", "run_id"),
    ("/v1/diagnoses", "202", "diagnosis_id"),
)
ID = "$response.body#/id"


def describe(app: FastAPI) -> None:
    """Let ``app`` publish more than the framework does."""
    generate = app.openapi

    def openapi() -> Json:
        known = app.openapi_schema is not None
        specification = generate()
        if not known:
            _problems(specification)
            _links(specification)
        return specification

    app.openapi = openapi  # type: ignore[method-assign]  # the way that FastAPI documents


def _problems(specification: Json) -> None:
    schemas = specification.setdefault("components", {}).setdefault("schemas", {})
    problem = ProblemOut.model_json_schema(ref_template="#/components/schemas/{model}")
    schemas.update(problem.pop("$defs", {}))
    schemas["Problem"] = problem


def _links(specification: Json) -> None:
    """From every answer that makes something to the calls that take its id."""
    for path, status, name in MADE:
        links = specification["paths"][path]["post"]["responses"][status].setdefault("links", {})
        for other, methods in specification["paths"].items():
            for method, operation in methods.items():
                title = operation["summary"]
                if f"{{{name}}}" in other:
                    links[title] = {"operationId": operation["operationId"], "parameters": {name: ID}}
                elif method == "post" and other != path and name in _fields(specification, operation):
                    links[title] = {"operationId": operation["operationId"], "requestBody": {name: ID}}


def _fields(specification: Json, operation: Json) -> Json:
    """Fields of the JSON body that an operation takes."""
    content = operation.get("requestBody", {}).get("content", {}).get("application/json", {})
    name = content.get("schema", {}).get("$ref", "").rpartition("/")[2]
    fields: Json = specification["components"]["schemas"].get(name, {}).get("properties", {})
    return fields
