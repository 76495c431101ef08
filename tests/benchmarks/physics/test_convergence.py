from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from benchmarks.physics.convergence import (
    Passed,
    Subject,
    at_steps,
    beats,
    beats_to_periodic,
    energy_error,
    fewest_steps,
    largest_distance,
    ms_per_beat,
    periodic,
    reference,
)
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.campaign import blank_recording, tunnel, vacuum

TOLERANCE = 1e-4
VACUUM = Subject("4", vacuum(10.0, 0.05, 3.0))
AIR = Subject("4", tunnel(0.05, 3.0, 6.0))


def harmonics(count: int) -> np.ndarray:
    """[count, 2, 3] of a motion with three harmonics."""
    psi = 2 * np.pi * np.arange(count)[:, None, None] / count
    amplitude = np.arange(1.0, 7.0).reshape(2, 3)
    return np.asarray(0.3 + amplitude * np.cos(psi - amplitude) + 0.5 * np.sin(2 * psi) - 0.2 * np.cos(3 * psi))


@pytest.mark.parametrize(("known", "wanted"), [(64, 32), (64, 50), (63, 62), (64, 100)])
def test_periodic_tracks_at_other_instants(known: int, wanted: int) -> None:
    np.testing.assert_allclose(at_steps(harmonics(known), wanted), harmonics(wanted), atol=1e-13)


def test_tracks_at_known_instants_are_unchanged() -> None:
    """For any tracks, including the highest frequency that their instants can represent."""
    tracks = np.random.default_rng(2).normal(size=(64, 2, 3))
    np.testing.assert_allclose(at_steps(tracks, 48)[::3], tracks[::4], atol=1e-13)


def test_largest_distance_is_that_of_the_worst_marker_and_instant() -> None:
    tracks = harmonics(50)
    tracks[17, 1] += (0.0, 3e-3, -4e-3)
    tracks[30, 0] += (1e-3, 0.0, 0.0)
    assert largest_distance(tracks, harmonics(64)) == pytest.approx(5e-3, rel=1e-9)


@pytest.mark.parametrize("window", [0, 8])
@pytest.mark.parametrize("subject", [VACUUM, AIR], ids=["vacuum", "air"])
def test_beats_are_those_of_the_simulator(subject: Subject, window: int) -> None:
    """Bit for bit, and as many until it counts as periodic."""
    numerics = Numerics(steps=48, window=window)
    model = replace(subject.model, numerics=numerics)
    expected = model.beat(subject.genome[0], blank_recording(model.wing, subject.condition))
    passed: list[Passed] = []
    for one in islice(beats(subject, 48, window=window), 24):
        passed.append(one)
        if one.distance <= numerics.settled:
            break
    assert len(passed) == expected.beats
    assert np.array_equal(passed[-1].trace.tracks, expected.tracks)


def test_fewest_steps_are_enough_and_two_less_are_not() -> None:
    converged = reference(VACUUM, TOLERANCE)
    steps, error = fewest_steps(VACUUM, converged, TOLERANCE)
    assert error <= TOLERANCE
    fewer = periodic(VACUUM, steps - 2).trace.tracks
    assert largest_distance(fewer, converged.tracks) > TOLERANCE
    assert ms_per_beat(VACUUM, steps, converged.start, seconds=0.0) > 0


def test_unconverged_reference_is_refused() -> None:
    with pytest.raises(ArithmeticError, match="raise CONVERGED"):
        reference(AIR, 1e-10)


def test_light_damping_needs_fewer_beats_with_acceleration() -> None:
    light = replace(VACUUM, damping=0.2)
    quick, plain = (beats_to_periodic(light, 64, window, TOLERANCE) for window in (8, 0))
    assert quick is not None
    assert plain is not None
    assert 2 < quick < plain


def test_beats_to_periodic_count_the_ramp_and_fall_with_a_coarser_tolerance() -> None:
    """The beat given is within the tolerance and the one before is not."""
    final = periodic(VACUUM, 64).trace.tracks
    errors = [largest_distance(p.trace.tracks, final) for p in islice(beats(VACUUM, 64, window=0), 12)]
    for tolerance in (1e-2, 1e-4):
        count = beats_to_periodic(VACUUM, 64, 0, tolerance)
        assert count is not None
        assert errors[count - 1] <= tolerance
        assert count == 1 or errors[count - 2] > tolerance


@pytest.mark.parametrize("subject", [VACUUM, AIR], ids=["vacuum", "air"])
def test_energy_ledger_closes_better_with_more_steps(subject: Subject) -> None:
    coarse, fine = (energy_error(subject, steps, count=4) for steps in (64, 256))
    assert fine < 0.3 * coarse
    assert coarse < 1e-2


def test_steps_that_diverge_are_reported() -> None:
    wild = Subject("24", vacuum(10.0, 0.05, 3.0), damping=0.0)
    with pytest.raises(ArithmeticError, match="8 steps"):
        list(islice(beats(wild, 8, window=0), 40))
