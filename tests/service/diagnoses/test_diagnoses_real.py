"""The real tool behind the API and in this process: a model without clap-and-peel, on forces of wings that do it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy.typing as npt

from tests.service.conftest import Api, serving
from tests.service.runs import force_data
from wingfit.calibration.problem import Evaluation, Problem
from wingfit.service.app import create_app
from wingfit.service.diagnoses.local import diagnose
from wingfit.service.settings import Settings
from wingfit.workers.in_process import InProcessEvaluator
from wingfit.workers.watch import never

ASKED: dict[str, Any] = {"without": ["clap_and_peel"], "suspects": ["clap_and_peel", "balance_offset"], "seed": 2}
LEFT_OUT = 2


def test_what_was_left_out_is_named_alike_on_the_server_and_here(tmp_path: Path) -> None:
    app = create_app(Settings(data=tmp_path / "data"), make_evaluator=InProcessEvaluator)
    archive = force_data.archive(LEFT_OUT)
    with serving(app) as client:
        api = Api(client)
        uploaded = client.post("/v1/datasets", files={"file": ("delfly.zip", archive)}).json()["id"]
        refused = client.post("/v1/diagnoses", json={"dataset_id": uploaded, "suspects": ["lens_distortion"]})
        assert "this rig has" in refused.json()["errors"][0]["message"]
        one = api.diagnose(uploaded, **ASKED)["id"]
        done = api.diagnosed(one, 120.0)
        assert (done["state"], done["error"], done["verdict"]) == ("SUCCEEDED", None, "partly named")
        assert done["evaluations"] > 0
        found = api.get(f"/v1/diagnoses/{one}/finding")
        assert found["named"] == ["clap_and_peel"]
        schema = api.get("/v1/schemas/finding")
        assert set(found) == set(schema["properties"])
        text = client.get(f"/v1/diagnoses/{one}/report").text
        assert "peel" in text.lower()
        assert "<script" not in text
    path = tmp_path / "delfly.zip"
    path.write_bytes(archive)
    told: list[tuple[float, float | None, str]] = []
    here = diagnose(path, ASKED, 1, lambda *now: told.append(now))
    assert (here.verdict, here.named, here.summary) == ("partly named", ("clap_and_peel",), done["summary"])
    assert [one.misfit for one in here.hypotheses] == [one["misfit"] for one in found["hypotheses"]]
    assert [part for part, _, _ in told] == sorted(part for part, _, _ in told)
    assert told[-1][0] == 1.0


def test_a_diagnosis_is_cancelled_in_the_middle_of_a_step(tmp_path: Path) -> None:
    slow = SlowEvaluator()
    app = create_app(Settings(data=tmp_path / "data"), make_evaluator=lambda: slow)
    with serving(app) as client:
        api = Api(client)
        uploaded = client.post("/v1/datasets", files={"file": ("delfly.zip", force_data.archive(LEFT_OUT))}).json()[
            "id"
        ]
        one = api.diagnose(uploaded, **ASKED)["id"]
        assert slow.asked.wait(30)
        assert client.post(f"/v1/diagnoses/{one}/cancel").json()["pending_action"] == "CANCEL"
        before = api.diagnosis(one)["steps"]
        slow.go_on.set()
        done = api.diagnosed(one, 120.0)
        assert (done["state"], done["steps"], done["error"]) == ("CANCELLED", before, None)
        assert slow.batches == 1


class SlowEvaluator(InProcessEvaluator):
    """Holds its first batch until it is released, and counts."""

    def __init__(self) -> None:
        super().__init__()
        self.asked, self.go_on, self.batches = threading.Event(), threading.Event(), 0

    def evaluate(
        self,
        problem: Problem,
        values: npt.ArrayLike,
        *,
        residuals: bool = False,
        interrupted: Callable[[], bool] = never,
    ) -> Evaluation:
        self.batches += 1
        self.asked.set()
        assert self.go_on.wait(30)
        return super().evaluate(problem, values, residuals=residuals, interrupted=interrupted)
