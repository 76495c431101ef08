from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.rigs import seen, wave_forces


@pytest.mark.parametrize("phase", [0.1, 0.25, 0.8])
def test_time_counts_from_the_phase(phase: float) -> None:
    before = wave_forces(harmonic=3)
    n = before.beat.shape[1]
    found = seen("phase_reference", before, share=1.0, phase=phase).beat
    np.testing.assert_allclose(found, np.roll(before.beat, -round(phase * n), axis=1), atol=1e-12)


def test_the_mean_stays() -> None:
    before = wave_forces()
    found = seen("phase_reference", before, share=0.4, phase=0.3).beat
    np.testing.assert_allclose(found.mean(axis=1), before.beat.mean(axis=1), atol=1e-14)
