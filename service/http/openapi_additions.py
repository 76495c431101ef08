"""Additions to the OpenAPI document that FastAPI generates: the schema of problems, examples, links, 304 responses."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any

from fastapi import FastAPI
from pydantic import TypeAdapter

from wingfit.client.answers import Problem
from wingfit.service.examples import EXAMPLES

Json = dict[str, Any]
# Path and status of each call that creates something, and the name of its id in other paths and bodies.
CREATING = (
    ("/v1/datasets", "201", "dataset_id"),
    ("/v1/runs", "202", "run_id"),
    ("/v1/diagnoses", "202", "diagnosis_id"),
    ("/v1/films", "201", "film_id"),
    ("/v1/trackings", "202", "tracking_id"),
)
ID = "$response.body#/id"
# Settings in answers, and the requests that set them.
SETTINGS = {"RunSpec": "RunIn", "DiagnosisSpec": "DiagnosisIn", "TrackingSpec": "TrackingIn"}
FORM = "multipart/form-data"


def extend_openapi(app: FastAPI) -> None:
    """Make the OpenAPI document that ``app`` publishes contain the additions of this module."""
    generate = app.openapi

    def openapi() -> Json:
        cached = app.openapi_schema is not None
        specification = generate()
        if not cached:
            _problems(specification)
            _examples(specification)
            _links(specification)
            _remove_null(specification)
            _not_modified(specification)
        return specification

    app.openapi = openapi  # type: ignore[method-assign]  # as FastAPI documents it


def _problems(specification: Json) -> None:
    schemas = specification.setdefault("components", {}).setdefault("schemas", {})
    problem = TypeAdapter(Problem).json_schema(ref_template="#/components/schemas/{model}")
    schemas.update(problem.pop("$defs", {}))
    schemas["Problem"] = problem


def _examples(specification: Json) -> None:
    """Add examples to the schemas of answers; describe settings in answers as in the requests that set them."""
    schemas = specification["components"]["schemas"]
    for shape, example in EXAMPLES.items():
        schemas[shape.__name__]["examples"] = [example]
    for answer, request in SETTINGS.items():
        for name, field in schemas[answer]["properties"].items():
            if description := schemas[request]["properties"].get(name, {}).get("description"):
                field["description"] = description


def _links(specification: Json) -> None:
    """Add links from every answer that creates a resource to the calls that take the resource's id."""
    for path, status, name in CREATING:
        links = specification["paths"][path]["post"]["responses"][status].setdefault("links", {})
        for other, methods in specification["paths"].items():
            for method, operation in methods.items():
                title = operation["summary"]
                if f"{{{name}}}" in other:
                    links[title] = {"operationId": operation["operationId"], "parameters": {name: ID}}
                elif method == "post" and other != path and name in _fields(specification, operation):
                    links[title] = {"operationId": operation["operationId"], "requestBody": {name: ID}}


def _fields(specification: Json, operation: Json, media_type: str = "application/json") -> Json:
    """Return the fields of the request body of an ``operation`` (name to JSON schema); empty if it has none."""
    content = operation.get("requestBody", {}).get("content", {}).get(media_type, {})
    name = content.get("schema", {}).get("$ref", "").rpartition("/")[2]
    fields: Json = specification["components"]["schemas"].get(name, {}).get("properties", {})
    return fields


def _remove_null(specification: Json) -> None:
    """Remove null from the types of parameters and form fields: unlike JSON fields they can only be omitted."""
    for methods in specification["paths"].values():
        for operation in methods.values():
            given = [parameter["schema"] for parameter in operation.get("parameters", ())]
            for schema in [*given, *_fields(specification, operation, FORM).values()]:
                others = [one for one in schema.get("anyOf", ()) if one != {"type": "null"}]
                if len(others) == 1:
                    schema.update(others[0])
                    del schema["anyOf"]


def _not_modified(specification: Json) -> None:
    """Add the 304 response to every operation that takes an ``If-None-Match``."""
    for methods in specification["paths"].values():
        for operation in methods.values():
            if any(parameter["name"] == "If-None-Match" for parameter in operation.get("parameters", ())):
                operation["responses"]["304"] = {"description": HTTPStatus(304).phrase}
