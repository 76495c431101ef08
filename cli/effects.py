"""``wingfit effects``: lists the effects (additional physics, measurement errors) that a model can include."""

from __future__ import annotations

from typing import Annotated

import typer

from wingfit.cli.base.options import AsJson
from wingfit.cli.base.output import Columns, emit, interval, number, records, say, table
from wingfit.client.client import WingfitError
from wingfit.client.effect_answers import Effect, EffectParameter

MEASURES = {"span": "span", "chord": "mean chord", "mass": "mass of the wing"}


def effects(
    name: Annotated[str | None, typer.Argument(help="An effect, for its details; default: list all.")] = None,
    as_json: AsJson = False,
) -> None:
    """List the effects that a run or a simulation can include with --with, or describe one of them; needs no server.

    Example: wingfit effects hinge_offset
    """
    from wingfit.service.effect_views import effect_view  # imported late: other commands start faster
    from wingfit.sim.effects.registry import EFFECTS

    if name is None:
        emit([effect_view(one) for one in EFFECTS.values()], _list, as_json=as_json, then="wingfit effects NAME")
        return
    key = name.replace("-", "_")
    if key not in EFFECTS:
        raise WingfitError(f"there is no effect {name!r}", f"there are {', '.join(EFFECTS)}")
    then = f"wingfit runs submit DATASET --with {key}; this estimates its genes"
    emit(effect_view(EFFECTS[key]), _describe, as_json=as_json, then=then)


def _list(effects: list[Effect]) -> None:
    columns: Columns[Effect] = {
        "effect": "name",
        "family": "family",
        "rig": lambda e: " ".join(e["applies_to"]),
        "genes": lambda e: " ".join(parameter["name"].partition(".")[2] for parameter in e["parameters"]),
        "signature": "signature",
    }
    records(effects, columns)


def _describe(effect: Effect) -> None:
    rows = [
        ["effect", f"{effect['name']}: {effect['title']}"],
        ["family", effect["family"]],
        ["acts on", f"{effect['port']} of a {' or '.join(effect['applies_to'])}"],
        ["power", "any" if effect["power"] == "any" else f"{effect['power']} only"],
        ["memory", effect["memory"] or "none"],
        *(["law" if k == 0 else "", line] for k, line in enumerate(effect["law"].splitlines())),
        ["source", effect["source"]],
        ["signature", effect["signature"]],
        ["confused with", ", ".join(effect["confused_with"]) or "–"],
    ]
    table(["", ""], rows)
    say("")
    columns: Columns[EffectParameter] = {
        "gene": "name",
        ">typical": lambda one: number(one["typical"], 3),
        "bounds": lambda one: interval(one["lower"], one["upper"]),
        "unit": lambda one: one["unit"] if one["relative_to"] is None else f"x {one['relative_to']}",
        "description": lambda one: f"{one['description']} ({_role(one)})",
    }
    records(effect["parameters"], columns)
    for of, unit in dict.fromkeys((p["relative_to"], p["unit"]) for p in effect["parameters"] if p["relative_to"]):
        say(f"'x {of}': multiples of the {MEASURES[of]}; in genomes and results the gene is in {unit}")
    say("the effect is off where all genes marked 'size' are zero")


def _role(one: EffectParameter) -> str:
    return "size" if one["is_size"] else "place" if one["is_location"] else "shape"
