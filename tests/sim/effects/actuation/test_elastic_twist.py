from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.flown import DELFLY, FAST, alone, density, flown, gliding
from tests.sim.vehicle.vehicles import COEFFICIENTS, genome
from wingfit.records import Vehicle
from wingfit.sim.effects.ports import vehicle as port
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing

PITCH, SPEED, LIFT = 1e-3, 3.0, 1.7


@pytest.mark.parametrize("compliance", [-0.1, 0.05, 1.0])
def test_a_wing_in_a_stream_yields_by_the_static_law(compliance: float) -> None:
    """A small incidence falls to 1 / (1 + q / q_D) of itself, with q_D the pressure of divergence (if negative)."""
    vehicle, rec = gliding(PITCH, SPEED)
    # lift rho C_l c V^2 pitch(r), with pitch(r) in proportion to r
    share = density(rec) * LIFT * SPEED**2 / (2 * vehicle.motion.pitch_station) * compliance / 10.0
    yielded = flown(vehicle, rec, alone("translation"), C_l=LIFT, elastic_twist__compliance=compliance)
    less = gliding(PITCH / (1 + share), SPEED)[0]
    expected = flown(less, rec, alone("translation"), C_l=LIFT)
    np.testing.assert_allclose(yielded, expected, rtol=1e-4, atol=1e-9)
    stiff = flown(vehicle, rec, alone("translation"), C_l=LIFT)
    assert (np.abs(yielded).max() < np.abs(stiff).max()) == (compliance > 0)


def pitch(compliance: float, vehicle: Vehicle = DELFLY) -> np.ndarray:
    model = BladeElementWing(vehicle, effects=("elastic_twist",))
    known = {gene.name for gene in model.genes}
    own = {name: value for name, value in COEFFICIENTS.items() if name in known}
    return np.asarray(model.angles(genome(model, **own, **{"elastic_twist.compliance": compliance}), FAST).pitch[0])


def test_the_twist_of_a_flapping_wing_is_that_of_the_load_which_it_makes(monkeypatch: pytest.MonkeyPatch) -> None:
    found = pitch(0.3)
    assert np.ptp(found[0] - pitch(0.0)[0]) > 0.05, "it matters"
    monkeypatch.setattr(port, "TWIST_ROUNDS", 60)
    np.testing.assert_allclose(found[0], pitch(0.3)[0], atol=5e-5)


def test_the_rates_are_those_of_the_angle() -> None:
    angle, rate, acceleration = pitch(0.3)
    step = 1.0 / (FAST.condition.flap_frequency * len(angle))
    for value, derivative in ((angle, rate), (rate, acceleration)):
        central = (np.roll(value, -1) - np.roll(value, 1)) / (2 * step)
        assert np.abs(central - derivative).max() < 0.02 * np.abs(derivative).max()


def test_a_twist_without_a_solution_is_not_finite(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a wing that diverges, or whose iteration has not settled."""
    monkeypatch.setattr(port, "TWIST_ROUNDS", 6)
    assert np.isnan(pitch(1.0)).all()
    assert np.isfinite(pitch(0.01)).all()


def test_drag_by_the_measured_curve_twists_too() -> None:
    model = BladeElementWing(DELFLY, terms=("steady_curves",), effects=("elastic_twist",))

    def found(K_d: float, compliance: float) -> np.ndarray:
        genes = genome(model, K_l=0.0, K_d=K_d, **{"elastic_twist.compliance": compliance})
        return np.asarray(model.angles(genes, FAST).pitch[0, 0])

    stiff = found(1.0, 0.0)
    np.testing.assert_array_equal(found(0.0, 0.1), stiff)
    weak, strong = (np.ptp(found(K_d, 0.02) - stiff) for K_d in (0.5, 1.0))
    assert strong == pytest.approx(2 * weak, rel=0.1)
    assert strong > 0.01
