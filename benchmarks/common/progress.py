"""Shows progress on standard error, in one line that is overwritten."""

from __future__ import annotations

import sys
import time

WIDTH = 100


def show(text: str, *, last: bool = False) -> None:
    """Overwrite the progress line with ``text``; with ``last``, also end the line, so that later output starts anew."""
    print(f"\r{text:<{WIDTH}}", end="\n" if last else "", file=sys.stderr, flush=True)


def show_count(label: str, done: int, total: int, began: float) -> None:
    """Show that ``done`` of ``total`` parts are done, the time spent, and an estimate of the remaining time.

    ``label``: text in front; ``began``: start of the work by ``time.monotonic`` (s).
    """
    spent = time.monotonic() - began
    left = spent / done * (total - done)
    show(f"{label}: {done} of {total}, {spent:.0f} s, about {left:.0f} s left", last=done == total)
