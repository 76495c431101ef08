"""The residual of a model as a multiple of the noise, and its badge."""

from __future__ import annotations

from typing import Any

import pytest

from tests.report import findings
from wingfit.service.outcomes import fit_quality

TRACKS: dict[str, Any] = {"after_mm": 0.6, "held_out_after_mm": 0.9, "noise_mm": 0.3}
FORCES: dict[str, Any] = {"after_mn": 2.0, "held_out_after_mn": None, "noise_mn": 2.5}
SERIES: dict[str, Any] = {"relative_to": "noise", "after": 1.1, "held_out_after": 1.2}


@pytest.mark.parametrize(
    ("kind", "result", "residual", "held_out"),
    [
        ("tracks", TRACKS, 2.0, 3.0),
        ("tracks", TRACKS | {"noise_mm": None}, None, None),
        ("forces", FORCES, 0.8, None),
        ("forces", {"after_mn": 2.0, "held_out_after_mn": 3.0}, None, None),  # of an earlier version
        ("series", SERIES, 1.1, 1.2),
        ("series", SERIES | {"relative_to": "range"}, None, None),
    ],
)
def test_misfits_become_multiples_of_the_noise(
    kind: str, result: dict[str, Any], residual: float | None, held_out: float | None
) -> None:
    found = fit_quality.of_result(kind, result)
    assert found.residual == (None if residual is None else pytest.approx(residual))
    assert found.held_out == (None if held_out is None else pytest.approx(held_out))


@pytest.mark.parametrize(
    ("residual", "held_out", "badge"),
    [
        (1.3, None, "good"),
        (1.31, None, "doubtful"),
        (3.01, None, "wrong"),
        (1.0, 1.4, "doubtful"),  # it fits, and predicts badly
        (0.9, 40.0, "wrong"),
        (None, 1.0, None),
    ],
)
def test_the_worse_of_fit_and_prediction_gives_the_badge(
    residual: float | None, held_out: float | None, badge: str | None
) -> None:
    assert fit_quality.badge(residual, held_out) == badge


def test_a_finding_is_judged_with_its_added_effects_over_the_floor() -> None:
    finding = findings.wing_finding()
    fitted = [one for one in finding.recordings if not one.held_out]
    assert finding.proof is not None
    found = fit_quality.of_finding(finding)
    squares = [(one.after.value / one.floor) ** 2 for one in fitted]
    assert found.residual == pytest.approx((sum(squares) / len(squares)) ** 0.5)
    assert found.held_out == finding.proof.after.value
