"""Methods of the client with which a driver takes the simulations of a job, and returns their results."""

from __future__ import annotations

import uuid
from collections.abc import Sequence
from typing import Any, cast

from wingfit.client.drive_answers import Settled, Work
from wingfit.client.transport import Transport, part


class DriveCalls(Transport):
    """Base class of the client: methods of drivers, which simulate the rig of a job (:func:`wingfit.drive`)."""

    def rigs(self) -> list[str]:
        """List the names of the rigs that are installed on the server."""
        return cast(list[str], self._json("GET", "/v1/rigs")["rigs"])

    def take_work(
        self,
        job_id: str,
        driver: str,
        *,
        limit: int = 1,
        wait_s: float = 0.0,
        holding: Sequence[str] = (),
        with_rig: bool = False,
        leaving: bool = False,
    ) -> Work:
        """Take up to ``limit`` simulations of a run or diagnosis, and return them with the state of the job.

        ``driver``: any name that is yours alone; ``wait_s``: how long to wait for a simulation, at most 25;
        ``holding``: ids of those that it took and computes; ``with_rig``: whether to return the declaration of
        the rig; ``leaving``: give back what this driver took.
        """
        body = {"driver": driver, "limit": limit, "wait_s": wait_s, "holding": list(holding)}
        body |= {"with_rig": with_rig, "leaving": leaving}
        return cast(Work, self._json("POST", f"/v1/drive/{part(job_id)}/work", json=body, key=str(uuid.uuid4())))

    def return_results(self, job_id: str, driver: str, results: Sequence[dict[str, Any]]) -> Settled:
        """Return results of simulations: each has the id, and either channels (by name, lists) or a reason."""
        body = {"driver": driver, "results": list(results)}
        path = f"/v1/drive/{part(job_id)}/results"
        return cast(Settled, self._json("POST", path, json=body, key=str(uuid.uuid4())))
