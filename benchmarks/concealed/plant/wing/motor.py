"""Compliant drive: a motor whose speed falls under load, so that the crank is late where the wing needs power.

Found by iteration with the motion of the wing (load, lead of the crank, motion, load and so on), with Anderson's
extrapolation.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.wing.build import Draft, rod_table
from benchmarks.concealed.plant.wing.integrator import State, drive
from benchmarks.concealed.plant.wing.joint_loads import joint_loads
from benchmarks.concealed.plant.wing.periodic import Accuracy, leap, settle
from benchmarks.concealed.plant.wing.rig import Motion, Rig

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_HARMONICS = 16  # of the load that change the speed
_GOVERNOR = 2.0  # rate at which the governor removes a lead, over the angular rate of the beat
_ROUNDS, _SAME = 25, 2e-5  # most iterations; rad: change of the lead at which they end
_FAR = 0.1  # rad: most that the lead changes in an iteration
_WINDOW = 6  # iterations that are combined in an extrapolation


def driven(rig: Rig, draft: Draft, start: State, accuracy: Accuracy) -> tuple[Array, Array, float, int]:
    """Find the periodic motion as :func:`.periodic.settle`, with the motor of ``draft``, whose ``lead`` is set.

    ArithmeticError if the iteration does not converge.
    """
    spent, xs, fs = 0, list[Array](), list[Array]()
    for _ in range(_ROUNDS):
        R, p, error, beats = settle(rig, lambda steps: rod_table(draft, steps), start, accuracy)
        spent += beats
        if not draft.motor[0]:
            return R, p, error, spent
        x = np.pad(draft.lead, (0, _HARMONICS + 1 - len(draft.lead))).view(float)
        xs, fs = [*xs[-_WINDOW:], x], [*fs[-_WINDOW:], lead(power(rig, draft, R, p), draft).view(float) - x]
        if np.abs(fs[-1]).sum() < _SAME:
            return R, p, error, spent
        way = leap(xs, fs) - x
        draft.lead = (x + way * min(1.0, _FAR / np.abs(way).sum())).view(complex)
    raise ArithmeticError("the motion of a compliant drive does not converge; choose a smaller strength")


def lead(load: Array, draft: Draft) -> Complex:
    """Fourier series [K] (rad) of the crank's lead for the power ``load`` [n] (W) that the wing needs over a beat.

    Direct-current motor with a governor of its mean speed: t s' + s = -d (P - mean P) - g tau, tau' = s, with the
    relative error of speed s, the lead tau (s), the loss of speed per power d and the time constant t (Fitzgerald,
    Kingsley and Umans 2003, ch. 7); solved for each harmonic, and g is _GOVERNOR times 2 pi f.
    """
    droop, constant = draft.motor
    omega = 2 * np.pi * draft.condition.flap_frequency
    rate = 1j * omega * np.arange(1, _HARMONICS + 1)
    parts = 2.0 * np.fft.rfft(load)[1 : _HARMONICS + 1] / len(load)
    return np.concatenate([[0.0], -omega * droop * parts / (rate**2 * constant + rate + _GOVERNOR * omega)])


def power(rig: Rig, draft: Draft, R: Array, p: Array) -> Array:
    """Power [n] (W) that both rods exert on the wing at the start of each step, by its springs and dampers.

    ``R`` [n, N, 3, 3], ``p`` [n, N, 3] (m): rotations and centres of the bodies over a beat. Without the moments of
    springs that have an internal state.
    """
    steps, count = p.shape[:2]
    v, dR = _rate(p, rig.period), _rate(R, rig.period)
    skew = np.einsum("tnij,tnkj->tnik", dR, R)
    w = 0.5 * np.stack([skew[..., i, j] - skew[..., j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=-1)
    rods, drawn = rod_table(draft, steps), np.zeros(steps)
    for t in range(steps):
        m = Motion(np.zeros((count + 2, 3, 3)), *(np.zeros((count + 2, 3)) for _ in range(5)))
        m.R[:count], m.p[:count], m.v[:count], m.w[:count] = R[t], p[t], v[t], w[t]
        drive(rig, rods[t, 0], m)
        load = np.zeros((count + 2, 6))
        joint_loads(rig, m, load)
        drawn[t] = -(load[count:, 3:] * m.w[count:]).sum()
    return drawn


def _rate(values: Array, period: float) -> Array:
    """Time derivative of one ``period`` (s) of ``values`` [n, ...]."""
    spectrum = np.fft.rfft(values, axis=0)
    k = np.arange(len(spectrum)).reshape(-1, *(1,) * (values.ndim - 1))
    return np.fft.irfft(2j * np.pi / period * k * spectrum, len(values), axis=0)
