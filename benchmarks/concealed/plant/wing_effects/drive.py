"""Hidden errors of the drive that the diagnosis can name, but simulates by other equations.

"The library" is the set of effects that the diagnosis can name. Fourier series of the rods' angles are complex [K], as
in ``wing/linkage.py``.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.wing.build import Draft
from benchmarks.concealed.plant.wing.linkage import angles, series_of
from benchmarks.concealed.plant.wing_effects.kind import Kind, Values
from wingfit.records import FourBarDrive, Wing

Complex = npt.NDArray[np.complex128]


def _further(wing: Wing, strength: float) -> Complex:
    """Change [K] (rad) of the rods' Fourier series for a crank longer by the fraction ``strength``; same mean.

    A drive without links moves farther by that fraction.
    """
    nominal = series_of(wing.drive)
    longer = isinstance(wing.drive, FourBarDrive) and replace(wing.drive, crank=wing.drive.crank * (1 + strength))
    change = series_of(longer) - nominal if longer else strength * nominal
    change[0] = 0.0
    return change


def _otherwise(wing: Wing, strength: float) -> Complex:
    """Change [K] (rad) of the rods' Fourier series for a ground link longer by the fraction ``strength``.

    The motor of a drive without links turns unevenly instead, by that fraction. Mean and first harmonic stay the same.
    """
    nominal = series_of(wing.drive)
    if isinstance(wing.drive, FourBarDrive):
        changed = series_of(replace(wing.drive, ground=wing.drive.ground * (1 + strength)))
    else:
        changed = _unevenly(nominal, strength)
    shift, size = np.angle(nominal[1] / changed[1]), abs(nominal[1] / changed[1])
    change = size * changed * np.exp(1j * shift * np.arange(len(changed))) - nominal
    change[:2] = 0.0
    return np.asarray(change)


def _unevenly(series: Complex, part: float) -> Complex:
    """Fourier series [K] of the motion ``series`` [K] at the phase psi + 2 ``part`` sin psi instead of psi."""
    n = 1024
    psi = 2 * np.pi * np.arange(n) / n
    found = 2 * np.fft.rfft(angles(series, psi + 2 * part * np.sin(psi))[:, 0])[: len(series)] / n
    found[0] *= 0.5
    return np.asarray(found)


def _add(draft: Draft, change: Complex) -> None:
    """Add ``change`` [K] (rad) to the Fourier series of both rods, delayed by the phase lag for the rear one."""
    late = np.exp(-1j * draft.condition.phase_lag * np.arange(len(change)))
    draft.rods += np.stack([change, change * late], axis=1)


def _stroke(draft: Draft, strength: float, _: Values) -> None:
    _add(draft, _further(draft.wing, strength))


def _stroke_genes(wing: Wing, strength: float, _: Values) -> dict[str, float]:
    first = series_of(wing.drive)[1]
    return {"stroke_amplitude.part": float(abs(first + _further(wing, strength)[1]) / abs(first) - 1)}


def _biased(draft: Draft, strength: float, _: Values) -> None:
    """Mount both rods at another angle on their axis."""
    draft.rods[0] += strength


def _bias_genes(_: Wing, strength: float, __: Values) -> dict[str, float]:
    return {"stroke_bias.angle": strength}


def _yielding(draft: Draft, strength: float, at: Values) -> None:
    """Let the speed of the motor fall by ``strength`` per watt, with a time constant (:mod:`..wing.motor`)."""
    draft.motor = strength, at["time"]


def _yielding_genes(_: Wing, __: float, at: Values) -> dict[str, float]:
    return {"compliant_drive.t": at["time"]}


def _shape(draft: Draft, strength: float, _: Values) -> None:
    _add(draft, _otherwise(draft.wing, strength))


def _shape_genes(wing: Wing, strength: float, _: Values) -> dict[str, float]:
    change = _otherwise(wing, strength) / abs(series_of(wing.drive)[1])
    found = {f"drive_harmonics.cos{k}": float(change[k].real) for k in (2, 3, 4)}
    return found | {f"drive_harmonics.sin{k}": -float(change[k].imag) for k in (2, 3, 4)}


def _late(draft: Draft, strength: float, _: Values) -> None:
    draft.rods[:, 1] *= np.exp(-1j * strength * np.arange(len(draft.rods)))


def _late_genes(_: Wing, strength: float, __: Values) -> dict[str, float]:
    return {"phase_lag_error.angle": strength}


def _tilted(draft: Draft, strength: float, at: Values) -> None:
    """Tilt the flapping axis: displace its rear bearing, a root chord behind the front one, by ``strength`` (m).

    ``at["direction"]``: angle of the displacement from y towards z, rad.
    """
    chord = draft.cut.section(float(draft.cut.edges[0]))[1]
    axle = np.array([chord, strength * math.cos(at["direction"]), strength * math.sin(at["direction"])])
    draft.axle = axle / np.linalg.norm(axle)


def _tilt_genes(wing: Wing, strength: float, at: Values) -> dict[str, float]:
    slope = strength / wing.stations[0].chord
    return {
        "hinge_tilt.y": -math.atan(slope) * math.sin(at["direction"]),
        "hinge_tilt.z": math.atan(slope) * math.cos(at["direction"]),
    }


def _moved(draft: Draft, strength: float, at: Values) -> None:
    draft.hinge = draft.hinge + strength * np.array([0.0, math.cos(at["direction"]), math.sin(at["direction"])])


def _moved_genes(_: Wing, strength: float, at: Values) -> dict[str, float]:
    return {
        "hinge_offset.y": strength * math.cos(at["direction"]),
        "hinge_offset.z": strength * math.sin(at["direction"]),
    }


def _loose(draft: Draft, strength: float, _: Values) -> None:
    for c, joint in enumerate(draft.joints):
        if joint.first < 0:
            draft.play[c] = 0.5 * strength


def _loose_genes(_: Wing, strength: float, __: Values) -> dict[str, float]:
    return {"backlash.b": strength}


_ROUND = {"direction": (0.6, -math.pi, math.pi)}

LISTED_DRIVE = (
    Kind(
        "stroke_amplitude", "actuation", True, "1", 0.05, 0.3,
        "a crank longer by a fraction: Freudenstein's equation (1955); the library multiplies the series", _stroke,
        genes=_stroke_genes,
    ),
    Kind(
        "stroke_bias", "actuation", True, "rad", 0.03, 0.2,
        "rods at another angle on their axis (Armanini et al. 2016, Eqs. 20-21: eta)", _biased, genes=_bias_genes,
    ),
    Kind(
        "drive_harmonics", "actuation", True, "1", 0.04, 0.13,
        "a linkage with a longer frame but the same stroke: all harmonics change; the library has two", _shape,
        genes=_shape_genes,
    ),
    Kind(
        "phase_lag_error", "actuation", True, "rad", 0.03, 0.2,
        "the rear rod lags more than described (van der Grinten, section III-F)", _late, genes=_late_genes,
    ),
    Kind(
        "hinge_tilt", "actuation", True, "m", 0.01, 0.05,
        "axis through two bearings, of which the rear one is displaced", _tilted, shape=_ROUND, genes=_tilt_genes,
    ),
    Kind(
        "hinge_offset", "actuation", True, "m", 0.006, 0.04,
        "axis displaced by a distance in a direction (van der Grinten's likeliest cause)", _moved, shape=_ROUND,
        genes=_moved_genes,
    ),
    Kind(
        "backlash", "actuation", True, "rad", 0.03, 0.12,
        "dead zone with logarithmic edges about the chord (Dubowsky and Freudenstein 1971; soft stops); the "
        "library has a pin in series with the spring", _loose, genes=_loose_genes,
    ),
    Kind(
        "compliant_drive", "actuation", True, "1/W", 0.002, 0.01,
        "motor with a governor of another gain, of the mean load exactly; the library's adapts to the load",
        _yielding, shape={"time": (0.04, 0.02, 0.08)}, genes=_yielding_genes,
    ),
)  # fmt: skip
