"""Kinematic model of a flapping elastic wing: a strip that is rigid along the chord and inextensible.

The frame used here is the wing's frame with its origin moved to the hinge: x aft, Y = y - hinge.y outboard along the
span, Z = z - hinge.z up. At the span position Y the strip has the slope B(Y) about x and the twist tau(Y) about its
line x = x_e, with polynomials in the distance from the root

    B(Y) = phi + sum_j b_j s^j, j = 1 ... J,  s = max(Y - Y_root, 0) / span
    tau(Y) = sum_k a_k (Y / span)^k, k = 1 ... K

and a slope towards x, d gamma / dY = tan(tau) dB / dY + d/dY sum_l g_l s^l, l = 1 ... L. The first term is exact for a
strip that bends about its twisted chord; g is small.

The line x_e is straight, x_e = e_0 + e_1 Y / span, and lies in the middle plane z = 0 of the wing, Z = -hinge.z.
phi is the flap angle. Neither b nor a moves the hinge: whatever the wing does, its driven root turns about the axis
Y = Z = 0. The term a_1 contains the lag of the rear driving rod. The strip is integrated along its length, so that
large slopes shorten it in Y as they should.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array
from wingfit.records.wing import Wing

BENDING, TWISTING, SWEEPING = 3, 3, 2
_B = slice(0, 1 + BENDING)
_A = slice(1 + BENDING, 1 + BENDING + TWISTING)
_G = slice(1 + BENDING + TWISTING, 1 + BENDING + TWISTING + SWEEPING)
STATES = 1 + BENDING + TWISTING + SWEEPING
_MOST_TWIST = 1.2  # rad, at which the tangent in gamma ends
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True)
class Strip:
    """Dimensions of a wing for the kinematic model, m.

    Attributes:
        root: Y of the root.
        span: from root to tip.
        chord: largest.
        plane: Z of the middle plane.
        line: [2] e_0 and e_1 of the line near which a wing twists: along the front driven rod; of a wing without rods,
            through the middles of the chords, which is where an even sheet twists.
    """

    root: float
    span: float
    chord: float
    plane: float
    line: tuple[float, float]


def strip_of(wing: Wing) -> Strip:
    """Return the strip of ``wing``."""
    y, x, slope = _twisted_about(wing)
    line = (x + slope * (wing.hinge.y - y), slope * wing.span)
    chord = max(station.chord for station in wing.stations)
    return Strip(wing.stations[0].y - wing.hinge.y, wing.span, chord, -wing.hinge.z, line)


def _twisted_about(wing: Wing) -> tuple[float, float, float]:
    """Return a point y, x (m) of the line that the wing twists about, and its slope dx/dy."""
    if not wing.driven_rods:
        y = np.array([station.y for station in wing.stations])
        middles = np.array([station.leading_edge + station.chord / 2 for station in wing.stations])
        slope, start = np.polyfit(y, middles, 1)
        return 0.0, float(start), float(slope)
    front = next(rod for rod in wing.rods if rod.name == wing.driven_rods[0])
    slope = (front.x_tip - front.x_root) / (front.y_tip - front.y_root) if front.y_tip != front.y_root else 0.0
    return front.y_root, front.x_root, slope


def positions(strip: Strip, rest: Array, states: Array, line: Array) -> tuple[Array, Array, Array, Array]:
    """Positions of markers in hinge coordinates, and their derivatives.

    Args:
        strip: the wing's dimensions.
        rest: [M, 3] rest positions in hinge coordinates, m.
        states: [T, STATES] phi, b_1 ... b_J, a_1 ... a_K, g_1 ... g_L, rad.
        line: [2] e_0, e_1, m.

    Returns:
        Positions [T, M, 3] (m), derivatives by the states [T, M, 3, STATES], by the rest positions [T, M, 3, 3], and by
        the line [T, M, 3, 2].

    """
    x, Y, Z = rest.T - np.array([[0.0], [0.0], [strip.plane]])
    T, M = len(states), len(rest)
    angle, twist, sweep = states[:, _B], states[:, _A], states[:, _G]
    # The line of the strip: Gauss-Legendre along the length, from the hinge to each marker.
    along = 0.5 * Y[:, None] * (1 + _NODES)
    weights = 0.5 * Y[:, None] * _WEIGHTS
    powers = _bending_powers(strip, along)
    B = np.einsum("tj,mgj->tmg", angle, powers)
    sin, cos = np.sin(B), np.cos(B)
    sweeping = np.einsum("mg,mgj->mj", weights, powers[..., 1 : 1 + SWEEPING])
    slopes = _bending_slopes(strip, along)
    curve = np.einsum("tj,mgj->tmg", angle, slopes)
    twists = (along / strip.span)[..., None] ** np.arange(1, TWISTING + 1)
    tan = np.tan(np.clip(np.einsum("tk,mgk->tmg", twist, twists), -_MOST_TWIST, _MOST_TWIST))
    rest_of = weights * (Y[:, None] - along)
    line_x = sweep @ sweeping.T + np.einsum("tmg,mg->tm", curve * tan, rest_of)
    line_y, line_z = (cos * weights).sum(-1), (sin * weights).sum(-1)
    start = np.stack([-np.sin(states[:, :1]), np.cos(states[:, :1])]) * strip.plane
    line_y, line_z = line_y + start[0], line_z + start[1]
    by_y = -np.einsum("tmg,mg,mgj->tmj", sin, weights, powers)
    by_z = np.einsum("tmg,mg,mgj->tmj", cos, weights, powers)
    by_y[..., 0] -= start[1]
    by_z[..., 0] += start[0]
    # The section at the marker.
    ends = _bending_powers(strip, Y)
    scaled = Y / strip.span
    twisting = scaled[:, None] ** np.arange(1, TWISTING + 1)
    bend, tau = angle @ ends.T, twist @ twisting.T
    sB, cB, st, ct = np.sin(bend), np.cos(bend), np.sin(tau), np.cos(tau)
    middle = line[0] + line[1] * scaled
    arm = x - middle
    out = -arm * st + Z * ct  # along the normal (0, -sB, cB) of the strip
    found = np.stack([middle + line_x + arm * ct + Z * st, line_y - sB * out, line_z + cB * out], axis=-1)
    by_state = np.zeros((T, M, 3, STATES))
    by_state[:, :, 1, _B] = by_y - (cB * out)[..., None] * ends
    by_state[:, :, 2, _B] = by_z - (sB * out)[..., None] * ends
    turned = -arm * ct - Z * st  # derivative of ``out`` by tau
    by_state[:, :, 0, _A] = out[..., None] * twisting
    by_state[:, :, 1, _A] = (-sB * turned)[..., None] * twisting
    by_state[:, :, 2, _A] = (cB * turned)[..., None] * twisting
    by_state[:, :, 0, _G] = sweeping
    by_state[:, :, 0, _B] = np.einsum("tmg,mg,mgj->tmj", tan, rest_of, slopes)
    by_state[:, :, 0, _A] += np.einsum("tmg,mg,mgk->tmk", curve * (1 + tan**2), rest_of, twists)
    by_rest = np.zeros((T, M, 3, 3))
    by_rest[..., 0, 0], by_rest[..., 1, 0], by_rest[..., 2, 0] = ct, sB * st, -cB * st
    by_rest[..., 0, 2], by_rest[..., 1, 2], by_rest[..., 2, 2] = st, -sB * ct, cB * ct
    # Along the span, with the slopes of bend, twist and sweep at the marker.
    orders = np.arange(1, TWISTING + 1)
    twisted = twist @ (orders * scaled[:, None] ** (orders - 1) / strip.span).T
    slope = twisted * turned
    bent = angle @ _bending_slopes(strip, Y).T * out
    by_line = (
        np.stack([1 - ct, -sB * st, cB * st], axis=-1)[..., None] * np.stack([np.ones(M), scaled], axis=-1)[:, None]
    )
    by_rest[..., 0, 1] = (
        sweep @ ends[:, 1 : 1 + SWEEPING].T + np.einsum("tmg,mg->tm", curve * tan, weights) + twisted * out
    )
    by_rest[..., 1, 1], by_rest[..., 2, 1] = cB - sB * slope - cB * bent, sB + cB * slope - sB * bent
    by_rest[..., 1] += by_line[..., 1] * line[1] / np.where(Y == 0, 1.0, Y)[:, None]
    return found, by_state, by_rest, by_line


def _bending_powers(strip: Strip, Y: Array) -> Array:
    s = np.maximum(Y - strip.root, 0.0) / strip.span
    return np.asarray(np.stack([s**j for j in range(BENDING + 1)], axis=-1))


def _bending_slopes(strip: Strip, Y: Array) -> Array:
    s = np.maximum(Y - strip.root, 0.0) / strip.span
    return np.asarray(np.stack([j * s ** max(j - 1, 0) for j in range(BENDING + 1)], axis=-1)) / strip.span
