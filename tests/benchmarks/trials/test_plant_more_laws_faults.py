"""Faults of balance and tracker that the plants hide, against the effects of the library that have the same name."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from benchmarks.concealed.plant.law import Concealed
from benchmarks.concealed.plant.measurement.balance import CHOICES, FAULTS, Weighed, draw_weighing, silent, weigh
from benchmarks.concealed.plant.measurement.film import Filming, film, smoothed
from benchmarks.concealed.plant.measurement.noise import Noise
from wingfit.records import Condition
from wingfit.sim.effects.library.cameras.exponential_smoothing import response
from wingfit.sim.effects.ports.observation import Sampling
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.virtual_rigs.balance import delfly
from wingfit.sim.virtual_rigs.campaign import robird_wing, vacuum

Array = npt.NDArray[np.float64]

VEHICLE, AIR = delfly(), Condition(12.5, 0.0, 101325.0, 293.15, 0.65, 1.2)
T = np.arange(480) / 480
FORCES = np.stack([0.15 + 0.2 * np.cos(2 * np.pi * T), 0.05 * np.sin(4 * np.pi * T) - 0.1], axis=1)
WING = robird_wing()
REST = np.array([marker.position for marker in WING.markers])
FLAP = 0.5 * np.sin(2 * np.pi * T) + 0.05 * np.cos(4 * np.pi * T)
BEAT = np.stack([Rotation.from_euler("x", angle).apply(REST) for angle in FLAP])
QUIET = Filming(Noise("first_order", 0.0), lost=0, gap_rate=0.0)


def rng(seed: int = 5) -> np.random.Generator:
    return np.random.default_rng(seed)


def weighed(hidden: Concealed | None = None) -> Weighed:
    return weigh(FORCES, VEHICLE, AIR, silent(draw_weighing(rng(1))), rng(), hidden)


@pytest.mark.parametrize("axis", [0.5, 1.5])
def test_the_gain_of_an_axis_is_that_of_the_library(axis: float) -> None:
    drawn = {"strength": 0.08, "axis": axis}
    gains = [1.0 + FAULTS["axis_scale"].values(drawn)[f"axis_scale.{name}"] for name in "xz"]
    np.testing.assert_allclose(weighed({"axis_scale": drawn}).clean, weighed().clean * gains, rtol=1e-6, atol=1e-9)
    assert gains == ([1.08, 1.0] if axis < 1.0 else [1.0, 1.08])


@pytest.mark.parametrize("name", CHOICES)
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_a_mistake_is_whole_at_any_strength_and_is_that_of_the_library(name: str, seed: int) -> None:
    drawn = FAULTS[name].draw(rng(seed))
    shot, plain = weighed({name: drawn}), weighed()
    np.testing.assert_array_equal(weighed({name: drawn | {"strength": 0.0}}).clean, plain.clean)
    np.testing.assert_array_equal(weighed({name: drawn | {"strength": 0.02}}).clean, shot.clean)
    values = {gene.split(".")[1]: np.array([value]) for gene, value in FAULTS[name].values(drawn).items()}
    assert set(values) == {parameter.name for parameter in EFFECTS[name].parameters}
    times, none = shot.recording.times, np.zeros((1, *shot.clean.shape))
    sampling = Sampling(VEHICLE, shot.recording, FORCES[None], times[None], none)
    observe = EFFECTS[name].observe
    assert observe is not None
    observe(sampling, values)
    beat = sampling.beat[0]
    expected = CubicSpline(np.arange(481) / 480, np.concatenate([beat, beat[:1]]), 0, "periodic")(times * 12.5 % 1.0)
    assert np.abs(shot.clean - expected).max() < 1e-4 * np.abs(expected).max()
    assert np.abs(shot.clean - plain.clean).max() > 0.05


def test_all_positions_of_a_mistake_are_drawn() -> None:
    parts = {
        round(FAULTS["unit_error"].values(FAULTS["unit_error"].draw(rng(k)))["unit_error.part"], 2) for k in range(30)
    }
    assert parts == {100.97, 999.0, -0.78}
    signs = {tuple(FAULTS["axis_sign"].values(FAULTS["axis_sign"].draw(rng(k))).values()) for k in range(30)}
    assert signs == {(1.0, 0.0), (0.0, 1.0)}


def test_smoothing_delays_as_the_librarys_does() -> None:
    """The filters have the same lag; the library's attenuates more."""
    condition = vacuum(10.0, 0.0, 3.0)
    plain = film(BEAT, WING, condition, QUIET, rng()).clean
    hidden = {"exponential_smoothing": {"strength": 0.3}}
    np.testing.assert_array_equal(
        film(BEAT, WING, condition, QUIET, rng(), {"exponential_smoothing": {"strength": 0.0}}).clean, plain
    )
    ours = film(BEAT, WING, condition, QUIET, rng(), hidden).clean - plain
    angle = 2 * np.pi * np.arange(len(plain) // 2 + 1) / len(plain)  # whole apparent beats: periodic in the frames
    gain = response(np.array([0.3]), angle)[0]
    theirs = np.fft.irfft(np.fft.rfft(plain, axis=0) * gain[:, None], len(plain), axis=0) - plain
    ours, theirs = ours[31:], theirs[31:]
    correlation = (ours * theirs).sum() / math.sqrt((ours**2).sum() * (theirs**2).sum())
    assert correlation > 0.98
    assert 0.85 < math.sqrt((ours**2).sum() / (theirs**2).sum()) < 1.1


def test_smoothing_follows_a_line_at_a_distance_and_restarts_after_a_gap() -> None:
    line = np.tile(0.1 * np.arange(60.0)[:, None, None], (1, 4, 3))
    seen = np.zeros((60, 4), bool)
    late = smoothed(line, seen, 0.5)
    np.testing.assert_allclose(late, line - 0.1, atol=1e-12)  # by 0.5 / (1 - 0.5) frames
    seen[20:25, 1] = True
    again = smoothed(line, seen, 0.5)
    np.testing.assert_allclose(again[25, 1], line[25, 1])
    np.testing.assert_allclose(again[25:, 0], late[25:, 0])
