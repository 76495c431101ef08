"""Creates valid objects on the server for the fuzzer: datasets of tracks and forces, runs, a diagnosis, a key."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import httpx

from benchmarks.abuse import uploads
from benchmarks.abuse.valid_values import ID
from benchmarks.common.files import archive
from benchmarks.common.jobs import succeeded

Json = dict[str, Any]
SEARCH = {"division": "4", "population": 8, "max_generations": 1, "mode": "joint"}
DIAGNOSIS = {"without": ["clap_and_peel"], "suspects": ["clap_and_peel"], "refits": 1}


def names(http: httpx.Client) -> dict[str, str]:
    """Upload a dataset of each kind, marker tracks and forces, calibrate each, and return the ids.

    They are returned by placeholder in the paths of cases: "{dataset}" (of tracks), "{forces}" (dataset),
    "{recording}", "{run}" and "{run of forces}".
    """
    dataset = http.post("/v1/datasets", files={"file": ("valid.zip", uploads.small_archive())}).json()
    forces = http.post("/v1/datasets", files={"file": ("valid.zip", archive("delfly"))}).json()
    return {
        "{dataset}": dataset["id"],
        "{forces}": forces["id"],
        "{recording}": dataset["recordings"][0]["name"],
        "{run}": succeeded(http, "runs", {"dataset_id": dataset["id"]} | SEARCH),
        "{run of forces}": succeeded(http, "runs", {"dataset_id": forces["id"]}),
    }


def values(http: httpx.Client, named: dict[str, str]) -> Json:
    """Return valid values of request fields for :mod:`benchmarks.abuse.valid_values`.

    ``named``: ids of :func:`names`. The values that depend on the kind of dataset are under "tracks" and "forces".
    """
    key = http.post("/v1/keys", json={"name": "fuzzed", "scopes": ["admin"]}).json()
    diagnosis = succeeded(http, "diagnoses", {"dataset_id": named["{forces}"]} | DIAGNOSIS)
    kinds = {"tracks": ("{dataset}", "{run}"), "forces": ("{forces}", "{run of forces}")}
    of_kind = {kind: _of(http, named[dataset], named[run]) for kind, (dataset, run) in kinds.items()}
    return of_kind | {
        "diagnosis_id": diagnosis,
        "key_id": key["id"],
        "key": key["secret"],
        "effects": [one["name"] for one in http.get("/v1/effects").json()["effects"]],
        "examples": sorted(set(ID.findall(http.get("/openapi.json").text))),
    }


def _of(http: httpx.Client, dataset_id: str, run_id: str) -> Json:
    dataset = http.get(f"/v1/datasets/{dataset_id}").json()
    genes = http.get(f"/v1/runs/{run_id}/genome").json()["genes"]
    applies = "wing" if dataset["kind"] == "tracks" else "vehicle"
    return {
        "dataset_id": dataset_id,
        "run_id": run_id,
        "recordings": [one["name"] for one in dataset["recordings"]],
        "genes": {gene["name"]: gene["nominal"] for gene in genes},
        "effects": [one["name"] for one in http.get("/v1/effects").json()["effects"] if applies in one["applies_to"]],
        "terms": [one["name"] for one in http.get("/v1/models").json()["terms"]],
    }


def cancel_queued(http: httpx.Client) -> None:
    """Cancel the jobs that wait for a worker, because they need not be computed."""
    for kind in ("runs", "diagnoses"):
        _cancel(http, (one["id"] for one in http.get(f"/v1/{kind}?state=QUEUED&limit=200").json()["items"]), kind)


def _cancel(http: httpx.Client, ids: Iterable[str], kind: str) -> None:
    for one in ids:
        http.post(f"/v1/{kind}/{one}/cancel")
