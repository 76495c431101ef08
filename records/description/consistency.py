"""Checks that involve several values: references between names, order, markers on the planform, masses, motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from decimal import Decimal

import numpy as np

from wingfit.records.array_types import Array, Float
from wingfit.records.description.camera_file import LEAST_CAMERAS, faults_of_cameras
from wingfit.records.description.dataset_file import DatasetFile, SeriesDatasetFile, VehicleDatasetFile, WingDatasetFile
from wingfit.records.description.fields import FourierFile
from wingfit.records.description.vehicle_file import MotionFile, VehicleFile, VehicleRecordingFile
from wingfit.records.description.wing_file import StationFile, WingFile
from wingfit.records.description.yaml_text import Path
from wingfit.records.errors import nearest
from wingfit.records.limits import MAX_OPEN_AT_START, PLANFORM_MARGIN
from wingfit.records.series_checks import not_stated, unknown, unstated, used_twice
from wingfit.records.vehicle import WINGS

Inconsistency = tuple[Path, object, str]
TIME = "time_s"  # the column of times


def inconsistencies(dataset: DatasetFile) -> Iterator[Inconsistency]:
    """Yield every inconsistency between values of ``dataset``: path of keys in the file, wrong value, message."""
    if isinstance(dataset, SeriesDatasetFile):
        yield from _series(dataset)
    else:
        yield from _vehicle(dataset) if isinstance(dataset, VehicleDatasetFile) else _wing(dataset)
        yield from _limits(dataset)
    recordings = [recording.name for recording in dataset.recordings]
    yield from _unique(("recordings",), recordings, "name", ignore_case=True)
    yield from _references(("held_out",), dataset.held_out, recordings, "recording")


def _limits(dataset: WingDatasetFile | VehicleDatasetFile) -> Iterator[Inconsistency]:
    """Yield limits of the rig of which the least value is not below the largest."""
    stated = dataset.rig_limits
    for key in type(stated).model_fields if stated else ():
        values = getattr(stated, key)
        if values is not None and values[0] >= values[1]:
            message = f"is [{values[0]}, {values[1]}]; the first must be less than the second: exchange them"
            yield ("rig_limits", key), values[0], message


def _wing(dataset: WingDatasetFile) -> Iterator[Inconsistency]:
    wing = dataset.wing
    yield from _foam_and_rods(wing) if wing.structure is None else _without_rods(dataset)
    yield from _increasing(("wing", "stations"), "y", [station.y_m for station in wing.stations])
    rods, markers = [rod.name for rod in wing.rods], [marker.name for marker in wing.markers]
    yield from _unique(("wing", "rods"), rods, "name")
    yield from _unique(("wing", "markers"), markers, "name")
    for index, rod in enumerate(wing.rods):
        if (rod.x_root_m, rod.y_root_m) == (rod.x_tip_m, rod.y_tip_m):
            message = f"rod {rod.name!r} starts and ends at the same point; its root and tip must differ"
            yield ("wing", "rods", index), rod.name, message
    yield from _references(("wing", "driven_rods"), wing.driven_rods, rods, "rod")
    yield from _references(("wing", "reference_markers"), wing.reference_markers, markers, "marker")
    yield from _markers(wing)
    if len(dataset.cameras) == 1:
        message = f"has one camera; at least {LEAST_CAMERAS} are needed for positions in space: add the others"
        yield ("cameras",), dataset.cameras[0].name, message
    places = [(marker.name, np.array([marker.x_m, marker.y_m, marker.z_m], float)) for marker in wing.markers]
    yield from faults_of_cameras(dataset.cameras, places)


def _foam_and_rods(wing: WingFile) -> Iterator[Inconsistency]:
    """Yield what a wing of foam and rods needs and does not have."""
    without = "for a wing without rods, state 'structure: sheet' or 'structure: rigid' (docs/formats.md)"
    for key, names in (("rods", wing.rods), ("driven_rods", wing.driven_rods)):
        if len(names) < 2:
            message = f"has {len(names)} entries, at least 2 are needed: add some; {without}"
            yield ("wing", key), None, message
    if wing.materials.foam_density_kg_m3 == 0:
        message = f"is 0 kg/m^3; the foam between rods has a density above 0; {without}"
        yield ("wing", "materials", "foam_density_kg_m3"), wing.materials.foam_density_kg_m3, message


def _without_rods(dataset: WingDatasetFile) -> Iterator[Inconsistency]:
    """Yield what a sheet or a rigid wing must not have."""
    wing, which = dataset.wing, f"a wing with 'structure: {dataset.wing.structure}'"
    for key, names in (("rods", wing.rods), ("driven_rods", wing.driven_rods)):
        if names:
            yield ("wing", key), None, f"{which} has no rods; remove {key}, or remove structure"
    if wing.materials.foam_density_kg_m3 == 0 and wing.materials.skin_areal_density_kg_m2 == 0:
        message = "both densities are 0; a wing has mass: give its mean areal density (mass / area), or a density"
        yield ("wing", "materials"), None, message
    for index, recording in enumerate(dataset.recordings):
        if recording.phase_lag_deg != 0:
            message = f"is {recording.phase_lag_deg} deg; {which} has no rear rod that lags: it must be 0"
            yield ("recordings", index, "phase_lag_deg"), recording.phase_lag_deg, message


def _vehicle(dataset: VehicleDatasetFile) -> Iterator[Inconsistency]:
    vehicle = dataset.vehicle
    places = [station.r_m for station in vehicle.stations]
    if places[0] != 0:
        message = f"is {places[0]} m; the first station lies on the flapping axis: r_m must be 0 there"
        yield ("vehicle", "stations", 0, "r_m"), places[0], message
    yield from _increasing(("vehicle", "stations"), "r", places)
    wings = WINGS[vehicle.layout] * vehicle.wing_mass_kg
    parts: dict[Path, VehicleFile | VehicleRecordingFile] = {("vehicle",): vehicle}
    for path, part in (parts | {("recordings", i): r for i, r in enumerate(dataset.recordings)}).items():
        mass = part.mass_kg
        if mass is not None and wings >= mass:
            message = f"is {mass} kg; it must be more than the mass of all wings, {wings} kg: check the units (kg)"
            yield (*path, "mass_kg"), mass, message
        if vehicle.claps and part.motion is not None:
            yield from _starts_closed(part.motion, (*path, "motion", "flap"))


def _series(dataset: SeriesDatasetFile) -> Iterator[Inconsistency]:
    seen: dict[str, str] = {}
    for key in ("channels", "inputs", "settings"):
        for index, name in enumerate(quantity.name for quantity in getattr(dataset, key)):
            here = f"{key}[{index}]"
            if name.lower() == TIME:
                message = f"is {name!r}, the name of the column of times; name the quantity otherwise"
                yield (key, index, "name"), name, message
            elif name in seen:
                message = (
                    f"{name!r} is also the name of {seen[name]}; channels, inputs and settings each need a name of "
                    "their own: rename one, or remove it"
                )
                yield (key, index, "name"), name, message
            seen.setdefault(name, here)
    known = [setting.name for setting in dataset.settings]
    for index, recording in enumerate(dataset.recordings):
        for name in recording.settings:
            if name not in known:
                remedy = f"remove it, or list it under settings with its unit; {nearest(name, known)}"
                yield ("recordings", index, "settings", name), name, f"no setting is called {name!r}; {remedy}"
    for index, name in unstated(dataset.recordings, dataset.settings):
        path = ("recordings", index, "settings")
        yield path, None, not_stated(dataset.recordings[index].name, name)


def _starts_closed(motion: MotionFile, path: Path) -> Iterator[Inconsistency]:
    """Yield an inconsistency if wings that clap are open at the start of the beat.

    Only a Fourier series is checked: a split cycle always starts closed.
    """
    flap = motion.flap
    if not isinstance(flap, FourierFile):
        return
    phase = 2 * np.pi * np.outer(np.arange(360) / 360, np.arange(1, len(flap.cosine_deg) + 1))
    angle = np.cos(phase) @ np.array(flap.cosine_deg, float) + np.sin(phase) @ np.array(flap.sine_deg, float)
    late = (angle[0] - angle.min()) / max(float(np.ptp(angle)), 1e-12)
    if late > MAX_OPEN_AT_START:
        message = (
            f"the wings are closest at {angle.argmin() / 360:.2f} of the beat and {100 * late:.0f} % open at its "
            f"start; at most {100 * MAX_OPEN_AT_START:g} % are accepted: shift the series to a beat that starts "
            "with the wings closed, and the recordings' times with it"
        )
        yield path, None, message


def _increasing(path: Path, key: str, places: Sequence[Decimal]) -> Iterator[Inconsistency]:
    for index in range(1, len(places)):
        before, here = places[index - 1], places[index]
        if here <= before:
            message = f"is {here} m after {before} m; {key} must increase from root to tip: sort the stations"
            yield (*path, index, f"{key}_m"), here, message


def _unique(
    path: Path, names: Sequence[str], key: str | None = None, *, ignore_case: bool = False
) -> Iterator[Inconsistency]:
    seen: dict[str, str] = {}
    for index, name in enumerate(names):
        folded = name.lower() if ignore_case else name
        here = (*path, index, key) if key else (*path, index)
        if seen.get(folded) == name:
            yield here, name, used_twice(name)
        elif folded in seen:
            message = f"{name!r} differs from {seen[folded]!r} only by case, which some file systems ignore: rename one"
            yield here, name, message
        seen.setdefault(folded, name)


def _references(path: Path, names: Sequence[str], known: Sequence[str], what: str) -> Iterator[Inconsistency]:
    yield from _unique(path, names)
    for index, name in enumerate(names):
        if name not in known:
            yield (*path, index), name, unknown(what, name, known)


def _markers(wing: WingFile) -> Iterator[Inconsistency]:
    if list(_increasing((), "y", [station.y_m for station in wing.stations])):
        return
    outline = planform_outline(wing.stations)
    for index, marker in enumerate(wing.markers):
        distance = distance_outside(outline, float(marker.x_m), float(marker.y_m))
        if distance > PLANFORM_MARGIN:
            message = (
                f"marker {marker.name!r} at x = {marker.x_m} m, y = {marker.y_m} m is {distance * 1e3:.1f} mm outside "
                f"the planform; at most {PLANFORM_MARGIN * 1e3:g} mm are accepted: check unit (m), sign, x and y"
            )
            yield ("wing", "markers", index), marker.name, message


def planform_outline(stations: Sequence[StationFile]) -> Float[Array, "N 2"]:
    """Return the corners (x, y) of the planform [N, 2] in m: leading edge from root to tip, then trailing edge back."""
    leading = [(float(s.leading_edge_m), float(s.y_m)) for s in stations]
    trailing = [(float(s.leading_edge_m + s.chord_m), float(s.y_m)) for s in stations]
    return np.array(leading + trailing[::-1])


def distance_outside(outline: Float[Array, "N 2"], x: float, y: float) -> float:
    """Return the distance (m) of the point (x, y) from the planform with the corners ``outline`` [N, 2]; 0 inside."""
    start, end = outline, np.roll(outline, -1, axis=0)
    point, edge = np.array([x, y]), end - start
    # Inside when a ray to +x crosses the outline an odd number of times.
    crosses = (start[:, 1] > y) != (end[:, 1] > y)
    slope = np.divide(edge[:, 0], edge[:, 1], out=np.zeros(len(edge)), where=crosses)
    if np.count_nonzero(crosses & (x < start[:, 0] + (y - start[:, 1]) * slope)) % 2:
        return 0.0
    along = np.clip(((point - start) * edge).sum(axis=1) / np.maximum((edge**2).sum(axis=1), 1e-300), 0.0, 1.0)
    return float(np.hypot(*(start + along[:, None] * edge - point).T).min())
