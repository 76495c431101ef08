"""All effects, in the order in which they act on a scene."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

from records import Vehicle, Wing
from sim.effects.contract import Effect

# One line each: a file of this folder that declares EFFECT.
_NAMES: tuple[str, ...] = (
    # measurement
    "camera_shift",
)

EFFECTS: dict[str, Effect] = {name: import_module(f"sim.effects.{name}").EFFECT for name in _NAMES}


def chosen(names: Iterable[str], rig: Wing | Vehicle) -> tuple[Effect, ...]:
    """The effects called ``names``, in the order of the registry; ValueError for one unknown, repeated or of no use."""
    wanted = list(names)
    for name in wanted:
        if name not in EFFECTS:
            raise ValueError(f"unknown effect {name!r}; there are {', '.join(EFFECTS)}")
        if wanted.count(name) > 1:
            raise ValueError(f"effect {name!r} is named {wanted.count(name)} times; name it once")
        if not EFFECTS[name].applies_to(rig):
            kind = "wing" if isinstance(rig, Wing) else "vehicle"
            known = ", ".join(n for n, effect in EFFECTS.items() if effect.applies_to(rig))
            raise ValueError(f"effect {name!r} does not apply to a {kind}; there are {known}: leave it out")
    return tuple(effect for name, effect in EFFECTS.items() if name in wanted)
