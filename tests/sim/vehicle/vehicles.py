"""Vehicles and recordings for the tests of the blade elements."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wingfit.records import (
    ChordStation,
    Condition,
    FourierFlap,
    FourierPitch,
    PassivePitch,
    Recording,
    SplitCycleFlap,
    Vehicle,
    WingMotion,
)
from wingfit.records.dataset import ForceAxis
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.motion import Angles, angles_of, flap_series

PASSIVE = PassivePitch(0.3139, -1.1382, -0.0179, -0.0002)
DELFLY = Vehicle(
    "delfly",
    "x4",
    True,
    (ChordStation(0.0, 0.085), ChordStation(0.0685, 0.0835), ChordStation(0.137, 0.056)),
    wing_mass=0.29e-3,
    thickness=1e-5,
    pitch_axis=0.0,
    dihedral=0.0,
    mass=17.4e-3,
    motion=WingMotion(SplitCycleFlap(0.34, 0.34, 0.35), PASSIVE, root_pitch=math.pi / 2),
)
COEFFICIENTS = {"C_l": 1.24, "C_r": 1.44, "C_F": 1.58, "C_D0": 0.07, "C_Dpi2": 2.0}


def plate(flap: FourierFlap, pitch: FourierPitch, **changes: object) -> Vehicle:
    """One rectangular wing of 0.1 m by 0.05 m, untwisted, with the given motion; a single wing."""
    mean = pitch.mean if not pitch.cosine else math.pi / 2
    motion = WingMotion(flap, pitch, root_pitch=mean)
    made = Vehicle(
        "plate", "single", False, (ChordStation(0.0, 0.05), ChordStation(0.1, 0.05)), 1e-3, 1e-4, 0.0, 0.0, 0.01, motion
    )
    return replace(made, **changes)  # type: ignore[arg-type]


def recording(
    frequency: float = 12.5,
    speed: float = 0.0,
    pitch: float = 0.0,
    axes: tuple[ForceAxis, ...] = ("x", "z"),
    **changes: object,
) -> Recording:
    """Four beats at 1 kHz."""
    times = np.arange(int(4000 / frequency)) / 1000.0
    condition = Condition(frequency, 0.0, 101325.0, 293.15, speed, pitch)
    blank = Recording("blank", "wind_tunnel", condition, times, (), np.zeros((len(times), len(axes))), forces=axes)
    return replace(blank, **changes)  # type: ignore[arg-type]


def genome(model: BladeElementWing, **values: float) -> list[float]:
    """The nominal genome with some values changed."""
    known = {gene.name: gene.nominal for gene in model.genes}
    assert set(values) <= set(known), sorted(set(values) - set(known))
    return list((known | values).values())


def angles(
    motion: WingMotion,
    values: Mapping[str, npt.NDArray[np.float64]],
    frequency: float,
    instants: int,
    claps: bool,
    peel_width: float = 0.0,
) -> Angles:
    """The angles of a motion with ``values`` [B] of its genes; other parameters have the motion's own values."""
    count = max((len(v) for v in values.values()), default=1)
    series = flap_series(motion.flap, values, count, instants)
    return angles_of(series, motion, values, frequency, instants, claps, peel_width)
