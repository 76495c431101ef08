"""Effects that a model can contain, on the wire."""

from __future__ import annotations

from pydantic import BaseModel

from wingfit.records.genes import Scale
from wingfit.sim.effects.contract import Family, Measure, Port, Power, RigKind


class ParameterOut(BaseModel):
    """One gene of an effect; ``name`` is the gene's.

    With ``of``, ``lower``, ``upper`` and ``typical`` are parts of that measure of what is calibrated: its span, its
    mean chord, or the mass of its wing. A run's genes have them in ``unit``.
    """

    name: str
    unit: str
    of: Measure | None
    lower: float
    upper: float
    typical: float
    scale: Scale
    size: bool
    place: bool
    description: str


class EffectOut(BaseModel):
    """One piece of physics, or one fault of a measurement, that a model can contain.

    It is switched off where all its parameters that are a ``size`` are zero, as in every nominal genome.
    """

    name: str
    title: str
    family: Family
    port: Port
    power: Power
    memory: str | None
    law: str
    source: str
    signature: str
    confused_with: list[str]
    applies_to: list[RigKind]
    parameters: list[ParameterOut]


class EffectsOut(BaseModel):
    """All effects, in the order in which they act."""

    effects: list[EffectOut]
