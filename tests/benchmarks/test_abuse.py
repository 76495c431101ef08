"""Hostile requests are many, the same for the same seed, and their answers are judged."""

from __future__ import annotations

import httpx
import pytest

from benchmarks.abuse import requests, uploads
from benchmarks.abuse.__main__ import _wrong
from benchmarks.abuse.cases import Case
from records import load_archive

PROBLEM = {"Content-Type": "application/problem+json"}


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_there_are_many_and_the_same_seed_gives_the_same() -> None:
    first, again = (list(uploads.cases(1)) for _ in range(2))
    assert first == again
    assert first != list(uploads.cases(2))
    assert len(first) + len(list(requests.cases())) > 2000
    load_archive(uploads.small_archive(), "good.zip")


@pytest.mark.parametrize(
    ("answer", "status", "headers", "text", "fine"),
    [
        ("refused", 422, PROBLEM, "{}", True),
        ("refused", 201, {}, "{}", False),
        ("any", 201, {}, "{}", True),
        ("any", 404, PROBLEM, "{}", True),
        ("any", 500, PROBLEM, "{}", False),
        ("any", 503, PROBLEM, "{}", False),
        ("any", 400, {"Content-Type": "text/plain"}, "no", False),
        ("any", 422, PROBLEM, "Traceback (most recent call last)", False),
        ("accepted", 422, PROBLEM, "{}", False),
        ("accepted", 202, {}, "{}", True),
    ],
)
def test_an_answer_is_judged(answer: str, status: int, headers: dict[str, str], text: str, *, fine: bool) -> None:
    case = Case("x", answer=answer)  # type: ignore[arg-type]  # as above
    found = httpx.Response(status, headers=headers, content=text.encode())
    assert (_wrong(case, found) == "") is fine
