"""Uploads that try to write outside the store, and a database filled with many runs."""

from __future__ import annotations

from benchmarks.abuse.uploads import example_files, zipped, zipped_with
from benchmarks.load.filling import Filled, fill

__all__ = ["Filled", "example_files", "fill", "zipped", "zipped_with"]
