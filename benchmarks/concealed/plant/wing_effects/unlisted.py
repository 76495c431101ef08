"""Hidden effects that are not in the library of the diagnosis, which can detect but not name them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.wing.build import Draft
from benchmarks.concealed.plant.wing.linkage import angles
from benchmarks.concealed.plant.wing.rig import APPENDAGE, BAND, BRAKE, POINTS, STOP
from benchmarks.concealed.plant.wing_effects.kind import Kind, Values

Array = npt.NDArray[np.float64]

_SEA_LEVEL = 101_325.0  # Pa
_TOOTH = 60.0  # sharpness of a tooth: its width is about a fiftieth of a turn
_LOSS = 0.5  # s/m: relative increase of a stop's force per speed of the approaching wing
_DROP = 0.12  # m: height of the wing at rest above the band's anchor


def _point(draft: Draft, kind: int, at: Values, *law: float) -> None:
    body, arm, _ = draft.at(at["span"], at["chord"])
    row = [float(kind), *arm.tolist(), *law]
    draft.points.append((body, row + [0.0] * (POINTS - len(row))))


def _height(draft: Draft, at: Values) -> float:
    """Height (m, wing frame) of the span position ``at['span']`` on an undeformed wing.

    The front rod's angle is at the fraction ``at['stroke']`` of its range.
    """
    angle = angles(draft.rods[:, 0], 2 * np.pi * np.arange(256) / 256)[:, 0]
    there = angle.min() + at["stroke"] * (angle.max() - angle.min())
    _, y = draft.cut.place(at["span"], 0.5)
    return float(draft.hinge[2] + (y - draft.hinge[1]) * math.sin(there))


def _band(draft: Draft, strength: float, at: Values) -> None:
    x, y, _ = draft.at(at["span"], at["chord"])[2]
    _point(draft, BAND, at, x, y, -_DROP, strength, _DROP)


def _stop(draft: Draft, strength: float, at: Values) -> None:
    _point(draft, STOP, at, _height(draft, at), 1.0, strength, _LOSS)


def _pressing(draft: Draft, at: Values, height: Array, rate: Array) -> Array:
    depth = np.maximum(height - _height(draft, at), 0.0)
    return np.asarray(depth**1.5 * np.maximum(1.0 + _LOSS * rate, 0.0))


def _brake(draft: Draft, strength: float, at: Values) -> None:
    _point(draft, BRAKE, at, strength)


def _appendage(draft: Draft, strength: float, at: Values) -> None:
    _point(draft, APPENDAGE, at, strength, 2 * math.pi * at["hertz"], 0.04)


def _jet(draft: Draft, strength: float, at: Values) -> None:
    strip = int(draft.cut.strip[draft.at(at["span"], 0.5)[0]])
    draft.jets.append([float(strip), 0.0, 0.0, -strength, _height(draft, at), at["half"]])


def _blowing(draft: Draft, at: Values, height: Array, _: Array) -> Array:
    return np.asarray(np.exp(-(((height - _height(draft, at)) / at["half"]) ** 2)))


def _tooth(draft: Draft, strength: float, at: Values) -> None:
    """Add a faulty tooth of the motor's gear: once a turn it advances both rods briefly, by up to ``strength`` rad."""
    n = 1024
    psi = 2 * np.pi * np.arange(n) / n
    bump = strength * np.exp(_TOOTH * (np.cos(psi - at["turn"]) - 1))
    change = 2 * np.fft.rfft(bump)[: len(draft.rods)] / n
    change[0] = 0.0
    late = np.exp(-1j * draft.condition.phase_lag * np.arange(len(change)))
    draft.rods += np.stack([change, change * late], axis=1)


def _cells(draft: Draft, strength: float, _: Values) -> None:
    """Multiply stiffness and damping by 1 + ``strength`` x ambient pressure / that at sea level (closed-cell foam)."""
    draft.factor *= 1 + strength * draft.condition.pressure / _SEA_LEVEL


_PLACE = {"span": (0.7, 0.4, 0.9), "chord": (0.5, 0.2, 0.8)}

UNLISTED = (
    Kind(
        "band", "structure", False, "N/m", 3.0, 200.0,
        "Hooke's law of an elastic band from the ground, slack below its natural length", _band, shape=_PLACE,
    ),
    Kind(
        "stop", "structure", False, "N/m^1.5", 60.0, 5e3,
        "contact after Hunt and Crossley (1975) with an obstacle above the wing", _stop,
        shape={**_PLACE, "stroke": (0.85, 0.75, 0.9)}, acting=_pressing,
    ),
    Kind(
        "brake", "structure", False, "N s^3/m^3", 0.005, 0.2,
        "a resistance at one point, proportional to the cube of its speed", _brake, shape=_PLACE,
    ),
    Kind(
        "appendage", "inertia", False, "kg", 0.0015, 0.02,
        "a mass on a spring (Den Hartog, Mechanical Vibrations (1956), ch. 3): a loose panel or antenna", _appendage,
        shape={**_PLACE, "hertz": (9.0, 7.0, 13.0)},
    ),
    Kind(
        "jet", "aerodynamics", False, "m/s", 6.0, 30.0,
        "a downward jet through which a strip of the wing passes at the top of the stroke", _jet,
        shape={"span": (0.7, 0.4, 0.9), "stroke": (0.95, 0.9, 1.0), "half": (0.04, 0.03, 0.05)},
        acting=_blowing,
    ),
    Kind(
        "tooth", "actuation", False, "rad", 0.02, 0.1,
        "a bump of the gear at one phase of the motor (von Mises' bell)", _tooth,
        shape={"turn": (2.0, 0.0, 2 * math.pi)},
    ),
    Kind(
        "closed_cells", "structure", False, "1", 0.4, 3.0,
        "closed-cell foam: the gas within carries load (Gibson and Ashby, Cellular Solids (1997), ch. 5)", _cells,
    ),
)  # fmt: skip
