"""Between the models of a vehicle in ``dataset.yaml`` and the dataclasses. Exact both ways: see ``records.units``."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import numpy.typing as npt

from wingfit.records.dataset import Condition, ForceAxis, LowPass, Recording
from wingfit.records.description.fields import fourier_data
from wingfit.records.description.vehicle_file import MotionFile, PassivePitchFile, SplitCycleFile, VehicleFile
from wingfit.records.description.vehicle_file import VehicleRecordingFile as RecordingFile
from wingfit.records.description.yaml_text import Document, Path
from wingfit.records.errors import Faults
from wingfit.records.files.table import Samples
from wingfit.records.units import CELSIUS, DEG, MBAR, decimals, from_si, to_si
from wingfit.records.vehicle import (
    ChordStation,
    Flap,
    FourierFlap,
    FourierPitch,
    PassivePitch,
    Pitch,
    SplitCycleFlap,
    Vehicle,
    WingMotion,
)

Deviations = npt.NDArray[np.float64]


def to_vehicle(vehicle: VehicleFile) -> Vehicle:
    """Convert the vehicle to SI units."""
    return Vehicle(
        name=vehicle.name,
        layout=vehicle.layout,
        claps=vehicle.claps,
        stations=tuple(ChordStation(float(s.r_m), float(s.chord_m)) for s in vehicle.stations),
        wing_mass=float(vehicle.wing_mass_kg),
        thickness=float(vehicle.thickness_m),
        pitch_axis=float(vehicle.pitch_axis),
        dihedral=to_si(vehicle.dihedral_deg, DEG),
        mass=float(vehicle.mass_kg),
        motion=_to_motion(vehicle.motion),
        velocities=vehicle.velocities,
        estimates={name: float(value) for name, value in vehicle.estimates.items()},
    )


def _to_motion(motion: MotionFile) -> WingMotion:
    return WingMotion(
        flap=_to_flap(motion),
        pitch=_to_pitch(motion),
        pitch_station=float(motion.pitch_station),
        root_pitch=to_si(motion.root_pitch_deg, DEG),
        peel_end=float(motion.peel_end_beats),
    )


def _to_flap(motion: MotionFile) -> Flap:
    flap = motion.flap
    if isinstance(flap, SplitCycleFile):
        amplitude, bias = to_si(flap.amplitude_deg, DEG), to_si(flap.bias_deg, DEG)
        return SplitCycleFlap(amplitude, bias, float(flap.split_rad_per_beat), float(flap.smoothing_beats))
    return FourierFlap(*flap.radians())


def _to_pitch(motion: MotionFile) -> Pitch:
    pitch = motion.pitch
    if isinstance(pitch, PassivePitchFile):
        terms = (pitch.constant_rad, pitch.flap, pitch.flap_rate_s, pitch.flap_rate_squared_s2)
        constant, flap, rate, squared = (float(term) for term in terms)
        return PassivePitch(constant, flap, rate, squared)
    return FourierPitch(*pitch.radians())


def to_recording(entry: RecordingFile, samples: Samples, document: Document, path: Path, faults: Faults) -> Recording:
    """Convert an entry of the list at ``path``, with its forces; notes what is wrong with its noise."""
    condition = Condition(
        flap_frequency=float(entry.flap_frequency_hz),
        phase_lag=0.0,
        pressure=to_si(entry.pressure_mbar, MBAR),
        temperature=to_si(entry.temperature_c, CELSIUS),
        airspeed=float(entry.airspeed_m_s),
        angle_of_attack=to_si(entry.body_pitch_deg, DEG),
        gravity=float(entry.gravity_m_s2),
    )
    return Recording(
        entry.name,
        entry.rig,
        condition,
        samples.times,
        (),
        samples.values,
        _to_deviations(entry, samples.forces, document, (*path, "standard_deviation_n"), faults),
        forces=samples.forces,
        low_pass=LowPass(float(entry.low_pass.cutoff_hz), entry.low_pass.order) if entry.low_pass else None,
        motion=_to_motion(entry.motion) if entry.motion else None,
        mass=None if entry.mass_kg is None else float(entry.mass_kg),
    )


def _to_deviations(
    entry: RecordingFile, axes: tuple[ForceAxis, ...], document: Document, path: Path, faults: Faults
) -> Deviations | None:
    """Known noise per axis [C], or None; notes axes that are missing or were not recorded."""
    noise = entry.standard_deviation_n
    if noise is None:
        return None
    if isinstance(noise, Decimal):
        return np.full(len(axes), float(noise))
    given = {"x": noise.x, "z": noise.z}
    for axis, value in given.items():
        if value is not None and axis not in axes:
            faults.add(document.where((*path, axis)), axis, f"axis {axis!r} is not in the recording; remove it")
        if value is None and axis in axes:
            message = f"axis {axis!r} has no entry; give one for each axis recorded, or one number for all"
            faults.add(document.where(path), axis, message)
    return np.array([float(given[axis] or "nan") for axis in axes])


def describe_vehicle(vehicle: Vehicle) -> dict[str, object]:
    """``vehicle`` as the plain data of ``dataset.yaml``."""
    return {
        "name": vehicle.name,
        "layout": vehicle.layout,
        "claps": vehicle.claps,
        "stations": [decimals(r_m=station.r, chord_m=station.chord) for station in vehicle.stations],
        **decimals(wing_mass_kg=vehicle.wing_mass, thickness_m=vehicle.thickness, pitch_axis=vehicle.pitch_axis),
        "dihedral_deg": from_si(vehicle.dihedral, DEG),
        "mass_kg": from_si(vehicle.mass),
        "motion": _motion(vehicle.motion),
        "velocities": vehicle.velocities,
        **({"estimates": decimals(**vehicle.estimates)} if vehicle.estimates else {}),
    }


def _motion(motion: WingMotion) -> dict[str, object]:
    return {
        "flap": _flap(motion.flap),
        "pitch": _pitch(motion.pitch),
        "pitch_station": from_si(motion.pitch_station),
        "root_pitch_deg": from_si(motion.root_pitch, DEG),
        "peel_end_beats": from_si(motion.peel_end),
    }


def _flap(flap: Flap) -> dict[str, object]:
    if isinstance(flap, FourierFlap):
        return fourier_data(flap)
    angles = {"amplitude_deg": from_si(flap.amplitude, DEG), "bias_deg": from_si(flap.bias, DEG)}
    return {"kind": flap.kind, **angles, **decimals(split_rad_per_beat=flap.split, smoothing_beats=flap.smoothing)}


def _pitch(pitch: Pitch) -> dict[str, object]:
    if isinstance(pitch, FourierPitch):
        return fourier_data(pitch)
    terms = decimals(
        constant_rad=pitch.constant,
        flap=pitch.flap,
        flap_rate_s=pitch.flap_rate,
        flap_rate_squared_s2=pitch.flap_rate_squared,
    )
    return {"kind": pitch.kind, **terms}


def describe_recording(recording: Recording) -> dict[str, object]:
    """``recording`` without its forces, as the plain data of ``dataset.yaml``."""
    condition, low_pass = recording.condition, recording.low_pass
    data: dict[str, object] = {
        "name": recording.name,
        "rig": recording.rig,
        "flap_frequency_hz": from_si(condition.flap_frequency),
        "body_pitch_deg": from_si(condition.angle_of_attack, DEG),
        "pressure_mbar": from_si(condition.pressure, MBAR),
        "temperature_c": from_si(condition.temperature, CELSIUS),
        "airspeed_m_s": from_si(condition.airspeed),
        "gravity_m_s2": from_si(condition.gravity),
    }
    if low_pass is not None:
        data["low_pass"] = {"cutoff_hz": from_si(low_pass.cutoff), "order": low_pass.order}
    if recording.motion is not None:
        data["motion"] = _motion(recording.motion)
    if recording.mass is not None:
        data["mass_kg"] = from_si(recording.mass)
    if recording.standard_deviation is not None:
        noise = zip(recording.forces, recording.standard_deviation.tolist(), strict=True)
        data["standard_deviation_n"] = {axis: from_si(value) for axis, value in noise}
    return data
