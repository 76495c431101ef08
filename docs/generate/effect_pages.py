"""Write the generated parts of docs/effects: ``python -m docs.generate.effect_pages``.

A page is written by hand except between ``<!-- NAME -->`` and ``<!-- end of NAME -->``: these blocks are generated from
the effect's declaration, and a test fails where they are stale.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path

from wingfit.sim.effects.contract import Effect, Measure, Parameter
from wingfit.sim.effects.registry import EFFECTS

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "effects"
INDEX = FOLDER.parent / "effects.md"
_MEASURES: dict[Measure, str] = {"span": "spans", "chord": "mean chords", "mass": "wing masses"}
_POWERS = {
    "conservative": "It conserves energy: over a beat it neither gives nor takes any.",
    "dissipative": "It only takes energy.",
    "any": "It may give or take energy.",
}


def page_of(name: str) -> Path:
    """The page of an effect."""
    return FOLDER / f"{name}.md"


def filled(text: str, blocks: dict[str, str]) -> str:
    """``text`` with its named ``blocks`` updated; ValueError for a block without its pair of comments in it."""
    for name, block in blocks.items():
        opening, closing = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
        before, found, rest = text.partition(opening)
        _, ended, after = rest.partition(closing)
        if not found or not ended:
            raise ValueError(f"no place for {name!r}: put '{opening.strip()}' and '{closing}' on lines of their own")
        text = f"{before}{opening}{block}\n{closing}{after}"
    return text


def blocks_of(effect: Effect) -> dict[str, str]:
    """Generated blocks of the page of an effect, by name."""
    law = "\n".join(f"    {line}" for line in effect.law.splitlines())
    return {
        "law": law,
        "genes": genes(effect),
        "signature": signature(effect),
        "power": power(effect),
        "source": source(effect),
    }


def genes(effect: Effect) -> str:
    """Table of the genes. Bounds that grow with the rig are multiples of its span, mean chord or wing mass."""
    lines = ["| gene | kind | unit | bounds | typical | what it is |", "|---|---|---|---|---|---|"]
    for one in effect.parameters:
        kind = "size" if one in effect.size else "place" if one.place else "shape"
        bounds = f"{one.lower:g} to {one.upper:g}{_of(one)}{', log' if one.scale == 'log' else ''}"
        cells = (f"`{effect.name}.{one.name}`", kind, one.unit, bounds, f"{one.typical:g}{_of(one)}", one.description)
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines)


def _of(parameter: Parameter) -> str:
    return f" {_MEASURES[parameter.of]}" if parameter.of else ""


def signature(effect: Effect) -> str:
    """How it looks in a recording, and the effects that look alike."""
    others = ", ".join(f"[{EFFECTS[name].title}]({name}.md)" for name in effect.confused_with)
    return f"{effect.signature[0].upper()}{effect.signature[1:]}. Easily confused with: {others}."


def power(effect: Effect) -> str:
    """Port, energy exchange and internal states."""
    memory = f"Internal states: {effect.memory}." if effect.memory else "It has no internal states."
    if effect.port == "observation":
        return f"Port: observation. It acts after the simulation and exchanges no energy. {memory}"
    return f"Port: {effect.port}. {_POWERS[effect.power]} {memory}"


def source(effect: Effect) -> str:
    """Source of the law, and its test file."""
    (tests,) = (ROOT / "tests" / "sim" / "effects").glob(f"*/test_{effect.name}.py")
    return f"{effect.source}.\n\nTests: `{tests.relative_to(ROOT)}`."


def index() -> str:
    """Table of all effects."""
    lines = ["| effect | family | acts on | looks like | confused with |", "|---|---|---|---|---|"]
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
    """Generated blocks of every file: the index and the pages of ``names``."""
    return {INDEX: {"effects": index()}} | {page_of(name): blocks_of(EFFECTS[name]) for name in names}


def main() -> None:
    """Command line."""
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
