"""A right model is found adequate although a fit of its genes may end in a local minimum: a swing in closed form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

import wingfit
from wingfit import Gene, Rig, Run, Suspect
from wingfit.diagnosis.evidence import nominal
from wingfit.records import Channel, Series, SeriesDataset
from wingfit.records.array_types import Array

TIMES = np.linspace(0.0, 10.0, 501)
POSITION = Channel("x", "m", 1e-3)
HARD = Suspect("hard", genes=(Gene("hard.size", "1/m^2", 0.0, -0.5, 0.5),))
SQUARE = Suspect("square", genes=(Gene("square.size", "1/m", 0.0, -0.5, 0.5),))


def simulate(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    """A damped oscillation from x0 and v0, seen by a sensor that may not be linear."""
    t, w, d = run.times, genes["w"], genes["d"]
    rate = np.sqrt(w * w - d * d)
    sine = (genes["v0"] + d * genes["x0"]) / rate * np.sin(rate * t)
    x = np.exp(-d * t) * (genes["x0"] * np.cos(rate * t) + sine)
    return {"x": x + genes["hard.size"] * x**3 + genes["square.size"] * x**2}


RIG = Rig(
    "swing",
    (Gene("w", "1/s", 5.0, 1.0, 25.0, "log"), Gene("d", "1/s", 0.1, 0.01, 1.0, "log")),
    {"x": "m"},
    simulate,
    recording_genes=(Gene("x0", "m", 0.5, -2.0, 2.0), Gene("v0", "m/s", 0.0, -10.0, 10.0)),
    suspects=(HARD, SQUARE),
    faults=False,
)


def swings(hard: float = 0.0, w: float = 6.0) -> SeriesDataset:
    """Recordings of 9.5 beats, where the nominal model has 8: the last is held out."""
    found = []
    for name, x0, v0, seed in (("a", 1.0, 0.0, 0), ("b", -0.5, 3.0, 1), ("c", 0.2, -4.0, 2)):
        genes = {"w": w, "d": 0.15, "x0": x0, "v0": v0, "hard.size": hard, "square.size": 0.0}
        clean = simulate(genes, Run(name, TIMES, {}, {}, TIMES))["x"]
        noisy = clean + 1e-3 * np.random.default_rng(seed).standard_normal(len(TIMES))
        found.append(Series(name, TIMES, (POSITION,), noisy[:, None]))
    return SeriesDataset("swings", "swing", tuple(found), (POSITION,), held_out=("c",))


@pytest.mark.parametrize("w", [3.9, 6.0, 6.5])
def test_a_right_model_is_adequate(w: float) -> None:
    found = wingfit.diagnose(swings(w=w), rig=RIG)
    assert found.verdict == "adequate"
    assert {gene.name: gene.value.value for gene in found.genes}["w"] == pytest.approx(w, rel=1e-3)


def test_what_is_missing_is_named_with_its_size() -> None:
    found = wingfit.diagnose(swings(hard=0.1), rig=RIG)
    assert found.named == ("hard",)
    assert {gene.name: gene.value.value for gene in found.genes}["hard.size"] == pytest.approx(0.1, rel=0.05)


def test_without_the_iterations_of_a_calibration_the_fit_stays_in_a_local_minimum(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(nominal, "_calibrated", lambda *_: None)
    one = replace(swings(), recordings=swings().recordings[:2], held_out=("b",))
    assert wingfit.diagnose(one, rig=RIG).verdict == "unnamed"
