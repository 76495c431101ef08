"""What a planform measures: span, area, mean chord, aspect ratio, and the radius of its second moment of area."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wingfit.importers.planform.stations import Sections


@dataclass(frozen=True)
class Measures:
    """Measures of one wing, from its root end to its tip.

    Attributes:
        span_m: length along the span, m.
        area_m2: area S of the planform, m^2.
        mean_chord_m: area over span, m.
        aspect_ratio: span squared over area, of one wing.
        tip_radius_m: distance R of the tip from the flapping axis, m.
        second_moment_radius_m: r2, where r2^2 S is the integral of c r^2 dr, c the chord at the distance r from the
            flapping axis (Ellington 1984); m.
        second_moment_radius: r2 / R.
    """

    span_m: float
    area_m2: float
    mean_chord_m: float
    aspect_ratio: float
    tip_radius_m: float
    second_moment_radius_m: float
    second_moment_radius: float


def measures(sections: Sections, hinge_y: float) -> Measures:
    """Return the measures of the wing with ``sections`` that flaps about an axis at ``hinge_y`` (m)."""
    y, chord = sections.y, sections.chord
    step, r = np.diff(y), y - hinge_y
    middle_chord, middle_r = 0.5 * (chord[1:] + chord[:-1]), 0.5 * (r[1:] + r[:-1])
    span, area = float(y[-1] - y[0]), float(step @ middle_chord)
    # Simpson's rule is exact: chord and radius are linear between stations, so that the integrand is cubic.
    second = float(step @ (chord[:-1] * r[:-1] ** 2 + 4 * middle_chord * middle_r**2 + chord[1:] * r[1:] ** 2)) / 6
    radius, tip = math.sqrt(second / area), float(np.abs(r).max())
    return Measures(span, area, area / span, span**2 / area, tip, radius, radius / tip)
