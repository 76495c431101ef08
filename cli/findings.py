"""Prints the finding (result) of a diagnosis."""

from __future__ import annotations

from typing import Any

from wingfit.cli.base.output import Columns, interval, percent, records, remarks, say
from wingfit.cli.base.rounding import Unit, force_unit
from wingfit.service.units import MM

Json = dict[str, Any]
SHOWN = 12
SHOWN_ADVICE = 3
NOMINAL = "nominal model alone"


def print_finding(finding: Json) -> None:
    """Print a finding: verdict, summary, location of the residual, ranking of hypotheses, validation, next recording.

    Remarks are printed to standard error.
    """
    probability = finding["probabilities"].get(finding["verdict"])
    about = "" if probability is None else f" ({_probability(probability)})"
    named = f": {', '.join(finding['named'])}" if finding["named"] else ""
    say(f"verdict: {finding['verdict']}{about}{named}")
    say(finding["summary"])
    if finding["where"]:
        say(f"location: {finding['where']['words']}")
    say("")
    _ranking(finding)
    if alternatives := [" and ".join(names) for names in finding["indistinguishable"]]:
        say(f"not distinguishable by these recordings: {'; '.join(alternatives)}")
    _genes(finding)
    for key, label in (("law", "free-form law of the residual"), ("proof", "held-out recordings")):
        if finding[key]:
            say(f"{label}: {finding[key]['words']}")
    for rank, one in enumerate(finding["advice"][:SHOWN_ADVICE]):
        say(f"{'or' if rank else 'next recording'}: {one['words']}")
    remarks(finding["remarks"])


def _ranking(finding: Json) -> None:
    hypotheses = finding["hypotheses"]
    misfits = [one["misfit"] for one in hypotheses]
    unit = {"m": Unit("mm", MM), "noise": Unit("/ noise", 1.0)}.get(finding["unit"]) or force_unit(misfits)
    columns: Columns[Json] = {
        "hypothesis": lambda one: " + ".join(one["effects"]) or NOMINAL,
        ">probability": lambda one: _probability(one["probability"]),
        ">ln evidence": lambda one: f"{one['evidence'] + 0.0:.1f}",
        ">explained": lambda one: percent(one["explained"]),
        ">predicted": lambda one: percent(one["predicted"]),
        f">residual {unit.name}": lambda one: unit.show(one["misfit"]),
        "refitted": "refitted",
    }
    records(hypotheses[:SHOWN], columns, "no hypothesis was compared")
    if len(hypotheses) > SHOWN:
        say(f"{len(hypotheses) - SHOWN} less probable hypotheses are not shown; --json and the report list all")


def _genes(finding: Json) -> None:
    """Print the genes of the effects that the verdict names, with their 90 % intervals."""
    columns: Columns[Json] = {
        "gene": "name",
        ">value": lambda gene: gene["value"]["value"],
        "unit": "unit",
        "90 % interval": lambda gene: interval(gene["value"]["low"], gene["value"]["high"]),
        "description": "description",
    }
    genes = [gene for gene in finding["genes"] if any(gene["name"].startswith(f"{name}.") for name in finding["named"])]
    if genes:
        say("")
        records(genes, columns)


def _probability(part: float) -> str:
    """Return the probability ``part`` (a fraction) in per cent; "<1 %" or ">99 %" instead of 0 or 100 %."""
    if part < 0.005:
        return "<1 %"
    return percent(part) if part <= 0.995 else ">99 %"
