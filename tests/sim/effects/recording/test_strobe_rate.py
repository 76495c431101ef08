from __future__ import annotations

import numpy as np

from tests.sim.effects.rigs import recordings, rigid_tracks, seen, wave_forces, wing_model


def test_phase_runs_away_from_the_start_of_forces() -> None:
    before = wave_forces()
    after = seen("strobe_rate", before, part=1e-3)
    np.testing.assert_allclose(after.times, before.times * 1.001, atol=1e-15)


def test_phase_of_tracks_is_right_in_the_middle() -> None:
    before = rigid_tracks()
    drift = seen("strobe_rate", before, part=-2e-3).times[0] - before.times[0]
    assert abs(drift.mean()) < 1e-15
    np.testing.assert_allclose(np.diff(drift), -2e-3 * np.diff(before.times[0]), atol=1e-15)


def test_the_last_frame_is_ahead_where_the_beat_is_faster() -> None:
    """Each marker is off by its speed times the drift: forwards at the end, backwards at the beginning."""
    model, recording = wing_model().with_effects("strobe_rate"), recordings("wing")["vacuum"]
    part = 2e-4
    genomes = np.array([[gene.nominal for gene in model.genes]] * 2)
    genomes[1, -1] = part
    off, fast = model.observe(genomes, recording).channels
    drift = part * (recording.times - recording.times.mean())
    # 31 frames show the beat once, backwards: half the difference of neighbours in phase is the speed.
    step = (recording.times[1] - recording.times[0]) - 1.0 / recording.condition.flap_frequency
    speed = np.gradient(off, step, axis=0)
    inner = slice(2, -2)
    np.testing.assert_allclose(
        (fast - off)[inner], (speed * drift[:, None])[inner], atol=0.12 * np.abs(fast - off).max()
    )
