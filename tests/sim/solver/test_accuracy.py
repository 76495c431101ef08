"""The accuracy that a user states is the accuracy of the markers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from wingfit.records import Condition
from wingfit.sim.kernels.arrays import Trace
from wingfit.sim.solver.numerics import LADDER, Numerics
from wingfit.sim.solver.settle import Course
from wingfit.sim.solver.simulate import Beat, _judge
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing

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
def test_the_error_is_below_the_requested_accuracy(condition: Condition, accuracy: float) -> None:
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


@pytest.mark.parametrize("condition", [vacuum(10.0, 0.05, 3.0), tunnel(0.12, 4.0, 6.0)], ids=["vacuum", "tunnel"])
@pytest.mark.parametrize("division", ["4", "11"])
def test_a_warm_start_is_as_accurate_and_costs_less(division: str, condition: Condition) -> None:
    model = FlexibleWing(robird_wing(), division)
    base, blank = random_genomes(model, 1)[0], blank_recording(model.wing, condition)
    genomes = base * np.exp(np.random.default_rng(4).uniform(-0.15, 0.15, (8, len(base))))
    found = model.beside(base).beats(genomes, blank)
    exact = replace(model, numerics=FINE).beats(genomes, blank)
    assert max(error(a, b) for a, b in zip(found, exact, strict=True)) < model.numerics.accuracy
    assert max(beat.error for beat in found) < 1.5 * model.numerics.accuracy
    alone = model.beats(genomes, blank)
    cost = [sum(len(beat.tracks) * beat.beats for beat in beats) for beats in (found, alone)]
    assert cost[0] < 0.65 * cost[1]
    assert max(len(beat.tracks) for beat in found) <= max(len(beat.tracks) for beat in alone)


def test_an_individual_that_fails_from_a_warm_start_starts_from_rest() -> None:
    """A stroke that is larger at once throws the wing over in its first beat; from rest it goes."""
    wing = FlexibleWing(robird_wing(), "4")
    nominal, blank = np.array([g.nominal for g in wing.genes]), blank_recording(wing.wing, vacuum(10.0, 0.05, 3.0))
    model = wing.with_effects("stroke_amplitude")
    genomes = np.array([[*nominal, part, 0.0] for part in (0.01, 0.4)])
    found, exact = (one.beats(genomes, blank) for one in (model.beside(genomes[0]), replace(model, numerics=FINE)))
    assert [beat.reason for beat in found] == [None, None]
    assert max(error(a, b) for a, b in zip(found, exact, strict=True)) < model.numerics.accuracy


def test_an_accuracy_out_of_reach_is_reported() -> None:
    model = FlexibleWing(robird_wing(), "4", numerics=Numerics(accuracy=1e-12, periodic=1e-6))
    beat = model.beat([g.nominal for g in model.genes], blank_recording(model.wing, vacuum(10.0, 0.05, 4.0)))
    assert beat.reason is not None
    assert f"{LADDER[-1]} steps" in beat.reason
    assert "mm" in beat.reason
    assert np.isnan(beat.tracks).all()


@pytest.mark.parametrize("frequency", [4.0, 24.0, 40.0, 1000.0])
def test_there_are_always_two_motions_to_compare(frequency: float) -> None:
    ladder = Numerics().ladder(vacuum(10.0, 0.05, frequency))
    assert len(ladder) >= 2
    assert ladder == LADDER[-len(ladder) :]


def test_a_failure_without_a_coarser_motion_is_reported() -> None:
    """The rung before the last failed: no error is made up, nor one kept from before."""
    course = Course(np.zeros(1), tracks=np.zeros((4, 1, 3)), changes=[1.0], error=1.0, reason="diverged")
    _judge(course, Numerics(), LADDER[-2], last=False)
    assert np.isnan(course.error)
    course.reason, course.trace = None, Trace(*(np.zeros((LADDER[-1], 1, 3)) for _ in Trace._fields))
    _judge(course, Numerics(), LADDER[-1], last=True)
    assert course.reason is not None
    assert "no coarser motion for comparison" in course.reason
    assert "nan" not in course.reason


@pytest.mark.parametrize("periodic", [0.0, np.nan])
def test_distance_that_no_beat_reaches_is_refused(periodic: float) -> None:
    with pytest.raises(ValueError, match="periodic"):
        Numerics(periodic=periodic)


def test_window_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="window"):
        Numerics(window=-1)


@pytest.mark.parametrize("accuracy", [0.0, -1e-4, np.nan, np.inf])
def test_accuracy_that_is_none_is_refused(accuracy: float) -> None:
    with pytest.raises(ValueError, match="accuracy"):
        Numerics(accuracy=accuracy)


def test_a_wing_that_flutters_is_reported_and_does_not_affect_others() -> None:
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


# Of random genomes from the whole box: one that no wing could fly, relative to the estimates.
WILD = (4.36, 0.41, 0.41, 0.65, 0.26, 0.52, 3.69, 0.71, 1.2, 1.03, 2.93, 1.99, 1.79, 0.63, 1.01, 0.23, 0.31, 1.11)


def test_an_unstable_periodic_motion_is_distinguished_from_slow_convergence() -> None:
    """Leaping finds unstable motions too; waiting shows which they are. Light damping is not flutter."""
    model = FlexibleWing(robird_wing(), "11")
    nominal = np.array([g.nominal for g in model.genes])
    wild = nominal * np.array(WILD)
    stream = blank_recording(model.wing, tunnel(0.0, 2.0, 8.5))
    found = model.beat(wild, stream)
    assert found.reason is not None
    assert "flutters" in found.reason
    assert found.growth > 1.05
    waiting = replace(model, numerics=Numerics(steps=144, window=0, max_beats=60))
    assert waiting.beat(wild, stream).reason is not None
    light = nominal * [{"D_E": 0.2, "D_G": 0.2}.get(g.name, 1.0) for g in model.genes]
    settled = model.beat(light, blank_recording(model.wing, vacuum(0.01, 0.12, 4.0)))
    assert settled.reason is None
    assert 0.5 < settled.growth < 1.02
