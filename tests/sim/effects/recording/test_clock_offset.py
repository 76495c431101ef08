from __future__ import annotations

import numpy as np

from tests.sim.effects.rigs import recordings, rigid_tracks, seen, wave_forces, wing_model


def test_samples_are_later_by_the_delay() -> None:
    for before in (rigid_tracks(), wave_forces()):
        after = seen("clock_offset", before, delay=0.003)
        np.testing.assert_allclose(after.times, before.times + 0.003, atol=1e-15)
        assert np.array_equal(after.beat, before.beat)


def test_tracks_that_place_their_beat_themselves_do_not_show_it() -> None:
    model, recording = wing_model().with_effects("clock_offset"), recordings("wing")["air"]
    genomes = np.array([[gene.nominal for gene in model.genes]] * 2)
    genomes[1, -1] = 0.002
    off, late = model.observe(genomes, recording).channels
    moved = 2 * np.pi * recording.condition.flap_frequency * 0.002 * 0.1  # m: were it not placed again, at the tip
    assert np.abs(late - off).max() < 1e-3 * moved
