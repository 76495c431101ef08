"""Tracks do not depend on the number of threads that linear algebra has."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from wingfit.cameras.calibrate import from_boards
from wingfit.cameras.track import procedure


class StoppedError(Exception):
    """Ends a computation after its first step."""


@pytest.mark.parametrize(
    ("module", "step", "run"),
    [
        (procedure, "_check", lambda: procedure.track(SimpleNamespace(films=()))),  # type: ignore[arg-type]
        (from_boards, "_check", lambda: from_boards.calibrate_boards(None)),  # type: ignore[arg-type]
    ],
)
def test_linear_algebra_has_one_thread(
    monkeypatch: pytest.MonkeyPatch, module: object, step: str, run: Callable[[], object]
) -> None:
    seen = list[int]()

    def first(*_: object, **__: object) -> None:
        seen.extend(one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas")
        raise StoppedError

    monkeypatch.setattr(module, step, first)
    with threadpool_limits(2, user_api="blas"), pytest.raises(StoppedError):
        run()
    assert set(seen) == {1}
