"""A wing that cannot bend, moved as asked through the air: what laws of the air make of a history of the flow."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from tests.oracles.plates import loaded
from tests.sim.kernels.marching import plank
from wingfit.records import Condition, Wing
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import new_work
from wingfit.sim.kernels.integrate import airflow
from wingfit.sim.solver.scene import at_rest
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import build

Array = npt.NDArray[np.float64]


class Motion(NamedTuple):
    """Where the wing is and how it moves, numbers or one for each lane [W]: rad, rad/s, m, m/s.

    ``flap`` about x, tip up; ``pitch`` about y, nose up, before it; ``heave`` along z.
    """

    flap: npt.ArrayLike = 0.0
    flap_rate: npt.ArrayLike = 0.0
    pitch: npt.ArrayLike = 0.0
    pitch_rate: npt.ArrayLike = 0.0
    heave: npt.ArrayLike = 0.0
    heave_rate: npt.ArrayLike = 0.0


class History(NamedTuple):
    """Over n instants: flow [n, S, FLOW, W], loads [n, S, LOADS, W], induced [n, S, 3, W] and the states [n, Z, W]."""

    flow: Array
    loads: Array
    induced: Array
    z: Array


class Moved:
    """Strips of one body in a stream along x, with one effect at ``values``; these and the airspeed may be [W]."""

    def __init__(
        self,
        name: str,
        values: Mapping[str, npt.ArrayLike],
        *,
        airspeed: npt.ArrayLike = 0.0,
        wing: Wing | None = None,
        strips: int = 2,
        genes: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        """``genes`` of the wing that are not nominal."""
        self.structure = build(wing or plank(), Division.parse(f"{strips}x1"))
        effect = EFFECTS[name]
        own = {p.name: p.typical for p in effect.parameters} | dict(values)
        scene = WingScene.of(self.structure, Condition(3.0, 0.0, 101325.0, 293.15), loaded(self.structure, genes))
        scene.wind[0] = airspeed
        assert effect.wing is not None
        effect.wing(scene, {key: np.broadcast_to(np.asarray(value, float), (LANES,)) for key, value in own.items()})
        self.lanes, self.here = scene.frozen(), scene.setting(100)
        self.work = new_work(self.structure.wiring, self.here, self.lanes)
        self.z = np.zeros((len(self.lanes.laws.size), LANES))
        rest = at_rest(self.structure)
        self.work.R[:], self.work.p[:] = rest.R, rest.p
        self.centres = np.array([body.centre for body in self.structure.bodies])

    def rate(self, motion: Motion, z: Array) -> Array:
        """Rates [Z, W] of the states at ``z``; flow and loads are left in ``work``."""
        flap, flap_rate, pitch, pitch_rate, heave, heave_rate = (np.broadcast_to(x, LANES) for x in motion)
        n, none = len(self.centres), np.zeros(LANES)
        across = Rotation.from_rotvec(np.outer(pitch, [0.0, 1.0, 0.0])).as_matrix()
        R = Rotation.from_rotvec(np.outer(flap, [1.0, 0.0, 0.0])).as_matrix() @ across
        spin = np.einsum("wji,jw->wi", across, [flap_rate, none, none]) + np.array([none, pitch_rate, none]).T
        sweep = np.einsum("wji,jw->wi", R, [none, none, heave_rate])
        self.work.R[:n] = np.moveaxis(R, 0, -1).reshape(9, LANES)
        self.work.p[:n] = np.einsum("wij,nj->niw", R, self.centres)
        self.work.p[:n, 2] += heave
        self.work.V[:n, :3] = spin.T
        self.work.V[:n, 3:] = (sweep + np.cross(spin, self.centres[:, None])).transpose(0, 2, 1)
        self.work.z[:] = z
        airflow(self.structure.wiring, self.here, self.lanes, self.work)
        return np.array(self.work.z_rate)

    def march(self, motion: Callable[[float], Motion], step: float, steps: int) -> History:
        """From time 0 and the states as they are, by the classical method of Runge and Kutta."""
        kept: list[tuple[Array, ...]] = []
        for k in range(steps):
            t = k * step
            a = self.rate(motion(t), self.z)
            kept.append(tuple(np.array(x) for x in (self.work.flow, self.work.loads, self.work.induced, self.z)))
            b = self.rate(motion(t + 0.5 * step), self.z + 0.5 * step * a)
            c = self.rate(motion(t + 0.5 * step), self.z + 0.5 * step * b)
            d = self.rate(motion(t + step), self.z + step * c)
            self.z = self.z + step / 6 * (a + 2 * b + 2 * c + d)
        return History(*(np.array(x) for x in zip(*kept, strict=True)))

    def decay(self, motion: Motion, z: Array) -> tuple[Array, Array]:
        """What the law says minus its rates' own derivatives are [Z, W], and what differences say."""
        self.rate(motion, z)
        described = np.array(self.work.z_tangent[0])
        found = np.zeros_like(z)
        for i in range(len(z)):
            small = np.zeros_like(z)
            small[i] = 1e-6
            found[i] = -(self.rate(motion, z + small)[i] - self.rate(motion, z - small)[i]) / 2e-6
        return described, found
