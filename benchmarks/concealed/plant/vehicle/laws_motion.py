"""Hidden errors of the described motion of a vehicle's wings."""

from __future__ import annotations

from functools import partial

import numpy as np

from benchmarks.concealed.plant.law import Concealed, Law, strength
from benchmarks.concealed.plant.vehicle.flow import Array

_DAMPER, _HELD = 0.005, 6  # of a wing that yields: delay in beats, harmonics
_LARGEST = 0.999  # sine of half the largest deviation of the pitch


def levered(flap: Array, strength: float) -> Array:
    """Flap angle [n] (rad) if the driving lever is longer by the fraction ``strength`` than for ``flap`` [n].

    The tangent of the angle's deviation from its mean grows by that fraction.
    """
    if not strength:
        return flap
    mean = flap.mean()
    return np.asarray(mean + np.arctan((1.0 + strength) * np.tan(flap - mean)))


def flapped(flap: Array, hidden: Concealed) -> Array:
    """Flap angle [n] (rad) with the hidden errors of stroke amplitude and mean, for the described angle ``flap`` [n].

    The mean is that of Eqs. 20-21 of Armanini et al. (2016), eta.
    """
    return levered(flap, strength(hidden, "stroke_amplitude")) + strength(hidden, "stroke_bias")


def pitched(pitch: Array, rest: float, hidden: Concealed) -> Array:
    """Pitch angle [n] (rad) at the pitch station with its hidden errors, for the described angle ``pitch`` [n].

    The angle is late as that of a wing on a spring and damper, 1 / (1 + 2 pi i k lag) for the harmonic k, lag in beats
    (Voigt's model; Flügge 1975, Viscoelasticity, ch. 1). The distance of the trailing edge from its place at the angle
    ``rest`` (rad), 2 c sin((theta - rest) / 2) with the chord c, grows by a fraction. A constant is added.
    """
    late = strength(hidden, "wing_pitch_phase")
    if late:
        spectrum = np.fft.rfft(pitch)
        pitch = np.fft.irfft(spectrum / (1.0 + 2j * np.pi * late * np.arange(len(spectrum))), len(pitch))
    more = strength(hidden, "wing_pitch_amplitude")
    if more:
        sine = np.clip((1.0 + more) * np.sin(0.5 * (pitch - rest)), -_LARGEST, _LARGEST)
        pitch = rest + 2.0 * np.arcsin(sine)
    return np.asarray(pitch + strength(hidden, "wing_pitch_zero"))


def yielded(moment: Array, part: float) -> Array:
    """Twist [n] (rad) by a ``moment`` [n] over a beat, of a wing on a spring and damper (Flügge 1975, ch. 1).

    ``part``: rad per unit of the moment, at rest. Above its lowest harmonics, the wing's inertia holds it.
    """
    spectrum = np.fft.rfft(part * moment)
    k = np.arange(len(spectrum))
    return np.fft.irfft(spectrum * (k <= _HELD) / (1.0 + 2j * np.pi * _DAMPER * k), len(moment))


_listed = partial(Law, side="physics")
MOTION = (
    _listed(
        "stroke_amplitude",
        typical=0.05,
        source="a lever longer than described: the tangent of the angle grows",
        both_signs=True,
        values=lambda p: {"stroke_amplitude.part": p["strength"]},
    ),
    _listed(
        "stroke_bias",
        typical=0.03,
        source="Armanini et al. (2016), Eqs. 20-21: eta",
        both_signs=True,
        values=lambda p: {"stroke_bias.angle": p["strength"]},
    ),
    _listed(
        "wing_pitch_zero",
        typical=0.05,
        source="Armanini et al. (2016), Eq. 17: C_theta0",
        both_signs=True,
        values=lambda p: {"wing_pitch_zero.angle": p["strength"]},
    ),
    _listed(
        "wing_pitch_amplitude",
        typical=0.1,
        source="the way of the trailing edge grows, not the angle",
        both_signs=True,
        values=lambda p: {"wing_pitch_amplitude.part": p["strength"]},
    ),
    _listed(
        "wing_pitch_phase",
        typical=0.02,
        source="Flügge (1975): spring and damper, in place of a delay alike for all harmonics",
        values=lambda p: {"wing_pitch_phase.lag": p["strength"]},
    ),
    _listed(
        "elastic_twist",
        typical=0.1,
        source="Bisplinghoff, Ashley and Halfman (1955), Aeroelasticity, ch. 8: torsion by the moment of the air",
    ),
)
