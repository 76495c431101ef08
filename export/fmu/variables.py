"""The variables of an FMU: what an importer sets, and what it reads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from wingfit.export.fmu.kernels import board as places

Kind = Literal["Float64", "Boolean", "Int32"]
Causality = Literal["input", "parameter", "tunable", "output"]


@dataclass(frozen=True)
class Variable:
    """A variable of the FMU.

    ``word``: its place in the memory of the model. ``start``: of an input or parameter. ``least`` and ``most``: values
    that are possible at all; the range to which the model was fitted is narrower.
    """

    name: str
    word: int
    causality: Causality
    unit: str
    description: str
    start: float | None = None
    least: float = float("-inf")
    most: float = float("inf")
    kind: Kind = "Float64"


@dataclass(frozen=True)
class Limit:
    """The range in which the input called ``name`` was fitted, in its ``unit``."""

    name: str
    word: int
    unit: str
    low: float
    high: float


INPUTS = {
    "flap_frequency": (places.FREQUENCY, "Hz", "flap frequency; the drive follows it within input_time", 0.0, 1e4),
    "phase_lag": (places.LAG, "rad", "lag of the rear driving rod behind the front one, in drive phase", -7.0, 7.0),
    "airspeed": (places.AIRSPEED, "m/s", "speed of the stream", 0.0, 1e3),
    "angle_of_attack": (
        places.PITCH, "rad", "angle of attack of the wing's frame in the stream, or body pitch of a vehicle", -7.0, 7.0,
    ),
}  # fmt: skip
EXTRAPOLATE = Variable(
    "extrapolate", places.EXTRAPOLATE, "tunable", "",
    "whether inputs outside the fitted range are simulated; if false, they are refused", 0.0, 0.0, 1.0, "Boolean",
)  # fmt: skip
SMOOTHING = Variable(
    "input_time", places.SMOOTHING, "parameter", "s",
    "time constant with which the drive follows flap frequency and phase lag; at 0 they jump", 0.02, 0.0, 10.0,
)  # fmt: skip
RAMP = Variable(
    "ramp_beats", places.RAMP, "parameter", "1", "beats over which the stroke grows from rest", 1.0, 0.0, 1000.0
)
STEPS = Variable(
    "steps_per_beat", places.STEPS, "parameter", "1", "steps of time in a beat, at least", None, 8.0, 1e5, "Int32"
)


def output(name: str, word: int, unit: str, description: str) -> Variable:
    """Return an output."""
    return Variable(name, word, "output", unit, description)


def vector(name: str, word: int, unit: str, description: str, axes: str = "xyz") -> tuple[Variable, ...]:
    """Return outputs ``name.x``, ``name.y``, ``name.z`` in consecutive words."""
    return tuple(
        output(f"{name}.{axis}", word + k, unit, f"{axis} of the {description}") for k, axis in enumerate(axes)
    )
