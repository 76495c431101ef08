"""Write the generated parts of docs/effects: ``python -m docs.generate.effect_pages``.

A page is written by hand except between ``<!-- NAME -->`` and ``<!-- end of NAME -->``: these blocks are generated from
the effect's declaration, and a test fails if they are out of date.
"""

from __future__ import annotations

import argparse
import sys
import textwrap
from collections.abc import Iterable
from pathlib import Path

from wingfit.sim.effects.contract import Effect, Measure, Parameter, Port, RigKind
from wingfit.sim.effects.registry import EFFECTS

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "effects"
INDEX = FOLDER.parent / "effects.md"
_MEASURES: dict[Measure, str] = {"span": "spans", "chord": "mean chords", "mass": "wing masses"}
_PORTS: dict[Port, str] = {
    "inertia": "the inertia of the wing",
    "connector": "the connectors, which join the bodies of the wing",
    "point": "a force or a moment at one place of the wing",
    "drive": "the motion of the drive",
    "air": "the air around the wing",
}
_RIGS: dict[RigKind, str] = {
    "wing": "the wing of the Robird (a robotic bird)",
    "vehicle": "the DelFly (a vehicle with four wings)",
}
_DETAILS = "../effects.md#figures"
_POWERS = {
    "conservative": "The law of the effect conserves energy: over a beat, it neither adds nor removes any.",
    "dissipative": "The law of the effect dissipates energy and never generates any.",
    "any": "The law is declared neither conservative nor dissipative: whether it adds or removes energy is not fixed.",
}
_KINDS = {
    "size": "The effect is off where every gene of the kind *size* is zero.",
    "place": "A *place* says where on the wing the effect acts.",
    "shape": "A *shape* says how the effect acts.",
}


def page_of(name: str) -> Path:
    """Return the path of the page of the effect called ``name``."""
    return FOLDER / f"{name}.md"


def filled(text: str, blocks: dict[str, str]) -> str:
    """Return ``text`` with its named ``blocks`` updated.

    ValueError if ``text`` lacks the pair of comments of a block.
    """
    for name, block in blocks.items():
        opening, closing = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
        before, found, rest = text.partition(opening)
        _, ended, after = rest.partition(closing)
        if not found or not ended:
            raise ValueError(f"no place for {name!r}: put '{opening.strip()}' and '{closing}' on lines of their own")
        text = f"{before}{opening}{block}\n{closing}{after}"
    return text


def blocks_of(effect: Effect) -> dict[str, str]:
    """Return the generated blocks of the page of an effect, by name."""
    law = "\n".join(f"    {line}" for line in effect.law.splitlines())
    return {
        "law": law,
        "genes": genes(effect),
        "signature": signature(effect),
        "power": power(effect),
        "source": source(effect),
    }


def genes(effect: Effect) -> str:
    """Return an explanation and a table of the genes of an effect.

    Bounds that grow with the rig are given as multiples of its span, mean chord or mass.
    """
    kinds = [_kind(effect, one) for one in effect.parameters]
    legend = ["A gene is a parameter that a calibration can fit; the law uses the part of its name after the dot."]
    legend += [text for kind, text in _KINDS.items() if kind in kinds]
    if any(one.scale == "log" for one in effect.parameters):
        legend.append('"Log" means that a search samples the bounds on a logarithmic scale.')
    lines = ["| gene | kind | unit | bounds | typical | what it is |", "|---|---|---|---|---|---|"]
    for one, kind in zip(effect.parameters, kinds, strict=True):
        bounds = f"{one.lower:g} to {one.upper:g}{_of(one)}{', log' if one.scale == 'log' else ''}"
        cells = (f"`{effect.name}.{one.name}`", kind, one.unit, bounds, f"{one.typical:g}{_of(one)}", one.description)
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join([*textwrap.wrap(" ".join(legend), 120), "", *lines])


def _kind(effect: Effect, parameter: Parameter) -> str:
    return "size" if parameter in effect.size else "place" if parameter.place else "shape"


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _of(parameter: Parameter) -> str:
    return f" {_MEASURES[parameter.of]}" if parameter.of else ""


def signature(effect: Effect) -> str:
    """Return how the effect looks in a recording, which effects look alike, and what the page's figure shows."""
    others = ", ".join(f"[{EFFECTS[name].title}]({name}.md)" for name in effect.confused_with)
    rigs = " and ".join(_RIGS[kind] for kind in effect.rigs)
    figure = f"The figure shows the change that the effect makes at its typical size on {rigs} ([details]({_DETAILS}))."
    return f"{_capital(effect.signature)}. Effects that look similar: {others}.\n\n{figure}"


def power(effect: Effect) -> str:
    """Return a text on where the effect acts (its port), the energy that it exchanges, and its internal states."""
    memory = f"Internal states: {effect.memory}." if effect.memory else "The effect has no internal states."
    if effect.port == "observation":
        text = "Port: observation. The effect changes simulated recordings, not the motion, and exchanges no energy."
    else:
        text = f"Port: {effect.port}. The effect acts through {_PORTS[effect.port]}. {_power_of(effect)}"
    return "\n".join(textwrap.wrap(f"{text} {memory}", 120))


def _power_of(effect: Effect) -> str:
    law = _POWERS[effect.power]
    in_air = effect.family == "aerodynamics" and effect.power != "any"
    return f"In still air, {law[0].lower()}{law[1:]}" if in_air else law


def source(effect: Effect) -> str:
    """Return a text with the source of the effect's law, and its test file."""
    (tests,) = (ROOT / "tests" / "sim" / "effects").glob(f"*/test_{effect.name}.py")
    return f"{_capital(effect.source)}.\n\nTests: `{tests.relative_to(ROOT)}`."


def index() -> str:
    """Return a table of all effects."""
    lines = ["| effect | family | acts on | what it looks like | similar effects |", "|---|---|---|---|---|"]
    for effect in EFFECTS.values():
        others = ", ".join(f"[{name}](effects/{name}.md)" for name in effect.confused_with)
        cells = (
            f"[{effect.name}](effects/{effect.name}.md)",
            effect.family,
            ", ".join(effect.rigs),
            effect.signature,
            others,
        )
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines)


def files(names: Iterable[str]) -> dict[Path, dict[str, str]]:
    """Return the generated blocks of every file, by path: of the index, and of the pages of the effects ``names``."""
    return {INDEX: {"effects": index()}} | {page_of(name): blocks_of(EFFECTS[name]) for name in names}


def main() -> None:
    """Update the generated blocks of all pages, and print the paths of changed files."""
    argparse.ArgumentParser(prog="python -m docs.generate.effect_pages", description=__doc__).parse_args()
    for file, blocks in files(EFFECTS).items():
        text = file.read_text(encoding="utf-8")
        try:
            fresh = filled(text, blocks)
        except ValueError as error:
            sys.exit(f"{file}: {error}")
        if fresh != text:
            file.write_text(fresh, encoding="utf-8")
            print(file)


if __name__ == "__main__":
    main()
