"""Bodies of the requests that drivers send."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonDict

from wingfit.records.limits import MAX_QUANTITIES, MAX_ROWS
from wingfit.rigs.declaration import Name, Number

MOST_SIMULATIONS = 1000
LONGEST_WAIT_S = 25.0
RESULTS: JsonDict = {"driver": "laptop-1", "results": [{"id": "sim_0", "channels": {"angle": [0.1, 0.2]}}]}
DRIVER = "names the process that computes; what a driver took and did not return is offered to others when it is silent"


class _Body(BaseModel):
    model_config = ConfigDict(extra="forbid")


class WorkIn(_Body):
    """A request for simulations to compute."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"driver": "laptop-1", "limit": 4}]})

    driver: Annotated[Name, Field(description=DRIVER)]
    limit: Annotated[int, Field(strict=True, ge=0, le=MOST_SIMULATIONS, description="largest number")] = 1
    wait_s: Annotated[
        Number, Field(ge=0, le=LONGEST_WAIT_S, description="how long the answer may wait for a simulation")
    ] = 0.0
    holding: Annotated[
        list[Name],
        Field(max_length=MOST_SIMULATIONS, description="ids that this driver has taken and computes; others are free"),
    ] = []
    with_rig: Annotated[bool, Field(description="whether the answer has the declaration of the rig")] = False
    leaving: Annotated[bool, Field(description="offer to others what this driver took, and wait for nothing")] = False


class ResultIn(_Body):
    """The result of one simulation: the values of every channel at the recording's samples, or why it failed."""

    id: Name
    channels: Annotated[
        dict[Name, Annotated[list[Number], Field(max_length=MAX_ROWS)]] | None,
        Field(
            max_length=MAX_QUANTITIES,
            description="by name of the channel, in its unit, at every sample of the recording; null if it failed",
        ),
    ] = None
    reason: Annotated[str | None, Field(min_length=1, max_length=2000, description="why it failed; else null")] = None
    error: Annotated[
        str | None,
        Field(min_length=1, max_length=2000, description="of the simulation itself, with which the job fails"),
    ] = None


class ResultsIn(_Body):
    """Results of simulations."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [RESULTS]})

    driver: Annotated[Name, Field(description=DRIVER)]
    results: Annotated[list[ResultIn], Field(min_length=1, max_length=MOST_SIMULATIONS)]
