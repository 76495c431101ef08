"""What a simulator without ports misses is described by a law of motion and inputs, or by none."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest

import wingfit
from wingfit.diagnosis.finding import FreeLaw
from wingfit.records import Channel, Gene, Quantity, Series, SeriesDataset
from wingfit.records.array_types import Array
from wingfit.rigs.rig import Rig
from wingfit.rigs.run import Run

NOISE = 0.002  # m
CUBE = 0.4  # 1/m^2: at most 6 % of the displacement, so that the fitted compliance stays near
TIMES = np.linspace(0.0, 6.0, 240)
CHANNEL = Channel("x", "m", NOISE)
DRIVES = ((4.0, 0.7), (8.0, 0.4), (6.0, 1.6), (10.0, 0.5))  # m/s^2, Hz


def simulate(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    """A sensor on an oscillator that settles at once: the displacement follows the input."""
    return {"x": genes["compliance"] * run.input("drive", run.times)}


RIG = Rig(
    name="follower",
    genes=[Gene("compliance", "s^2", 0.03, 0.01, 0.09, "log")],
    channels={"x": "m"},
    inputs={"drive": "m/s^2"},
    simulate=simulate,
    faults=False,
    suspects=[wingfit.Suspect("decoy", genes=(Gene("decoy.size", "1", 0.0, -1.0, 1.0),))],
)


def law_of(missing: Callable[[Array, int], Array], count: int = len(DRIVES)) -> FreeLaw | None:
    """The law found where ``missing(x, number)`` is added to the recorded displacement."""
    recordings = []
    for k, (size, frequency) in enumerate(DRIVES[:count]):
        drive = size * np.sin(2 * np.pi * frequency * TIMES) + 0.3 * size * np.cos(5.0 * frequency * TIMES)
        x = 0.03 * drive
        noise = NOISE * np.random.default_rng(k).standard_normal(len(TIMES))
        recordings.append(
            Series(f"r{k}", TIMES, (CHANNEL,), (x + missing(x, k) + noise)[:, None], inputs={"drive": drive})
        )
    dataset = SeriesDataset("d", "follower", tuple(recordings), (CHANNEL,), (Quantity("drive", "m/s^2"),))
    finding = wingfit.diagnose(dataset, rig=RIG)
    assert finding.verdict == "unnamed"
    assert "Free-form law" in wingfit.html(finding) or finding.law is None
    return finding.law


def test_the_law_of_a_sensor_that_is_not_linear_is_recovered() -> None:
    law = law_of(lambda x, _: CUBE * x**3)
    assert law is not None
    (term,) = law.terms
    # the input is in proportion to x, so either may stand in the law
    assert (term.feature, term.unit) in {("(x)^3 in x", "m/m^3"), ("(drive)^3 in x", "m/((m/s^2)^3)")}
    scale = 1.0 if term.unit == "m/m^3" else 0.03**-3
    assert term.coefficient.value * scale == pytest.approx(CUBE, rel=0.2)
    assert law.explained > 0.9


def test_what_differs_from_recording_to_recording_has_no_law() -> None:
    def unrelated(_x: Array, number: int) -> Array:
        frequency, phase = np.random.default_rng(100 + number).uniform([2.0, 0.0], [3.0, 6.0])
        return np.asarray(0.03 * np.sin(2 * np.pi * frequency * TIMES + phase))

    law = law_of(unrelated)
    assert law is not None
    assert law.terms == ()
    assert law.words.startswith("no simple law of motion and inputs predicts another recording")


def test_two_recordings_are_too_few() -> None:
    assert law_of(lambda x, _: 5.0 * x**3, 2) is None


def test_repeats_of_one_experiment_do_not_validate_a_law() -> None:
    """The same misfit in every repeat is predicted by the other repeats, whatever its law is."""
    drive = 5.0 * np.sin(4.0 * TIMES)
    error = 0.02 * np.sin(2 * np.pi * 2.3 * TIMES + 1.0)
    recordings = tuple(
        Series(
            f"r{k}",
            TIMES,
            (CHANNEL,),
            (0.03 * drive + error + NOISE * np.random.default_rng(k).standard_normal(len(TIMES)))[:, None],
            inputs={"drive": drive},
            repeats="one",
        )
        for k in range(5)
    )
    dataset = SeriesDataset("d", "follower", recordings, (CHANNEL,), (Quantity("drive", "m/s^2"),))
    finding = wingfit.diagnose(dataset, rig=RIG)
    assert finding.verdict == "unnamed"
    assert finding.law is None
