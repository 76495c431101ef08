"""The layout of ``dataset.yaml`` as pydantic models, in the units of the file, with physical limits.

These check the layout and single values; ``wingfit.records.description.consistency`` checks relations between values.
The published JSON Schema is generated from these models.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from wingfit.records.description.fields import Name, Prose, Strict, Title, whole
from wingfit.records.description.vehicle_file import VehicleFile, VehicleRecordingFile
from wingfit.records.description.wing_file import WingFile, WingRecordingFile
from wingfit.records.limits import MAX_RECORDINGS


class _DatasetFile(Strict):
    format_version: Annotated[Literal[1], BeforeValidator(whole)]
    name: Title
    description: Prose = ""
    held_out: list[Name] = Field(default_factory=list, max_length=MAX_RECORDINGS)


class WingDatasetFile(_DatasetFile):
    """A wing with recordings of its markers."""

    wing: WingFile
    recordings: list[WingRecordingFile] = Field(min_length=1, max_length=MAX_RECORDINGS)


class VehicleDatasetFile(_DatasetFile):
    """A vehicle with recordings of its forces."""

    vehicle: VehicleFile
    recordings: list[VehicleRecordingFile] = Field(min_length=1, max_length=MAX_RECORDINGS)


DatasetFile = WingDatasetFile | VehicleDatasetFile


def model_of(data: object) -> type[DatasetFile]:
    """The model for unchecked ``data``: a vehicle's if it has the key ``vehicle`` or a similar one, else a wing's."""
    keys = [str(key) for key in data] if isinstance(data, Mapping) else []
    meant = "wing" not in keys and difflib.get_close_matches("vehicle", keys, 1, 0.7)
    return VehicleDatasetFile if meant else WingDatasetFile
