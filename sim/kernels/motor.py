"""A compliant drive: the motor slows down under load, so the rods lag.

The crank leads uniform rotation by the time tau: tau' = sigma, the relative error of its speed, with

    sigma' = -(d (P - P_m) + sigma) / T - k tau,     P_m' = (P - P_m) a,

with the power P, the loss of speed per power d (1/W), the time constant of the motor T (s), the gain k of the control
of the mean speed (1/s^2), and the rate a at which the control adapts to the mean load P_m, to which it does not
respond. The rods follow the profile at the time t + tau, by its Taylor series. The states (tau, sigma, P_m) are the
last three.
"""

from __future__ import annotations

from wingfit.records.array_types import Array
from wingfit.sim.kernels.arrays import DECAY, Work
from wingfit.sim.kernels.jit import kernel
from wingfit.sim.kernels.lanes.vector import load, load1, store, store1

DROOP, FOLLOWING, HOLDING, AVERAGING, MOTOR = range(5)  # d, 1 / T, k, a


@kernel
def rods_of(profile: Array, tau_sigma: Array, turning: Array, out: Array) -> None:
    """Set ``out`` [2, 3, W] to angle, rate and acceleration of both rods, delayed or advanced by the motor's lead tau.

    ``profile`` [2, 6, W]: the described angle of each rod (rad) and its first four time derivatives, then the
    integration method's term for explicit dependence on time. ``tau_sigma`` [Z, W]: all states of effects, of which the
    motor's are the last three; ``turning`` [Z, W]: their rates.
    """
    z = len(tau_sigma) - 3
    tau, pace, quickening = load1(tau_sigma, z), load1(tau_sigma, z + 1) + 1.0, load1(turning, z + 1)
    for rod in range(2):
        jerk, snap = load(profile, rod, 3), load(profile, rod, 4)
        a = load(profile, rod, 2) + load(profile, rod, 5) + tau * (jerk + 0.5 * tau * snap)
        v = load(profile, rod, 1) + tau * (load(profile, rod, 2) + tau * (0.5 * jerk + tau * snap * (1.0 / 6.0)))
        x = load(profile, rod, 2) + tau * (jerk * (1.0 / 3.0) + tau * snap * (1.0 / 12.0))
        store(out, rod, 0, load(profile, rod, 0) + tau * (load(profile, rod, 1) + 0.5 * tau * x))
        store(out, rod, 1, pace * v)
        store(out, rod, 2, pace * pace * a + quickening * v)


@kernel
def motor_rates(motor: Array, work: Work) -> None:
    """Set the rates of the motor's three states in ``work.z_rate``, from the power that the rods draw.

    Their decay, minus the derivative by the state itself, is also set; ``motor`` [MOTOR, W]: d, 1 / T, k, a.
    """
    n, z = len(work.V) - 2, len(work.z) - 3
    tau, sigma, mean = load1(work.z, z), load1(work.z, z + 1), load1(work.z, z + 2)
    drawn = tau * 0.0
    for rod in range(n, n + 2):
        for i in range(6):
            drawn -= load(work.wrench, rod, i) * load(work.V, rod, i)
    excess, following = drawn - mean, load1(motor, FOLLOWING)
    store1(work.z_rate, z, sigma)
    store1(work.z_rate, z + 1, -(load1(motor, DROOP) * excess + sigma) * following - load1(motor, HOLDING) * tau)
    store1(work.z_rate, z + 2, excess * load1(motor, AVERAGING))
    store(work.z_tangent, DECAY, z, tau * 0.0)
    store(work.z_tangent, DECAY, z + 1, following)
    store(work.z_tangent, DECAY, z + 2, load1(motor, AVERAGING))
