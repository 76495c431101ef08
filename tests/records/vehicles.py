"""A small realistic vehicle and its dataset: a four-winged flapper like the DelFly on a balance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from wingfit.records import (
    ChordStation,
    Condition,
    Dataset,
    FourierFlap,
    FourierPitch,
    LowPass,
    PassivePitch,
    Recording,
    SplitCycleFlap,
    Vehicle,
    WingMotion,
)
from wingfit.records.dataset import ForceAxis
from wingfit.records.files.folder import contents

FORCES = "recordings/hover.csv"
YAML = "dataset.yaml"


def delfly() -> Vehicle:
    """Planform and motion of Armanini et al. 2016, Tables 3 and 5 and Eqs. 20-21."""
    return Vehicle(
        name="delfly",
        layout="x4",
        claps=True,
        stations=(ChordStation(0.0, 0.085), ChordStation(0.0685, 0.0835), ChordStation(0.137, 0.056)),
        wing_mass=0.29e-3,
        thickness=1e-5,
        pitch_axis=0.0,
        dihedral=0.0,
        mass=17.4e-3,
        motion=WingMotion(
            SplitCycleFlap(0.34, 0.34, 0.35),
            PassivePitch(0.3139, -1.1382, -0.0179, -0.0002),
            root_pitch=math.pi / 2,
        ),
        estimates={"C_l": 1.2},
    )


def measured_motion() -> WingMotion:
    """Motion as Fourier series, closed at the start of the beat."""
    flap = FourierFlap(0.34, (-0.33, -0.01), (0.0, 0.004))
    return WingMotion(flap, FourierPitch(1.6, (0.3,), (0.2,)), math.pi / 2, 0.7, 0.2)


def balance(name: str, condition: Condition, forces: tuple[ForceAxis, ...] = ("x", "z"), frames: int = 60) -> Recording:
    """Three beats of force about the vehicle's weight, with noise."""
    times: npt.NDArray[np.float64] = np.arange(frames, dtype=np.float64) * 3.0 / (condition.flap_frequency * frames)
    beat = 2 * math.pi * condition.flap_frequency * times
    both = 0.17 * np.stack([1.0 + np.sin(beat), 0.3 * np.cos(2 * beat)], axis=1)
    values = both[:, [("x", "z").index(axis) for axis in forces]]
    noise = np.random.default_rng(len(name)).normal(0.0, 0.002, values.shape)
    return Recording(name, "wind_tunnel", condition, times, (), values + noise, forces=forces)


def delfly_dataset(frames: int = 60) -> Dataset:
    """Three recordings; one filtered, one with everything that a recording may bring of its own."""
    hover = balance("hover", _condition(13.3, 83.0, 0.3), frames=frames)
    slow = balance("slow", _condition(12.5, 74.0, 0.5), ("x",), frames)
    fast = balance("fast", _condition(10.3, 31.0, 2.0), frames=frames)
    slow = replace(slow, low_pass=LowPass(40.0), standard_deviation=np.array([0.003]))
    fast = replace(
        fast,
        rig="free_flight",
        low_pass=LowPass(67.0, 2),
        motion=measured_motion(),
        mass=18.4e-3,
        standard_deviation=np.array([0.002, 0.005]),
    )
    return Dataset("delfly", delfly(), (hover, slow, fast), ("fast",), "A flapper, for tests.")


def _condition(frequency: float, pitch: float, airspeed: float) -> Condition:
    return Condition(frequency, 0.0, 101325.0, 293.15, airspeed, math.radians(pitch))


@cache
def good_vehicle() -> Mapping[str, bytes]:
    """Files of a good dataset of a vehicle, by name."""
    return MappingProxyType(contents(delfly_dataset()))


def vehicle_yaml(old: str, new: str) -> dict[str, bytes]:
    """Good files, with ``old`` in the description replaced once."""
    text = good_vehicle()[YAML].decode()
    assert old in text, old
    return {**good_vehicle(), YAML: text.replace(old, new, 1).encode()}


def vehicle_csv(old: str, new: str) -> dict[str, bytes]:
    """Good files, with ``old`` in the first recording replaced everywhere."""
    text = good_vehicle()[FORCES].decode()
    assert old in text, old
    return {**good_vehicle(), FORCES: text.replace(old, new).encode()}
