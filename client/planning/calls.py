"""The method of the client that plans an experiment."""

from __future__ import annotations

import uuid
from collections.abc import Mapping, Sequence
from typing import Any, cast

from wingfit.client.planning.answers import Plan
from wingfit.client.transport import Transport, given, part


class PlanCalls(Transport):
    """Base class of the client: plans."""

    def plan(
        self,
        dataset_id: str,
        *,
        suspects: Sequence[str] | None = (),
        genome: Mapping[str, float] | None = None,
        genes: Sequence[str] = (),
        recordings: Sequence[str] = (),
        **settings: Any,
    ) -> Plan:
        """Predict which genes and effects the recordings of a dataset identify, and which recordings add most.

        It takes seconds to minutes. ``suspects``: names of the effects that are compared; empty: all, None: none.
        ``genome``: values of genes at which the plan is made, such as the best of a run; others are nominal. ``genes``
        that are estimated, ``recordings`` that are planned with; empty: as a calibration does. ``settings``: further
        fields of the request, such as ``beats``, ``noise_mm``, ``add``, ``division`` (docs/api.md).
        """
        body = {"suspects": None if suspects is None else list(suspects), "genes": list(genes)}
        body |= {"recordings": list(recordings), **given(genome=genome and dict(genome), **settings)}
        path = f"/v1/datasets/{part(dataset_id)}/plan"
        return cast(Plan, self._json("POST", path, key=str(uuid.uuid4()), timeout=self.simulating, json=body))
