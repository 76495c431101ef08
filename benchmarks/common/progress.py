"""Progress on standard error, in one line that is overwritten."""

from __future__ import annotations

import sys
import time

WIDTH = 100


def show(text: str, *, last: bool = False) -> None:
    """Overwrite the line with ``text``; end the line if it is the ``last``."""
    print(f"\r{text:<{WIDTH}}", end="\n" if last else "", file=sys.stderr, flush=True)


def show_count(label: str, done: int, total: int, began: float) -> None:
    """Show ``done`` of ``total`` with the remaining time; ``began`` is the start by ``time.monotonic``."""
    spent = time.monotonic() - began
    left = spent / done * (total - done)
    show(f"{label}: {done} of {total}, {spent:.0f} s, about {left:.0f} s left", last=done == total)
