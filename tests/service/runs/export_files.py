"""Exports as tests fetch and read them."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import h5netcdf

from tests.service.conftest import Api

FORMATS = {"json": "application/json", "csv": "text/csv; charset=utf-8", "netcdf": "application/x-netcdf"}
ENDINGS = {"json": ".json", "csv": ".csv", "netcdf": ".nc"}


def exported(api: Api, path: str, form: str) -> bytes:
    answer = api.client.get(f"/v1/{path}/export", params={"format": form})
    assert answer.status_code == 200, answer.text
    assert answer.headers["Content-Type"] == FORMATS[form]
    return answer.content


def rows_of(api: Api, path: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(exported(api, path, "csv").decode(), newline="")))


@contextmanager
def opened(data: bytes) -> Iterator[Any]:
    with h5netcdf.File(io.BytesIO(data), "r", decode_vlen_strings=True) as file:
        yield file


def variables(group: Any) -> Iterator[tuple[str, Any]]:
    for name, variable in group.variables.items():
        yield f"{group.name}/{name}", variable
    for inner in group.groups.values():
        yield from variables(inner)


def texts(variable: Any) -> list[str]:
    return [str(text) for text in variable[:]]
