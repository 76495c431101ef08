"""The accuracy that a user states: over HTTP, in the database, in the client, on the command line, in the engine."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import httpx
import numpy as np
import pytest

from tests.service import toy
from tests.service.conftest import Api, Gate, serving
from tests.service.shapes import fields, valid
from wingfit.calibration.search import CalibrationSpec
from wingfit.cli.simulate import solved
from wingfit.client.answers import Comparison
from wingfit.client.answers import Numerics as NumericsAnswer
from wingfit.client.client import Client
from wingfit.records import Dataset, FourBarDrive
from wingfit.service.app import create_app
from wingfit.service.runs import views
from wingfit.service.runs.engine import Engine
from wingfit.service.runs.requests import COARSEST_MM, FINEST_MM
from wingfit.service.runs.simulation_hints import FLUTTER, with_remedy
from wingfit.service.runs.spec_views import run_settings
from wingfit.service.settings import Settings
from wingfit.service.storage.database import FILE_NAME
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing

Json = dict[str, Any]
ROUTES = ("/v1/runs", "/v1/simulations", "/v1/loads")


def ask(api: Api, dataset: str, route: str, **body: Any) -> httpx.Response:
    about = {"dataset_id": dataset} | ({} if route == "/v1/runs" else {"recording": "slow"})
    return api.client.post(route, json=about | body)


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize(
    ("value", "said"),
    [(0.0199, "at least 0.02 mm: below, corners"), (0.0, "at least"), (-0.1, "at least"), (1.001, "at most 1.0 mm")],
)
def test_an_accuracy_out_of_reach_is_refused_and_says_why(
    shared: tuple[Api, str], route: str, value: float, said: str
) -> None:
    answer = ask(*shared, route, accuracy_mm=value)
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert (error["where"], error["value"]) == ("body.accuracy_mm", value)
    assert said in error["message"]


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("value", [FINEST_MM, 0.07, COARSEST_MM])
def test_an_accuracy_within_the_limits_is_taken(api: Api, route: str, value: float) -> None:
    assert ask(api, api.upload()["id"], route, accuracy_mm=value).is_success


def test_the_limits_are_published(client: httpx.Client) -> None:
    shapes = client.get("/openapi.json").json()["components"]["schemas"]
    for name in ("RunIn", "SimulationIn", "LoadsIn"):
        published = shapes[name]["properties"]["accuracy_mm"]
        assert (published["minimum"], published["maximum"], published["default"]) == (FINEST_MM, COARSEST_MM, 0.1)


def test_what_is_not_said_is_what_the_library_does() -> None:
    usual = CalibrationSpec(mode="staged", method="genetic")
    assert run_settings(usual)["accuracy_mm"] == 0.1
    assert usual.accuracy == Numerics().accuracy == 1e-4


def test_a_run_shows_and_uses_its_accuracy(api: Api) -> None:
    dataset = api.upload()["id"]
    usual, fine = api.submit(dataset), api.submit(dataset, accuracy_mm=0.123)
    for run, stated in ((usual, 0.1), (fine, 0.123)):
        assert run["spec"]["accuracy_mm"] == stated, "as it was written, without the digits of a division"
        assert api.finish(run["id"])["spec"]["accuracy_mm"] == stated
        tracks = valid(Comparison, api.get(f"/v1/runs/{run['id']}/comparison"))
        assert tracks.numerics.accuracy_mm == stated
        # a fifth of what was asked for is what the toy says it has
        assert tracks.numerics.estimated_error_mm == pytest.approx(stated / 5)


@pytest.mark.parametrize("route", ["/v1/simulations", "/v1/loads"])
def test_the_engine_is_given_metres(
    api: Api, engine: toy.ToyEngine, monkeypatch: pytest.MonkeyPatch, route: str
) -> None:
    given: list[float] = []

    def noted(real: Callable[..., Any]) -> Callable[..., Any]:
        def call(spec: CalibrationSpec, *rest: Any) -> Any:
            given.append(spec.accuracy)
            return real(spec, *rest)

        return call

    for name in ("compare", "loads"):
        monkeypatch.setattr(engine, name, noted(getattr(engine, name)))
    assert ask(api, api.upload()["id"], route, accuracy_mm=0.5, outputs=True).is_success
    assert given == [5e-4] * (2 if route == "/v1/simulations" else 1)


def test_a_simulation_says_how_it_was_solved(shared: tuple[Api, str]) -> None:
    answer = ask(*shared, "/v1/simulations", accuracy_mm=0.5).json()["numerics"]
    assert answer == {"accuracy_mm": 0.5, "estimated_error_mm": 0.1, "steps_per_beat": 144, "beats": 7}
    assert set(answer) == fields(NumericsAnswer)


def test_the_same_key_with_another_accuracy_is_another_request(api: Api) -> None:
    body: Json = {"dataset_id": api.upload()["id"], "max_generations": 1}
    key = {"Idempotency-Key": "k"}
    first = api.client.post("/v1/runs", json=body, headers=key).json()
    assert api.client.post("/v1/runs", json=dict(reversed(body.items())), headers=key).json() == first
    for other in ({"accuracy_mm": 0.2}, {"accuracy_mm": 0.1}, {"population": 50}):  # a default that is named counts
        assert api.client.post("/v1/runs", json=body | other, headers=key).status_code == 422


def test_a_run_of_a_version_without_accuracy_goes_on(settings: Settings, gate: Gate, engine: toy.ToyEngine) -> None:
    """Its stored specification lacks the key; the checkpoint is what it was."""
    with serving(create_app(settings, engine=engine, make_evaluator=toy.NoEvaluator)) as client:
        api = Api(client)
        run = api.submit(api.upload()["id"])["id"]
        gate.let(2)
        api.until(run, lambda r: r["generations"] == 2)
        api.control(run, "pause")
        gate.let(1)
        api.until(run, lambda r: r["state"] == "PAUSED")
    connection = sqlite3.connect(settings.data / FILE_NAME)
    with connection:
        (spec,) = connection.execute("select spec from run").fetchone()
        assert json.loads(spec)["accuracy"] == 1e-4
        connection.execute("update run set spec = json_remove(spec, '$.accuracy')")
    connection.close()
    with serving(create_app(settings, engine=engine, make_evaluator=toy.NoEvaluator)) as client:
        api = Api(client)
        assert api.run(run)["spec"]["accuracy_mm"] == 0.1
        api.control(run, "resume")
        gate.let(7)
        assert api.finish(run)["state"] == "SUCCEEDED"
    assert engine.started_from == [0, 3]


def test_the_client(client: httpx.Client, api: Api) -> None:
    dataset = api.upload()["id"]
    with Client(str(client.base_url)) as mine:
        assert mine.simulate(dataset, "slow")["numerics"]["accuracy_mm"] == 0.1
        assert mine.simulate(dataset, "slow", accuracy_mm=0.3)["numerics"]["accuracy_mm"] == 0.3
        assert mine.loads_under(dataset, "slow", accuracy_mm=0.3, outputs=["air"])["outputs"]["lift_n"]
        assert mine.submit_run(dataset, accuracy_mm=0.3, max_generations=1)["spec"]["accuracy_mm"] == 0.3


def test_a_line_for_people() -> None:
    how: NumericsAnswer = {"accuracy_mm": 0.1, "estimated_error_mm": 0.01963, "steps_per_beat": 144, "beats": 9}
    assert solved(how) == "solved with 144 steps per beat, estimated error 0.02 mm"
    assert solved(how | {"estimated_error_mm": None}).endswith("error – mm")


# -- the real simulator ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    """A recording of the nominal wing: one beat of it."""
    wing = robird_wing()
    blank = blank_recording(wing, vacuum(10.0, 0.05, 4.0), "still", frames=24)
    model = FlexibleWing(wing, "4", numerics=Numerics(steps=96))
    tracks = model.beat([gene.nominal for gene in model.genes], blank).tracks
    return Dataset("robird", wing, (replace(blank, values=tracks[::4].reshape(24, -1)),))


def test_the_real_engine_solves_as_well_as_asked(dataset: Dataset) -> None:
    engine = Engine()
    rough, fine = (CalibrationSpec(division="4", accuracy=accuracy) for accuracy in (1e-3, 2e-5))
    genome = engine.genome(rough, dataset, {})
    found = [engine.compare(spec, dataset, genome, "still") for spec in (rough, fine, fine)]
    assert found[0].solution.beats < found[1].solution.beats
    assert found[0].solution.error > found[1].solution.error
    for tracks, spec in zip(found, (rough, fine, fine), strict=True):
        assert tracks.accuracy == spec.accuracy
        assert 0 < tracks.solution.error <= spec.accuracy
    apart = np.linalg.norm(found[0].simulated - found[1].simulated, axis=2).max()
    assert 0 < apart <= rough.accuracy + fine.accuracy
    assert np.array_equal(found[1].simulated, found[2].simulated), "the same numbers, bit for bit"
    shown = valid(NumericsAnswer, views.comparison(found[1])["numerics"])
    assert shown.steps_per_beat == found[1].solution.steps
    assert shown.estimated_error_mm == pytest.approx(1e3 * found[1].solution.error)


def test_the_real_loads_are_given_the_accuracy_too(dataset: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is what they fall back on where their own, which is finer, cannot be had."""
    given: list[float] = []
    monkeypatch.setattr(
        "wingfit.service.runs.engine.simulate_outputs", lambda model, *_: given.append(model.numerics.accuracy)
    )
    engine, spec = Engine(), CalibrationSpec(division="4", accuracy=3e-4)
    engine.loads(spec, dataset, engine.genome(spec, dataset, {}), dataset.recordings[0])
    assert given == [3e-4]


