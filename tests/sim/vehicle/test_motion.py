"""Prescribed motion: the split cycle and the passive pitch as printed, and derivatives that belong to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.oracles.armanini_2016 import split_cycle
from tests.sim.vehicle.vehicles import DELFLY, PASSIVE, angles
from wingfit.records import FourierFlap, FourierPitch, SplitCycleFlap, WingMotion
from wingfit.sim.vehicle.motion import motion_genes, split_cycle_series

SHARP = replace(DELFLY.motion, flap=SplitCycleFlap(0.34, 0.34, 0.35, smoothing=1e-3))


@pytest.mark.parametrize("delta", [-0.6, 0.0, 1e-9, 0.35, 1.2])
def test_split_cycle_as_printed(delta: float) -> None:
    series = split_cycle_series(np.array([[delta]]), 2000)[0]
    t = np.linspace(0, 1, 57)
    value = (np.exp(2j * np.pi * t[:, None] * np.arange(2001)) @ series).real
    assert value == pytest.approx([split_cycle(x, 1.0, delta, 0.0) for x in t], abs=2e-7)


def test_opening_takes_longer_than_closing() -> None:
    flap = angles(SHARP, {}, 12.5, 800, claps=True).flap[0, 0]
    assert flap.argmin() == 0
    assert flap.argmax() / 800 == pytest.approx(np.pi / (2 * np.pi - 0.35), abs=2e-3)
    assert (flap[0], flap.max()) == pytest.approx((0.0, 0.68), abs=3e-3)


@pytest.mark.parametrize("motion", [DELFLY.motion, SHARP])
def test_derivatives_are_those_of_the_angles(motion: WingMotion) -> None:
    found, n, f = angles(motion, {}, 12.5, 1600, claps=True), 1600, 12.5
    for series in (found.flap[0], found.pitch[0]):
        spectrum = np.fft.rfft(series[0])
        for order in (1, 2):
            by_fft = np.fft.irfft(spectrum * (2j * np.pi * f * np.arange(n // 2 + 1)) ** order, n)
            assert series[order] == pytest.approx(by_fft, abs=1e-6 * np.abs(by_fft).max())


def test_passive_pitch_is_table_5() -> None:
    found = angles(DELFLY.motion, {}, 13.3, 400, claps=True)
    zeta, rate = found.flap[0, 0], found.flap[0, 1]
    wanted = np.pi / 2 + 0.3139 - 1.1382 * zeta - 0.0179 * rate - 0.0002 * rate**2
    assert found.pitch[0, 0] == pytest.approx(wanted, rel=1e-14)


def test_genes_of_the_motion_move_it_one_by_one() -> None:
    genes = {gene.name: gene.nominal for gene in motion_genes(DELFLY.motion)}
    assert list(genes) == ["A", "eta", "delta", "C_theta0", "C_theta1", "C_theta2", "C_theta3"]
    batch = {name: np.array([value, value]) for name, value in genes.items()}
    batch["A"] = np.array([0.34, 0.17])
    found, own = angles(DELFLY.motion, batch, 12.5, 400, True), angles(DELFLY.motion, {}, 12.5, 400, True)
    assert np.array_equal(found.flap[0], own.flap[0])
    assert np.array_equal(found.pitch[0], own.pitch[0])
    assert np.ptp(found.flap[1, 0]) == pytest.approx(0.5 * np.ptp(own.flap[0, 0]), rel=1e-12)


def test_motion_as_a_series_has_no_genes() -> None:
    motion = WingMotion(FourierFlap(0.3, (-0.3,), (0.01,)), FourierPitch(1.5, (), (0.4,)), root_pitch=1.5)
    assert motion_genes(motion) == ()
    found, t = angles(motion, {}, 10.0, 400, claps=False), np.arange(400) / 400
    assert found.flap[0, 0] == pytest.approx(0.3 - 0.3 * np.cos(2 * np.pi * t) + 0.01 * np.sin(2 * np.pi * t))
    assert found.pitch[0, 1] == pytest.approx(0.4 * 20 * np.pi * np.cos(2 * np.pi * t), abs=1e-12)
    assert motion_genes(replace(motion, pitch=PASSIVE))[0].name == "C_theta0"


def test_peel_lasts_until_the_wing_stops_pitching() -> None:
    found = angles(DELFLY.motion, {}, 12.5, 400, claps=True)
    rate, peel = found.pitch[0, 1], found.peel[0]
    end = int(np.nonzero(rate >= 0)[0][0])
    assert (peel[1 : end - 1] == 1).all()
    assert (peel[end + 2 :] == 0).all()
    assert found.peeled[34] == pytest.approx(34 / 400 / 0.17)
    assert (found.peeled[68:] == 1).all()
    apart = angles(DELFLY.motion, {}, 12.5, 400, claps=False)
    assert not apart.peel.any()
    assert (apart.peeled == 1).all()


def test_wings_that_pitch_the_other_way_do_not_peel() -> None:
    motion = replace(DELFLY.motion, pitch=FourierPitch(1.5, (), (0.4,)))
    assert not angles(motion, {}, 12.5, 400, claps=True).peel.any()
    still = replace(DELFLY.motion, pitch=FourierPitch(1.5, (0.4,), ()))  # begins to pitch at t* = 0, not before
    assert np.nonzero(angles(still, {}, 12.5, 400, claps=True).peel[0])[0].tolist()[::199] == [1, 200]
    turned = replace(DELFLY.motion, pitch=FourierPitch(1.5, (), (-0.4,)))
    assert np.nonzero(angles(turned, {}, 12.5, 400, claps=True).peel[0])[0][-1] == pytest.approx(100, abs=1)


def test_refusals() -> None:
    with pytest.raises(ValueError, match=r"delta is 2.6 rad; it must lie in \[-12, 2.5\] rad"):
        angles(replace(DELFLY.motion, flap=SplitCycleFlap(0.3, 0.3, 2.6)), {}, 12.5, 400, True)
    many = FourierFlap(0.0, (0.1,) * 40, (0.0,) * 40)
    with pytest.raises(ValueError, match="40 harmonics needs at least 81 instants"):
        angles(replace(DELFLY.motion, flap=many), {}, 12.5, 64, True)
