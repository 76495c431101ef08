"""The instant of a short force, although genes have absorbed part of it; noise has none."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import pytest

from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.location.pulse_phase import locate_pulse
from wingfit.records import Condition, LowPass, Recording
from wingfit.sim.filtering import default_cutoff, low_passed

Array = npt.NDArray[np.float64]

NOISE, ORIGIN = 0.01, 0.7  # N; rad of the drive at which a beat begins
SUBJECT = cast("Any", SimpleNamespace(beat_start_phase=lambda _: ORIGIN))


def force_data(when: float | None, rng: np.random.Generator, *, filtered: bool = False) -> WhitenedData:
    """Four recordings of a pulse and an opposite half pulse shortly after; sizes and directions differ."""
    recordings = []
    for k, frequency in enumerate((10.3, 11.7, 12.5, 13.3)):
        times = np.arange(900) / 800.0
        phase = frequency * times - ORIGIN / (2 * np.pi)
        values = NOISE * rng.standard_normal((len(times), 2))
        if when is not None:
            for at, size, width in ((when, 1.0, 0.02), (when + 0.1, -0.4, 0.04)):
                apart = (phase - at + 0.5) % 1.0 - 0.5
                values += 0.2 * (1 + k) * size * np.exp(-0.5 * (apart / width) ** 2)[:, None] * [0.8, -0.3]
        condition = Condition(frequency, 0.0, 101_325.0, 293.15, 1.0, 0.5)
        one = Recording(f"r{k}", "wind_tunnel", condition, times, (), values, forces=("x", "z"))
        recordings.append(low_passed(one, LowPass(default_cutoff(frequency))) if filtered else one)
    return WhitenedData.of(recordings, ("x", "z"))


def pulse_of(of: WhitenedData) -> Any:
    """The pulse in the residual where first and second harmonics are free, like genes."""
    order = np.concatenate([np.tile(beat_fit.order, 2) for beat_fit in of.beat_fits])
    white = -np.concatenate([beat_fit.coefficients.ravel() for beat_fit in of.beat_fits]) / of.scale
    genes = np.eye(len(white))[:, (order == 1) | (order == 2)]
    left = white - genes @ (genes.T @ white)
    unit = np.full(genes.shape[1], 0.5)
    fit = SimpleNamespace(coefficients=left * of.scale, jacobian=1e3 * genes * of.scale[:, None], unit=unit)
    return locate_pulse(FitContext(SUBJECT, of, cast("Any", None)), cast("Any", fit))


@pytest.mark.parametrize("when", [0.05, 0.3, 0.98])
def test_a_pulse_is_located_although_genes_absorbed_its_slow_part(when: float) -> None:
    found = pulse_of(force_data(when, np.random.default_rng(1)))
    apart = (found.value - when + 0.5) % 1.0 - 0.5
    assert abs(apart) < 10.0 / 360.0
    assert found.low < found.value < found.high
    assert found.high - found.low < 0.2


@pytest.mark.parametrize("when", [0.05, 0.3, 0.98])
def test_a_low_passed_pulse_is_located(when: float) -> None:
    found = pulse_of(force_data(when, np.random.default_rng(1), filtered=True))
    apart = (found.value - when + 0.5) % 1.0 - 0.5
    assert abs(apart) < 15.0 / 360.0
    assert found.low < found.value - apart < found.high


@pytest.mark.parametrize("filtered", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_noise_has_no_instant(seed: int, filtered: bool) -> None:
    assert pulse_of(force_data(None, np.random.default_rng(seed), filtered=filtered)) is None
