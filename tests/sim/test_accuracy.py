"""The accuracy that a user states is the accuracy of the markers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from records import Condition
from sim.flexible_wing import FlexibleWing
from sim.numerics import LADDER, Numerics
from sim.rig import blank_recording, robird_wing, tunnel, vacuum
from sim.simulate import Beat

Array = npt.NDArray[np.float64]
FINE = Numerics(steps=864, periodic=1e-6, max_beats=60)


def random_genomes(model: FlexibleWing, count: int, seed: int = 1) -> Array:
    rng = np.random.default_rng(seed)
    low, high = (np.log([getattr(g, side) for g in model.genes]) for side in ("lower", "upper"))
    return np.asarray(np.exp(rng.uniform(0.8 * low + 0.2 * high, 0.2 * low + 0.8 * high, (count, len(low)))))


def error(beat: Beat, reference: Beat) -> float:
    """Largest distance of a marker between two motions, at the instants they share."""
    shared = np.gcd(len(beat.tracks), len(reference.tracks))
    apart = [b.tracks[:: len(b.tracks) // shared] for b in (beat, reference)]
    return float(np.linalg.norm(apart[0] - apart[1], axis=2).max())


@pytest.mark.parametrize("condition", [vacuum(10.0, 0.05, 3.0), tunnel(0.12, 4.0, 6.0)], ids=["vacuum", "tunnel"])
@pytest.mark.parametrize("accuracy", [1e-3, 1e-4, 2e-5])
def test_error_is_what_was_asked_for(condition: Condition, accuracy: float) -> None:
    model = FlexibleWing(robird_wing(), "4", numerics=Numerics(accuracy=accuracy))
    genomes, blank = random_genomes(model, 8), blank_recording(model.wing, condition)
    found, exact = model.beats(genomes, blank), replace(model, numerics=FINE).beats(genomes, blank)
    assert all(beat.reason is None for beat in (*found, *exact))
    errors = np.array([error(a, b) for a, b in zip(found, exact, strict=True)])
    estimates = np.array([beat.error for beat in found])
    assert np.all(estimates <= accuracy)
    assert np.all(errors <= accuracy)
    # the estimate is an estimate of the error, not a number that happens to be small
    assert np.all(estimates > errors / 2)


def test_what_one_needs_does_not_depend_on_its_neighbours() -> None:
    """Alone, in another lane, or among others on other rungs: the same numbers, bit for bit."""
    model = FlexibleWing(robird_wing(), "11")
    genomes, blank = random_genomes(model, 11, 7), blank_recording(model.wing, vacuum(10.0, 0.12, 4.0))
    together = model.beats(genomes, blank)
    assert len({len(beat.tracks) for beat in together}) > 1, "all on the same rung: the test shows nothing"
    backwards = model.beats(genomes[::-1], blank)[::-1]
    alone = [model.beat(genome, blank) for genome in genomes[:4]]
    for k, beat in enumerate(together):
        assert np.array_equal(beat.tracks, backwards[k].tracks)
        if k < 4:
            assert np.array_equal(beat.tracks, alone[k].tracks)
            assert beat.beats == alone[k].beats


def test_accuracy_out_of_reach_is_said() -> None:
    model = FlexibleWing(robird_wing(), "4", numerics=Numerics(accuracy=1e-12, periodic=1e-6))
    beat = model.beat([g.nominal for g in model.genes], blank_recording(model.wing, vacuum(10.0, 0.05, 4.0)))
    assert beat.reason is not None
    assert f"{LADDER[-1]} steps" in beat.reason
    assert "mm" in beat.reason
    assert np.isnan(beat.tracks).all()


@pytest.mark.parametrize("accuracy", [0.0, -1e-4, np.nan, np.inf])
def test_accuracy_that_is_none_is_refused(accuracy: float) -> None:
    with pytest.raises(ValueError, match="accuracy"):
        Numerics(accuracy=accuracy)


def test_wing_that_flutters_is_reported_and_harms_nobody() -> None:
    """A soft wing with five times the lift in a fast stream has no periodic motion; its neighbours have theirs."""
    model = FlexibleWing(robird_wing(), "11")
    nominal = np.array([g.nominal for g in model.genes])
    slack = {"E_f": 0.27, "E_r": 1.26, "G_f": 0.43, "G_r": 0.64, "D_E": 0.29, "D_G": 0.27, "L_a": 4.7, "L_b": 0.62}
    soft = nominal * [slack.get(g.name, 1.0) for g in model.genes]
    blank = blank_recording(model.wing, tunnel(0.05, 4.0, 11.0))
    calm, wild = model.beats([nominal, soft], blank)
    assert calm.reason is None
    assert wild.reason is not None
    assert "flutter" in wild.reason or "diverged" in wild.reason
    assert np.array_equal(calm.tracks, model.beat(nominal, blank).tracks)
