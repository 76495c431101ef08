"""Processes of a driver that a simulation ends: only that simulation has failed, whatever ran beside it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

import wingfit
from tests.service.conftest import Json
from tests.service.rigs import deadly_rig, decay_rig
from tests.service.rigs.test_drive import client_of, service, upload
from wingfit._drive import BROKEN, _Computing, _Simulator
from wingfit.client.drive_answers import Simulation
from wingfit.records.array_types import Array
from wingfit.rigs.declaration import declaration
from wingfit.rigs.run import Run


def misspelt(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    return {"charge": run.times * genes["rat"]}


def simulation(name: str, rate: float) -> Simulation:
    genes = {"rate": rate, "charge0": 1.0}
    return {"id": name, "recording": "from-1", "effects": [], "genes": genes, "settings": {}, "input_factors": {}}


def test_a_rig_that_other_processes_cannot_load_is_refused_before_any_work() -> None:
    unloadable = replace(decay_rig.rig, simulate=lambda genes, run: decay_rig.simulate(genes, run))
    with pytest.raises(wingfit.WingfitError, match="workers=1"):
        _Computing(_Simulator(unloadable, decay_rig.dataset()), 2)


def test_only_the_simulation_that_ends_its_process_fails() -> None:
    simulations = [simulation(f"good {k}", 0.5 + 0.1 * k) for k in range(6)]
    simulations.insert(1, simulation("deadly", 3.0))
    results, deadline = dict[str, Json](), time.monotonic() + 180.0
    with _Computing(_Simulator(deadly_rig.rig, decay_rig.dataset()), 3) as computing:
        computing.add(simulations)
        while computing.holding:
            assert time.monotonic() < deadline
            results |= {one["id"]: one for one in computing.finished()}
    assert results.pop("deadly")["reason"] == f"the simulation ended its process, {BROKEN} times"
    assert len(results) == 6
    assert all("channels" in one for one in results.values())


def test_an_error_of_the_function_ends_the_job_and_says_why(tmp_path: Path) -> None:
    rig = replace(decay_rig.rig, simulate=misspelt)
    with service(tmp_path) as api:
        one = api.diagnose(upload(api), rig=declaration(rig))["id"]
        with client_of(api) as client:
            last = wingfit.drive(client, one, rig)
        assert last["state"] == "FAILED"
        assert "the simulation has an error where it is driven: KeyError: 'rat'" in (last["error"] or "")


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"ports": [{"name": "p", "coordinate_unit": "m", "force_unit": "N", "coordinate": 1e-120, "rate": 1.0,
                     "force": 1.0}]}, "its typical coordinate is 1e-120"),
        ({"suspects": [{"name": "s", "genes": [{"name": "s.size", "unit": "1", "nominal": 0.0, "lower": -1.0,
                                               "upper": 1.0}], "candidate_shapes": [[1.0]]}]}, "each needs 0"),
        ({"genes": [{"name": "x[from-1]", "unit": "1", "nominal": 1.0, "lower": 0.5, "upper": 2.0}]}, "has a bracket"),
        ({"genes": [{"name": "x", "unit": "1", "nominal": 1.0, "lower": 2.0, "upper": 0.5}]}, "below upper bound"),
    ],
)  # fmt: skip
def test_declarations_that_contradict_themselves_are_refused(tmp_path: Path, change: Json, word: str) -> None:
    with service(tmp_path) as api:
        body = {"dataset_id": upload(api), "rig": declaration(decay_rig.rig) | change}
        refused = api.client.post("/v1/diagnoses", json=body)
        assert refused.status_code == 422
        assert word in refused.json()["errors"][0]["message"]