def test_what_the_simulator_gives_as_reason_has_a_remedy(dataset: Dataset) -> None:
    """The simulator's own words; a change of them must be followed in `service/runs/simulation_hints.py`."""
    wing, still = dataset.wing, dataset.recordings[0]
    impatient = Numerics(accuracy=1e-12, periodic=1e-6)
    model = FlexibleWing(wing, "4", numerics=impatient)
    nominal = np.array([gene.nominal for gene in model.genes])
    said = with_remedy(model.beat(nominal, still).reason or "")
    assert "requested 1e-09 mm. Remedy: state a larger accuracy_mm" in said
    slow = replace(model, numerics=Numerics(accuracy=1e-4, periodic=1e-15, max_beats=3))
    settling = slow.beat(nominal, still).reason or ""
    assert with_remedy(settling).endswith("needs a larger accuracy_mm (at most 1)")
    bent = {"L_a": 400.0, "E_f": 1e5, "E_r": 2e9, "G_f": 3e4}
    wild = np.array([bent.get(gene.name, gene.nominal) for gene in model.genes])
    windy = blank_recording(wing, tunnel(0.05, 3.0, 6.0))
    assert FLUTTER in with_remedy(FlexibleWing(wing, "4").beat(wild, windy).reason or "")
    assert isinstance(wing.drive, FourBarDrive)
    aloft = replace(wing, drive=replace(wing.drive, offset=wing.drive.offset + 1.0))
    reason = FlexibleWing(aloft, "4").observe(nominal[None], still).reasons[0] or ""
    assert "or other reference markers" in with_remedy(reason)
    assert with_remedy("something else") == "something else"


def test_a_simulation_that_failed_comes_with_its_remedy(api: Api) -> None:
    """The toy diverges beyond a stiffness of 9."""
    for route in ("/v1/simulations", "/v1/loads"):
        answer = ask(api, api.upload()["id"], route, genome={"stiffness": 9.5})
        assert answer.status_code == 409
        assert answer.json()["detail"] == f"the simulation failed: the simulation diverged at 0.1 s. Remedy: {FLUTTER}"
