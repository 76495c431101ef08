"""The covariance of a run on tracks survives its way through the stored answer."""

from __future__ import annotations

import json

from wingfit.calibration.estimates.uncertainty import GeneCovariance
from wingfit.calibration.result import Result
from wingfit.export.from_run import covariance_of
from wingfit.service.outcomes import force_views
from wingfit.service.runs import views


def test_it_is_stored_and_read_again() -> None:
    known = GeneCovariance.of_independent(
        [GeneCovariance(("E_r", "G_f"), ((4.0, 1.0), (1.0, 9.0))), GeneCovariance(("L_a",), ((0.25,),))]
    )
    assert known is not None
    assert known.matrix == ((4.0, 1.0, 0.0), (1.0, 9.0, 0.0), (0.0, 0.0, 0.25))
    result = Result((), (), 1.0, 0.5, None, None, 0.1, (), known)
    stored = json.loads(json.dumps(views.result(result)))
    assert force_views.stored("tracks", stored)["kind"] == "tracks"
    found = covariance_of(stored["covariance"]["names"], stored["covariance"]["matrix"])
    assert found is not None
    assert (found.names, found.matrix) == (known.names, known.matrix)


def test_a_result_of_before_has_none() -> None:
    stored = views.result(Result((), (), 1.0, 0.5, None, None, 0.1))
    assert stored.get("covariance") is None
    del stored["covariance"]
    assert force_views.stored("tracks", dict(stored))["kind"] == "tracks"
