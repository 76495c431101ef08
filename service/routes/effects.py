"""Routes that describe the effects (physics that can be added to a model)."""

from __future__ import annotations

from fastapi import APIRouter

from wingfit.client import effect_answers as answers
from wingfit.service.answers import answer
from wingfit.service.http import responses as http
from wingfit.service.http.problems import not_found
from wingfit.sim.effects.contract import Effect, Parameter
from wingfit.sim.effects.registry import EFFECTS

router = APIRouter(prefix="/v1/effects", tags=["effects"])


@router.get("", responses=http.errors(), summary="List effects")
def list_effects() -> answers.Effects:
    """List the effects that a run or a simulation can include, with their genes and sources."""
    return {"effects": [_effect(one) for one in EFFECTS.values()]}


@router.get("/{name}", responses=http.errors(404), summary="Fetch an effect")
def fetch(name: str) -> answers.Effect:
    """Return the description of one effect: its genes, its sources, and what it applies to."""
    if name not in EFFECTS:
        raise not_found("effect", name, f"there are {', '.join(EFFECTS)}")
    return _effect(EFFECTS[name])


def _effect(effect: Effect) -> answers.Effect:
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
