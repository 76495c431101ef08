"""A known load on the wing, given by its place along the span and in the beat, or a known motion of its drive.

A probe, no suspect: what the tracks answer to it tells which load is missing where a model and a recording differ, or
which motion. It is not in the registry: a search for what is missing must not name it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.arrays import AREA, NOW, PUSH_L, PUSH_M, PUSH_N, SHARE, START
from wingfit.sim.kernels.jit import inlined
from wingfit.sim.kernels.lanes.lanewise import cosine_and_sine
from wingfit.sim.kernels.lanes.vector import load, load0, load1, store
from wingfit.sim.kernels.laws import AFTER, strip_port
from wingfit.sim.wing.structure import Structure

Array = npt.NDArray[np.float64]

LARGEST = 1000.0  # N/m, of a gene: far beyond what a wing bears
_FURTHEST = 90.0  # deg, likewise of what a rod turns further
_THINNEST = 1e-9  # kg/m^3: loads are told as parts of the air's, so that there must be some
_CUTS = 1200  # of the span, for the means of its hats


@dataclass(frozen=True)
class Probe:
    """A force per metre of span, N/m: hat functions over ``stations`` times a Fourier series of the drive phase.

    ``stations`` in parts of the span, rising from 0 (root) to 1 (tip); ``harmonics`` of the flap frequency. It acts
    along the normal of the wing where it is, upward, and is spread over the chord. With ``turning`` there is a moment
    about the span as well, nose up, N m/m: a force before or behind the middle of the chord is both. With ``driving``
    both rods turn further by such a series each, deg, the rear one later by its lag. The genes of the effects
    (:meth:`effects`) are numbered station by station, forces first, rods last: constant, cosines, sines
    (:meth:`terms`).
    """

    stations: tuple[float, ...] = (0.0, 0.25, 0.5, 0.75, 1.0)
    harmonics: int = 8
    turning: bool = False
    driving: bool = False

    def __post_init__(self) -> None:
        y = np.array(self.stations)
        if len(y) < 2 or y[0] != 0.0 or y[-1] != 1.0 or not np.all(np.diff(y) > 0):
            raise ValueError(f"stations {self.stations} must rise from 0 (root) to 1 (tip); give at least these two")
        if not 0 <= self.harmonics <= 12:
            raise ValueError(f"{self.harmonics} harmonics of a load; there must be 0 to 12")

    @property
    def size(self) -> int:
        """Number of its genes, P = stations times (1 + 2 harmonics), twice that with moments; and of two rods."""
        return self.loads + (2 * (1 + 2 * self.harmonics) if self.driving else 0)

    @property
    def loads(self) -> int:
        """Number of those that are forces or moments."""
        return self.forces * (2 if self.turning else 1)

    @property
    def forces(self) -> int:
        """Number of those that are forces."""
        return len(self.stations) * (1 + 2 * self.harmonics)

    def terms(self, phase: npt.ArrayLike) -> Array:
        """Constant, cosines and sines [..., 1 + 2 harmonics] at drive ``phase`` [...] in beats."""
        turn = 2 * np.pi * np.asarray(phase, float)[..., None] * np.arange(1, self.harmonics + 1)
        return np.concatenate([np.ones((*turn.shape[:-1], 1)), np.cos(turn), np.sin(turn)], axis=-1)

    def hats(self, span: npt.ArrayLike) -> Array:
        """Hat functions [..., stations] at parts of the ``span`` [...]."""
        y = np.asarray(span, float)
        return np.stack([np.interp(y, self.stations, row) for row in np.eye(len(self.stations))], axis=-1)

    def on_strips(self, structure: Structure) -> tuple[Array, Array]:
        """Force on each strip per size of each hat [S, stations], m, and its moment about the strip's middle, m^2.

        The moment is about the chord, tip up: a load acts on the strip that it lies on, where it lies.
        """
        edges = structure.planform.strips(structure.division)
        span = (np.arange(_CUTS) + 0.5) / _CUTS
        length = edges[-1] - edges[0]
        strip = np.clip(np.searchsorted(edges, edges[0] + span * length) - 1, 0, len(edges) - 2)
        lies = (strip == np.arange(len(edges) - 1)[:, None]) * length / _CUTS
        lever = (span - strip_middles(structure)[:, None]) * length
        hats = self.hats(span)
        return np.asarray(lies @ hats), np.asarray((lies * lever) @ hats)

    def effects(self) -> tuple[Effect, ...]:
        """Load and motion as effects, for :class:`sim.wing.flexible_wing.FlexibleWing`, whose field ``probe`` it is."""
        return (self._load(), self._motion()) if self.driving else (self._load(),)

    @property
    def _series(self) -> dict[str, str]:
        """Names of the terms, and what they are."""
        kinds = {"c": "cosine", "s": "sine"}
        terms = {f"{kind}{k}": f"{told} {k}" for kind, told in kinds.items() for k in range(1, self.harmonics + 1)}
        return {"0": "constant", **terms}

    def _motion(self) -> Effect:
        return Effect(
            name="driving_probe",
            title="Known motion of the drive",
            family="actuation",
            port="drive",
            size=tuple(
                Parameter(f"{rod}_{name}", "deg", -_FURTHEST, _FURTHEST, 0.1, f"{rod} rod turns further, {told}")
                for rod in ("front", "rear")
                for name, told in self._series.items()
            ),
            source="Fourier series of the drive phase, for each rod",
            signature="whatever one wishes",
            confused_with=(),
            wing=_drive,
        )

    def _load(self) -> Effect:
        loads = [("", "N/m", "force"), ("turn", "N", "moment nose up")][: 2 if self.turning else 1]
        return Effect(
            name="probe",
            title="Known load",
            family="aerodynamics",
            port="air",
            size=tuple(
                Parameter(
                    f"{load}{j}_{name}",
                    unit,
                    -LARGEST,
                    LARGEST,
                    1.0,
                    f"{told} per metre of span at {y:g} of it, {what}",
                )
                for load, unit, told in loads
                for j, y in enumerate(self.stations)
                for name, what in self._series.items()
            ),
            source="sum of hats of the span times Fourier series of the drive phase: any load, as well as these can",
            signature="whatever one wishes",
            confused_with=(),
            wing=partial(_wing, self),
        )


def strip_middles(structure: Structure) -> Array:
    """Span parts [S] at which evenly spread loads of the strips act."""
    edges, wiring = structure.planform.strips(structure.division), structure.wiring
    y = np.array([body.centroid[1] for body in structure.bodies])
    middle = np.add.reduceat(wiring.weight * y, wiring.strip_start[:-1])
    return np.asarray((middle - edges[0]) / (edges[-1] - edges[0]))


def _push(frame: Any, moment: int) -> None:
    """F = sum of a_k cos k psi + b_k sin k psi per strip, with what the step's method asks of its rate of change."""
    if moment == AFTER:
        _series(frame, PUSH_N)


