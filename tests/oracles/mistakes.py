"""Deliberate mistakes in datasets, each with the findings that name it."""

from __future__ import annotations

from benchmarks.mistakes import vehicles, wings

KINDS = {f"{kind.rig}: {kind.name}": kind for kind in (*wings.KINDS, *vehicles.KINDS)}
