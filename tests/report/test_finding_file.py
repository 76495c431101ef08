"""A finding survives JSON exactly, and the published schema says what is written."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.report.findings import bare, force_finding, wing_finding, with_verdict
from wingfit.diagnosis.finding import VERDICTS, Finding, Interval
from wingfit.report import finding_from_json, finding_json, html
from wingfit.report.schema import finding_schema, schema_text

jsonschema: Any = import_module("jsonschema")
PUBLISHED = Path(__file__).parents[2] / "docs" / "schemas" / "finding.schema.json"
FINDINGS = [wing_finding(), force_finding(), bare(wing_finding()), *(with_verdict(wing_finding(), v) for v in VERDICTS)]


@pytest.mark.parametrize("finding", FINDINGS)
def test_what_is_written_reads_back_the_same(finding: Finding) -> None:
    data = json.loads(json.dumps(finding_json(finding), allow_nan=False))
    again = finding_from_json(data)
    assert again == finding
    assert type(again) is Finding
    assert repr(again) == repr(finding)  # tuples stay tuples, every digit the same
    jsonschema.Draft202012Validator(finding_schema()).validate(data)


def test_awkward_numbers_keep_every_bit() -> None:
    numbers = (0.1 + 0.2, 5e-324, -0.0, 1.7976931348623157e308, 2 / 3)
    finding = replace(wing_finding(), genes=(), probabilities={str(k): v for k, v in enumerate(numbers)}, strength=7)
    again = finding_from_json(json.loads(json.dumps(finding_json(finding))))
    assert [v.hex() for v in again.probabilities.values()] == [v.hex() for v in numbers]
    assert again.strength == 7


def test_the_published_schema_is_the_code_s() -> None:
    assert PUBLISHED.read_text(encoding="utf-8") == schema_text(), (
        "run: python -m wingfit.report.schema > docs/schemas/finding.schema.json"
    )


def test_the_schema_is_valid_and_closed() -> None:
    schema = finding_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    assert all(part["additionalProperties"] is False for part in (schema, *schema["$defs"].values()))
    assert set(schema["required"]) >= {"format_version", "verdict", "probabilities", "hypotheses"}


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_number_that_json_cannot_say_is_named(bad: float) -> None:
    finding = wing_finding()
    worst = replace(finding.genes[2], value=Interval(1.0, bad, None))
    with pytest.raises(ValueError, match=r"finding\.genes\[2\]\.value\.low is .*must be finite"):
        finding_json(replace(finding, genes=(*finding.genes[:2], worst)))


def test_arrays_and_their_numbers_do_not_slip_through() -> None:
    data = finding_json(replace(wing_finding(), strength=np.float64(0.1)))
    assert type(data["strength"]) is float
    with pytest.raises(ValueError, match=r"finding\.evaluations is a int64; it must be a plain number"):
        finding_json(replace(wing_finding(), evaluations=np.int64(3)))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"format_version": 2}, "format_version is 2; this program reads 1"),
        ({"verdict": "guilty"}, "verdict"),
        ({"strength": "5"}, "strength"),
        ({"strength": None}, "strength"),
        ({"surprise": 1}, "surprise"),
        ({"where": {"words": "", "span": 3}}, "where"),
        ({"floors": {}}, "floors"),
    ],
)
def test_what_is_no_finding_is_refused_by_name(changed: dict[str, Any], said: str) -> None:
    data = {**finding_json(wing_finding()), **changed}
    with pytest.raises(ValueError, match=said):
        finding_from_json(data)
    assert not jsonschema.Draft202012Validator(finding_schema()).is_valid(data)


def test_advice_of_an_earlier_version_is_read_and_shown() -> None:
    """It has no kind, cost or places, and only conditions, of which the probability was always given."""
    data = finding_json(wing_finding())
    new = ("kind", "cost", "beyond", "places", "channels")
    for one in data["advice"]:
        for name in new:
            del one[name]
    jsonschema.Draft202012Validator(finding_schema()).validate(data)
    again = finding_from_json(data)
    assert again == wing_finding()
    assert "5 Hz, 14° of lag, 10 mbar" in html(again)
