"""What a user can do about a failed simulation, added to the simulator's error message."""

from __future__ import annotations

FLUTTER = (
    "a wing that flutters has no periodic motion: give it more stiffness or damping, a slower stream, or a lower flap "
    "frequency"
)

# Part of a message of the simulator, and the remedy.
REMEDIES = (
    ("not accurate enough", "state a larger accuracy_mm (at most 1), or a lower flap frequency"),
    ("not periodic", f"{FLUTTER}; one that only settles slowly needs a larger accuracy_mm (at most 1)"),
    ("flutters", FLUTTER),
    ("diverged", FLUTTER),
    (
        "never cross the hinge height",
        "the wing droops or bends too far to be laid over the recording: give it more stiffness, or other reference "
        "markers; if all genomes fail, tracks and description may disagree: 'wingfit datasets check' finds wrong axes, "
        "units and frequencies",
    ),
)


def with_remedy(reason: str) -> str:
    """Return ``reason``, an error message of the simulator, followed by what the user can do about it, if known."""
    remedy = next((remedy for words, remedy in REMEDIES if words in reason), None)
    return f"{reason}. Remedy: {remedy}" if remedy else reason
