"""The vehicle as a model: genes, sampling, filtering, batches."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from tests.sim.vehicle.vehicles import COEFFICIENTS, DELFLY, genome, recording
from wingfit.records import FourierFlap, LowPass
from wingfit.sim.filtering import gain, low_passed
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.lift_drag import lift_drag
from wingfit.sim.vehicle.terms import PRESETS
from wingfit.sim.virtual_rigs.campaign import robird_wing
from wingfit.sim.wing.flexible_wing import FlexibleWing


def test_genes() -> None:
    model = BladeElementWing(DELFLY)
    assert [g.name for g in model.genes][:5] == ["C_l", "C_r", "C_F", "C_D0", "C_Dpi2"]
    assert model.searched == ("C_l", "C_r", "C_F")
    assert BladeElementWing(DELFLY, PRESETS["berman_wang"].terms).searched == ("C_l", "C_r")
    assert BladeElementWing(DELFLY, PRESETS["dickinson"].terms).searched == ("C_r", "K_l", "K_d")
    assert "C_F" not in [g.name for g in BladeElementWing(replace(DELFLY, claps=False)).genes]
    reference = BladeElementWing(replace(DELFLY, estimates={"C_l": 1.3}))
    assert reference.genes[0].nominal == 1.3
    wing = FlexibleWing(robird_wing(), "4")
    assert wing.searched == tuple(g.name for g in wing.genes)


def test_observes_what_the_beat_is() -> None:
    """Sampled at the steps of the beat, unfiltered, the series gives the steps back but for its very last harmonic."""
    model = BladeElementWing(DELFLY)
    rec = recording(12.5, 0.5, 1.2)
    rec = replace(rec, times=np.arange(800) / 400 / 12.5, values=np.zeros((800, 2)))
    values = genome(model, **COEFFICIENTS)
    found, beat = model.observe([values], rec).channels[0], model.beat(values, rec)[0]
    assert found[:400] == pytest.approx(beat, abs=1e-5)
    assert found[400:] == pytest.approx(found[:400], abs=1e-12)


def test_filters_the_model_as_the_data() -> None:
    """A recording made by the model and then filtered equals what the model says of the filtered recording."""
    model = BladeElementWing(DELFLY)
    values = genome(model, **COEFFICIENTS)
    raw = recording(12.5, 0.5, 1.2)
    raw = replace(raw, times=np.arange(12500) / 6250, values=np.zeros((12500, 2)))  # fast enough for every harmonic
    raw = replace(raw, values=model.observe([values], raw).channels[0])
    for cutoff in (40.0, 67.0):
        filtered = low_passed(raw, LowPass(cutoff))
        found = model.observe([values], filtered).channels[0]
        inside = slice(2500, 10000)
        assert found[inside] == pytest.approx(filtered.values[inside], abs=1e-7 * np.abs(raw.values).max())
        assert not np.isnan(
            low_passed(replace(raw, times=raw.times[:1400], values=raw.values[:1400]), LowPass(40.0)).values
        ).any()
        kept = np.isfinite(filtered.values[:, 0])  # also where the filter has just settled
        assert 0.9 < kept.mean() < 0.98
        assert found[kept] == pytest.approx(filtered.values[kept], abs=0.01 * np.abs(raw.values).max())
    assert np.ptp(found[:, 0]) < 0.97 * np.ptp(raw.values[:, 0])


def test_gain_is_that_of_the_filter_run_both_ways() -> None:
    rate, low_pass = 1000.0, LowPass(40.0, 4)
    t = np.arange(4000) / rate
    for frequency in (5.0, 40.0, 70.0):
        wave = np.sin(2 * np.pi * frequency * t)
        out = sosfiltfilt(butter(4, 40.0, fs=rate, output="sos"), wave)[1500:2500]
        amplitude = 2 * np.abs(np.mean(out * np.exp(-2j * np.pi * frequency * t[1500:2500])))
        assert gain(low_pass, rate, [frequency])[0] == pytest.approx(amplitude, rel=1e-6)
    assert gain(low_pass, rate, [40.0])[0] == pytest.approx(0.5)
    assert gain(low_pass, rate, [600.0])[0] == 0


def test_filter_refusals() -> None:
    rec = recording()
    with pytest.raises(ValueError, match=r"cutoff must lie in \(0, 500\) Hz"):
        low_passed(rec, LowPass(600.0))
    values = rec.values.copy()
    values[3, 0] = np.nan
    with pytest.raises(ValueError, match="has 1 missing values"):
        low_passed(replace(rec, values=values), LowPass(40.0))
    with pytest.raises(ValueError, match="not sampled evenly"):
        low_passed(replace(rec, times=rec.times**1.1), LowPass(40.0))
    with pytest.raises(ValueError, match="low-passed at 40 Hz already"):
        low_passed(low_passed(rec, LowPass(40.0)), LowPass(40.0))


def test_same_bits_in_any_batch() -> None:
    model, rec = BladeElementWing(DELFLY), low_passed(recording(12.5, 0.5, 1.2), LowPass(40.0))
    draw = np.random.default_rng(3)
    lower, upper = (np.array([getattr(g, side) for g in model.genes]) for side in ("lower", "upper"))
    batch = draw.uniform(lower, upper, (19, len(lower)))
    together = model.observe(batch, rec).channels
    alone = np.concatenate([BladeElementWing(DELFLY).observe([values], rec).channels for values in batch])
    assert np.array_equal(together, alone)
    assert np.array_equal(together[::-1], model.observe(batch[::-1], rec).channels)
    again: BladeElementWing = pickle.loads(pickle.dumps(model))  # noqa: S301
    assert np.array_equal(together[:3], again.observe(batch[:3], rec).channels)
    assert np.array_equal(model.beat(batch, rec)[7], model.beat(batch[7], rec)[0])


def test_axes_and_kind() -> None:
    model = BladeElementWing(DELFLY)
    values = genome(model, **COEFFICIENTS)
    both = model.observe([values], recording(12.5, 0.5, 1.2)).channels
    z = model.observe([values], recording(12.5, 0.5, 1.2, axes=("z",))).channels
    assert np.array_equal(both[:, :, 1:], z)
    tracks = replace(recording(), markers=("m",), forces=())
    with pytest.raises(ValueError, match="holds tracks; a vehicle is compared with forces"):
        model.observe([values], tracks)


def test_motion_of_the_recording_comes_first() -> None:
    model, rec = BladeElementWing(DELFLY), recording(12.5, 0.5, 1.2)
    smaller = replace(DELFLY.motion, flap=FourierFlap(0.2, (-0.2,), (0.0,)))
    own = BladeElementWing(replace(DELFLY, motion=smaller))
    values, other = genome(model, **COEFFICIENTS), genome(own, **COEFFICIENTS)
    given = model.beat([values, values], replace(rec, motion=smaller))
    assert np.array_equal(given[0], own.beat(other, rec)[0])
    assert np.array_equal(given[0], given[1])


def test_one_wing_or_a_pair() -> None:
    pair = BladeElementWing(replace(DELFLY, layout="pair", claps=False))
    single = BladeElementWing(replace(DELFLY, layout="single", claps=False))
    rec = recording(12.5, 0.5, 1.2)
    values = {k: v for k, v in COEFFICIENTS.items() if k != "C_F"}
    assert pair.beat(genome(pair, **values), rec) == pytest.approx(2 * single.beat(genome(single, **values), rec))


def test_lift_and_drag() -> None:
    assert lift_drag([[1.0, 0.0]], np.pi / 2)[0] == pytest.approx([1.0, 0.0])
    assert lift_drag([[0.0, -1.0]], 0.0)[0] == pytest.approx([1.0, 0.0])
    assert lift_drag([[1.0, 0.0]], 0.0)[0] == pytest.approx([0.0, -1.0])
    assert lift_drag([[1.0, 2.0]], 0.3)[0] == pytest.approx(
        [np.sin(0.3) - 2 * np.cos(0.3), -np.cos(0.3) - 2 * np.sin(0.3)]
    )


def test_lifts_about_its_weight_in_the_seeds_conditions() -> None:
    """Cycle-averaged lift near the 0.17 to 0.18 N that the vehicle weighs, from hover to 2 m/s (Tables 4 and 8).

    With the twist starting at theta_w = 0 at the root, as the print may also be read, the fast condition would carry a
    third of the weight (docs/decisions/0005).
    """
    reference = {
        (13.3, 0.30, 83): (0.89, 1.49, 1.69),
        (12.5, 0.65, 71): (1.24, 1.44, 1.58),
        (10.3, 2.00, 31): (2.02, 1.57, 0.67),
    }
    lifts = {}
    for root in (np.pi / 2, 0.0):
        model = BladeElementWing(replace(DELFLY, motion=replace(DELFLY.motion, root_pitch=root)))
        for (f, speed, pitch), (C_l, C_r, C_F) in reference.items():
            rec = recording(f, speed, np.radians(pitch))
            force = model.beat(genome(model, C_l=C_l, C_r=C_r, C_F=C_F), rec)[0].mean(axis=0)
            lifts[root, f] = lift_drag(force, np.radians(pitch))[0]
    assert all(0.12 < lifts[np.pi / 2, f] < 0.22 for f, *_ in reference)
    assert lifts[0.0, 10.3] < 0.1
