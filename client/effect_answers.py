"""JSON answers of the server about effects (physics or measurement errors that a model can include)."""

from __future__ import annotations

from typing import Literal

from typing_extensions import TypedDict


class EffectParameter(TypedDict):
    """One gene of an effect.

    With ``relative_to``, ``lower``, ``upper`` and ``typical`` are fractions of that measure of the rig: its span, its
    mean chord, or the mass of its wing. The genes of a run give the same quantities in ``unit``.
    ``is_size``: the effect is off if this and its other sizes are zero; ``is_location``: where on the wing it acts;
    ``scale``: how a search spreads over the bounds.
    """

    name: str
    unit: str
    relative_to: Literal["span", "chord", "mass"] | None
    lower: float
    upper: float
    typical: float
    scale: Literal["log", "linear"]
    is_size: bool
    is_location: bool
    description: str


class Effect(TypedDict):
    """One piece of physics, or one measurement error, that a model can contain.

    The effect is off where all its parameters with ``is_size`` are zero, as in every nominal genome. ``port`` is where
    it enters the model, ``power`` how it exchanges energy over a beat, ``memory`` its internal states in words,
    ``law`` its equations, ``source`` their publication, ``signature`` its trace in a recording.
    """

    name: str
    title: str
    family: Literal["structure", "inertia", "actuation", "aerodynamics", "measurement"]
    port: Literal["inertia", "connector", "drive", "air", "point", "observation"]
    power: Literal["conservative", "dissipative", "any"]
    memory: str | None
    law: str
    source: str
    signature: str
    confused_with: list[str]
    applies_to: list[Literal["wing", "vehicle"]]
    parameters: list[EffectParameter]


class Effects(TypedDict):
    """All effects, in the order in which the simulation applies them."""

    effects: list[Effect]
