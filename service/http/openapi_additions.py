"""The published description (OpenAPI), beyond what the framework writes: problems, and where an answer leads."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any

from fastapi import FastAPI
from pydantic import TypeAdapter

from wingfit.client.answers import Problem
from wingfit.service.examples import EXAMPLES

Json = dict[str, Any]
# What makes a thing, the parameter of paths by which it is named, and how bodies name it.
MADE = (
    ("/v1/datasets", "201", "dataset_id"),
    ("/v1/runs", "202", "run_id"),
    ("/v1/diagnoses", "202", "diagnosis_id"),
)
ID = "$response.body#/id"
# Settings in answers, and the requests that set them.
SETTINGS = {"RunSpec": "RunIn", "DiagnosisSpec": "DiagnosisIn"}
FORM = "multipart/form-data"


def describe(app: FastAPI) -> None:
    """Let ``app`` publish more than the framework does."""
    generate = app.openapi

    def openapi() -> Json:
        known = app.openapi_schema is not None
        specification = generate()
        if not known:
            _problems(specification)
            _examples(specification)
            _links(specification)
            _nothing_is_null(specification)
            _unchanged(specification)
        return specification

    app.openapi = openapi  # type: ignore[method-assign]  # the way that FastAPI documents


def _problems(specification: Json) -> None:
    schemas = specification.setdefault("components", {}).setdefault("schemas", {})
    problem = TypeAdapter(Problem).json_schema(ref_template="#/components/schemas/{model}")
    schemas.update(problem.pop("$defs", {}))
    schemas["Problem"] = problem


def _examples(specification: Json) -> None:
    """Give answers their examples, and their settings the descriptions that the requests give them."""
    schemas = specification["components"]["schemas"]
    for shape, example in EXAMPLES.items():
        schemas[shape.__name__]["examples"] = [example]
    for answer, request in SETTINGS.items():
        for name, field in schemas[answer]["properties"].items():
            if description := schemas[request]["properties"].get(name, {}).get("description"):
                field["description"] = description


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


def _fields(specification: Json, operation: Json, media_type: str = "application/json") -> Json:
    """Fields of the body that an operation takes."""
    content = operation.get("requestBody", {}).get("content", {}).get(media_type, {})
    name = content.get("schema", {}).get("$ref", "").rpartition("/")[2]
    fields: Json = specification["components"]["schemas"].get(name, {}).get("properties", {})
    return fields


def _nothing_is_null(specification: Json) -> None:
    """A parameter or field of a form that is not given is left out: unlike JSON, a text cannot say null."""
    for methods in specification["paths"].values():
        for operation in methods.values():
            given = [parameter["schema"] for parameter in operation.get("parameters", ())]
            for schema in [*given, *_fields(specification, operation, FORM).values()]:
                kept = [one for one in schema.get("anyOf", ()) if one != {"type": "null"}]
                if len(kept) == 1:
                    schema.update(kept[0])
                    del schema["anyOf"]


def _unchanged(specification: Json) -> None:
    """Who may say what he has may be told that it is still so."""
    for methods in specification["paths"].values():
        for operation in methods.values():
            if any(parameter["name"] == "If-None-Match" for parameter in operation.get("parameters", ())):
                operation["responses"]["304"] = {"description": HTTPStatus(304).phrase}
