"""Apply a given load to the wing, by its position along the span and its phase, or a given motion to its drive.

The response of the tracks to this load shows which load or motion is missing where model and recording differ. The load
is not in the registry of effects, because a search for missing physics must not propose it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from wingfit.records.array_types import Array, ArrayLike
from wingfit.sim.effects.contract import Effect, Parameter, Values, effect_of_air, effect_of_drive
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.arrays import AREA, NOW, PUSH_L, PUSH_M, PUSH_N, SHARE, START
from wingfit.sim.kernels.jit import inlined
from wingfit.sim.kernels.lanes.lanewise import cosine_and_sine
from wingfit.sim.kernels.lanes.vector import load, load0, load1, store
from wingfit.sim.kernels.laws import strip_port
from wingfit.sim.wing.structure import Structure

LARGEST = 1000.0  # N/m, bound of a gene: far beyond the strength of a wing
_FURTHEST = 90.0  # deg, bound of the additional angle of a rod
_THINNEST = 1e-9  # kg/m^3: the loads are given as loads of the air, in proportion to its density
_CUTS = 1200  # pieces of the span over which the hat functions are averaged


@dataclass(frozen=True)
class Probe:
    """A force per metre of span (N/m): hat functions over ``stations`` times Fourier series of the drive phase.

    A hat function is 1 at its station, 0 at all others, and linear between. ``stations`` are fractions of the span,
    increasing from 0 (root) to 1 (tip); ``harmonics``: number of harmonics of the flap frequency. The force acts upward
    along the normal of the wing and is spread over the chord. If ``turning``, a moment about the span (nose up, N m/m)
    is added. If ``driving``, the angle of each rod has an additional Fourier series (deg), for the rear rod later by
    its lag. The genes of the effects (:meth:`effects`) are ordered forces, moments, front rod, rear rod; loads station
    by station; each as constant, cosines, sines (:meth:`terms`).
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
        """Number of genes: S (1 + 2 H) forces (S stations, H harmonics), as many moments, 2 (1 + 2 H) rod motions."""
        return self.loads + (2 * (1 + 2 * self.harmonics) if self.driving else 0)

    @property
    def loads(self) -> int:
        """Number of genes that are forces or moments."""
        return self.forces * (2 if self.turning else 1)

    @property
    def forces(self) -> int:
        """Number of genes that are forces."""
        return len(self.stations) * (1 + 2 * self.harmonics)

    def terms(self, phase: ArrayLike) -> Array:
        """Return constant, cosines and sines [..., 1 + 2 H] at the drive ``phase`` [...] in beats, for H harmonics."""
        turn = 2 * np.pi * np.asarray(phase, float)[..., None] * np.arange(1, self.harmonics + 1)
        return np.concatenate([np.ones((*turn.shape[:-1], 1)), np.cos(turn), np.sin(turn)], axis=-1)

    def hats(self, span: ArrayLike) -> Array:
        """Return the hat functions [..., stations] at fractions ``span`` [...] of the span."""
        y = np.asarray(span, float)
        return np.stack([np.interp(y, self.stations, row) for row in np.eye(len(self.stations))], axis=-1)

    def on_strips(self, structure: Structure) -> tuple[Array, Array]:
        """Return force (m) and moment (m^2) on each strip per 1 N/m of each hat function, [S, stations] each.

        S strips. The moment is that about the chord at the strip's middle, tip up. Each piece of load acts on the strip
        under it.
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
        """Return load and motion as effects of a FlexibleWing (:mod:`wingfit.sim.wing.flexible_wing`)."""
        return (self._load(), self._motion()) if self.driving else (self._load(),)

    @property
    def _series(self) -> dict[str, str]:
        """Short names of the terms of a Fourier series, each with its description."""
        kinds = {"c": "cosine", "s": "sine"}
        terms = {f"{kind}{k}": f"{word} {k}" for kind, word in kinds.items() for k in range(1, self.harmonics + 1)}
        return {"0": "constant", **terms}

    def _motion(self) -> Effect:
        what = "additional angle of the"
        return effect_of_drive(
            name="driving_probe",
            title="Known motion of the drive",
            size=tuple(
                Parameter(f"{rod}_{name}", "deg", -_FURTHEST, _FURTHEST, 0.1, f"{what} {rod} rod, {term}")
                for rod in ("front", "rear")
                for name, term in self._series.items()
            ),
            law="zeta_front = zeta + front_0 + sum_k front_ck cos k psi + front_sk sin k psi, and the rear rod alike",
            source="Fourier series of the drive phase, for each rod",
            signature="any",
            confused_with=(),
            wing=_drive,
        )

    def _load(self) -> Effect:
        loads = [("", "N/m", "force"), ("turn", "N", "moment nose up")][: 2 if self.turning else 1]
        places = [f"per metre of span at {y:g} of it" for y in self.stations]
        return effect_of_air(
            name="probe",
            title="Known load",
            size=tuple(
                Parameter(f"{load}{j}_{name}", unit, -LARGEST, LARGEST, 1.0, f"{what} {where}, {term}")
                for load, unit, what in loads
                for j, where in enumerate(places)
                for name, term in self._series.items()
            ),
            law="f = sum_j hat_j(y) (j_0 + sum_k j_ck cos k psi + j_sk sin k psi), with 0_0 at the root",
            source="hat functions of the span times Fourier series of the drive phase",
            signature="any",
            confused_with=(),
            wing=partial(_wing, self),
        )


def strip_middles(structure: Structure) -> Array:
    """Return the fractions of the span [S] at which loads that are spread evenly over S strips act."""
    edges, wiring = structure.planform.strips(structure.division), structure.wiring
    y = np.array([body.centroid[1] for body in structure.bodies])
    middle = np.add.reduceat(wiring.weight * y, wiring.strip_start[:-1])
    return np.asarray((middle - edges[0]) / (edges[-1] - edges[0]))


def _push(frame: Any, moment: int) -> None:
    """Add to each strip the normal forces, which are the parameters of the law; for ``frame``, see :func:`_series`."""
    _series(frame, PUSH_N)


def _roll(frame: Any, moment: int) -> None:
    """Add to each strip the moment of the normal forces on it about the strip's middle, tip up."""
    _series(frame, PUSH_L)


def _turn(frame: Any, moment: int) -> None:
    """Add to each strip a moment about the span, nose up."""
    _series(frame, PUSH_M)


@inlined
def _series(frame: Any, which: int) -> None:
    """Add sum_k a_k cos k psi + b_k sin k psi to column ``which`` of the strips' loads, psi being the drive phase.

    The law's parameters a_k, then b_k, are in N or N m; ``frame``: see :mod:`wingfit.sim.kernels.laws`. The
    integrator's term for explicit dependence on time is included.
    """
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
    """Return (cosine, sine) of the sum of two angles, from (cosine, sine) of each."""
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
