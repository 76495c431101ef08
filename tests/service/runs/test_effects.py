"""Effects over HTTP: the list, what a run or a simulation may include, and what is kept of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.service.conftest import Api
from tests.service.shapes import valid
from wingfit.calibration.search import CalibrationSpec
from wingfit.client.effect_answers import Effects
from wingfit.records import Dataset, Genome
from wingfit.service.http.problems import ProblemError
from wingfit.service.outcomes.requests import SimulationIn
from wingfit.service.runs.engine import Engine
from wingfit.service.runs.requests import RunIn
from wingfit.service.runs.spec_views import calibration_spec, refuse_effects, run_name, run_settings, simulation_spec
from wingfit.service.storage import store
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.balance import delfly
from wingfit.sim.virtual_rigs.campaign import Tracking, record, robird_wing, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing

Json = dict[str, Any]


def test_the_list_is_the_registry(shared: tuple[Api, str]) -> None:
    api, _ = shared
    found = valid(Effects, api.get("/v1/effects")).effects
    assert [one.name for one in found] == list(EFFECTS)
    for one in found:
        effect = EFFECTS[one.name]
        assert {
            rig for rig, data in (("wing", robird_wing()), ("vehicle", delfly())) if effect.applies_to(data)
        } == set(one.applies_to)
        assert [p.name for p in one.parameters] == [f"{one.name}.{p.name}" for p in effect.parameters]
        assert [p.is_size for p in one.parameters] == [p in effect.size for p in effect.parameters]
        assert one.source
        assert one.signature


def test_bounds_that_scale_with_the_rig_are_parts_of_it(shared: tuple[Api, str]) -> None:
    api, _ = shared
    shift = api.get("/v1/effects/camera_shift")
    assert shift in api.get("/v1/effects")["effects"]
    assert shift["applies_to"] == ["wing"]
    first = shift["parameters"][0]
    gene = EFFECTS["camera_shift"].genes(robird_wing())[0]
    assert (first["name"], first["unit"], first["relative_to"], first["is_size"]) == (gene.name, "m", "chord", True)
    assert first["upper"] / first["lower"] == gene.upper / gene.lower
    assert first["upper"] != gene.upper


def test_an_unknown_effect_is_not_found_and_the_known_ones_named(shared: tuple[Api, str]) -> None:
    api, _ = shared
    answer = api.client.get("/v1/effects/added_moss")
    assert answer.status_code == 404
    assert answer.json()["detail"].startswith("there is no effect 'added_moss'; there are ")
    assert "camera_shift" in answer.json()["detail"]


@pytest.mark.parametrize("route", ["runs", "simulations", "loads"])
@pytest.mark.parametrize(
    ("effects", "where", "said"),
    [
        (["camera_shift", "added_moss"], "body.effects.1", "unknown effect 'added_moss'; there are"),
        (["camera_shift", "camera_shift"], "body.effects.1", "is named 2 times; name it once"),
        (["balance_offset"], "body.effects.0", "does not apply to a wing; there are"),
        ("camera_shift", "body.effects", "valid list"),
        ([""], "body.effects.0", "at least 1 character"),
    ],
)
def test_effects_that_cannot_be_are_refused(
    shared: tuple[Api, str], route: str, effects: Any, where: str, said: str
) -> None:
    api, dataset = shared
    body = {"dataset_id": dataset, "effects": effects} | ({} if route == "runs" else {"recording": "slow"})
    answer = api.client.post(f"/v1/{route}", json=body)
    assert answer.status_code == 422, answer.text
    (error,) = answer.json()["errors"]
    assert error["where"] == where
    assert said in error["message"]


def test_a_gene_of_an_effect_that_is_not_included_says_so(shared: tuple[Api, str]) -> None:
    api, dataset = shared
    answer = api.client.post("/v1/runs", json={"dataset_id": dataset, "genes": ["camera_shift.x"]})
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["where"] == "body.genes.0"
    assert "effect 'camera_shift', which the request does not include; name it in 'effects'" in error["message"]


def test_a_simulation_says_the_same_of_such_a_gene_and_lists_the_known_ones_once(shared: tuple[Api, str]) -> None:
    api, dataset = shared
    genome = {"stifness": 1.0, "camera_shift.x": 1e-3, "dampng": 1.0}
    body = {"dataset_id": dataset, "recording": "slow", "genome": genome}
    answer = api.client.post("/v1/simulations", json=body)
    assert answer.status_code == 422
    first, shift, last = answer.json()["errors"]
    assert "name it in 'effects' (--with camera_shift)" in shift["message"]
    assert "known are stiffness, damping" in first["message"]
    assert last["message"] == "unknown gene; see those named above"
    effects = {"dataset_id": body["dataset_id"], "effects": ["one", "two"]}
    one, two = api.client.post("/v1/runs", json=effects).json()["errors"]
    assert "there are stiffness_drift, damage" in one["message"]
    assert two["message"] == "unknown effect 'two'; see those named above"


def test_a_run_keeps_its_effects_and_is_named_after_them(api: Api) -> None:
    dataset = api.upload()["id"]
    run = api.submit(dataset, effects=["camera_shift"])
    assert run["name"] == "toy, division 11 with camera_shift, staged"
    assert api.finish(run["id"])["spec"]["effects"] == ["camera_shift"]
    plain = api.submit(dataset)
    assert (plain["spec"]["effects"], plain["name"]) == ([], "toy, division 11, staged")


def test_effects_tell_requests_apart_that_repeat_a_key(api: Api) -> None:
    dataset, key = api.upload()["id"], {"Idempotency-Key": "one"}
    bodies: list[Json] = [{"effects": []}, {"effects": []}, {"effects": ["camera_shift"]}]
    answers = [api.client.post("/v1/runs", json={"dataset_id": dataset} | body, headers=key) for body in bodies]
    assert [answer.status_code for answer in answers] == [202, 202, 422]
    assert answers[0].json()["id"] == answers[1].json()["id"]


def test_specifications_go_around_and_those_of_before_name_no_effect() -> None:
    spec = calibration_spec(RunIn(dataset_id="x", effects=["camera_shift"], mode="joint", method="genetic"))
    assert spec.effects == ("camera_shift",)
    stored = store.spec_json(spec)
    assert store.spec_from(stored) == spec
    assert run_settings(spec)["effects"] == ["camera_shift"]
    del stored["effects"]
    assert store.spec_from(stored).effects == ()


def test_a_vehicle_takes_effects_on_forces_and_no_others() -> None:
    dataset = Dataset("delfly", delfly(), ())
    refuse_effects(["balance_offset"], dataset)
    with pytest.raises(Exception, match="the model cannot contain these effects"):
        refuse_effects(["camera_shift"], dataset)
    with pytest.raises(ProblemError) as refused:
        refuse_effects(["tip_loss", "clap_and_peel"], dataset, RunIn(dataset_id="x"))
    (error,) = refused.value.errors
    assert error["where"] == "body.effects.1"
    assert 'leave the effect out, or the term: without: ["clap_and_peel"] (--without clap_and_peel)' in error["message"]
    refuse_effects(["clap_and_peel"], dataset, RunIn(dataset_id="x", without=["clap_and_peel"]))
    spec = CalibrationSpec(effects=("balance_offset",), without=("inertial",), mode="local")
    assert run_name(dataset, spec) == "delfly, proposed without inertial with balance_offset, local"
    names = Engine().gene_names(spec, dataset)
    assert [name for name in names if "." in name] == [gene.name for gene in EFFECTS["balance_offset"].genes(delfly())]


def test_a_simulation_with_an_effect_contains_it() -> None:
    """The real engine: tracks move by the shift that the genome names, up to the phase that is fitted."""
    wing = robird_wing()
    model = FlexibleWing(wing, "4", numerics=Numerics(accuracy=1e-3))
    recording = record(
        model, Genome.nominal(model.genes), vacuum(10.0, 0.0, 3.0), Tracking(beats=1), np.random.default_rng(1)
    )
    dataset, engine = Dataset("robird", wing, (recording,)), Engine()
    plain, shifted = (
        simulation_spec(SimulationIn(dataset_id="d", recording="r", division="4", accuracy_mm=1.0, effects=effects))
        for effects in ([], ["camera_shift"])
    )
    genome = engine.genome(shifted, dataset, {"camera_shift.y": 2e-3})
    before = engine.compare(plain, dataset, engine.genome(plain, dataset, {}), recording.name)
    after = engine.compare(shifted, dataset, genome, recording.name)
    moved = (after.simulated - before.simulated)[:, :, 1]
    assert moved == pytest.approx(2e-3, abs=2e-4)
    with pytest.raises(ValueError, match=r"unknown gene 'camera_shift\.y'"):
        engine.genome(plain, dataset, {"camera_shift.y": 2e-3})
