"""Recordings whose frame, side or labels nobody can know, and wings that flap rigidly."""

from __future__ import annotations

from benchmarks.alignment.unsettled import Unsettled, grid_wing, rigid, tracks_of, unsettled

__all__ = ["Unsettled", "grid_wing", "rigid", "tracks_of", "unsettled"]
