"""``wingfit effects``: what a model can be made to contain; and the option that names effects."""

from __future__ import annotations

from typing import Annotated

import typer

from wingfit.cli.base.output import AsJson, Url, number, print_json, say, table
from wingfit.client.client import DEFAULT_URL, Client
from wingfit.client.effect_answers import Effect, EffectParameter

With = Annotated[
    list[str] | None,
    typer.Option("--with", help="Include these effects of 'wingfit effects', e.g. added_mass,hinge_offset."),
]

MEASURES = {"span": "span", "chord": "mean chord", "mass": "mass of the wing"}


def names(words: list[str] | None) -> list[str] | None:
    """Effects named in ``words``, each of which may name several, separated by commas; None where none is."""
    found = [name.strip() for word in words or [] for name in word.split(",")]
    if "" in found:
        raise typer.BadParameter(
            "an effect without a name; give names of 'wingfit effects', such as added_mass,hinge_offset, or leave the "
            "option out",
            param_hint="--with",
        )
    return found or None


def effects(
    name: Annotated[str | None, typer.Argument(help="An effect, for its details; all if left out.")] = None,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """List the effects that a run or a simulation can include with --with, or describe one of them.

    Example: wingfit effects hinge_offset
    """
    with Client(url) as client:
        found = [client.effect(name)] if name else client.effects()
    if as_json:
        print_json(found[0] if name else found)
    elif name:
        _describe(found[0])
    else:
        columns = ["effect", "family", "of", "genes", "what it looks like"]
        table(columns, [[e["name"], e["family"], _of(e), _genes(e), e["signature"]] for e in found])


def _of(effect: Effect) -> str:
    return " ".join(effect["applies_to"])


def _genes(effect: Effect) -> str:
    return " ".join(parameter["name"].partition(".")[2] for parameter in effect["parameters"])


def _describe(effect: Effect) -> None:
    rows = [
        ["effect", f"{effect['name']}: {effect['title']}"],
        ["family", effect["family"]],
        ["acts on", f"{effect['port']} of a {' or '.join(effect['applies_to'])}"],
        ["power", "any" if effect["power"] == "any" else f"{effect['power']} only"],
        ["memory", effect["memory"] or "none"],
        ["source", effect["source"]],
        ["looks like", effect["signature"]],
        ["confused with", ", ".join(effect["confused_with"]) or "–"],
    ]
    table(["", ""], rows)
    say("")
    columns = ["gene", ">typical", "bounds", "unit", "what it is"]
    table(columns, [_row(parameter) for parameter in effect["parameters"]])
    for of, unit in dict.fromkeys((p["relative_to"], p["unit"]) for p in effect["parameters"] if p["relative_to"]):
        say(f"'x {of}' is in parts of the {MEASURES[of]}; in genomes and results the gene is in {unit}")
    say("zero in all genes marked 'size' switches it off; fit it: wingfit runs submit ID --with " + effect["name"])


def _row(one: EffectParameter) -> list[str]:
    unit = one["unit"] if one["relative_to"] is None else f"x {one['relative_to']}"
    bounds = f"[{number(one['lower'], 3)}, {number(one['upper'], 3)}]"
    role = "size" if one["is_size"] else "place" if one["is_location"] else "shape"
    return [one["name"], number(one["typical"], 3), bounds, unit, f"{one['description']} ({role})"]
