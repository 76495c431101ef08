"""Description of a flapping vehicle on a balance or in flight: planform, mass and the prescribed motion of its wings.

SI units, radians. Body axes: x forward to the nose, z down; zero body pitch is level (docs/notation.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from wingfit.records.drive import FourierSeries

Layout = Literal["x4", "pair", "single"]
WINGS: Mapping[Layout, int] = {"x4": 4, "pair": 2, "single": 1}


@dataclass(frozen=True)
class ChordStation:
    """Chord (m) of the wing at the distance ``r`` (m) from the flapping axis; between stations it is linear."""

    r: float
    chord: float


@dataclass(frozen=True)
class SplitCycleFlap:
    """Flap angle of a wing that opens and closes at different speeds (Armanini et al. 2016, Eqs. 20-21).

    zeta is the flap angle (rad), t* the time in beats since the start of the beat. With omega = 2 pi,
    zeta(t*) = bias - amplitude cos((omega - split) t*) while the wing opens and
    bias - amplitude cos((omega + sigma) t* + xi) while it closes, sigma = split omega / (omega - 2 split) and
    xi = -2 pi split / (omega - 2 split): a positive split (rad per beat, below pi) opens slowly and closes fast.
    ``smoothing`` is the standard deviation, in beats, of the Gaussian that smooths the flap angle.
    """

    amplitude: float
    bias: float
    split: float
    smoothing: float = 0.01
    kind: Literal["split_cycle"] = "split_cycle"


class FourierFlap(FourierSeries):
    """Flap angle zeta as a Fourier series of psi = 2 pi t*, t* being the time in beats since the beat's start."""


@dataclass(frozen=True)
class PassivePitch:
    """Wing pitch computed from the flap angle (Armanini et al. 2016, Eq. 17 and Table 5), in rad and s.

    theta_w = pi/2 + constant + flap zeta + flap_rate zeta' + flap_rate_squared zeta'^2, with the wing pitch theta_w
    (rad), the flap angle zeta (rad) and its rate zeta' (rad/s).
    """

    constant: float
    flap: float
    flap_rate: float
    flap_rate_squared: float
    kind: Literal["passive"] = "passive"


class FourierPitch(FourierSeries):
    """Wing pitch theta_w as a Fourier series of psi = 2 pi t*, t* being the time in beats since the beat's start."""


Flap = SplitCycleFlap | FourierFlap
Pitch = PassivePitch | FourierPitch


@dataclass(frozen=True)
class WingMotion:
    """Prescribed motion of the wings over a beat, which starts (t* = 0) where the wings are closest and begin to open.

    t* is the time in beats. ``flap`` is the flap angle, ``pitch`` the wing pitch at the fraction ``pitch_station`` of
    the span. The pitch is linear along the span, with the value ``root_pitch`` (rad) at the flapping axis (pi/2: chord
    along the body). ``peel_end`` is the t* at which wings that touched have separated along the whole chord.
    """

    flap: Flap
    pitch: Pitch
    root_pitch: float
    pitch_station: float = 0.7
    peel_end: float = 0.17


@dataclass(frozen=True)
class Vehicle:
    """A flapping vehicle or animal: all inputs of a blade-element model that are not genes.

    Attributes:
        layout: "x4" two pairs crossed like an X, whose upper and lower wings meet; "pair" two wings; "single" one wing.
        claps: whether wings touch at the start of the beat; if so, models with peel (the chords separate from the
            leading edge backwards) and fling circulation apply.
        stations: chord from the flapping axis (r = 0) to the tip.
        wing_mass: of one wing, kg.
        thickness: of the wing, m.
        pitch_axis: distance of the axis of wing pitch behind the leading edge, in chords (x0 of Armanini et al. 2016,
            Eq. 4).
        dihedral: zeta_0, rad, flap angle at which the wings of a pair are closed.
        mass: of the whole vehicle, kg.
        motion: of the wings in recordings without a motion of their own.
        velocities: how the velocities of the upper wing are computed: "mirrored" (mirror image of the lower wing) or
            "printed" (Armanini et al. 2016, Eq. 18 as printed).
        estimates: the user's estimates of genes by name, overriding the model's defaults.
    """

    name: str
    layout: Layout
    claps: bool
    stations: tuple[ChordStation, ...]
    wing_mass: float
    thickness: float
    pitch_axis: float
    dihedral: float
    mass: float
    motion: WingMotion
    velocities: Literal["mirrored", "printed"] = "mirrored"
    estimates: Mapping[str, float] = field(default_factory=dict)

    @property
    def span(self) -> float:
        """Length R of one wing, from the flapping axis to the tip, m."""
        return self.stations[-1].r

    @property
    def wings(self) -> int:
        """Number of wings."""
        return WINGS[self.layout]
