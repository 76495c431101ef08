"""Candidate terms of a load law: products of the local motion, the air and the wing with physical meaning."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Float, Mask
from wingfit.sim.wing.probing import StationMotion

OUTER, INNER = 0.6, 0.4  # of the span: start of the outer part, end of the inner part


@dataclass(frozen=True)
class Feature:
    """A load per metre of span: a coefficient in ``unit`` times ``field``.

    ``field`` returns the values [stations, instants] for a motion of the wing; ``words``: description for the user.
    """

    name: str
    unit: str
    words: str
    field: Callable[[StationMotion], Array]


@dataclass(frozen=True)
class Window:
    """A part of the wing or beat: ``field`` of a motion is 1 inside, else 0 [stations, instants]; ``words`` name it."""

    words: str
    field: Callable[[StationMotion], Array]


def _wave(order: int, power: int, sine: bool) -> Feature:
    turn = np.sin if sine else np.cos
    name = f"f^{power} {'sin' if sine else 'cos'} {order} psi" if power else f"{'sin' if sine else 'cos'} {order} psi"
    unit = {0: "N/m", 2: "N s^2/m"}[power]
    grows = " and scales with flap frequency squared" if power else " independent of flap frequency"
    return Feature(
        name,
        unit,
        f"at {order} per beat{grows}",
        lambda m: m.flap_frequency**power * turn(2 * np.pi * order * m.phase) + 0.0 * m.velocity,
    )


FEATURES: tuple[Feature, ...] = (
    Feature(
        "rho c |V_n| V_n",
        "1",
        "proportional to air density and the square of the local normal velocity",
        lambda m: m.density * m.chord[:, None] * np.abs(m.velocity) * m.velocity,
    ),
    Feature(
        "rho c |V| V_n",
        "1",
        "proportional to air density, the speed through the air and the local normal velocity",
        lambda m: m.density * m.chord[:, None] * np.hypot(m.velocity, m.forward) * m.velocity,
    ),
    Feature(
        "rho c V_n^2",
        "1",
        "proportional to air density and the square of the local normal velocity, with the same sign on both strokes",
        lambda m: m.density * m.chord[:, None] * m.velocity**2,
    ),
    Feature(
        "rho c^2 V_c theta'",
        "1",
        "proportional to air density, the speed along the chord and the pitch rate",
        lambda m: m.density * m.chord[:, None] ** 2 * m.forward * m.pitch_rate,
    ),
    Feature(
        "rho c^2 a_n",
        "1",
        "proportional to air density and the local normal acceleration",
        lambda m: m.density * m.chord[:, None] ** 2 * m.acceleration,
    ),
    Feature(
        "rho c U^2",
        "1",
        "proportional to air density and the square of the airspeed",
        lambda m: m.density * m.chord[:, None] * m.airspeed**2 + 0.0 * m.velocity,
    ),
    Feature(
        "m a_n",
        "1",
        "proportional to the wing's own mass and the local normal acceleration",
        lambda m: m.mass[:, None] * m.acceleration,
    ),
    Feature("V_n", "N s/m^2", "proportional to the local normal velocity", lambda m: 1.0 * m.velocity),
    Feature("sign V_n", "N/m", "of constant size, with the sign of the local velocity", lambda m: np.sign(m.velocity)),
    Feature("w", "N/m^2", "proportional to the local deflection", lambda m: 1.0 * m.deflection),
    Feature("w^3", "N/m^4", "proportional to the cube of the local deflection", lambda m: m.deflection**3),
    Feature("1", "N/m", "that is constant in time", lambda m: np.ones_like(m.velocity)),
    *(_wave(order, power, sine) for order in (1, 2) for power in (0, 2) for sine in (False, True)),
)

SPAN_WINDOWS: tuple[Window, ...] = (
    Window("", lambda m: np.ones_like(m.velocity)),
    Window(f"outer {100 * (1 - OUTER):.0f} % of the span", lambda m: _where(m, m.stations[:, None] >= OUTER)),
    Window(f"inner {100 * INNER:.0f} % of the span", lambda m: _where(m, m.stations[:, None] <= INNER)),
)
BEAT_WINDOWS: tuple[Window, ...] = (
    Window("", lambda m: np.ones_like(m.velocity)),
    Window("on the upstroke", lambda m: _where(m, m.velocity[-1] > 0)),
    Window("on the downstroke", lambda m: _where(m, m.velocity[-1] < 0)),
)


def _where(motion: StationMotion, inside: Mask) -> Array:
    return np.where(np.broadcast_to(inside, motion.velocity.shape), 1.0, 0.0)


@dataclass(frozen=True)
class Candidate:
    """A candidate term: a feature that acts only in one window of the span and one of the beat."""

    feature: Feature
    span: Window
    beat: Window

    def field(self, motion: StationMotion) -> Float[Array, "J N"]:
        """Return the load per metre of span for a coefficient of one, [stations, instants]."""
        return self.feature.field(motion) * self.span.field(motion) * self.beat.field(motion)

    @property
    def name(self) -> str:
        """Short name, such as ``rho c |V_n| V_n (outer 40 % of the span)``."""
        where = ", ".join(window.words for window in (self.span, self.beat) if window.words)
        return f"{self.feature.name} ({where})" if where else self.feature.name

    @property
    def words(self) -> str:
        """Description for the user."""
        return ", ".join(text for text in (f"a load {self.feature.words}", self.span.words, self.beat.words) if text)


def candidates() -> Iterator[Candidate]:
    """Yield all features in all windows, unrestricted ones first."""
    for span in SPAN_WINDOWS:
        for beat in BEAT_WINDOWS:
            for feature in FEATURES:
                yield Candidate(feature, span, beat)
