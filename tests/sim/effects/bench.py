"""A wing with one effect: its scene, a law of its connectors turned by hand, and the ledger of a whole beat."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from tests.sim.effects.rigs import CONDITIONS
from wingfit.records import Condition, Genome, Wing
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import Lanes, Work, new_work
from wingfit.sim.kernels.laws import AFTER
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.simulate import Beat
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, tunnel
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.genes import lanes, wing_genes
from wingfit.sim.wing.structure import Structure, build

Array = npt.NDArray[np.float64]
AIR, VACUUM = tunnel(0.05, 3.0, 6.0), CONDITIONS["vacuum"]
_LAW = ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_int64), ctypes.c_int64)
_NOMINAL: Mapping[str, float] = MappingProxyType({})


def described(name: str, wing: Wing, values: Mapping[str, float]) -> dict[str, float]:
    """All parameters of an effect by their short names: typical, or zero for sizes beside one that is given."""
    effect = EFFECTS[name]
    typical = {key.partition(".")[2]: value for key, value in effect.typical(wing).items()}
    sizes = {p.name: 0.0 for p in effect.size}
    return {**typical, **(sizes if sizes.keys() & values.keys() else {}), **values}


def scene_of(name: str, structure: Structure, condition: Condition = AIR, /, **values: float) -> WingScene:
    """The scene of the nominal wing with one effect, its parameters as :func:`described`."""
    genes = wing_genes(structure.wing.estimates)
    nominal = lanes(structure, genes, np.array([Genome.nominal(genes).values]))
    found = WingScene.of(structure, condition, nominal)
    act = EFFECTS[name].wing
    assert act is not None
    act(found, {key: np.full(LANES, value) for key, value in described(name, structure.wing, values).items()})
    return found


@dataclass
class Bench:
    """The connectors' law of an effect on a wing; one connector is turned by hand, the others lie still."""

    scene: WingScene
    frozen: Lanes
    work: Work
    at: int

    @classmethod
    def of(cls, name: str, division: str = "4", at: int = 1, **values: float) -> Bench:
        """On the robird."""
        scene = scene_of(name, build(robird_wing(), Division.parse(division)), **values)
        frozen = scene.frozen()
        work = new_work(scene.structure.wiring, scene.setting(64), frozen)
        work.Q[:, [0, 4, 8]] = 1.0
        return cls(scene, frozen, work, at)

    def call(self, turn: Array, rate: Array, states: Array) -> None:
        """Ask the law at rotation vector ``turn`` [3], turning with ``rate`` [3] about A's axes, at ``states`` [K]."""
        work, count = self.work, len(self.scene.structure.connectors)
        work.Q[self.at] = Rotation.from_rotvec(turn).as_matrix().reshape(9, 1)
        work.twist[self.at, :3] = np.asarray(rate)[:, None]
        work.z.reshape(len(states), count, LANES)[:, self.at] = np.asarray(states)[:, None]
        for array in (work.more, work.more_k, work.more_d, work.lost, work.stored):
            array[:] = 0.0
        frame = work.connector_frames[0].ctypes.data_as(ctypes.POINTER(ctypes.c_int64))
        _LAW(int(self.frozen.laws.connector[0, 0]))(frame, AFTER)

    def states(self, array: Array) -> Array:
        """What an array [Z, W] says of the states [K] of the connector that is turned."""
        count = len(self.scene.structure.connectors)
        return array.reshape(len(array) // count, count, LANES)[:, self.at, 0]

    @property
    def moment(self) -> Array:
        """Moment [3] on the second body."""
        return np.asarray(self.work.more[self.at, :3, 0])

    @property
    def energy(self) -> float:
        """Energy kept."""
        return float(self.work.stored[0])

    @property
    def loss(self) -> float:
        """Power lost."""
        return float(self.work.lost[0])

    @property
    def stiffness(self) -> Array:
        """Of the connector itself [6]."""
        return self.scene.lanes.stiffness[self.at, :, 0]

    def swing(self, axis: int, angle: Array, step: float) -> tuple[Array, Array, Array, Array]:
        """Turn about ``axis`` through ``angle`` [n] (rad), straight from one to the next, in steps of time.

        Moment about the axis, energy kept, energy lost so far, and the power that went in so far, [n] each.
        """
        unit, dt = np.eye(3)[axis], step
        z = np.zeros(len(self.work.z) // len(self.scene.structure.connectors))
        moment, kept, lost, given = (np.zeros(len(angle)) for _ in range(4))
        for k in range(len(angle) - 1):
            rate = (angle[k + 1] - angle[k]) / dt
            slopes: list[Array] = []
            work, loss = [], []
            for part in (0.0, 0.5, 0.5, 1.0):  # the classical Runge-Kutta method
                there = z + (part * dt * slopes[-1] if slopes else 0.0)
                self.call(unit * (angle[k] + part * rate * dt), unit * rate, there)
                if not slopes:
                    moment[k], kept[k] = self.moment[axis], self.energy
                slopes.append(self.states(self.work.z_rate).copy())
                work.append(-float(self.moment[axis]) * rate)
                loss.append(self.loss)
            weights = dt / 6 * np.array([1.0, 2.0, 2.0, 1.0])
            z = z + weights @ np.array(slopes)
            lost[k + 1], given[k + 1] = lost[k] + weights @ loss, given[k] + weights @ work
        self.call(unit * angle[-1], unit * 0.0, z)
        moment[-1], kept[-1] = self.moment[axis], self.energy
        return moment, kept, lost, given

    def derivatives(self, turn: Array, rate: Array, states: Array, axes: list[int]) -> None:
        """Check decay, drive and pull of all states against differences."""
        self.call(turn, rate, states)
        described = [self.states(self.work.z_tangent[kind]).copy() for kind in range(3)]
        h = 1e-7
        for k, axis in enumerate(axes):
            aside, other = np.array(states, float), np.array(rate, float)
            seen = []
            for sign in (h, -h):
                aside[k] = states[k] + sign
                self.call(turn, rate, aside)
                seen.append((self.states(self.work.z_rate)[k], self.moment[axis]))
            np.testing.assert_allclose(described[0][k], (seen[1][0] - seen[0][0]) / (2 * h), rtol=1e-5, atol=1e-7)
            np.testing.assert_allclose(described[2][k], (seen[1][1] - seen[0][1]) / (2 * h), rtol=1e-5, atol=1e-7)
            seen_rate = []
            for sign in (h, -h):
                other[axis] = rate[axis] + sign
                self.call(turn, other, states)
                seen_rate.append(self.states(self.work.z_rate)[k])
            np.testing.assert_allclose(described[1][k], (seen_rate[0] - seen_rate[1]) / (2 * h), rtol=1e-5, atol=1e-7)


def beat_of(
    name: str,
    condition: Condition = VACUUM,
    steps: int = 96,
    division: str = "4",
    genes: Mapping[str, float] = _NOMINAL,
    **values: float,
) -> Beat:
    """A periodic beat of the robird with an effect, its parameters as :func:`described`; without effects for no name.

    ``genes``: of the wing, where not nominal.
    """
    model = FlexibleWing(robird_wing(), division, numerics=Numerics(steps=steps, periodic=2e-6, max_beats=40))
    own = {}
    if name:
        model = model.with_effects(name)
        own = {f"{name}.{key}": value for key, value in described(name, model.wing, values).items()}
    genome = Genome.nominal(model.genes).replace(own | dict(genes))
    found = model.beat(genome.values, blank_recording(model.wing, condition), with_motion=True)
    assert found.reason is None
    return found


def ledger(beat: Beat, frequency: float) -> float:
    """How far energy kept and power through all ports are apart over a beat, as a part of the work of the motors."""
    stored, power, n = beat.energy.sum(axis=1), beat.power.sum(axis=1), len(beat.energy)
    turn = 2j * np.pi * frequency * np.arange(n // 2 + 1)
    turn[0] = 1.0
    given = np.fft.irfft(np.fft.rfft(power - power.mean()) / turn, n)
    apart = np.abs(given - given.mean() - stored + stored.mean()).max() + abs(power.mean()) / frequency
    return float(apart / np.abs(beat.power[:, 1:3].sum(axis=1)).mean() * frequency)


def excursion(beat: Beat) -> float:
    """How far the markers come up and down, m: mean over the outer half of them."""
    height = np.ptp(beat.tracks[:, :, 2], axis=0)
    return float(np.sort(height)[len(height) // 2 :].mean())
