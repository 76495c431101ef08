"""All effects that can be hidden in a simulated wing, in the order in which they are applied.

LISTED: those that the diagnosis has in its own library of effects; UNKNOWN: the others.
"""

from __future__ import annotations

from benchmarks.concealed.plant.wing_effects.air import LISTED_AIR
from benchmarks.concealed.plant.wing_effects.drive import LISTED_DRIVE
from benchmarks.concealed.plant.wing_effects.kind import Kind
from benchmarks.concealed.plant.wing_effects.structure import LISTED_STRUCTURE
from benchmarks.concealed.plant.wing_effects.unlisted import UNLISTED

KINDS: dict[str, Kind] = {kind.name: kind for kind in (*LISTED_STRUCTURE, *LISTED_DRIVE, *LISTED_AIR, *UNLISTED)}
LISTED = tuple(kind.name for kind in KINDS.values() if kind.listed)
UNKNOWN = tuple(kind.name for kind in KINDS.values() if not kind.listed)
