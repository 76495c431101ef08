"""A small realistic series: an arm that a motor turns, with an encoder at its axis and an accelerometer at its tip."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from wingfit.records import Channel, Quantity, Series, SeriesDataset
from wingfit.records.files.folder import contents

YAML = "dataset.yaml"
SAMPLES = "recordings/light-1.csv"

CHANNELS = (
    Channel("angle", "rad", 0.002, "axis", "of an encoder"),
    Channel("acceleration", "m/s^2", place="tip"),
    Channel("contact", "1"),
)
INPUTS = (Quantity("voltage", "V", "at the motor"),)
SETTINGS = (Quantity("mass", "kg"), Quantity("gear", "1"))


def arm_recording(
    name: str, mass: float, *, repeats: str = "", period: float | None = None, samples: int = 40
) -> Series:
    """Two turns of the voltage, sampled unevenly, with noise, a gap in one channel and another that begins late."""
    rng = np.random.default_rng(len(name) + sum(map(ord, name)))
    steps = np.random.default_rng(5).uniform(0.02, 0.03, samples)
    times: npt.NDArray[np.float64] = np.cumsum(steps) - 0.1
    voltage = 2.4 * np.sin(4 * math.pi * times / np.ptp(times))
    angle = 0.5 * np.cos(4 * math.pi * times / np.ptp(times)) / (1.0 + mass) + rng.normal(0.0, 0.002, samples)
    acceleration = 1.5 * voltage + rng.normal(0.0, 0.1, samples)
    contact = (angle > 0).astype(float)
    acceleration[samples // 3 : samples // 2] = np.nan
    contact[:4] = np.nan
    return Series(
        name,
        times,
        CHANNELS,
        np.stack([angle, acceleration, contact], axis=1),
        inputs={"voltage": voltage},
        settings={"mass": mass, "gear": 20.0},
        estimates={"angle0": 0.5} if not repeats else {},
        repeats=repeats,
        period=period,
    )


def arm_dataset(samples: int = 40) -> SeriesDataset:
    """Two repeats with a light arm, and two recordings with a heavy one, one of which is held out."""
    recordings = (
        arm_recording("light-1", 0.1, repeats="light", samples=samples),
        arm_recording("light-2", 0.1, repeats="light", samples=samples),
        arm_recording("heavy", 0.3, period=0.25, samples=samples),
        arm_recording("heaviest", 0.5, samples=samples),
    )
    return SeriesDataset("arm", "motor arm", recordings, CHANNELS, INPUTS, SETTINGS, ("heaviest",), "For tests.")


@cache
def good_series() -> Mapping[str, bytes]:
    """Files of a good dataset of a series, by name."""
    return MappingProxyType(contents(arm_dataset(12)))


def series_yaml(old: str, new: str) -> dict[str, bytes]:
    """Good files, with ``old`` in the description replaced once."""
    text = good_series()[YAML].decode()
    assert old in text, old
    return {**good_series(), YAML: text.replace(old, new, 1).encode()}


def series_csv(
    change: Mapping[tuple[int, int], str] | None = None, *, old: str = "", new: str = ""
) -> dict[str, bytes]:
    """Good files, with cells (line, column, from 1) of the first recording replaced, or a text replaced everywhere."""
    lines = [line.split(",") for line in good_series()[SAMPLES].decode().splitlines()]
    for (line, column), cell in (change or {}).items():
        lines[line - 1][column - 1] = cell
    text = "\n".join([*(",".join(line) for line in lines), ""])
    assert not old or old in text, old
    return {**good_series(), SAMPLES: (text.replace(old, new) if old else text).encode()}
