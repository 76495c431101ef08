"""Builds a series of any rig from its description and samples, describes one for a file, and checks both."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wingfit.records.description.convert import to_dataclass
from wingfit.records.description.dataset_file import SeriesDatasetFile
from wingfit.records.description.series_file import SeriesRecordingFile
from wingfit.records.description.yaml_text import Document
from wingfit.records.errors import Faults, nearest
from wingfit.records.files.plausibility import Locate, check_frames, check_times
from wingfit.records.files.table import Samples
from wingfit.records.limits import FORMAT_VERSION
from wingfit.records.series import Channel, Quantity, Series, SeriesDataset, difference_of_repeats
from wingfit.records.units import from_si

_SHOWN = 3
_PERIOD = "check its unit (s), record at least one period, or leave it out"


def to_series(checked: SeriesDatasetFile, entry: SeriesRecordingFile, samples: Samples) -> Series:
    """Return the recording that ``entry`` of the description ``checked`` describes, with its ``samples``."""
    channels = quantities(checked)[0]
    columns = {name: k for k, name in enumerate(samples.quantities)}
    return Series(
        name=entry.name,
        times=samples.times,
        quantities=channels,
        values=np.ascontiguousarray(samples.values[:, [columns[one.name] for one in channels]]),
        inputs={one.name: samples.values[:, columns[one.name]].copy() for one in checked.inputs},
        settings={name: float(value) for name, value in entry.settings.items()},
        estimates={name: float(value) for name, value in entry.estimates.items()},
        repeats=entry.repeats or "",
        period=None if entry.period_s is None else float(entry.period_s),
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


def check_attributes(recording: Series, dataset: SeriesDataset, faults: Faults) -> None:
    """Add a fault for each attribute of ``recording`` that cannot be stored in files of ``dataset``."""
    where = f"recording {recording.name!r}"
    if recording.quantities != dataset.channels:
        message = "are not the channels of the dataset; all recordings must have these, in the same order"
        faults.add(f"{where}: quantities", ", ".join(recording.channels), message)
        return
    listed = [one.name for one in dataset.inputs]
    for name in recording.inputs:
        if name not in listed:
            message = f"no input of the dataset is called {name!r}; {nearest(name, listed)}"
            faults.add(f"{where}: inputs", name, message)
    for name in listed:
        if name not in recording.inputs:
            faults.add(f"{where}: inputs", None, f"the input {name!r} of the dataset is missing; add it")
    times = len(recording.times)
    wanted: list[tuple[str, object, tuple[int, ...]]] = [
        ("times", recording.times, (times,)),
        ("values", recording.values, (times, len(recording.channels))),
        *((f"inputs[{name!r}]", samples, (times,)) for name, samples in recording.inputs.items()),
    ]
    for what, array, shape in wanted:
        if np.shape(np.asarray(array)) != shape or np.asarray(array).dtype != np.float64:
            found = f"{np.asarray(array).dtype} {list(np.shape(np.asarray(array)))}"
            message = f"is {found}; it must be float64 {list(shape)}: convert or transpose it"
            faults.add(f"{where}: {what}", found, message)


def check_series(recording: Series, where: str, at: Locate, faults: Faults) -> None:
    """Add a fault for each error in the times, values and inputs of ``recording``.

    In messages, ``where`` is the place of the recording and ``at(row)`` that of one row.
    """
    check_frames(len(recording.times), where, faults, "samples")
    increasing = check_times(recording.times, at, faults)
    for row in np.flatnonzero(np.isinf(recording.values).any(axis=1))[:_SHOWN]:
        faults.add(at(int(row)), "inf", "a channel is infinite; it must be finite, or missing")
    for name, samples in recording.inputs.items():
        for row in np.flatnonzero(~np.isfinite(samples))[:_SHOWN]:
            message = (
                f"input {name!r} has no finite value; an input needs one in every row: interpolate, or cut the row"
            )
            faults.add(at(int(row)), None, message)
    if recording.values.size and np.isnan(recording.values).all():
        faults.add(where, None, "no channel has a value; leave the recording out")
    if increasing and recording.period is not None and len(recording.times) > 1:
        covered = float(np.ptp(recording.times) + np.median(np.diff(recording.times)))
        if recording.period > covered:
            message = f"period_s is {recording.period:.6g} s, but the recording lasts {covered:.6g} s; {_PERIOD}"
            faults.add(where, recording.period, message)


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
