"""Effects from the registry to the wire."""

from __future__ import annotations

from wingfit.service.http.problems import not_found
from wingfit.service.outcomes.effect_schemas import EffectOut, EffectsOut, ParameterOut
from wingfit.sim.effects.contract import Effect, Parameter
from wingfit.sim.effects.registry import EFFECTS


def effects() -> EffectsOut:
    """All effects."""
    return EffectsOut(effects=[_effect(one) for one in EFFECTS.values()])


def effect(name: str) -> EffectOut:
    """The effect called ``name``, or a 404."""
    if name not in EFFECTS:
        raise not_found("effect", name, f"there are {', '.join(EFFECTS)}")
    return _effect(EFFECTS[name])


def _effect(found: Effect) -> EffectOut:
    return EffectOut(
        name=found.name,
        title=found.title,
        family=found.family,
        port=found.port,
        power=found.power,
        memory=found.memory or None,
        law=found.law,
        source=found.source,
        signature=found.signature,
        confused_with=list(found.confused_with),
        applies_to=list(found.rigs),
        parameters=[_parameter(found, one) for one in found.parameters],
    )


def _parameter(found: Effect, one: Parameter) -> ParameterOut:
    return ParameterOut(
        name=f"{found.name}.{one.name}",
        unit=one.unit,
        of=one.of,
        lower=one.lower,
        upper=one.upper,
        typical=one.typical,
        scale=one.scale,
        size=one in found.size,
        place=one.place,
        description=one.description,
    )
