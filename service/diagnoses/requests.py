"""The body of a request for a diagnosis."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StrictBool

from wingfit.service.rigs.stored_rig import RigIn
from wingfit.service.runs.requests import DATASET_ID, Axes, JobSettings, Name, Number, Title, Whole, once

MOST_REFITS = 50


Values = Annotated[dict[str, Number], Field(max_length=1000)]


class DiagnosisIn(JobSettings, BaseModel):
    """Body of a request for a diagnosis of a dataset, or of a run, whose settings apply where the request has none.

    See `wingfit.diagnosis.DiagnosisSpec`.
    """

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"dataset_id": DATASET_ID, "division": "11", "name": "what is missing?"}]},
    )

    dataset_id: Annotated[Name | None, Field(description="null: that of the run")] = None
    run_id: Annotated[Name | None, Field(description="run to start from: its best genome and its settings")] = None
    rig: RigIn | None = None
    name: Title | None = None
    genes: Annotated[
        list[Name], Field(max_length=1000, description="free genes of the nominal model; empty: all usual")
    ] = []
    fixed: Annotated[Values, Field(description="genes that keep a value")] = {}
    suspects: Annotated[
        list[Name],
        AfterValidator(once),
        Field(max_length=100, description="effects to consider; empty: all of /v1/effects that fit"),
    ] = []
    refine: Annotated[StrictBool, Field(description="whether a finer division may be taken where it limits")] = True
    refits: Annotated[Whole, Field(ge=1, le=MOST_REFITS, description="effects refitted in full at most")] = 8
    exhaustive: Annotated[
        StrictBool, Field(description="whether every pair of the suspects is fitted; for at most 20 suspects")
    ] = False
    axes: Annotated[Axes | None, Field(description="vehicles only; null: all that every recording has")] = None
