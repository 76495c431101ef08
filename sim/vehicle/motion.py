"""The prescribed motion of the wings, measured or by formula: flap angle and pitch with their time derivatives.

Every flap angle is converted to a Fourier series, so that all its derivatives belong to one motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wingfit.records import Flap, FourierFlap, FourierPitch, Gene, PassivePitch, Pitch, SplitCycleFlap, WingMotion
from wingfit.records.array_types import Array, Complex

HARMONICS = 100  # of the split cycle, before its smoothing
SPLITS = (-12.0, 2.5)  # rad per beat: the wings open for 17 to 83 % of it
_NO_SPLIT = 1e-7  # rad per beat

# field of the motion, gene, unit, half width of the box, description
_FLAP_GENES = (
    ("amplitude", "A", "rad", 0.2, "amplitude of the flap angle (Armanini et al. 2016, Eqs. 20-21)"),
    ("bias", "eta", "rad", 0.2, "mean of the flap angle (Eqs. 20-21)"),
    ("split", "delta", "rad", 0.35, "split-cycle parameter: how much longer the wings open than close (Eqs. 20-21)"),
)
_PITCH_GENES = (
    ("constant", "C_theta0", "rad", 0.3, "wing pitch at rest, less pi/2 (Eq. 17)"),
    ("flap", "C_theta1", "1", 1.0, "wing pitch per flap angle (Eq. 17)"),
    ("flap_rate", "C_theta2", "s", 0.02, "wing pitch per flap rate (Eq. 17)"),
    ("flap_rate_squared", "C_theta3", "s^2", 0.001, "wing pitch per flap rate squared (Eq. 17)"),
)


_VALUE = np.array([1.0, 0.0, 0.0])[:, None]  # of an angle and its two derivatives, the angle


class PitchError(NamedTuple):
    """How the wing's pitch at the pitch station differs from that described, for B individuals, [B] each.

    ``zero``: rad, added; ``part``: relative increase of its deviation from that at rest
    (:class:`PassivePitch`) or from its mean (:class:`FourierPitch`); ``lag``: beats of delay; ``more`` [B, K + 1]:
    Fourier series added, rad, or None.
    """

    zero: Array
    part: Array
    lag: Array
    more: Complex | None = None


@dataclass(frozen=True)
class Angles:
    """Motion over one beat at n equal steps from t* = 0, for B individuals.

    ``flap`` [B, 3, n] and ``pitch`` [B, 3, n] (at the pitch station): angle (rad) and its first two derivatives by time
    (s); ``peel`` [B, n] is 1 while the wings peel apart and 0 after; ``peeled`` [n] is the fraction of the chord over
    which the wings have separated (1 for wings that do not touch).
    """

    flap: Array
    pitch: Array
    peel: Array
    peeled: Array


def motion_genes(motion: WingMotion) -> tuple[Gene, ...]:
    """Genes of the flap angle and the wing pitch of ``motion`` where given by formula; Fourier series have none."""
    laws = ((motion.flap, SplitCycleFlap, _FLAP_GENES), (motion.pitch, PassivePitch, _PITCH_GENES))
    return tuple(
        Gene(name, unit, getattr(law, field), getattr(law, field) - half, getattr(law, field) + half, "linear", text)
        for law, formula, rows in laws
        if isinstance(law, formula)
        for field, name, unit, half, text in rows
    )


def angles_of(
    series: Complex, motion: WingMotion, values: Mapping[str, Array], frequency: float, instants: int, claps: bool,
    peel_width: float, error: PitchError | None = None,
) -> Angles:  # fmt: skip
    """Flap angle, pitch and peel over one beat of ``instants`` equal steps at ``frequency`` (Hz), for B individuals.

    The flap angle is a ``series`` [B, K + 1] (:func:`flap_series`). ``values`` are genes [B] of the motion; other
    parameters have the motion's own values. Wings peel only if they touch at t* = 0 (``claps``). ``peel_width`` is the
    time, in beats, in which rotational circulation replaces fling circulation; at 0 it is one step, as printed
    (Armanini et al. 2016, Eq. 7). ``error``: of the described pitch; None for none.
    """
    flap = _derivatives(series, frequency, instants, 3)
    pitch = _pitch(motion.pitch, values, series, flap, frequency, instants, error)
    t_star = np.arange(instants) / instants
    peel, peeled = np.zeros((len(series), instants)), np.ones(instants)
    if claps:
        peel = _peel(pitch[:, 1], t_star, max(peel_width, 1.0 / instants), motion.peel_end)
        peeled = np.minimum(t_star / motion.peel_end, 1.0)
        peeled[0] = np.sqrt(0.5)  # discontinuous at t* = 0: root of the mean square of 1 and 0
    return Angles(flap[:, :3], pitch, peel, peeled)


def flap_series(flap: Flap, values: Mapping[str, Array], count: int, instants: int) -> Complex:
    """Fourier series [B, K + 1] of the flap angle (rad), Re sum_k series_k exp(2 pi i k t*), for ``count`` = B.

    ``values``: genes [B] by name that replace parameters of ``flap``. A split cycle has K < ``instants`` / 2.
    """
    if isinstance(flap, FourierFlap):
        return np.tile(flap.series, (count, 1))
    k = np.arange(min(HARMONICS, (instants - 1) // 2) + 1)
    own = (("A", flap.amplitude), ("eta", flap.bias), ("delta", flap.split))
    amplitude, bias, split = (_column(values, name, value) for name, value in own)
    series = amplitude * split_cycle_series(split, len(k) - 1)
    series[:, :1] += bias
    return np.asarray(np.broadcast_to(series, (count, len(k))) * np.exp(-0.5 * (2 * np.pi * k * flap.smoothing) ** 2))


def _column(values: Mapping[str, Array], name: str, own: float) -> Array:
    """Values [B] of the gene ``name`` as a column [B, 1], or ``own`` as [1, 1] if ``values`` has no such gene."""
    return np.asarray(values.get(name, np.array([own])), float)[:, None]


def split_cycle_series(delta: Array, harmonics: int) -> Complex:
    """Fourier series [B, harmonics + 1] of split-cycle flap angles of unit amplitude and zero bias, in closed form.

    The wing opens as -cos((omega - delta) t*) until (omega - delta) t* = pi, and closes as -cos((omega + sigma) t* +
    xi), with omega = 2 pi, sigma = delta omega / (omega - 2 delta), xi = -2 pi delta / (omega - 2 delta); ``delta``
    [B, 1], rad per beat (Armanini et al. 2016, Eqs. 20-21). ValueError if it is outside SPLITS.
    """
    out = delta[~((SPLITS[0] <= delta) & (delta <= SPLITS[1]))]
    if len(out):
        raise ValueError(
            f"the split-cycle parameter delta is {out[0]:g} rad; it must lie in [{SPLITS[0]:g}, {SPLITS[1]:g}] rad: "
            "outside, one of the strokes takes less than a sixth of the beat"
        )
    omega = 2 * np.pi
    delta = np.where(np.abs(delta) < _NO_SPLIT, _NO_SPLIT, delta)  # the closed form is 0 / 0 at zero
    opening, closing = omega - delta, omega + delta * omega / (omega - 2 * delta)
    b = 2 * np.pi * np.arange(harmonics + 1)
    turns = 1.0 + np.exp(-1j * b * (np.pi / opening))
    series = -1j * b * turns * (1.0 / (opening**2 - b**2) - 1.0 / (closing**2 - b**2))
    series[:, 1:] *= 2
    return np.asarray(series)


def _pitch(
    pitch: Pitch, values: Mapping[str, Array], series: Complex, flap: Array, frequency: float, instants: int,
    error: PitchError | None,
) -> Array:  # fmt: skip
    """Wing pitch theta_w (rad) at the pitch station and its first two derivatives by time (s): [B, 3, n] (Eq. 17).

    ``flap`` [B, 4, n]: flap angle, of the Fourier ``series``, and its first three derivatives.
    """
    late = error is not None and bool(error.lag.any())
    own = np.tile(pitch.series, (len(flap), 1)) if isinstance(pitch, FourierPitch) else series
    if error is not None and late:
        own = own * np.exp(-2j * np.pi * np.arange(own.shape[1]) * error.lag[:, None])
    if isinstance(pitch, FourierPitch):
        found, rest = _derivatives(own, frequency, instants, 2), own[:, :1].real
    else:
        rest = np.pi / 2 + _column(values, "C_theta0", pitch.constant)
        found = _passive_pitch(pitch, values, _derivatives(own, frequency, instants, 3) if late else flap)
    if error is None:
        return found
    zero = _VALUE * rest[:, :, None]
    found = found + error.part[:, None, None] * (found - zero) + error.zero[:, None, None] * _VALUE
    return np.asarray(found if error.more is None else found + _derivatives(error.more, frequency, instants, 2))


def _passive_pitch(pitch: PassivePitch, values: Mapping[str, Array], flap: Array) -> Array:
    """Wing pitch and its derivatives [B, 3, n] as :func:`_pitch`, from the flap angle with three derivatives."""
    own = {"C_theta0": pitch.constant, "C_theta1": pitch.flap, "C_theta2": pitch.flap_rate}
    c0, c1, c2, c3 = (_column(values, n, v) for n, v in (*own.items(), ("C_theta3", pitch.flap_rate_squared)))
    angle, rate, acceleration, jerk = np.moveaxis(flap, 1, 0)
    slope = c2 + 2 * c3 * rate
    value = np.pi / 2 + c0 + c1 * angle + (c2 + c3 * rate) * rate
    first = c1 * rate + slope * acceleration
    second = c1 * acceleration + slope * jerk + 2 * c3 * acceleration**2
    return np.stack([value, first, second], axis=1)


def _peel(pitch_rate: Array, t_star: Array, width: float, latest: float) -> Array:
    """Weight [B, n]: 1 while the wings peel, 0 after (Eq. 7: theta_fling' = -theta_w' > 0); ``pitch_rate`` is theta_w'.

    The peel starts at the first instant with such a pitch rate, if that is before t* = ``latest`` (else there is no
    peel), and ends where the rate changes sign. The end is a smooth step of ``width`` beats about that zero, which is
    interpolated between instants, so that forces are smooth functions of the genes.
    """
    n, rows = len(t_star), np.arange(len(pitch_rate))
    fling = pitch_rate < 0
    start = fling.argmax(axis=1)
    ended = ~fling & (np.arange(n) > start[:, None])
    k = np.maximum(ended.argmax(axis=1), 1)
    after, before = pitch_rate[rows, k], pitch_rate[rows, k - 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        end = (k - after / (after - before)) / n
    weight = np.clip((end[:, None] - t_star) / width + 0.5, 0.0, 1.0)
    weight = weight * weight * (3.0 - 2.0 * weight)
    weight[~ended.any(axis=1)] = 1.0
    weight[np.arange(n) < start[:, None]] = 0.0
    weight[~fling.any(axis=1) | (t_star[start] >= latest)] = 0.0
    weight[:, 0] *= 0.5  # discontinuous at t* = 0: the mean of both sides
    return np.asarray(weight)


def _derivatives(series: Complex, frequency: float, instants: int, orders: int) -> Array:
    """Values and derivatives by time (s) [B, orders + 1, n] over one beat of the Fourier ``series`` [B, K + 1].

    The series is Re sum_k series_k exp(2 pi i k t*); ``frequency`` in Hz. ValueError if n = ``instants`` is below
    2 K + 1.
    """
    last = series.shape[1] - 1
    if 2 * last >= instants:
        raise ValueError(
            f"a motion of {last} harmonics needs at least {2 * last + 1} instants per beat, got {instants}"
        )
    k = np.arange(last + 1)
    order = np.arange(orders + 1)[:, None]
    spectrum = np.zeros((len(series), orders + 1, instants // 2 + 1), np.complex128)
    spectrum[:, :, : last + 1] = series[:, None] * (2j * np.pi * k * frequency) ** order * (0.5 * instants)
    spectrum[:, :, 0] *= 2
    return np.fft.irfft(spectrum, instants, axis=2)
