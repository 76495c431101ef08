"""Conversion between the models of ``dataset.yaml`` and the dataclasses of ``wingfit.records``, exact both ways.

A key of the file is the name of the dataclass's attribute, followed by the unit where there is one: ``dihedral_deg``
holds ``Vehicle.dihedral``, in degrees. The names therefore determine the conversion (``wingfit.records.units``).
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from decimal import Decimal
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np
from pydantic import BaseModel

from wingfit.records.array_types import Array, Float
from wingfit.records.camera_pose import CameraPose
from wingfit.records.dataset import Condition, FrameError, Recording, RigLimits
from wingfit.records.description.camera_file import CameraFile
from wingfit.records.description.dataset_file import VehicleDatasetFile, WingDatasetFile
from wingfit.records.description.fields import models_in, tag_of
from wingfit.records.description.vehicle_file import VehicleFile, VehicleLimitsFile, VehicleRecordingFile
from wingfit.records.description.wing_file import FrameErrorFile, WingFile, WingLimitsFile, WingRecordingFile
from wingfit.records.description.yaml_text import Document, Path
from wingfit.records.errors import Faults, nearest
from wingfit.records.files.table import Samples
from wingfit.records.units import CELSIUS, DEG, MBAR, SI, Unit, from_si, to_si
from wingfit.records.vehicle import Vehicle
from wingfit.records.wing import Marker, Wing

T = TypeVar("T")
RecordingFile = WingRecordingFile | VehicleRecordingFile

_UNITS = {"deg": DEG, "mbar": MBAR, "c": CELSIUS}
_OTHER_NAMES = {"body_pitch_deg": "angle_of_attack_deg"}


def to_rig(dataset: WingDatasetFile | VehicleDatasetFile) -> Wing | Vehicle:
    """Convert the wing or vehicle of a checked description to its dataclass, in SI units."""
    if isinstance(dataset, VehicleDatasetFile):
        return to_dataclass(Vehicle, dataset.vehicle)
    return to_dataclass(Wing, dataset.wing)


def to_frame_error(dataset: WingDatasetFile | VehicleDatasetFile) -> FrameError | None:
    """Convert the errors of the frame in a checked description to SI units; None if they are not stated."""
    stated = dataset.frame_error if isinstance(dataset, WingDatasetFile) else None
    return to_dataclass(FrameError, stated) if stated else None


def describe_frame_error(error: FrameError) -> dict[str, object]:
    """Convert the errors of a frame to the plain data that ``dataset.yaml`` has under its key ``frame_error``."""
    return to_data(error, FrameErrorFile)


def to_rig_limits(dataset: WingDatasetFile | VehicleDatasetFile) -> RigLimits | None:
    """Convert the limits of the rig in a checked description to SI units; None if they are not stated."""
    return to_dataclass(RigLimits, dataset.rig_limits) if dataset.rig_limits else None


def describe_rig_limits(limits: RigLimits, rig: Wing | Vehicle) -> dict[str, object]:
    """Convert limits to the plain data that ``dataset.yaml`` has under its key ``rig_limits``."""
    return to_data(limits, VehicleLimitsFile if isinstance(rig, Vehicle) else WingLimitsFile)


def to_cameras(dataset: WingDatasetFile | VehicleDatasetFile) -> tuple[CameraPose, ...]:
    """Convert the cameras of a checked description to SI units; none if they are not stated."""
    stated = dataset.cameras if isinstance(dataset, WingDatasetFile) else []
    return tuple(to_dataclass(CameraPose, camera) for camera in stated)


def describe_cameras(cameras: Iterable[CameraPose]) -> list[dict[str, object]]:
    """Convert cameras to the plain data that ``dataset.yaml`` has under its key ``cameras``."""
    return [to_data(camera, CameraFile) for camera in cameras]


def to_recording(entry: RecordingFile, samples: Samples, document: Document, path: Path, faults: Faults) -> Recording:
    """Convert the description ``entry`` of a recording, together with its ``samples``, to a Recording.

    Errors in its standard deviations are added to ``faults``; ``path`` is the position of ``entry`` in ``document``.
    """
    lag = {} if isinstance(entry, WingRecordingFile) else {"phase_lag": 0.0}
    return to_dataclass(
        Recording,
        entry,
        condition=to_dataclass(Condition, entry, **lag),
        times=samples.times,
        markers=samples.markers,
        forces=samples.forces,
        values=samples.values,
        standard_deviation=_to_deviations(entry, samples, document, path, faults),
        noise_correlation=_to_correlations(entry, samples, document, path, faults),
    )


def to_dataclass(cls: type[T], model: BaseModel, **given: object) -> T:
    """Make an instance of the dataclass ``cls`` from the keys of ``model``; attributes in ``given`` take precedence."""
    hints, values = get_type_hints(cls), dict(given)
    for key in type(model).model_fields:
        attribute, unit = _attribute(key, hints)
        if attribute and attribute not in given:
            values[attribute] = _to_value(getattr(model, key), hints[attribute], unit)
    if cls is Marker:
        values["position"] = tuple(float(getattr(model, f"{axis}_m")) for axis in "xyz")
    return cls(**values)


def to_data(instance: object, model: type[BaseModel]) -> dict[str, object]:
    """Convert a dataclass to plain data with the keys and units of ``model``; None and empty mappings are omitted."""
    axes = dict(zip("xyz", instance.position, strict=True)) if isinstance(instance, Marker) else {}
    return _data(vars(instance) | axes, model)


def describe_rig(rig: Wing | Vehicle) -> dict[str, object]:
    """Convert ``rig`` to the plain data that ``dataset.yaml`` has under its key ``wing`` or ``vehicle``."""
    return to_data(rig, VehicleFile if isinstance(rig, Vehicle) else WingFile)


def describe_recording(recording: Recording) -> dict[str, object]:
    """Convert ``recording``, without its samples, to plain data: an entry of ``recordings`` in ``dataset.yaml``."""
    values = vars(recording.condition) | vars(recording) | {"standard_deviation": _deviations(recording)}
    values["noise_correlation"] = _correlations(recording)
    return _data(values, VehicleRecordingFile if recording.kind == "forces" else WingRecordingFile)


def _attribute(key: str, attributes: Iterable[str]) -> tuple[str | None, Unit]:
    """Return the one of ``attributes`` that ``key`` of the file holds and the unit there; None and SI if there is none.

    The key ``dihedral_deg`` holds the attribute ``dihedral`` in degrees.
    """
    name = _OTHER_NAMES.get(key, key)
    attribute = max((a for a in attributes if f"{name}_".startswith(f"{a}_")), key=len, default=None)
    return attribute, _UNITS.get(name[len(attribute) + 1 :], SI) if attribute else SI


def _to_value(value: Any, hint: Any, unit: Unit) -> object:
    """Convert ``value`` of the file, which is in ``unit``, to an attribute of type ``hint`` in SI units."""
    if isinstance(value, BaseModel):
        kind = getattr(value, "kind", None)
        return to_dataclass(next(c for c in _dataclasses(hint) if getattr(c, "kind", None) == kind), value)
    if isinstance(value, Decimal):
        return to_si(value, unit)
    if isinstance(value, list):
        return tuple(_to_value(item, hint, unit) for item in value)
    if isinstance(value, dict):
        return {name: _to_value(item, hint, unit) for name, item in value.items()}
    return value


def _dataclasses(hint: Any) -> Iterator[type[Any]]:
    """Yield the dataclasses within the type ``hint``, such as ``tuple[Rod, ...]`` or ``LowPass | None``."""
    if isinstance(hint, type) and is_dataclass(hint):
        yield hint
    for argument in get_args(hint):
        yield from _dataclasses(argument)


def _data(values: Mapping[str, object], model: type[BaseModel]) -> dict[str, object]:
    """Convert attributes to plain data under the keys of ``model``, without None and what is empty."""
    data = dict[str, object]()
    for key, field in model.model_fields.items():
        attribute, unit = _attribute(key, values)
        if attribute and not _is_empty(values[attribute]):
            data[key] = _plain(values[attribute], list(models_in(field.annotation)), unit)
    return data


def _is_empty(value: object) -> bool:
    """Return whether ``value`` is None, or a mapping or tuple without items; an array is not compared with them."""
    return value is None or (isinstance(value, Mapping | tuple) and not value)


def _plain(value: Any, models: Sequence[type[BaseModel]], unit: Unit) -> object:
    """Convert an attribute to plain data in ``unit``; a dataclass by that one of ``models`` with the same ``kind``."""
    if is_dataclass(value):
        kind = getattr(value, "kind", None)
        return to_data(value, next(model for model in models if tag_of(model) == kind))
    if isinstance(value, Mapping):
        return {name: _plain(item, models, unit) for name, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(item, models, unit) for item in value]
    if (isinstance(value, int) and unit == SI) or not isinstance(value, numbers.Real):
        return value
    return from_si(float(value), unit)


def _to_deviations(
    entry: RecordingFile, samples: Samples, document: Document, path: Path, faults: Faults
) -> Float[Array, " C"] | None:
    """Return the noise's standard deviation of each channel [C] (m or N), or None if ``entry`` gives none.

    Adds a fault for a marker or axis of ``samples`` without an entry, and for one that is not in the recording.
    """
    names: Sequence[str]
    if isinstance(entry, WingRecordingFile):
        key, what, each, names, size = "standard_deviation_m", "marker", "[x, y, z] for each marker", samples.markers, 3
    else:
        key, what, each, names, size = "standard_deviation_n", "axis", "one for each axis recorded", samples.forces, 1
    noise = getattr(entry, key)
    if noise is None or isinstance(noise, Decimal):
        return None if noise is None else np.full(size * len(names), float(noise))
    known = noise if isinstance(noise, dict) else {axis: [value] for axis, value in noise if value is not None}
    remedy = f"give {each}, or one number for all"
    return _values_of(known, names, size, what, remedy, document, (*path, key), faults).ravel()


def _to_correlations(
    entry: RecordingFile, samples: Samples, document: Document, path: Path, faults: Faults
) -> Float[Array, "M 3"] | None:
    """Return the correlations of each marker's noise, or None if ``entry`` gives none; faults as of deviations."""
    key = "noise_correlation"
    known = getattr(entry, key, None)
    if known is None:
        return None
    remedy = "give [xy, xz, yz] for each marker of the recording"
    return _values_of(known, samples.markers, 3, "marker", remedy, document, (*path, key), faults)


