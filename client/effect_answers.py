"""Shapes of the server's answers about effects, as the Python client hands them out (docs/api.md explains them)."""

from __future__ import annotations

from typing import Literal, TypedDict


class EffectParameter(TypedDict):
    """One gene of an effect; with ``of``, bounds and typical value are parts of that measure of what is calibrated."""

    name: str
    unit: str
    of: Literal["span", "chord", "mass"] | None
    lower: float
    upper: float
    typical: float
    scale: Literal["log", "linear"]
    size: bool
    place: bool
    description: str


class Effect(TypedDict):
    """One piece of physics, or one fault of a measurement, that a model can contain."""

    name: str
    title: str
    family: str
    port: str
    power: str
    memory: str | None
    law: str
    source: str
    signature: str
    confused_with: list[str]
    applies_to: list[Literal["wing", "vehicle"]]
    parameters: list[EffectParameter]
