"""A periodic motion that sags from period to period is not taken for noise, where the noise is stated or visible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from wingfit import DiagnosisSpec, Gene, Quantity, Rig, Run, Series, SeriesDataset, diagnose
from wingfit.diagnosis.policy import POLICY
from wingfit.records import Channel
from wingfit.records.array_types import Array

SAG = 0.02  # of the lift, from period to period
NOISE = {"lift": 0.004, "torque": 0.001}


def simulate(genes: Mapping[str, float], run: Run) -> Mapping[str, Array]:
    """Lift and torque of a flapper whose wings move as the encoder says."""
    phase = 2 * np.pi * run.settings["frequency"] * run.times
    lift = genes["c_lift"] * np.sin(phase + genes["lead"]) ** 2
    return {"lift": lift, "torque": genes["c_torque"] * np.cos(phase)}


RIG = Rig(
    name="flapper",
    genes=[
        Gene("c_lift", "N", 0.3, 0.1, 1.0, "log"),
        Gene("lead", "rad", 0.1, -1.0, 1.0),
        Gene("c_torque", "N m", 0.03, 0.01, 0.2, "log"),
    ],
    channels={"lift": "N", "torque": "N m"},
    simulate=simulate,
)


def flapped(sag: float, *, stated: bool) -> SeriesDataset:
    """Ten beats at three frequencies."""
    rng, found = np.random.default_rng(4), []
    channels = tuple(
        Channel(name, unit, NOISE[name] if stated else None) for name, unit in (("lift", "N"), ("torque", "N m"))
    )
    for name, f in (("slow", 4.0), ("middle", 5.0), ("fast", 6.25)):
        times = np.arange(600) / (60 * f)
        phase = 2 * np.pi * f * times
        lift = 0.4 * np.sin(phase + 0.4) ** 2 * (1.0 - sag * f * times)
        values = np.stack([lift, 0.05 * np.cos(phase)], axis=1) + rng.standard_normal((600, 2)) * [*NOISE.values()]
        settings = {"frequency": f}
        found.append(Series(name, times, channels, values, settings=settings, period=1.0 / f))
    dataset = SeriesDataset("flapper", "flapper", tuple(found), channels, settings=(Quantity("frequency", "Hz"),))
    return replace(dataset, held_out=("middle",))


def test_a_sag_in_one_of_two_channels_is_not_taken_for_noise_with_certainty() -> None:
    """Its periods differ by four times the noise that is stated, and that its highest frequencies show."""
    suspects = DiagnosisSpec(suspects=("gain.lift", "delay.lift", "drift.lift"))
    sagging, steady = (diagnose(flapped(sag, stated=True), suspects, rig=RIG) for sag in (SAG, 0.0))
    assert sagging.probabilities["adequate"] <= POLICY.doubted_noise
    assert "The noise is not known well enough" in sagging.summary
    assert steady.verdict == "adequate"
    assert steady.probabilities["adequate"] > 0.8
    assert "not known well enough" not in steady.summary
