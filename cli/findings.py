"""What a diagnosis found, as people read it in a terminal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from wingfit.cli.base.output import note, number, say, table
from wingfit.cli.base.rounding import force_unit, kept
from wingfit.service.units import MM

Json = dict[str, Any]
SHOWN = 12
NOMINAL = "nothing more (nominal model)"


def print_finding(found: Json) -> None:
    """Verdict, summary, where, ranking, proof, what to record next; remarks on standard error."""
    probable = found["probabilities"].get(found["verdict"])
    about = "" if probable is None else f" ({_probable(probable)})"
    named = f": {', '.join(found['named'])}" if found["named"] else ""
    say(f"verdict: {found['verdict']}{about}{named}")
    say(found["summary"])
    if found["where"]:
        say(f"where: {found['where']['words']}")
    say("")
    _ranking(found)
    if alternatives := [" and ".join(names) for names in found["indistinguishable"]]:
        say(f"these recordings cannot tell apart: {'; '.join(alternatives)}")
    _genes(found)
    if found["law"]:
        say(f"free-form law: {found['law']['words']}")
    if found["proof"]:
        say(f"held out: {found['proof']['words']}")
    if found["advice"]:
        say(f"record next: {found['advice'][0]['words']}")
    for remark in found["remarks"]:
        note(f"note: {remark}")


def _ranking(found: Json) -> None:
    unit, show = _misfits(found)
    columns = ["hypothesis", ">probable", ">ln evidence", ">explains", ">held-out", f">leaves {unit}", "refitted"]
    rows = [
        [
            " + ".join(one["effects"]) or NOMINAL,
            _probable(one["probability"]),
            f"{one['evidence'] + 0.0:.1f}",
            _percent(one["explained"]),
            _percent(one["predicted"]),
            show(one["misfit"]),
            "yes" if one["refitted"] else "no",
        ]
        for one in found["hypotheses"][:SHOWN]
    ]
    table(columns, rows, "no hypothesis was compared")
    if len(found["hypotheses"]) > SHOWN:
        say(f"and {len(found['hypotheses']) - SHOWN} less probable ones; --json or the report has all")


def _genes(found: Json) -> None:
    """Genes of what was found, with their 90 % intervals."""
    rows = [
        [gene["name"], number(gene["value"]["value"]), gene["unit"], _interval(gene["value"]), gene["description"]]
        for gene in found["genes"]
        if gene["name"].partition(".")[0] in found["named"]
    ]
    if rows:
        say("")
        table(["gene", ">value", "unit", "90 % interval", "what it is"], rows)


def _interval(value: Json) -> str:
    low, high = (number(value[end], 3) if value[end] is not None else "open" for end in ("low", "high"))
    return f"[{low}, {high}]"


def _misfits(found: Json) -> tuple[str, Callable[[float | None], str]]:
    """The unit of misfits and how one is shown in it."""
    if found["unit"] == "m":
        return "mm", lambda metres: kept(None if metres is None else MM * metres)
    unit = force_unit(one["misfit"] for one in found["hypotheses"])
    return unit.name, unit.show


def _probable(part: float) -> str:
    """A probability in per cent; what is not certain is not shown as certain."""
    if part < 0.005:
        return "<1 %"
    return _percent(part) if part <= 0.995 else ">99 %"


def _percent(part: float | None) -> str:
    return "–" if part is None else f"{100 * part:.0f} %"
