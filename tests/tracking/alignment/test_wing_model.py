"""The kinematic model of the wing: closed forms, and derivatives against differences."""

from __future__ import annotations

import numpy as np
import pytest

from wingfit.tracking.alignment.wing_model import BENDING, STATES, Strip, positions

STRIP = Strip(root=0.03, span=0.5, chord=0.2, plane=-0.01, line=(0.05, 0.03))
LINE = np.array(STRIP.line)
REST = np.random.default_rng(0).uniform([-0.05, 0.05, -0.01], [0.1, 0.5, 0.01], (7, 3))
STEP = 1e-6


def test_without_elastic_states_the_wing_turns_rigidly_about_the_hinge() -> None:
    states = np.zeros((3, STATES))
    states[:, 0] = 0.0, 0.4, -1.2
    found = positions(STRIP, REST, states, LINE)[0]
    x, y, z = REST.T
    for position, angle in zip(found, states[:, 0], strict=True):
        expected = [x, y * np.cos(angle) - z * np.sin(angle), y * np.sin(angle) + z * np.cos(angle)]
        assert np.allclose(position, np.transpose(expected), atol=1e-12)


def test_a_bent_strip_keeps_its_length() -> None:
    states = np.zeros((1, STATES))
    states[0, : 1 + BENDING] = 0.2, 0.5, -0.3, 0.4
    y = np.linspace(0.0, 0.53, 400)
    x = STRIP.line[0] + STRIP.line[1] * y / STRIP.span
    rest = np.stack([x, y, np.full_like(y, STRIP.plane)], axis=-1)
    line = positions(STRIP, rest, states, LINE)[0][0]
    length = np.linalg.norm(np.diff(line[:, 1:], axis=0), axis=1).sum()
    assert length == pytest.approx(y[-1], rel=3e-4)  # the quadrature's error where it begins to bend


@pytest.mark.parametrize("what", ["states", "rest", "line"])
def test_derivatives(what: str) -> None:
    states = 0.4 * np.random.default_rng(1).normal(size=(3, STATES))
    at = {"states": states, "rest": REST, "line": LINE}
    found = positions(STRIP, at["rest"], at["states"], at["line"])
    derivative = found[1 + list(at).index(what)]
    for column in range(at[what].shape[-1]):
        moved = {name: value.copy() for name, value in at.items()}
        moved[what][..., column] += STEP
        ahead = positions(STRIP, moved["rest"], moved["states"], moved["line"])[0]
        moved[what][..., column] -= 2 * STEP
        behind = positions(STRIP, moved["rest"], moved["states"], moved["line"])[0]
        # Gauss-Legendre quadrature is exact to 1e-3 where a wing begins to bend within it.
        assert np.allclose((ahead - behind) / (2 * STEP), derivative[..., column], atol=3e-3)
        assert np.abs(derivative[..., column]).max() > 1e-3
