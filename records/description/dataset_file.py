"""The keys of ``dataset.yaml`` as pydantic models, in the units of the file, with physical limits.

The models check keys and single values; ``wingfit.records.description.consistency`` checks relations between values.
The published JSON Schema is generated from these models.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Annotated, Literal, get_args

from pydantic import BeforeValidator, Field

from wingfit.records.description.camera_file import MOST_CAMERAS, CameraFile
from wingfit.records.description.fields import Name, Prose, Strict, Title, whole
from wingfit.records.description.series_file import ChannelFile, QuantityFile, SeriesRecordingFile
from wingfit.records.description.vehicle_file import VehicleFile, VehicleLimitsFile, VehicleRecordingFile
from wingfit.records.description.wing_file import FrameErrorFile, WingFile, WingLimitsFile, WingRecordingFile
from wingfit.records.limits import MAX_QUANTITIES, MAX_RECORDINGS
from wingfit.records.mistake_kinds import MistakeKind

VERIFIED = "likely mistakes that you have verified to be none, so that no check warns of them"
MOST_VERIFIED = len(get_args(MistakeKind))
LIMITS = "[least, largest] value of the settings that the rig allows: no recording beyond is proposed"


class _DatasetFile(Strict):
    format_version: Annotated[Literal[1], BeforeValidator(whole)]
    name: Title
    description: Prose = ""
    held_out: list[Name] = Field(default_factory=list, max_length=MAX_RECORDINGS)


class WingDatasetFile(_DatasetFile):
    """A dataset of a wing: its description, and recordings of the positions of its markers."""

    wing: WingFile
    frame_error: FrameErrorFile | None = Field(
        None,
        description="standard errors of the frame of all tracks, about and along x, y and z of the wing; leave out if "
        "unknown",
    )
    cameras: list[CameraFile] = Field(
        default_factory=list,
        max_length=MOST_CAMERAS,
        description="which filmed all recordings, two to eight; leave out if unknown",
    )
    rig_limits: WingLimitsFile | None = Field(None, description=LIMITS)
    verified: list[MistakeKind] = Field(default_factory=list, max_length=MOST_VERIFIED, description=VERIFIED)
    recordings: list[WingRecordingFile] = Field(min_length=1, max_length=MAX_RECORDINGS)


class VehicleDatasetFile(_DatasetFile):
    """A dataset of a vehicle: its description, and recordings of the forces of its wings."""

    vehicle: VehicleFile
    rig_limits: VehicleLimitsFile | None = Field(None, description=LIMITS)
    verified: list[MistakeKind] = Field(default_factory=list, max_length=MOST_VERIFIED, description=VERIFIED)
    recordings: list[VehicleRecordingFile] = Field(min_length=1, max_length=MAX_RECORDINGS)


class SeriesDatasetFile(_DatasetFile):
    """A dataset of any other rig: its channels, inputs and settings, and recordings of these."""

    rig: Title = Field(description="name of the rig")
    channels: list[ChannelFile] = Field(min_length=1, max_length=MAX_QUANTITIES)
    inputs: list[QuantityFile] = Field(default_factory=list, max_length=MAX_QUANTITIES)
    settings: list[QuantityFile] = Field(default_factory=list, max_length=MAX_QUANTITIES)
    recordings: list[SeriesRecordingFile] = Field(min_length=1, max_length=MAX_RECORDINGS)


DatasetFile = WingDatasetFile | VehicleDatasetFile | SeriesDatasetFile


def model_of(data: object) -> type[DatasetFile]:
    """Return the model for unchecked ``data``, by the keys that it has, even if they are misspelt.

    It is that of a vehicle for a key like ``vehicle``, that of any other rig for ``rig`` or one like ``channels``, and
    that of a wing for ``wing`` or if there is none of them.
    """
    keys = [str(key) for key in data] if isinstance(data, Mapping) else []
    if "wing" in keys:
        return WingDatasetFile
    if difflib.get_close_matches("vehicle", keys, 1, 0.7):
        return VehicleDatasetFile
    series = "rig" in keys or difflib.get_close_matches("channels", keys, 1, 0.7)
    return SeriesDatasetFile if series else WingDatasetFile
