"""How often the 95 % intervals of exported models contain the truth of simulated campaigns, under other conditions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.export.models import calibrated_vehicle, calibrated_wing
from wingfit.calibration.spec import CalibrationSpec
from wingfit.export.predict import predictor
from wingfit.export.runtime.conditions import shown
from wingfit.export.runtime.wing import INSTANTS
from wingfit.records import Dataset, Recording
from wingfit.records.array_types import Array
from wingfit.sim.virtual_rigs import balance, campaign
from wingfit.sim.wing.flexible_wing import FlexibleWing

SCATTER = {"C_l": 0.03, "C_r": 0.04, "C_F": 0.06}  # of single conditions about a law, as in the published tables
PREDICTED = ("test-4", "test-5")  # left out, inside the range of the others
WING = CalibrationSpec(division="4", mode="joint", method="gauss_newton", genes=("E_r", "G_f", "D_E", "L_a", "L_b"))


@dataclass(frozen=True)
class Coverage:
    """Numbers of predictions, and of those whose 95 % interval contains the truth."""

    predictions: int
    contained: int

    @property
    def percent(self) -> float:
        """Contained predictions in percent."""
        return 100.0 * self.contained / max(self.predictions, 1)


def vehicles(campaigns: int, seed: int) -> Iterator[Coverage]:
    """Yield the coverage of each campaign: cycle means and eight instants of the force along x at other conditions.

    The coefficients of each condition are those of a law (the published ones, fitted) and a scatter of their own, so
    that the interval must allow for both.
    """
    law, matrix = _law()
    for k in range(campaigns):
        rng = np.random.default_rng([seed, k])
        trials = [
            replace(one, coefficients=_drawn(law, row, rng)) for one, row in zip(balance.TRIALS, matrix, strict=True)
        ]
        fitted = [one for one in trials if one.name not in PREDICTED]
        data = balance.campaign(seed * 1000 + k, balance.EXAMPLE, fitted)
        model = predictor(calibrated_vehicle(data))
        inside = []
        for one in (trial for trial in trials if trial.name in PREDICTED):
            given: dict[str, Any] = shown(one.condition)
            found, truth = model.forces(**given), balance.true_beat(balance.delfly(), one)
            every = len(found.time_s) // 8
            low, high = found.interval()
            there = truth[:: len(truth) // 8, 0]
            inside += ((low[::every, 0] <= there) & (there <= high[::every, 0])).tolist()
            means = found.means()
            inside.append(bool(means["mean_force_x_low_n"] <= truth[:, 0].mean() <= means["mean_force_x_high_n"]))
        yield Coverage(len(inside), int(np.sum(inside)))


def wings(campaigns: int, seed: int) -> Iterator[Coverage]:
    """Yield the coverage of each campaign: heights of all markers at eight instants, under the held-out conditions.

    The true wing has as many bodies as the calibrated one; genes that are not fitted are known.
    """
    for k in range(campaigns):
        data, truth = campaign.campaign(division=WING.division, small=True, seed=seed * 1000 + k)
        fixed = {name: value for name, value in truth.as_dict().items() if name not in WING.genes}
        model = predictor(calibrated_wing(data, replace(WING, fixed=fixed)))
        inside = list[bool]()
        for recording in _inside(data):
            given: dict[str, Any] = shown(recording.condition)
            found = model.forces(**given)
            own = FlexibleWing(data.wing, WING.division, numerics=campaign.REFERENCE)
            there = _resampled(own.beat(truth.values, recording).tracks)
            low, high = found.interval()
            every = INSTANTS // 8
            within = (low <= there) & (there <= high)
            inside += within[::every, :, 2].ravel().tolist()
        yield Coverage(len(inside), int(np.sum(inside)))


def _inside(data: Dataset) -> list[Recording]:
    return [one for one in data.recordings if one.name in data.held_out]


def _resampled(tracks: Array) -> Array:
    spectrum = np.fft.rfft(tracks, axis=0)[: INSTANTS // 2 + 1]
    whole = np.zeros((INSTANTS // 2 + 1, *tracks.shape[1:]), complex)
    whole[: len(spectrum)] = spectrum
    return np.asarray(np.fft.irfft(whole, INSTANTS, axis=0) * (INSTANTS / len(tracks)))


def _law() -> tuple[dict[str, Array], Array]:
    """Return the numbers [3] of a law of each coefficient, fitted to the published ones, and its inputs [8, 3]."""
    matrix = np.array([[1.0, t.condition.flap_frequency, t.condition.angle_of_attack] for t in balance.TRIALS])
    law = {}
    for name in SCATTER:
        values = np.array([trial.coefficients[name] for trial in balance.TRIALS])
        used = matrix if name in ("C_l", "C_F") else matrix[:, :1]
        found = np.linalg.lstsq(used, values, rcond=None)[0]
        law[name] = np.concatenate([found, np.zeros(3 - len(found))])
    return law, matrix


def _drawn(law: dict[str, Array], row: Array, rng: np.random.Generator) -> dict[str, float]:
    return {name: float(row @ numbers + SCATTER[name] * rng.standard_normal()) for name, numbers in law.items()}
