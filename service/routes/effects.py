"""The effects that a model can contain."""

from __future__ import annotations

from fastapi import APIRouter

from wingfit.service.http import responses as http
from wingfit.service.outcomes import effect_views
from wingfit.service.outcomes.effect_schemas import EffectOut, EffectsOut

router = APIRouter(prefix="/v1/effects", tags=["effects"])


@router.get("", responses=http.errors(), summary="List effects")
def list_effects() -> EffectsOut:
    """List the effects that a run or a simulation can include, with their genes and sources."""
    return effect_views.effects()


@router.get("/{name}", responses=http.errors(404), summary="Fetch an effect")
def fetch(name: str) -> EffectOut:
    """Describe one effect."""
    return effect_views.effect(name)
