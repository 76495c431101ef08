"""The documents and their code blocks.

A fence says in its info string what is done with the block: its language, then any of

- ``file=PATH``: the block is written to that file of the folder in which the page's commands run;
- ``model=NAME``: a JSON block is validated against that schema of ``/openapi.json``;
- ``no-run: REASON``: the block is not run; its commands and options must exist.

A ``text`` block is the output of the block before it. A ``console`` block holds ``$ command`` lines and their outputs.
An indented block is a formula, but for the pages in NOT_RUN, where it holds commands.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).parents[2]
PAGES = tuple(
    path.relative_to(ROOT).as_posix() for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
)

# Pages none of whose blocks run, with the reason. Everything else is decided block by block.
NOT_RUN = {
    "docs/deployment.md": "other machines, containers and clusters are needed",
    "docs/security.md": "the fuzzer is not among the tools of development, and takes minutes",
}


@dataclass(frozen=True)
class Block:
    """One code block of a page; ``reason`` says why it is not run, and is empty for one that is."""

    page: str
    line: int
    language: str
    text: str
    file: str
    model: str
    reason: str

    @property
    def place(self) -> str:
        return f"{self.page}:{self.line}"


def tokens(page: str) -> Sequence[Token]:
    """Everything in a page, in its order."""
    return MarkdownIt("commonmark").enable("table").parse((ROOT / page).read_text(encoding="utf-8"))


def blocks(page: str) -> list[Block]:
    """The code blocks of a page, in their order."""
    return [_block(page, token) for token in tokens(page) if token.type in ("fence", "code_block")]


def inline_code(page: str) -> list[str]:
    """What stands between single backquotes in a page."""
    children = [child for token in tokens(page) for child in token.children or ()]
    return [child.content for child in children if child.type == "code_inline"]


def _block(page: str, token: Token) -> Block:
    formula = token.type == "code_block" and page not in NOT_RUN
    info, _, reason = ("formula" if formula else token.info).partition("no-run:")
    language, *attributes = info.split() or [""]
    given = dict(attribute.split("=", 1) for attribute in attributes)
    unknown = set(given) - {"file", "model"}
    assert not unknown, f"{page}: unknown words in the info string {token.info!r}: {unknown}"
    assert token.map is not None
    return Block(
        page=page,
        line=token.map[0] + 1,
        language=language,
        text=token.content,
        file=given.get("file", ""),
        model=given.get("model", ""),
        reason=reason.strip() or NOT_RUN.get(page, ""),
    )


def commands(block: Block) -> list[tuple[str, str]]:
    """The commands of a shell block, each with the output that the page shows for it (empty where it shows none)."""
    text = re.sub(r" *\\\n\s*", " ", block.text)
    if block.language != "console":
        return [(line, "") for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    first, *pairs = re.split(r"^\$ (.*)\n?", text, flags=re.MULTILINE)
    assert not first.strip(), f"{block.place}: a console block must begin with '$ '"
    return list(zip(pairs[::2], pairs[1::2], strict=True))
