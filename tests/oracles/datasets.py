"""Uploads that try to write outside the store, and a database as years of use leave it."""

from __future__ import annotations

from benchmarks.abuse.uploads import example_files, zipped, zipped_with
from benchmarks.load.filling import Filled, fill

__all__ = ["Filled", "example_files", "fill", "zipped", "zipped_with"]
