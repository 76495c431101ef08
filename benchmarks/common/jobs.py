"""Jobs that a benchmark submits to a server and waits for."""

from __future__ import annotations

import time
from typing import Any

import httpx

FINAL = ("SUCCEEDED", "FAILED", "CANCELLED")
POLL_SECONDS = 0.05


def succeeded(http: httpx.Client, kind: str, body: dict[str, Any]) -> str:
    """Submit a job (``kind`` is "runs" or "diagnoses"), wait for it, and return its id.

    RuntimeError if it does not succeed.
    """
    job = str(http.post(f"/v1/{kind}", json=body).json()["id"])
    while (now := http.get(f"/v1/{kind}/{job}").json())["state"] not in FINAL:
        time.sleep(POLL_SECONDS)
    if now["state"] != "SUCCEEDED":
        raise RuntimeError(f"{kind} {job} is {now['state']}: {now['error']}")
    return job
