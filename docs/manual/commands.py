"""Writes the reference of the command line from the help of the commands themselves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import typer

from wingfit.cli.main import app

BAR = "\\|"  # as a table needs it
_HEAD = """# Command line

What `wingfit COMMAND --help` prints. [Commands by task](../docs/commands.md) has examples."""


def page() -> str:
    """Return the page in Markdown: one section for each command."""
    command: Any = typer.main.get_command(app)
    context = command.context_class(command, info_name="wingfit")
    return "\n\n".join([_HEAD, *_sections(command, context)]) + "\n"


def _sections(group: Any, context: Any) -> Iterator[str]:
    for name in sorted(group.commands):
        command = group.commands[name]
        if command.hidden:
            continue
        inner = command.context_class(command, parent=context, info_name=name)
        if hasattr(command, "commands"):
            yield f"## `{inner.command_path}`\n\n{_prose(command.help)}"
            yield from _sections(command, inner)
        else:
            yield _section(command, inner)


def _section(command: Any, context: Any) -> str:
    level = "##" if context.parent.parent is None else "###"
    usage = " ".join([context.command_path, *command.collect_usage_pieces(context)])
    rows = [_row(one, context) for one in command.params if not one.hidden]
    parts = [f"{level} `{context.command_path}`", _prose(command.help), f"```text\n{usage}\n```"]
    if rows:
        parts.append("\n".join(["| argument or option | what it is |", "|---|---|", *rows]))
    return "\n\n".join(parts)


def _row(parameter: Any, context: Any) -> str:
    names, text = parameter.get_help_record(context)
    return f"| `{names.replace('|', BAR)}` | {_escaped(' '.join(text.split()))} |"


def _prose(text: str | None) -> str:
    """Return a help text as Markdown, with its examples as code."""
    lines = []
    for paragraph in (text or "").split("\n\n"):
        words = " ".join(paragraph.split())
        head, found, example = words.partition("Example: ")
        lines.append(f"{_escaped(head)}Example: `{example}`" if found else _escaped(words))
    return "\n\n".join(lines)


def _escaped(text: str) -> str:
    for sign in "\\*_<[|":
        text = text.replace(sign, f"\\{sign}")
    return text
