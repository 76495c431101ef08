"""The set of effects hidden in one simulated wing: any number, each with a strength that can be zero."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from benchmarks.concealed.plant.wing.build import Draft
from benchmarks.concealed.plant.wing_effects.catalogue import KINDS
from benchmarks.concealed.plant.wing_effects.kind import Family, Kind, Values
from wingfit.records import Wing


@dataclass(frozen=True)
class Effect:
    """A hidden effect: its ``strength`` (in the unit of its :class:`Kind`) and its other parameters.

    ``at``: parameters by name whose value is not the typical one.
    """

    name: str
    strength: float
    at: Values = field(default_factory=dict)

    @property
    def kind(self) -> Kind:
        """The effect's entry in the catalogue; ValueError for an unknown name."""
        if self.name not in KINDS:
            raise ValueError(f"the plant cannot hide {self.name!r}; it can hide {', '.join(KINDS)}")
        return KINDS[self.name]

    @property
    def values(self) -> dict[str, float]:
        """All parameters by name, typical values included; ValueError for an unknown parameter."""
        shape = self.kind.shape
        for name in self.at:
            if name not in shape:
                raise ValueError(f"{self.name} has no parameter {name!r}; it has {', '.join(shape) or 'none'}")
        return {name: float(self.at.get(name, row[0])) for name, row in shape.items()}


@dataclass(frozen=True)
class Truth:
    """What a correct diagnosis should report about one hidden effect.

    Attributes:
        name, family, listed, strength: of the effect; see :class:`Kind`.
        parameters: all of its parameters.
        span, chord: place on the wing, as fractions; None for an effect without a place.
        turn: drive phase (rad) near which it acts; None if it always acts.
        genes: true values, by name, of those genes of the library's effect of the same kind that have the same
            meaning as a parameter of this one.
    """

    name: str
    family: Family
    listed: bool
    strength: float
    parameters: Values
    span: float | None
    chord: float | None
    turn: float | None
    genes: Values


@dataclass(frozen=True)
class Hidden:
    """All effects hidden in one wing; none by default."""

    effects: tuple[Effect, ...] = ()

    @classmethod
    def one(cls, name: str, strength: float, **at: float) -> Hidden:
        """The single effect ``name`` with its ``strength`` and those parameters ``at`` that are not typical."""
        return cls((Effect(name, strength, at),))

    def put_into(self, draft: Draft) -> None:
        """Divide the wing of ``draft`` into bodies and apply the effects to it, in the order of the catalogue."""
        order = list(KINDS)
        present = [e for e in sorted(self.effects, key=lambda e: order.index(e.kind.name)) if e.strength != 0.0]
        for effect in present:
            if effect.kind.before:
                effect.kind.put(draft, effect.strength, effect.values)
        draft.cut_up()
        for effect in present:
            if not effect.kind.before:
                effect.kind.put(draft, effect.strength, effect.values)

    def truths(self, wing: Wing, turns: Mapping[str, float]) -> tuple[Truth, ...]:
        """What a correct diagnosis should report about each effect hidden in ``wing``.

        ``turns``: drive phase (rad) at which an effect acts, by its name, for those whose phase follows from the
        motion.
        """
        return tuple(_truth(effect, wing, turns.get(effect.name)) for effect in self.effects)


def _truth(effect: Effect, wing: Wing, turn: float | None) -> Truth:
    kind, values = effect.kind, effect.values
    return Truth(
        effect.name,
        kind.family,
        kind.listed,
        effect.strength,
        values,
        values.get("span"),
        values.get("chord"),
        values.get("turn", turn),
        kind.genes(wing, effect.strength, values) if kind.genes else {},
    )


def drawn(name: str, strength: float, rng: np.random.Generator) -> Effect:
    """The effect ``name`` of ``strength``, with its other parameters drawn uniformly from their ranges."""
    shape = Effect(name, strength).kind.shape
    return Effect(name, strength, {key: float(rng.uniform(low, high)) for key, (_, low, high) in shape.items()})
