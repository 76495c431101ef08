"""Between the models of a wing in ``dataset.yaml`` and the dataclasses. Exact both ways: see ``records.units``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Decimal

import numpy as np
import numpy.typing as npt

from wingfit.records.dataset import Condition, Recording
from wingfit.records.description.fields import fourier_data
from wingfit.records.description.wing_file import FourBarFile, WingFile, WingRecordingFile
from wingfit.records.description.yaml_text import Document, Path
from wingfit.records.drive import Drive, FourBarDrive, FourierDrive
from wingfit.records.errors import Faults, nearest
from wingfit.records.files.table import Samples
from wingfit.records.units import CELSIUS, DEG, MBAR, decimals, from_si, to_si
from wingfit.records.wing import Hinge, Marker, Materials, Rod, Station, Wing

Deviations = npt.NDArray[np.float64]


def to_wing(wing: WingFile) -> Wing:
    """Convert the wing to SI units."""
    return Wing(
        name=wing.name,
        stations=tuple(
            Station(float(s.y_m), float(s.leading_edge_m), float(s.chord_m), float(s.thickness_m))
            for s in wing.stations
        ),
        materials=Materials(float(wing.materials.foam_density_kg_m3), float(wing.materials.skin_areal_density_kg_m2)),
        rods=tuple(
            Rod(
                name=rod.name,
                x_root=float(rod.x_root_m),
                y_root=float(rod.y_root_m),
                x_tip=float(rod.x_tip_m),
                y_tip=float(rod.y_tip_m),
                diameter=float(rod.diameter_m),
                density=float(rod.density_kg_m3),
                glue_linear_density=float(rod.glue_linear_density_kg_m),
            )
            for rod in wing.rods
        ),
        driven_rods=(wing.driven_rods[0], wing.driven_rods[1]),
        markers=tuple(
            Marker(m.name, (float(m.x_m), float(m.y_m), float(m.z_m)), float(m.mass_kg)) for m in wing.markers
        ),
        reference_markers=tuple(wing.reference_markers),
        hinge=Hinge(float(wing.hinge.y_m), float(wing.hinge.z_m)),
        drive=_to_drive(wing),
        estimates={name: float(value) for name, value in wing.estimates.items()},
    )


def _to_drive(wing: WingFile) -> Drive:
    drive = wing.drive
    if isinstance(drive, FourBarFile):
        links = (drive.ground_m, drive.crank_m, drive.coupler_m, drive.rocker_m)
        ground, crank, coupler, rocker = (float(length) for length in links)
        return FourBarDrive(ground, crank, coupler, rocker, to_si(drive.offset_deg, DEG))
    return FourierDrive(*drive.radians())


def to_recording(
    entry: WingRecordingFile, samples: Samples, document: Document, path: Path, faults: Faults
) -> Recording:
    """Convert an entry of the list at ``path``, with its tracks; notes what is wrong with its noise."""
    condition = Condition(
        flap_frequency=float(entry.flap_frequency_hz),
        phase_lag=to_si(entry.phase_lag_deg, DEG),
        pressure=to_si(entry.pressure_mbar, MBAR),
        temperature=to_si(entry.temperature_c, CELSIUS),
        airspeed=float(entry.airspeed_m_s),
        angle_of_attack=to_si(entry.angle_of_attack_deg, DEG),
        gravity=float(entry.gravity_m_s2),
    )
    noise = _to_deviations(entry, samples.markers, document, (*path, "standard_deviation_m"), faults)
    return Recording(entry.name, entry.rig, condition, samples.times, samples.markers, samples.values, noise)


def _to_deviations(
    recording: WingRecordingFile, markers: Sequence[str], document: Document, path: Path, faults: Faults
) -> Deviations | None:
    """Known noise per channel [C], or None; notes markers that are missing or unknown."""
    noise = recording.standard_deviation_m
    if noise is None:
        return None
    if isinstance(noise, Decimal):
        return np.full(3 * len(markers), float(noise))
    for name in noise:
        if name not in markers:
            message = f"marker {name!r} is not in the recording; {nearest(name, markers)}"
            faults.add(document.where((*path, name)), name, message)
    lacking = [name for name in markers if name not in noise]
    if lacking:
        message = f"marker {lacking[0]!r} has no entry; give [x, y, z] for each marker, or one number for all"
        faults.add(document.where(path), lacking[0], message)
    axes = [noise.get(name, [Decimal("nan")] * 3) for name in markers]
    return np.array([[float(value) for value in axis] for axis in axes]).ravel()


def describe_wing(wing: Wing) -> dict[str, object]:
    """``wing`` as the plain data of ``dataset.yaml``."""
    return {
        "name": wing.name,
        "stations": [
            decimals(y_m=s.y, leading_edge_m=s.leading_edge, chord_m=s.chord, thickness_m=s.thickness)
            for s in wing.stations
        ],
        "materials": decimals(
            foam_density_kg_m3=wing.materials.foam_density, skin_areal_density_kg_m2=wing.materials.skin_areal_density
        ),
        "rods": [{"name": rod.name, **_rod(rod)} for rod in wing.rods],
        "driven_rods": list(wing.driven_rods),
        "markers": [
            {"name": m.name, **decimals(x_m=m.position[0], y_m=m.position[1], z_m=m.position[2], mass_kg=m.mass)}
            for m in wing.markers
        ],
        "reference_markers": list(wing.reference_markers),
        "hinge": decimals(y_m=wing.hinge.y, z_m=wing.hinge.z),
        "drive": _drive(wing.drive),
        **({"estimates": decimals(**wing.estimates)} if wing.estimates else {}),
    }


def _rod(rod: Rod) -> dict[str, Decimal]:
    return decimals(
        x_root_m=rod.x_root,
        y_root_m=rod.y_root,
        x_tip_m=rod.x_tip,
        y_tip_m=rod.y_tip,
        diameter_m=rod.diameter,
        density_kg_m3=rod.density,
        glue_linear_density_kg_m=rod.glue_linear_density,
    )


def _drive(drive: Drive) -> dict[str, object]:
    if isinstance(drive, FourBarDrive):
        lengths = decimals(ground_m=drive.ground, crank_m=drive.crank, coupler_m=drive.coupler, rocker_m=drive.rocker)
        return {"kind": drive.kind, **lengths, "offset_deg": from_si(drive.offset, DEG)}
    return fourier_data(drive)


def describe_recording(recording: Recording) -> dict[str, object]:
    """``recording`` without its tracks, as the plain data of ``dataset.yaml``."""
    condition = recording.condition
    noise = _deviations(recording)
    return {
        "name": recording.name,
        "rig": recording.rig,
        "flap_frequency_hz": from_si(condition.flap_frequency),
        "phase_lag_deg": from_si(condition.phase_lag, DEG),
        "pressure_mbar": from_si(condition.pressure, MBAR),
        "temperature_c": from_si(condition.temperature, CELSIUS),
        "airspeed_m_s": from_si(condition.airspeed),
        "angle_of_attack_deg": from_si(condition.angle_of_attack, DEG),
        "gravity_m_s2": from_si(condition.gravity),
        **({} if noise is None else {"standard_deviation_m": noise}),
    }


def _deviations(recording: Recording) -> object:
    if recording.standard_deviation is None:
        return None
    values = recording.standard_deviation.tolist()
    if values and len(set(values)) == 1 and math.isfinite(values[0]):
        return from_si(values[0])
    return {
        marker: [from_si(value) for value in values[3 * index : 3 * index + 3]]
        for index, marker in enumerate(recording.markers)
    }
