"""Builds a series of any rig from its description and samples, describes one for a file, and checks both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from wingfit.records.array_types import Array, Float
from wingfit.records.description.convert import to_dataclass
from wingfit.records.description.dataset_file import SeriesDatasetFile
from wingfit.records.description.series_file import SeriesRecordingFile
from wingfit.records.description.yaml_text import Document
from wingfit.records.errors import Faults
from wingfit.records.files.plausibility import check_frames
from wingfit.records.files.table import Samples
from wingfit.records.limits import FORMAT_VERSION
from wingfit.records.series import Channel, Quantity, Series, SeriesDataset, difference_of_repeats
from wingfit.records.series_checks import Locate, check_samples
from wingfit.records.units import from_si

_PERIOD = "check its unit (s), record at least one period, or leave it out"


def to_series(
    checked: SeriesDatasetFile, entry: SeriesRecordingFile, samples: Samples, where: str, at: Locate, faults: Faults
) -> Series | None:
    """Return the recording that ``entry`` of the description ``checked`` describes, with its ``samples``.

    None if they have errors, which are added to ``faults`` as in :func:`check_series`.
    """
    channels = quantities(checked)[0]
    columns = {name: k for k, name in enumerate(samples.quantities)}
    values = np.ascontiguousarray(samples.values[:, [columns[one.name] for one in channels]])
    inputs = {one.name: samples.values[:, columns[one.name]].copy() for one in checked.inputs}
    period = None if entry.period_s is None else float(entry.period_s)
    before = faults.count
    check_series(samples.times, values, inputs, period, where, at, faults)
    if faults.count > before:
        return None
    return Series(
        name=entry.name,
        times=samples.times,
        quantities=channels,
        values=values,
        inputs=inputs,
        settings={name: float(value) for name, value in entry.settings.items()},
        estimates={name: float(value) for name, value in entry.estimates.items()},
        repeats=entry.repeats or "",
        period=period,
    )


def to_series_dataset(checked: SeriesDatasetFile, recordings: Sequence[Series]) -> SeriesDataset:
    """Return the dataset that ``checked`` describes, with its ``recordings``."""
    channels, inputs, settings = quantities(checked)
    return SeriesDataset(
        checked.name,
        checked.rig,
        tuple(recordings),
        channels,
        inputs,
        settings,
        tuple(checked.held_out),
        checked.description,
    )


def quantities(
    checked: SeriesDatasetFile,
) -> tuple[tuple[Channel, ...], tuple[Quantity, ...], tuple[Quantity, ...]]:
    """Return the channels, inputs and settings that ``checked`` lists."""
    channels = tuple(to_dataclass(Channel, one) for one in checked.channels)
    inputs, settings = (tuple(to_dataclass(Quantity, q) for q in own) for own in (checked.inputs, checked.settings))
    return channels, inputs, settings


def describe_series(dataset: SeriesDataset) -> dict[str, object]:
    """Convert ``dataset``, without its samples, to the plain data of ``dataset.yaml``; nothing is checked."""
    lists: dict[str, Sequence[Channel | Quantity]] = {
        "channels": dataset.channels,
        "inputs": dataset.inputs,
        "settings": dataset.settings,
    }
    return {
        "format_version": FORMAT_VERSION,
        "name": dataset.name,
        **({"description": dataset.description} if dataset.description else {}),
        "rig": dataset.rig,
        **{key: [_quantity(one) for one in listed] for key, listed in lists.items() if listed or key == "channels"},
        "recordings": [_recording(one) for one in dataset.recordings],
        **({"held_out": list(dataset.held_out)} if dataset.held_out else {}),
    }


def _quantity(quantity: Channel | Quantity) -> dict[str, object]:
    data: dict[str, object] = {"name": quantity.name, "unit": 1 if quantity.unit == "1" else quantity.unit}
    if isinstance(quantity, Channel):
        if quantity.standard_deviation is not None:
            data["standard_deviation"] = from_si(quantity.standard_deviation)
        if quantity.accepted_error is not None:
            data["accepted_error"] = from_si(quantity.accepted_error)
        if quantity.place:
            data["place"] = quantity.place
    return data | ({"description": quantity.description} if quantity.description else {})


def _recording(recording: Series) -> dict[str, object]:
    data: dict[str, object] = {"name": recording.name}
    for key, values in (("settings", recording.settings), ("estimates", recording.estimates)):
        if values:
            data[key] = {name: from_si(value) for name, value in values.items()}
    if recording.repeats:
        data["repeats"] = recording.repeats
    return data | ({} if recording.period is None else {"period_s": from_si(recording.period)})


def samples_of(recording: Series) -> Samples:
    """Return the numbers of ``recording`` as files hold them: channels, then inputs."""
    values = np.column_stack([recording.values, *recording.inputs.values()])
    names = (*recording.channels, *recording.inputs)
    return Samples(recording.times, values, np.arange(len(recording.times)), quantities=names)


def check_series(
    times: Float[Array, " T"],
    values: Float[Array, "T C"],
    inputs: Mapping[str, Float[Array, " T"]],
    period: float | None,
    where: str,
    at: Locate,
    faults: Faults,
) -> None:
    """Add a fault for each error in the times (s), channels and inputs of a recording with a ``period`` (s) or none.

    In messages, ``where`` is the place of the recording and ``at(row)`` that of one row.
    """
    check_frames(len(times), where, faults, "samples")
    increasing = check_samples(times, values, inputs, at, faults)
    if values.size and np.isnan(values).all():
        faults.add(where, None, "no channel has a value; leave the recording out")
    if increasing and period is not None and len(times) > 1:
        covered = float(np.ptp(times) + np.median(np.diff(times)))
        if period > covered:
            message = f"period_s is {period:.6g} s, but the recording lasts {covered:.6g} s; {_PERIOD}"
            faults.add(where, period, message)


def check_together(recordings: Sequence[Series], document: Document, faults: Faults) -> None:
    """Add a fault for each channel that no recording uses, and each recording that does not repeat its group.

    ``document`` describes all ``recordings``.
    """
    for k, channel in enumerate(recordings[0].quantities):
        found = [one.values[one.valid[:, k], k] for one in recordings if one.valid[:, k].any()]
        if found and any(np.ptp(values) for values in found):
            continue
        value = {float(values[0]) for values in found}
        state = "has no value in any recording" if not found else "never changes during a recording"
        if len(value) == 1:
            unit = "" if channel.unit == "1" else f" {channel.unit}"
            state = f"never changes: it is {min(value):.6g}{unit} throughout"
        remedy = (
            "check the sensor, or make it a setting, and remove its column" if found else "remove it and its column"
        )
        place = document.where(("channels", k))
        faults.add(place, channel.name, f"channel {channel.name!r} {state}; {remedy}")
    firsts: dict[str, Series] = {}
    for index, one in enumerate(recordings):
        first = firsts.setdefault(one.repeats, one)
        what = difference_of_repeats(first, one) if one.repeats else None
        if what:
            message = (
                f"recording {one.name!r} repeats {one.repeats!r} as {first.name!r} does, but has different {what}; "
                "resample them to the same, or remove 'repeats'"
            )
            faults.add(document.where(("recordings", index, "repeats")), one.repeats, message)
