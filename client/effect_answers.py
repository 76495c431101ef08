"""JSON answers of the server about effects (physics or measurement errors that a model can include)."""

from __future__ import annotations

from typing import Literal

from typing_extensions import TypedDict


class EffectParameter(TypedDict):
    """One gene of an effect, with its bounds ``lower`` and ``upper`` and a ``typical`` value.

    If ``relative_to`` is not null, bounds and typical value are fractions of that measure of the rig (span, mean chord,
    or mass of the wing); in runs the same gene is in ``unit``. Otherwise they are in ``unit``.
    ``is_size``: the gene says how strong the effect is; the effect is off if all such genes are zero.
    ``is_location``: the gene says where on the wing the effect acts. ``scale``: whether a search spreads the values of
    the gene evenly between the bounds ("linear") or evenly in their logarithm ("log").
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

    The effect is off if all its parameters with ``is_size`` are zero, as in every nominal genome. ``port`` is the part
    of the model that the effect changes; ``power`` says whether its law gains or loses no energy over a beat
    (conservative), loses some at every instant (dissipative), or neither is guaranteed (any). ``memory`` describes its
    internal states (null: none), ``law`` gives its equations, one per line, ``source`` their publication; ``signature``
    says how the effect shows in a recording, ``confused_with`` names effects that show similarly.
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
