"""How much of a tracking is done, from the step that is computed and the part of it that is done."""

from __future__ import annotations

# Parts of the time that each step takes.
_STEPS = {"detecting": (0.0, 0.85), "instants": (0.85, 0.87), "rays": (0.87, 0.91), "following": (0.91, 1.0)}


def whole(step: str, part: float) -> float:
    """Return the part (0 to 1) of a whole tracking that is done when ``part`` of ``step`` is."""
    low, high = _STEPS[step]
    return low + (high - low) * part
