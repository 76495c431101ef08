"""Prints a plan as tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wingfit.cli.base.output import Columns, number, percent, records, remarks, say

WORDS = {"stated": "as stated", "recordings": "as seen in the recordings", "default": "a default; state yours"}


def print_plan(plan: Mapping[str, Any]) -> None:
    """Print what will be identified, first the genes, then the effects, then what to add."""
    say(_sampling(plan))
    say(_noise(plan["noise"]))
    say("")
    genes: Columns[Any] = {
        "gene": "name",
        ">value": "value",
        ">standard error": lambda one: number(one["standard_error"], 3),
        "unit": "unit",
        ">relative": lambda one: f"{one['relative_percent']:.2g} %",
        "identified": "identified",
        f">beats for {plan['target_percent']:g} %": lambda one: number(one["beats_for_target"]),
        "correlated with": lambda one: f"{one['correlated_with'] or '–'} ({one['correlation']:+.2f})",
    }
    records(plan["genes"], genes)
    if plan["effects"]:
        say("")
        _print_effects(plan)
    for key, title in (
        ("for_genes", "recordings that add most for the genes"),
        ("for_effects", "recordings that add most to distinguish effects"),
    ):
        if plan[key]:
            say(f"\n{title}:")
            records(plan[key], _PROPOSALS)
    say("")
    records(plan["variants"], _VARIANTS)
    remarks(plan["remarks"])


def _print_effects(plan: Mapping[str, Any]) -> None:
    chance = percent(plan["power"])
    columns: Columns[Any] = {
        "effect": "name",
        f"smallest size seen ({chance})": _smallest,
        ">of typical": lambda one: number(one["smallest_part"], 2),
        ">diagnosed from": lambda one: number(one["diagnosed_part"], 2),
        ">in the genes": lambda one: f"{one['explained_percent']:.0f} %",
        "most like": lambda one: f"{one['rival']} ({one['cosine']:.3f})" if one["rival"] else "–",
        ">distinct from": lambda one: number(one["separable_part"], 2),
    }
    records(plan["effects"], columns)
    if plan["confused"]:
        say("\neffects of typical size that these recordings do not distinguish:")
        pairs: Columns[Any] = {
            "effect": "one",
            "and": "other",
            ">cosine": lambda one: f"{one['cosine']:.4f}",
            ">distinguished": lambda one: percent(one["probability"]),
        }
        records(plan["confused"], pairs)


_PROPOSALS: Columns[Any] = {
    "record": lambda one: one["words"] + (f" (beyond: {', '.join(one['beyond'])})" if one["beyond"] else ""),
    ">standard errors": lambda one: f"x {one['standard_error_factor']:.2f}",
    ">distances of effects": lambda one: f"x {one['separation_factor']:.2f}",
}
_VARIANTS: Columns[Any] = {
    "per recording": lambda one: f"{one['number']} {one['what']}",
    ">standard errors": lambda one: f"x {one['standard_error_factor']:.2f}",
    ">genes identified": "identified",
}


def _smallest(effect: Mapping[str, Any]) -> str:
    size = effect["sizes"][0]
    if size["smallest"] is None:
        return "–"
    unit = "" if size["unit"] == "1" else f" {size['unit']}"
    return f"{size['name'].partition('.')[2]} {number(size['smallest'], 2)}{unit}"


def _sampling(plan: Mapping[str, Any]) -> str:
    count = len(plan["recordings"])
    words = f"plan of {plan['dataset']}: {count} recording{'s' if count > 1 else ''}"
    if plan["kind"] == "series":
        return f"{words}, {number(plan['beats'])} of each, {plan['seconds']:.3g} s in all"
    words += f" of {plan['beats']:.3g} beats and {plan['frames']:.3g} {_FRAMES[plan['kind']]} per beat"
    if plan["markers"]:
        words += f", {plan['markers']} markers"
    return f"{words}; {plan['seconds']:.3g} s of flapping"


_FRAMES = {"tracks": "frames", "forces": "samples"}


def _noise(noise: Mapping[str, Any]) -> str:
    sizes = ", ".join(f"{name} {number(one, 3)}" for name, one in noise["deviation"].items())
    words = f"noise: {sizes}{' ' + noise['unit'] if noise['unit'] else ''}"
    if noise["scatter_percent"] is not None:
        words += f", force {noise['scatter_percent']:.2g} % from beat to beat"
    if noise["correlation"]:
        words += f", correlation of successive frames {noise['correlation']:.2f}"
    return f"{words} ({WORDS.get(noise['source'], noise['source'])})"
