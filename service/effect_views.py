"""Describes effects (physics that can be added to a model) as the API and the command line answer."""

from __future__ import annotations

from wingfit.client import effect_answers as answers
from wingfit.service.answers import answer
from wingfit.sim.effects.contract import Effect, Parameter


def effect_view(effect: Effect) -> answers.Effect:
    """Return the description of ``effect``, with its genes in the order of the model."""
    return answer(
        answers.Effect,
        effect,
        memory=effect.memory or None,
        applies_to=list(effect.rigs),
        parameters=[_parameter(effect, one) for one in effect.parameters],
    )


def _parameter(effect: Effect, one: Parameter) -> answers.EffectParameter:
    return answer(
        answers.EffectParameter,
        one,
        name=f"{effect.name}.{one.name}",
        relative_to=one.of,
        is_size=one in effect.size,
        is_location=one.place,
    )
