"""The measurements of the code's layout."""

from __future__ import annotations

from benchmarks.house import cycles, idioms, imports, large_files, largest_folder, phrases_in

__all__ = ["cycles", "idioms", "imports", "large_files", "largest_folder", "phrases_in"]
