"""The keys of ``dataset.yaml`` as pydantic models, in the units of the file, with physical limits.

The models check keys and single values; ``wingfit.records.description.consistency`` checks relations between values.
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
    """A dataset of a wing: its description, and recordings of the positions of its markers."""

    wing: WingFile
    recordings: list[WingRecordingFile] = Field(min_length=1, max_length=MAX_RECORDINGS)


class VehicleDatasetFile(_DatasetFile):
    """A dataset of a vehicle: its description, and recordings of the forces of its wings."""

    vehicle: VehicleFile
    recordings: list[VehicleRecordingFile] = Field(min_length=1, max_length=MAX_RECORDINGS)


DatasetFile = WingDatasetFile | VehicleDatasetFile


def model_of(data: object) -> type[DatasetFile]:
    """Return the model for unchecked ``data``: a wing's, unless it has no key ``wing`` but one like ``vehicle``."""
    keys = [str(key) for key in data] if isinstance(data, Mapping) else []
    meant = "wing" not in keys and difflib.get_close_matches("vehicle", keys, 1, 0.7)
    return VehicleDatasetFile if meant else WingDatasetFile