def _roll(frame: Any, moment: int) -> None:
    """The same of the moment by which forces act beside the middle of their strip."""
    if moment == AFTER:
        _series(frame, PUSH_L)


def _turn(frame: Any, moment: int) -> None:
    """The same of a moment about the span."""
    if moment == AFTER:
        _series(frame, PUSH_M)


@inlined
def _series(frame: Any, which: int) -> None:
    port = strip_port(frame)
    harmonics = len(port.parameters) // 2
    share = load1(port.clock, SHARE)
    now, start = cosine_and_sine(load1(port.clock, NOW)), cosine_and_sine(load1(port.clock, START))
    once, first = now, start
    for s in range(port.places):
        scale = load0(port.density) * (0.5 * port.geometry[s, AREA])
        store(port.loads, s, which, load(port.loads, s, which) + load(port.parameters, 0, s) / scale)
    for k in range(1, harmonics + 1):
        drift = float(k) * share
        cosine, sine = now[0] - drift * start[1], now[1] + drift * start[0]
        for s in range(port.places):
            size = load(port.parameters, k, s) * cosine + load(port.parameters, harmonics + k, s) * sine
            scale = load0(port.density) * (0.5 * port.geometry[s, AREA])
            store(port.loads, s, which, load(port.loads, s, which) + size / scale)
        now, start = _further(now, once), _further(start, first)


@inlined
def _further(turned: Any, by: Any) -> Any:
    """Cosine and sine of the sum of two angles."""
    return turned[0] * by[0] - turned[1] * by[1], turned[1] * by[0] + turned[0] * by[1]


def _wing(probe: Probe, scene: WingScene, values: Values) -> None:
    kinds = probe.loads // probe.forces
    sizes = np.array(list(values.values())).reshape(kinds, len(probe.stations), 1 + 2 * probe.harmonics, -1)
    scene.density = np.maximum(scene.density, _THINNEST)
    strips, levers = probe.on_strips(scene.structure)
    laws = [(_push, strips, sizes[0]), (_roll, levers, sizes[0])]
    if probe.turning:
        laws.append((_turn, strips, sizes[1]))
    for law, shares, loads in laws:
        scene.add_strip_law(law, list(np.einsum("sj,jkw->ksw", shares, loads)))


def _drive(scene: WingScene, values: Values) -> None:
    rods, lag = scene.rods, scene.condition.phase_lag
    sizes = np.radians(np.array(list(values.values())))
    sizes = sizes.reshape(2, len(sizes) // 2, -1)
    harmonics = sizes.shape[1] // 2
    rods.lengthened(harmonics)
    rods.series[0] += sizes[:, 0]
    for k in range(1, harmonics + 1):
        turned = sizes[:, k] - 1j * sizes[:, harmonics + k]
        rods.series[k] += turned * np.exp(-1j * k * np.array([[0.0], [lag]]))
