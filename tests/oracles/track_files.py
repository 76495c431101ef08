"""Files of capture programs, written by code that shares nothing with the importers, and ways to damage them."""

from __future__ import annotations

from benchmarks.data_in import binary_writers, text_writers
from benchmarks.data_in.cases import Case, cases, refusals
from benchmarks.data_in.formats import fuzz, guessed, measure
from benchmarks.data_in.truth import Truth, flapping

__all__ = [
    "Case", "Truth", "binary_writers", "cases", "flapping", "fuzz", "guessed", "measure", "refusals", "text_writers",
]  # fmt: skip
