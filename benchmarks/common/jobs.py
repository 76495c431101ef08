"""Submits a job (a calibration or a diagnosis) to a server over HTTP and waits until it has succeeded."""

from __future__ import annotations

import time
from typing import Any

import httpx

FINAL = ("SUCCEEDED", "FAILED", "CANCELLED")
POLL_SECONDS = 0.05


def succeeded(http: httpx.Client, kind: str, body: dict[str, Any]) -> str:
    """Submit a job to the server of ``http``, wait until it has ended, and return its id.

    ``kind``: "runs" or "diagnoses"; ``body``: JSON of the request. RuntimeError if the job does not succeed.
    """
    job = str(http.post(f"/v1/{kind}", json=body).json()["id"])
    while (now := http.get(f"/v1/{kind}/{job}").json())["state"] not in FINAL:
        time.sleep(POLL_SECONDS)
    if now["state"] != "SUCCEEDED":
        raise RuntimeError(f"{kind} {job} is {now['state']}: {now['error']}")
    return job
