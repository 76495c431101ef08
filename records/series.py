"""Recordings of any rig: named channels over time, inputs and settings, in the units that the user states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from wingfit.records.array_types import Array, Bool, Float, Mask
from wingfit.records.limits import LARGEST, SMALLEST
from wingfit.records.name_lists import refuse_text
from wingfit.records.recorded import Recorded
from wingfit.records.series_checks import check_recording, check_recordings

SAME_TIMES = 1e-6  # of the duration: largest difference of the times of repeats
SAME_INPUTS = 1e-3  # largest relative difference of their inputs


@dataclass(frozen=True)
class Quantity:
    """A named quantity of a rig: an input, or a setting; ``unit`` as the user writes it ("1" if it has none)."""

    name: str
    unit: str
    description: str = ""


@dataclass(frozen=True)
class Channel:
    """A measured quantity.

    Attributes:
        name: identifier, the name of its column in a file.
        unit: as the user writes it; "1" if it has none.
        standard_deviation: of the noise of one sample, in ``unit``; None if it is not known.
        place: where it is measured, as text for reports; "" if that has no meaning.
        description: for reports.
        accepted_error: root mean square, in ``unit``, by which the simulation may differ from the truth and still
            count as adequate, for a sensor that is more exact than any simulation; None: no more than the noise.
    """

    name: str
    unit: str
    standard_deviation: float | None = None
    place: str = ""
    description: str = ""
    accepted_error: float | None = None

    def __post_init__(self) -> None:
        for name in ("standard_deviation", "accepted_error"):
            value = getattr(self, name)
            if value is not None and not SMALLEST <= value <= LARGEST:
                unit = "" if self.unit == "1" else f" {self.unit}"
                raise ValueError(
                    f"channel {self.name!r}: {name} is {value:g}{unit}; give a positive number ({SMALLEST:g} to "
                    f"{LARGEST:g}) or None"
                )


@dataclass(frozen=True, eq=False)
class Series:
    """One recording of a rig: ``values`` [T, C] of C channels at T increasing ``times`` (s); NaN if not recorded.

    DatasetError if shapes do not fit, times do not increase, or a number other than a missing value is not finite.

    Attributes:
        name: identifier within its dataset.
        times: [T], s; not necessarily even.
        quantities: the C channels.
        values: [T, C], each column in the unit of its channel.
        inputs: samples [T] of each exogenous input (a voltage, a gust) at ``times``, by name.
        settings: values that were set for this recording (a mass, an airspeed), by name.
        estimates: estimates of genes that belong to this recording alone (an initial angle), by name of the gene.
        repeats: name of the group of recordings that repeat the same experiment; "" if it was not repeated.
        period: period (s) of the motion; None if it is not periodic.
    """

    name: str
    times: Float[Array, " T"]
    quantities: tuple[Channel, ...]
    values: Float[Array, "T C"]
    inputs: Mapping[str, Float[Array, " T"]] = field(default_factory=dict)
    settings: Mapping[str, float] = field(default_factory=dict)
    estimates: Mapping[str, float] = field(default_factory=dict)
    repeats: str = ""
    period: float | None = None

    def __post_init__(self) -> None:
        check_recording(self)

    @property
    def kind(self) -> Literal["series"]:
        """Return "series"."""
        return "series"

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the columns of ``values``."""
        return tuple(channel.name for channel in self.quantities)

    @property
    def standard_deviation(self) -> Float[Array, " C"] | None:
        """Stated standard deviation [C] of the noise of each channel; None unless all channels state one."""
        stated = [channel.standard_deviation for channel in self.quantities]
        return None if any(one is None for one in stated) else np.array(stated, float)

    @cached_property
    def valid(self) -> Bool[Mask, "T C"]:
        """True [T, C] where a value was recorded, False where it is missing (NaN)."""
        return np.isfinite(self.values)


def difference_of_repeats(first: Series, other: Series) -> str | None:
    """Return in what ``other`` does not repeat the experiment of ``first``, such as "settings"; None if it does."""
    span = max(float(np.ptp(first.times)), 1e-300)
    if len(first.times) != len(other.times) or not np.allclose(
        first.times, other.times, rtol=0.0, atol=SAME_TIMES * span
    ):
        return "sample times"
    if dict(first.settings) != dict(other.settings):
        return "settings"
    same = (np.allclose(samples, other.inputs[name], rtol=SAME_INPUTS) for name, samples in first.inputs.items())
    return None if all(same) else "inputs"


def recording_gene(gene: str, recording: str) -> str:
    """Return the name of the gene ``gene`` that belongs to the recording called ``recording`` alone."""
    return f"{gene}[{recording}]"


def belongs_to(gene: str, recording: str) -> bool:
    """Return whether the gene called ``gene`` belongs to the recording called ``recording`` alone."""
    return gene.endswith(f"[{recording}]")


@dataclass(frozen=True)
class SeriesDataset(Recorded[Series]):
    """Recordings of one rig that the user simulates.

    DatasetError if a name is used twice or is unknown, or if a recording does not hold what the dataset lists.

    Attributes:
        name: of the dataset.
        rig: name of the rig.
        recordings: all with the same channels and inputs.
        channels, inputs, settings: what the recordings hold, with units.
        held_out: names of recordings that are used for validation only, never for fitting.
        description: free text.
    """

    name: str
    rig: str
    recordings: tuple[Series, ...]
    channels: tuple[Channel, ...]
    inputs: tuple[Quantity, ...] = ()
    settings: tuple[Quantity, ...] = ()
    held_out: tuple[str, ...] = ()
    description: str = ""

    def __post_init__(self) -> None:
        refuse_text(self, "held_out")
        check_recordings(self)

    @property
    def kind(self) -> Literal["series"]:
        """Return "series"."""
        return "series"
