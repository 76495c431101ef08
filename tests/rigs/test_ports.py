"""Laws at ports against closed forms, their signs, and that zero switches them off."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from tests.rigs.oscillator import PORT, blank, run_of
from wingfit.records.array_types import Array
from wingfit.rigs.ports import Port, laws
from wingfit.rigs.run import SimulationError

LAWS = laws(PORT)
NAMES = sorted(LAWS)


def motion(name: str, values: dict[str, float], start: tuple[float, float], stiffness: float = 0.0) -> Array:
    """Displacement and rate [2, T] of a mass of 1 kg on which the law ``name`` acts."""
    run = run_of(blank(), {"slide": [LAWS[name]]}, values)

    def rate(_: float, state: Array) -> tuple[float, float]:
        return state[1], -stiffness * state[0] + run.force("slide", state[0], state[1])

    return run.integrate(rate, start)


@pytest.mark.parametrize("name", NAMES)
def test_zero_is_exactly_off(name: str) -> None:
    law, rng = LAWS[name], np.random.default_rng(1)
    values = {gene.name: gene.nominal for gene in law.suspect.genes} | {"stiffness": 40.0}
    for x, v, z in rng.normal(size=(50, 3)):
        assert law.force(values, x, v, z) == 0.0


@pytest.mark.parametrize("name", NAMES)
def test_the_force_at_the_bound_is_that_of_the_port(name: str) -> None:
    """The largest size gives the port's force at its largest coordinate and rate, so that bounds make sense."""
    law = LAWS[name]
    values = {gene.name: gene.upper for gene in law.suspect.genes} | {"stiffness": 40.0}
    force = abs(law.force(values, PORT.coordinate, PORT.rate, 1.0))
    expected = 40.0 * 0.5 * PORT.coordinate if name.startswith("play") else PORT.force
    assert force == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("name", ["dry_friction.slide", "viscous.slide", "square_drag.slide", "hysteresis.slide"])
def test_damping_takes_energy(name: str) -> None:
    values = {gene.name: gene.nominal for gene in LAWS[name].suspect.genes}
    values[LAWS[name].suspect.size_genes[0]] = 0.3 * LAWS[name].suspect.genes[0].upper
    x, v = motion(name, values, (0.1, 0.0), stiffness=40.0)
    energy = 0.5 * v**2 + 20.0 * x**2
    assert energy[-1] < 0.5 * energy[0]


def test_viscous_damping_decays_exponentially() -> None:
    _, v = motion("viscous.slide", {"viscous.slide.size": 0.7}, (0.0, 0.5))
    np.testing.assert_allclose(v, 0.5 * np.exp(-0.7 * blank().times), rtol=1e-6)


def test_drag_with_the_square_of_the_rate() -> None:
    _, v = motion("square_drag.slide", {"square_drag.slide.size": 1.3}, (0.0, 0.5))
    np.testing.assert_allclose(v, 0.5 / (1.0 + 1.3 * 0.5 * blank().times), rtol=1e-6)


def test_dry_friction_stops_a_mass_after_the_distance_of_coulomb() -> None:
    """From 0.6 m/s with 0.5 N per kg: 0.36 m; the smooth sign lets it creep a little further."""
    x, v = motion("dry_friction.slide", {"dry_friction.slide.size": 0.5}, (0.0, 0.6))
    assert x[-1] == pytest.approx(0.6**2 / (2 * 0.5), rel=0.02)
    assert abs(v[-1]) < 1e-3


def test_a_cubic_spring_has_the_period_of_duffing() -> None:
    """Without a linear spring: period = 4 sqrt(2) K(1/2) / (sqrt(k) a) / sqrt(2), with the elliptic integral K."""
    size, start = 400.0, 0.1
    x, _ = motion("cubic_stiffness.slide", {"cubic_stiffness.slide.size": size}, (start, 0.0))
    period = 4.0 * scipy.special.ellipk(0.5) / (np.sqrt(size) * start)
    crossing = blank().times[np.flatnonzero(np.diff(np.sign(x)))[0]]
    assert crossing == pytest.approx(period / 4.0, abs=0.03)
    assert x.min() == pytest.approx(-start, rel=1e-3)


def test_a_constant_force_moves_the_rest_position() -> None:
    x, _ = motion("constant_force.slide", {"constant_force.slide.size": 2.0}, (0.05, 0.0), stiffness=40.0)
    np.testing.assert_allclose(x, 0.05, atol=1e-7)  # 2 N on 40 N/m


def test_play_is_a_gap_without_force() -> None:
    force = LAWS["play.slide"].force
    values = {"play.slide.gap": 0.02, "stiffness": 40.0}
    total = [-40.0 * x + force(values, x, 0.0, 0.0) for x in (-0.05, -0.01, 0.0, 0.02, 0.05)]
    np.testing.assert_allclose(total, [40.0 * 0.03, 0.0, 0.0, 0.0, -40.0 * 0.03], atol=1e-12)


def test_hysteresis_builds_up_to_its_force_and_encloses_an_area() -> None:
    """Dahl: pulled far at a steady rate, the friction is F (1 - exp(-distance / reach))."""
    law, recording = LAWS["hysteresis.slide"], blank()
    values = {"hysteresis.slide.force": 1.5, "hysteresis.slide.reach": 0.02}
    run, seen = run_of(recording, {"slide": [law]}, values), []

    def rate(_: float, state: Array) -> tuple[float, float]:
        return 0.1, run.force("slide", state[0], 0.1)

    x, total = run.integrate(rate, (0.0, 0.0))
    seen = np.gradient(total, recording.times)
    np.testing.assert_allclose(seen[2:-2], -1.5 * (1.0 - np.exp(-x[2:-2] / 0.02)), atol=0.02)


def test_a_law_with_memory_needs_the_integration() -> None:
    run = run_of(blank(), {"slide": [LAWS["hysteresis.slide"]]}, {"hysteresis.slide.force": 1.0})
    with pytest.raises(SimulationError, match=r"within Run\.integrate"):
        run.force("slide", 0.0, 0.0)


def test_a_port_without_a_stated_spring_has_no_play() -> None:
    assert not any(name.startswith("play") for name in laws(Port("a", "m", "N", 1.0, 1.0, 1.0)))


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_scales_of_a_port_are_positive(value: float) -> None:
    with pytest.raises(ValueError, match=r"typical rate is .*; give a positive number"):
        Port("a", "m", "N", 1.0, value, 1.0)
