"""A small realistic wing and dataset: a falcon's wing half a metre long, flapped by a Fourier drive."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from wingfit.records import (
    CameraPose,
    Condition,
    Dataset,
    FourBarDrive,
    FourierDrive,
    FrameError,
    Hinge,
    Marker,
    Materials,
    Recording,
    Rod,
    Station,
    Wing,
)
from wingfit.records.dataset import Rig

ROWS = ((0.06, 3), (0.20, 3), (0.33, 3), (0.46, 3))
FOUR_BAR = FourBarDrive(ground=0.06, crank=0.012, coupler=0.055, rocker=0.03, offset=math.radians(-90.0))


def falcon_wing() -> Wing:
    """Span 0.5 m, root chord 0.22 m, 12 mm thick at the root, two rods, twelve markers."""
    stations = (
        Station(0.0, -0.06, 0.22, 0.012),
        Station(0.2, -0.075, 0.21, 0.011),
        Station(0.35, -0.06, 0.17, 0.009),
        Station(0.5, -0.01, 0.07, 0.006),
    )
    rods = (
        Rod("front", -0.03, 0.0, -0.01, 0.47, 0.003, 1600.0, 0.004),
        Rod("rear", 0.07, 0.0, 0.04, 0.44, 0.002, 1600.0, 0.003),
    )
    return Wing(
        name="falcon",
        stations=stations,
        materials=Materials(foam_density=30.0, skin_areal_density=0.12),
        rods=rods,
        driven_rods=("front", "rear"),
        markers=_markers(stations),
        reference_markers=("m1", "m2", "m3"),
        hinge=Hinge(y=-0.04, z=0.0),
        drive=FourierDrive(mean=math.radians(5.0), cosine=(0.0, 0.01), sine=(math.radians(30.0), -0.02)),
        estimates={"E_f": 5e6, "G_f": 2.1e6},
    )


def _markers(stations: Sequence[Station]) -> tuple[Marker, ...]:
    y = [station.y for station in stations]
    markers: list[Marker] = []
    for span, count in ROWS:
        edge = np.interp(span, y, [station.leading_edge for station in stations])
        chord = np.interp(span, y, [station.chord for station in stations])
        height = np.interp(span, y, [station.thickness for station in stations]) / 2
        for k in range(count):
            x = float(edge + chord * (0.1 + 0.8 * k / (count - 1)))
            markers.append(Marker(f"m{len(markers) + 1}", (x, span, float(height)), 2e-4))
    return tuple(markers)


def rigid_tracks(wing: Wing, condition: Condition, times: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Positions [T, 3 M] of a stiff wing's markers, flapping about the hinge by 30 degrees."""
    rest = np.array([marker.position for marker in wing.markers])
    out, up = rest[:, 1] - wing.hinge.y, rest[:, 2] - wing.hinge.z
    angle = math.radians(30.0) * np.sin(2 * math.pi * condition.flap_frequency * times)[:, None]
    y = wing.hinge.y + out * np.cos(angle) - up * np.sin(angle)
    z = wing.hinge.z + out * np.sin(angle) + up * np.cos(angle)
    x = np.broadcast_to(rest[:, 0], y.shape)
    return np.stack([x, y, z], axis=2).reshape(len(times), -1)


def falcon_recording(
    name: str, condition: Condition, wing: Wing | None = None, frames: int = 60, seed: int = 1
) -> Recording:
    """Two beats of a stiff wing with 0.5 mm noise, a gap in one marker and another marker lost altogether."""
    wing = wing or falcon_wing()
    times: npt.NDArray[np.float64] = np.arange(frames, dtype=np.float64) * 2.0 / (condition.flap_frequency * frames)
    values = rigid_tracks(wing, condition, times)
    values += np.random.default_rng(seed).normal(0.0, 5e-4, values.shape)
    values[frames // 3 : frames // 2, 6:9] = np.nan
    values[:, 15:18] = np.nan
    rig: Rig = "vacuum_chamber" if condition.airspeed == 0 else "wind_tunnel"
    return Recording(name, rig, condition, times, tuple(m.name for m in wing.markers), values)


def falcon_dataset(frames: int = 60) -> Dataset:
    """Two recordings in vacuum and two in the tunnel, one of each held out."""
    wing = falcon_wing()
    conditions = {
        "vacuum-2hz": Condition(2.0, math.radians(3.0), 1000.0, 293.15),
        "vacuum-3hz": Condition(3.0, math.radians(7.0), 1000.0, 293.15),
        "tunnel-3hz-5": Condition(3.0, math.radians(3.0), 101325.0, 294.25, 5.0, math.radians(4.0)),
        "tunnel-4hz-8": Condition(4.0, math.radians(7.0), 101325.0, 294.25, 8.0, math.radians(4.0)),
    }
    recordings = tuple(
        falcon_recording(name, condition, wing, frames, seed)
        for seed, (name, condition) in enumerate(conditions.items())
    )
    frame = FrameError((math.radians(0.26), math.radians(0.06), 0.0), (5.6e-4, 1.7e-4, 2e-4))
    held_out = ("vacuum-3hz", "tunnel-4hz-8")
    return Dataset("falcon", wing, recordings, held_out, "A stiff wing, for tests.", frame, falcon_cameras())


def falcon_cameras() -> tuple[CameraPose, ...]:
    """Two cameras a metre and a half above the wing, which look at the middle of the span at different angles."""
    target, found = np.array([0.03, 0.25, 0.0]), []
    for name, place, focal in (("left", [0.0, 0.05, 1.5], 1900.0), ("right", [0.1, 0.6, 1.4], 1911.97)):
        forward = (target - place) / np.linalg.norm(target - place)
        right = np.cross([1.0, 0.0, 0.0], forward) / np.linalg.norm(np.cross([1.0, 0.0, 0.0], forward))
        axes = np.stack([right, np.cross(forward, right), forward])
        found.append(CameraPose.of(name, np.array(place), axes, focal))
    return tuple(found)
