"""Routes that describe the effects (physics that can be added to a model)."""

from __future__ import annotations

from fastapi import APIRouter

from wingfit.client import effect_answers as answers
from wingfit.service.effect_views import effect_view
from wingfit.service.http import responses as http
from wingfit.service.http.problems import not_found
from wingfit.sim.effects.registry import EFFECTS

router = APIRouter(prefix="/v1/effects", tags=["effects"])


@router.get("", responses=http.errors(), summary="List effects")
def list_effects() -> answers.Effects:
    """List the effects that a run or a simulation can include, with their genes and sources."""
    return {"effects": [effect_view(one) for one in EFFECTS.values()]}


@router.get("/{name}", responses=http.errors(404), summary="Fetch an effect")
def fetch(name: str) -> answers.Effect:
    """Return the description of one effect: its genes, its sources, and what it applies to."""
    if name not in EFFECTS:
        raise not_found("effect", name, f"there are {', '.join(EFFECTS)}")
    return effect_view(EFFECTS[name])
