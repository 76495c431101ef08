"""The blind trials on small rigs of other fields: true sizes in the model, coverage, and timed commands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.any_rig.plants import PLANTS
from benchmarks.any_rig.rigs import RIGS
from benchmarks.any_rig.suite import Mark, counted, covered
from benchmarks.any_rig.timings import overhead_ms_per_call, readme_commands
from benchmarks.any_rig.trials import Answer, Trial, sizes_in_model
from wingfit.records import Channel, Quantity, Series, SeriesDataset
from wingfit.rigs.rig_model import RigModel

LISTED = [(rig, name) for rig, plant in PLANTS.items() for name in plant.listed]
SAMPLES = 120


def trial(rig: str, hidden: str) -> Trial:
    return Trial("t", 1, rig, "listed", hidden, 2.0, "stated")


def recorded(rig: str, hidden: str, size: float) -> tuple[SeriesDataset, dict[str, float]]:
    """A recording of the plant of ``rig`` without noise, and all its parameters, those of the recording included."""
    plant, description = PLANTS[rig], RIGS[rig]
    times = np.arange(SAMPLES, dtype=np.float64) * plant.interval
    push = plant.push * (0.3 + 0.7 * np.sin(2.0 * np.pi * times / (3.0 * plant.corner)))
    start = np.array(plant.start)
    values = plant.run(plant.nominal, {hidden: size}, lambda t: float(np.interp(t, times, push)), start, times)
    channels = tuple(Channel(name, unit) for name, unit in description.channels.items())
    one = Series("run-0", times, channels, values, {next(iter(description.inputs)): push})
    genes = {f"{g.name}[run-0]": v for g, v in zip(description.recording_genes, plant.start, strict=True)}
    inputs = tuple(Quantity(name, unit) for name, unit in description.inputs.items())
    return SeriesDataset("d", rig, (one,), channels, inputs), {**plant.nominal, **genes}


@pytest.mark.parametrize(("rig", "hidden"), [one for one in LISTED if not one[1].startswith("saturation")])
def test_the_model_with_the_true_size_is_the_plant(rig: str, hidden: str) -> None:
    size = PLANTS[rig].listed[hidden]
    dataset, known = recorded(rig, hidden, size)
    known |= sizes_in_model(trial(rig, hidden), size, dataset)
    one, left = dataset.recordings[0], []
    for names in ((), (hidden,)):
        model = RigModel(RIGS[rig], dataset.recordings, names)
        found = model.observe([known[gene.name] for gene in model.genes], one).channels[0]
        left.append(float(np.sqrt(np.mean(((found - one.values) / np.ptp(one.values, axis=0)) ** 2))))
    # Dry friction of the plants is a steep line, that of the model a hyperbolic tangent: at two masses 25 % remain.
    assert left[1] < (0.3 if hidden.startswith("dry_friction") else 0.1) * left[0], left


def test_what_the_model_does_not_have_has_no_true_size() -> None:
    dataset, _ = recorded("circuit", "saturation.voltage", 0.3)
    assert sizes_in_model(trial("circuit", "saturation.voltage"), 0.3, dataset) == {}


def mark(verdict: str, *names: str, low: float = 0.5, high: float = 1.5) -> Mark:
    return Mark(verdict, names, names, 0.9, None, None, 1.0, (), {"radiation.emissivity": (low, high)})


def test_intervals_count_where_the_right_effect_is_named() -> None:
    answer = Answer(trial("block", "radiation"), {}, 1.0, 0.01, 3.0, {"radiation.emissivity": 1.0})
    assert covered(mark("named", "radiation"), answer) == [True]
    assert covered(mark("named", "radiation", low=1.1), answer) == [False]
    assert covered(mark("ambiguous", "radiation"), answer) == []
    assert covered(mark("named", "free_convection"), answer) == []
    assert covered(Mark("named", ("radiation",), (), 0.9, None, None, 1.0), answer) == []  # open at an end
    rates = counted([(mark("named", "radiation"), answer), (mark("named", "radiation", high=0.9), answer)])
    assert (rates["intervals"], rates["coverage_percent"]) == (2, 50.0)


def test_the_commands_that_are_timed_are_those_of_the_readme() -> None:
    check, diagnosis = readme_commands((Path(__file__).parents[3] / "README.md").read_text(encoding="utf-8"))
    assert check[:2] == ["rig", "check"]
    assert diagnosis[0] == "diagnose"
    assert "--report" in diagnosis


def test_the_time_that_the_tool_adds_is_measured() -> None:
    assert 0.0 < overhead_ms_per_call() < 100.0
