from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.sim.effects.flown import DELFLY, FAST, alone, density, flown, refused, without
from wingfit.records import ChordStation

CHORD = 0.08
RECTANGLE = replace(DELFLY, stations=tuple(ChordStation(r, CHORD) for r in (0.0, DELFLY.span)))


@pytest.mark.parametrize("chords", [0.1, -0.1])
def test_the_air_is_a_mass_that_lies_further_behind_the_axis(chords: float) -> None:
    """The forces of added mass pi rho c^2 / 4 at a distance are those of wings of that mass at that distance."""
    air = 0.25 * np.pi * density(FAST) * CHORD**2 * RECTANGLE.span
    terms = alone("inertial", "added_mass")
    found = flown(RECTANGLE, FAST, terms, pitch_axis_error__chords=chords) - flown(RECTANGLE, FAST, terms)
    heavy = replace(RECTANGLE, wing_mass=air)
    moved = flown(heavy, FAST, terms, mass_offset__distance=chords * CHORD) - flown(heavy, FAST, terms)
    np.testing.assert_allclose(found, moved, atol=1e-12)
    assert np.sqrt(np.mean(found**2)) > 1e-4


def test_the_circulation_of_rotation_is_that_of_a_vehicle_with_another_axis() -> None:
    other = replace(DELFLY, pitch_axis=DELFLY.pitch_axis - 0.1)
    on, off = (flown(DELFLY, FAST, pitch_axis_error__chords=0.1, C_r=c) for c in (1.5, 0.0))
    np.testing.assert_allclose(on - off, flown(other, FAST, C_r=1.5) - flown(other, FAST, C_r=0.0), atol=1e-12)


def test_it_grows_with_the_added_mass_and_less_of_the_chord_peeled() -> None:
    terms = alone("added_mass")
    once = flown(DELFLY, FAST, terms, pitch_axis_error__chords=0.1) - flown(DELFLY, FAST, terms)
    with_more = {"added_mass_error__part": 0.5}
    more = flown(DELFLY, FAST, terms, pitch_axis_error__chords=0.1, **with_more)
    np.testing.assert_allclose(more - flown(DELFLY, FAST, terms, **with_more), 1.5 * once, atol=1e-12)
    peeled = alone("added_mass", "effective_chord")
    start = (flown(DELFLY, FAST, peeled, pitch_axis_error__chords=0.1) - flown(DELFLY, FAST, peeled))[1]
    assert np.abs(start).max() < 0.01 * np.abs(once[1]).max()


@pytest.mark.parametrize("axis", [DELFLY.pitch_axis, 0.75])
def test_so_is_a_circulation_that_an_effect_adds(axis: float) -> None:
    terms, added = without("rotation"), {"rotational_circulation__coefficient": 1.5}
    here, other = replace(DELFLY, pitch_axis=axis), replace(DELFLY, pitch_axis=axis - 0.1)
    change = flown(here, FAST, terms, pitch_axis_error__chords=0.1, **added)
    change -= flown(here, FAST, terms, pitch_axis_error__chords=0.1)
    wanted = flown(other, FAST, terms, **added) - flown(other, FAST, terms)
    np.testing.assert_allclose(change, wanted, atol=1e-12)
    assert np.abs(wanted).max() > 1e-4


def test_forces_by_the_rate_of_pitch_are_those_of_the_inertial_terms() -> None:
    """Each part acts where the model, or another effect, has its term."""
    shift = {"pitch_axis_error__chords": 0.1}
    both, bare = alone("inertial", "added_mass"), alone("added_mass")
    whole = flown(RECTANGLE, FAST, both, **shift) - flown(RECTANGLE, FAST, both)
    accelerated = flown(RECTANGLE, FAST, bare, **shift) - flown(RECTANGLE, FAST, bare)
    share = {"inertial__share": 1.0}
    again = flown(RECTANGLE, FAST, bare, **shift, **share) - flown(RECTANGLE, FAST, bare, **share)
    np.testing.assert_allclose(again, whole, atol=1e-12)
    turned = whole - accelerated  # towards the axis: with both signs of the rate, not of the acceleration
    assert np.abs(turned).max() > 1e-4
    assert np.abs(accelerated).max() > 1e-4
    assert (turned[:, 0] * np.sign(-0.1)).min() > -1e-6


def test_it_is_for_models_with_added_mass() -> None:
    assert not refused("pitch_axis_error", without())
    assert refused("pitch_axis_error", without("added_mass"))
