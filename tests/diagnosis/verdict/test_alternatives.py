"""Effects that cannot be distinguished are tried on what is held out, one after the other."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from wingfit.diagnosis.verdict import build_finding


@pytest.mark.parametrize(
    ("verdict", "best", "other", "none"),
    [
        ("ambiguous", "missed", "missed", True),
        ("ambiguous", "missed", "predicted", False),
        ("ambiguous", "missed", None, True),  # it cannot be simulated there
        ("ambiguous", "predicted", "missed", False),
        ("named", "missed", "missed", False),
    ],
)
def test_none_predicts_if_each_misses(
    monkeypatch: pytest.MonkeyPatch, verdict: str, best: str, other: str | None, none: bool
) -> None:
    tried = []

    def predicted(*given: Any) -> tuple[str | None, tuple[()]]:
        tried.append(given[-1])
        return other, ()

    monkeypatch.setattr(build_finding, "predict_held_out", predicted)
    monkeypatch.setattr(build_finding, "proof", lambda found, *_, **__: found)
    monkeypatch.setattr(build_finding, "unpredicted", lambda _, found, __: found == "missed")
    monkeypatch.setattr(build_finding, "_discretisation_error", lambda _: 0.0)
    refits: Any = tuple(SimpleNamespace(names=names, fit="+".join(names)) for names in ((), ("a",), ("b", "c"), ("d",)))
    state: Any = SimpleNamespace(
        data=SimpleNamespace(unit="N"),
        fitted_nominal=SimpleNamespace(refit=refits[0]),
        final_weights=SimpleNamespace(refits=refits),
        floor=lambda error: error,
        position_errors=None,
        context=None,
    )
    decision: Any = SimpleNamespace(verdict=verdict, alternatives=(("a",), ("c", "b")))
    proved: Any = best
    assert build_finding._none_predicts(state, decision, refits[1], (), proved) == none
    assert tried == (["b+c"] if (verdict, best) == ("ambiguous", "missed") else []), "only the other alternative"