def _values_of(
    known: Mapping[str, Sequence[Decimal]],
    names: Sequence[str],
    size: int,
    what: str,
    remedy: str,
    document: Document,
    path: Path,
    faults: Faults,
) -> Float[Array, "N size"]:
    """Return the values [N, size] of N ``names``; adds a fault for a name that is not ``known``, and for any other."""
    for name in known:
        if name not in names:
            other = nearest(name, names) if what == "marker" else "remove it"
            faults.add(document.where((*path, name)), name, f"{what} {name!r} is not in the recording; {other}")
    missing = [name for name in names if name not in known]
    if missing:
        faults.add(document.where(path), missing[0], f"{what} {missing[0]!r} has no entry; {remedy}")
    rows = [[float(value) for value in known.get(name, [Decimal("nan")] * size)] for name in names]
    return np.array(rows).reshape(len(names), size)


def _deviations(recording: Recording) -> object:
    """Convert standard deviations to plain data: forces by axis; tracks by marker, or one number; None if unknown."""
    if recording.standard_deviation is None:
        return None
    values = recording.standard_deviation.tolist()
    if recording.kind == "forces":
        return dict(zip(recording.forces, values, strict=True))
    if values and len(set(values)) == 1 and math.isfinite(values[0]):
        return values[0]
    return {marker: values[3 * k : 3 * k + 3] for k, marker in enumerate(recording.markers)}


def _correlations(recording: Recording) -> object:
    """Convert the correlations of the noise to plain data by marker; None if they are unknown."""
    if recording.noise_correlation is None:
        return None
    return dict(zip(recording.markers, recording.noise_correlation.tolist(), strict=True))
