"""A rigid wing that swings on root springs and on one effect of the wing: a pendulum, known in closed form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ellipj, ellipk

from tests.sim.kernels.marching import march, turned, vacuum_here
from tests.sim.wing.test_rigid import pendulum
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import DAMPERS, Trace
from wingfit.sim.solver.scene import at_rest
from wingfit.sim.virtual_rigs.campaign import vacuum

Array = npt.NDArray[np.float64]

AT_ROOT = 0.02  # N m/rad, of each of the two pins


def angle(trace: Trace) -> Array:
    """Return the rotation of the first body about the x axis at each step, rad."""
    return np.asarray(np.unwrap(np.arctan2(trace.R[:, 0, 7, 0], trace.R[:, 0, 8, 0])))


@dataclass(frozen=True)
class Swing:
    """``effect`` on the pendulum, with the ``defaults`` of its genes; its spring k adds k ``lever``^2 to K_0.

    Every spring has the potential K (1 - cos theta): the pendulum's.
    """

    effect: str
    defaults: Mapping[str, float]
    lever: float

    def attach(self, scene: WingScene, **values: float) -> None:
        """Put the effect on the wing of ``scene``."""
        wing = EFFECTS[self.effect].wing
        assert wing is not None
        wing(scene, {name: np.full(LANES, value) for name, value in {**self.defaults, **values}.items()})

    def march(self, amplitude: float, steps: int, beats: float = 2.0, **values: float) -> tuple[Trace, Array, float]:
        """Return the motion after a release at ``amplitude``, its times, and omega_0 = sqrt((K_0 + K) / I)."""
        structure, group, _, inertia = pendulum()
        group.stiffness[:, 0] = AT_ROOT
        scene = WingScene.of(structure, vacuum(0.0, 0.0, 3.0), group)
        self.attach(scene, **values)
        pace = float(np.sqrt((2 * AT_ROOT + values.get("k", 0.0) * self.lever**2) / inertia))
        step = beats * 4 * float(ellipk(np.sin(amplitude / 2) ** 2)) / pace / steps
        state = at_rest(structure)
        turned(structure, state, amplitude)
        trace = march(structure, scene.frozen(), vacuum_here(step), state, steps)
        return trace, step * np.arange(steps, dtype=float), pace

    def swings_as_in_print(self, k: float, amplitude: float) -> None:
        """At a finite amplitude sin(theta / 2) = m cd(omega_0 t; m), m = sin(amplitude / 2)."""
        trace, t, pace = self.march(amplitude, 800, k=k)
        m = np.sin(amplitude / 2)
        _, cn, dn, _ = ellipj(pace * t, m**2)
        np.testing.assert_allclose(angle(trace), 2 * np.arcsin(m * cn / dn), atol=2e-4 * amplitude)

    def conserves_energy(self, k: float) -> None:
        """A spring alone keeps the sum, and dissipates nothing."""
        trace, _, _ = self.march(1.5, 1600, k=k)
        total = trace.energy[:, :, 0].sum(axis=1)
        assert not trace.power[:, DAMPERS].any()
        assert np.ptp(trace.energy[:, 1, 0]) > 0.9 * total[0], "the spring takes all of it and gives it back"
        np.testing.assert_allclose(total, total[0], rtol=1e-5)

    def holds_still_however_stiff(self) -> None:
        """The limit k to infinity: nothing moves, though a step is a thousand periods: the integrator is implicit."""
        structure, group, _, _ = pendulum()
        scene = WingScene.of(structure, vacuum(0.0, 0.0, 3.0), group)
        self.attach(scene, k=1e9)
        trace = march(structure, scene.frozen(), vacuum_here(1e-3, 9.81), at_rest(structure), 200)
        assert np.abs(trace.R[:, 0] - trace.R[0, 0]).max() < 1e-8
        assert np.abs(trace.p[:, 0] - trace.p[0, 0]).max() < 1e-8
