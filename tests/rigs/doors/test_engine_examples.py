"""The examples with the pendulum in other engines: the same simulation, and the same finding, as with its equations."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import wingfit
from wingfit.diagnosis import DiagnosisSpec
from wingfit.diagnosis.rig_check import check_rig
from wingfit.records import SeriesDataset, load_dataset
from wingfit.rigs.load import load_rig
from wingfit.rigs.rig import Rig
from wingfit.rigs.rig_model import RigModel

EXAMPLES = Path(__file__).parents[3] / "examples"
LAW = "dry_friction.pivot"


@pytest.fixture(params=["mujoco", "exudyn"])
def rig(request: pytest.FixtureRequest) -> Rig:
    engine = request.param
    if importlib.util.find_spec(engine) is None:
        pytest.skip(f"{engine} is not installed: pip install {engine}")
    return load_rig(str(EXAMPLES / f"{engine}_pendulum" / "rig.py"))


@pytest.fixture
def dataset() -> SeriesDataset:
    """Recordings of the largest and smallest swing, which distinguish friction from drag, and one held out."""
    found = load_dataset(EXAMPLES / "pendulum")
    assert isinstance(found, SeriesDataset)
    return replace(found, recordings=found.select(["swing-3", "swing-4", "swing-5"]), held_out=("swing-5",))


@pytest.mark.parametrize("effects", [(), (LAW,)])
def test_an_engine_gives_what_the_equation_gives(rig: Rig, dataset: SeriesDataset, effects: tuple[str, ...]) -> None:
    seen = []
    for one in (load_rig(str(EXAMPLES / "pendulum" / "rig.py")), rig):
        model = RigModel(one, dataset.recordings, effects)
        genome = [0.3 if gene.name == f"{LAW}.size" else gene.nominal for gene in model.genes]
        seen.append(model.observe(genome, dataset.recordings[0]).channels)
    assert np.abs(seen[1] - seen[0]).max() < 1e-6


def test_an_engine_keeps_the_contract_of_a_rig(rig: Rig, dataset: SeriesDataset) -> None:
    outcomes = {one.name: (one.outcome, one.words) for one in check_rig(rig, dataset)}
    assert {outcome for outcome, _ in outcomes.values()} == {"pass"}, outcomes


def test_a_diagnosis_with_an_engine_names_the_dry_friction(rig: Rig, dataset: SeriesDataset) -> None:
    finding = wingfit.diagnose(dataset, DiagnosisSpec(suspects=(LAW, "square_drag.pivot")), rig=rig)
    assert (finding.verdict, finding.named) == ("named", (LAW,))
    (size,) = (gene.value for gene in finding.genes if gene.name == f"{LAW}.size")
    assert size.low is not None
    assert size.high is not None
    assert size.low < 0.3 < size.high  # 1/s^2, as with the equations and all six recordings
